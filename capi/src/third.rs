//! Depths in the view of a camera beside the pair.

use std::ffi::c_char;
use std::path::Path;

use mrfgs::calibration::{cameras, third};

use crate::argument;
use crate::maps;
use crate::rig::Rig;
use crate::status::{Failure, Status, call};

/// A camera beside the pair, such as the colour camera of a rig: its lens, its size, and how it stands to the left camera.
pub struct ThirdCamera(cameras::ThirdCamera);

/// Reads it from a file, in any form that `mrfgs match --into` takes: one camera by the names of OpenCV or ROS, the last camera of
/// Kalibr's chain, or that of an OAK's calibration which is not one of its pair.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_read(
    path: *const c_char,
    camera: *mut *mut ThirdCamera,
) -> Status {
    let read = || {
        // SAFETY: the caller promises that it is a text.
        let path = unsafe { argument::text("the path", path) }?;
        Ok(ThirdCamera(third::read(Path::new(path))?))
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("camera", camera, read) }
}

/// The same of the text of such a file. Errors call it "text".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_of_text(
    text: *const c_char,
    camera: *mut *mut ThirdCamera,
) -> Status {
    let read = || {
        // SAFETY: the caller promises that it is a text.
        let text = unsafe { argument::text("the text", text) }?;
        Ok(ThirdCamera(third::of_text(Path::new("text"), text)?))
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("camera", camera, read) }
}

/// Width and height of its images, in pixels.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_size(
    camera: *const ThirdCamera,
    width: *mut u32,
    height: *mut u32,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let camera = unsafe { argument::thing("camera", camera) }?;
        // SAFETY: the caller promises that a number can be written to each place that is not null.
        unsafe { argument::put_size(camera.0.size, [width, height]) }
    })
}

/// The depths as a third camera sees them, along its axis and at its pixels, in the unit of the baseline: +infinity where it sees what the
/// map does not. `width` and `height` are those of the map of disparities (in pixels), and the map of depths has the size of
/// mrfgs_third_camera_size(). The nearest of several surfaces counts, and each pixel of the map covers what it covers there. Strides are in
/// bytes; the maps are not one.
///
/// The camera stands to the left camera that took the images where the rig is one of mrfgs_rig_of_rectification(), else to the rectified
/// one. A rig of mrfgs_rig_new() is refused, as it knows no principal point.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_depth_registered(
    rig: *const Rig,
    width: u32,
    height: u32,
    disparity: *const f32,
    disparity_stride: usize,
    camera: *const ThirdCamera,
    depth: *mut f32,
    depth_stride: usize,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let rig = unsafe { argument::thing("rig", rig) }?;
        // SAFETY: the same.
        let camera = unsafe { argument::thing("camera", camera) }?;
        if !rig.knows_principal_point {
            return Err(Failure::argument(
                "the rig knows no principal point, which another view takes: make it by mrfgs_rig_of_calibration() or \
                 mrfgs_rig_of_rectification()",
            ));
        }
        rig.check((width, height))?;
        let size = (width as usize, height as usize);
        maps::check("disparity", disparity, disparity_stride, size)?;
        maps::check("depth", depth.cast_const(), depth_stride, camera.0.size)?;
        // SAFETY: it is not null, and the caller promises that it is as large as the arguments say.
        let map = unsafe { maps::read(disparity, disparity_stride, size) };
        let depths = rig.inner.registered(&map, &camera.0);
        // SAFETY: the same.
        unsafe { maps::put(&depths, depth, depth_stride) };
        Ok(())
    })
}

/// Frees a third camera; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_free(camera: *mut ThirdCamera) {
    // SAFETY: the caller promises that it was made here, and is freed once.
    unsafe { argument::free(camera) }
}
