//! The points that a sensor has measured.

use super::basics::{Encoding, Result};
use super::bytes::Decoder;
use super::types::{FLOAT32, FLOAT64, Header};

/// The positions in a `sensor_msgs/msg/PointCloud2`, such as a scan of a lidar.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// Time and frame.
    pub header: Header,
    /// x, y and z of all finite points, in metres.
    pub points: Vec<[f64; 3]>,
}

/// A coordinate of the points: its offset within a point, and whether it has double precision.
type Coordinate = (usize, bool);

impl Scan {
    /// Decodes the message. Fields other than x, y and z are skipped, and so are points that are not finite.
    ///
    /// # Errors
    /// If the bytes are not such a message, if x, y and z are not all there as float32 or float64, or if the points do not fit into the data.
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self> {
        let from = &mut Decoder::new(bytes, encoding)?;
        let header = Header::decode(from)?;
        let [height, width, fields] = [from.u32()?, from.u32()?, from.u32()?];
        let mut found: [Option<(u32, u8)>; 3] = [None; 3];
        for _ in 0..fields {
            let name = from.string()?;
            let (offset, datatype, _count) = (from.u32()?, from.u8()?, from.u32()?);
            if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
                found[axis] = Some((offset, datatype));
            }
        }
        let highest_first = from.u8()? != 0;
        let [step, row_step] = [from.u32()? as usize, from.u32()? as usize];
        let data = from.list()?;
        let coordinate = |axis: usize| -> Result<Coordinate> {
            let name = ["x", "y", "z"][axis];
            let (offset, double) = match found[axis] {
                Some((offset, kind @ (FLOAT32 | FLOAT64))) => (offset as usize, kind == FLOAT64),
                Some((_, kind)) => {
                    return Err(format!("has {name} of type {kind}, not float32 or float64").into());
                }
                None => return Err(format!("has no field {name}").into()),
            };
            if offset.saturating_add(if double { 8 } else { 4 }) > step {
                return Err(format!("has {name} at byte {offset} of points of {step} bytes").into());
            }
            Ok((offset, double))
        };
        let coordinates = [coordinate(0)?, coordinate(1)?, coordinate(2)?];
        let (width, height) = (width as usize, height as usize);
        if height == 0 || width == 0 {
            return Ok(Self { header, points: Vec::new() });
        }
        // Some drivers leave the length of the only row empty.
        let row_step = if height == 1 { width.saturating_mul(step) } else { row_step };
        let row = width.saturating_mul(step);
        let needed = (height - 1).saturating_mul(row_step).saturating_add(row);
        if row_step < row || data.len() < needed {
            return Err(format!(
                "has {} bytes in rows of {row_step} for {width} x {height} points of {step} bytes",
                data.len()
            )
            .into());
        }
        let rows = (0..height).map(|y| &data[y * row_step..][..row]);
        let all = rows.flat_map(|row| row.chunks_exact(step));
        let points = all.map(|point| coordinates.map(|of| value(point, of, highest_first)));
        Ok(Self { header, points: points.filter(|point| point.iter().all(|v| v.is_finite())).collect() })
    }
}

/// A coordinate of a point, which has the bytes for it.
fn value(point: &[u8], (offset, double): Coordinate, highest_first: bool) -> f64 {
    if double {
        f64::from_le_bytes(lowest_first(&point[offset..], highest_first))
    } else {
        f32::from_le_bytes(lowest_first(&point[offset..], highest_first)).into()
    }
}

/// The first `N` bytes, least significant first.
fn lowest_first<const N: usize>(bytes: &[u8], highest_first: bool) -> [u8; N] {
    let mut number = [0; N];
    number.copy_from_slice(&bytes[..N]);
    if highest_first {
        number.reverse();
    }
    number
}
