//! The labels of the mirrored pair: see [`Stage::MirrorLabels`](crate::backend::Stage::MirrorLabels).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "mirror_labels"(plan, level) {}
    main { optima, right_labels } => Variant::new(0);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
