//! Costs of the coarser levels: see [`Stage::Pyramid`](crate::backend::Stage::Pyramid).
//!
//! Lower bound for four fine labels of level 1: 5 bytes moved, 124 requested (5 x 5 window), 100 operations.

use super::cost;
use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::stage::{Data, Volume};

shader! {
    "pyramid"(plan, level) { fine: LevelParams, label_offset: i32 }
    main { fine_cost around 2, cost } => Variant::new(7 * 31)
        .with("FINE_NARROW", level == 1)
        .with("LOW_PASS", !plan.minimum_over_d());
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    if r.level > 1 || r.plan.holds_all_rows() {
        return record_rows(r);
    }
    cost::record_as_needed(r, 2, |r, fine| r.at(1, fine.start / 2..fine.end.div_ceil(2), record_rows))
}

/// Records rows whose fine costs are computed.
fn record_rows(r: &mut Recorder) -> Result<()> {
    let (z, l) = (r.level, r.params());
    let own = Uniform { fine: r.buffers.levels[z - 1], label_offset: r.plan.label_offset(z) };
    r.rows(&main(r.plan, z), &own, 2 * l.width * l.quads)?;
    r.renew(Data::Volume(Volume::Cost(z)));
    Ok(())
}
