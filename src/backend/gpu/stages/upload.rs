//! The pair on its way to the device: images of whole 8-bit levels go up in one word a pixel, and the device takes these apart.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "upload"(plan, level) {}
    main { left_words, right_words, left, right } => Variant::new(0);
}

/// Takes the words of the pair apart.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
