//! The right view in place of the left one: see [`Stage::SwapViews`](crate::backend::Stage::SwapViews).
//!
//! Floor: 88 bytes moved and asked for a pixel.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::stage::NO_RUNNER_UP;

shader! {
    "swap_views"(plan, level) {}
    main: Main { left, right, optima, right_labels } => Kernel::new(0)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&main(r.plan, 0), &Uniform {}, l.width.div_ceil(2), |rows| Main {
        left: b.left.bind(rows),
        right: b.right.bind(rows),
        optima: b.optima.bind(rows),
        right_labels: b.right_labels.bind(rows),
    })
}
