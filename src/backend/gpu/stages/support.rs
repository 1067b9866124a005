//! The support of each pixel: see [`Stage::Support`](crate::backend::Stage::Support).
//!
//! Lower bound per pixel: 20 bytes moved, 200 requested (25 places), 130 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::support::{SUPPORT_NEAR, SUPPORT_PLACES, SUPPORT_REACH, SUPPORT_STEP};
use crate::stage::Map;

shader! {
    "support"(plan, level) { floor: u32 }
    main { disparity around SUPPORT_REACH, flags around SUPPORT_REACH, next_flags } => Variant::new((SUPPORT_PLACES + 1) * SUPPORT_PLACES)
        .with("PLACES", SUPPORT_PLACES as u32)
        .with("STEP", SUPPORT_STEP as u32)
        .with("NEAR", SUPPORT_NEAR as u32);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let own = Uniform { floor: r.plan.method.refinement.confidence_floor };
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &own, width)?;
    r.exchange(Map::Validity);
    Ok(())
}
