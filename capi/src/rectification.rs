//! Rectification of raw pairs.

use std::ffi::c_void;
use std::sync::OnceLock;

use mrfgs::image;
use mrfgs::rectification::Options;

use crate::argument;
use crate::calibration::Calibration;
use crate::frame::{self, Image, Layout, Sample, extent};
use crate::maps::put;
use crate::status::{Failure, Status, call};
use crate::warnings;
use crate::words;

/// Turns raw images into rectified pairs. It is computed once and applies to any number of pairs.
pub struct Rectification {
    pub(crate) by: mrfgs::rectification::Rectification,
    /// A copy with cached source positions, from the first pair on.
    kept: OnceLock<mrfgs::rectification::Rectification>,
}

/// The destination of a rectified view, of the size mrfgs_rectification_size(). Strides are in bytes, from one row to the next.
#[repr(C)]
pub struct View {
    /// sizeof(mrfgs_view).
    pub size: usize,
    /// The pixels; 0 without a source. Null skips them.
    pub data: *mut c_void,
    pub stride: usize,
    /// The mrfgs_format of the pixels, of 8 or 16 bits. 8 bits are the upper bits of deeper views; alpha is 0 without a source.
    pub format: u32,
    /// 255 for pixels without a source, else 0: a mask for mrfgs_match_masked(). Null skips it.
    pub mask: *mut u8,
    pub mask_stride: usize,
}

/// Makes the rectification of images of this size in pixels (0 and 0: that of the calibration), like OpenCV's stereoRectify. Alpha runs
/// from 0, where the views have no empty borders, to 1, where they contain all pixels of the images; below 0 the rectification in the
/// calibration is used if there is one, else one that keeps the focal length. With zero_disparity 1, points at infinity have disparity 0.
/// mrfgs_last_warnings() lists probable faults of the calibration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectification_new(
    calibration: *const Calibration,
    width: u32,
    height: u32,
    alpha: f64,
    zero_disparity: u32,
    rectification: *mut *mut Rectification,
) -> Status {
    let find = || {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let calibration = unsafe { argument::thing("calibration", calibration) }?;
        let sizes = match (width, height) {
            (0, 0) => calibration.0.sizes().ok_or_else(|| {
                Failure::argument("the calibration lacks the size of the images: give width and height")
            })?,
            size => [(size.0 as usize, size.1 as usize); 2],
        };
        if alpha.is_nan() || alpha > 1.0 {
            return Err(Failure::argument(format!(
                "alpha is {alpha}: give a number from 0 to 1, or -1 for the rectification in the calibration"
            )));
        }
        let options =
            Options { alpha: Some(alpha).filter(|alpha| *alpha >= 0.0), zero_disparity: zero_disparity != 0 };
        let by = mrfgs::rectification::Rectification::of_sizes(&calibration.0, sizes, &options)?;
        warnings::say(by.doubts().iter().map(words::doubt));
        Ok(Rectification::of(by))
    };
    // SAFETY: the caller guarantees that `rectification` is null or writable.
    unsafe { argument::make("rectification", rectification, find) }
}

/// Width and height of the rectified views, in pixels; swapped if one camera is above the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectification_size(
    rectification: *const Rectification,
    width: *mut u32,
    height: *mut u32,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        // SAFETY: the caller guarantees that each place is null or writable.
        unsafe { argument::put_size(rectification.by.size(), [width, height]) }
    })
}

/// Rectifies a pair of images, and writes both views.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectify(
    rectification: *const Rectification,
    left: *const Image,
    right: *const Image,
    left_view: *const View,
    right_view: *const View,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        // SAFETY: the caller guarantees that the images match their fields until this returns.
        let pair = unsafe { frame::raw_pair([left, right]) }?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let left = unsafe { argument::thing("left view", left_view) }?;
        // SAFETY: as above.
        let right = unsafe { argument::thing("right view", right_view) }?;
        let size = rectification.by.size();
        let layouts = [left.check("left view", size)?, right.check("right view", size)?];
        let pair = rectification.with_places()?.apply(&pair)?;
        // SAFETY: it was checked for this size, and the caller guarantees that it is as large as its fields say.
        unsafe { left.write(layouts[0], pair.left()) };
        // SAFETY: as above.
        unsafe { right.write(layouts[1], pair.right()) };
        Ok(())
    })
}

