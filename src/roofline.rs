//! A lower bound on the cost of message passing, counted from the plan: the memory roofline.
//!
//! The message stages, [`Stage::Flood`] with its parts and [`Stage::Resolution`], do little arithmetic per
//! value, so they are memory-bound. [`bytes`] is what one run of a stage must move if nothing stays in a
//! cache from an earlier run: every volume that it reads is read once, and every volume that it writes is
//! written once, in the stored width. Padding is included, because it goes through the same arithmetic. The
//! graph, a few bytes per pixel, is left out. This number divided by the machine's copy rate is the shortest
//! time that the stage can take. Where the volumes of a level fit in a cache, the stage can be faster.

use crate::backend::Stage;
use crate::plan::Plan;
use crate::stage::{Data, Volume, volume_shape};

/// The message stages of `plan`, level by level. A backend records the time either of [`Stage::Flood`] or of
/// the two stages that it combines.
pub fn message_stages(plan: &Plan) -> impl Iterator<Item = Stage> + use<> {
    Stage::all(plan).into_iter().filter(|stage| stage.passes_messages())
}

/// Label updates of one run of `stage`: the dependency message values that it computes, which is pixels times
/// labels (without padding, but including labels outside label windows) times members per factor. It is 0 for
/// all other stages.
#[must_use]
pub fn label_updates(plan: &Plan, stage: Stage) -> u64 {
    let messages = stage.writes().filter_map(Data::volume).find(|v| matches!(v, Volume::Dependency(_)));
    messages.map_or(0, |volume| {
        let (rows, labels, _) = volume_shape(plan, volume);
        rows as u64 * labels as u64
    })
}

/// The smallest number of bytes that one run of `stage` moves; 0 unless it is a message stage. `cells` is the
/// number of cells that the volumes of each level hold ([`Backend::cells`](crate::backend::Backend::cells)).
#[must_use]
pub fn bytes(plan: &Plan, stage: Stage, cells: &[u64]) -> u64 {
    let stored = |volume: Volume| {
        let rows = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
        cells[volume.level()] * (rows * volume.bytes(plan)) as u64
    };
    if stage.passes_messages() { stage.volumes(plan).map(stored).sum() } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, Method};

    fn plan(preset: &str) -> Plan {
        let mut method = Method::preset(preset).unwrap();
        method.set("levels", "2").unwrap();
        method.set("percentile", "92").unwrap();
        Plan::new(5, 3, DisparityRange::new(0, 19).unwrap(), &method).unwrap()
    }

    #[test]
    fn every_volume_counts_once() {
        // 15 pixels of 20 labels, padded to 32, and 6 of 11, padded to 16; 5 members.
        for (preset, b) in [("default", 1), ("paper", 2)] {
            let plan = plan(preset);
            let (fine, coarse) = (15 * 32, 6 * 16);
            for (stage, expected) in [
                (Stage::Dependency(0), fine * (1 + 2 * 5) * b),
                (Stage::Dependency(1), coarse * (1 + 2 * 5) * b),
                (Stage::Resolution(1), (fine + coarse) * (1 + 2) * b),
                (Stage::Belief(0), fine * (1 + (5 + 1 + 1) * b)),
                (Stage::Belief(1), coarse * (1 + (5 + 1 + 1) * b)),
                (Stage::Flood(0), fine * (1 + 2 * b + 2 * 5 * b + b)),
                (Stage::Cost, 0),
                (Stage::Median, 0),
            ] {
                assert_eq!(bytes(&plan, stage, &[fine, coarse]), expected, "{preset}, {stage:?}");
            }
            assert_eq!(label_updates(&plan, Stage::Dependency(0)), 15 * 20 * 5);
            assert_eq!(label_updates(&plan, Stage::Dependency(1)), 6 * 11 * 5);
            assert_eq!(label_updates(&plan, Stage::Belief(0)), 0);
        }
    }

    #[test]
    fn every_message_stage_is_named_once() {
        let stages: Vec<_> = message_stages(&plan("default")).collect();
        let expected = [
            Stage::Flood(0),
            Stage::Dependency(0),
            Stage::Belief(0),
            Stage::Flood(1),
            Stage::Dependency(1),
            Stage::Resolution(1),
            Stage::Belief(1),
        ];
        assert_eq!(stages, expected);
    }
}
