//! Label windows: see [`Stage::LabelWindow`](crate::backend::Stage::LabelWindow).
//!
//! Windows with all labels are uploaded once, so they need no shader.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::HALO;
use crate::error::Result;
use crate::plan::{LABEL_BLOCK, Plan, WINDOW_MARGIN, WINDOW_REACH, WINDOW_RUN, WINDOW_SLACK, WINDOW_STEP};
use crate::stage::Data;

shader! {
    "label_window"(plan, level) { runs: u32, labels: u32, stride: u32, label_offset: i32 }
    candidates { belief, candidates_out, windows } if plan.windows_follow_beliefs(level) => {
        variant(plan, WINDOW_REACH as u32, 2 * plan.levels[level + 1].quads()).at_coarser_level()
    };
    around { candidates_in around WINDOW_REACH, windows_out as fine_windows } if plan.windows_follow_beliefs(level) => {
        let pixels = (2 * WINDOW_REACH + 1) * (2 * WINDOW_REACH + WINDOW_RUN / 2 + 1);
        variant(plan, WINDOW_REACH as u32, pixels).at_coarser_level()
    };
    within { label_range around HALO, windows_out } if limited(plan, level) => {
        variant(plan, HALO, 2 * (WINDOW_RUN + 1))
    };
}

/// Whether the windows of `level` are those of the label ranges.
fn limited(plan: &Plan, level: usize) -> bool {
    plan.limits_labels() && !plan.windows_follow_beliefs(level)
}

fn variant(plan: &Plan, reach: u32, loops: usize) -> Variant {
    Variant::new(loops)
        .of_width(plan.volume_width)
        .with("WINDOW_STEP", WINDOW_STEP as u32)
        .with("LABEL_BLOCK", LABEL_BLOCK as u32)
        .with("MARGIN", WINDOW_MARGIN)
        .with("SLACK", u32::from(WINDOW_SLACK))
        .with("REACH", reach)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, z) = (r.plan, r.level);
    let l = &plan.levels[z];
    let runs = l.windows().0 as u32;
    let own = |label_offset| Uniform { runs, labels: l.labels as u32, stride: l.stride as u32, label_offset };
    if plan.windows_follow_beliefs(z) {
        let own = own(plan.label_offset(z + 1));
        r.rows(&candidates(plan, z), &own, plan.levels[z + 1].width as u32)?;
        r.renew(Data::Candidates(z + 1));
        r.rows(&around(plan, z), &own, runs)
    } else if limited(plan, z) {
        r.rows(&within(plan, z), &own(0), runs)
    } else {
        Ok(())
    }
}
