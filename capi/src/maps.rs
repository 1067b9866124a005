//! Maps in C's memory.

use std::mem::offset_of;
use std::ptr;

use mrfgs::Matched;
use mrfgs::image::Plane;
use mrfgs::maps::flag;

use crate::argument;
use crate::frame::extent;
use crate::status::Failure;

/// The status of a pixel: bits of the validity map. A pixel of 0 is measured and trusted.
#[repr(u8)]
pub enum Flag {
    /// The match is outside the right image.
    Outside = 1,
    /// The right view disagrees: occluded or wrong.
    Occluded = 2,
    /// The pixel is in a region too small to be trusted.
    Speckle = 4,
    /// The confidence is low; the disparity is kept.
    LowConfidence = 8,
    /// The disparity is filled in from other pixels.
    Filled = 16,
    /// The pixel is ignored and has no disparity.
    Masked = 32,
    /// Two labels match equally well.
    Tie = 64,
    /// Neighbouring pixels outvote the disparity, and it is filled in from them.
    Outvoted = 128,
}

// cbindgen needs literal values above.
const _: () = assert!(
    Flag::Outside as u8 == flag::OUTSIDE
        && Flag::Occluded as u8 == flag::OCCLUDED
        && Flag::Speckle as u8 == flag::SPECKLE
        && Flag::LowConfidence as u8 == flag::LOW_CONFIDENCE
        && Flag::Filled as u8 == flag::FILLED
        && Flag::Masked as u8 == flag::MASKED
        && Flag::Tie as u8 == flag::TIE
        && Flag::Outvoted as u8 == flag::OUTVOTED
);

/// Destinations of the maps, which all have the size of the images. Null skips a map. Strides are in bytes, from one row to the next.
#[repr(C)]
pub struct Maps {
    /// sizeof(mrfgs_maps).
    pub size: usize,
    /// The disparity in pixels, +infinity if unknown. Left (x, y) with disparity d appears at right (x - d, y).
    pub disparity: *mut f32,
    pub disparity_stride: usize,
    /// How sure each pixel is: the lead of the best disparity over the runner-up in 1/8 nat, averaged over neighbouring pixels (those with
    /// another disparity count 0). 0 for pixels without a measurement.
    pub confidence: *mut u8,
    pub confidence_stride: usize,
    /// The status of each pixel: the sum of mrfgs_flag.
    pub validity: *mut u8,
    pub validity_stride: usize,
    /// The disparity of the right view in pixels, +infinity if unknown: right (x, y) with disparity d appears at left (x + d, y).
    /// Requesting it makes a match slower.
    pub right: *mut f32,
    pub right_stride: usize,
    /// The expected error of every measured disparity in pixels, from its confidence: about two thirds of the errors are smaller. +infinity
    /// for pixels without a measurement.
    pub sigma: *mut f32,
    pub sigma_stride: usize,
}

/// All sizes that the structure has had; each version added fields.
const SIZES: [usize; 3] = [offset_of!(Maps, right), offset_of!(Maps, sigma), size_of::<Maps>()];

impl Maps {
    /// Reads the caller's structure, which may come from an older header with fewer fields.
    ///
    /// # Safety
    /// `maps` is null, or starts with its size and, if that is one of `SIZES`, has that many bytes.
    pub(crate) unsafe fn given(maps: *const Self) -> Result<Self, Failure> {
        if maps.is_null() {
            return Err(Failure::argument("the structure of the maps is null"));
        }
        // SAFETY: the caller guarantees the size, which is the first field.
        let size = unsafe { maps.cast::<usize>().read() };
        if !SIZES.contains(&size) {
            return Err(argument::wrong_size::<Self>(&format!("maps.size is {size}"), "mrfgs_maps"));
        }
        let mut own = Self {
            size,
            disparity: ptr::null_mut(),
            disparity_stride: 0,
            confidence: ptr::null_mut(),
            confidence_stride: 0,
            validity: ptr::null_mut(),
            validity_stride: 0,
            right: ptr::null_mut(),
            right_stride: 0,
            sigma: ptr::null_mut(),
            sigma_stride: 0,
        };
        // SAFETY: the caller guarantees this many bytes; the structure has at least as many, and any bytes are valid fields.
        unsafe { maps.cast::<u8>().copy_to_nonoverlapping((&raw mut own).cast::<u8>(), size) };
        Ok(own)
    }

