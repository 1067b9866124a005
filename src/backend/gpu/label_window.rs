//! Label windows: see [`Stage::LabelWindow`](crate::backend::Stage::LabelWindow).
//!
//! Windows that hold all labels are there from the start.

use super::rows::{HALO, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::{LABEL_BLOCK, Plan, WINDOW_MARGIN, WINDOW_REACH, WINDOW_RUN, WINDOW_SLACK, WINDOW_STEP};

const SHADER: &str = include_str!("../../../shaders/label_window.wgsl");

uniform! { runs: u32, labels: u32, stride: u32, label_offset: i32 }

pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    let kernel = |entry, reach: u32| {
        Kernel::new("label_window", entry, SHADER)
            .of_width(plan.volume_width)
            .with("WINDOW_STEP", WINDOW_STEP as u32)
            .with("LABEL_BLOCK", LABEL_BLOCK as u32)
            .with("MARGIN", WINDOW_MARGIN)
            .with("SLACK", u32::from(WINDOW_SLACK))
            .with("REACH", reach)
    };
    if plan.windows_follow_beliefs(level) {
        let quads = plan.levels[level + 1].quads();
        let pixels = (2 * WINDOW_REACH + 1) * (2 * WINDOW_REACH + WINDOW_RUN / 2 + 1);
        let reach = WINDOW_REACH as u32;
        vec![
            Job::new::<Uniform>(kernel("candidates", reach), 2 * quads),
            Job::new::<Uniform>(kernel("around", reach), pixels),
        ]
    } else if plan.limits_labels() {
        vec![Job::new::<Uniform>(kernel("within", HALO), 2 * (WINDOW_RUN + 1))]
    } else {
        Vec::new()
    }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (level, here) = (r.level, r.here());
    let l = &r.plan.levels[level];
    let runs = l.windows().0 as u32;
    let own = |label_offset| Uniform { runs, labels: l.labels as u32, stride: l.stride as u32, label_offset };
    let windows = here.windows.bind(&(0..1));
    match &jobs(r.plan, level)[..] {
        [candidates, around] => {
            let own = own(r.plan.label_offset(level + 1));
            let (coarse, height) = (&r.buffers.levels[level + 1], r.plan.levels[level + 1].height as u32);
            r.at(level + 1, 0..height, |r| {
                let width = r.params().width;
                r.rows(candidates, &own, width, |rows| {
                    vec![
                        (1, coarse.belief.bind(rows)),
                        (2, coarse.candidates.bind(rows)),
                        (6, coarse.windows.bind(&(0..1))),
                    ]
                })?;
                r.renew(&coarse.candidates);
                r.rows(around, &own, runs, |rows| {
                    let near = with_halo(rows, WINDOW_REACH as u32, height);
                    vec![(3, coarse.candidates.bind(&near)), (5, windows.clone())]
                })
            })?;
        }
        [within] => {
            let height = r.params().height;
            r.rows(within, &own(0), runs, |rows| {
                vec![(4, here.label_range.bind(&with_halo(rows, HALO, height))), (5, windows.clone())]
            })?;
        }
        _ => {}
    }
    Ok(())
}
