//! Fills by votes: see [`crate::backend::Stage::VoteFill`].

use crate::backend::cpu::colours::{channels, difference, mean_colours};
use crate::backend::cpu::pages::Pages;
use crate::backend::cpu::units::{block, each_lane};
use crate::image::{Image, Pair, Plane};
use crate::maps::{FRACTION, flag, is_filled};
use crate::options::{Fill, Nearer};
use crate::plan::Plan;
use crate::plan::votes::{
    HIDING_LABELS, VOTE_AWAY, VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_OUTVOTES,
    VOTE_REACH, VOTE_SHIFT, VOTE_SURE, Votes,
};
use crate::stage::MapSet;
use crate::threads::prelude::*;
use crate::weights::vote_weights;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let left = pair.left();
    if plan.method.refinement.fill == Fill::Votes {
        let colours = mean_colours(left, 2);
        let elected = elect(maps, plan, &colours, Votes::of(plan));
        take(maps, left, &colours, &elected);
    }
}

/// Whether a pixel with these flags and this confidence is sure.
fn is_sure(flags: u8, confidence: u8) -> bool {
    flags & flag::INVALID == 0 && u32::from(confidence) >= VOTE_SURE
}

/// Whether a pixel with these flags and this confidence may be outvoted.
fn may_be_outvoted(flags: u8, confidence: u8) -> bool {
    flags & flag::INVALID == 0 && !is_sure(flags, confidence)
}

/// `weight` / 65536 of `sum`, rounded down.
#[inline(always)]
fn weighted(weight: u32, sum: u32) -> u32 {
    (sum >> 16) * weight + (((sum & 0xffff) * weight) >> 16)
}

/// The half-size pixels with needed votes: filled pixels may take them, or they may outvote a pixel.
fn asked(maps: &MapSet, votes: Votes) -> Plane<bool> {
    let MapSet { validity, confidence, .. } = maps;
    let mut asked = Plane::filled(votes.width, votes.height, false);
    asked.data_mut().par_chunks_mut(votes.width).enumerate().for_each(|(y, asked)| {
        for row in (2 * y).saturating_sub(2)..(2 * y + 4).min(validity.height()) {
            for (x, _) in validity.row(row).iter().enumerate().filter(|&(_, &f)| is_filled(f)) {
                asked[around(x, votes.width)].fill(true);
            }
        }
        for row in 2 * y..(2 * y + 2).min(validity.height()) {
            for (x, (&flags, &confidence)) in validity.row(row).iter().zip(confidence.row(row)).enumerate() {
                asked[x / 2] |= may_be_outvoted(flags, confidence);
            }
        }
    });
    asked
}

/// The columns or rows of half-size pixels within 1 of that of pixel `at`, of `count`.
fn around(at: usize, count: usize) -> std::ops::Range<usize> {
    (at / 2).saturating_sub(1)..(at / 2 + 2).min(count)
}

/// Stands for the vote of a half-size pixel that has none.
const NO_VOTE: i32 = i32::MIN;

