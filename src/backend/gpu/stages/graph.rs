//! The graph of a level: see [`Stage::Graph`](crate::backend::Stage::Graph).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Kernel, Variant, shader};
use crate::backend::gpu::rows::HALO;
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::graph::{NO_KEY, NO_MEMBER, RANK_BITS, by_distance, code, spatial_weight};
use crate::plan::{GRAPH_WINDOW, Plan};
use crate::stage::Data;
use std::ops::Range;

/// Largest number of neighbours that `choose` finds in one pass over the window.
const CHOSEN: usize = 8;
/// Places of the window besides the centre.
const PLACES: usize = GRAPH_WINDOW * GRAPH_WINDOW - 1;

shader! {
    "graph"(plan, level) {
        ranked: [[u32; 4]; PLACES / 16], fine: LevelParams, weight: u32, guide_at: u32, fine_at: u32
    }
    downsample { fine_guide around 2, next_guide } if level > 0 => variant(plan, 5 * 6);
    choose { guide around HALO, members_out } if plan.neighbours > 0 => {
        let chosen = chosen(plan);
        let pass = chosen + PLACES * (1 + chosen) + chosen.div_ceil(4) * 5;
        variant(plan, plan.neighbours.div_ceil(chosen) * pass)
    };
    transpose { members_in around HALO, incoming } if plan.neighbours > 0 => {
        variant(plan, (PLACES + 1) * (1 + plan.neighbours.div_ceil(4)))
    };
}

impl Uniform {
    fn of(plan: &Plan) -> Self {
        let mut ranked = [[0; 4]; PLACES / 16];
        for (rank, (dx, dy)) in by_distance().into_iter().enumerate() {
            ranked[rank / 16][rank / 4 % 4] |= u32::from(code(dx, dy)) << (8 * (rank % 4));
        }
        Self { ranked, weight: spatial_weight(&plan.method), ..Self::default() }
    }
}

/// Neighbours that `choose` finds in one pass.
fn chosen(plan: &Plan) -> usize {
    plan.neighbours.clamp(1, CHOSEN)
}

fn variant(plan: &Plan, loops: usize) -> Variant {
    Variant::new(loops)
        .with("NEIGHBOURS", plan.neighbours as u32)
        .with("CHOSEN", chosen(plan) as u32)
        .with("NO_MEMBER", u32::from(NO_MEMBER))
        .with("NO_KEY", NO_KEY)
        .with("RANK_BITS", RANK_BITS)
        .with("PLACES", PLACES as u32)
        .with("WINDOW", GRAPH_WINDOW as u32)
        .with("RADIUS", HALO)
        .over_levels(plan)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, width) = (r.plan, r.params().width);
    if r.level > 0 {
        record_guide(r, &downsample(plan, r.level))?;
        r.replace(Data::Guide(r.level), Data::NextGuide(r.level));
    }
    if plan.neighbours > 0 {
        r.rows(&choose(plan, r.level), &Uniform::of(plan), width)?;
    }
    record_transposed(r)
}

/// Like `record`, with one dispatch for all `levels`, except for their guides.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    let coarser = levels.start.max(1)..levels.end;
    for z in coarser.clone() {
        r.level = z;
        // All copies follow the last guide, because each one ends a compute pass.
        let kernel = downsample(r.plan, z);
        let is_first = z == coarser.start;
        let kernel = if is_first { kernel } else { kernel.taking("fine_guide", "fine_next_guide") };
        record_guide(r, &kernel)?;
    }
    for z in coarser {
        r.replace(Data::Guide(z), Data::NextGuide(z));
    }
    let (plan, buffers) = (r.plan, r.buffers);
    if plan.neighbours > 0 {
        let own = |z: usize| {
            // In pixels.
            let guide_at = buffers.rows(plan, Data::Guide(z)).start(16);
            (Uniform { guide_at, ..Uniform::of(plan) }, buffers.levels[z].width)
        };
        r.levels(&choose(plan, levels.start), levels.clone(), own)?;
        r.levels(&transpose(plan, levels.start), levels, own)?;
    }
    Ok(())
}

/// Computes the next guide of the level from the next finer one. Guides may share a buffer, which a dispatch must
/// not both read and write.
fn record_guide(r: &mut Recorder, downsample: &Kernel<Uniform>) -> Result<()> {
    let (z, width) = (r.level, r.params().width);
    let own = Uniform { fine: r.buffers.levels[z - 1], ..Uniform::default() };
    r.rows(downsample, &own, width)
}

/// Finds the factors that hold each pixel.
pub(super) fn record_transposed(r: &mut Recorder) -> Result<()> {
    r.renew(Data::Members(r.level));
    if r.plan.neighbours == 0 {
        return Ok(());
    }
    let width = r.params().width;
    r.rows(&transpose(r.plan, r.level), &Uniform::default(), width)
}
