//! The graph of a level: see [`Stage::Graph`](crate::backend::Stage::Graph).

use super::buffers::{HALO, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::{LevelParams, uniform};
use crate::error::Result;
use crate::graph::{NO_KEY, NO_MEMBER, RANK_BITS, by_distance, code, spatial_weight};
use crate::plan::{GRAPH_WINDOW, Plan};

const SHADER: &str = include_str!("../../../shaders/graph.wgsl");
/// Neighbours that `choose` finds in one pass over the window, at most.
const CHOSEN: usize = 8;
/// Places of the window besides the centre.
const PLACES: usize = GRAPH_WINDOW * GRAPH_WINDOW - 1;

uniform! { ranked: [[u32; 4]; PLACES / 16], fine: LevelParams, padding: [u32; 3], weight: u32 }

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
        Job::new::<Uniform>(kernel, loops)
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
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let guide = if r.level == 0 { &b.left } else { &here.guide };
    let all = jobs(r.plan, r.level);
    let mut jobs = &all[..];
    if let [downsample, rest @ ..] = jobs
        && r.level > 0
    {
        let finer = r.finer();
        let from = if r.level == 1 { &b.left } else { &finer.guide };
        let own = Uniform { fine: finer.params, ..Uniform::default() };
        r.rows(downsample, &own, l.width, |rows| {
            let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
            vec![(1, from.bind(&with_halo(&fine_rows, 2, finer.params.height))), (2, guide.bind(rows))]
        })?;
        jobs = rest;
    }
    if let [choose, _] = jobs {
        let mut ranked = [[0; 4]; PLACES / 16];
        for (rank, (dx, dy)) in by_distance().into_iter().enumerate() {
            ranked[rank / 16][rank / 4 % 4] |= u32::from(code(dx, dy)) << (8 * (rank % 4));
        }
        let own = Uniform { ranked, weight: spatial_weight(&r.plan.method), ..Uniform::default() };
        r.rows(choose, &own, l.width, |rows| {
            vec![(1, guide.bind(&with_halo(rows, HALO, l.height))), (3, here.members.bind(rows))]
        })?;
        transpose(r)?;
    }
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