/// The votes of the half-size pixels that are needed, in 1/256 px, or [`NO_VOTE`].
fn elect(maps: &MapSet, plan: &Plan, colours: &Plane<[u8; 3]>, votes: Votes) -> Plane<i32> {
    let asked = asked(maps, votes);
    let [along, across] = vote_weights();
    // Weights of the steps from each half-size pixel to the one above.
    let mut steps_down = Plane::filled(votes.width, votes.height, 0);
    steps_down.data_mut().par_chunks_mut(votes.width).enumerate().skip(1).for_each(|(y, weights)| {
        for (weight, (&here, &above)) in weights.iter_mut().zip(colours.row(y).iter().zip(colours.row(y - 1)))
        {
            *weight = across[difference(here, above)];
        }
    });
    let mut elected = Plane::filled(votes.width, votes.height, NO_VOTE);
    // Labels are padded to whole blocks; padding gets no votes.
    let stride = votes.labels.next_multiple_of(BLOCK);
    let row_length = votes.width * stride;
    let mut sums = Pages::new(votes.summed() * row_length).expect("memory for the votes of a band");
    for first in (0..votes.height).step_by(votes.band) {
        let band = first..(first + votes.band).min(votes.height);
        let seen = first.saturating_sub(VOTE_REACH)..(band.end + VOTE_REACH).min(votes.height);
        let rows = sums.par_chunks_mut(row_length).zip(seen.clone());
        rows.for_each_init(Scratch::default, |scratch, (row, y)| {
            own_votes(maps, plan, y, row, scratch);
            let colours = colours.row(y);
            scratch.steps.clear();
            scratch.steps.extend(colours.windows(2).map(|pair| along[difference(pair[0], pair[1])]));
            sum_row(row, stride, scratch);
        });
        let out = elected.rows_mut(band.clone()).par_chunks_mut(votes.width).zip(band);
        out.for_each_init(Vec::new, |totals, (out, y)| {
            totals.resize(stride, 0);
            for (x, vote) in out.iter_mut().enumerate().filter(|(x, _)| asked[(*x, y)]) {
                let at = |row: usize| (row - seen.start) * row_length + x * stride;
                // Steps from outside the image have weight 0.
                let mut steps = [[Step::default(); 2]; VOTE_REACH];
                for (away, [above, below]) in (1..=VOTE_REACH).rev().zip(&mut steps) {
                    if let Some(row) = y.checked_sub(away) {
                        *above = Step { from: at(row), weight: steps_down[(x, row + 1)] };
                    }
                    if y + away < votes.height {
                        *below = Step { from: at(y + away), weight: steps_down[(x, y + away)] };
                    }
                }
                let extremes = sum_column(votes.labels, totals, &sums, at(y), &steps);
                *vote = winner(&totals[..votes.labels], extremes)
                    .map_or(NO_VOTE, |vote| vote + FRACTION * plan.range.min);
            }
        });
    }
    elected
}

/// Number of labels whose sums stay in registers.
const BLOCK: usize = 8;

/// A step along a column: the index of the sums of the row it starts from, and its weight.
#[derive(Clone, Copy, Default)]
struct Step {
    from: usize,
    weight: u32,
}

/// Scratch memory for one row of half-size pixels.
#[derive(Default)]
struct Scratch {
    /// By label: how near it must be to hide a label in the right view. For the pixel in column x of a row of width w, the value
    /// for label k is at index w - x + k, split by parity into two vectors, so that even labels are adjacent.
    hiding: [Vec<i32>; 2],
    /// Weights of the steps between neighbours.
    steps: Vec<u32>,
    /// By label: the sum from the left, and the sum carried from the right.
    here: Vec<u32>,
    carried: Vec<u32>,
}

/// Votes of the half-size pixels of row `y` themselves, \[x\]\[label\].
#[pulp::with_simd(own_votes = crate::vectors::widest())]
#[inline(always)]
fn own_votes_on<'a, S: pulp::Simd>(
    _: S,
    maps: &'a MapSet,
    plan: &'a Plan,
    y: usize,
    out: &'a mut [u32],
    scratch: &'a mut Scratch,
) {
    let (width, height) = maps.disparity.size();
    let (min, labels) = (plan.range.min, plan.levels[0].labels);
    let stride = labels.div_ceil(2).next_multiple_of(BLOCK);
    // Nearness of label 0, and the increment per label.
    let (first, more) = match plan.method.refinement.nearer {
        Nearer::Larger => (0, 1),
        Nearer::Smaller => (labels as i32 - 1, -1),
    };
    out.fill(0);
    for y in 2 * y..height.min(2 * y + 2) {
        let (flags, optima, confidence) = (maps.validity.row(y), maps.optima.row(y), maps.confidence.row(y));
        for hiding in &mut scratch.hiding {
            hiding.clear();
            hiding.resize(width.midpoint(labels) + stride + 1, i32::MAX);
        }
        for (x, optimum) in optima.iter().enumerate().filter(|&(x, _)| is_sure(flags[x], confidence[x])) {
            let column = x as i32 - min - i32::from(optimum.label);
            if (0..width as i32).contains(&column) {
                let at = width - x + usize::from(optimum.label);
                let least = &mut scratch.hiding[at % 2][at / 2];
                let near = first + more * i32::from(optimum.label) + HIDING_LABELS as i32;
                *least = if *least == i32::MAX { near } else { near.max(*least) };
            }
        }
        for (x, (&disparity, &flags)) in maps.disparity.row(y).iter().zip(flags).enumerate() {
            let own = &mut out[x / 2 * stride..][..stride];
            if flags & flag::INVALID == 0 {
                vote_for(own, disparity - FRACTION * min);
            } else if flags & flag::MASKED == 0 {
                let at = width - x;
                vote_against_hiding(own, &scratch.hiding[at % 2][at / 2..], [first, 2 * more]);
            }
        }
    }
}

