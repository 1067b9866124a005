//! Which stages can go over several levels in one dispatch, where these share buffers.

use super::buffers::Shared;
use super::steps::Recorder;
use super::{belief, dependency, graph, resolution};
use crate::backend::Stage;
use crate::error::Result;
use std::ops::Range;

/// Records a stage at several levels at once.
pub(super) type RecordLevels = fn(&mut Recorder, &Shared, Range<usize>) -> Result<()>;

/// How `stage` goes over levels at once, where it can.
pub(super) fn record_levels(stage: Stage) -> Option<RecordLevels> {
    match stage {
        Stage::Graph(_) => Some(graph::record_levels),
        Stage::Dependency(_) => Some(dependency::record_levels),
        Stage::Resolution(_) => Some(resolution::record_levels),
        Stage::Belief(_) => Some(belief::record_levels),
        _ => None,
    }
}

/// Whether all that `stage` reads and writes is shared.
pub(super) fn can_share(stage: Stage, shared: &Shared) -> bool {
    match stage {
        Stage::Resolution(z) => z > shared.finest,
        stage => stage.level().is_some_and(|z| z >= shared.finest),
    }
}

/// The same stage at the next coarser level, where the two can run together.
pub(super) fn next_level(stage: Stage) -> Option<Stage> {
    match stage {
        Stage::Graph(z) => Some(Stage::Graph(z + 1)),
        Stage::Dependency(z) => Some(Stage::Dependency(z + 1)),
        Stage::Resolution(z) => Some(Stage::Resolution(z + 1)),
        Stage::Belief(z) => Some(Stage::Belief(z + 1)),
        Stage::Flood(z) => Some(Stage::Flood(z + 1)),
        _ => None,
    }
}
