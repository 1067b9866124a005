//! Rectified pairs of what two cameras saw.

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

/// How images as the cameras took them become a rectified pair. It is found once, and applied to any number of pairs.
pub struct Rectification {
    pub(crate) by: mrfgs::rectification::Rectification,
    /// The same with its places, from the first pair on.
    kept: OnceLock<mrfgs::rectification::Rectification>,
}

/// Where a rectified view is written; it has the size of mrfgs_rectification_size(). Strides are in bytes, from a row to the next one.
#[repr(C)]
pub struct View {
    /// sizeof(mrfgs_view).
    pub size: usize,
    /// The pixels; 0 where there is no source. Null leaves them out.
    pub data: *mut c_void,
    pub stride: usize,
    /// The mrfgs_format of the pixels, of 8 or 16 bits. Of views of more than 8 bits, 8 bits are the upper ones; alpha is 0 where there is
    /// no source.
    pub format: u32,
    /// 255 where there is no source, else 0: a mask for mrfgs_match_masked(). Null leaves it out.
    pub mask: *mut u8,
    pub mask_stride: usize,
}

/// The rectification of images of so many pixels (0 and 0: those of the calibration), as OpenCV's stereoRectify chooses it. Alpha is from
/// 0, where every pixel of the views has a source, to 1, where no pixel of the images is lost; below 0 it is the rectification of the
/// calibration where it has one, else one that keeps the focal length. zero_disparity is 1 where what is infinitely far is to have a
/// disparity of 0, else 0. mrfgs_last_warnings() says what is probably wrong with the calibration.
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
        // SAFETY: the caller promises that the pointer is null or good.
        let calibration = unsafe { argument::thing("calibration", calibration) }?;
        let sizes = match (width, height) {
            (0, 0) => calibration.0.sizes().ok_or_else(|| {
                Failure::argument(
                    "the calibration does not say the size of the images: give width and height",
                )
            })?,
            size => [(size.0 as usize, size.1 as usize); 2],
        };
        if alpha.is_nan() || alpha > 1.0 {
            return Err(Failure::argument(format!(
                "alpha is {alpha}: give a number from 0 to 1, or -1 for the rectification of the calibration"
            )));
        }
        let options =
            Options { alpha: Some(alpha).filter(|alpha| *alpha >= 0.0), zero_disparity: zero_disparity != 0 };
        let by = mrfgs::rectification::Rectification::of_sizes(&calibration.0, sizes, &options)?;
        warnings::say(by.doubts().iter().map(words::doubt));
        Ok(Rectification::of(by))
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("rectification", rectification, find) }
}

/// Width and height of the rectified views, in pixels; turned by a quarter where one camera is above the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectification_size(
    rectification: *const Rectification,
    width: *mut u32,
    height: *mut u32,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        // SAFETY: the caller promises that a number can be written to each place that is not null.
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
        // SAFETY: the caller promises that the pointer is null or good.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::raw_pair([left, right]) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let left = unsafe { argument::thing("left view", left_view) }?;
        // SAFETY: the same.
        let right = unsafe { argument::thing("right view", right_view) }?;
        let size = rectification.by.size();
        let layouts = [left.check("left view", size)?, right.check("right view", size)?];
        let pair = rectification.with_places()?.apply(&pair)?;
        // SAFETY: it was checked for this size, and the caller promises that it is as large as its fields say.
        unsafe { left.write(layouts[0], pair.left()) };
        // SAFETY: the same.
        unsafe { right.write(layouts[1], pair.right()) };
        Ok(())
    })
}

/// Frees a rectification; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rectification_free(rectification: *mut Rectification) {
    // SAFETY: the caller promises that it was made here, and is freed once.
    unsafe { argument::free(rectification) }
}

impl Rectification {
    pub(crate) fn of(by: mrfgs::rectification::Rectification) -> Self {
        Self { by, kept: OnceLock::new() }
    }

    /// Many pairs may follow the first, so it finds out once where pixels come from.
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
    /// What its pixels are made of, where a view of this size fits.
    fn check(&self, name: &str, size: (usize, usize)) -> Result<Layout, Failure> {
        let wrong = |what: &str| Failure::argument(format!("the {name} {what}"));
        if self.size != size_of::<Self>() {
            return Err(wrong(&format!(
                "has the size {}, and sizeof(mrfgs_view) is {} in the library: set it, and build with the library's own header",
                self.size,
                size_of::<Self>()
            )));
        }
        let layout = Layout::of(self.format, name)?;
        if layout.sample == Sample::Float {
            return Err(wrong("has a format of floats: give one of 8 or 16 bits"));
        }
        if !self.data.is_null() {
            extent(self.stride, size, layout.pixel_bytes()).map_err(|what| wrong(&what))?;
        }
        if !self.mask.is_null() {
            extent(self.mask_stride, size, 1).map_err(|what| wrong(&format!("has a mask that {what}")))?;
        }
        Ok(layout)
    }

    /// Writes pixels and mask where they are wanted.
    ///
    /// # Safety
    /// The view was checked for the size of `image`, and is as large as its fields say.
    unsafe fn write(&self, layout: Layout, image: &image::Image) {
        if !self.mask.is_null() {
            let mask = image.masked.map(|masked| if *masked { u8::MAX } else { 0 });
            // SAFETY: the caller promises it.
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
            // SAFETY: the caller promises that the row is there.
            let to = unsafe { self.data.cast::<u8>().add(y * self.stride) };
            // SAFETY: both rows have these bytes, and one of them was made here.
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
