//! Messages between two levels: see [`Stage::Resolution`](crate::backend::Stage::Resolution).
//!
//! Floor, for a fine label of level 1: 3 + 3/8 bytes moved, 5.6 asked for (all that is read again after the minimum), 100 operations
//! for four labels.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use super::uniform::LevelParams;
use crate::error::Result;
use crate::plan::TruncationRule;
use std::ops::Range;

shader! {
    "resolution"(plan, level) { fine: LevelParams, label_offset: i32, tau: u32, fine_at: u32 }
    main: Main { fine_belief, coarse_belief, down, up, windows, fine_windows } => {
        // The finest levels have the most labels.
        let (coarse, fine) = (plan.levels[1].stride, plan.levels[0].stride);
        Kernel::new(fine + 3 * coarse + fine / 2)
            .of_width(plan.volume_width)
            .with("ABSOLUTE", plan.resolution.rule == TruncationRule::Absolute)
            .with("INTERPOLATING", plan.interpolating())
            .over_levels(plan)
    };
}

impl Uniform {
    fn of(r: &Recorder, level: usize) -> Self {
        Self {
            fine: r.buffers.levels[level - 1].params,
            label_offset: r.plan.label_offset(level),
            tau: r.plan.resolution.tau.into(),
            fine_at: 0,
        }
    }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform::of(r, r.level);
    r.rows(&main(r.plan, r.level), &own, l.width, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        Main {
            fine_belief: finer.belief.bind(&fine_rows),
            coarse_belief: here.belief.bind(rows),
            down: finer.down.bind(&fine_rows),
            up: here.up.bind(rows),
            windows: here.windows.bind(&(0..1)),
            fine_windows: finer.windows.bind(&(0..1)),
        }
    })
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let own = levels.clone().map(|z| {
        let (fine, (fine_at, _)) = r.buffers.levels[z - 1].shared_params(r.plan);
        (Uniform { fine, fine_at, ..Uniform::of(r, z) }, r.buffers.levels[z].params.width)
    });
    let (own, first, shared): (Vec<_>, _, _) = (own.collect(), levels.start, r.shared(&levels));
    let bindings = Main {
        fine_belief: shared.belief.whole(),
        coarse_belief: shared.belief.whole(),
        down: shared.down.whole(),
        up: shared.up.whole(),
        windows: shared.windows.whole(),
        fine_windows: shared.windows.whole(),
    };
    r.levels(&main(r.plan, first), levels, |z| own[z - first], bindings)
}
