//! Depth.

use std::ffi::c_char;

use mrfgs::depth;
use mrfgs::image::calib::{self, Camera, Unit};
use mrfgs::rectification::Doubt;

use crate::argument;
use crate::calibration::Calibration;
use crate::maps;
use crate::rectification::Rectification;
use crate::status::{Failure, Status, call};
use crate::warnings;
use crate::words;

/// The cameras of a rectified pair, which turn disparities into depths.
pub struct Rig {
    pub(crate) inner: depth::Rig,
    /// (width, height) of the images, if known.
    size: Option<(usize, usize)>,
    /// Not needed for depths along the axis.
    pub(crate) knows_principal_point: bool,
}

impl Rig {
    fn of(calibration: &calib::Calibration) -> mrfgs::Result<Self> {
        let size = calibration.width.zip(calibration.height);
        let size = size.map(|(width, height)| (width as usize, height as usize));
        Ok(Self { inner: depth::Rig::new(calibration)?, size, knows_principal_point: true })
    }

    /// Refuses a map whose size differs from the calibration.
    pub(crate) fn check(&self, (width, height): (u32, u32)) -> Result<(), Failure> {
        match self.size.filter(|known| *known != (width as usize, height as usize)) {
            Some((w, h)) => Err(Failure::argument(format!(
                "the map is {width} x {height} but the calibration is for images of {w} x {h}: give the calibration of this size"
            ))),
            None => Ok(()),
        }
    }
}

/// Makes the rig of a rectified pair from its focal length and doffs (cx of the right camera minus cx of the left one; usually 0) in
/// pixels, and its baseline, whose unit applies to all depths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_new(focal: f64, baseline: f64, doffs: f64, rig: *mut *mut Rig) -> Status {
    let make = || {
        for (name, value, fits) in
            [("focal", focal, focal > 0.0), ("baseline", baseline, baseline > 0.0), ("doffs", doffs, true)]
        {
            if !fits || !value.is_finite() {
                let expected = if name == "doffs" { "a number" } else { "a number above 0" };
                return Err(Failure::argument(format!("{name} is {value}: give {expected}")));
            }
        }
        // Depths do not depend on the principal point.
        let camera = Camera { focal_length: [focal; 2], principal_point: [0.0; 2] };
        let mut calibration = calib::Calibration::of_cameras(camera, baseline, Unit::Unknown);
        calibration.doffs = Some(doffs);
        Ok(Rig { knows_principal_point: false, ..Rig::of(&calibration)? })
    };
    // SAFETY: the caller guarantees that `rig` is null or writable.
    unsafe { argument::make("rig", rig, make) }
}

/// Makes the rig of a rectified pair from its calibration. A calibration for several image sizes is refused: use mrfgs_rig_new() with the
/// values for yours.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_of_calibration(
    calibration: *const Calibration,
    rig: *mut *mut Rig,
) -> Status {
    let make = || {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let calibration = unsafe { argument::thing("calibration", calibration) }?;
        let rectified = calibration.0.of_rectified_images(None)?.ok_or_else(|| {
            Failure::argument(
                "the calibration describes images that are not rectified: use mrfgs_rig_of_rectification(), or give that of the \
                 rectified pair",
            )
        })?;
        let rig = Rig::of(&rectified)?;
        let doubts = Doubt::about(&rectified, rig.size.map(|(width, _)| width));
        warnings::say(doubts.iter().map(words::doubt));
        Ok(rig)
    };
    // SAFETY: the caller guarantees that `rig` is null or writable.
    unsafe { argument::make("rig", rig, make) }
}

/// Makes the rig of the pairs that a rectification gives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_of_rectification(
    rectification: *const Rectification,
    rig: *mut *mut Rig,
) -> Status {
    let make = || {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        let Rig { inner, size, .. } = Rig::of(&rectification.by.calibration()?)?;
        let [rectifying, _] = rectification.by.rotations();
        Ok(Rig { inner: inner.rectified_by(rectifying), size, knows_principal_point: true })
    };
    // SAFETY: the caller guarantees that `rig` is null or writable.
    unsafe { argument::make("rig", rig, make) }
}

