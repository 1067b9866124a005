//! Beliefs: see [`Stage::Belief`](crate::backend::Stage::Belief).
//!
//! Floor, a label: 6 bytes moved and asked for, 20 operations for four; beside that the graph: 8 bytes a pixel, and 4 a member.

use super::buffers::Shared;
use super::rows::{Binding, HALO, Rows, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan};
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/belief.wgsl");
/// Quads of labels of an invocation.
const QUADS: u32 = LABEL_BLOCK as u32 / 4;

uniform! { most: u32, has_down: u32, has_up: u32 }

impl Uniform {
    fn of(plan: &Plan, level: usize) -> Self {
        let (has_down, has_up) = (level + 1 < plan.levels.len(), level > 0);
        Self { most: plan.belief_most().into(), has_down: has_down.into(), has_up: has_up.into() }
    }
}

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let kernel = Kernel::new("belief", "main", SHADER)
        .of_width(plan.volume_width)
        .with("SLOTS", plan.slots() as u32)
        .with("WINDOW", GRAPH_WINDOW as u32)
        .with("RADIUS", HALO)
        .with("QUADS", QUADS);
    // A pixel is a member of at most the factors of its window.
    let (quads, words) = (QUADS as usize, plan.neighbours.div_ceil(4));
    let loops = 2 * quads + GRAPH_WINDOW * GRAPH_WINDOW * (1 + words + quads);
    vec![Job::new::<Uniform>(kernel, loops).over_levels(plan)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, level, here, l) = (r.plan, r.level, r.here(), r.params());
    let own = Uniform::of(plan, level);
    // A level without one kind of messages binds something that is never read.
    let messages = |rows: &Range<u32>, volume: &Rows, there: u32| {
        if there == 1 {
            volume.bind(rows)
        } else {
            Binding::whole(volume.buffers().next().expect("a buffer of no rows"))
        }
    };
    r.rows(&jobs(plan, level)[0], &own, l.width * (l.quads / QUADS), |rows| {
        vec![
            (1, here.evidence.bind(rows)),
            (2, here.dependency.bind(&with_halo(rows, HALO, l.height))),
            (3, here.members.bind(&with_halo(rows, HALO, l.height))),
            (4, here.incoming.bind(rows)),
            (5, messages(rows, &here.down, own.has_down)),
            (6, messages(rows, &here.up, own.has_up)),
            (7, here.belief.bind(rows)),
            (8, here.windows.bind(&(0..1))),
        ]
    })?;
    r.renew(&here.belief);
    Ok(())
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, shared: &Shared, levels: Range<usize>) -> Result<()> {
    let (plan, buffers) = (r.plan, r.buffers);
    let own = |z: usize| {
        let l = buffers.levels[z].params;
        (Uniform::of(plan, z), l.width * (l.quads / QUADS))
    };
    let s = shared;
    let bound = [&s.evidence, &s.dependency, &s.members, &s.incoming, &s.down, &s.up, &s.belief, &s.windows];
    r.levels(&jobs(plan, 0)[0], levels, own, &(1..).zip(bound).collect::<Vec<_>>())
}
