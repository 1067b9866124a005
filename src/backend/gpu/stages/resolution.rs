//! Messages between two levels: see [`Stage::Resolution`](crate::backend::Stage::Resolution).
//!
//! Lower bound per fine label of level 1: 3 + 3/8 bytes moved, 5.6 requested (all data again after the
//! minimum), 100 operations for four labels.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::plan::TruncationRule;
use std::ops::Range;

shader! {
    "resolution"(plan, level) { fine: LevelParams, label_offset: i32, tau: u32, fine_at: u32, sent: u32 }
    main { fine_belief, belief, fine_down, up, windows, fine_windows } => {
        // The finest levels have the most labels.
        let (coarse, fine) = (plan.levels[1].stride, plan.levels[0].stride);
        Variant::new(fine + 3 * coarse + fine / 2)
            .of_width(plan.volume_width)
            .with("ABSOLUTE", plan.resolution.rule == TruncationRule::Absolute)
            .with("INTERPOLATING", plan.interpolating())
            .over_levels(plan)
    };
}

impl Uniform {
    fn of(r: &Recorder, level: usize) -> Self {
        Self {
            fine: r.buffers.levels[level - 1],
            label_offset: r.plan.label_offset(level),
            tau: r.plan.resolution.tau.into(),
            fine_at: 0,
            sent: r.sent(level).below.into(),
        }
    }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, r.level), &Uniform::of(r, r.level), width)
}

/// Like `record`, in one dispatch for all `levels`.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let own = levels.clone().map(|z| {
        let (fine, (fine_at, _)) = r.buffers.shared_params(r.plan, z - 1);
        (Uniform { fine, fine_at, ..Uniform::of(r, z) }, r.buffers.levels[z].width)
    });
    let (own, first): (Vec<_>, _) = (own.collect(), levels.start);
    r.levels(&main(r.plan, first), levels, |z| own[z - first])
}
