//! The types of messages.

use std::borrow::Cow;
use std::fmt::Write as _;

use super::basics::{Encoding, Result, Stamp};
use super::bytes::{Decoder, Encoder};

/// When and in which frame of coordinates something was seen.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// When.
    pub stamp: Stamp,
    /// The name of the frame.
    pub frame_id: String,
}

/// `sensor_msgs/msg/Image`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image<'a> {
    /// Its time and camera.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// What a pixel holds, such as `mono8`.
    pub encoding: Cow<'a, str>,
    /// Whether samples of more than a byte begin with the highest one.
    pub is_bigendian: bool,
    /// Bytes from a row to the next.
    pub step: u32,
    /// The rows.
    pub data: Cow<'a, [u8]>,
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressedImage<'a> {
    /// Its time and camera.
    pub header: Header,
    /// `jpeg`, `png`, or what `image_transport` writes, such as `bgr8; jpeg compressed bgr8`.
    pub format: Cow<'a, str>,
    /// A file of that format.
    pub data: Cow<'a, [u8]>,
}

/// `sensor_msgs/msg/RegionOfInterest`, in pixels of the sensor. All 0 is all of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegionOfInterest {
    /// Its first column.
    pub x_offset: u32,
    /// Its first row.
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
    /// Its time and camera.
    pub header: Header,
    /// Rows of the sensor.
    pub height: u32,
    /// Columns of the sensor.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial` or `equidistant`.
    pub distortion_model: String,
    /// The coefficients of the lens.
    pub d: Vec<f64>,
    /// The matrix of the camera, row by row.
    pub k: [f64; 9],
    /// The rotation from its frame to that of the rectified view.
    pub r: [f64; 9],
    /// The projection of the rectified view, a matrix of 3 x 4.
    pub p: [f64; 12],
    /// How many columns are one of the image; 0 is 1.
    pub binning_x: u32,
    /// How many rows are one of the image; 0 is 1.
    pub binning_y: u32,
    /// What of the sensor is read out.
    pub roi: RegionOfInterest,
}

/// `stereo_msgs/msg/DisparityImage`. A pixel below `min_disparity` is invalid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisparityImage<'a> {
    /// That of the left image.
    pub header: Header,
    /// The disparities in pixels, as `32FC1`: such that Z = f t / d.
    pub image: Image<'a>,
    /// Focal length in pixels.
    pub f: f32,
    /// Distance of the cameras in metres.
    pub t: f32,
    /// Where a pixel may have a disparity.
    pub valid_window: RegionOfInterest,
    /// Smallest disparity that was searched.
    pub min_disparity: f32,
    /// Largest disparity that was searched.
    pub max_disparity: f32,
    /// Step between two disparities.
    pub delta_d: f32,
}

/// A number of each point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointField {
    /// Its name.
    pub name: &'static str,
    /// Where it is in a point, in bytes.
    pub offset: u32,
    /// Its type: [`UINT8`] or [`FLOAT32`].
    pub datatype: u8,
}

/// The type of a field that is a byte.
pub const UINT8: u8 = 2;
/// The type of a field that is a float.
pub const FLOAT32: u8 = 7;

/// `sensor_msgs/msg/PointCloud2`, a list of points, all of which are finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud2 {
    /// That of the left image.
    pub header: Header,
    /// What a point holds.
    pub fields: Vec<PointField>,
    /// Bytes of a point.
    pub point_step: u32,
    /// The points.
    pub data: Vec<u8>,
}

/// A type of messages.
pub trait Type {
    /// Its name, such as `sensor_msgs/msg/Image`.
    const NAME: &'static str;
}

/// A message that is written.
pub trait Encode: Type {
    /// Its bytes in CDR, lowest byte first.
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
    fn decode(from: &mut Decoder) -> Result<Self> {
        Ok(Self { stamp: from.stamp()?, frame_id: from.string()?.into_owned() })
    }

    fn encode(&self, to: &mut Encoder) {
        to.stamp(self.stamp);
        to.string(&self.frame_id);
    }

    /// The header with which the bytes of any message begin that has one.
    ///
    /// # Errors
    /// Where the bytes end before.
    pub fn of(bytes: &[u8], encoding: Encoding) -> Result<Self> {
        Self::decode(&mut Decoder::new(bytes, encoding)?)
    }
}

impl<'a> Image<'a> {
    /// The message in `bytes`, whose pixels are borrowed.
    ///
    /// # Errors
    /// Where the bytes are no such message.
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
    /// The message in `bytes`, whose file is borrowed.
    ///
    /// # Errors
    /// Where the bytes are no such message.
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
    /// The message in `bytes`.
    ///
    /// # Errors
    /// Where the bytes are no such message.
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

    /// Whether it says a camera at all: that of one without a calibration is 0.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        self.k[0] != 0.0
    }

    /// The same in the words of a file of ROS's `camera_calibration`, which
    /// [`calibration::of_texts`](mrfgs::calibration::of_texts) takes together with that of the other camera.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { height, width, distortion_model, d, k, r, p, binning_x, binning_y, roi, .. } = self;
        let mut text = format!("image_width: {width}\nimage_height: {height}\n");
        // Older drivers leave the name of the usual model out.
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

    /// That of the rectified view: a camera without distortion, whose projection is the same.
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
        // One row: the points are in no grid.
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
