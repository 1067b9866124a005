//! Matching cost of level 0: see [`crate::backend::Stage::Cost`].

use super::features::{RowFeatures, Sums, Views};
use super::units::Units;
use super::volumes::Volumes;
use crate::image::{Pair, Pixel};
use crate::options::MatchingCost;
use crate::plan::{COST_MAX, Plan};
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let Volumes { plan, pair, features, fine_cost: out, .. } = v;
    match plan.method.cost.matching {
        MatchingCost::Sad => sad(plan, pair, out),
        MatchingCost::Census | MatchingCost::AdCensus if plan.holds_all_rows() => census(plan, pair, out),
        MatchingCost::Census | MatchingCost::AdCensus => features.fill(plan, pair),
    }
}

fn difference(a: Pixel, b: Pixel) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum()
}

fn census(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let views = Views::new(plan, pair);
    out.par_chunks_mut(level.width * level.stride).enumerate().for_each_init(
        || (RowFeatures::new(plan), Sums::new(level.width)),
        |(features, sums), (y, costs)| {
            features.fill(&views, y, sums);
            features.costs(plan, costs);
        },
    );
}

fn sad(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let (width, height) = (level.width, level.height);
    let radius = plan.method.cost.sad_window as usize / 2;
    let (left, right) = (pair.left(), pair.right());
    out.par_chunks_mut(width * level.stride).enumerate().for_each_init(
        || vec![(0u64, 0u32); width + 1],
        |sums, (y, row)| {
            for costs in row.chunks_exact_mut(level.stride) {
                costs[..level.labels].fill(plan.outside_cost);
                costs[level.labels..].fill(u8::MAX);
            }
            let rows = y.saturating_sub(radius)..(y + radius + 1).min(height);
            for j in 0..level.labels {
                let d = i64::from(level.min) + j as i64;
                let inside = d.max(0)..(width as i64 + d.min(0));
                if inside.is_empty() {
                    continue;
                }
                let inside = inside.start as usize..inside.end as usize;
                // Running sums along the row of (difference, valid pairs) over the window's rows.
                let mut running = (0u64, 0);
                sums[inside.start] = running;
                for x in inside.clone() {
                    let xr = (x as i64 - d) as usize;
                    for ny in rows.clone() {
                        if !left.masked[(x, ny)] && !right.masked[(xr, ny)] {
                            running.0 += u64::from(difference(left.pixels[(x, ny)], right.pixels[(xr, ny)]));
                            running.1 += 1;
                        }
                    }
                    sums[x + 1] = running;
                }
                for x in inside.clone() {
                    let xr = (x as i64 - d) as usize;
                    if left.masked[(x, y)] || right.masked[(xr, y)] {
                        continue;
                    }
                    let from = sums[x.saturating_sub(radius).max(inside.start)];
                    let to = sums[(x + radius + 1).min(inside.end)];
                    let (sum, count) = ((to.0 - from.0) as u32, to.1 - from.1);
                    row[x * level.stride + j] =
                        ((sum + 384 * count) / (768 * count)).min(COST_MAX.into()) as u8;
                }
            }
        },
    );
}