/// Frees a rectification; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectification_free(rectification: *mut Rectification) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(rectification) }
}

impl Rectification {
    pub(crate) fn of(by: mrfgs::rectification::Rectification) -> Self {
        Self { by, kept: OnceLock::new() }
    }

    /// Caches the source positions, as many pairs may follow the first.
    fn with_places(&self) -> mrfgs::Result<&mrfgs::rectification::Rectification> {
        if let Some(kept) = self.kept.get() {
            return Ok(kept);
        }
        let mut by = self.by.clone();
        by.keep_places()?;
        Ok(self.kept.get_or_init(|| by))
    }
}

impl View {
    /// The layout of its pixels, after checking that a view of this size fits.
    fn check(&self, name: &str, size: (usize, usize)) -> Result<Layout, Failure> {
        let wrong = |what: &str| Failure::argument(format!("the {name} {what}"));
        if self.size != size_of::<Self>() {
            let said = format!("the {name} has the size {}", self.size);
            return Err(argument::wrong_size::<Self>(&said, "mrfgs_view"));
        }
        let layout = Layout::of(self.format, name)?;
        if layout.sample == Sample::Float {
            return Err(wrong("has a float format: give one of 8 or 16 bits"));
        }
        if !self.data.is_null() {
            extent(self.stride, size, layout.pixel_bytes()).map_err(|what| wrong(&what))?;
        }
        if !self.mask.is_null() {
            extent(self.mask_stride, size, 1).map_err(|what| wrong(&format!("has a mask that {what}")))?;
        }
        Ok(layout)
    }

    /// Writes the requested pixels and mask.
    ///
    /// # Safety
    /// The view was checked for the size of `image`, and is as large as its fields say.
    unsafe fn write(&self, layout: Layout, image: &image::Image) {
        if !self.mask.is_null() {
            let mask = image.masked.map(|masked| if *masked { u8::MAX } else { 0 });
            // SAFETY: guaranteed by the caller.
            unsafe { put(&mask, self.mask, self.mask_stride) };
        }
        if self.data.is_null() {
            return;
        }
        let (width, height) = image.pixels.size();
        let mut row = Vec::with_capacity(width * layout.pixel_bytes());
        for y in 0..height {
            row.clear();
            for (pixel, masked) in image.pixels.row(y).iter().zip(image.masked.row(y)) {
                for sample in samples(*pixel, *masked, layout) {
                    match layout.sample {
                        Sample::Byte => row.push((sample >> 8) as u8),
                        Sample::Word | Sample::Float => row.extend(sample.to_ne_bytes()),
                    }
                }
            }
            // SAFETY: the caller guarantees that the row exists.
            let to = unsafe { self.data.cast::<u8>().add(y * self.stride) };
            // SAFETY: both rows have this many bytes, and one of them was allocated here.
            unsafe { row.as_ptr().copy_to_nonoverlapping(to, row.len()) };
        }
    }
}

/// The samples of a pixel, in the order of the layout.
fn samples([r, g, b, grey]: image::Pixel, masked: bool, layout: Layout) -> impl Iterator<Item = u16> {
    let alpha = if masked { 0 } else { u16::MAX };
    let [first, last] = if layout.is_bgr { [b, r] } else { [r, b] };
    let all = if layout.channels == 1 { [grey, 0, 0, 0] } else { [first, g, last, alpha] };
    all.into_iter().take(layout.channels).map(move |sample| if masked { 0 } else { sample })
}
