//! Planes through the disparities of filled pixels: see [`Stage::FillPlane`](crate::backend::Stage::FillPlane).

use super::steps::{Job, Recorder};
use super::{median, plane};
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::planes::PLANE_BITS;
use crate::weights::{FILL_STEP_BITS, MedianWeights};

fn weights(plan: &Plan) -> [MedianWeights; 2] {
    FILL_STEP_BITS.map(|step_bits| MedianWeights::of_filled(&plan.method, step_bits))
}

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let (kernel, rounds) = if plan.method.refinement.plane {
        (plane::kernel(), PLANE_BITS.len())
    } else {
        (median::kernel(), 0)
    };
    vec![median::job(&weights(plan)[0], kernel, rounds)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let job = &jobs(r.plan, 0)[0];
    for weights in weights(r.plan) {
        median::smooth(r, job, &weights, &r.buffers.fill_weights, false)?;
    }
    Ok(())
}
