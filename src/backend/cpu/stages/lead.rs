//! The lead of each label without the pixel's own guess: see [`crate::backend::Stage::Lead`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::{Window, Windows};
use crate::stage::Optimum;
use crate::stage::guess::GUESS_CAP;
use crate::stage::prior::LabelPrior;
use crate::threads::prelude::*;
use std::ops::Range;

/// Changes the runners-up of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let Some(prior) = v.priors.first() else { return };
    let (width, labels) = (v.plan.levels[0].width, v.plan.levels[0].labels);
    let Level { belief, windows, .. } = &v.levels[0];
    let optima = v.maps.optima.rows_mut(rows.clone()).par_chunks_mut(width);
    optima.zip(rows).for_each(|(optima, y)| {
        lead_row(labels, windows.row(y), prior.row(y), (windows, windows.row_of(belief, y)), optima);
    });
}

#[pulp::with_simd(lead_row = crate::vectors::widest())]
#[inline(always)]
fn lead_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    labels: usize,
    row: &'a [Window],
    prior: &'a [LabelPrior],
    (windows, beliefs): (&'a Windows, &'a [U]),
    optima: &'a mut [Optimum],
) {
    let pixels = row.iter().zip(prior).zip(optima);
    for ((&window, prior), optimum) in pixels.filter(|((_, prior), _)| (1..=GUESS_CAP).contains(&prior.cap)) {
        let words = prior.words(labels);
        let cost = |k: u32| LabelPrior::cost(words, k);
        let label = u32::from(optimum.label);
        // Plus the cap, so that nothing is negative.
        let cap = u32::from(prior.cap);
        let beliefs = beliefs[window.cells()].iter().zip(window.first() as u32..);
        let others = beliefs.take(windows.labels(window)).map(|(&b, k)| {
            let b: u16 = b.into();
            if k.abs_diff(label) > 1 { u32::from(b) + cap - cost(k) } else { u32::MAX }
        });
        let least = others.fold(u32::MAX, u32::min);
        if least < u32::MAX {
            optimum.runner_up = ((least + cost(label)).saturating_sub(cap) as u16).max(optimum.best);
        }
    }
}
