//! Planes through the disparities: see [`Stage::Plane`](crate::backend::Stage::Plane).
//!
//! Floor, a pixel: that of the median, and in each of two rounds 1,500 bytes asked for (53 places) and 2,500 operations.

use super::median;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::planes::{PLANE_BITS, PLANE_FARTHEST, PLANE_STEEPEST};
use crate::weights::MedianWeights;

const SHADER: &str = include_str!("../../../shaders/plane.wgsl");

pub(super) fn kernel() -> Kernel {
    Kernel::new("plane", "main", SHADER)
        .with("FIRST_BITS", PLANE_BITS[0])
        .with("SECOND_BITS", PLANE_BITS[1])
        .with("STEEPEST", PLANE_STEEPEST)
        .with("FARTHEST", PLANE_FARTHEST)
}

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    vec![median::job(&MedianWeights::of(&plan.method), kernel(), PLANE_BITS.len())]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let job = &jobs(r.plan, 0)[0];
    median::record_as(r, job)
}
