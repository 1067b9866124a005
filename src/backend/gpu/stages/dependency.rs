//! Messages of the dependency factors: see [`Stage::Dependency`](crate::backend::Stage::Dependency).
//!
//! Lower bound per label, with three members: 7 bytes moved, 15 requested (the beliefs of three members, all
//! again after the minimum), 50 operations for four labels.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::HALO;
use crate::error::Result;
use crate::graph::NO_MEMBER;
use crate::plan::{GRAPH_WINDOW, TruncationRule};
use crate::stage::{Data, Volume};
use std::ops::Range;

shader! {
    "dependency"(plan, level) { tau: u32, step: u32, sent: u32 }
    main { members, belief around HALO, dependency, windows } => {
        let absolute = plan.dependency.rule == TruncationRule::Absolute;
        // The finest level has the most labels.
        let (quads, slots) = (plan.levels[0].quads(), plan.slots());
        let floors = if absolute { slots * (quads + 1) } else { 0 };
        Variant::new(floors + 3 * slots + 2 * quads * (2 * slots + 1))
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

/// The uniform of `level`. A step that costs as much as any disagreement has no effect.
fn uniform(r: &Recorder, level: usize) -> Uniform {
    let tau = r.plan.dependency.tau;
    let step = r.plan.label_step(level).unwrap_or(tau);
    Uniform { tau: tau.into(), step: step.into(), sent: r.sent(level).dependency.into() }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, z, width) = (r.plan, r.level, r.params().width);
    r.rows(&main(plan, z), &uniform(r, z), width)?;
    r.renew(Data::Volume(Volume::Dependency(z)));
    Ok(())
}

/// Like `record`, in one dispatch for all `levels`.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let own: Vec<_> = levels.clone().map(|z| (uniform(r, z), r.buffers.levels[z].width)).collect();
    let first = levels.start;
    // The coarsest level has a step if any other one has.
    r.levels(&main(r.plan, levels.end - 1), levels, |z| own[z - first])
}
