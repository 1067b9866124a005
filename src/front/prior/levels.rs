//! A prior in the labels of each level.

use super::ReadyPrior;
use crate::image::Plane;
use crate::maps::{FRACTION, is_filled};
use crate::plan::{LevelPlan, PRIOR_SLOPE_BITS, PRIOR_SLOPE_MOST, Plan, UNITS_PER_NAT};
use crate::prior::PriorKind;
use crate::stage::NO_ANCHOR;
use crate::stage::guess::{GUESS_CAP, GUESS_SLOPE, faded};
use crate::stage::prior::{LabelPrior, LevelPriors};
use crate::threads::prelude::*;

/// The largest cost of a prior, in units: 5 nats for points, 2 for a surface, which may be wrong in whole regions.
const CAPS: [u8; 2] = [20, 8];
/// A deviation from a point that costs nothing, in 1/256 px. A surface has its standard deviation in the place of this.
const POINT_DEAD: i32 = FRACTION / 2;
/// The largest standard deviation with which a prior decides where no match can be trusted, in 1/256 px.
const ANCHOR_SIGMA: u16 = 11 * FRACTION as u16 / 4;

/// The prior of each pixel for all levels of `plan`.
pub(crate) fn levels(ready: &ReadyPrior, plan: &Plan) -> LevelPriors {
    LevelPriors { levels: all(finest(ready, &plan.levels[0]), plan), anchors: anchors(ready) }
}

/// The prior of each pixel after a look with these disparity and validity maps: what is `known` from the caller, and the filled
/// disparities.
pub(crate) fn with_guess(
    known: Option<LevelPriors>,
    (disparity, validity): (&Plane<i32>, &Plane<u8>),
    plan: &Plan,
) -> LevelPriors {
    let nothing = Plane::filled(0, 0, LabelPrior::default());
    let finer = known.as_ref().map_or(&nothing, |known| &known.levels[0]);
    let levels = all(guessed(disparity, validity, finer, &plan.levels[0]), plan);
    let (width, height) = disparity.size();
    let anchors = known.map_or_else(|| Plane::filled(width, height, NO_ANCHOR), |known| known.anchors);
    LevelPriors { levels, anchors }
}

/// The priors of all levels from that of the `finest` one.
fn all(finest: Plane<LabelPrior>, plan: &Plan) -> Vec<Plane<LabelPrior>> {
    let mut levels = vec![finest];
    for z in 1..plan.levels.len() {
        let coarse = coarser(&levels[z - 1], &plan.levels[z], plan.label_offset(z));
        levels.push(coarse);
    }
    levels
}

/// The prior of the labels of level 0: nothing is known of pixels whose disparity is more than a label outside the range.
fn finest(ready: &ReadyPrior, level: &LevelPlan) -> Plane<LabelPrior> {
    let known = &ready.known;
    let cap = CAPS[usize::from(known.kind == PriorKind::Surface)];
    let (low, high) = (level.min - 1, level.max() + 1);
    let mut finest = Plane::filled(level.width, level.height, LabelPrior::default());
    let pixels = finest.data_mut().par_iter_mut().zip(known.disparity.data()).zip(known.sigma.data());
    pixels.filter(|(_, sigma)| **sigma > 0).for_each(|((prior, &disparity), &sigma)| {
        if disparity < low * FRACTION || disparity > high * FRACTION {
            return;
        }
        let dead = if known.kind == PriorKind::Points { POINT_DEAD } else { sigma.into() };
        // In fractions of a label.
        let label = |end: i32| (end - level.min * FRACTION) * LabelPrior::LABEL / FRACTION;
        *prior = LabelPrior {
            lo: label(disparity - dead),
            hi: label(disparity + dead),
            slope: ((UNITS_PER_NAT as u32 * FRACTION as u32) << PRIOR_SLOPE_BITS)
                .div_ceil(sigma.into())
                .min(PRIOR_SLOPE_MOST),
            cap,
        }
        .cut(level.labels);
    });
    finest
}

/// The prior of level 0 that the filled pixels of a look give, and those `known` from elsewhere, if any: the level 0 of
/// [`Stage::Guess`](crate::stage::Stage::Guess).
pub(crate) fn guessed(
    disparity: &Plane<i32>,
    validity: &Plane<u8>,
    known: &Plane<LabelPrior>,
    level: &LevelPlan,
) -> Plane<LabelPrior> {
    let (width, height) = disparity.size();
    let mut guessed = Plane::filled(width, height, LabelPrior::default());
    guessed.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (prior, (&d, &flags)) in row.iter_mut().zip(disparity.row(y).iter().zip(validity.row(y))) {
            if is_filled(flags) {
                let at = (d - level.min * FRACTION).div_euclid(FRACTION / LabelPrior::LABEL);
                *prior = LabelPrior { lo: at, hi: at, slope: GUESS_SLOPE, cap: GUESS_CAP }.cut(level.labels);
            }
        }
        if !known.data().is_empty() {
            let known = known.row(y).iter().zip(row).filter(|(known, _)| known.cap > GUESS_CAP);
            known.for_each(|(known, prior)| *prior = known.cut(level.labels));
        }
    });
    guessed
}

/// The prior of a level from that of the next finer one: the smallest interval that holds those of all known children, with twice
/// their mean slope, because a label is twice as wide, and the mean of their [faded] caps. Coarse label k stands for fine labels
/// 2 k + `offset` - 1 ..= 2 k + `offset` + 1.
pub(crate) fn coarser(fine: &Plane<LabelPrior>, level: &LevelPlan, offset: i32) -> Plane<LabelPrior> {
    let (width, height) = fine.size();
    let mut coarse = Plane::filled(level.width, level.height, LabelPrior::default());
    coarse.data_mut().par_chunks_mut(level.width).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            let (mut lo, mut hi, mut slope, mut cap, mut count) = (i32::MAX, i32::MIN, 0, 0, 0_u32);
            for v in 2 * y..(2 * y + 2).min(height) {
                for child in &fine.row(v)[2 * x..(2 * x + 2).min(width)] {
                    if child.cap > 0 {
                        (lo, hi) = (lo.min(child.lo), hi.max(child.hi));
                        (slope, cap, count) =
                            (slope + child.slope, cap + u32::from(faded(child.cap)), count + 1);
                    }
                }
            }
            let Some(slope) = (2 * slope).checked_div(count) else { continue };
            let shift = offset * LabelPrior::LABEL;
            *out = LabelPrior {
                lo: (lo - shift - LabelPrior::LABEL).div_euclid(2),
                hi: -(-(hi - shift + LabelPrior::LABEL)).div_euclid(2),
                slope: slope.min(PRIOR_SLOPE_MOST),
                cap: (cap / count) as u8,
            }
            .cut(level.labels);
        }
    });
    coarse
}

/// The disparities that a prior gives where no match can be trusted.
pub(crate) fn anchors(ready: &ReadyPrior) -> Plane<i32> {
    let known = &ready.known;
    let (width, height) = known.size();
    let mut anchors = Plane::filled(width, height, NO_ANCHOR);
    if known.kind == PriorKind::Points {
        let pixels = anchors.data_mut().iter_mut().zip(known.disparity.data()).zip(known.sigma.data());
        let trusted = pixels.filter(|(_, sigma)| (1..=ANCHOR_SIGMA).contains(*sigma));
        trusted.for_each(|((anchor, &disparity), _)| *anchor = disparity);
    }
    anchors
}
