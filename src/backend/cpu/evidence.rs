//! Evidence from cost: see [`crate::backend::Stage::Evidence`].

use super::pyramid::StoredCost;
use super::units::Units;
use super::volumes::Volumes;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (plan, l) = (&v.plan.levels[level], &mut v.levels[level]);
    if level == 0 {
        evidence(plan, &v.fine_cost, &mut l.evidence, &mut l.belief);
    } else {
        evidence(plan, &l.cost, &mut l.evidence, &mut l.belief);
    }
}

fn evidence<C: StoredCost, U: Units>(level: &LevelPlan, cost: &[C], evidence: &mut [u8], belief: &mut [U]) {
    let row = level.width * level.stride;
    cost.par_chunks(row)
        .zip(evidence.par_chunks_mut(row))
        .zip(belief.par_chunks_mut(row))
        .for_each(|((cost, evidence), belief)| evidence_row(level, cost, evidence, belief));
}

#[pulp::with_simd(evidence_row = pulp::Arch::new())]
#[inline(always)]
fn evidence_row_on<'a, S: pulp::Simd, C: StoredCost, U: Units>(
    _: S,
    level: &'a LevelPlan,
    cost: &'a [C],
    evidence: &'a mut [u8],
    belief: &'a mut [U],
) {
    let pixels = cost.chunks_exact(level.stride).zip(evidence.chunks_exact_mut(level.stride));
    for ((cost, evidence), belief) in pixels.zip(belief.chunks_exact_mut(level.stride)) {
        // The cost of padding is the largest value.
        let min = cost.iter().copied().fold(C::MOST, C::min).fraction();
        for ((e, b), c) in evidence.iter_mut().zip(belief.iter_mut()).zip(cost) {
            *e = level.evidence.apply(c.fraction() - min);
            *b = (*e).into();
        }
        // Padding must never look better than a label.
        evidence[level.labels..].fill(u8::MAX);
        belief[level.labels..].fill(U::MOST);
    }
}
