//! Message types.

use std::borrow::Cow;
use std::fmt::Write as _;

use super::basics::{Encoding, Result, Stamp};
use super::bytes::{Decoder, Encoder};

/// The time and the coordinate frame of an observation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// The time.
    pub stamp: Stamp,
    /// The name of the frame.
    pub frame_id: String,
}

/// `sensor_msgs/msg/Image`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image<'a> {
    /// Time and camera.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// The pixel encoding, such as `mono8`.
    pub encoding: Cow<'a, str>,
    /// Whether samples of more than one byte are big-endian.
    pub is_bigendian: bool,
    /// Bytes from one row to the next.
    pub step: u32,
    /// The rows.
    pub data: Cow<'a, [u8]>,
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressedImage<'a> {
    /// Time and camera.
    pub header: Header,
    /// `jpeg`, `png`, or a format of `image_transport`, such as `bgr8; jpeg compressed bgr8`.
    pub format: Cow<'a, str>,
    /// A file in that format.
    pub data: Cow<'a, [u8]>,
}

/// `sensor_msgs/msg/RegionOfInterest`, in sensor pixels. All 0 means the whole sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Whether the region of the rectified image differs.
    pub do_rectify: bool,
}

/// `sensor_msgs/msg/CameraInfo`, a camera of a calibrated pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraInfo {
    /// Time and camera.
    pub header: Header,
    /// Rows of the sensor.
    pub height: u32,
    /// Columns of the sensor.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial` or `equidistant`.
    pub distortion_model: String,
    /// Distortion coefficients.
    pub d: Vec<f64>,
    /// The camera matrix, row by row.
    pub k: [f64; 9],
    /// The rotation from the camera's frame to the rectified frame.
    pub r: [f64; 9],
    /// The 3 x 4 projection of the rectified view, row by row.
    pub p: [f64; 12],
    /// Sensor columns per image column; 0 means 1.
    pub binning_x: u32,
    /// Sensor rows per image row; 0 means 1.
    pub binning_y: u32,
    /// The region of the sensor that is read out.
    pub roi: RegionOfInterest,
}

/// `stereo_msgs/msg/DisparityImage`. Pixels below `min_disparity` are invalid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisparityImage<'a> {
    /// The header of the left image.
    pub header: Header,
    /// The disparities in pixels, as `32FC1`, with Z = f t / d.
    pub image: Image<'a>,
    /// Focal length in pixels.
    pub f: f32,
    /// Baseline in metres.
    pub t: f32,
    /// The region in which pixels may have a disparity.
    pub valid_window: RegionOfInterest,
    /// Smallest disparity that was searched.
    pub min_disparity: f32,
    /// Largest disparity that was searched.
    pub max_disparity: f32,
    /// Step between two disparities.
    pub delta_d: f32,
}

/// A field of the points of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointField {
    /// The name.
    pub name: &'static str,
    /// Offset within a point, in bytes.
    pub offset: u32,
    /// The type: [`UINT8`] or [`FLOAT32`].
    pub datatype: u8,
}

/// The type of a byte field.
pub const UINT8: u8 = 2;
/// The type of a field of single precision.
pub const FLOAT32: u8 = 7;
/// The type of a field of double precision.
pub const FLOAT64: u8 = 8;

/// `sensor_msgs/msg/PointCloud2`, a list of finite points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud2 {
    /// The header of the left image.
    pub header: Header,
    /// The fields of a point.
    pub fields: Vec<PointField>,
    /// Bytes per point.
    pub point_step: u32,
    /// The points.
    pub data: Vec<u8>,
}

/// A message type.
pub trait Type {
    /// The name, such as `sensor_msgs/msg/Image`.
    const NAME: &'static str;
}

/// A message that can be written.
pub trait Encode: Type {
    /// Encodes the message as little-endian CDR.
    fn encode(&self) -> Vec<u8>;
}

macro_rules! types {
    ($($name:literal: $type:ty),*) => {
        $(impl Type for $type {
            const NAME: &'static str = $name;
        })*
    };
}

types! {
    "sensor_msgs/msg/Image": Image<'_>,
    "sensor_msgs/msg/CompressedImage": CompressedImage<'_>,
    "sensor_msgs/msg/CameraInfo": CameraInfo,
    "stereo_msgs/msg/DisparityImage": DisparityImage<'_>,
    "sensor_msgs/msg/PointCloud2": PointCloud2
}

impl Header {
    pub(super) fn decode(from: &mut Decoder) -> Result<Self> {
        Ok(Self { stamp: from.stamp()?, frame_id: from.string()?.into_owned() })
    }

    fn encode(&self, to: &mut Encoder) {
        to.stamp(self.stamp);
        to.string(&self.frame_id);
    }

    /// Decodes the header at the start of any message that has one.
    ///
    /// # Errors
    /// If the bytes end early.
    pub fn of(bytes: &[u8], encoding: Encoding) -> Result<Self> {
        Self::decode(&mut Decoder::new(bytes, encoding)?)
    }
}

impl<'a> Image<'a> {
    /// Decodes the message; its pixels are borrowed.
    ///
    /// # Errors
    /// If the bytes are not such a message.
    pub fn decode(bytes: &'a [u8], encoding: Encoding) -> Result<Self> {
        let from = &mut Decoder::new(bytes, encoding)?;
        Ok(Self {
            header: Header::decode(from)?,
            height: from.u32()?,
            width: from.u32()?,
            encoding: from.string()?,
            is_bigendian: from.u8()? != 0,
            step: from.u32()?,
            data: Cow::Borrowed(from.list()?),
        })
    }

