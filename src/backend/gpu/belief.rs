//! Beliefs: see [`Stage::Belief`](crate::backend::Stage::Belief).
//!
//! Floor, a label: 6 bytes moved and asked for, 20 operations for four; beside that the graph: 8 bytes a pixel, and 4 a member.

use super::buffers::{Binding, HALO, Rows, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan};
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/belief.wgsl");
/// Quads of labels of an invocation.
const QUADS: u32 = LABEL_BLOCK as u32 / 4;

uniform! { most: u32 }

pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    let kernel = Kernel::new("belief", "main", SHADER)
        .of_width(plan.volume_width)
        .with("HAS_DOWN", level + 1 < plan.levels.len())
        .with("HAS_UP", level > 0)
        .with("SLOTS", plan.slots() as u32)
        .with("WINDOW", GRAPH_WINDOW as u32)
        .with("RADIUS", HALO)
        .with("QUADS", QUADS);
    // A pixel is a member of at most the factors of its window.
    let (quads, words) = (QUADS as usize, plan.neighbours.div_ceil(4));
    vec![Job::new::<Uniform>(kernel, 2 * quads + GRAPH_WINDOW * GRAPH_WINDOW * (1 + words + quads))]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, level, here, l) = (r.plan, r.level, r.here(), r.params());
    let own = Uniform { most: plan.belief_most().into() };
    // A level without one kind of messages binds something that is never read.
    let messages = |rows: &Range<u32>, volume: &Rows, there: bool| {
        if there {
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
            (5, messages(rows, &here.down, level + 1 < plan.levels.len())),
            (6, messages(rows, &here.up, level > 0)),
            (7, here.belief.bind(rows)),
            (8, Binding::whole(&here.windows)),
        ]
    })?;
    r.renew(&here.belief);
    Ok(())
}
