//! Costs of the coarser levels: see [`Stage::Pyramid`](crate::backend::Stage::Pyramid).
//!
//! Floor, for a fine label of level 1: 1 + 2/8 bytes moved, 31 asked for (the 5 x 5 window), 100 operations for four labels.

use super::commands::Recorder;
use super::cost;
use super::kernel::{Kernel, shader};
use super::rows::with_halo;
use super::uniform::LevelParams;
use crate::error::Result;

shader! {
    "pyramid"(plan, level) { fine: LevelParams, label_offset: i32 }
    main: Main { fine_cost, cost } => Kernel::new(7 * 31)
        .with("FINE_NARROW", level == 1)
        .with("LOW_PASS", !plan.minimum_over_d());
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    if r.level > 1 || r.plan.holds_all_rows() {
        return record_rows(r);
    }
    cost::record_as_needed(r, 2, |r, fine| r.at(1, fine.start / 2..fine.end.div_ceil(2), record_rows))
}

/// From costs that are there.
fn record_rows(r: &mut Recorder) -> Result<()> {
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform { fine: finer.params, label_offset: r.plan.label_offset(r.level) };
    r.rows(&main(r.plan, r.level), &own, 2 * l.width * l.quads, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        let seen = with_halo(&fine_rows, 2, finer.params.height);
        Main { fine_cost: finer.cost.bind(&seen), cost: here.cost.bind(rows) }
    })?;
    r.renew(&here.cost);
    Ok(())
}
