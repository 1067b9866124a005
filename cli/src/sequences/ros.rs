//! Images and cameras of ROS, from recordings and live.

use std::path::Path;

use mrfgs::image::raster::Raster;
use mrfgs::image::read::Reader;
use mrfgs::{Error, Result};
use mrfgs_ros::messages::{CameraInfo, CompressedImage, Encoding, Image, Type};
use mrfgs_ros::pixels;

/// The image in the bytes of a message of the type `kind`, which errors call `name`.
///
/// # Errors
/// Where they hold none.
pub(crate) fn view(
    kind: &str,
    bytes: &[u8],
    encoding: Encoding,
    reader: Reader,
    name: &Path,
) -> Result<Raster<'static>> {
    let error = |reason| Error::read(name, reason);
    if kind == CompressedImage::NAME {
        let image = CompressedImage::decode(bytes, encoding).map_err(error)?;
        return pixels::compressed(&image, reader, name);
    }
    let image = Image::decode(bytes, encoding).map_err(error)?;
    let raster = pixels::image(&image, reader.max_pixels).map_err(error)?;
    match reader.no_data {
        Some(value) => raster.without(value),
        None => Ok(raster),
    }
}

/// Whether what is called left is the right camera: the baseline stands in the projection of the right one.
pub(crate) fn are_exchanged(cameras: [&CameraInfo; 2]) -> bool {
    let [left, right] = cameras.map(|camera| camera.p[3]);
    left != 0.0 && right == 0.0
}

/// What a camera is in the words of a file, of images that are rectified or not.
pub(crate) fn text(camera: &CameraInfo, is_rectified: bool) -> String {
    if is_rectified { camera.of_rectified().text() } else { camera.text() }
}

/// Whether a message says anything of the camera of images that are rectified or not.
pub(crate) fn is_known(camera: &CameraInfo, is_rectified: bool) -> bool {
    // Of what is rectified already the projection counts alone.
    if is_rectified { camera.p[0] != 0.0 } else { camera.is_calibrated() }
}
