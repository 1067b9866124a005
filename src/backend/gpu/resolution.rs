//! Messages between two levels: see [`Stage::Resolution`](crate::backend::Stage::Resolution).
//!
//! Floor, for a fine label of level 1: 3 + 3/8 bytes moved, 5.6 asked for (all that is read again after the minimum), 100 operations
//! for four labels.

use super::buffers::Shared;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::{LevelParams, uniform};
use crate::error::Result;
use crate::plan::{Plan, TruncationRule};
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/resolution.wgsl");

uniform! { fine: LevelParams, label_offset: i32, tau: u32, fine_at: u32 }

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

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    // The finest levels have the most labels.
    let (coarse, fine) = (plan.levels[1].stride, plan.levels[0].stride);
    let kernel = Kernel::new("resolution", "main", SHADER)
        .of_width(plan.volume_width)
        .with("ABSOLUTE", plan.resolution.rule == TruncationRule::Absolute)
        .with("INTERPOLATING", plan.interpolating());
    vec![Job::new::<Uniform>(kernel, fine + 3 * coarse + fine / 2).over_levels(plan)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform::of(r, r.level);
    r.rows(&jobs(r.plan, r.level)[0], &own, l.width, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        vec![
            (1, finer.belief.bind(&fine_rows)),
            (2, here.belief.bind(rows)),
            (3, finer.down.bind(&fine_rows)),
            (4, here.up.bind(rows)),
            (5, here.windows.bind(&(0..1))),
            (6, finer.windows.bind(&(0..1))),
        ]
    })
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, shared: &Shared, levels: Range<usize>) -> Result<()> {
    let own = levels.clone().map(|z| {
        let (fine, (fine_at, _)) = r.buffers.levels[z - 1].shared_params(r.plan);
        (Uniform { fine, fine_at, ..Uniform::of(r, z) }, r.buffers.levels[z].params.width)
    });
    let (own, first): (Vec<_>, _) = (own.collect(), levels.start);
    let s = shared;
    let bound = [&s.belief, &s.belief, &s.down, &s.up, &s.windows, &s.windows];
    r.levels(&jobs(r.plan, 1)[0], levels, |z| own[z - first], &(1..).zip(bound).collect::<Vec<_>>())
}
