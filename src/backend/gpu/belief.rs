//! Beliefs: see [`Stage::Belief`](crate::backend::Stage::Belief).
//!
//! Floor, a label: 6 bytes moved and asked for, 20 operations for four; beside that the graph: 8 bytes a pixel, and 4 a member.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use super::rows::{HALO, Rows, with_halo};
use crate::error::Result;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan};
use std::ops::Range;

/// Quads of labels of an invocation.
const QUADS: u32 = LABEL_BLOCK as u32 / 4;

shader! {
    "belief"(plan, level) { most: u32, has_down: u32, has_up: u32 }
    main: Main { evidence, dependency, members, incoming, down, up, belief, windows } => {
        // A pixel is a member of at most the factors of its window.
        let (quads, words) = (QUADS as usize, plan.neighbours.div_ceil(4));
        Kernel::new(2 * quads + GRAPH_WINDOW * GRAPH_WINDOW * (1 + words + quads))
            .of_width(plan.volume_width)
            .with("SLOTS", plan.slots() as u32)
            .with("WINDOW", GRAPH_WINDOW as u32)
            .with("RADIUS", HALO)
            .with("QUADS", QUADS)
            .over_levels(plan)
    };
}

impl Uniform {
    fn of(plan: &Plan, level: usize) -> Self {
        let (has_down, has_up) = (level + 1 < plan.levels.len(), level > 0);
        Self { most: plan.belief_most().into(), has_down: has_down.into(), has_up: has_up.into() }
    }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, level, here, l) = (r.plan, r.level, r.here(), r.params());
    let own = Uniform::of(plan, level);
    // A level without one kind of messages binds something that is never read.
    let messages = |rows: &Range<u32>, volume: &Rows, there: u32| {
        if there == 1 { volume.bind(rows) } else { volume.whole() }
    };
    r.rows(&main(plan, level), &own, l.width * (l.quads / QUADS), |rows| {
        let seen = with_halo(rows, HALO, l.height);
        Main {
            evidence: here.evidence.bind(rows),
            dependency: here.dependency.bind(&seen),
            members: here.members.bind(&seen),
            incoming: here.incoming.bind(rows),
            down: messages(rows, &here.down, own.has_down),
            up: messages(rows, &here.up, own.has_up),
            belief: here.belief.bind(rows),
            windows: here.windows.bind(&(0..1)),
        }
    })?;
    r.renew(&here.belief);
    Ok(())
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let (plan, buffers, shared) = (r.plan, r.buffers, r.shared(&levels));
    let own = |z: usize| {
        let l = buffers.levels[z].params;
        (Uniform::of(plan, z), l.width * (l.quads / QUADS))
    };
    let bindings = Main {
        evidence: shared.evidence.whole(),
        dependency: shared.dependency.whole(),
        members: shared.members.whole(),
        incoming: shared.incoming.whole(),
        down: shared.down.whole(),
        up: shared.up.whole(),
        belief: shared.belief.whole(),
        windows: shared.windows.whole(),
    };
    r.levels(&main(plan, levels.start), levels, own, bindings)
}
