//! Matching cost of level 0: see [`crate::backend::Stage::Cost`].

mod sad;

use crate::backend::cpu::features::{RowFeatures, Sums, Views};
use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::image::Pair;
use crate::options::MatchingCost;
use crate::plan::Plan;
use crate::threads::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let Volumes { plan, pair, features, fine_cost: out, .. } = v;
    match plan.method.cost.matching {
        MatchingCost::Sad => sad::costs(plan, pair, out),
        MatchingCost::Census | MatchingCost::AdCensus if plan.stores_costs() => census(plan, pair, out),
        MatchingCost::Census | MatchingCost::AdCensus => features.fill(plan, pair),
    }
}

fn census(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let views = Views::new(plan, pair);
    out.par_chunks_mut(level.width * level.stride).enumerate().for_each_init(
        || (RowFeatures::new(plan), Sums::new(level.width)),
        |(features, sums), (y, costs)| {
            features.fill(&views, y, sums);
            features.costs(plan, costs);
        },
    );
}
