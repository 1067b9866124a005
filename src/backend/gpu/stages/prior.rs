//! The prior in the evidence: see [`Stage::Prior`](crate::backend::Stage::Prior).
//!
//! Lower bound for four labels: 12 bytes moved, 16 requested (the evidence twice, for the minimum), 60 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::{PRIOR_LABEL_BITS, PRIOR_REACH, PRIOR_SLOPE_BITS};
use crate::stage::{Data, Volume};

shader! {
    "prior"(plan, level) { cap: u32 }
    main { evidence, belief, windows, prior } => Variant::new(2 * plan.levels[level].quads())
        .of_width(plan.volume_width)
        .with("PRIOR_LABEL_BITS", PRIOR_LABEL_BITS)
        .with("PRIOR_SLOPE_BITS", PRIOR_SLOPE_BITS)
        .with("PRIOR_REACH", PRIOR_REACH)
        .with("PADDING", u32::from(u8::MAX));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let own = Uniform { cap: r.plan.levels[r.level].evidence.cap.into() };
    r.rows(&main(r.plan, r.level), &own, r.params().width)?;
    r.renew(Data::Volume(Volume::Belief(r.level)));
    Ok(())
}
