//! Beliefs: see [`Stage::Belief`](crate::backend::Stage::Belief).
//!
//! Lower bound per label: 6 bytes moved and requested, 5 operations; for the graph 8 bytes per pixel and 4 per member.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::HALO;
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK};
use crate::program::Sent;
use crate::stage::{Data, Volume};
use std::ops::Range;

/// Quads of labels per invocation.
const QUADS: u32 = LABEL_BLOCK as u32 / 4;

shader! {
    "belief"(plan, level) { most: u32, sent: u32, has_down: u32, has_up: u32 }
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
    fn of(r: &Recorder, level: usize) -> Self {
        let Sent { dependency, above, below } = r.sent(level);
        let most = r.plan.belief_most().into();
        Self { most, sent: dependency.into(), has_down: above.into(), has_up: below.into() }
    }
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (z, threads) = (r.level, threads(&r.params()));
    r.rows(&main(r.plan, z), &Uniform::of(r, z), threads)?;
    r.renew(Data::Volume(Volume::Belief(z)));
    Ok(())
}

/// Like `record`, in one dispatch for all `levels`.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let own: Vec<_> = levels.clone().map(|z| (Uniform::of(r, z), threads(&r.buffers.levels[z]))).collect();
    let first = levels.start;
    r.levels(&main(r.plan, first), levels, |z| own[z - first])
}

fn threads(level: &LevelParams) -> u32 {
    level.width * (level.quads / QUADS)
}