/// The unit of the baseline and of depths: "mm", "cm", "m", or "unknown"; null for a null rig. Always valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_unit(rig: *const Rig) -> *const c_char {
    // SAFETY: the caller guarantees that the pointer is null or valid.
    let unit = unsafe { rig.as_ref() }.map(|rig| match rig.inner.unit() {
        Unit::Millimetre => c"mm",
        Unit::Centimetre => c"cm",
        Unit::Metre => c"m",
        Unit::Unknown => c"unknown",
    });
    unit.map_or(std::ptr::null(), std::ffi::CStr::as_ptr)
}

/// The depth of every pixel along the optical axis, in the unit of the baseline, from a disparity map in pixels: +infinity if unknown.
/// Strides are in bytes. Both maps may be the same memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_depth(
    rig: *const Rig,
    width: u32,
    height: u32,
    disparity: *const f32,
    disparity_stride: usize,
    depth: *mut f32,
    depth_stride: usize,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rig = unsafe { argument::thing("rig", rig) }?;
        let given = [("disparity", disparity, disparity_stride)];
        // SAFETY: the caller guarantees that the maps are as large as the arguments say.
        unsafe {
            put_each(rig, (width, height), given, ("depth", depth, depth_stride), |[d]| {
                rig.inner.depth(f64::from(d)).map_or(f32::INFINITY, |depth| depth as f32)
            })
        }
    })
}

/// The expected error of every depth, in the unit of the baseline, from maps of disparities and of their errors (mrfgs_maps.sigma), both in
/// pixels: +infinity if unknown. Strides are in bytes. The maps may be the same memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_depth_sigma(
    rig: *const Rig,
    width: u32,
    height: u32,
    disparity: *const f32,
    disparity_stride: usize,
    sigma: *const f32,
    sigma_stride: usize,
    depth_sigma: *mut f32,
    depth_sigma_stride: usize,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rig = unsafe { argument::thing("rig", rig) }?;
        let given = [("disparity", disparity, disparity_stride), ("sigma", sigma, sigma_stride)];
        // SAFETY: the caller guarantees that the maps are as large as the arguments say.
        unsafe {
            put_each(
                rig,
                (width, height),
                given,
                ("depth_sigma", depth_sigma, depth_sigma_stride),
                |[d, sigma]| {
                    rig.inner
                        .depth_sigma(f64::from(d), f64::from(sigma))
                        .map_or(f32::INFINITY, |sigma| sigma as f32)
                },
            )
        }
    })
}

/// Writes `value` of each pixel of the given maps to `to`. Each map comes with name and stride.
///
/// # Safety
/// Each map is null, or as large as its stride and the size say.
unsafe fn put_each<const N: usize>(
    rig: &Rig,
    (width, height): (u32, u32),
    given: [(&str, *const f32, usize); N],
    (name, to, stride): (&str, *mut f32, usize),
    value: impl Fn([f32; N]) -> f32,
) -> Result<(), Failure> {
    let size = (width as usize, height as usize);
    rig.check((width, height))?;
    for (name, map, stride) in given.into_iter().chain([(name, to.cast_const(), stride)]) {
        maps::check(name, map, stride, size)?;
    }
    for y in 0..size.1 {
        for x in 0..size.0 {
            let offset = |stride: usize| y * stride + x * size_of::<f32>();
            // SAFETY: the caller guarantees that the pixel is in the map.
            let values = given
                .map(|(_, map, stride)| unsafe { map.wrapping_byte_add(offset(stride)).read_unaligned() });
            let values = value(values);
            // SAFETY: as above.
            unsafe { to.wrapping_byte_add(offset(stride)).write_unaligned(values) };
        }
    }
    Ok(())
}

/// Frees a rig; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_free(rig: *mut Rig) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(rig) }
}
