//! The stages of the method: the table of all stages, and a descriptor of each.
//!
//! A row of [`for_every_stage`](crate::for_every_stage) gives the variant of [`Stage`] and the name of its
//! files: `stage/NAME.rs` with its exact definition and its [`Descriptor`], `backend/cpu/stages/NAME.rs`,
//! `backend/gpu/stages/NAME.rs`, `shaders/NAME.wgsl`, and the twin and the test. All lists of stages are
//! generated from this table.

mod data;
mod map;
mod map_set;
mod memory;
mod volume;

use crate::plan::Plan;
pub(crate) use data::{Array, Extent, Place};
pub use data::{Data, Start};
pub(crate) use map::NO_RUNNER_UP;
pub use map::{Map, NO_ANCHOR, NO_LABEL};
pub(crate) use map_set::{MapSet, Optimum};
pub(crate) use volume::PaddedRows;
pub use volume::{Volume, volume_shape};

/// Calls the macro `$then` with all rows: stages that run at a level, stages on the volumes of level 0 (in
/// both groups, those that can run on bands of rows come separately), and map stages in the order of a match.
#[doc(hidden)]
#[macro_export]
macro_rules! for_every_stage {
    ($then:ident) => {
        $then! {
            levels {
                Graph graph; Pyramid pyramid; LabelRange label_range; LabelWindow label_window; Flood flood; Guess guess;
            }
            level_rows { Evidence evidence; Prior prior; Dependency dependency; Resolution resolution; Belief belief; }
            finest { Cost cost; Change change; Refine refine; SwapViews swap_views; MirrorLabels mirror_labels; }
            finest_rows { WinnerTakesAll winner_takes_all; Lead lead; RightView right_view; SubPixel sub_pixel; }
            maps {
                LeftRightCheck left_right_check; SpeckleFilter speckle_filter; Confidence confidence; Anchor anchor;
                Fill fill; VoteFill vote_fill; FillPlane fill_plane; Median median; Plane plane; Support support;
                FarPlane far_plane; Enlarge enlarge;
            }
        }
    };
}

/// Approximate share of the labels in the windows of a level that follow beliefs.
const KEPT: f64 = 0.35;

/// Properties of a stage that hold for every backend.
pub struct Descriptor {
    /// Data that it reads at a level; those that do not exist there are skipped.
    pub reads: fn(usize) -> Vec<Data>,
    /// Data that it writes at a level.
    pub writes: fn(usize) -> Vec<Data>,
    /// Scratch memory on a device: written before it is read, and unused after the stage.
    pub needs: fn(usize) -> Vec<Data>,
    /// Number of rows around its own that it reads at its level; `None` if it cannot run on a band of rows.
    /// (Resolution counts rows of the coarser level, and reads and writes those of their children too.)
    pub reach: Option<usize>,
    /// Whether it may run at several levels at once, because no level depends on its results at another.
    pub joins: bool,
    /// Whether a match by this plan uses it. Only consulted for map stages.
    pub taken: fn(&Plan) -> bool,
    /// Approximate time on one thread, in ns per pixel of its level.
    pub pixel: f64,
    /// Additional time in ns per cell (label of a pixel) of its level.
    pub cell: f64,
}

impl Descriptor {
    /// A stage that reads and writes nothing, and takes no time.
    pub(crate) const NONE: Self = Self {
        reads: |_| Vec::new(),
        writes: |_| Vec::new(),
        needs: |_| Vec::new(),
        reach: None,
        joins: false,
        taken: |_| true,
        pixel: 0.0,
        cell: 0.0,
    };
}

fn volumes(volumes: &[Volume]) -> Vec<Data> {
    volumes.iter().copied().map(Data::Volume).collect()
}

fn maps(maps: &[Map]) -> Vec<Data> {
    maps.iter().copied().map(Data::Map).collect()
}

