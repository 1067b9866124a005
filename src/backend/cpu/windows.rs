//! Label windows of a level, and where the volumes hold the cells of each pixel.
//!
//! A volume is \[y\]\[x\]\[slot\]\[label of the pixel's window\] (slot only for dependency messages). Windows differ from run to
//! run, so rows of a volume differ in length. A row has a block of unused cells on either side, so that a block of labels
//! can be loaded wherever it touches a window.

use super::units::{Units, each_lane};
use crate::image::Plane;
use crate::plan::{LABEL_BLOCK, LevelPlan, WINDOW_RUN};

/// The label window of a run of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Window {
    /// First label.
    pub(super) first: usize,
    /// Cells of a pixel: whole blocks of labels.
    pub(super) stride: usize,
    /// Labels; the cells after them are padding.
    pub(super) labels: usize,
    /// Where the cells of the run start in their row.
    start: usize,
}

impl Window {
    /// Where the cells of the pixel in column `x` start in their row.
    #[inline(always)]
    pub(super) fn at(&self, x: usize) -> usize {
        self.start + x % WINDOW_RUN * self.stride
    }

    /// The labels of the window.
    pub(super) fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.labels
    }
}

/// The label windows of a level.
pub(super) struct Windows {
    /// Whether all hold all labels.
    full: bool,
    /// Windows of a row of pixels.
    runs: usize,
    /// \[row of windows\]\[run\].
    all: Vec<Window>,
    /// Where each row of cells starts, and the end.
    rows: Vec<usize>,
}

impl Windows {
    /// Windows that hold all labels.
    pub(super) fn full(level: &LevelPlan) -> Self {
        let (runs, rows) = level.windows();
        Self::new(level, &Plane::filled(runs, rows, [0, level.stride as u16]))
    }

    /// From the first label and the number of cells of each window.
    pub(super) fn new(level: &LevelPlan, windows: &Plane<[u16; 2]>) -> Self {
        let runs = level.windows().0;
        let (mut all, mut rows) = (Vec::with_capacity(windows.data().len()), vec![0]);
        let mut end = 0;
        for (i, row) in windows.data().chunks_exact(runs).enumerate() {
            let mut start = LABEL_BLOCK;
            for (run, &[first, stride]) in row.iter().enumerate() {
                let (first, stride) = (usize::from(first), usize::from(stride));
                all.push(Window { first, stride, labels: stride.min(level.labels - first), start });
                start += stride * WINDOW_RUN.min(level.width - run * WINDOW_RUN);
            }
            for _ in 2 * i..level.height.min(2 * i + 2) {
                end += start + LABEL_BLOCK;
                rows.push(end);
            }
        }
        let full = all.iter().all(|window| window.stride == level.stride);
        Self { full, runs, all, rows }
    }

    /// Whether every window holds all labels.
    pub(super) fn are_full(&self) -> bool {
        self.full
    }

    /// Largest number of cells of `level`.
    pub(super) fn most_cells(level: &LevelPlan) -> usize {
        level.height * (level.width * level.stride + 2 * LABEL_BLOCK)
    }

    /// The window of the pixel at (x, y).
    #[inline(always)]
    pub(super) fn of(&self, x: usize, y: usize) -> &Window {
        &self.all[y / 2 * self.runs + x / WINDOW_RUN]
    }

    /// Where the cells of row `y` start; for `y` the height, the number of all cells.
    #[inline(always)]
    pub(super) fn start(&self, y: usize) -> usize {
        self.rows[y]
    }

    /// Number of rows.
    pub(super) fn height(&self) -> usize {
        self.rows.len() - 1
    }

    /// The cells of row `y` of a volume.
    #[inline(always)]
    pub(super) fn row_of<'a, T>(&self, volume: &'a [T], y: usize) -> &'a [T] {
        &volume[self.rows[y]..self.rows[y + 1]]
    }

    /// The rows of a volume with `slots` times as many cells, `each` of them together.
    pub(super) fn rows_mut<'a, T>(&self, volume: &'a mut [T], slots: usize, each: usize) -> Vec<&'a mut [T]> {
        let mut rest = volume;
        let mut rows = Vec::with_capacity(self.height().div_ceil(each));
        for y in (0..self.height()).step_by(each) {
            let end = (y + each).min(self.height());
            let (row, after) = rest.split_at_mut((self.rows[end] - self.rows[y]) * slots);
            rows.push(row);
            rest = after;
        }
        rows
    }

    /// The first label and the number of cells of each window.
    pub(super) fn to_plane(&self) -> Plane<[u16; 2]> {
        let windows = self.all.iter().map(|w| [w.first as u16, w.stride as u16]).collect();
        Plane::new(self.runs, self.all.len() / self.runs, windows)
    }
}

/// A block of labels of one pixel as seen through the window of another: which cells to load, and which of them are
/// labels.
pub(super) struct Seen<'a, U> {
    cells: &'a [U],
    start: usize,
    /// Label of the first window less that of the second.
    shift: isize,
    stride: isize,
    labels: isize,
}

impl<'a, U: Units> Seen<'a, U> {
    /// The cells of a pixel that start at `start` in the row `cells` and belong to `window`, for labels counted from
    /// `first`.
    #[inline(always)]
    pub(super) fn new(cells: &'a [U], start: usize, window: &Window, first: usize) -> Self {
        let shift = first.cast_signed() - window.first.cast_signed();
        Self { cells, start, shift, stride: window.stride.cast_signed(), labels: window.labels.cast_signed() }
    }

    /// The cells of the block of labels at `at`, and the largest value for those that are not labels of the pixel, 0 for
    /// the others; all 0 where every window is `FULL`.
    #[inline(always)]
    pub(super) fn block<const FULL: bool>(&self, at: usize) -> (&'a [U; LABEL_BLOCK], [U; LABEL_BLOCK]) {
        if FULL {
            // Padding is stored with the largest belief, which is above all others less a message.
            let cells = self.cells[self.start + at..].first_chunk().expect("rows are whole blocks");
            return (cells, [U::default(); LABEL_BLOCK]);
        }
        let block = LABEL_BLOCK.cast_signed();
        let place = at.cast_signed() + self.shift;
        let from = self.start.wrapping_add_signed(place.clamp(-block, self.stride));
        let before = (place.clamp(-block, 0) + block).cast_unsigned();
        let after = (place - self.labels + block).clamp(0, block).cast_unsigned();
        let cells = self.cells[from..].first_chunk().expect("rows have a block on either side");
        let before: &[U; LABEL_BLOCK] = U::EDGE[before..].first_chunk().expect("three blocks");
        let after: &[U; LABEL_BLOCK] = U::EDGE[LABEL_BLOCK + after..].first_chunk().expect("three blocks");
        (cells, each_lane(|i| before[i] | after[i]))
    }
}
