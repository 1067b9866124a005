//! The confidence of each pixel by itself: see [`Stage::Confidence`](crate::backend::Stage::Confidence).

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;

shader! {
    "confidence"(plan, level) {}
    main: Main { optima, flags } => Kernel::new(0);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&main(r.plan, 0), &Uniform {}, l.width, |rows| Main {
        optima: b.optima.bind(rows),
        flags: b.flags.bind(rows),
    })
}
