//! Blocks: regions that together are a pair too large for the memory of its method, or shared by several runs.

use super::Region;
use crate::error::{BudgetError, Error, Result};
use crate::front::conditioning::Conditioning;
use crate::image::{Pair, Rect};
use crate::options::{DisparityRange, Method};
use crate::plan::{FullSize, Plan};
use crate::program::tiles::{Axis, Tiles};
use std::iter;

/// Width of the margin around a block, in pixels.
///
/// Unlike a tile, a block is matched to the end alone: what fills its pixels looks no farther than its window. Measured as the share of
/// pixels that are off by more than 1 px from a match in one go, ten pairs of rooms, roads and from the air, of 170,000 to 1,000,000
/// pixels, each in 2 x 2 blocks. `default`: 0.00 to 2.5 % with 32 pixels, 0.00 to 1.0 % with 64, 0.00 to 0.07 % with 128 (0.00 in the
/// median). `fast`: 0.00 to 5.8 %, 0.00 to 7.3 %, 0.00 to 0.9 % (0.00 in the median).
const MARGIN: usize = 128;
/// About the largest width and height of a block in pixels, so that a large pair has blocks to share, and little is lost with one of them.
const LARGEST: usize = 4096;
/// A pair of fewer pixels than this, or whose tiles have fewer pixels than [`MOST_IN_TILES`] times its own, is matched in tiles if they fit,
/// even if blocks took less time: tiles share maps, so their seams are better.
const LARGE: usize = 1 << 22;
const MOST_IN_TILES: f64 = 1.5;
/// Samples in which corrections are measured lie in the middle of the parts of a grid with this many columns and rows.
const SAMPLES: usize = 3;
/// Largest and smallest width and height of a sample in pixels.
const SAMPLE: usize = 1024;
const LEAST_SAMPLE: usize = 256;
/// Bytes that measuring takes for each pixel. A pair is measured as a whole if that fits in the memory of the method.
const BYTES: u64 = 72;

/// A pair in blocks, each matched alone. Their cut depends on the size of the pair, the disparities and the method alone, so it is the
/// same on every machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    size: (usize, usize),
    list: Vec<Region>,
    /// Pixels to the left and to the right of a part of the left view that hold its matches.
    reach: [usize; 2],
    range: DisparityRange,
    method: Method,
}

impl Blocks {
    /// The blocks of a pair of (width, height) pixels over the disparities of `range`: as many as the memory of `method` needs, with
    /// at most about 4096 x 4096 pixels each, and those that take the least time in total.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, and [`Error::Budget`] if even the smallest block does not fit.
    pub fn new(size: (usize, usize), range: DisparityRange, method: &Method) -> Result<Self> {
        let whole = Plan::new(size.0, size.1, range, method)?;
        let grid = Grid::of(&whole);
        let Some((_, (width, height))) = grid.quickest(&whole) else {
            return Err(too_little(&whole, grid.smallest()));
        };
        let rows = grid.down.spans(height);
        let list = rows.iter().flat_map(|[y, window_y]| {
            grid.across.spans(width).into_iter().map(|[x, window_x]| Region {
                part: Rect { x, y: y.clone() },
                window: Rect { x: window_x, y: window_y.clone() },
            })
        });
        Ok(Self { size, list: list.collect(), reach: grid.reach, range, method: method.clone() })
    }

    /// Whether a pair of (width, height) pixels is matched in blocks: if its tiles do not fit in the memory of `method`, or, for more than
    /// four million pixels, if they are so small that they take longer than blocks.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range.
    pub fn pay(size: (usize, usize), range: DisparityRange, method: &Method) -> Result<bool> {
        let whole = Plan::new(size.0, size.1, range, method)?;
        let Some(pixels) = Tiles::pixels(&whole) else { return Ok(true) };
        let share = pixels as f64 / whole.levels[0].pixels() as f64;
        if size.0 * size.1 < LARGE || share < MOST_IN_TILES {
            return Ok(false);
        }
        let in_tiles = share * (size.0 * size.1) as f64;
        let pays = |(in_blocks, window)| window != size && in_blocks < in_tiles;
        Ok(Grid::of(&whole).quickest(&whole).is_some_and(pays))
    }

    /// (width, height) of the pair.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The blocks, row by row from the top left. Their [parts](Region::part) are the whole view, each pixel once. Those of a row of
    /// blocks have the same rows.
    #[must_use]
    pub fn list(&self) -> &[Region] {
        &self.list
    }

    /// The corrections of all blocks: the median of those in the [samples](Self::samples), which `window` reads.
    ///
    /// # Errors
    /// The errors of `window` and of [`Conditioning::measured`].
    pub fn conditioning(&self, window: impl Fn(&Rect) -> Result<Pair>) -> Result<Conditioning> {
        let measured = |part: &Rect| Conditioning::measured(&window(part)?, self.range, &self.method);
        Ok(Conditioning::median(&self.samples().iter().map(measured).collect::<Result<Vec<_>>>()?))
    }

