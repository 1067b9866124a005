//! The stages of the method: the one table that lists them, and what is true of each.
//!
//! A row of [`for_every_stage`](crate::for_every_stage) gives the variant of [`Stage`] and the name of its files: `stage/NAME.rs`
//! with its exact definition and its [`Descriptor`], `backend/cpu/stages/NAME.rs`, `backend/gpu/stages/NAME.rs`, `shaders/NAME.wgsl`, and the
//! twin and the test of that name. Whatever needs a list of all stages follows from this table.

mod data;
mod map_set;
mod memory;

use crate::options::Method;
use crate::plan::Plan;
pub(crate) use data::PaddedRows;
pub use data::{Array, Data, Extent, Map, NO_LABEL, NO_RUNNER_UP, Place, Start, Volume, volume_shape};
pub(crate) use map_set::{MapSet, Optimum};

/// Calls the macro `$then` with all rows: the stages that run at a level and those that run on the volumes of level 0, of both kinds
/// apart the ones that can go row by row, and the stages that look at maps alone, in the order in which a match runs them.
#[doc(hidden)]
#[macro_export]
macro_rules! for_every_stage {
    ($then:ident) => {
        $then! {
            levels {
                Graph graph; Pyramid pyramid; LabelRange label_range; LabelWindow label_window; Flood flood;
            }
            level_rows { Evidence evidence; Dependency dependency; Resolution resolution; Belief belief; }
            finest { Cost cost; Change change; Refine refine; SwapViews swap_views; MirrorLabels mirror_labels; }
            finest_rows { WinnerTakesAll winner_takes_all; RightView right_view; SubPixel sub_pixel; }
            maps {
                LeftRightCheck left_right_check; SpeckleFilter speckle_filter; Confidence confidence; Fill fill;
                VoteFill vote_fill; FillPlane fill_plane; Median median; Plane plane; Support support; FarPlane far_plane;
                Enlarge enlarge;
            }
        }
    };
}

/// What is true of a stage, whoever runs it.
pub struct Descriptor {
    /// What it reads at a level, and what it writes. What a level does not have is not read.
    pub reads: fn(usize) -> Vec<Data>,
    /// What it writes at a level.
    pub writes: fn(usize) -> Vec<Data>,
    /// Scratch memory of a device: written before it is read, and not needed once the stage has run.
    pub needs: fn(usize) -> Vec<Data>,
    /// How many rows around its own, of its level, it reads; `None` where it does not go row by row. (Resolution goes by rows of
    /// the coarser level, and reads and writes those of their children.)
    pub reach: Option<usize>,
    /// Whether it may run at several levels at once: no level waits for what it does at another.
    pub joins: bool,
    /// Whether a match by a method runs it. Asked of the stages that look at maps alone.
    pub taken: fn(&Method) -> bool,
    /// About how long it takes on one thread, in ns: for a pixel of its level.
    pub pixel: f64,
    /// And for a cell of its level: a label of a pixel.
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

/// Volumes, as data.
fn volumes(volumes: &[Volume]) -> Vec<Data> {
    volumes.iter().copied().map(Data::Volume).collect()
}

/// Maps, as data.
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
        $( pub mod $level_name; )*
        $( pub mod $level_row_name; )*
        $( pub mod $finest_name; )*
        $( pub mod $finest_row_name; )*
        $( pub mod $map_name; )*

