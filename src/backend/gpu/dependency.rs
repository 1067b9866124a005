//! Messages of the dependency factors: see [`Stage::Dependency`](crate::backend::Stage::Dependency).
//!
//! Floor, a label and three members: 7 bytes moved, 15 asked for (the beliefs of three members, all of it again after the
//! minimum), 50 operations for four labels.

use super::buffers::Shared;
use super::rows::{HALO, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::graph::NO_MEMBER;
use crate::plan::{GRAPH_WINDOW, Plan, TruncationRule};
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/dependency.wgsl");

uniform! { tau: u32 }

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let absolute = plan.dependency.rule == TruncationRule::Absolute;
    // The finest level has the most labels.
    let (quads, slots) = (plan.levels[0].quads(), plan.slots());
    let kernel = Kernel::new("dependency", "main", SHADER)
        .of_width(plan.volume_width)
        .with("SLOTS", slots as u32)
        .with("ABSOLUTE", absolute)
        .with("NO_MEMBER", u32::from(NO_MEMBER))
        .with("WINDOW", GRAPH_WINDOW as u32)
        .with("RADIUS", HALO);
    let floors = if absolute { slots * (quads + 1) } else { 0 };
    let loops = floors + 3 * slots + 2 * quads * (2 * slots + 1);
    vec![Job::new::<Uniform>(kernel, loops).over_levels(plan)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    let own = Uniform { tau: r.plan.dependency.tau.into() };
    r.rows(&jobs(r.plan, r.level)[0], &own, l.width, |rows| {
        let seen = with_halo(rows, HALO, l.height);
        vec![
            (1, here.members.bind(rows)),
            (2, here.belief.bind(&seen)),
            (3, here.dependency.bind(rows)),
            (4, here.windows.bind(&(0..1))),
        ]
    })?;
    r.renew(&here.dependency);
    Ok(())
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, shared: &Shared, levels: Range<usize>) -> Result<()> {
    let (plan, buffers) = (r.plan, r.buffers);
    let own = |z: usize| (Uniform { tau: plan.dependency.tau.into() }, buffers.levels[z].params.width);
    let bound = [(1, &shared.members), (2, &shared.belief), (3, &shared.dependency), (4, &shared.windows)];
    r.levels(&jobs(plan, 0)[0], levels, own, &bound)
}
