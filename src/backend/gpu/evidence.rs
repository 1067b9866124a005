//! Evidence and the first beliefs: see [`Stage::Evidence`](crate::backend::Stage::Evidence).
//!
//! Floor, a label: 3 bytes moved, 4 asked for (the costs twice, for their minimum), 25 operations for four.

use super::commands::Recorder;
use super::cost;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::plan::COST_FRACTION_BITS;

shader! {
    "evidence"(plan, level) { multiplier: u32, limit: u32, up: u32, down: u32, cap: u32 }
    main: Main { cost, evidence, belief, windows } => Kernel::new(2 * plan.levels[level].quads())
        .of_width(plan.volume_width)
        .with("FINE_NARROW", level == 0)
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS)
        .with("PADDING", u32::from(u8::MAX));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l, scale) = (r.here(), r.params(), r.plan.levels[r.level].evidence);
    let own = Uniform {
        multiplier: scale.multiplier.into(),
        limit: scale.limit.into(),
        up: scale.up,
        down: scale.down,
        cap: scale.cap.into(),
    };
    if r.level == 0 && !r.plan.holds_all_rows() {
        // What these rows take the place of goes.
        cost::record_costs(r)?;
        r.clear(&here.dependency);
        r.clear(&here.down);
    }
    r.rows(&main(r.plan, r.level), &own, l.width, |rows| Main {
        cost: here.cost.bind(rows),
        evidence: here.evidence.bind(rows),
        belief: here.belief.bind(rows),
        windows: here.windows.bind(&(0..1)),
    })?;
    r.renew(&here.belief);
    Ok(())
}
