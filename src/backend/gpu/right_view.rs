//! The map of the right view: see [`Stage::RightView`](crate::backend::Stage::RightView).
//!
//! Floor, a label: 1 byte moved, 4 asked for (words of four labels of which it wants one), 20 operations for four.

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/right_view.wgsl");

uniform! { first_column: u32, columns: u32 }

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let kernel = Kernel::new("right_view", "main", SHADER).of_width(plan.volume_width);
    vec![Job::new::<Uniform>(kernel, plan.levels[0].labels)]
}

/// The tile decides which columns count, so each tile has its own steps.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l, core) = (r.buffers, r.here(), r.params(), &r.plan.core);
    let own = Uniform { first_column: core.start as u32, columns: core.len() as u32 };
    r.rows(&jobs(r.plan, 0)[0], &own, l.width, |rows| {
        vec![(1, here.belief.bind(rows)), (2, b.right_labels.bind(rows))]
    })
}