    /// The parts of the pair in which the corrections of all blocks are [measured](Self::conditioning). They are windows in the middle of the parts of a grid, or all of the pair if the memory holds it.
    #[must_use]
    pub fn samples(&self) -> Vec<Rect> {
        let (width, height) = self.size;
        let memory = u64::from(self.method.tiles.memory) << 20;
        if BYTES * (width * height) as u64 <= memory {
            return vec![Rect::whole(self.size)];
        }
        let half = ((memory / BYTES).isqrt() as usize).clamp(LEAST_SAMPLE, SAMPLE) / 2;
        let around = |middle: usize, [before, after]: [usize; 2], length: usize| {
            // Blocks of 2 x 2 pixels stay whole.
            let start = middle.saturating_sub(half + before) & !1;
            start..(middle + half + after).min(length)
        };
        let along = |length: usize, reach: [usize; 2]| {
            (0..SAMPLES).map(move |i| around((2 * i + 1) * length / (2 * SAMPLES), reach, length))
        };
        along(height, [0; 2])
            .flat_map(|y| along(width, self.reach).map(move |x| Rect { x, y: y.clone() }))
            .collect()
    }
}

/// The ways to cut a pair into blocks.
struct Grid {
    across: Axis,
    down: Axis,
    /// As [`Blocks::reach`].
    reach: [usize; 2],
    /// Blocks begin at multiples of this many pixels.
    step: usize,
}

impl Grid {
    fn of(whole: &Plan) -> Self {
        let FullSize { size: (width, height), range } = whole.of_pair();
        let halves = usize::from(whole.full.is_some());
        let step = 1 << (whole.levels.len() - 1 + halves);
        let mut reach = [range.max, -range.min].map(|disparity| usize::try_from(disparity).unwrap_or(0));
        if whole.method.refinement.right_map {
            // The right view sees the other way.
            reach = [reach[0].max(reach[1]); 2];
        }
        let across = Axis::new(width, reach.map(|reach| MARGIN + reach), step);
        let down = Axis::new(height, [MARGIN; 2], step);
        Self { across, down, reach, step }
    }

    /// (width, height) of the smallest window.
    fn smallest(&self) -> (usize, usize) {
        (self.across.crop(self.across.most()), self.down.crop(self.down.most()))
    }

    /// The size of the windows that take the least time, and the pixels that are then matched, those of tiles counted for each; `None` if
    /// no window fits in the memory.
    fn quickest(&self, whole: &Plan) -> Option<(f64, (usize, usize))> {
        let sides =
            iter::successors(Some(LARGEST), |side| Some(side * 3 / 4)).take_while(|side| *side >= self.step);
        let windows = sides.map(|side| {
            let crop = |axis: &Axis| axis.crop(axis.length().div_ceil(side));
            (crop(&self.across), crop(&self.down))
        });
        let pixels = |(width, height): (usize, usize)| {
            let plan = plan_of((width, height), whole).ok()?;
            let share = Tiles::pixels(&plan)? as f64 / plan.levels[0].pixels() as f64;
            Some(share * self.across.cropped(width) as f64 * self.down.cropped(height) as f64)
        };
        let timed = windows.chain([self.smallest()]).filter_map(|window| Some((pixels(window)?, window)));
        timed.min_by(|(a, _), (b, _)| a.total_cmp(b))
    }
}

/// The plan of a window of (width, height) pixels. With a prior or without one, the blocks are the same.
fn plan_of((width, height): (usize, usize), whole: &Plan) -> Result<Plan> {
    Ok(Plan::new(width, height, whole.of_pair().range, &whole.method)?.with_prior(true))
}

/// The error that the memory holds no block; `smallest` is the size of the smallest window. The whole pair in tiles may need less.
fn too_little(whole: &Plan, smallest: (usize, usize)) -> Error {
    let in_blocks = plan_of(smallest, whole).and_then(|plan| Tiles::new(&plan));
    match (Tiles::new(whole), in_blocks) {
        (Err(Error::Budget(in_tiles)), Err(Error::Budget(in_blocks))) => match (in_tiles, in_blocks) {
            (
                BudgetError::NoTileFits { memory, width, height, labels, needed },
                BudgetError::NoTileFits { needed: for_block, .. },
            ) => BudgetError::NoTileFits { memory, width, height, labels, needed: needed.min(for_block) }
                .into(),
            (other, _) => other.into(),
        },
        (Ok(_), Err(error)) | (Err(error), _) => error,
        (Ok(_), Ok(_)) => unreachable!("a window that fits is a block"),
    }
}