    fn put(&self, to: &mut Encoder) {
        self.header.encode(to);
        to.u32(self.height);
        to.u32(self.width);
        to.string(&self.encoding);
        to.u8(self.is_bigendian.into());
        to.u32(self.step);
        to.list(&self.data);
    }
}

impl Encode for Image<'_> {
    fn encode(&self) -> Vec<u8> {
        let mut to = Encoder::with_room_for(self.data.len());
        self.put(&mut to);
        to.finish()
    }
}

impl<'a> CompressedImage<'a> {
    /// Decodes the message; its file is borrowed.
    ///
    /// # Errors
    /// If the bytes are not such a message.
    pub fn decode(bytes: &'a [u8], encoding: Encoding) -> Result<Self> {
        let from = &mut Decoder::new(bytes, encoding)?;
        Ok(Self { header: Header::decode(from)?, format: from.string()?, data: Cow::Borrowed(from.list()?) })
    }
}

impl RegionOfInterest {
    fn decode(from: &mut Decoder) -> Result<Self> {
        let [x_offset, y_offset, height, width] = [from.u32()?, from.u32()?, from.u32()?, from.u32()?];
        Ok(Self { x_offset, y_offset, height, width, do_rectify: from.u8()? != 0 })
    }

    fn encode(&self, to: &mut Encoder) {
        for v in [self.x_offset, self.y_offset, self.height, self.width] {
            to.u32(v);
        }
        to.u8(self.do_rectify.into());
    }
}

impl CameraInfo {
    /// Decodes the message.
    ///
    /// # Errors
    /// If the bytes are not such a message.
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self> {
        let from = &mut Decoder::new(bytes, encoding)?;
        Ok(Self {
            header: Header::decode(from)?,
            height: from.u32()?,
            width: from.u32()?,
            distortion_model: from.string()?.into_owned(),
            d: from.doubles()?,
            k: from.array()?,
            r: from.array()?,
            p: from.array()?,
            binning_x: from.u32()?,
            binning_y: from.u32()?,
            roi: RegionOfInterest::decode(from)?,
        })
    }

    /// Whether it contains a calibration; uncalibrated cameras send zeros.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        self.k[0] != 0.0
    }

    /// The camera as a file of ROS's `camera_calibration`, which [`calibration::of_texts`](mrfgs::calibration::of_texts) reads together
    /// with the other camera's.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { height, width, distortion_model, d, k, r, p, binning_x, binning_y, roi, .. } = self;
        let mut text = format!("image_width: {width}\nimage_height: {height}\n");
        // Older drivers omit the name of the usual model.
        if !distortion_model.is_empty() {
            let _ = writeln!(text, "distortion_model: {distortion_model:?}");
        }
        let lists: [(&str, &[f64]); 4] = [
            ("camera_matrix", k),
            ("distortion_coefficients", d),
            ("rectification_matrix", r),
            ("projection_matrix", p),
        ];
        for (name, numbers) in lists {
            let _ = writeln!(text, "{name}: {numbers:?}");
        }
        let _ = writeln!(text, "binning_x: {binning_x}\nbinning_y: {binning_y}");
        let RegionOfInterest { x_offset, y_offset, height, width, .. } = roi;
        let _ = writeln!(
            text,
            "roi: {{x_offset: {x_offset}, y_offset: {y_offset}, height: {height}, width: {width}}}"
        );
        text
    }

    /// The rectified camera: without distortion, and with the same projection.
    #[must_use]
    pub fn of_rectified(&self) -> Self {
        let p = &self.p;
        Self {
            distortion_model: "plumb_bob".into(),
            d: vec![0.0; 5],
            k: [p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            ..self.clone()
        }
    }
}

impl Encode for CameraInfo {
    fn encode(&self) -> Vec<u8> {
        let mut to = Encoder::with_room_for(0);
        self.header.encode(&mut to);
        to.u32(self.height);
        to.u32(self.width);
        to.string(&self.distortion_model);
        to.u32(self.d.len() as u32);
        to.doubles(&self.d);
        to.doubles(&self.k);
        to.doubles(&self.r);
        to.doubles(&self.p);
        to.u32(self.binning_x);
        to.u32(self.binning_y);
        self.roi.encode(&mut to);
        to.finish()
    }
}

impl Encode for DisparityImage<'_> {
    fn encode(&self) -> Vec<u8> {
        let mut to = Encoder::with_room_for(self.image.data.len());
        self.header.encode(&mut to);
        self.image.put(&mut to);
        to.f32(self.f);
        to.f32(self.t);
        self.valid_window.encode(&mut to);
        for v in [self.min_disparity, self.max_disparity, self.delta_d] {
            to.f32(v);
        }
        to.finish()
    }
}

impl Encode for PointCloud2 {
    fn encode(&self) -> Vec<u8> {
        let count = self.data.len() as u32 / self.point_step.max(1);
        let mut to = Encoder::with_room_for(self.data.len());
        self.header.encode(&mut to);
        // A single row, as the points are unordered.
        to.u32(1);
        to.u32(count);
        to.u32(self.fields.len() as u32);
        for field in &self.fields {
            to.string(field.name);
            to.u32(field.offset);
            to.u8(field.datatype);
            to.u32(1);
        }
        to.u8(0);
        to.u32(self.point_step);
        to.u32(self.data.len() as u32);
        to.list(&self.data);
        to.u8(1);
        to.finish()
    }
}
