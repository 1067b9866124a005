//! The optimum of every pixel: see [`Stage::WinnerTakesAll`](crate::backend::Stage::WinnerTakesAll).
//!
//! Floor, a label: 1 byte moved, 2 asked for (the beliefs again, for the runner-up), 15 operations for four.

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;
use crate::stage::NO_RUNNER_UP;

const SHADER: &str = include_str!("../../../shaders/winner_takes_all.wgsl");

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let kernel = Kernel::new("winner_takes_all", "main", SHADER)
        .of_width(plan.volume_width)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
    vec![Job::new::<()>(kernel, 2 * plan.levels[0].quads())]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l) = (r.buffers, r.here(), r.params());
    r.rows(&jobs(r.plan, 0)[0], &(), l.width, |rows| {
        vec![(1, here.belief.bind(rows)), (2, b.optima.bind(rows)), (3, here.windows.bind(&(0..1)))]
    })
}
