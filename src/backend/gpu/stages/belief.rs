//! Beliefs: see [`Stage::Belief`](crate::backend::Stage::Belief).
//!
//! Lower bound per label: 6 bytes moved and requested, 5 operations; for the graph 8 bytes per pixel and 4 per member.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::HALO;
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan};
use crate::stage::{Data, Volume};
use std::ops::Range;

/// Quads of labels per invocation.
const QUADS: u32 = LABEL_BLOCK as u32 / 4;

shader! {
    "belief"(plan, level) { most: u32, has_down: u32, has_up: u32 }
    main {
        evidence, dependency around HALO, members around HALO, incoming, down, up, belief, windows
    } => {
        // A pixel is a member of at most the factors of its window.
        let (quads, words) = (QUADS as usize, plan.neighbours.div_ceil(4));
        Variant::new(2 * quads + GRAPH_WINDOW * GRAPH_WINDOW * (1 + words + quads))
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
    let (z, threads) = (r.level, threads(&r.params()));
    r.rows(&main(r.plan, z), &Uniform::of(r.plan, z), threads)?;
    r.renew(Data::Volume(Volume::Belief(z)));
    Ok(())
}

/// Like `record`, in one dispatch for all `levels`.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let (plan, buffers) = (r.plan, r.buffers);
    let own = |z: usize| (Uniform::of(plan, z), threads(&buffers.levels[z]));
    r.levels(&main(plan, levels.start), levels, own)
}

fn threads(level: &LevelParams) -> u32 {
    level.width * (level.quads / QUADS)
}
