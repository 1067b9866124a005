//! ROS images and cameras, from recordings and live.

use std::path::Path;

use mrfgs::image::raster::Raster;
use mrfgs::image::read::Reader;
use mrfgs::{Error, Result};
use mrfgs_ros::messages::{CameraInfo, CompressedImage, Encoding, Image, Type};
use mrfgs_ros::pixels;

/// Decodes the image in a message of the type `kind`, which errors call `name`.
///
/// # Errors
/// If the bytes are not a valid image.
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

/// Whether left and right are swapped: the baseline is in the projection of the right camera.
pub(crate) fn are_exchanged(cameras: [&CameraInfo; 2]) -> bool {
    let [left, right] = cameras.map(|camera| camera.p[3]);
    left != 0.0 && right == 0.0
}

/// A camera as the text of a calibration file, for raw or rectified images.
pub(crate) fn text(camera: &CameraInfo, is_rectified: bool) -> String {
    if is_rectified { camera.of_rectified().text() } else { camera.text() }
}

/// Whether a message contains the calibration of raw or rectified images.
pub(crate) fn is_known(camera: &CameraInfo, is_rectified: bool) -> bool {
    // Rectified images only need the projection.
    if is_rectified { camera.p[0] != 0.0 } else { camera.is_calibrated() }
}
