//! Which stages can go over several levels in one dispatch, where these share buffers.

use super::commands::Recorder;
use super::{belief, dependency, graph, resolution};
use crate::backend::Stage;
use crate::error::Result;
use std::ops::Range;

/// Records a stage at several levels at once.
pub(super) type RecordLevels = fn(&mut Recorder, Range<usize>) -> Result<()>;

/// The stages that go over levels at once, by name.
const ALL: [(&str, RecordLevels); 4] = [
    ("graph", graph::record_levels),
    ("dependency", dependency::record_levels),
    ("resolution", resolution::record_levels),
    ("belief", belief::record_levels),
];

/// How `stage` goes over levels at once, where it can.
pub(super) fn record_levels(stage: Stage) -> Option<RecordLevels> {
    ALL.into_iter().find(|(name, _)| *name == stage.name()).map(|(_, record)| record)
}
