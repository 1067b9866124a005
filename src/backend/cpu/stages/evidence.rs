//! Evidence from cost: see [`crate::backend::Stage::Evidence`].

use super::pyramid::StoredCost;
use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::backend::cpu::windows::{Window, Windows};
use crate::plan::LevelPlan;
use crate::program::Sent;
use crate::threads::prelude::*;
use std::ops::Range;

/// The evidence of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, level: usize, _: Sent, rows: Range<usize>) {
    let (plan, l) = (&v.plan.levels[level], &mut v.levels[level]);
    let windows = &l.windows;
    let evidence = windows.rows_mut(&mut l.evidence, 1, 1, rows.clone()).into_par_iter();
    let rows = evidence.zip(windows.rows_mut(&mut l.belief, 1, 1, rows.clone())).zip(rows);
    if level > 0 {
        rows.for_each(|((evidence, belief), y)| {
            evidence_row(plan, windows, y, Costs::stored(&l.cost, y, plan), evidence, belief);
        });
    } else if v.plan.stores_costs() {
        rows.for_each(|((evidence, belief), y)| {
            evidence_row(plan, windows, y, Costs::stored(&v.fine_cost, y, plan), evidence, belief);
        });
    } else {
        rows.for_each_init(Vec::new, |costs, ((evidence, belief), y)| {
            costs.resize(windows.length(y), 0);
            v.features.costs_in_windows(&v.plan, windows, y, costs);
            evidence_row(plan, windows, y, Costs::OfWindows(costs), evidence, belief);
        });
    }
}

/// The costs of a row.
#[derive(Clone, Copy)]
enum Costs<'a, C> {
    /// Costs of all labels.
    OfAll(&'a [C]),
    /// Costs of the labels in the windows, in the layout of volumes.
    OfWindows(&'a [C]),
}

impl<'a, C> Costs<'a, C> {
    /// Row `y` of a volume with the costs of all labels.
    fn stored(volume: &'a [C], y: usize, level: &LevelPlan) -> Self {
        let cells = level.width * level.stride;
        Self::OfAll(&volume[y * cells..][..cells])
    }

    /// The costs of the pixel at column `x` for the labels of its window.
    #[inline(always)]
    fn of(&self, x: usize, window: Window, level: &LevelPlan) -> &'a [C] {
        match self {
            Self::OfAll(costs) => &costs[x * level.stride + window.first()..][..window.stride()],
            Self::OfWindows(costs) => &costs[window.cells()],
        }
    }
}

#[pulp::with_simd(evidence_row = crate::vectors::widest())]
#[inline(always)]
fn evidence_row_on<'a, S: pulp::Simd, C: StoredCost, U: Units>(
    _: S,
    level: &'a LevelPlan,
    windows: &'a Windows,
    y: usize,
    costs: Costs<'a, C>,
    evidence: &'a mut [u8],
    belief: &'a mut [U],
) {
    for (x, &window) in windows.row(y).iter().enumerate() {
        let (cells, labels) = (window.cells(), windows.labels(window));
        let (evidence, belief) = (&mut evidence[cells.clone()], &mut belief[cells]);
        // The cost of padding is the largest value.
        let cost = costs.of(x, window, level);
        let min = cost.iter().copied().fold(C::MOST, C::min).fraction();
        for ((e, b), c) in evidence.iter_mut().zip(belief.iter_mut()).zip(cost) {
            *e = level.evidence.apply(c.fraction() - min);
            *b = (*e).into();
        }
        // Padding must never be better than a label.
        evidence[labels..].fill(u8::MAX);
        belief[labels..].fill(U::MOST);
    }
}
