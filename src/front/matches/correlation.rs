//! Zero-mean normalised cross-correlation (ZNCC) of a window with those along a row.

use super::view::{RADIUS, View, WINDOW, WINDOW_PIXELS};
use std::array::from_fn;
use std::ops::RangeInclusive;

/// ZNCC of the window of `of` around (x, y) with those of `within` on row `v`; 0 where the window does not
/// fit.
pub(super) fn correlation(
    of: &View,
    (x, y): (usize, usize),
    within: &View,
    v: usize,
    columns: RangeInclusive<usize>,
) -> Vec<f64> {
    let (first, count) = (*columns.start(), columns.count());
    let template = from_fn(|row| from_fn(|column| of.grey[(x + column - RADIUS, y + row - RADIUS)]));
    let lines = from_fn(|row| &within.grey.row(v + row - RADIUS)[first - RADIUS..]);
    let mut products = vec![0; count];
    products_along(&template, &lines, &mut products);
    let mut scores = vec![0.0; count];
    let there = (&within.sum.row(v)[first..first + count], &within.norm.row(v)[first..first + count]);
    scores_along(&products, (of.sum[(x, y)], of.norm[(x, y)]), there, &mut scores);
    scores
}

/// Scores of windows with these products, from the sums and norms of the template and of each window. All but
/// the last division is exact, since nothing reaches 2^53.
#[pulp::with_simd(scores_along = crate::vectors::widest())]
#[inline(always)]
fn scores_along_on<'a, S: pulp::Simd>(
    _: S,
    products: &'a [i32],
    (sum, norm): (i32, f64),
    (sums, norms): (&'a [i32], &'a [f64]),
    out: &'a mut [f64],
) {
    let there = sums.iter().zip(norms);
    for (out, (product, (there, of_there))) in out.iter_mut().zip(products.iter().zip(there)) {
        let norms = norm * of_there;
        let covariance = WINDOW_PIXELS as f64 * f64::from(*product) - f64::from(sum) * f64::from(*there);
        *out = if norms > 0.0 { covariance / norms } else { 0.0 };
    }
}

/// The sum of the products of `template` with the window that begins at each position of `lines`.
#[pulp::with_simd(products_along = crate::vectors::widest())]
#[inline(always)]
fn products_along_on<'a, S: pulp::Simd>(
    _: S,
    template: &'a [[i16; WINDOW]; WINDOW],
    lines: &'a [&'a [i16]; WINDOW],
    out: &'a mut [i32],
) {
    let (blocks, rest) = out.as_chunks_mut::<32>();
    let first_of_rest = 32 * blocks.len();
    for (i, block) in blocks.iter_mut().enumerate() {
        *block = products_at(template, lines, 32 * i);
    }
    for (i, sum) in rest.iter_mut().enumerate() {
        [*sum] = products_at(template, lines, first_of_rest + i);
    }
}

/// The products at `N` positions from `first` on; so few sums stay in registers.
#[inline(always)]
fn products_at<const N: usize>(
    template: &[[i16; WINDOW]; WINDOW],
    lines: &[&[i16]; WINDOW],
    first: usize,
) -> [i32; N] {
    let mut sums = [0; N];
    for (template, line) in template.iter().zip(lines) {
        let line = &line[first..first + WINDOW - 1 + N];
        for (column, &t) in template.iter().enumerate() {
            for (sum, &value) in sums.iter_mut().zip(&line[column..]) {
                *sum += t as i32 * value as i32;
            }
        }
    }
    sums
}
