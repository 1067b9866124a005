//! Planes through the disparities: see [`Stage::Plane`](crate::backend::Stage::Plane).
//!
//! Lower bound per pixel: half of the median's, and in two rounds 1,500 bytes requested (53 places), 2,500 operations.

use super::median;
use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::Kernel;
use crate::backend::gpu::shader::Shader;
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::planes::{PLANE_BITS, PLANE_FARTHEST, PLANE_START_BITS, PLANE_STEEPEST};
use crate::weights::MedianWeights;

const SHADER: Shader = Shader::new("plane", "main", include_str!("../../../../shaders/plane.wgsl"));

/// The kernel for a window with `weights`. It has the bindings of the median.
pub(super) fn kernel(weights: &MedianWeights) -> Kernel<median::Uniform> {
    median::over_window(SHADER, weights, PLANE_BITS.len(), |variant| {
        variant
            .with("START_BITS", PLANE_START_BITS)
            .with("FIRST_BITS", PLANE_BITS[0])
            .with("SECOND_BITS", PLANE_BITS[1])
            .with("STEEPEST", PLANE_STEEPEST)
            .with("FARTHEST", PLANE_FARTHEST)
    })
}

pub(super) fn kernels(plan: &Plan, _: usize) -> Vec<Kernel> {
    vec![kernel(&MedianWeights::of_planes(&plan.method)).any()]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    median::record_as(r, kernel, &MedianWeights::of_planes(&r.plan.method))
}
