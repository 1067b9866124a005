//! Splits pairs whose volumes exceed memory into tiles. Volumes exist per tile; maps are always whole.
//!
//! The split depends only on the plan of the whole image, so the result is the same on every machine.
//!
//! ```text
//! crop: ─────────────────────────────────────────────
//!       │ reach │ overlap │      core      │ overlap │
//! ```
//!
//! The cores partition the image; only the core of a tile's crop enters the maps. The overlap gives the
//! outermost pixels of the core the same surroundings as in the whole image. The reach contains their
//! matches, because the right view is cropped in the same way: it is as wide as the largest disparity; for
//! negative disparities there is one on the right too. Crops end at the borders of the image.

use super::together::streamed;
use crate::error::{BudgetError, Result};
use crate::image::Rect;
use crate::plan::{FullSize, Plan};

use std::ops::Range;

/// Width of the overlap in pixels, rounded up to pixels of the coarsest level (32 pixels by default).
///
/// Measured as the share of pixels that tiling moves by more than 1 px (default preset; overlaps of 0, 32, 64
/// and 96 px). Five Middlebury pairs in 2 to 4 tiles: 0.00 to 0.19 % without an overlap, at most 0.002 % with
/// 32, at most 0.001 % with 64 or 96. Seven rendered scenes in 2 to 12 tiles: 0.00 to 0.90 % without, none
/// with 32. The plain wall, whose only cues are far away: 5 and 11 % without, 0.11 % and none with 32. No
/// overlap helps if texture zones limit the labels, because each tile finds its own zones: in two pairs, a
/// fifth to a half of the pixels move, about as often towards the truth as away from it.
pub const OVERLAP: usize = 32;

/// A part of the image that is matched separately.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// The pixels that enter the maps.
    pub core: Rect,
    /// The pixels that are matched. The crop starts at a whole pixel of the coarsest level, so that the grids
    /// of the pyramid are those of the whole image.
    pub crop: Rect,
    /// The plan for the crop; its [`Plan::core`] holds the core's columns, relative to the crop, and its
    /// [`Plan::memory`] the memory limit of a tile.
    pub plan: Plan,
}

/// A whole image in tiles, or in one piece.
#[derive(Clone, Debug, PartialEq)]
pub struct Tiles {
    whole: Plan,
    tiles: Vec<Tile>,
}

impl Tiles {
    /// The tiles for a match by `whole`, the plan for the whole image: one tile if the whole image fits in
    /// the memory of its method; otherwise tiles that fit and crop the fewest pixels in total.
    ///
    /// # Errors
    /// [`Error::Budget`](crate::Error::Budget) if no tile is small enough, here or in the match at twice the
    /// size that the method asks for.
    pub fn new(whole: &Plan) -> Result<Self> {
        Self::with_overlap(whole, OVERLAP)
    }

    /// Like [`Tiles::new`], with an overlap of at least `overlap` pixels, to measure its effect.
    ///
    /// # Errors
    /// The errors of [`Tiles::new`].
    pub fn with_overlap(whole: &Plan, overlap: usize) -> Result<Self> {
        let cut = Cut::at_all_sizes(whole, overlap).map_err(|needed| {
            let FullSize { size: (width, height), range } = whole.of_pair();
            let memory = whole.method.tiles.memory;
            // With a larger limit, more may be held: the reported limit must be enough.
            let mut needed = needed;
            while let Ok(granted) = needed.try_into()
                && let Err(more) = Cut::at_all_sizes(&whole.granted(granted), overlap)
            {
                needed = more.max(needed + 1);
            }
            BudgetError::NoTileFits { memory, width, height, labels: range.labels(), needed }
        })?;
        let Some(Cut { across, down, crop: (width, height) }) = cut else {
            return Ok(Self::in_one_piece(whole));
        };
        let rows = down.spans(height);
        let mut tiles = Vec::new();
        // Column by column, since all crops of a column have the same width.
        for [core_x, crop_x] in across.spans(width) {
            for [core_y, crop_y] in &rows {
                let core = Rect { x: core_x.clone(), y: core_y.clone() };
                let crop = Rect { x: crop_x.clone(), y: crop_y.clone() };
                let (width, height) = crop.size();
                let mut plan = Plan { core: core.within(&crop).x, ..whole.resized(width, height) };
                plan.memory -= beside(whole).div_ceil(1 << 20) as u32;
                tiles.push(Tile { core, crop, plan });
            }
        }
        Ok(Self { whole: whole.clone(), tiles })
    }

    /// Number of pixels of all tiles that [`Tiles::new`] finds, those that they share counted for each; `None` if no tile is small enough.
    pub(crate) fn pixels(whole: &Plan) -> Option<usize> {
        let cut = Cut::at_all_sizes(whole, OVERLAP).ok()?;
        Some(cut.map_or(whole.levels[0].pixels(), |cut| {
            cut.across.cropped(cut.crop.0) * cut.down.cropped(cut.crop.1)
        }))
    }

    /// The whole image in one piece, regardless of its memory.
    #[must_use]
    pub fn in_one_piece(whole: &Plan) -> Self {
        let all = Rect::whole(whole.size());
        Self { whole: whole.clone(), tiles: vec![Tile { core: all.clone(), crop: all, plan: whole.clone() }] }
    }

    /// The plan for the whole image.
    #[must_use]
    pub fn whole(&self) -> &Plan {
        &self.whole
    }

    /// The tiles, column by column from the top left.
    #[must_use]
    pub fn list(&self) -> &[Tile] {
        &self.tiles
    }

