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

/// The cameras of a rectified pair: from disparities to depths.
pub struct Rig {
    pub(crate) inner: depth::Rig,
    /// (width, height) of the images, where it is known.
    size: Option<(usize, usize)>,
    /// Depths along the axis take none.
    pub(crate) knows_principal_point: bool,
}

impl Rig {
    fn of(calibration: &calib::Calibration) -> mrfgs::Result<Self> {
        let size = calibration.width.zip(calibration.height);
        let size = size.map(|(width, height)| (width as usize, height as usize));
        Ok(Self { inner: depth::Rig::new(calibration)?, size, knows_principal_point: true })
    }

    /// Refuses a map of another size than that of the calibration.
    pub(crate) fn check(&self, (width, height): (u32, u32)) -> Result<(), Failure> {
        match self.size.filter(|known| *known != (width as usize, height as usize)) {
            Some((w, h)) => Err(Failure::argument(format!(
                "the map is {width} x {height} and the calibration of images of {w} x {h}: depth takes the calibration of this size"
            ))),
            None => Ok(()),
        }
    }
}

/// The rig of a pair that is rectified already, by its focal length and doffs (cx of the right camera less cx of the left one; mostly 0) in
/// pixels, and by its baseline, whose unit is that of all depths.
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
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("rig", rig, make) }
}

/// The rig of a pair that is rectified already, by its calibration. One that is for images of several sizes is refused: give
/// mrfgs_rig_new() the numbers of yours.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_of_calibration(
    calibration: *const Calibration,
    rig: *mut *mut Rig,
) -> Status {
    let make = || {
        // SAFETY: the caller promises that the pointer is null or good.
        let calibration = unsafe { argument::thing("calibration", calibration) }?;
        let rectified = calibration.0.of_rectified_images(None)?.ok_or_else(|| {
            Failure::argument(
                "the calibration is of images that are not rectified: use mrfgs_rig_of_rectification(), or give that of the \
                 rectified pair",
            )
        })?;
        let rig = Rig::of(&rectified)?;
        let doubts = Doubt::about(&rectified, rig.size.map(|(width, _)| width));
        warnings::say(doubts.iter().map(words::doubt));
        Ok(rig)
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("rig", rig, make) }
}

/// The rig of what a rectification makes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_of_rectification(
    rectification: *const Rectification,
    rig: *mut *mut Rig,
) -> Status {
    let make = || {
        // SAFETY: the caller promises that the pointer is null or good.
        let rectification = unsafe { argument::thing("rectification", rectification) }?;
        let Rig { inner, size, .. } = Rig::of(&rectification.by.calibration()?)?;
        let [rectifying, _] = rectification.by.rotations();
        Ok(Rig { inner: inner.rectified_by(rectifying), size, knows_principal_point: true })
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("rig", rig, make) }
}

/// The unit of the baseline, and so of depths: "mm", "cm", "m", or "unknown"; null for a rig that is null. It stays as it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_unit(rig: *const Rig) -> *const c_char {
    // SAFETY: the caller promises that the pointer is null or good.
    let unit = unsafe { rig.as_ref() }.map(|rig| match rig.inner.unit() {
        Unit::Millimetre => c"mm",
        Unit::Centimetre => c"cm",
        Unit::Metre => c"m",
        Unit::Unknown => c"unknown",
    });
    unit.map_or(std::ptr::null(), std::ffi::CStr::as_ptr)
}

/// The depth of every pixel along the optical axis, in the unit of the baseline, of a map of disparities in pixels: +infinity where there
/// is none. Strides are in bytes. Both maps may be one.
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
        // SAFETY: the caller promises that the pointer is null or good.
        let rig = unsafe { argument::thing("rig", rig) }?;
        let given = [("disparity", disparity, disparity_stride)];
        // SAFETY: the caller promises that the maps are as large as the arguments say.
        unsafe {
            put_each(rig, (width, height), given, ("depth", depth, depth_stride), |[d]| {
                rig.inner.depth(f64::from(d)).map_or(f32::INFINITY, |depth| depth as f32)
            })
        }
    })
}

/// The error to expect of every depth, in the unit of the baseline, of maps of disparities and of their errors (mrfgs_maps.sigma), both
/// in pixels: +infinity where there is none. Strides are in bytes. The maps may be one.
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
        // SAFETY: the caller promises that the pointer is null or good.
        let rig = unsafe { argument::thing("rig", rig) }?;
        let given = [("disparity", disparity, disparity_stride), ("sigma", sigma, sigma_stride)];
        // SAFETY: the caller promises that the maps are as large as the arguments say.
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

/// Writes `value` of each pixel of the given maps to `to`. Each map has its name and its stride.
///
/// # Safety
/// A map is null, or as large as its stride and the size say.
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
            // SAFETY: the pixel is in the map, as the caller promises.
            let values = given
                .map(|(_, map, stride)| unsafe { map.wrapping_byte_add(offset(stride)).read_unaligned() });
            let values = value(values);
            // SAFETY: the same.
            unsafe { to.wrapping_byte_add(offset(stride)).write_unaligned(values) };
        }
    }
    Ok(())
}

/// Frees a rig; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_rig_free(rig: *mut Rig) {
    // SAFETY: the caller promises that it was made here, and is freed once.
    unsafe { argument::free(rig) }
}
