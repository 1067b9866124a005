//! Depths in the view of a third camera.

use std::ffi::c_char;
use std::path::Path;

use mrfgs::calibration::{cameras, third};

use crate::argument;
use crate::maps;
use crate::rig::Rig;
use crate::status::{Failure, Status, call};

/// A camera besides the pair, such as a colour camera: its lens, image size and pose relative to the left camera.
pub struct ThirdCamera(cameras::ThirdCamera);

/// Reads a camera from a file, in any format of `mrfgs match --into`: one camera with the names of OpenCV or ROS, the last camera of a
/// Kalibr chain, or the camera of an OAK calibration that is not part of its pair.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_read(
    path: *const c_char,
    camera: *mut *mut ThirdCamera,
) -> Status {
    let read = || {
        // SAFETY: the caller guarantees a text.
        let path = unsafe { argument::text("the path", path) }?;
        Ok(ThirdCamera(third::read(Path::new(path))?))
    };
    // SAFETY: the caller guarantees that `camera` is null or writable.
    unsafe { argument::make("camera", camera, read) }
}

/// Reads a camera from the text of such a file. Errors call it "text".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_of_text(
    text: *const c_char,
    camera: *mut *mut ThirdCamera,
) -> Status {
    let read = || {
        // SAFETY: the caller guarantees a text.
        let text = unsafe { argument::text("the text", text) }?;
        Ok(ThirdCamera(third::of_text(Path::new("text"), text)?))
    };
    // SAFETY: the caller guarantees that `camera` is null or writable.
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
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let camera = unsafe { argument::thing("camera", camera) }?;
        // SAFETY: the caller guarantees that each place is null or writable.
        unsafe { argument::put_size(camera.0.size, [width, height]) }
    })
}

/// The depths seen by a third camera, along its axis and at its pixels, in the unit of the baseline: +infinity where it sees something that
/// the map does not. `width` and `height` are those of the disparity map (in pixels), and the depth map has the size
/// mrfgs_third_camera_size(). The nearest surface wins, and each pixel of the map covers its projected area. Strides are in bytes; the maps
/// must not overlap.
///
/// The camera's pose is relative to the original left camera if the rig is from mrfgs_rig_of_rectification(), else to the rectified one. A
/// rig of mrfgs_rig_new() is refused, as it has no principal point.
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
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let rig = unsafe { argument::thing("rig", rig) }?;
        // SAFETY: as above.
        let camera = unsafe { argument::thing("camera", camera) }?;
        if !rig.knows_principal_point {
            return Err(Failure::argument(
                "the rig has no principal point, which another view needs: make it with mrfgs_rig_of_calibration() or \
                 mrfgs_rig_of_rectification()",
            ));
        }
        rig.check((width, height))?;
        let size = (width as usize, height as usize);
        maps::check("disparity", disparity, disparity_stride, size)?;
        maps::check("depth", depth.cast_const(), depth_stride, camera.0.size)?;
        // SAFETY: it is not null, and the caller guarantees that it is as large as the arguments say.
        let map = unsafe { maps::read(disparity, disparity_stride, size) };
        let depths = rig.inner.registered(&map, &camera.0);
        // SAFETY: as above.
        unsafe { maps::put(&depths, depth, depth_stride) };
        Ok(())
    })
}

/// Frees a third camera; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_third_camera_free(camera: *mut ThirdCamera) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(camera) }
}
