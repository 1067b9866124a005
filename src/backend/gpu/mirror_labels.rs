//! The labels of the mirrored pair: see [`Stage::MirrorLabels`](crate::backend::Stage::MirrorLabels).

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/mirror_labels.wgsl");

pub(super) fn jobs(_: &Plan, _: usize) -> Vec<Job> {
    vec![Job::new::<()>(Kernel::new("mirror_labels", "main", SHADER), 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&jobs(r.plan, 0)[0], &(), l.width, |rows| {
        vec![(1, b.optima.bind(rows)), (2, b.right_labels.bind(rows))]
    })
}
