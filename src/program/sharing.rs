//! Memory sharing of data that are never needed at the same time, and freeing of data after their last use.

use super::Step;
use crate::plan::Plan;
use crate::stage::{Data, Place, Stage, Volume};
use std::collections::HashMap;
use std::ops::RangeInclusive;

/// The steps at which each datum is needed: from the first to the last access, or, for scratch memory, single steps. When the labels
/// of a level are set anew, for another look, its volumes besides the costs start another life.
fn lives(plan: &Plan, steps: &[Step]) -> HashMap<Data, Vec<RangeInclusive<usize>>> {
    let mut lives: HashMap<_, Vec<RangeInclusive<usize>>> = HashMap::new();
    // The step at which the labels of each level were last set.
    let mut set = vec![0; plan.levels.len()];
    for (at, step) in steps.iter().enumerate() {
        let Step::Run(run) = step else { continue };
        for stage in run.stages() {
            if let Stage::LabelWindow(z) = stage {
                set[z] = at;
            }
            for data in stage.reads(plan).chain(stage.writes()) {
                let since = match data {
                    Data::Volume(Volume::Cost(_)) => 0,
                    Data::Volume(volume) => set[volume.level()],
                    _ => 0,
                };
                let lives = lives.entry(data).or_default();
                match lives.last_mut() {
                    Some(life) if *life.start() >= since => *life = *life.start()..=at,
                    _ => lives.push(at..=at),
                }
            }
            for data in stage.needs(plan) {
                lives.entry(data).or_default().push(at..=at);
            }
        }
    }
    lives
}

/// Pairs of data that may share memory: on the CPU path the costs of a level and its messages, unless another look needs the costs
/// again; on a device data that the table [places](Place) in other data.
fn pairs(plan: &Plan) -> Vec<[Data; 2]> {
    let levels = plan.levels.len();
    let costs = if plan.looks() == 1 { 1..levels } else { 0..0 };
    let mut pairs: Vec<_> =
        costs.map(|z| [Volume::Cost(z), Volume::Dependency(z)].map(Data::Volume)).collect();
    for data in Data::all(plan) {
        match data.array(plan).place {
            Place::Own => {}
            Place::In(other) => pairs.push([data, other]),
            Place::AnyVolume => {
                let volumes = (0..levels).flat_map(Data::of_levels).filter(|data| data.volume().is_some());
                pairs.extend(volumes.map(|volume| [data, volume]));
            }
        }
    }
    pairs
}

/// The steps of a frame, with graphs freed after the last stage that reads them; `plan`
/// [shares](Plan::shares) memory if no pair is needed at the same time.
#[must_use]
pub(crate) fn pass(plan: &mut Plan, steps: Vec<Step>) -> Vec<Step> {
    let lives = lives(plan, &steps);
    let apart = |pair: [Data; 2]| match pair.map(|data| lives.get(&data)) {
        [Some(a), Some(b)] => a.iter().all(|a| b.iter().all(|b| a.end() < b.start() || b.end() < a.start())),
        _ => true,
    };
    plan.shares = pairs(plan).into_iter().all(apart);
    let mut freed: HashMap<usize, Vec<Step>> = HashMap::new();
    for z in 0..plan.levels.len() {
        let graph = Data::Members(z);
        if let Some(life) = lives.get(&graph).and_then(|lives| lives.last()) {
            freed.entry(*life.end()).or_default().push(Step::Free(graph));
        }
    }
    let with_freed = |(at, step)| std::iter::once(step).chain(freed.remove(&at).unwrap_or_default());
    steps.into_iter().enumerate().flat_map(with_freed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, Method, PRESETS};
    use crate::program::schedule;

    #[test]
    fn presets_share_and_free() {
        for preset in PRESETS {
            let range = DisparityRange::new(0, 20).unwrap();
            let mut plan = Plan::new(80, 60, range, &preset.method()).unwrap();
            let preset = preset.name;
            let steps = schedule::steps(&plan);
            let shared = pass(&mut plan, steps.clone());
            assert!(plan.shares, "{preset}");
            for z in 0..plan.levels.len() {
                let reads = |step: &Step| {
                    step.stage().is_some_and(|stage| stage.reads(&plan).any(|data| data == Data::Members(z)))
                };
                let freed = shared.iter().position(|step| *step == Step::Free(Data::Members(z))).unwrap();
                assert!(!shared[freed..].iter().any(reads), "{preset}, level {z}");
            }
            let kept: Vec<_> = shared.into_iter().filter(|step| !matches!(step, Step::Free(_))).collect();
            assert_eq!(kept, steps);
        }
    }

    /// Control: costs that are read after messages were sent do not share memory.
    #[test]
    fn control_data_needed_at_the_same_time_do_not_share() {
        let mut method = Method::default();
        // Several looks keep the costs apart anyway.
        method.schedule.looks = 1;
        let mut plan = Plan::new(80, 60, DisparityRange::new(0, 20).unwrap(), &method).unwrap();
        for late in [Stage::Evidence(1), Stage::Pyramid(2)] {
            let mut steps = schedule::steps(&plan);
            steps.push(Step::of(late));
            let _ = pass(&mut plan, steps);
            assert!(!plan.shares, "{late:?}");
        }
    }
}
