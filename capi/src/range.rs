//! The disparity range and the region.

use mrfgs::image::Rect;
use mrfgs::options::DisparityRange;

use crate::status::Failure;

/// The disparities to search, in pixels, inclusive.
#[repr(C)]
pub struct Range {
    pub min: i32,
    pub max: i32,
}

impl Range {
    /// The range; `None` if it is null.
    ///
    /// # Safety
    /// `range` is null or valid.
    pub(crate) unsafe fn searched(range: *const Self) -> Result<Option<DisparityRange>, Failure> {
        // SAFETY: guaranteed by the caller.
        let range = unsafe { range.as_ref() };
        Ok(range.map(|range| DisparityRange::new(range.min, range.max)).transpose()?)
    }
}

/// A region of the left image, in pixels: first column, first row and size.
#[repr(C)]
pub struct Region {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

impl Region {
    /// The region as columns and rows; `None` if it is null.
    ///
    /// # Safety
    /// `region` is null or valid.
    pub(crate) unsafe fn part(region: *const Self) -> Option<Rect> {
        // SAFETY: guaranteed by the caller.
        let region = unsafe { region.as_ref() };
        let ends = |start: u32, length: u32| start as usize..(start as usize).saturating_add(length as usize);
        region.map(|region| Rect { x: ends(region.x, region.width), y: ends(region.y, region.height) })
    }
}
