//! A region of the left view that is matched alone: the window of both views that it needs, and its part of the maps.

mod blocks;

pub use blocks::Blocks;

use crate::error::{Error, Result};
use crate::image::{Pair, Rect};
use crate::maps::Maps;
use crate::options::DisparityRange;
use crate::program::tiles::OVERLAP;
use std::ops::Range;

/// Windows start at multiples of this many pixels, the pixel size of the coarsest level, to share its grid.
const GRID: usize = 32;

/// A region of the left view, which is matched like a tile. Its maps may differ from those of the whole pair,
/// to which all pixels contribute, but are the same on every device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    part: Rect,
    window: Rect,
}

impl Region {
    /// The region `part` of the left view of a pair of (width, height) pixels, over the disparities of `range`.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where it is empty or not inside the view.
    pub fn new(part: Rect, (width, height): (usize, usize), range: DisparityRange) -> Result<Self> {
        if part.x.is_empty() || part.y.is_empty() || part.x.end > width || part.y.end > height {
            return Err(Error::Mismatch(format!(
                "the region of columns {} to {} and rows {} to {} is not inside a view of {width} x {height} pixels",
                part.x.start, part.x.end, part.y.start, part.y.end
            )));
        }
        // The right view shows x at x - max to x - min.
        let reach = |disparity: i32| usize::try_from(disparity).unwrap_or(0);
        let window = |ends: &Range<usize>, before: usize, after: usize, length: usize| {
            let start = ends.start.saturating_sub(before + OVERLAP);
            start - start % GRID..(ends.end + after + OVERLAP).min(length)
        };
        let x = window(&part.x, reach(range.max), reach(-range.min), width);
        let y = window(&part.y, 0, 0, height);
        Ok(Self { part, window: Rect { x, y } })
    }

    /// The region, in pixels of the left view.
    #[must_use]
    pub fn part(&self) -> &Rect {
        &self.part
    }

    /// The window that is matched for the region, in pixels of both views.
    #[must_use]
    pub fn window(&self) -> &Rect {
        &self.window
    }

    /// The part of a pair that is matched: the region, its counterpart in the right view, and a margin.
    #[must_use]
    pub fn window_of(&self, pair: &Pair) -> Pair {
        pair.crop(&self.window)
    }

    /// The maps of the region, from the maps of its window.
    #[must_use]
    pub fn maps_of(&self, maps: &Maps) -> Maps {
        maps.crop(&self.part.within(&self.window))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_includes_the_counterpart_in_the_right_view() {
        let region = |x, y, (min, max)| {
            Region::new(Rect { x, y }, (300, 200), DisparityRange { min, max }).map(|region| region.window)
        };
        assert_eq!(region(140..150, 80..90, (0, 40)).unwrap(), Rect { x: 64..182, y: 32..122 });
        assert_eq!(region(140..150, 80..90, (-20, 10)).unwrap(), Rect { x: 96..202, y: 32..122 });
        assert_eq!(region(140..150, 80..90, (5, 10)).unwrap().x, 96..182);
        assert_eq!(region(0..300, 0..200, (0, 40)).unwrap(), Rect::whole((300, 200)));
        for (x, y) in [(5..5, 0..9), (0..9, 7..7), (0..301, 0..9), (0..9, 190..201)] {
            let said = region(x, y, (0, 9)).unwrap_err().to_string();
            assert!(said.contains("not inside a view of 300 x 200 pixels"), "{said}");
        }
    }
}
