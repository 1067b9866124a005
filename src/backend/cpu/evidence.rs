//! Evidence from cost: see [`crate::backend::Stage::Evidence`].

use super::pyramid::StoredCost;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<C: StoredCost>(level: &LevelPlan, cost: &[C], evidence: &mut [u8], belief: &mut [u16]) {
    let row = level.width * level.stride;
    let scale = level.evidence;
    cost.par_chunks(row).zip(evidence.par_chunks_mut(row)).zip(belief.par_chunks_mut(row)).for_each(
        |((cost, evidence), belief)| {
            let pixels = cost.chunks_exact(level.stride).zip(evidence.chunks_exact_mut(level.stride));
            for (cost, evidence) in pixels {
                let cost = &cost[..level.labels];
                let min = cost.iter().map(|c| c.fraction()).min().unwrap_or(0);
                for (e, c) in evidence.iter_mut().zip(cost) {
                    *e = scale.apply(c.fraction() - min);
                }
                // Padding must never look better than a label.
                evidence[level.labels..].fill(u8::MAX);
            }
            for (b, &e) in belief.iter_mut().zip(evidence.iter()) {
                *b = e.into();
            }
        },
    );
}
