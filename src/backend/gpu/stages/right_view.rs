//! The map of the right view: see [`Stage::RightView`](crate::backend::Stage::RightView).
//!
//! Lower bound for four labels: 4 bytes moved, 16 requested (words of four labels, one used), 20 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "right_view"(plan, level) { first_column: u32, columns: u32 }
    main { belief, left, right_labels } => Variant::new(plan.levels[0].labels).of_width(plan.volume_width);
}

/// The columns depend on the core of the tile, so each tile has its own commands.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (core, width) = (&r.plan.core, r.params().width);
    let own = Uniform { first_column: core.start as u32, columns: core.len() as u32 };
    r.rows(&main(r.plan, 0), &own, width)
}
