//! The stretched median of what was filled: see [`Stage::FillMedian`](crate::backend::Stage::FillMedian).

use super::median;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;
use crate::weights::MedianWeights;

const SHADER: &str = include_str!("../../../shaders/fill_median.wgsl");

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    vec![median::job(plan, Kernel::new("fill_median", "main", SHADER), 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (weights, table) = (MedianWeights::stretched(&r.plan.method), &r.buffers.stretched_weights);
    median::smooth(r, &jobs(r.plan, 0)[0], &weights, table, false)
}
