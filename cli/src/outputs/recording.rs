//! Recordings of maps: MCAP files with the messages of ROS 2.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mrfgs::image::calib::Calibration;
use mrfgs::image::cloud::Cloud;
use mrfgs::image::write::Growing;
use mrfgs::image::{Plane, write};
use mrfgs::maps::FRACTION;
use mrfgs::options::DisparityRange;
use mrfgs::{Error, Result};
use mrfgs_ros::messages::{
    CameraInfo, DisparityImage, Encode, FLOAT32, Header, Image, PointCloud2, PointField, RegionOfInterest,
    UINT8,
};
use mrfgs_ros::recording::Writer;

/// The topics, by what ROS usually calls them.
const DISPARITY: &str = "/disparity";
const CAMERA_INFO: &str = "/left/camera_info";
const DEPTH: &str = "/depth/image_rect";
const MILLIMETRES: &str = "/depth/image_rect_raw";
const POINTS: &str = "/points2";
const SIGMA: &str = "/sigma";
const DEPTH_SIGMA: &str = "/depth/sigma";

/// What a frame has beside its disparities.
pub(crate) enum Content {
    /// In the unit of the baseline; +infinity where there is none.
    Depth(Plane<f32>),
    /// 0 where there is none.
    Millimetres(Plane<u16>),
    Points(Cloud),
    /// Errors in pixels; +infinity where there is none.
    Sigma(Plane<f32>),
    /// Errors in the unit of the baseline; +infinity where there is none.
    DepthSigma(Plane<f32>),
    /// A map of bytes, with its name.
    Bytes(&'static str, Plane<u8>),
}

/// The cameras of the maps.
#[derive(Clone)]
pub(crate) struct Cameras {
    focal_length: [f64; 2],
    principal_point: [f64; 2],
    doffs: f64,
    /// In metres; 0 where its unit is not known.
    baseline: f64,
    /// How many metres the unit is.
    metres: f64,
}

impl Cameras {
    /// Those of a calibration, where it says them, of maps whose first pixel is at `origin` in the left view.
    pub(crate) fn of(calibration: &Calibration, origin: (usize, usize)) -> Option<Self> {
        let (camera, doffs, baseline) = (calibration.camera?, calibration.doffs?, calibration.baseline?);
        let metres = calibration.unit.millimetres().map_or(0.0, |millimetres| millimetres / 1000.0);
        let [cx, cy] = camera.principal_point;
        Some(Self {
            focal_length: camera.focal_length,
            principal_point: [cx - origin.0 as f64, cy - origin.1 as f64],
            doffs,
            baseline: baseline * metres,
            metres,
        })
    }

    fn message(&self, header: &Header, (width, height): (usize, usize)) -> CameraInfo {
        let ([fx, fy], [cx, cy]) = (self.focal_length, self.principal_point);
        let p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
        let info = CameraInfo { header: header.clone(), p, ..CameraInfo::default() };
        CameraInfo { width: width as u32, height: height as u32, ..info.of_rectified() }
    }
}

/// A recording in the making. The file appears when it is [finished](Self::finish).
pub(crate) struct RecordedMaps {
    path: PathBuf,
    range: DisparityRange,
    cameras: Option<Cameras>,
    /// `None` before the first frame.
    writer: Option<Writer<BufWriter<Growing>>>,
}

impl RecordedMaps {
    /// One at `path`, of disparities in `range`.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be written.
    pub(crate) fn new(path: &Path, range: DisparityRange, cameras: Option<Cameras>) -> Result<Self> {
        write::check_path(path)?;
        Ok(Self { path: path.to_owned(), range, cameras, writer: None })
    }

    /// Adds the disparities of a frame, its camera and its `contents`. The left view has this `header`, and disparities have this error
    /// (sigma, in pixels), where it is known.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be written.
    pub(crate) fn add(
        &mut self,
        header: &Header,
        map: &Plane<f32>,
        sigma: Option<f32>,
        contents: Vec<Content>,
    ) -> Result<()> {
        let disparity = disparity(header, map, self.range, self.cameras.as_ref());
        let delta_d = sigma.unwrap_or(disparity.delta_d);
        self.put(DISPARITY, header, &DisparityImage { delta_d, ..disparity })?;
        if let Some(cameras) = &self.cameras {
            let message = cameras.message(header, map.size());
            self.put(CAMERA_INFO, header, &message)?;
        }
        // Both are checked before: such contents come with a known unit.
        let metres = self.cameras.as_ref().map_or(1.0, |cameras| cameras.metres);
        for content in contents {
            match content {
                Content::Depth(depth) => {
                    self.put(DEPTH, header, &floats(header, &known(&depth, metres)))?;
                }
                Content::Sigma(sigmas) => {
                    self.put(SIGMA, header, &floats(header, &known(&sigmas, 1.0)))?;
                }
                Content::DepthSigma(sigmas) => {
                    self.put(DEPTH_SIGMA, header, &floats(header, &known(&sigmas, metres)))?;
                }
                Content::Millimetres(depth) => {
                    let data = depth.data().iter().flat_map(|v| v.to_le_bytes()).collect();
                    self.put(MILLIMETRES, header, &image(header, depth.size(), "16UC1", data))?;
                }
                Content::Points(cloud) => self.put(POINTS, header, &points(header, &cloud, metres))?,
                Content::Bytes(name, map) => {
                    let size = map.size();
                    self.put(&format!("/{name}"), header, &image(header, size, "mono8", map.into_data()))?;
                }
            }
        }
        Ok(())
    }

