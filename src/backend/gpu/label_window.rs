//! Label windows: see [`Stage::LabelWindow`](crate::backend::Stage::LabelWindow).
//!
//! Windows that hold all labels are there from the start.

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{HALO, with_halo};
use crate::error::Result;
use crate::plan::{LABEL_BLOCK, Plan, WINDOW_MARGIN, WINDOW_REACH, WINDOW_RUN, WINDOW_SLACK, WINDOW_STEP};

shader! {
    "label_window"(plan, level) { runs: u32, labels: u32, stride: u32, label_offset: i32 }
    candidates: FindCandidates { belief, candidates_out, windows } if plan.windows_follow_beliefs(level) => {
        kernel(plan, WINDOW_REACH as u32, 2 * plan.levels[level + 1].quads())
    };
    around: Around { candidates_in, windows_out } if plan.windows_follow_beliefs(level) => {
        let pixels = (2 * WINDOW_REACH + 1) * (2 * WINDOW_REACH + WINDOW_RUN / 2 + 1);
        kernel(plan, WINDOW_REACH as u32, pixels)
    };
    within: Within { label_range, windows_out } if limited(plan, level) => {
        kernel(plan, HALO, 2 * (WINDOW_RUN + 1))
    };
}

/// Whether the windows of `level` hold the label ranges.
fn limited(plan: &Plan, level: usize) -> bool {
    plan.limits_labels() && !plan.windows_follow_beliefs(level)
}

fn kernel<B: Bindings>(plan: &Plan, reach: u32, loops: usize) -> Kernel<B> {
    Kernel::new(loops)
        .of_width(plan.volume_width)
        .with("WINDOW_STEP", WINDOW_STEP as u32)
        .with("LABEL_BLOCK", LABEL_BLOCK as u32)
        .with("MARGIN", WINDOW_MARGIN)
        .with("SLACK", u32::from(WINDOW_SLACK))
        .with("REACH", reach)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, level, here) = (r.plan, r.level, r.here());
    let l = &plan.levels[level];
    let runs = l.windows().0 as u32;
    let own = |label_offset| Uniform { runs, labels: l.labels as u32, stride: l.stride as u32, label_offset };
    let windows_out = here.windows.bind(&(0..1));
    if plan.windows_follow_beliefs(level) {
        let own = own(plan.label_offset(level + 1));
        let (coarse, height) = (&r.buffers.levels[level + 1], plan.levels[level + 1].height as u32);
        r.at(level + 1, 0..height, |r| {
            let width = r.params().width;
            r.rows(&candidates(plan, level), &own, width, |rows| FindCandidates {
                belief: coarse.belief.bind(rows),
                candidates_out: coarse.candidates.bind(rows),
                windows: coarse.windows.bind(&(0..1)),
            })?;
            r.renew(&coarse.candidates);
            r.rows(&around(plan, level), &own, runs, |rows| {
                let near = with_halo(rows, WINDOW_REACH as u32, height);
                Around { candidates_in: coarse.candidates.bind(&near), windows_out: windows_out.clone() }
            })
        })
    } else if limited(plan, level) {
        let height = r.params().height;
        r.rows(&within(plan, level), &own(0), runs, |rows| Within {
            label_range: here.label_range.bind(&with_halo(rows, HALO, height)),
            windows_out: windows_out.clone(),
        })
    } else {
        Ok(())
    }
}
