//! The change of the label map, and convergence: see [`Stage::Change`](crate::backend::Stage::Change).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::Plan;

shader! {
    "change"(plan, level) { most_low: u32, most_high: u32, may_settle: u32, endings: u32 }
    labels { belief, label_map, squares } => variant(plan, plan.levels[0].quads());
    sums { squares, row_sums } => variant(plan, plan.levels[0].width);
    // At most 64 dispatches of messages per level, including joined ones.
    settle { row_sums, convergence, groups } => {
        variant(plan, plan.levels[0].height + 64 * plan.levels.len())
    };
}

fn variant(plan: &Plan, loops: usize) -> Variant {
    Variant::new(loops).of_width(plan.volume_width)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, l, most) = (r.plan, r.params(), r.plan.settled_change());
    let own = Uniform {
        most_low: most.unwrap_or(0) as u32,
        most_high: (most.unwrap_or(0) >> 32) as u32,
        may_settle: most.is_some().into(),
        endings: r.buffers.endings,
    };
    r.rows(&labels(plan, 0), &own, l.width)?;
    r.one_a_row(&sums(plan, 0), &own)?;
    r.dispatch(&settle(plan, 0), &own, 0..l.height, (1, 1))
}
