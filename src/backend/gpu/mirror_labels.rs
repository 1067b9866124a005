//! The labels of the mirrored pair: see [`Stage::MirrorLabels`](crate::backend::Stage::MirrorLabels).

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;

shader! {
    "mirror_labels"(plan, level) {}
    main: Main { optima, right_labels } => Kernel::new(0);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&main(r.plan, 0), &Uniform {}, l.width, |rows| Main {
        optima: b.optima.bind(rows),
        right_labels: b.right_labels.bind(rows),
    })
}
