//! Confidence: see [`Stage::Confidence`](crate::backend::Stage::Confidence).

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/confidence.wgsl");

uniform! { floor: u32 }

pub(super) fn jobs(_: &Plan, _: usize) -> Vec<Job> {
    vec![Job::new::<Uniform>(Kernel::new("confidence", "main", SHADER), 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let own = Uniform { floor: r.plan.method.refinement.confidence_floor };
    r.rows(&jobs(r.plan, 0)[0], &own, l.width, |rows| vec![(1, b.optima.bind(rows)), (2, b.flags.bind(rows))])
}
