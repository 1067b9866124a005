//! Label windows of a level, and the layout of the pixels' cells in volumes.
//!
//! A volume is \[y\]\[x\]\[slot\]\[label of the pixel's window\] (slot only for dependency messages). Windows
//! differ, so rows of a volume differ in length. A row has a block of unused cells on either side, so that a
//! block of labels can be loaded wherever it overlaps a window.
//!
//! If only some rows are held, a volume is a ring: rows replace rows that are no longer needed. The two rows
//! that share windows stay adjacent.

use super::units::{Units, each_lane};
use crate::image::Plane;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, LevelPlan, WINDOW_RUN};
use std::array::from_fn;
use std::ops::Range;

/// The label window of a pixel, and the index of its cells in their row.
#[derive(Clone, Copy)]
pub(super) struct Window {
    start: u32,
    first: u16,
    stride: u16,
}

impl Window {
    /// Index of the pixel's first cell in its row.
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

    /// Whether both contain the same labels.
    #[inline(always)]
    pub(super) fn matches(self, other: Self) -> bool {
        (self.first, self.stride) == (other.first, other.stride)
    }

    /// The indices of the cells in their row.
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
    /// \[row of windows\]\[x\].
    all: Vec<Window>,
    /// Index of the first cell of each row.
    rows: Vec<usize>,
    /// Cells of a row, by row of windows.
    lengths: Vec<usize>,
}

impl Windows {
    /// Windows with all labels; `held` rows are needed at the same time.
    pub(super) fn full(level: &LevelPlan, held: usize) -> Self {
        let (runs, rows) = level.windows();
        Self::new(level, held, &Plane::filled(runs, rows, [0, level.stride as u16]))
    }

    /// From the first label and the number of cells of each run; `held` rows are needed at the same time.
    pub(super) fn new(level: &LevelPlan, held: usize, windows: &Plane<[u16; 2]>) -> Self {
        let (width, height) = (level.width, level.height);
        let (mut all, mut lengths) = (Vec::with_capacity(width * windows.height()), Vec::new());
        for i in 0..windows.height() {
            let mut start = LABEL_BLOCK as u32;
            for x in 0..width {
                let [first, stride] = windows[(x / WINDOW_RUN, i)];
                all.push(Window { start, first, stride });
                start += u32::from(stride);
            }
            lengths.push(start as usize + LABEL_BLOCK);
        }
        let rows = places(&lengths, held, height);
        Self { width, labels: level.labels, all, rows, lengths }
    }

    /// Upper bound of the cells of a volume of `level`, if `held` rows are needed at the same time.
    pub(super) fn most_cells(level: &LevelPlan, held: usize) -> usize {
        let rows = level.height.min(if held < level.height { 2 * (pairs(held) + 1) } else { held });
        rows * (level.width * level.stride + 2 * LABEL_BLOCK)
    }

    /// Cells of all pixels.
    pub(super) fn cells(&self) -> u64 {
        (0..self.height()).map(|y| (self.length(y) - 2 * LABEL_BLOCK) as u64).sum()
    }

    /// The windows of row `y`.
    #[inline(always)]
    pub(super) fn row(&self, y: usize) -> &[Window] {
        &self.all[y / 2 * self.width..][..self.width]
    }

    /// The windows of the rows around row `y` that its factors reach; empty outside the image.
    pub(super) fn around(&self, y: usize) -> [&[Window]; GRAPH_WINDOW] {
        from_fn(|k| self.row_around(y, k).map_or(&[][..], |ny| self.row(ny)))
    }

    /// Indices of the first cells of these rows relative to the cell `first`; 0 before it and outside the image.
    pub(super) fn starts_around(&self, y: usize, first: usize) -> [usize; GRAPH_WINDOW] {
        from_fn(|k| self.row_around(y, k).map_or(0, |ny| self.rows[ny].saturating_sub(first)))
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

    /// Index of the first cell of row `y`.
    #[inline(always)]
    pub(super) fn start(&self, y: usize) -> usize {
        self.rows[y]
    }

    /// Number of cells of row `y`.
    #[inline(always)]
    pub(super) fn length(&self, y: usize) -> usize {
        self.lengths[y / 2]
    }

    /// Number of rows.
    pub(super) fn height(&self) -> usize {
        self.rows.len()
    }

    /// The cells of row `y` of a volume.
    #[inline(always)]
    pub(super) fn row_of<'a, T>(&self, volume: &'a [T], y: usize) -> &'a [T] {
        &volume[self.rows[y]..][..self.lengths[y / 2]]
    }

    /// `rows` of a volume with `slots` times as many cells, in groups of `each` rows: one, or two that share windows.
    pub(super) fn rows_mut<'a, T>(
        &self,
        volume: &'a mut [T],
        slots: usize,
        each: usize,
        rows: Range<usize>,
    ) -> Vec<&'a mut [T]> {
        let Some(&first) = self.rows.get(rows.start) else { return Vec::new() };
        // In a ring, later rows may be stored before earlier ones.
        let (before, after) = volume.split_at_mut(slots * first);
        let mut parts = [(after, slots * first), (before, 0)].into_iter();
        let (mut rest, mut at) = parts.next().expect("two parts");
        rows.clone()
            .step_by(each)
            .map(|y| {
                let start = slots * self.rows[y];
                if start < at {
                    (rest, at) = parts.next().expect("a ring is gone through once");
                }
                let end = start + slots * self.lengths[y / 2] * each.min(rows.end - y);
                let (row, after) = std::mem::take(&mut rest)[start - at..].split_at_mut(end - start);
                (rest, at) = (after, end);
                row
            })
            .collect()
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

