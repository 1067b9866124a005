//! ROS's `camera_info`, one file for each camera, as saved by `camera_calibration` or printed by `rostopic echo`.

use super::cameras::StereoCalibration;
use super::lens::Lens;
use super::matrix::Matrix;
use super::models::Model;
use super::node::Entries;
use super::opencv::{self, Projection};
use crate::error::{Error, Result};
use crate::image::calib::{Camera, Unit};

const CAMERA: &str = "cameramatrix k";
const DISTORTION: &str = "distortioncoefficients d";
const RECTIFICATION: &str = "rectificationmatrix r";
const PROJECTION: &str = "projectionmatrix p";

/// Whether the file is of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find(CAMERA).is_some()
        && (entries.find(PROJECTION).is_some() || entries.find("distortionmodel").is_some())
}

struct Info {
    lens: Lens,
    rotation: Matrix,
    projection: Projection,
    size: (usize, usize),
}

/// The calibration of two cameras in any order: the projection of the left one has no offset.
pub(super) fn read(cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let [first, second] = [info(cameras[0])?, info(cameras[1])?];
    let is_left = |info: &Info| info.projection.offset.iter().all(|v| *v == 0.0);
    let ((left, right), entries) = match (is_left(&first), is_left(&second)) {
        (true, false) => ((first, second), cameras[1]),
        (false, true) => ((second, first), cameras[0]),
        _ => {
            let reason = format!(
                "projection_matrix: expected focal length times baseline in its fourth column here or in {}, and 0 in the \
                 other; give the files of a stereo calibration",
                cameras[0].path().display()
            );
            return Err(Error::read(cameras[1].path(), reason));
        }
    };
    let entry = entries.require(PROJECTION, "projection_matrix", "")?;
    let rotations = [left.rotation, right.rotation];
    let views = opencv::rectified(&entry, rotations, [left.projection, right.projection])?;
    Ok(StereoCalibration {
        lenses: Some([left.lens, right.lens]),
        views: Some(views),
        size: Some(left.size),
        right_size: Some(right.size).filter(|size| *size != left.size),
        unit: Unit::Metre,
        ..StereoCalibration::default()
    }
    .with_pose_of_views())
}

/// The region of the sensor that a driver reads, and its binning.
struct Region {
    offset: [f64; 2],
    size: (usize, usize),
    binning: [usize; 2],
}

impl Region {
    /// From `roi`, `binning_x` and `binning_y`, for a `sensor` of this size. 0 means all, and every pixel.
    fn read(entries: &Entries, sensor: (usize, usize)) -> Result<Self> {
        let count = |of: &Entries, names: &str| Ok::<_, Error>(of.number_or_zero(names)? as usize);
        let binning = [count(entries, "binningx")?.max(1), count(entries, "binningy")?.max(1)];
        let mut region = Self { offset: [0.0; 2], size: sensor, binning };
        if let Some(entry) = entries.find("roi") {
            let roi = entry.group()?;
            let size = (count(&roi, "width")?, count(&roi, "height")?);
            if size != (0, 0) {
                region.size = size;
                region.offset = [roi.number_or_zero("xoffset")?, roi.number_or_zero("yoffset")?];
            }
        }
        let ([x, y], (width, height)) = (region.offset, region.size);
        let inside =
            |start: f64, length: usize, end: usize| start >= 0.0 && start + length as f64 <= end as f64;
        if inside(x, width, sensor.0)
            && inside(y, height, sensor.1)
            && region.size().0.min(region.size().1) > 0
        {
            return Ok(region);
        }
        let (width, height) = sensor;
        let reason = format!(
            "roi: is not in the sensor of {width} x {height} pixels, or less than a pixel when binned"
        );
        Err(Error::read(entries.path(), reason))
    }

    fn size(&self) -> (usize, usize) {
        (self.size.0 / self.binning[0], self.size.1 / self.binning[1])
    }

    /// The camera of the region's images, from that of the whole sensor.
    fn camera(&self, Camera { focal_length, principal_point }: Camera) -> Camera {
        let by = self.binning.map(|by| by as f64);
        Camera {
            focal_length: [0, 1].map(|i| focal_length[i] / by[i]),
            principal_point: [0, 1].map(|i| (principal_point[i] - self.offset[i]) / by[i]),
        }
    }
}

fn info(entries: &Entries) -> Result<Info> {
    let matrix = entries.require(CAMERA, "camera_matrix", "a matrix of 3 x 3")?;
    let (focal_length, principal_point) = opencv::camera(&matrix)?;
    let expected = "plumb_bob, rational_polynomial or equidistant";
    // Older files lack it.
    let model = entries.find("distortionmodel");
    let entry = entries.require(DISTORTION, "distortion_coefficients", "those of the lens")?;
    let fisheye = match model.as_ref().map(|entry| Model::of(entry)) {
        None | Some(Ok(Model::RadialTangential)) => false,
        Some(Ok(Model::Equidistant)) => true,
        Some(_) => return Err(model.as_ref().unwrap_or(&entry).wrong(expected)),
    };
    let distortion = opencv::distortion(&entry, "the coefficients of the distortion", fisheye)?;
    let count = |names: &str, called| entries.require(names, called, "a number of pixels")?.count();
    let size = (count("imagewidth width", "image_width")?, count("imageheight height", "image_height")?);
    let region = Region::read(entries, size)?;
    let camera = region.camera(Camera { focal_length, principal_point });
    let lens = Lens::new(camera.focal_length, camera.principal_point, distortion);
    let rotation = entries.require(RECTIFICATION, "rectification_matrix", "a rotation of 3 x 3")?;
    let projection = entries.require(PROJECTION, "projection_matrix", "a matrix of 3 x 4")?;
    let projection = opencv::projection(&projection)?;
    Ok(Info {
        lens: lens.map_err(|_| matrix.wrong("a camera with its lens"))?,
        rotation: rotation.rotation(&rotation.matrix()?)?,
        projection: Projection { camera: region.camera(projection.camera), ..projection },
        size: region.size(),
    })
}
