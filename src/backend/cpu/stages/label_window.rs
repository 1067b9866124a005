//! Label windows: see [`crate::backend::Stage::LabelWindow`].

use crate::backend::Stage;
use crate::backend::cpu::units::{Units, smallest};
use crate::backend::cpu::volumes::Volumes;
use crate::backend::cpu::windows::Windows;
use crate::image::Plane;
use crate::plan::{
    LABEL_BLOCK, LevelPlan, WINDOW_MARGIN, WINDOW_REACH, WINDOW_RUN, WINDOW_SLACK, WINDOW_STEP,
};
use crate::threads::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    v.begin(Stage::LabelWindow(level));
    let (l, held) = (&v.plan.levels[level], v.plan.rows_held(level));
    v.levels[level].windows = if v.plan.windows_follow_beliefs(level) {
        let candidates = candidates(v, level + 1);
        let offset = v.plan.label_offset(level + 1);
        Windows::new(l, held, &around(l, &candidates, offset))
    } else if let Some(ranges) = v.label_ranges.get(level) {
        Windows::new(l, held, &within(l, ranges))
    } else {
        Windows::full(l, held)
    };
}

/// Lowest and highest candidate of each pixel of `level`.
fn candidates<U: Units>(v: &Volumes<U>, level: usize) -> Plane<[u16; 2]> {
    let (l, here) = (&v.plan.levels[level], &v.levels[level]);
    let mut candidates = Plane::filled(l.width, l.height, [0; 2]);
    candidates.data_mut().par_chunks_mut(l.width).enumerate().for_each(|(y, row)| {
        let belief = here.windows.row_of(&here.belief, y);
        for (x, candidates) in row.iter_mut().enumerate() {
            let window = here.windows.row(y)[x];
            let belief = &belief[window.start()..][..here.windows.labels(window)];
            let most = smallest(belief).plus(U::of(WINDOW_SLACK.into()));
            let lowest = belief.iter().position(|&b| b <= most).unwrap_or(0);
            let highest = belief.iter().rposition(|&b| b <= most).unwrap_or(0);
            *candidates = [lowest, highest].map(|label| (window.first() + label) as u16);
        }
    });
    candidates
}

/// The windows around `candidates` of the next coarser level; candidate z means label 2 z + `offset`.
fn around(level: &LevelPlan, candidates: &Plane<[u16; 2]>, offset: i32) -> Plane<[u16; 2]> {
    let (width, height) = candidates.size();
    let (runs, rows) = level.windows();
    let mut windows = Plane::filled(runs, rows, [0; 2]);
    windows.data_mut().par_chunks_mut(runs).enumerate().for_each_init(
        // Lowest and highest candidate of each column, over all rows within reach.
        || vec![(0, 0); width],
        |columns, (y, windows)| {
            columns.fill((u16::MAX, 0));
            for y in y.saturating_sub(WINDOW_REACH)..(y + WINDOW_REACH + 1).min(height) {
                for ((least, most), &[lowest, highest]) in columns.iter_mut().zip(candidates.row(y)) {
                    (*least, *most) = ((*least).min(lowest), (*most).max(highest));
                }
            }
            for (run, window) in windows.iter_mut().enumerate() {
                let x = run * WINDOW_RUN / 2;
                let near = x.saturating_sub(WINDOW_REACH)..(x + WINDOW_RUN / 2 + WINDOW_REACH).min(width);
                let least = columns[near.clone()].iter().map(|c| c.0).min().unwrap_or(0);
                let most = columns[near].iter().map(|c| c.1).max().unwrap_or(0);
                let label = |candidate: u16| 2 * i32::from(candidate) + offset;
                *window = holding(level, label(least) - WINDOW_MARGIN, label(most) + WINDOW_MARGIN);
            }
        },
    );
    windows
}

/// The windows that contain the label ranges of their pixels.
fn within(level: &LevelPlan, ranges: &Plane<[u16; 2]>) -> Plane<[u16; 2]> {
    let (runs, rows) = level.windows();
    Plane::from_fn(runs, rows, |run, row| {
        let rows = 2 * row..(2 * row + 2).min(level.height);
        let columns = run * WINDOW_RUN..((run + 1) * WINDOW_RUN).min(level.width);
        let pixels = || rows.clone().flat_map(|y| &ranges.row(y)[columns.clone()]);
        let least = pixels().map(|range| range[0]).min().unwrap_or(0);
        let most = pixels().map(|range| range[1]).max().unwrap_or(0);
        holding(level, least.into(), most.into())
    })
}

/// First label and number of cells of the window that contains the labels from `least` to `most`.
fn holding(level: &LevelPlan, least: i32, most: i32) -> [u16; 2] {
    let last = level.labels as i32 - 1;
    let (least, most) = (least.clamp(0, last) as usize, most.clamp(0, last) as usize);
    let first = least / WINDOW_STEP * WINDOW_STEP;
    let stride = (most + 1 - first).next_multiple_of(LABEL_BLOCK);
    [first.min(level.stride - stride) as u16, stride as u16]
}
