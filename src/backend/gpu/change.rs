//! How much the label map changed, and whether it has settled: see [`Stage::Change`](crate::backend::Stage::Change).

use super::rows::Binding;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/change.wgsl");

uniform! { most_low: u32, most_high: u32, may_settle: u32, endings: u32 }

/// `labels`, `sums` and `settle`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let level = &plan.levels[0];
    let job = |entry, loops| {
        let kernel = Kernel::new("change", entry, SHADER).of_width(plan.volume_width);
        Job::new::<Uniform>(kernel, loops)
    };
    // The messages of a level take few dispatches, also together with those of others.
    let endings = 64 * plan.levels.len();
    vec![job("labels", level.quads()), job("sums", level.width), job("settle", level.height + endings)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let [labels, sums, settle] = &jobs(r.plan, 0)[..] else { unreachable!("three kernels") };
    let most = r.plan.settled_change();
    let own = Uniform {
        most_low: most.unwrap_or(0) as u32,
        most_high: (most.unwrap_or(0) >> 32) as u32,
        may_settle: most.is_some().into(),
        endings: b.endings,
    };
    r.rows(labels, &own, l.width, |rows| {
        vec![(1, here.belief.bind(rows)), (2, b.labels.bind(rows)), (3, b.squares.bind(rows))]
    })?;
    r.one_a_row(sums, &own, |rows| vec![(3, b.squares.bind(rows)), (4, Binding::whole(&b.change_sums))])?;
    let bindings = [&b.change_sums, &b.convergence, &b.groups].map(Binding::whole);
    r.dispatch(settle, &own, 0..l.height, (1, 1), &[4, 5, 6].into_iter().zip(bindings).collect::<Vec<_>>())
}
