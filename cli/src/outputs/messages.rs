//! ROS 2 messages of a frame, and their topics.

use mrfgs::Result;
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::lens::Distortion;
use mrfgs::image::Plane;
use mrfgs::image::calib::Calibration;
use mrfgs::image::cloud::Cloud;
use mrfgs::maps::FRACTION;
use mrfgs::options::DisparityRange;
use mrfgs_ros::messages::{
    CameraInfo, DisparityImage, Encode, FLOAT32, Header, Image, PointCloud2, PointField, RegionOfInterest,
    Type, UINT8,
};

/// A topic and its message type, with ROS's usual name and without a namespace.
pub(crate) type Topic = (&'static str, &'static str);

pub(crate) const DISPARITY: Topic = ("disparity", DisparityImage::NAME);
/// The camera of the disparities, if no one else publishes it.
pub(crate) const CAMERA: Topic = ("left/camera_info", CameraInfo::NAME);
pub(crate) const DEPTH: Topic = ("depth/image_rect", Image::NAME);
pub(crate) const MILLIMETRES: Topic = ("depth/image_rect_raw", Image::NAME);
/// Depths in the view of a third camera, and that camera.
pub(crate) const REGISTERED: Topic = ("depth_registered/image", Image::NAME);
pub(crate) const REGISTERED_MILLIMETRES: Topic = ("depth_registered/image_raw", Image::NAME);
pub(crate) const REGISTERED_CAMERA: Topic = ("depth_registered/camera_info", CameraInfo::NAME);
pub(crate) const POINTS: Topic = ("points2", PointCloud2::NAME);
pub(crate) const SIGMA: Topic = ("sigma", Image::NAME);
pub(crate) const DEPTH_SIGMA: Topic = ("depth/sigma", Image::NAME);

/// The topic of an 8-bit map called `name`.
pub(crate) const fn of_bytes(name: &'static str) -> Topic {
    (name, Image::NAME)
}

/// Receives the messages of a frame.
pub(crate) trait Sink {
    /// Takes a message of `topic` with this `header`.
    ///
    /// # Errors
    /// If it cannot be written or sent.
    fn put(&mut self, topic: Topic, header: &Header, message: &impl Encode) -> Result<()>;
}

/// An output of a frame, besides its disparities.
pub(crate) enum Content {
    /// In the unit of the baseline; +infinity if unknown.
    Depth(Plane<f32>),
    /// 0 if unknown.
    Millimetres(Plane<u16>),
    /// Depths in the view of a third camera.
    Registered(Plane<f32>),
    RegisteredMillimetres(Plane<u16>),
    Points(Cloud),
    /// Errors in pixels; +infinity if unknown.
    Sigma(Plane<f32>),
    /// Errors in the unit of the baseline; +infinity if unknown.
    DepthSigma(Plane<f32>),
    /// An 8-bit map, with its name.
    Bytes(&'static str, Plane<u8>),
}

/// The cameras of the maps.
#[derive(Clone)]
pub(crate) struct Cameras {
    focal_length: [f64; 2],
    principal_point: [f64; 2],
    doffs: f64,
    /// In metres; 0 if its unit is unknown.
    baseline: f64,
    /// Metres per unit of the baseline; 0 if unknown.
    metres: f64,
}

impl Cameras {
    /// The cameras of a calibration, if complete, for maps whose first pixel is at `origin` in the left view.
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

/// A third camera, and the name of its coordinate frame.
#[derive(Clone)]
pub(crate) struct Third {
    pub(crate) frame_id: String,
    pub(crate) camera: ThirdCamera,
}

impl Third {
    fn message(&self, header: Header) -> CameraInfo {
        let ThirdCamera { lens, size: (width, height), .. } = &self.camera;
        let ([fx, fy], [cx, cy]) = (lens.focal_length(), lens.principal_point());
        // ROS has names for these models only.
        let (model, d) = match lens.distortion() {
            Distortion::RadialTangential(model) => match model.coefficients() {
                d if d.len() > 5 => ("rational_polynomial", d),
                d => ("plumb_bob", d),
            },
            Distortion::Equidistant(k) => ("equidistant", k.to_vec()),
            _ => ("", Vec::new()),
        };
        let pinhole = CameraInfo {
            header,
            width: *width as u32,
            height: *height as u32,
            p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        };
        CameraInfo { distortion_model: model.into(), d, ..pinhole.of_rectified() }
    }
}

/// Makes the messages of frames with disparities in `range`; cameras are added if known.
#[derive(Clone)]
pub(crate) struct Messages {
    range: DisparityRange,
    cameras: Option<Cameras>,
    third: Option<Third>,
}

impl Messages {
    /// With a `third` camera, depths may be in its view.
    pub(crate) fn new(range: DisparityRange, cameras: Option<Cameras>, third: Option<Third>) -> Self {
        Self { range, cameras, third }
    }

