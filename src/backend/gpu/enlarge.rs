//! The maps at full size: see [`Stage::Enlarge`](crate::backend::Stage::Enlarge).
//!
//! Floor, a pixel of half the size: 110 bytes moved; 900 bytes asked for and 800 operations for its four pixels.

use super::commands::Recorder;
use super::full_buffers::FullBuffers;
use super::kernel::{Kernel, shader};
use super::rows::with_halo;
use crate::error::Result;
use crate::maps::FRACTION;
use crate::stage::enlarge::{AWAY, NEAR};

shader! {
    "enlarge"(plan, level) { full_pitch: u32, low: i32, high: i32 }
    main: Main { left, raw, disparity, flags, full_left, full_raw, full_disparity, full_flags } =>
        Kernel::new(2 * 3 * 4).with("AWAY", AWAY).with("NEAR", NEAR);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l, range) = (r.buffers, r.params(), r.plan.of_pair().range);
    let full = b.full.as_ref().expect("buffers for the full size");
    let own = Uniform { full_pitch: full.pitch, low: FRACTION * range.min, high: FRACTION * range.max };
    r.rows(&main(r.plan, 0), &own, 4 * l.width, |rows| {
        let (seen, larger) = (with_halo(rows, 1, l.height), FullBuffers::rows(rows));
        Main {
            left: b.left.bind(&seen),
            raw: b.raw.bind(&seen),
            disparity: b.disparity.bind(&seen),
            flags: b.flags.bind(&seen),
            full_left: full.left.bind(&larger),
            full_raw: full.raw.bind(&larger),
            full_disparity: full.disparity.bind(&larger),
            full_flags: full.flags.bind(&larger),
        }
    })
}
