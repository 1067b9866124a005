//! Exchanges the views: see [`Stage::SwapViews`](crate::backend::Stage::SwapViews).
//!
//! Lower bound per pixel: 88 bytes moved and requested.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::full_pitch;
use crate::error::Result;
use crate::stage::NO_RUNNER_UP;

shader! {
    "swap_views"(plan, level) { full_pitch: u32 }
    main { left, right, optima, right_labels } => Variant::new(0)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
    full { full_left, full_right } if plan.full.is_some() => Variant::new(0)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    let own = Uniform { full_pitch: full_pitch(r.plan) };
    r.rows(&main(r.plan, 0), &own, width.div_ceil(2))?;
    if r.plan.full.is_some() { r.rows(&full(r.plan, 0), &own, 2 * width) } else { Ok(()) }
}