        /// A stage of the method, with its level where it has one. The module of its name holds its exact definition, which the
        /// CPU path, the shader and the naive twin in the tests follow independently.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Stage {
            $( #[doc = concat!("See [`", stringify!($level_name), "`].")] $level(usize), )*
            $( #[doc = concat!("See [`", stringify!($level_row_name), "`].")] $level_row(usize), )*
            $( #[doc = concat!("See [`", stringify!($finest_name), "`].")] $finest, )*
            $( #[doc = concat!("See [`", stringify!($finest_row_name), "`].")] $finest_row, )*
            $( #[doc = concat!("See [`", stringify!($map_name), "`].")] $map, )*
        }

        impl Stage {
            /// Every stage that there is for `plan`, whether its method takes it or not.
            #[must_use]
            pub fn all(plan: &Plan) -> Vec<Self> {
                let of_level = (0..plan.levels.len())
                    .flat_map(|z| [$( Self::$level(z), )* $( Self::$level_row(z) ),*]);
                let is_there = |stage: &Self| match stage {
                    Self::Pyramid(z) | Self::Resolution(z) => *z > 0,
                    Self::LabelRange(_) => plan.limits_labels(),
                    Self::Refine | Self::Enlarge => plan.full.is_some(),
                    _ => true,
                };
                let finest = [$( Self::$finest, )* $( Self::$finest_row, )* $( Self::$map ),*];
                of_level.chain(finest).filter(is_there).collect()
            }

            /// The stages that look at maps alone, in order.
            pub const OF_MAPS: &[Self] = &[$( Self::$map ),*];

            /// Its name: that of its files.
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

            /// What is true of it.
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

            /// Whether it looks at maps alone, and at the left image in the sizes that there are.
            #[must_use]
            pub fn is_of_maps(self) -> bool {
                Self::OF_MAPS.contains(&self)
            }

            /// The level that it runs at; `None` for what there is at the finest one alone.
            #[must_use]
            pub fn level(self) -> Option<usize> {
                match self {
                    $( Self::$level(z) )|* => Some(z),
                    $( Self::$level_row(z) )|* => Some(z),
                    _ => None,
                }
            }

            /// The same stage at the level that is `coarser` levels coarser.
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
    /// The data that it reads, of those that there are under `plan`.
    pub fn reads(self, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        self.of_plan(self.descriptor().reads, plan)
    }

    /// The data that it writes.
    pub fn writes(self) -> impl Iterator<Item = Data> + use<> {
        (self.descriptor().writes)(self.level().unwrap_or(0)).into_iter()
    }

    /// Its scratch memory on a device, of what there is under `plan`.
    pub fn needs(self, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        self.of_plan(self.descriptor().needs, plan)
    }

    fn of_plan(self, data: fn(usize) -> Vec<Data>, plan: &Plan) -> impl Iterator<Item = Data> + use<'_> {
        data(self.level().unwrap_or(0)).into_iter().filter(|data| data.is_there(plan))
    }

    /// Whether a match by `method` runs it. Only asked of stages that look at maps alone.
    #[must_use]
    pub fn is_taken(self, method: &Method) -> bool {
        (self.descriptor().taken)(method)
    }

    /// The volumes that it reads or writes, each once a use.
    pub fn volumes(self, plan: &Plan) -> impl Iterator<Item = Volume> + use<'_> {
        self.reads(plan).chain(self.writes()).filter_map(Data::volume)
    }

    /// Whether it needs volumes of level 0 that are not there where not all of its rows are held. (Costs alone are computed where
    /// they are needed.)
    #[must_use]
    pub fn needs_level_0(self, plan: &Plan) -> bool {
        self.volumes(plan).any(|volume| volume.level() == 0 && volume != Volume::Cost(0))
    }

    /// Whether it computes messages or beliefs from others: what is done again in every iteration.
    #[must_use]
    pub fn passes_messages(self) -> bool {
        self.descriptor().joins && self.writes().any(|data| data.volume().is_some())
    }

    /// The finest level that it touches.
    #[must_use]
    pub fn finest_level(self, plan: &Plan) -> usize {
        self.volumes(plan).map(Volume::level).chain(self.level()).min().unwrap_or(0)
    }

    /// About how long it takes on one thread, in ns.
    #[must_use]
    pub fn work(self, plan: &Plan) -> f64 {
        let level = &plan.levels[self.level().unwrap_or(0)];
        let &Descriptor { pixel, cell, .. } = self.descriptor();
        pixel * level.pixels() as f64 + cell * level.cells() as f64
    }
}
