//! Evidence and the first beliefs: see [`Stage::Evidence`](crate::backend::Stage::Evidence).
//!
//! Lower bound for four labels: 12 bytes moved, 16 requested (the costs twice, for their minimum), 25 operations.

use super::cost;
use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::COST_FRACTION_BITS;
use crate::stage::{Data, Volume};

shader! {
    "evidence"(plan, level) { multiplier: u32, limit: u32, up: u32, down: u32, cap: u32 }
    main { cost, evidence, belief, windows } => Variant::new(2 * plan.levels[level].quads())
        .of_width(plan.volume_width)
        .with("FINE_NARROW", level == 0)
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS)
        .with("PADDING", u32::from(u8::MAX));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let scale = r.plan.levels[r.level].evidence;
    let own = Uniform {
        multiplier: scale.multiplier.into(),
        limit: scale.limit.into(),
        up: scale.up,
        down: scale.down,
        cap: scale.cap.into(),
    };
    if r.level == 0 && !r.plan.holds_all_rows() {
        cost::record_costs(r)?;
    }
    r.rows(&main(r.plan, r.level), &own, r.params().width)?;
    r.renew(Data::Volume(Volume::Belief(r.level)));
    Ok(())
}
