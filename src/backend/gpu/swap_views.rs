//! The right view in place of the left one: see [`Stage::SwapViews`](crate::backend::Stage::SwapViews).
//!
//! Floor: 88 bytes moved and asked for a pixel.

use super::commands::Recorder;
use super::full_buffers::FullBuffers;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::stage::NO_RUNNER_UP;

shader! {
    "swap_views"(plan, level) { full_pitch: u32 }
    main: Main { left, right, optima, right_labels } => Kernel::new(0)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
    full: Full { full_left, full_right } if plan.full.is_some() => Kernel::new(0)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let own = Uniform { full_pitch: b.full.as_ref().map_or(0, |full| full.pitch) };
    r.rows(&main(r.plan, 0), &own, l.width.div_ceil(2), |rows| Main {
        left: b.left.bind(rows),
        right: b.right.bind(rows),
        optima: b.optima.bind(rows),
        right_labels: b.right_labels.bind(rows),
    })?;
    let Some(larger) = &b.full else { return Ok(()) };
    r.rows(&full(r.plan, 0), &own, 2 * l.width, |rows| Full {
        full_left: larger.left.bind(&FullBuffers::rows(rows)),
        full_right: larger.right.bind(&FullBuffers::rows(rows)),
    })
}
