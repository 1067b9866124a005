//! The pair on its way to the device: images of whole 8-bit levels go up in one word a pixel, and the device takes these apart.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;

shader! {
    "upload"(plan, level) {}
    main: Main { left_words, right_words, left, right } => Kernel::new(0);
}

/// Takes the words of the pair apart. They are in the spare maps, which no stage needs before.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&main(r.plan, 0), &Uniform {}, l.width, |rows| Main {
        left_words: b.spare_disparity.bind(rows),
        right_words: b.spare_flags.bind(rows),
        left: b.left.bind(rows),
        right: b.right.bind(rows),
    })
}
