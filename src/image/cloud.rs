//! Point clouds.

use super::calib::Unit;

/// A point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Its position: x, y, z.
    pub position: [f32; 3],
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// Confidence 0 ..= 255.
    pub confidence: u8,
}

/// The camera that defines the coordinates of points: x to its right, y down, z forward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointFrame {
    /// The left camera of the pair that was matched; the rectified one, if the pair has been rectified.
    #[default]
    Matched,
    /// The original left camera before rectification. It has the same centre.
    Original,
}

/// Points in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points, row by row of the left image. Positions have the unit of the baseline.
    pub points: Vec<Point>,
    /// The frame of the positions.
    pub frame: PointFrame,
    /// The unit of positions.
    pub unit: Unit,
}

impl Cloud {
    /// Describes the positions in one line: frame and unit.
    #[must_use]
    pub fn about(&self) -> String {
        let unit = if self.unit == Unit::Unknown { "that of the baseline" } else { self.unit.name() };
        let camera = match self.frame {
            PointFrame::Matched => "the left camera",
            PointFrame::Original => "the original left camera, before rectification",
        };
        format!("frame of {camera}: x right, y down, z forward; unit {unit}")
    }
}

/// Encodes a file: a header, then each point in `size` bytes, as `record` writes it.
pub(super) fn encoded(
    header: String,
    cloud: &Cloud,
    size: usize,
    record: impl Fn(&Point, &mut Vec<u8>),
) -> Vec<u8> {
    let mut bytes = header.into_bytes();
    bytes.reserve_exact(cloud.points.len() * size);
    cloud.points.iter().for_each(|point| record(point, &mut bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::{pcd, ply};
    use super::*;

    /// The words after `key` in each line of a header that begins with it.
    fn entries<'a>(header: &'a str, key: &str) -> Vec<&'a str> {
        header.lines().filter_map(|line| line.strip_prefix(key)).flat_map(str::split_whitespace).collect()
    }

    #[test]
    fn the_header_says_what_the_bytes_are() {
        let point = Point { position: [1.5, -2.0, 1e6], colour: [7, 8, 9], confidence: 200 };
        let other = Point { position: [0.0; 3], colour: [0; 3], confidence: 0 };
        let confidence = 200.0_f32.to_le_bytes();
        let position = [1.5_f32, -2.0, 1e6].map(f32::to_le_bytes).concat();
        for frame in [PointFrame::Matched, PointFrame::Original] {
            let cloud = Cloud { points: vec![point, other], frame, unit: Unit::Metre };
            let split = |bytes: Vec<u8>, end: &str| {
                let start =
                    bytes.windows(end.len()).position(|window| window == end.as_bytes()).unwrap() + end.len();
                (String::from_utf8(bytes[..start].to_vec()).unwrap(), bytes[start..].to_vec())
            };

            let (header, points) = split(ply::encode(&cloud), "end_header\n");
            assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"), "{header}");
            let about = entries(&header, "comment ").join(" ");
            assert!(about.contains(&cloud.about()) && about.contains("confidence"), "{about}");
            assert_eq!(entries(&header, "element "), ["vertex", "2"]);
            let properties = entries(&header, "property ");
            let of_kind = |kind: &str| properties.iter().filter(|word| **word == kind).count();
            assert_eq!(points.len(), 2 * (4 * of_kind("float") + of_kind("uchar")));
            let names: Vec<_> = properties.into_iter().skip(1).step_by(2).collect();
            assert_eq!(names, ["x", "y", "z", "red", "green", "blue", "quality"]);
            assert!(points.starts_with(&[&position[..], &[7, 8, 9], &confidence].concat()));

            let (header, points) = split(pcd::encode(&cloud), "DATA binary\n");
            assert!(header.contains(&format!("\n# {}\n", cloud.about())), "{header}");
            assert_eq!(entries(&header, "FIELDS "), ["x", "y", "z", "rgb", "intensity"]);
            assert_eq!(
                ["WIDTH ", "HEIGHT ", "POINTS "].map(|key| entries(&header, key)).concat(),
                ["2", "1", "2"]
            );
            for key in ["SIZE ", "TYPE ", "COUNT "] {
                assert_eq!(entries(&header, key).len(), 5, "{key}");
            }
            let bytes_a_point: usize =
                entries(&header, "SIZE ").iter().map(|size| size.parse::<usize>().unwrap()).sum();
            assert_eq!(points.len(), 2 * bytes_a_point);
            // Little-endian 0x00070809.
            assert!(points.starts_with(&[&position[..], &[9, 8, 7, 0], &confidence].concat()));
        }
    }

    #[test]
    fn the_frame_is_that_of_a_camera() {
        let about = |frame| Cloud { frame, ..Cloud::default() }.about();
        assert!(about(PointFrame::Matched).starts_with("frame of the left camera: x right, y down"));
        assert!(about(PointFrame::Original).starts_with("frame of the original left camera, before"));
    }
}
