//! Messages of the dependency factors: see [`Stage::Dependency`](crate::backend::Stage::Dependency).
//!
//! Floor, a label and three members: 7 bytes moved, 15 asked for (the beliefs of three members, all of it again after the
//! minimum), 50 operations for four labels.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use super::rows::{HALO, with_halo};
use crate::error::Result;
use crate::graph::NO_MEMBER;
use crate::plan::{GRAPH_WINDOW, Plan, TruncationRule};
use std::ops::Range;

shader! {
    "dependency"(plan, level) { tau: u32, step: u32 }
    main: Main { members, belief, messages, windows } => {
        let absolute = plan.dependency.rule == TruncationRule::Absolute;
        // The finest level has the most labels.
        let (quads, slots) = (plan.levels[0].quads(), plan.slots());
        let floors = if absolute { slots * (quads + 1) } else { 0 };
        Kernel::new(floors + 3 * slots + 2 * quads * (2 * slots + 1))
            .of_width(plan.volume_width)
            .with("SLOTS", slots as u32)
            .with("ABSOLUTE", absolute)
            .with("STEPS", plan.label_step(level).is_some())
            .with("NO_MEMBER", u32::from(NO_MEMBER))
            .with("WINDOW", GRAPH_WINDOW as u32)
            .with("RADIUS", HALO)
            .over_levels(plan)
    };
}

/// That of `level`: where a step costs as much as any disagreement, it is none.
fn uniform(plan: &Plan, level: usize) -> Uniform {
    let tau = plan.dependency.tau;
    Uniform { tau: tau.into(), step: plan.label_step(level).unwrap_or(tau).into() }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    let own = uniform(r.plan, r.level);
    r.rows(&main(r.plan, r.level), &own, l.width, |rows| Main {
        members: here.members.bind(rows),
        belief: here.belief.bind(&with_halo(rows, HALO, l.height)),
        messages: here.dependency.bind(rows),
        windows: here.windows.bind(&(0..1)),
    })?;
    r.renew(&here.dependency);
    Ok(())
}

/// The same for all of `levels` at once.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let (plan, buffers, shared) = (r.plan, r.buffers, r.shared(&levels));
    let own = |z: usize| (uniform(plan, z), buffers.levels[z].params.width);
    let bindings = Main {
        members: shared.members.whole(),
        belief: shared.belief.whole(),
        messages: shared.dependency.whole(),
        windows: shared.windows.whole(),
    };
    // The coarsest has steps wherever another one has.
    r.levels(&main(plan, levels.end - 1), levels, own, bindings)
}