/// Votes for a disparity, in 1/256 px from the smallest label.
#[inline(always)]
fn vote_for(votes: &mut [u32], disparity: i32) {
    for (vote, label) in votes.iter_mut().zip(0..) {
        let away = (disparity - 2 * FRACTION * label).abs().min(VOTE_MOST) >> VOTE_BITS;
        *vote += (away as u32) << VOTE_FRACTION_BITS;
    }
}

/// Votes against labels at least as near as in `hiding`. `near` is the nearness of the first label and the increment.
#[inline(always)]
fn vote_against_hiding(votes: &mut [u32], hiding: &[i32], near: [i32; 2]) {
    for ((vote, &least), label) in votes.iter_mut().zip(hiding).zip(0..) {
        let hides = near[0] + near[1] * label >= least;
        *vote += if hides { VOTE_HIDING << VOTE_FRACTION_BITS } else { 0 };
    }
}

/// Sums the votes of a row along it.
#[pulp::with_simd(sum_row = crate::vectors::widest())]
#[inline(always)]
fn sum_row_on<'a, S: pulp::Simd>(_: S, row: &'a mut [u32], stride: usize, scratch: &'a mut Scratch) {
    let Scratch { steps, here, carried, .. } = scratch;
    for (x, &weight) in steps.iter().enumerate() {
        let (before, own) = row[x * stride..][..2 * stride].split_at_mut(stride);
        own.iter_mut().zip(before).for_each(|(own, before)| *own += weighted(weight, *before));
    }
    let last = &mut row[steps.len() * stride..];
    here.clear();
    here.extend_from_slice(last);
    for sum in last {
        *sum >>= VOTE_SHIFT;
    }
    carried.clear();
    carried.resize(stride, 0);
    for (x, &weight) in steps.iter().enumerate().rev() {
        let sums = row[x * stride..][..stride].iter_mut();
        for ((sum, here), carried) in sums.zip(here.iter_mut()).zip(carried.iter_mut()) {
            let own = *here - weighted(weight, *sum);
            *carried = weighted(weight, *carried + own);
            *here = *sum;
            *sum = (*sum + *carried) >> VOTE_SHIFT;
        }
    }
}

/// The sums at `at` plus those carried along the column by `steps` from above and below, farthest first. Returns the smallest and the
/// largest one of the first `labels`.
#[pulp::with_simd(sum_column = crate::vectors::widest())]
#[inline(always)]
fn sum_column_on<'a, S: pulp::Simd>(
    _: S,
    labels: usize,
    totals: &'a mut [u32],
    sums: &'a [u32],
    at: usize,
    steps: &'a [[Step; 2]; VOTE_REACH],
) -> (u32, u32) {
    for (i, totals) in totals.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
        let mut carried = [[0; BLOCK]; 2];
        for steps in steps {
            for (carried, step) in carried.iter_mut().zip(steps) {
                let sums: &[u32; BLOCK] = block(sums, step.from + i * BLOCK);
                carried.iter_mut().zip(sums).for_each(|(c, sum)| *c = weighted(step.weight, *c + sum));
            }
        }
        let own: &[u32; BLOCK] = block(sums, at + i * BLOCK);
        let [above, below] = carried;
        *totals = each_lane(|lane| own[lane] + above[lane] + below[lane]);
    }
    totals[..labels].iter().fold((u32::MAX, 0), |(least, most), &sum| (least.min(sum), most.max(sum)))
}

