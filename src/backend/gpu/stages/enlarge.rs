//! Upsampled maps: see [`Stage::Enlarge`](crate::backend::Stage::Enlarge).
//!
//! Lower bound per half-size pixel: 110 bytes moved; 900 bytes requested and 800 operations for its four pixels.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::full_pitch;
use crate::error::Result;
use crate::maps::FRACTION;
use crate::stage::enlarge::{AWAY, NEAR};

shader! {
    "enlarge"(plan, level) { full_pitch: u32, low: i32, high: i32 }
    main {
        left around 1, raw around 1, disparity around 1, flags around 1,
        full_left, full_raw, full_disparity, full_flags
    } =>
        Variant::new(2 * 3 * 4).with("AWAY", AWAY).with("NEAR", NEAR);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (width, range) = (r.params().width, r.plan.of_pair().range);
    let (low, high) = (FRACTION * range.min, FRACTION * range.max);
    let own = Uniform { full_pitch: full_pitch(r.plan), low, high };
    r.rows(&main(r.plan, 0), &own, 4 * width)
}