    /// Checks that maps of this size fit.
    pub(crate) fn check(&self, size: (usize, usize)) -> Result<(), Failure> {
        for (name, is_null, stride, pixel) in [
            ("disparity", self.disparity.is_null(), self.disparity_stride, size_of::<f32>()),
            ("confidence", self.confidence.is_null(), self.confidence_stride, 1),
            ("validity", self.validity.is_null(), self.validity_stride, 1),
            ("right", self.right.is_null(), self.right_stride, size_of::<f32>()),
            ("sigma", self.sigma.is_null(), self.sigma_stride, size_of::<f32>()),
        ] {
            if !is_null {
                extent(stride, size, pixel)
                    .map_err(|wrong| Failure::argument(format!("the map maps.{name} {wrong}")))?;
            }
        }
        Ok(())
    }

    /// Writes every requested map.
    ///
    /// # Safety
    /// The maps were checked for the size of `matched`, and are as large as their fields say.
    pub(crate) unsafe fn write(&self, matched: &Matched) {
        if !self.disparity.is_null() {
            // SAFETY: guaranteed by the caller.
            unsafe { put(&matched.disparity(), self.disparity, self.disparity_stride) };
        }
        if !self.confidence.is_null() {
            // SAFETY: guaranteed by the caller.
            unsafe { put(matched.confidence(), self.confidence, self.confidence_stride) };
        }
        if !self.validity.is_null() {
            // SAFETY: guaranteed by the caller.
            unsafe { put(matched.validity(), self.validity, self.validity_stride) };
        }
        if !self.sigma.is_null() {
            // SAFETY: guaranteed by the caller.
            unsafe { put(&matched.sigma(), self.sigma, self.sigma_stride) };
        }
        if let Some(right) = matched.maps.right_map().filter(|_| !self.right.is_null()) {
            // SAFETY: guaranteed by the caller.
            unsafe { put(&right, self.right, self.right_stride) };
        }
    }
}

/// Refuses the map `name` if it is null or its stride is too small for this size.
pub(crate) fn check(name: &str, map: *const f32, stride: usize, size: (usize, usize)) -> Result<(), Failure> {
    if map.is_null() {
        return Err(Failure::argument(format!("the map of {name} is null")));
    }
    extent(stride, size, size_of::<f32>())
        .map_err(|wrong| Failure::argument(format!("the map of {name} {wrong}")))?;
    Ok(())
}

/// Copies a checked map.
///
/// # Safety
/// `map` is as large as stride and size say.
pub(crate) unsafe fn read<T: Copy>(
    map: *const T,
    stride: usize,
    (width, height): (usize, usize),
) -> Plane<T> {
    Plane::from_fn(width, height, |x, y| {
        // SAFETY: the caller guarantees that the pixel is in the map.
        let at = unsafe { map.byte_add(y * stride + x * size_of::<T>()) };
        // SAFETY: as above; rows may be unaligned.
        unsafe { at.read_unaligned() }
    })
}

/// Copies a map byte by byte, as rows may be unaligned.
///
/// # Safety
/// `to` is the first of as many rows as `map` has, `stride` bytes apart, each at least as long as a row of `map`.
pub(crate) unsafe fn put<T: Copy>(map: &Plane<T>, to: *mut T, stride: usize) {
    for y in 0..map.height() {
        let row = map.row(y);
        // SAFETY: the caller guarantees that the row is in the map's memory.
        let to = unsafe { to.cast::<u8>().add(y * stride) };
        // SAFETY: both rows have this many bytes, and one of them was allocated here.
        unsafe { row.as_ptr().cast::<u8>().copy_to_nonoverlapping(to, size_of_val(row)) };
    }
}
