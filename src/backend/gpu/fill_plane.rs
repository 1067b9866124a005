//! Planes through the disparities of filled pixels: see [`Stage::FillPlane`](crate::backend::Stage::FillPlane).

use super::commands::Recorder;
use super::{Kernel, median, plane};
use crate::error::Result;
use crate::plan::Plan;
use crate::weights::{FILL_STEP_BITS, MedianWeights};

fn weights(plan: &Plan) -> [MedianWeights; 2] {
    FILL_STEP_BITS.map(|step_bits| MedianWeights::of_filled(&plan.method, step_bits))
}

fn kernel(plan: &Plan) -> Kernel<median::Main> {
    let kernel = if plan.method.refinement.plane { plane::kernel } else { median::kernel };
    kernel(&weights(plan)[0])
}

pub(super) fn kernels(plan: &Plan, _: usize) -> Vec<Kernel> {
    vec![kernel(plan).any()]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    for weights in weights(r.plan) {
        median::smooth(r, &kernel(r.plan), &weights, &r.buffers.fill_weights, false)?;
    }
    Ok(())
}
