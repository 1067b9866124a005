//! The right view in place of the left one: see [`Stage::SwapViews`](crate::backend::Stage::SwapViews).
//!
//! Floor: 88 bytes moved and asked for a pixel.

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;
use crate::stage::NO_RUNNER_UP;

const SHADER: &str = include_str!("../../../shaders/swap_views.wgsl");

pub(super) fn jobs(_: &Plan, _: usize) -> Vec<Job> {
    let kernel = Kernel::new("swap_views", "main", SHADER).with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
    vec![Job::new::<()>(kernel, 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&jobs(r.plan, 0)[0], &(), l.width.div_ceil(2), |rows| {
        vec![
            (1, b.left.bind(rows)),
            (2, b.right.bind(rows)),
            (3, b.optima.bind(rows)),
            (4, b.right_labels.bind(rows)),
        ]
    })
}
