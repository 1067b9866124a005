//! Label windows of a level, and where the volumes hold the cells of each pixel.
//!
//! A volume is \[y\]\[x\]\[slot\]\[label of the pixel's window\] (slot only for dependency messages). Windows differ from run to
//! run, so rows of a volume differ in length. A row has a block of unused cells on either side, so that a block of labels
//! can be loaded wherever it touches a window.

use super::units::{Units, argmin, each_lane};
use crate::image::Plane;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, LevelPlan, WINDOW_RUN};
use std::array::from_fn;
use std::ops::Range;

/// The label window of a pixel, and where its cells start in their row.
#[derive(Clone, Copy)]
pub(super) struct Window {
    start: u32,
    first: u16,
    stride: u16,
}

impl Window {
    /// Where the pixel's cells start in their row.
    #[inline(always)]
    pub(super) fn start(self) -> usize {
        self.start as usize
    }

    /// First label.
    #[inline(always)]
    pub(super) fn first(self) -> usize {
        self.first.into()
    }

    /// Number of cells: whole blocks of labels.
    #[inline(always)]
    pub(super) fn stride(self) -> usize {
        self.stride.into()
    }

    /// The cells in their row.
    #[inline(always)]
    pub(super) fn cells(self) -> Range<usize> {
        self.start()..self.start() + self.stride()
    }
}

/// The label windows of a level.
pub(super) struct Windows {
    width: usize,
    /// Labels of the level.
    labels: usize,
    /// Whether all windows hold all labels.
    full: bool,
    /// \[row of windows\]\[x\].
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

    /// From the first label and the number of cells of each run.
    pub(super) fn new(level: &LevelPlan, windows: &Plane<[u16; 2]>) -> Self {
        let width = level.width;
        let (mut all, mut rows) = (Vec::with_capacity(width * windows.height()), vec![0]);
        let mut end = 0;
        for i in 0..windows.height() {
            let mut start = LABEL_BLOCK as u32;
            for x in 0..width {
                let [first, stride] = windows[(x / WINDOW_RUN, i)];
                all.push(Window { start, first, stride });
                start += u32::from(stride);
            }
            for _ in 2 * i..level.height.min(2 * i + 2) {
                end += start as usize + LABEL_BLOCK;
                rows.push(end);
            }
        }
        let full = windows.data().iter().all(|window| usize::from(window[1]) == level.stride);
        Self { width, labels: level.labels, full, all, rows }
    }

    /// Largest number of cells of `level`.
    pub(super) fn most_cells(level: &LevelPlan) -> usize {
        level.height * (level.width * level.stride + 2 * LABEL_BLOCK)
    }

    /// Cells of all pixels.
    pub(super) fn cells(&self) -> u64 {
        let unused = 2 * LABEL_BLOCK * self.height();
        (self.rows[self.height()] - unused) as u64
    }

    /// Whether every window holds all labels.
    pub(super) fn are_full(&self) -> bool {
        self.full
    }

    /// The windows of row `y`.
    #[inline(always)]
    pub(super) fn row(&self, y: usize) -> &[Window] {
        &self.all[y / 2 * self.width..][..self.width]
    }

    /// The windows of the rows around row `y` that its factors reach; those outside the image are empty.
    pub(super) fn around(&self, y: usize) -> [&[Window]; GRAPH_WINDOW] {
        from_fn(|k| self.row_around(y, k).map_or(&[][..], |ny| self.row(ny)))
    }

    /// Where the cells of these rows start, relative to row `first`; 0 for those above it and outside the image.
    pub(super) fn starts_around(&self, y: usize, first: usize) -> [usize; GRAPH_WINDOW] {
        let start = |ny: usize| self.rows[ny].saturating_sub(self.rows[first]);
        from_fn(|k| self.row_around(y, k).map_or(0, start))
    }

    fn row_around(&self, y: usize, k: usize) -> Option<usize> {
        (y + k).checked_sub(GRAPH_WINDOW / 2).filter(|&ny| ny < self.height())
    }

    /// Number of labels in a window; the cells after them are padding.
    #[inline(always)]
    pub(super) fn labels(&self, window: Window) -> usize {
        window.stride().min(self.labels - window.first())
    }

    /// The labels of a window.
    #[inline(always)]
    pub(super) fn range(&self, window: Window) -> Range<usize> {
        window.first()..window.first() + self.labels(window)
    }

    /// The label with the smallest belief of a pixel, the lowest on ties; `row` holds the beliefs of its row.
    #[inline(always)]
    pub(super) fn winner<U: Units>(&self, window: Window, row: &[U]) -> u16 {
        (window.first() + argmin(&row[window.start()..][..self.labels(window)]).0) as u16
    }

    /// Where the cells of row `y` start; for the height, the number of all cells.
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

    /// The first label and the number of cells of each run.
    pub(super) fn to_plane(&self) -> Plane<[u16; 2]> {
        let rows = self.all.len() / self.width;
        Plane::from_fn(self.width.div_ceil(WINDOW_RUN), rows, |run, row| {
            let window = self.all[row * self.width + run * WINDOW_RUN];
            [window.first, window.stride]
        })
    }
}

/// The cells of a pixel as seen through the window of another.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a, U> {
    cells: &'a [U],
    start: usize,
    /// First label of the other window less that of the pixel's own.
    shift: isize,
    stride: isize,
    labels: isize,
}

impl<'a, U: Units> Seen<'a, U> {
    /// The cells that start at `start` in `cells` and belong to a pixel with this `window`, of `windows`, for labels counted
    /// from `first`.
    #[inline(always)]
    pub(super) fn new(windows: &Windows, window: Window, cells: &'a [U], start: usize, first: usize) -> Self {
        let (shift, stride) =
            (first.cast_signed() - window.first().cast_signed(), window.stride().cast_signed());
        Self { cells, start, shift, stride, labels: windows.labels(window).cast_signed() }
    }

    /// The block of labels at `at`: the cells, and the largest value for those that are not labels of the pixel, 0 for the
    /// others.
    #[inline(always)]
    pub(super) fn block(&self, at: usize) -> (&'a [U; LABEL_BLOCK], [U; LABEL_BLOCK]) {
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

    /// The block of labels at `at` where all windows hold all labels. Padding is stored with the largest belief, which is
    /// above all others less a message.
    #[inline(always)]
    pub(super) fn whole_block(&self, at: usize) -> (&'a [U; LABEL_BLOCK], [U; LABEL_BLOCK]) {
        let cells = self.cells[self.start + at..].first_chunk().expect("rows are whole blocks");
        (cells, [U::default(); LABEL_BLOCK])
    }
}
