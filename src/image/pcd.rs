//! Point clouds as PCD files, which the Point Cloud Library, ROS and `Open3D` read.

use super::cloud::Cloud;

/// A cloud as binary PCD 0.7 with the fields `x`, `y`, `z`, `rgb` and `intensity`, of four bytes each. `rgb` is 0x00RRGGBB in the
/// bits of a float, as the Point Cloud Library has it; `intensity` is the confidence, 0 to 255.
#[must_use]
pub fn encode(cloud: &Cloud) -> Vec<u8> {
    let header = format!(
        "# .PCD v0.7 - Point Cloud Data file format\n\
         # {}\n\
         # intensity is the confidence, 0 to 255\n\
         VERSION 0.7\n\
         FIELDS x y z rgb intensity\n\
         SIZE 4 4 4 4 4\n\
         TYPE F F F F F\n\
         COUNT 1 1 1 1 1\n\
         WIDTH {count}\n\
         HEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {count}\n\
         DATA binary\n",
        cloud.about(),
        count = cloud.points.len()
    );
    let mut bytes = header.into_bytes();
    bytes.reserve_exact(cloud.points.len() * 20);
    for point in &cloud.points {
        let [red, green, blue] = point.colour;
        bytes.extend(point.position.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(u32::from_be_bytes([0, red, green, blue]).to_le_bytes());
        bytes.extend(f32::from(point.confidence).to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::cloud::{Frame, Point};
    use super::*;

    #[test]
    fn the_header_says_what_the_bytes_are() {
        let point = Point { position: [1.5, -2.0, 1e6], colour: [7, 8, 9], confidence: 200 };
        let other = Point { position: [0.0; 3], colour: [0; 3], confidence: 0 };
        let bytes = encode(&Cloud { points: vec![point, other], frame: Frame::Original });
        let end = b"DATA binary\n";
        let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..start]).unwrap();
        assert!(header.contains("\n# frame of the original left camera"), "{header}");
        let entry = |key: &str| -> Vec<&str> {
            let line = header.lines().find_map(|line| line.strip_prefix(key)).unwrap();
            line.split_whitespace().collect()
        };
        assert_eq!(entry("FIELDS "), ["x", "y", "z", "rgb", "intensity"]);
        assert_eq!([entry("WIDTH "), entry("HEIGHT "), entry("POINTS ")].concat(), ["2", "1", "2"]);
        for key in ["SIZE ", "TYPE ", "COUNT "] {
            assert_eq!(entry(key).len(), 5, "{key}");
        }
        let bytes_a_point: usize = entry("SIZE ").iter().map(|size| size.parse::<usize>().unwrap()).sum();
        assert_eq!(bytes.len(), start + 2 * bytes_a_point);
        let mut first = [1.5_f32, -2.0, 1e6].map(f32::to_le_bytes).concat();
        // Little-endian 0x00070809.
        first.extend([9, 8, 7, 0]);
        first.extend(200.0_f32.to_le_bytes());
        assert_eq!(bytes[start..][..bytes_a_point], first);
    }
}
