//! The graph of a level: see [`Stage::Graph`](crate::backend::Stage::Graph).

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{HALO, Rows, with_halo};
use super::uniform::LevelParams;
use crate::error::Result;
use crate::graph::{NO_KEY, NO_MEMBER, RANK_BITS, by_distance, code, spatial_weight};
use crate::plan::{GRAPH_WINDOW, Plan};
use std::ops::Range;

/// Neighbours that `choose` finds in one pass over the window, at most.
const CHOSEN: usize = 8;
/// Places of the window besides the centre.
const PLACES: usize = GRAPH_WINDOW * GRAPH_WINDOW - 1;

shader! {
    "graph"(plan, level) {
        ranked: [[u32; 4]; PLACES / 16], fine: LevelParams, weight: u32, guide_at: u32, fine_at: u32
    }
    downsample: Downsample { guide, coarse_guide } if level > 0 => kernel(plan, 5 * 6);
    choose: Choose { guide, members_out } if plan.neighbours > 0 => {
        let chosen = chosen(plan);
        let pass = chosen + PLACES * (1 + chosen) + chosen.div_ceil(4) * 5;
        kernel(plan, plan.neighbours.div_ceil(chosen) * pass)
    };
    transpose: Transpose { members_in, incoming } if plan.neighbours > 0 => {
        kernel(plan, (PLACES + 1) * (1 + plan.neighbours.div_ceil(4)))
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

fn kernel<B: Bindings>(plan: &Plan, loops: usize) -> Kernel<B> {
    Kernel::new(loops)
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
    let (plan, here, l) = (r.plan, r.here(), r.params());
    record_guide(r)?;
    if plan.neighbours > 0 {
        r.rows(&choose(plan, r.level), &Uniform::of(plan), l.width, |rows| Choose {
            guide: here.guide.bind(&with_halo(rows, HALO, l.height)),
            members_out: here.members.bind(rows),
        })?;
    }
    record_transposed(r)
}

/// The same for all of `levels` at once, but for their guides.
pub(super) fn record_levels(r: &mut Recorder, levels: Range<usize>) -> Result<()> {
    for z in levels.clone() {
        r.level = z;
        record_guide(r)?;
    }
    let (plan, buffers, shared) = (r.plan, r.buffers, r.shared(&levels));
    if plan.neighbours > 0 {
        let own = |z: usize| {
            let here = &buffers.levels[z];
            (Uniform { guide_at: here.guide_at(), ..Uniform::of(plan) }, here.params.width)
        };
        let [guide, members, incoming] = [&shared.guide, &shared.members, &shared.incoming].map(Rows::whole);
        let bindings = Choose { guide, members_out: members.clone() };
        r.levels(&choose(plan, levels.start), levels.clone(), own, bindings)?;
        let bindings = Transpose { members_in: members, incoming };
        r.levels(&transpose(plan, levels.start), levels, own, bindings)?;
    }
    Ok(())
}

/// Makes the guide of the level from that of the next finer one.
fn record_guide(r: &mut Recorder) -> Result<()> {
    if r.level == 0 {
        return Ok(());
    }
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform { fine: finer.params, ..Uniform::default() };
    // A dispatch must not read and write one buffer.
    let next = r.buffers.next_guide(&l);
    r.rows(&downsample(r.plan, r.level), &own, l.width, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        let seen = with_halo(&fine_rows, 2, finer.params.height);
        Downsample { guide: finer.guide.bind(&seen), coarse_guide: next.bind(rows) }
    })?;
    r.copies(next.copy_to(&here.guide));
    Ok(())
}

/// Finds for every pixel the factors that hold it.
pub(super) fn record_transposed(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    r.renew(&here.members);
    if r.plan.neighbours == 0 {
        return Ok(());
    }
    r.rows(&transpose(r.plan, r.level), &Uniform::default(), l.width, |rows| Transpose {
        members_in: here.members.bind(&with_halo(rows, HALO, l.height)),
        incoming: here.incoming.bind(rows),
    })
}
