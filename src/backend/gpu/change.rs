//! How much the label map changed: see [`Stage::Change`](crate::backend::Stage::Change).

use super::buffers::Binding;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/change.wgsl");

/// `labels` and `sums`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let level = &plan.levels[0];
    let kernel = |entry| Kernel::new("change", entry, SHADER).of_width(plan.volume_width);
    vec![Job::new::<()>(kernel("labels"), level.quads()), Job::new::<()>(kernel("sums"), level.width)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let [labels, sums] = &jobs(r.plan, 0)[..] else { unreachable!("two kernels") };
    r.rows(labels, &(), l.width, |rows| {
        vec![(1, here.belief.bind(rows)), (2, b.labels.bind(rows)), (3, b.squares.bind(rows))]
    })?;
    r.one_a_row(sums, &(), |rows| vec![(3, b.squares.bind(rows)), (4, Binding::whole(&b.change_sums))])
}
