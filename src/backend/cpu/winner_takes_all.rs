//! Winner takes all: the optimum of the beliefs. See [`crate::backend::Stage::WinnerTakesAll`].

use super::finest::Optimum;
use super::units::{Units, argmin, smallest};
use super::volumes::Volumes;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let (level, belief, maps) = (&v.plan.levels[0], &v.levels[0].belief, &mut v.maps);
    let optima = maps.optima.data_mut().par_chunks_mut(level.width);
    optima
        .zip(belief.par_chunks_exact(level.width * level.stride))
        .for_each(|(optima, beliefs)| optimum_row(level, beliefs, optima));
}

#[pulp::with_simd(optimum_row = pulp::Arch::new())]
#[inline(always)]
fn optimum_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    level: &'a LevelPlan,
    beliefs: &'a [U],
    optima: &'a mut [Optimum],
) {
    for (optimum, belief) in optima.iter_mut().zip(beliefs.chunks_exact(level.stride)) {
        *optimum = optimum_of(&belief[..level.labels]);
    }
}

#[inline(always)]
fn optimum_of<U: Units>(belief: &[U]) -> Optimum {
    let (label, best) = argmin(belief);
    let below = &belief[..label.saturating_sub(1)];
    let above = belief.get(label + 2..).unwrap_or_default();
    let runner_up = if below.is_empty() && above.is_empty() {
        u16::MAX
    } else {
        smallest(below).min(smallest(above)).into()
    };
    Optimum { label: label as u16, best: best.into(), runner_up }
}
