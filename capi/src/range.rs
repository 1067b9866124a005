//! The disparities to search.

use mrfgs::options::DisparityRange;

use crate::status::Failure;

/// The disparities to search, in pixels, both ends included.
#[repr(C)]
pub struct Range {
    pub min: i32,
    pub max: i32,
}

impl Range {
    /// The range; `None` where it is null.
    ///
    /// # Safety
    /// `range` is null or good.
    pub(crate) unsafe fn searched(range: *const Self) -> Result<Option<DisparityRange>, Failure> {
        // SAFETY: the caller promises it.
        let range = unsafe { range.as_ref() };
        Ok(range.map(|range| DisparityRange::new(range.min, range.max)).transpose()?)
    }
}