/// The winner of `sums` with these extremes, in 1/256 px from the smallest label; `None` if all are the same.
fn winner(sums: &[u32], (least, most): (u32, u32)) -> Option<i32> {
    if most == least {
        return None;
    }
    let label = sums.iter().position(|&sum| sum == least)?;
    let mut offset = 0;
    if 0 < label && label + 1 < sums.len() {
        let (mut below, mut above) = (sums[label - 1] - least, sums[label + 1] - least);
        while below.max(above) > 0xffff {
            (below, above) = (below >> 1, above >> 1);
        }
        let slope = below.max(above) as i32;
        if slope > 0 {
            offset = (512 * (below as i32 - above as i32) + slope).div_euclid(2 * slope);
        }
    }
    Some(2 * FRACTION * label as i32 + offset)
}

/// Filled pixels take the vote of the most similar half-size pixel around them, outvoted ones that of their own.
fn take(maps: &mut MapSet, left: &Image, colours: &Plane<[u8; 3]>, elected: &Plane<i32>) {
    let width = maps.disparity.width();
    let rows =
        maps.disparity.data_mut().par_chunks_mut(width).zip(maps.validity.data_mut().par_chunks_mut(width));
    let rows = rows.zip(maps.confidence.data_mut().par_chunks_mut(width)).enumerate();
    rows.for_each(|(y, ((disparity, flags), confidence))| {
        let pixels = left.pixels.row(y);
        for (x, ((disparity, flags), confidence)) in
            disparity.iter_mut().zip(flags).zip(confidence).enumerate()
        {
            if is_filled(*flags) {
                let own = channels(pixels[x]);
                let (mut least, mut taken) = (usize::MAX, NO_VOTE);
                for row in around(y, elected.height()) {
                    let columns = around(x, elected.width());
                    let colours = &colours.row(row)[columns.clone()];
                    let votes = &elected.row(row)[columns.clone()];
                    for ((&colour, &vote), column) in colours.iter().zip(votes).zip(columns) {
                        let away = column.abs_diff(x / 2) + row.abs_diff(y / 2);
                        let unlike = difference(own, colour) + VOTE_AWAY as usize * away;
                        if vote != NO_VOTE && unlike < least {
                            (least, taken) = (unlike, vote);
                        }
                    }
                }
                if taken != NO_VOTE {
                    *disparity = taken;
                }
            } else {
                let vote = elected[(x / 2, y / 2)];
                if vote != NO_VOTE
                    && may_be_outvoted(*flags, *confidence)
                    && (vote - *disparity).abs() > VOTE_OUTVOTES
                {
                    (*disparity, *flags, *confidence) = (vote, flag::OUTVOTED | flag::FILLED, 0);
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, Method};
    use crate::stage::Optimum;

    #[test]
    fn bands_do_not_change_votes() {
        let (width, height) = (37, 61);
        let range = DisparityRange::new(0, 11).unwrap();
        let plan = Plan::new(width, height, range, &Method::default()).unwrap();
        let noise = |x: usize, y: usize, salt: usize| (x * 7919 + y * 104_729 + x * y * salt) % 251;
        let colours =
            Plane::from_fn(width.div_ceil(2), height.div_ceil(2), |x, y| [noise(x, y, 3) as u8 / 8; 3]);
        let label = |x, y| (noise(x, y, 5) % 12) as u16;
        let mut maps = MapSet::new(&plan);
        maps.optima =
            Plane::from_fn(width, height, |x, y| Optimum { label: label(x, y), ..Optimum::default() });
        maps.disparity = Plane::from_fn(width, height, |x, y| FRACTION * i32::from(label(x, y)));
        maps.validity = Plane::from_fn(width, height, |x, y| match noise(x, y, 11) % 3 {
            0 => flag::OCCLUDED | flag::FILLED,
            _ => 0,
        });
        let of = |band| elect(&maps, &plan, &colours, Votes { band, ..Votes::of(&plan) });
        let whole = of(height);
        assert!(whole.data().iter().filter(|&&vote| vote != NO_VOTE).count() > 400);
        for band in [1, 2, 7, 30] {
            assert!(of(band) == whole, "{band}");
        }
        // Negative control: another row of colours moves votes.
        let mut other = colours.clone();
        other.row_mut(9).fill([255; 3]);
        assert!(elect(&maps, &plan, &other, Votes::of(&plan)) != whole);
    }
}