    /// The number of tiles.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tiles.len()
    }

    /// The plan that takes the most memory on the CPU path without an inspector: the plan of the whole image
    /// if there is one tile.
    #[must_use]
    pub fn largest(&self) -> Plan {
        let plans = self.tiles.iter().map(|tile| streamed(&tile.plan).on_host());
        plans.max_by_key(Plan::bytes).unwrap_or_else(|| self.whole.clone())
    }

    /// Upper bound of the bytes of the match on the CPU path.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.beside() + self.largest().bytes()
    }

    /// Upper bound of the bytes of the match on a device.
    #[must_use]
    pub fn bytes_on_device(&self) -> u64 {
        let plans = self.tiles.iter().map(|tile| streamed(&tile.plan).on_device().bytes());
        self.beside() + plans.max().unwrap_or(0)
    }

    fn beside(&self) -> u64 {
        if self.count() == 1 { 0 } else { beside(&self.whole) }
    }
}

/// How an image is cut.
struct Cut {
    across: Axis,
    down: Axis,
    /// (width, height) of the largest crop.
    crop: (usize, usize),
}

impl Cut {
    /// The cut, if tiles of the match at twice the size fit too, `None` for one piece; else the MiB that the smallest tiles need.
    fn at_all_sizes(whole: &Plan, overlap: usize) -> Result<Option<Self>, u64> {
        let cut = Self::at_one_size(whole, overlap)?;
        // Other errors of that size are reported when it is matched.
        if let Ok(Some(double)) = whole.doubled() {
            Self::at_one_size(&double, overlap)?;
        }
        Ok(cut)
    }

    /// The cut, `None` for one piece, or the MiB that the smallest tiles need.
    fn at_one_size(whole: &Plan, overlap: usize) -> Result<Option<Self>, u64> {
        let (width, height) = whole.size();
        let memory = u64::from(whole.method.tiles.memory) << 20;
        if streamed(whole).bytes() <= memory {
            return Ok(None);
        }
        let step = 1 << (whole.levels.len() - 1);
        let reach = |disparity: i32| disparity.max(0) as usize;
        let range = whole.range;
        let across = Axis::new(width, [overlap + reach(range.max), overlap + reach(-range.min)], step);
        let down = Axis::new(height, [overlap; 2], step);

        let bytes =
            |(width, height): (usize, usize)| beside(whole) + streamed(&whole.resized(width, height)).bytes();
        let candidates = (1..=across.most()).filter_map(|columns| {
            let width = across.crop(columns);
            // The smallest number of rows of tiles that fits.
            let rows = partition(1..down.most() + 1, |rows| bytes((width, down.crop(rows))) <= memory)?;
            let size = (width, down.crop(rows));
            Some((across.cropped(size.0) * down.cropped(size.1), size))
        });
        let Some((_, crop)) = candidates.min_by_key(|&(pixels, _)| pixels) else {
            let least =
                bytes((across.crop(across.most()), down.crop(down.most()))).min(streamed(whole).bytes());
            return Err(least.div_ceil(1 << 20));
        };
        Ok(Some(Self { across, down, crop }))
    }
}

/// Bytes of a match in tiles besides the current tile.
fn beside(whole: &Plan) -> u64 {
    whole.pair_bytes() + whole.conditioning_bytes() + whole.mosaic_bytes()
}

/// The smallest number in `range` for which `holds` is true, which must be monotonic.
fn partition(range: Range<usize>, holds: impl Fn(usize) -> bool) -> Option<usize> {
    let Range { start: mut low, end: mut high } = range.clone();
    while low < high {
        let middle = low.midpoint(high);
        if holds(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    (low < range.end).then_some(low)
}

/// The split along one side of the image.
pub(crate) struct Axis {
    /// Pixels of the image.
    length: usize,
    /// Pixels of a crop before and after its core, inside the image: multiples of `step`.
    around: [usize; 2],
    /// Cores start at multiples of this.
    step: usize,
}

impl Axis {
    pub(crate) fn new(length: usize, around: [usize; 2], step: usize) -> Self {
        Self { length, around: around.map(|pixels| pixels.next_multiple_of(step)), step }
    }

    /// Pixels of the image.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    /// The width that two adjacent crops share.
    fn shared(&self) -> usize {
        self.around[0] + self.around[1]
    }

    /// The largest useful number of tiles.
    pub(crate) fn most(&self) -> usize {
        self.length.div_ceil(self.step)
    }

    /// Pixels of the largest crop if the image is split evenly into `count` tiles.
    pub(crate) fn crop(&self, count: usize) -> usize {
        let all = self.length + (count - 1) * self.shared();
        let even = all.div_ceil(count).next_multiple_of(self.step);
        even.max(self.shared() + self.step).min(self.length)
    }

    /// Pixels of all crops together if none has more than `crop`.
    pub(crate) fn cropped(&self, crop: usize) -> usize {
        if crop >= self.length {
            return self.length;
        }
        let borders = (self.length - crop).div_ceil(crop - self.shared());
        self.length + borders * self.shared()
    }

    /// Cores and crops of at most `crop` pixels, as few as possible.
    pub(crate) fn spans(&self, crop: usize) -> Vec<[Range<usize>; 2]> {
        let [before, after] = self.around;
        let mut spans: Vec<[Range<usize>; 2]> = Vec::new();
        let mut start = 0;
        while start < self.length {
            let first = start.saturating_sub(before);
            let last = (first + crop).min(self.length);
            let end = if last == self.length { last } else { last - after };
            spans.push([start..end, first..last]);
            start = end;
        }
        spans
    }
}
