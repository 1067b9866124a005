//! Matching cost: see [`Stage::Cost`](crate::backend::Stage::Cost).
//!
//! Floor: `census` moves 52 bytes a pixel at 2,500 operations, and asks for 2,000, the 63 places of the window in both images;
//! `ad_census` moves 1 byte a label at 100 operations for four, and asks for 32, the right row once a label.

use super::rows::with_halo;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::options::MatchingCost;
use crate::plan::{
    CENSUS_BIT_COST, CENSUS_BITS, CENSUS_PLACES, CENSUS_RADIUS_X, CENSUS_RADIUS_Y, COLOUR_MOST, COST_MAX,
    Plan,
};
use crate::program::together::BAND;
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/cost.wgsl");
/// Pixels of a row that share an invocation of `sad`.
const SAD_RUN: u32 = 8;

uniform! { outside_cost: u32, colour_weight: u32, colour_variance: u32, sad_radius: i32 }

impl Uniform {
    fn of(plan: &Plan) -> Self {
        Self {
            outside_cost: plan.outside_cost.into(),
            colour_weight: plan.colour_weight(),
            colour_variance: plan.colour_variance(),
            sad_radius: (plan.method.cost.sad_window / 2) as i32,
        }
    }
}

/// `sad`; or `census` and `ad_census`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let job = |entry: &'static str, loops| {
        let kernel = Kernel::new("cost", entry, SHADER)
            .with("SAD_RUN", SAD_RUN as i32)
            .with("COST_MAX", u32::from(COST_MAX))
            .with("CENSUS_RADIUS_X", CENSUS_RADIUS_X as i32)
            .with("CENSUS_RADIUS_Y", CENSUS_RADIUS_Y as i32)
            .with("CENSUS_PLACES", CENSUS_PLACES)
            .with("CENSUS_BITS", CENSUS_BITS)
            .with("CENSUS_BIT_COST", CENSUS_BIT_COST)
            .with("COLOUR_MOST", COLOUR_MOST);
        Job::new::<Uniform>(kernel, loops)
    };
    if plan.method.cost.matching == MatchingCost::Sad {
        let (window, run) = (plan.method.cost.sad_window as usize, SAD_RUN as usize);
        return vec![job("sad", (window + run - 1) * (1 + 5 * window + run) + run * 5)];
    }
    let window = (2 * CENSUS_RADIUS_Y as usize + 1) * (2 * CENSUS_RADIUS_X as usize + 2);
    vec![job("census", window), job("ad_census", 4)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, b, l) = (r.plan, r.buffers, r.params());
    let own = Uniform::of(plan);
    let cost = &r.here().cost;
    match &jobs(plan, 0)[..] {
        [census, _] => {
            r.rows(census, &own, l.width, |rows| {
                let seen = with_halo(rows, CENSUS_RADIUS_Y, l.height);
                vec![
                    (1, b.left.bind(&seen)),
                    (2, b.right.bind(&seen)),
                    (7, b.census[0].bind(rows)),
                    (8, b.census[1].bind(rows)),
                    (9, b.contrast.bind(rows)),
                ]
            })?;
            if plan.holds_all_rows() {
                record_costs(r)?;
            }
        }
        jobs => {
            r.rows(&jobs[0], &own, l.width.div_ceil(SAD_RUN) * l.quads, |rows| {
                let seen = with_halo(rows, plan.method.cost.sad_window / 2, l.height);
                vec![(1, b.left.bind(&seen)), (2, b.right.bind(&seen)), (3, cost.bind(rows))]
            })?;
            r.renew(cost);
        }
    }
    Ok(())
}

/// Costs from what [`record`] has taken of both views.
pub(super) fn record_costs(r: &mut Recorder) -> Result<()> {
    let (plan, b, l, cost) = (r.plan, r.buffers, r.params(), &r.here().cost);
    let [_, ad_census] = &jobs(plan, 0)[..] else { unreachable!("costs of the census") };
    r.rows(ad_census, &Uniform::of(plan), l.width * l.quads, |rows| {
        vec![
            (1, b.left.bind(rows)),
            (2, b.right.bind(rows)),
            (3, cost.bind(rows)),
            (4, b.census[0].bind(rows)),
            (5, b.census[1].bind(rows)),
            (6, b.contrast.bind(rows)),
        ]
    })?;
    r.renew(cost);
    Ok(())
}

/// Goes down level 0 where not all of its rows are held: `then` gets some rows after the other, once the costs of these and of
/// `around` more on either side are there.
pub(super) fn record_as_needed(
    r: &mut Recorder,
    around: u32,
    mut then: impl FnMut(&mut Recorder, Range<u32>) -> Result<()>,
) -> Result<()> {
    let height = r.buffers.levels[0].params.height;
    let mut computed = 0;
    for start in (0..height).step_by(BAND) {
        let rows = start..(start + BAND as u32).min(height);
        let end = (rows.end + around).min(height);
        // The last few rows may have been around those before.
        if computed < end {
            r.at(0, computed..end, record_costs)?;
            computed = end;
        }
        then(r, rows)?;
    }
    Ok(())
}