    /// The disparity message of a frame; `header` is that of the left view, `sigma` the typical error in pixels, if known.
    pub(crate) fn disparity<'a>(
        &self,
        header: &Header,
        map: &Plane<f32>,
        sigma: Option<f32>,
    ) -> DisparityImage<'a> {
        let disparity = disparity(header, map, self.range, self.cameras.as_ref());
        let delta_d = sigma.unwrap_or(disparity.delta_d);
        DisparityImage { delta_d, ..disparity }
    }

    /// The camera message for maps of this `size`, if the cameras are known.
    pub(crate) fn camera(&self, header: &Header, size: (usize, usize)) -> Option<CameraInfo> {
        self.cameras.as_ref().map(|cameras| cameras.message(header, size))
    }

    /// Passes the disparities of a frame, its camera and its `contents` to `sink`.
    ///
    /// # Errors
    /// Errors of the sink.
    pub(crate) fn put_frame(
        &self,
        header: &Header,
        map: &Plane<f32>,
        sigma: Option<f32>,
        contents: Vec<Content>,
        sink: &mut impl Sink,
    ) -> Result<()> {
        sink.put(DISPARITY, header, &self.disparity(header, map, sigma))?;
        if let Some(camera) = self.camera(header, map.size()) {
            sink.put(CAMERA, header, &camera)?;
        }
        self.put(header, contents, sink)
    }

    /// Passes the further outputs of a frame to `sink`.
    ///
    /// # Errors
    /// Errors of the sink.
    pub(crate) fn put(&self, header: &Header, contents: Vec<Content>, sink: &mut impl Sink) -> Result<()> {
        // Callers have checked that the cameras and the unit are known if these outputs need them.
        let metres = self.cameras.as_ref().map_or(1.0, |cameras| cameras.metres);
        let of_third =
            |content: &Content| matches!(content, Content::Registered(_) | Content::RegisteredMillimetres(_));
        let third = self.third.as_ref().filter(|_| contents.iter().any(of_third));
        let frame_id = third.map_or_else(String::new, |third| third.frame_id.clone());
        let there = Header { stamp: header.stamp, frame_id };
        if let Some(third) = third {
            sink.put(REGISTERED_CAMERA, &there, &third.message(there.clone()))?;
        }
        for content in contents {
            match content {
                Content::Depth(depth) => sink.put(DEPTH, header, &floats(header, &known(&depth, metres)))?,
                Content::Sigma(sigmas) => sink.put(SIGMA, header, &floats(header, &known(&sigmas, 1.0)))?,
                Content::DepthSigma(sigmas) => {
                    sink.put(DEPTH_SIGMA, header, &floats(header, &known(&sigmas, metres)))?;
                }
                Content::Millimetres(depth) => sink.put(MILLIMETRES, header, &words(header, &depth))?,
                Content::Registered(depth) => {
                    sink.put(REGISTERED, &there, &floats(&there, &known(&depth, metres)))?;
                }
                Content::RegisteredMillimetres(depth) => {
                    sink.put(REGISTERED_MILLIMETRES, &there, &words(&there, &depth))?;
                }
                Content::Points(cloud) => sink.put(POINTS, header, &points(header, &cloud, metres))?,
                Content::Bytes(name, map) => {
                    let size = map.size();
                    sink.put(of_bytes(name), header, &image(header, size, "mono8", map.into_data()))?;
                }
            }
        }
        Ok(())
    }
}

fn in_metres(v: f32, metres: f64) -> f32 {
    (f64::from(v) * metres) as f32
}

/// Scales `map` to another unit; unknown values become NaN.
fn known(map: &Plane<f32>, unit: f64) -> Plane<f32> {
    map.map(|v| if v.is_finite() { in_metres(*v, unit) } else { f32::NAN })
}

/// A disparity message: shifted so that depth = focal length x baseline / disparity; invalid pixels lie below the range.
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

fn words(header: &Header, map: &Plane<u16>) -> Image<'static> {
    image(header, map.size(), "16UC1", map.data().iter().flat_map(|v| v.to_le_bytes()).collect())
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

/// 20 bytes per point: position, colour packed as in PCL, and confidence.
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
