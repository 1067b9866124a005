//! Messages between two levels: see [`Stage::Resolution`](crate::backend::Stage::Resolution).
//!
//! Floor, for a fine label of level 1: 3 + 3/8 bytes moved, 17 asked for (words of four labels, once a label and once more after
//! the minimum), 100 operations for four labels.

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::{LevelParams, uniform};
use crate::error::Result;
use crate::plan::{Plan, TruncationRule};

const SHADER: &str = include_str!("../../../shaders/resolution.wgsl");

uniform! { fine: LevelParams, padding: [u32; 3], label_offset: i32, tau: u32 }

pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    let (coarse, fine) = (plan.levels[level].stride, plan.levels[level - 1].stride);
    let kernel = Kernel::new("resolution", "main", SHADER)
        .of_width(plan.volume_width)
        .with("ABSOLUTE", plan.resolution.rule == TruncationRule::Absolute)
        .with("INTERPOLATING", plan.interpolating());
    vec![Job::new::<Uniform>(kernel, fine + 3 * coarse + fine / 2)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform {
        fine: finer.params,
        label_offset: r.plan.label_offset(r.level),
        tau: r.plan.resolution.tau.into(),
        ..Uniform::default()
    };
    r.rows(&jobs(r.plan, r.level)[0], &own, l.width, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        vec![
            (1, finer.belief.bind(&fine_rows)),
            (2, here.belief.bind(rows)),
            (3, finer.down.bind(&fine_rows)),
            (4, here.up.bind(rows)),
        ]
    })
}
