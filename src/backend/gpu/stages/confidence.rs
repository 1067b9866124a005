//! The lead of each pixel's label: see [`Stage::Confidence`](crate::backend::Stage::Confidence).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "confidence"(plan, level) {}
    main { optima, flags } => Variant::new(0);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
