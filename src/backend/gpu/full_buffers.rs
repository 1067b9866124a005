//! The buffers of a pair at full size that is matched at half of it.

use super::allocator::Allocator;
use super::rows::Rows;
use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::error::Result;
use std::ops::Range;

/// What the full size takes. Rows are twice as many as at half the size, in whole blocks.
pub(super) struct FullBuffers {
    /// Elements in a row.
    pub(super) pitch: u32,
    /// The views, two words a pixel: colours in 8 bits each | 1 << 24 if masked; grey.
    pub(super) left: Rows,
    pub(super) right: Rows,
    /// The census of the left and of the right view.
    pub(super) census: [Rows; 2],
    /// Costs around the labels: four words a pixel of half the size.
    pub(super) costs: Rows,
    pub(super) raw: Rows,
    pub(super) disparity: Rows,
    /// Validity and confidence.
    pub(super) flags: Rows,
}

impl FullBuffers {
    /// Those for a finest level of these parameters.
    pub(super) fn new(a: &mut Allocator, fine: &LevelParams) -> Result<Self> {
        let pitch = (2 * fine.width).next_multiple_of(ALIGN_WORDS as u32);
        let whole = [0, 2 * fine.height];
        let costs = a.rows("costs around labels", 4 * fine.pixel_pitch, &[0, fine.height])?;
        let mut map = |label: &str, words: u32| a.rows(label, words * pitch, &whole);
        Ok(Self {
            pitch,
            left: map("left view at full size", 2)?,
            right: map("right view at full size", 2)?,
            census: [map("left census at full size", 1)?, map("right census at full size", 1)?],
            costs,
            raw: map("raw at full size", 1)?,
            disparity: map("disparity at full size", 1)?,
            flags: map("flags at full size", 1)?,
        })
    }

    /// The rows of the full size that `rows` of half of it stand for.
    pub(super) fn rows(rows: &Range<u32>) -> Range<u32> {
        2 * rows.start..2 * rows.end
    }
}
