//! Planes through the disparities of filled pixels: see [`Stage::FillPlane`](crate::backend::Stage::FillPlane).

use super::steps::{Job, Recorder};
use super::{median, plane};
use crate::error::Result;
use crate::plan::Plan;
use crate::weights::{FILL_STEP_BITS, MedianWeights};

pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    if plan.method.refinement.plane { plane::jobs(plan, level) } else { median::jobs(plan, level) }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let job = &jobs(r.plan, 0)[0];
    for step_bits in FILL_STEP_BITS {
        median::smooth(r, job, &MedianWeights::stretched(&r.plan.method, step_bits), false)?;
    }
    Ok(())
}
