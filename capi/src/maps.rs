//! Maps in the memory of C.

use std::mem::offset_of;
use std::ptr;

use mrfgs::Matched;
use mrfgs::image::Plane;
use mrfgs::maps::flag;

use crate::frame::extent;
use crate::status::Failure;

/// Why a pixel is what it is: bits of the validity map. A pixel of 0 is measured and trusted.
#[repr(u8)]
pub enum Flag {
    /// The match is outside the right image.
    Outside = 1,
    /// The right view disagrees: occluded, or mistaken.
    Occluded = 2,
    /// The pixel is in a region too small to be trusted.
    Speckle = 4,
    /// The confidence is low; the disparity stays.
    LowConfidence = 8,
    /// The disparity is filled in from other pixels.
    Filled = 16,
    /// The pixel is ignored, and has no disparity.
    Masked = 32,
    /// Two labels match equally well.
    Tie = 64,
    /// The pixels around it outvote the disparity, and it is filled in from them.
    Outvoted = 128,
}

// The header takes numbers alone.
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

/// Where maps are written; all of them have the size of the images. Null leaves a map out. Strides are in bytes, from a row to the next
/// one.
#[repr(C)]
pub struct Maps {
    /// sizeof(mrfgs_maps).
    pub size: usize,
    /// The disparity in pixels, +infinity where there is none. Left (x, y) with disparity d is seen at right (x - d, y).
    pub disparity: *mut f32,
    pub disparity_stride: usize,
    /// How far the best runner-up is behind, in 1/8 nat, as a mean over the pixels around; those with another disparity count 0. It
    /// is 0 where nothing was measured.
    pub confidence: *mut u8,
    pub confidence_stride: usize,
    /// Why each pixel is what it is: the sum of mrfgs_flag.
    pub validity: *mut u8,
    pub validity_stride: usize,
    /// The disparity of the right view in pixels, +infinity where there is none: right (x, y) with disparity d is seen at left (x + d, y).
    /// A match that writes it takes longer.
    pub right: *mut f32,
    pub right_stride: usize,
    /// The error to expect of every measured disparity in pixels, from its confidence: about two thirds are nearer to the truth.
    /// +infinity where nothing was measured.
    pub sigma: *mut f32,
    pub sigma_stride: usize,
}

/// The sizes that the structure has had, each with more fields than the one before.
const SIZES: [usize; 3] = [offset_of!(Maps, right), offset_of!(Maps, sigma), size_of::<Maps>()];

impl Maps {
    /// What a caller gives, whose header may be older and know fewer fields.
    ///
    /// # Safety
    /// `maps` is null, or holds its size and, where that is one of `SIZES`, as many bytes.
    pub(crate) unsafe fn given(maps: *const Self) -> Result<Self, Failure> {
        if maps.is_null() {
            return Err(Failure::argument("the structure of the maps is null"));
        }
        // SAFETY: the caller promises that the size, which is the first field, is there.
        let size = unsafe { maps.cast::<usize>().read() };
        if !SIZES.contains(&size) {
            return Err(Failure::argument(format!(
                "maps.size is {size}, and sizeof(mrfgs_maps) is {} in the library: set it, and build with the library's own header",
                size_of::<Self>()
            )));
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
        // SAFETY: the caller promises that so many bytes are there; the structure has no fewer, and its fields may hold any bytes.
        unsafe { maps.cast::<u8>().copy_to_nonoverlapping((&raw mut own).cast::<u8>(), size) };
        Ok(own)
    }

    /// Whether maps of this size fit.
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

    /// Writes every map that is wanted.
    ///
    /// # Safety
    /// The maps were checked for the size of those that were found, and are as large as their fields say.
    pub(crate) unsafe fn write(&self, matched: &Matched) {
        if !self.disparity.is_null() {
            // SAFETY: the caller promises it.
            unsafe { put(&matched.disparity(), self.disparity, self.disparity_stride) };
        }
        if !self.confidence.is_null() {
            // SAFETY: the caller promises it.
            unsafe { put(matched.confidence(), self.confidence, self.confidence_stride) };
        }
        if !self.validity.is_null() {
            // SAFETY: the caller promises it.
            unsafe { put(matched.validity(), self.validity, self.validity_stride) };
        }
        if !self.sigma.is_null() {
            // SAFETY: the caller promises it.
            unsafe { put(&matched.sigma(), self.sigma, self.sigma_stride) };
        }
        if let Some(right) = matched.maps.right_map().filter(|_| !self.right.is_null()) {
            // SAFETY: the caller promises it.
            unsafe { put(&right, self.right, self.right_stride) };
        }
    }
}

/// Refuses the map `name` where it is null, or has a stride that rows of this size do not fit.
pub(crate) fn check(name: &str, map: *const f32, stride: usize, size: (usize, usize)) -> Result<(), Failure> {
    if map.is_null() {
        return Err(Failure::argument(format!("the map of {name} is null")));
    }
    extent(stride, size, size_of::<f32>())
        .map_err(|wrong| Failure::argument(format!("the map of {name} {wrong}")))?;
    Ok(())
}

/// A copy of a map that was checked.
///
/// # Safety
/// `map` is as large as stride and size say.
pub(crate) unsafe fn read<T: Copy>(
    map: *const T,
    stride: usize,
    (width, height): (usize, usize),
) -> Plane<T> {
    Plane::from_fn(width, height, |x, y| {
        // SAFETY: the pixel is in the map, as the caller promises.
        let at = unsafe { map.byte_add(y * stride + x * size_of::<T>()) };
        // SAFETY: the same; rows may begin at any address.
        unsafe { at.read_unaligned() }
    })
}

/// Copies a map byte by byte: rows may begin at any address, and hold anything.
///
/// # Safety
/// `to` is the first of as many rows as `map` has, `stride` bytes apart, each at least as long as its rows.
pub(crate) unsafe fn put<T: Copy>(map: &Plane<T>, to: *mut T, stride: usize) {
    for y in 0..map.height() {
        let row = map.row(y);
        // SAFETY: the row is in the memory of the map, as the caller promises.
        let to = unsafe { to.cast::<u8>().add(y * stride) };
        // SAFETY: both rows have these bytes, and one of them was made here.
        unsafe { row.as_ptr().cast::<u8>().copy_to_nonoverlapping(to, size_of_val(row)) };
    }
}
