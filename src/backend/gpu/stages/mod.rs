//! The stages on a device, each in the file of its name.

mod pack;
mod upload;

use super::commands::Recorder;
use super::kernel::Kernel;
use crate::error::Result;
use crate::plan::Plan;
use crate::stage::Stage;
use std::ops::Range;
pub(super) use upload::Unpacking;

macro_rules! declare {
    (
        levels { $( $level:ident $level_name:ident; )* }
        level_rows { $( $level_row:ident $level_row_name:ident; )* }
        finest { $( $finest:ident $finest_name:ident; )* }
        finest_rows { $( $finest_row:ident $finest_row_name:ident; )* }
        maps { $( $map:ident $map_name:ident; )* }
    ) => {
        $( mod $level_name; )*
        $( mod $level_row_name; )*
        $( mod $finest_name; )*
        $( mod $finest_row_name; )*
        $( mod $map_name; )*

        /// The kernels of `stage` for `plan`; needs no device.
        #[must_use]
        pub fn kernels(stage: Stage, plan: &Plan) -> Vec<Kernel> {
            match stage {
                $( Stage::$level(z) => $level_name::kernels(plan, z), )*
                $( Stage::$level_row(z) => $level_row_name::kernels(plan, z), )*
                $( Stage::$finest => $finest_name::kernels(plan, 0), )*
                $( Stage::$finest_row => $finest_row_name::kernels(plan, 0), )*
                $( Stage::$map => $map_name::kernels(plan, 0), )*
            }
        }

        pub(super) fn record(recorder: &mut Recorder, stage: Stage) -> Result<()> {
            match stage {
                $( Stage::$level(_) => $level_name::record(recorder), )*
                $( Stage::$level_row(_) => $level_row_name::record(recorder), )*
                $( Stage::$finest => $finest_name::record(recorder), )*
                $( Stage::$finest_row => $finest_row_name::record(recorder), )*
                $( Stage::$map => $map_name::record(recorder), )*
            }
        }
    };
}

crate::for_every_stage!(declare);

/// The kernels of a match by `plan` that belong to no stage.
#[must_use]
pub fn other_kernels(plan: &Plan) -> Vec<Kernel> {
    [upload::kernels(plan, 0), pack::kernels(plan, 0)].concat()
}

/// Records a stage for several levels at once.
pub(super) type RecordLevels = fn(&mut Recorder, Range<usize>) -> Result<()>;

/// The stages that can process several levels in one dispatch, by name.
const OVER_LEVELS: [(&str, RecordLevels); 4] = [
    ("graph", graph::record_levels),
    ("dependency", dependency::record_levels),
    ("resolution", resolution::record_levels),
    ("belief", belief::record_levels),
];

/// The function that records `stage` for several levels at once, if there is one.
pub(super) fn record_levels(stage: Stage) -> Option<RecordLevels> {
    OVER_LEVELS.into_iter().find(|(name, _)| *name == stage.name()).map(|(_, record)| record)
}

/// The work of a device before and after the stages of a match, on the way of images to it and of maps from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Transfer {
    /// Unpacks the uploaded pair.
    Up(Unpacking),
    /// Packs the final maps for reading back.
    Down,
}

/// Records a transfer.
pub(super) fn record_transfer(r: &mut Recorder, transfer: Transfer) -> Result<()> {
    match transfer {
        Transfer::Up(unpacking) => upload::record(r, unpacking),
        Transfer::Down => pack::record(r),
    }
}

/// Records the transposition of the graph: the factors that hold each pixel.
pub(super) fn record_transposed(r: &mut Recorder) -> Result<()> {
    graph::record_transposed(r)
}