macro_rules! define {
    (
        levels { $( $level:ident $level_name:ident; )* }
        level_rows { $( $level_row:ident $level_row_name:ident; )* }
        finest { $( $finest:ident $finest_name:ident; )* }
        finest_rows { $( $finest_row:ident $finest_row_name:ident; )* }
        maps { $( $map:ident $map_name:ident; )* }
    ) => {
        $( pub(crate) mod $level_name; )*
        $( pub(crate) mod $level_row_name; )*
        $( pub(crate) mod $finest_name; )*
        $( pub(crate) mod $finest_row_name; )*
        $( pub(crate) mod $map_name; )*

        /// A stage of the method, with its level if it has one. The module of the same name holds its exact definition, which
        /// the CPU path, the shader and the naive twin in the tests implement independently.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Stage {
            $( #[doc = concat!("Defined in `", stringify!($level_name), "`.")] $level(usize), )*
            $( #[doc = concat!("Defined in `", stringify!($level_row_name), "`.")] $level_row(usize), )*
            $( #[doc = concat!("Defined in `", stringify!($finest_name), "`.")] $finest, )*
            $( #[doc = concat!("Defined in `", stringify!($finest_row_name), "`.")] $finest_row, )*
            $( #[doc = concat!("Defined in `", stringify!($map_name), "`.")] $map, )*
        }

        impl Stage {
            /// Every stage that exists for `plan`, whether its method uses it or not.
            #[must_use]
            pub fn all(plan: &Plan) -> Vec<Self> {
                let of_level = (0..plan.levels.len())
                    .flat_map(|z| [$( Self::$level(z), )* $( Self::$level_row(z) ),*]);
                let is_there = |stage: &Self| match stage {
                    Self::Pyramid(z) | Self::Resolution(z) => *z > 0,
                    Self::LabelRange(_) => plan.limits_labels(),
                    Self::Prior(_) => plan.has_priors(),
                    Self::Guess(_) | Self::Lead => plan.looks() > 1,
                    Self::Anchor => plan.prior,
                    Self::Refine | Self::Enlarge => plan.full.is_some(),
                    _ => true,
                };
                let finest = [$( Self::$finest, )* $( Self::$finest_row, )* $( Self::$map ),*];
                of_level.chain(finest).filter(is_there).collect()
            }

            /// The map stages, in order.
            pub const OF_MAPS: &[Self] = &[$( Self::$map ),*];

            /// The name of the stage and of its files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$level(_) => stringify!($level_name), )*
                    $( Self::$level_row(_) => stringify!($level_row_name), )*
                    $( Self::$finest => stringify!($finest_name), )*
                    $( Self::$finest_row => stringify!($finest_row_name), )*
                    $( Self::$map => stringify!($map_name), )*
                }
            }

            /// The properties of the stage.
            #[must_use]
            pub fn descriptor(self) -> &'static Descriptor {
                match self {
                    $( Self::$level(_) => &$level_name::ROW, )*
                    $( Self::$level_row(_) => &$level_row_name::ROW, )*
                    $( Self::$finest => &$finest_name::ROW, )*
                    $( Self::$finest_row => &$finest_row_name::ROW, )*
                    $( Self::$map => &$map_name::ROW, )*
                }
            }

            /// Whether it is a map stage: one that reads no volumes, only maps, the left image and tables.
            #[must_use]
            pub fn is_of_maps(self) -> bool {
                Self::OF_MAPS.contains(&self)
            }

            /// The level that it runs at; `None` if it exists at the finest level only.
            #[must_use]
            pub fn level(self) -> Option<usize> {
                match self {
                    $( Self::$level(z) )|* => Some(z),
                    $( Self::$level_row(z) )|* => Some(z),
                    _ => None,
                }
            }

            /// This stage at a level coarser by `coarser`.
            #[must_use]
            pub fn coarser(self, coarser: usize) -> Self {
                match self {
                    $( Self::$level(z) => Self::$level(z + coarser), )*
                    $( Self::$level_row(z) => Self::$level_row(z + coarser), )*
                    finest => finest,
                }
            }
        }
    };
}

for_every_stage!(define);

impl Stage {
    /// The data that it reads, if they exist in `plan`.
    pub fn reads(self, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        // Before the first guess, only a prior from elsewhere is there.
        let is_there = move |data: &Data| plan.prior || (self, *data) != (Self::Guess(0), Data::Prior(0));
        self.of_plan(self.descriptor().reads, plan).filter(is_there)
    }

    /// The data that it writes.
    pub fn writes(self) -> impl Iterator<Item = Data> + use<> {
        (self.descriptor().writes)(self.level().unwrap_or(0)).into_iter()
    }

    /// Its scratch memory on a device, if it exists in `plan`.
    pub fn needs(self, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        self.of_plan(self.descriptor().needs, plan)
    }

    fn of_plan(self, data: fn(usize) -> Vec<Data>, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        data(self.level().unwrap_or(0)).into_iter().filter(|data| data.is_there(plan))
    }

    /// Whether a match by `plan` uses it. Only called for map stages.
    #[must_use]
    pub fn is_taken(self, plan: &Plan) -> bool {
        (self.descriptor().taken)(plan)
    }

    /// The volumes that it reads or writes, repeated for each use.
    pub fn volumes(self, plan: &Plan) -> impl Iterator<Item = Volume> + use<'_> {
        self.reads(plan).chain(self.writes()).filter_map(Data::volume)
    }

    /// Whether it needs volumes of level 0 that are not stored if only some rows are held. (Costs are
    /// computed where they are needed.)
    #[must_use]
    pub fn needs_level_0(self, plan: &Plan) -> bool {
        self.volumes(plan).any(|volume| volume.level() == 0 && volume != Volume::Cost(0))
    }

    /// Whether it computes messages or beliefs from others, so that it runs in every iteration.
    #[must_use]
    pub fn passes_messages(self) -> bool {
        self.descriptor().joins && self.writes().any(|data| data.volume().is_some())
    }

    /// The finest level that it reads or writes.
    #[must_use]
    pub fn finest_level(self, plan: &Plan) -> usize {
        self.volumes(plan).map(Volume::level).chain(self.level()).min().unwrap_or(0)
    }

    /// Approximate time on one thread, in ns.
    #[must_use]
    pub fn work(self, plan: &Plan) -> f64 {
        let z = self.level().unwrap_or(0);
        let level = &plan.levels[z];
        let &Descriptor { pixel, cell, .. } = self.descriptor();
        // Costs are computed for all labels, what follows only within the label windows.
        let windowed = plan.windows_follow_beliefs(z)
            && self.volumes(plan).any(|volume| volume.level() == z && volume != Volume::Cost(z));
        let cells = if windowed { KEPT } else { 1.0 } * level.cells() as f64;
        pixel * level.pixels() as f64 + cell * cells
    }
}