/// Largest number of pairs of rows (starting at even rows) that `held` rows touch.
fn pairs(held: usize) -> usize {
    held / 2 + 1
}

/// Start of each row in a volume of which `held` rows are needed at the same time; `lengths` are per pair of rows.
fn places(lengths: &[usize], held: usize, height: usize) -> Vec<usize> {
    let doubled: Vec<usize> = lengths.iter().map(|length| 2 * length).collect();
    let size = if held < height {
        let most = doubled.windows(pairs(held).min(doubled.len())).map(|pairs| pairs.iter().sum()).max();
        // The unused end of the ring is smaller than a pair.
        most.unwrap_or(0) + doubled.iter().max().unwrap_or(&0)
    } else {
        usize::MAX
    };
    let (mut rows, mut end) = (Vec::with_capacity(height), 0);
    for (i, &pair) in doubled.iter().enumerate() {
        if end + pair > size {
            end = 0;
        }
        rows.extend((2 * i..height.min(2 * i + 2)).map(|y| end + y % 2 * lengths[i]));
        end += pair;
    }
    rows
}

/// The cells of a pixel, aligned to the window of another pixel.
#[derive(Clone, Copy)]
pub(super) struct AlignedCells<'a, U> {
    cells: &'a [U],
    start: usize,
    /// First label of the other window minus first label of the pixel's own.
    shift: isize,
    stride: isize,
    labels: isize,
}

impl<'a, U: Units> AlignedCells<'a, U> {
    /// The cells from `start` on in `cells`, of a pixel with this `window`; labels count from `first`.
    #[inline(always)]
    pub(super) fn new(windows: &Windows, window: Window, cells: &'a [U], start: usize, first: usize) -> Self {
        let (shift, stride) =
            (first.cast_signed() - window.first().cast_signed(), window.stride().cast_signed());
        Self { cells, start, shift, stride, labels: windows.labels(window).cast_signed() }
    }

    /// The block of labels at `at`: its cells, and a mask with the largest value for labels that the pixel
    /// does not have, and 0 for others.
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

    /// The block of labels at `at` if both windows contain the same labels. Padding has the largest belief,
    /// which exceeds all others even minus a message.
    #[inline(always)]
    pub(super) fn same_block(&self, at: usize) -> (&'a [U; LABEL_BLOCK], [U; LABEL_BLOCK]) {
        let cells = self.cells[self.start + at..].first_chunk().expect("rows are whole blocks");
        (cells, [U::default(); LABEL_BLOCK])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether any two of `held` consecutive rows at these places share cells.
    fn collide(places: &[usize], lengths: &[usize], held: usize) -> bool {
        let cells = |y: usize| places[y]..places[y] + lengths[y / 2];
        (0..places.len()).any(|y| {
            (y.saturating_sub(held - 1)..y).any(|other| {
                let (a, b) = (cells(y), cells(other));
                a.start < b.end && b.start < a.end
            })
        })
    }

    #[test]
    fn rows_that_are_held_do_not_share_cells() {
        let mut seed = 1u32;
        let mut random = |most: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) % most
        };
        for height in [1, 2, 9, 40, 101] {
            for held in [1, 2, 5, 16, 17, 60] {
                let lengths: Vec<usize> =
                    (0..usize::div_ceil(height, 2)).map(|_| 1 + random(50) as usize).collect();
                let places = places(&lengths, held, height);
                assert!(!collide(&places, &lengths, held), "{height} rows, {held} held");
                if held + 10 < height {
                    let end = (0..height).map(|y| places[y] + lengths[y / 2]).max().unwrap();
                    assert!(end < 2 * lengths.iter().sum::<usize>(), "a ring is smaller than all rows");
                    assert!(collide(&places, &lengths, held + 8), "more rows than are held must be noticed");
                }
            }
        }
    }
}
