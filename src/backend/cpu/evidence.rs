//! Evidence from cost: see [`crate::backend::Stage::Evidence`].

use super::pyramid::StoredCost;
use super::units::Units;
use super::volumes::Volumes;
use super::windows::Windows;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (plan, l) = (&v.plan.levels[level], &mut v.levels[level]);
    let (windows, evidence, belief) = (&l.windows, &mut l.evidence, &mut l.belief);
    if level == 0 {
        in_windows(plan, windows, &v.fine_cost, evidence, belief);
    } else {
        in_windows(plan, windows, &l.cost, evidence, belief);
    }
}

fn in_windows<C: StoredCost, U: Units>(
    level: &LevelPlan,
    windows: &Windows,
    cost: &[C],
    evidence: &mut [u8],
    belief: &mut [U],
) {
    let rows = windows.rows_mut(evidence, 1, 1).into_par_iter().zip(windows.rows_mut(belief, 1, 1));
    rows.zip(cost.par_chunks(level.width * level.stride))
        .enumerate()
        .for_each(|(y, ((evidence, belief), cost))| evidence_row(level, windows, y, cost, evidence, belief));
}

#[pulp::with_simd(evidence_row = pulp::Arch::new())]
#[inline(always)]
fn evidence_row_on<'a, S: pulp::Simd, C: StoredCost, U: Units>(
    _: S,
    level: &'a LevelPlan,
    windows: &'a Windows,
    y: usize,
    cost: &'a [C],
    evidence: &'a mut [u8],
    belief: &'a mut [U],
) {
    for (x, cost) in cost.chunks_exact(level.stride).enumerate() {
        let window = windows.row(y)[x];
        let (cells, labels) = (window.cells(), windows.labels(window));
        let (evidence, belief) = (&mut evidence[cells.clone()], &mut belief[cells]);
        // The cost of padding is the largest value.
        let cost = &cost[window.first()..][..window.stride()];
        let min = cost.iter().copied().fold(C::MOST, C::min).fraction();
        for ((e, b), c) in evidence.iter_mut().zip(belief.iter_mut()).zip(cost) {
            *e = level.evidence.apply(c.fraction() - min);
            *b = (*e).into();
        }
        // Padding must never look better than a label.
        evidence[labels..].fill(u8::MAX);
        belief[labels..].fill(U::MOST);
    }
}
