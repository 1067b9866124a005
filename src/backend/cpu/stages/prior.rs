//! The prior in the evidence: see [`crate::backend::Stage::Prior`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::backend::cpu::windows::Windows;
use crate::plan::LevelPlan;
use crate::program::Sent;
use crate::stage::prior::LabelPrior;
use crate::threads::prelude::*;
use std::ops::Range;

/// Adds the prior to the evidence of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, level: usize, _: Sent, rows: Range<usize>) {
    let Some(prior) = v.priors.get(level) else { return };
    let (plan, l) = (&v.plan.levels[level], &mut v.levels[level]);
    let windows = &l.windows;
    let evidence = windows.rows_mut(&mut l.evidence, 1, 1, rows.clone()).into_par_iter();
    let rows = evidence.zip(windows.rows_mut(&mut l.belief, 1, 1, rows.clone())).zip(rows);
    rows.for_each(|((evidence, belief), y)| prior_row(plan, windows, y, prior.row(y), evidence, belief));
}

#[pulp::with_simd(prior_row = crate::vectors::widest())]
#[inline(always)]
fn prior_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    level: &'a LevelPlan,
    windows: &'a Windows,
    y: usize,
    prior: &'a [LabelPrior],
    evidence: &'a mut [u8],
    belief: &'a mut [U],
) {
    let mut sums = Vec::new();
    for (&window, prior) in windows.row(y).iter().zip(prior).filter(|(_, prior)| prior.cap > 0) {
        let cells = window.start()..window.start() + windows.labels(window);
        let (evidence, belief) = (&mut evidence[cells.clone()], &mut belief[cells]);
        let words = prior.words(level.labels);
        sums.clear();
        let first = window.first() as u32;
        sums.extend(evidence.iter().zip(first..).map(|(&e, k)| u32::from(e) + LabelPrior::cost(words, k)));
        let least = sums.iter().copied().min().unwrap_or(0);
        for ((e, b), sum) in evidence.iter_mut().zip(belief).zip(&sums) {
            *e = (sum - least).min(level.evidence.cap.into()) as u8;
            *b = (*e).into();
        }
    }
}
