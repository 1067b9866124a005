//! Anchors: see [`Stage::Anchor`](crate::backend::Stage::Anchor).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::stage::NO_ANCHOR;
use crate::stage::anchor::ANCHOR_CONFIDENCE;

shader! {
    "anchor"(plan, level) {}
    main { anchors, disparity, flags } => Variant::new(0)
        .with("NO_ANCHOR", NO_ANCHOR)
        .with("ANCHOR_CONFIDENCE", u32::from(ANCHOR_CONFIDENCE));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
