//! Matching cost: see [`Stage::Cost`](crate::backend::Stage::Cost).
//!
//! Lower bound: `census` moves 52 bytes per pixel with 2,500 operations, and requests 2,000 (the 63 places of the window in
//! both images); `ad_census` moves 1 byte per label with 100 operations for four, and requests 32 (the right row for each
//! label).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::options::MatchingCost;
use crate::plan::{
    CENSUS_BIT_COST, CENSUS_BITS, CENSUS_PLACES, CENSUS_RADIUS_X, CENSUS_RADIUS_Y, COLOUR_MOST, COST_MAX,
    Plan,
};
use crate::program::together::BAND;
use crate::stage::{Data, Volume};
use std::ops::Range;

/// Pixels of a row per invocation of `sad`.
const SAD_RUN: u32 = 8;

shader! {
    "cost"(plan, level) { outside_cost: u32, colour_weight: u32, colour_variance: u32, sad_radius: i32, sad_steps: u32 }
    sad { left around radius(plan), right around radius(plan), cost } if plan.method.cost.matching == MatchingCost::Sad => {
        let (window, run) = (plan.method.cost.sad_window as usize, SAD_RUN as usize);
        variant((window + run - 1) * (1 + 5 * window + run) + run * 5)
    };
    census {
        left around CENSUS_RADIUS_Y, right around CENSUS_RADIUS_Y, left_census_out, right_census_out, contrast_out
    } if takes_census(plan) => {
        variant((2 * CENSUS_RADIUS_Y as usize + 1) * (2 * CENSUS_RADIUS_X as usize + 2))
    };
    ad_census { left, right, cost, left_census, right_census, contrast } if takes_census(plan) => {
        variant(4)
    };
}

/// Vertical radius of the window of absolute differences.
fn radius(plan: &Plan) -> u32 {
    plan.method.cost.sad_window / 2
}

fn takes_census(plan: &Plan) -> bool {
    matches!(plan.method.cost.matching, MatchingCost::Census | MatchingCost::AdCensus)
}

fn variant(loops: usize) -> Variant {
    Variant::new(loops)
        .with("SAD_RUN", SAD_RUN as i32)
        .with("COST_MAX", u32::from(COST_MAX))
        .with("CENSUS_RADIUS_X", CENSUS_RADIUS_X as i32)
        .with("CENSUS_RADIUS_Y", CENSUS_RADIUS_Y as i32)
        .with("CENSUS_PLACES", CENSUS_PLACES)
        .with("CENSUS_BITS", CENSUS_BITS)
        .with("CENSUS_BIT_COST", CENSUS_BIT_COST)
        .with("COLOUR_MOST", COLOUR_MOST)
}

impl Uniform {
    fn of(plan: &Plan) -> Self {
        Self {
            outside_cost: plan.outside_cost.into(),
            colour_weight: plan.colour_weight(),
            colour_variance: plan.colour_variance(),
            sad_radius: radius(plan) as i32,
            sad_steps: plan.method.cost.sad_steps,
        }
    }
}

/// Computes the features of both views, and the costs if all rows of these are held.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, width) = (r.plan, r.params().width);
    if takes_census(plan) {
        r.rows(&census(plan, 0), &Uniform::of(plan), width)?;
    }
    if plan.holds_all_rows() { record_costs(r) } else { Ok(()) }
}

/// Computes costs from both views and their features.
pub(super) fn record_costs(r: &mut Recorder) -> Result<()> {
    let (plan, l) = (r.plan, r.params());
    if takes_census(plan) {
        r.rows(&ad_census(plan, 0), &Uniform::of(plan), l.width * l.quads)?;
    } else {
        r.rows(&sad(plan, 0), &Uniform::of(plan), l.width.div_ceil(SAD_RUN) * l.quads)?;
    }
    r.renew(Data::Volume(Volume::Cost(0)));
    Ok(())
}

/// Processes level 0 in bands if not all its rows are held. Before each call of `then`, computes the costs of
/// its rows and of `around` more on either side.
pub(super) fn record_as_needed(
    r: &mut Recorder,
    around: u32,
    mut then: impl FnMut(&mut Recorder, Range<u32>) -> Result<()>,
) -> Result<()> {
    let height = r.buffers.levels[0].height;
    let mut computed = 0;
    for start in (0..height).step_by(BAND) {
        let rows = start..(start + BAND as u32).min(height);
        let end = (rows.end + around).min(height);
        // Rows near the end may already be computed.
        if computed < end {
            r.at(0, computed..end, record_costs)?;
            computed = end;
        }
        then(r, rows)?;
    }
    Ok(())
}
