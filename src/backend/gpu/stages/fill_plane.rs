//! Planes through the disparities of filled pixels: see [`Stage::FillPlane`](crate::backend::Stage::FillPlane).

use super::{median, plane};
use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::Kernel;
use crate::error::Result;
use crate::plan::Plan;
use crate::weights::{FILL_STEP_BITS, MedianWeights};

fn weights(plan: &Plan) -> [MedianWeights; 2] {
    FILL_STEP_BITS.map(|step_bits| MedianWeights::of_filled(&plan.method, step_bits))
}

fn kernel(plan: &Plan, weights: &MedianWeights) -> Kernel<median::Uniform> {
    let kernel = if plan.method.refinement.plane { plane::kernel } else { median::kernel };
    kernel(weights).taking("space", "fill_weights")
}

pub(super) fn kernels(plan: &Plan, _: usize) -> Vec<Kernel> {
    weights(plan).iter().map(|weights| kernel(plan, weights).any()).collect()
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    for weights in weights(r.plan) {
        median::smooth(r, &kernel(r.plan, &weights), &weights, false)?;
    }
    Ok(())
}
