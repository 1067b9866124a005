//! How much the label map changed, and whether it has settled: see [`Stage::Change`](crate::backend::Stage::Change).

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::Binding;
use crate::error::Result;
use crate::plan::Plan;

shader! {
    "change"(plan, level) { most_low: u32, most_high: u32, may_settle: u32, endings: u32 }
    labels: Labels { belief, label_map, squares } => kernel(plan, plan.levels[0].quads());
    sums: Sums { squares, row_sums } => kernel(plan, plan.levels[0].width);
    // The messages of a level take few dispatches, also together with those of others.
    settle: Settle { row_sums, convergence, groups } => {
        kernel(plan, plan.levels[0].height + 64 * plan.levels.len())
    };
}

fn kernel<B: Bindings>(plan: &Plan, loops: usize) -> Kernel<B> {
    Kernel::new(loops).of_width(plan.volume_width)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let (plan, most) = (r.plan, r.plan.settled_change());
    let own = Uniform {
        most_low: most.unwrap_or(0) as u32,
        most_high: (most.unwrap_or(0) >> 32) as u32,
        may_settle: most.is_some().into(),
        endings: b.endings,
    };
    r.rows(&labels(plan, 0), &own, l.width, |rows| Labels {
        belief: here.belief.bind(rows),
        label_map: b.labels.bind(rows),
        squares: b.squares.bind(rows),
    })?;
    let [row_sums, convergence, groups] = [&b.change_sums, &b.convergence, &b.groups].map(Binding::whole);
    r.one_a_row(&sums(plan, 0), &own, |rows| Sums {
        squares: b.squares.bind(rows),
        row_sums: row_sums.clone(),
    })?;
    let bindings = Settle { row_sums, convergence, groups };
    r.dispatch(&settle(plan, 0), &own, 0..l.height, (1, 1), bindings)
}
