//! The graph of a level: see [`Stage::Graph`](crate::backend::Stage::Graph).

use super::buffers::Shared;
use super::rows::{HALO, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::{LevelParams, uniform};
use crate::error::Result;
use crate::graph::{NO_KEY, NO_MEMBER, RANK_BITS, by_distance, code, spatial_weight};
use crate::plan::{GRAPH_WINDOW, Plan};
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/graph.wgsl");
/// Neighbours that `choose` finds in one pass over the window, at most.
const CHOSEN: usize = 8;
/// Places of the window besides the centre.
const PLACES: usize = GRAPH_WINDOW * GRAPH_WINDOW - 1;

uniform! { ranked: [[u32; 4]; PLACES / 16], fine: LevelParams, weight: u32, guide_at: u32, fine_at: u32 }

impl Uniform {
    fn of(plan: &Plan) -> Self {
        let mut ranked = [[0; 4]; PLACES / 16];
        for (rank, (dx, dy)) in by_distance().into_iter().enumerate() {
            ranked[rank / 16][rank / 4 % 4] |= u32::from(code(dx, dy)) << (8 * (rank % 4));
        }
        Self { ranked, weight: spatial_weight(&plan.method), ..Self::default() }
    }
}

/// `downsample`, but at level 0; and where there are neighbours, `choose` and `transpose`.
pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    let chosen = plan.neighbours.clamp(1, CHOSEN);
    let job = |entry, loops| {
        let kernel = Kernel::new("graph", entry, SHADER)
            .with("NEIGHBOURS", plan.neighbours as u32)
            .with("CHOSEN", chosen as u32)
            .with("NO_MEMBER", u32::from(NO_MEMBER))
            .with("NO_KEY", NO_KEY)
            .with("RANK_BITS", RANK_BITS)
            .with("PLACES", PLACES as u32)
            .with("WINDOW", GRAPH_WINDOW as u32)
            .with("RADIUS", HALO);
        Job::new::<Uniform>(kernel, loops).over_levels(plan)
    };
    let mut jobs = Vec::new();
    if level > 0 {
        jobs.push(job("downsample", 5 * 6));
    }
    if plan.neighbours > 0 {
        let pass = chosen + PLACES * (1 + chosen) + chosen.div_ceil(4) * 5;
        jobs.push(job("choose", plan.neighbours.div_ceil(chosen) * pass));
        jobs.push(job("transpose", (PLACES + 1) * (1 + plan.neighbours.div_ceil(4))));
    }
    jobs
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    downsample(r)?;
    let jobs = jobs(r.plan, r.level);
    if let [.., choose, _] = &jobs[..]
        && r.plan.neighbours > 0
    {
        r.rows(choose, &Uniform::of(r.plan), l.width, |rows| {
            vec![(1, here.guide.bind(&with_halo(rows, HALO, l.height))), (3, here.members.bind(rows))]
        })?;
    }
    transpose(r)
}

/// The same for all of `levels` at once, but for their guides.
pub(super) fn record_levels(r: &mut Recorder, shared: &Shared, levels: Range<usize>) -> Result<()> {
    for z in levels.clone() {
        r.level = z;
        downsample(r)?;
    }
    let (plan, buffers) = (r.plan, r.buffers);
    let jobs = jobs(plan, levels.start);
    if let [.., choose, transpose] = &jobs[..]
        && plan.neighbours > 0
    {
        let own = |z: usize| {
            let here = &buffers.levels[z];
            (Uniform { guide_at: here.guide_at(), ..Uniform::of(plan) }, here.params.width)
        };
        r.levels(choose, levels.clone(), own, &[(1, &shared.guide), (3, &shared.members)])?;
        r.levels(transpose, levels, own, &[(4, &shared.members), (5, &shared.incoming)])?;
    }
    Ok(())
}

/// Makes the guide of the level from that of the next finer one.
fn downsample(r: &mut Recorder) -> Result<()> {
    if r.level == 0 {
        return Ok(());
    }
    let (finer, here, l) = (r.finer(), r.here(), r.params());
    let own = Uniform { fine: finer.params, ..Uniform::default() };
    // A dispatch must not read and write one buffer.
    let next = r.buffers.next_guide(&l);
    r.rows(&jobs(r.plan, r.level)[0], &own, l.width, |rows| {
        let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
        let seen = with_halo(&fine_rows, 2, finer.params.height);
        vec![(1, finer.guide.bind(&seen)), (2, next.bind(rows))]
    })?;
    r.copies(next.copy_to(&here.guide));
    Ok(())
}

/// Finds for every pixel the factors that hold it.
pub(super) fn transpose(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    r.renew(&here.members);
    let jobs = jobs(r.plan, r.level);
    let Some(job) = jobs.last().filter(|_| r.plan.neighbours > 0) else { return Ok(()) };
    r.rows(job, &Uniform::default(), l.width, |rows| {
        vec![(4, here.members.bind(&with_halo(rows, HALO, l.height))), (5, here.incoming.bind(rows))]
    })
}
