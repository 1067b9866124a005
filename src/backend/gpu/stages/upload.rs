//! Unpacks uploaded images: those in whole 8-bit levels are uploaded as one word per pixel.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "upload"(plan, level) {}
    main { left_words, right_words, left, right } => Variant::new(0);
}

/// Unpacks the words of the pair.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
