//! The support of each pixel: see [`crate::backend::Stage::Support`].

use crate::image::{Pair, Plane};
use crate::maps::flag;
use crate::plan::Plan;
use crate::plan::support::{SUPPORT_NEAR, SUPPORT_PLACES, SUPPORT_REACH, SUPPORT_STEP};
use crate::stage::MapSet;
use crate::threads::prelude::*;
use std::iter::repeat_n;

/// Minimum number of rows per thread.
const LEAST_ROWS: usize = 16;

/// A row with replicated ends.
#[derive(Default)]
struct Row {
    disparities: Vec<i32>,
    confidences: Vec<i32>,
}

impl Row {
    fn fill(&mut self, disparity: &Plane<i32>, confidence: &Plane<u8>, y: usize) {
        fn wide<T: Copy + Into<i32>>(out: &mut Vec<i32>, row: &[T]) {
            let beyond = |end: T| repeat_n(end, SUPPORT_REACH);
            out.clear();
            out.extend(beyond(row[0]).map(T::into));
            out.extend(row.iter().map(|&v| v.into()));
            out.extend(beyond(row[row.len() - 1]).map(T::into));
        }
        wide(&mut self.disparities, disparity.row(y));
        wide(&mut self.confidences, confidence.row(y));
    }
}

/// Working memory of a thread.
#[derive(Default)]
struct Scratch {
    rows: [Row; SUPPORT_PLACES],
    sums: Vec<i32>,
}

pub(super) fn run(maps: &mut MapSet, plan: &Plan, _: &Pair) {
    let floor = plan.method.refinement.confidence_floor;
    let MapSet { disparity, validity, confidence, .. } = maps;
    let (width, height) = disparity.size();
    let before = confidence.clone();
    let rows = confidence.data_mut().par_chunks_mut(width).zip(validity.data_mut().par_chunks_mut(width));
    rows.enumerate().with_min_len(LEAST_ROWS).for_each_init(
        Scratch::default,
        |Scratch { rows, sums }, (y, (confidence, validity))| {
            for (i, row) in rows.iter_mut().enumerate() {
                let y = (y + SUPPORT_STEP * i).saturating_sub(SUPPORT_REACH).min(height - 1);
                row.fill(disparity, &before, y);
            }
            sums.clear();
            sums.resize(width, 0);
            sum(rows, sums);
            for ((confidence, flags), &sum) in confidence.iter_mut().zip(validity).zip(&*sums) {
                let mean = sum as u32 / (SUPPORT_PLACES * SUPPORT_PLACES) as u32;
                *confidence = if *flags & flag::INVALID == 0 { mean as u8 } else { 0 };
                if *flags & flag::INVALID == 0 && mean < floor {
                    *flags |= flag::LOW_CONFIDENCE;
                }
            }
        },
    );
}

/// The sums over the places of each pixel of the middle row.
#[pulp::with_simd(sum = crate::vectors::widest())]
#[inline(always)]
fn sum_on<'a, S: pulp::Simd>(_: S, rows: &'a [Row; SUPPORT_PLACES], sums: &'a mut [i32]) {
    let own = &rows[SUPPORT_PLACES / 2].disparities[SUPPORT_REACH..];
    for Row { disparities, confidences } in rows {
        for at in (0..SUPPORT_PLACES).map(|i| SUPPORT_STEP * i) {
            let places = disparities[at..].iter().zip(&confidences[at..]);
            for ((sum, own), (disparity, confidence)) in sums.iter_mut().zip(own).zip(places) {
                let near = (disparity - own).abs() <= SUPPORT_NEAR;
                *sum += if near { *confidence } else { 0 };
            }
        }
    }
}