    fn put(&mut self, topic: &str, header: &Header, message: &impl Encode) -> Result<()> {
        let error = |e: std::io::Error| Error::write(&self.path, e);
        let writer = if let Some(writer) = &mut self.writer {
            writer
        } else {
            let file = BufWriter::new(Growing::new(&self.path)?);
            self.writer.insert(Writer::new(file).map_err(error)?)
        };
        writer.add(topic, header.stamp, message).map_err(error)
    }

    /// Ends the recording, with its index.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be written.
    pub(crate) fn finish(self) -> Result<()> {
        let Some(writer) = self.writer else { return Ok(()) };
        let error = |e: std::io::Error| Error::write(&self.path, e);
        let file = writer.finish().map_err(error)?.into_inner().map_err(|e| error(e.into_error()))?;
        file.finish()
    }
}

fn in_metres(v: f32, metres: f64) -> f32 {
    (f64::from(v) * metres) as f32
}

/// `map` in another unit, and not a number where there is nothing.
fn known(map: &Plane<f32>, unit: f64) -> Plane<f32> {
    map.map(|v| if v.is_finite() { in_metres(*v, unit) } else { f32::NAN })
}

/// The map as ROS has it: shifted so that depth is focal length times baseline by disparity, and below the range where it is invalid.
fn disparity<'a>(
    header: &Header,
    map: &Plane<f32>,
    range: DisparityRange,
    cameras: Option<&Cameras>,
) -> DisparityImage<'a> {
    let doffs = cameras.map_or(0.0, |cameras| cameras.doffs);
    let shifted = |d: f64| (d + doffs) as f32;
    let invalid = shifted(f64::from(range.min) - 1.0);
    let map = map.map(|d| if d.is_finite() { shifted(f64::from(*d)) } else { invalid });
    let (width, height) = map.size();
    DisparityImage {
        header: header.clone(),
        image: floats(header, &map),
        f: cameras.map_or(0.0, |cameras| cameras.focal_length[0] as f32),
        t: cameras.map_or(0.0, |cameras| cameras.baseline as f32),
        valid_window: RegionOfInterest {
            width: width as u32,
            height: height as u32,
            ..RegionOfInterest::default()
        },
        min_disparity: shifted(f64::from(range.min)),
        max_disparity: shifted(f64::from(range.max)),
        delta_d: 1.0 / FRACTION as f32,
    }
}

fn floats(header: &Header, map: &Plane<f32>) -> Image<'static> {
    image(header, map.size(), "32FC1", map.data().iter().flat_map(|v| v.to_le_bytes()).collect())
}

fn image(
    header: &Header,
    (width, height): (usize, usize),
    encoding: &'static str,
    data: Vec<u8>,
) -> Image<'static> {
    Image {
        header: header.clone(),
        height: height as u32,
        width: width as u32,
        encoding: encoding.into(),
        is_bigendian: false,
        step: (data.len() / height) as u32,
        data: data.into(),
    }
}

/// Position, colours as PCL packs them, and confidence, in 20 bytes.
fn points(header: &Header, cloud: &Cloud, metres: f64) -> PointCloud2 {
    let field = |name, offset, datatype| PointField { name, offset, datatype };
    let mut data = Vec::with_capacity(20 * cloud.points.len());
    for point in &cloud.points {
        data.extend(point.position.iter().flat_map(|v| in_metres(*v, metres).to_le_bytes()));
        let [r, g, b] = point.colour;
        data.extend([b, g, r, 0, point.confidence, 0, 0, 0]);
    }
    PointCloud2 {
        header: header.clone(),
        fields: vec![
            field("x", 0, FLOAT32),
            field("y", 4, FLOAT32),
            field("z", 8, FLOAT32),
            field("rgb", 12, FLOAT32),
            field("confidence", 16, UINT8),
        ],
        point_step: 20,
        data,
    }
}
