//! The confidence that the pixels around a pixel support: see [`Stage::Support`](crate::backend::Stage::Support).
//!
//! Floor, a pixel: 20 bytes moved, 200 asked for (25 places), 130 operations.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use super::rows::with_halo;
use crate::error::Result;
use crate::plan::support::{SUPPORT_NEAR, SUPPORT_PLACES, SUPPORT_REACH, SUPPORT_STEP};

shader! {
    "support"(plan, level) { floor: u32 }
    main: Main { disparity, flags, supported } => Kernel::new((SUPPORT_PLACES + 1) * SUPPORT_PLACES)
        .with("PLACES", SUPPORT_PLACES as u32)
        .with("STEP", SUPPORT_STEP as u32)
        .with("NEAR", SUPPORT_NEAR as u32);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let own = Uniform { floor: r.plan.method.refinement.confidence_floor };
    r.rows(&main(r.plan, 0), &own, l.width, |rows| {
        let seen = with_halo(rows, SUPPORT_REACH as u32, l.height);
        Main {
            disparity: b.disparity.bind(&seen),
            flags: b.flags.bind(&seen),
            supported: b.spare_flags.bind(rows),
        }
    })?;
    r.copies(b.spare_flags.copy_to(&b.flags));
    Ok(())
}
