//! Point clouds as PLY files, which `MeshLab`, `CloudCompare` and most others open.

use super::cloud::Cloud;

/// A cloud as binary little-endian PLY: one element `vertex` with `x`, `y`, `z` (float), `red`, `green`, `blue` (uchar) and
/// `quality` (float), which is the confidence. `MeshLab` shows it under this name and type. It misreads a float
/// called `confidence`, and ignores any other name.
#[must_use]
pub fn encode(cloud: &Cloud) -> Vec<u8> {
    let header = format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment {}\n\
         comment quality is the confidence, 0 to 255\n\
         element vertex {}\n\
         property float x\n\
         property float y\n\
         property float z\n\
         property uchar red\n\
         property uchar green\n\
         property uchar blue\n\
         property float quality\n\
         end_header\n",
        cloud.about(),
        cloud.points.len()
    );
    let mut bytes = header.into_bytes();
    bytes.reserve_exact(cloud.points.len() * 19);
    for point in &cloud.points {
        bytes.extend(point.position.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(point.colour);
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
        let bytes = encode(&Cloud { points: vec![point, other], frame: Frame::Matched });
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
        let header: Vec<_> = std::str::from_utf8(&bytes[..start]).unwrap().lines().collect();
        assert_eq!(header[..2], ["ply", "format binary_little_endian 1.0"]);
        let about: String = header.iter().filter_map(|line| line.strip_prefix("comment ")).collect();
        assert!(about.contains("y down") && about.contains("confidence"), "{about}");
        let elements: Vec<_> = header.iter().filter_map(|line| line.strip_prefix("element ")).collect();
        assert_eq!(elements, ["vertex 2"]);
        let size = |kind: &str| if kind == "float" { 4 } else { 1 };
        let properties: Vec<_> = header.iter().filter_map(|line| line.strip_prefix("property ")).collect();
        let bytes_a_point: usize = properties.iter().map(|p| size(p.split(' ').next().unwrap())).sum();
        assert_eq!(bytes.len(), start + 2 * bytes_a_point);
        let names: Vec<_> = properties.iter().map(|p| p.split(' ').next_back().unwrap()).collect();
        assert_eq!(names, ["x", "y", "z", "red", "green", "blue", "quality"]);
        let mut first = [1.5_f32, -2.0, 1e6].map(f32::to_le_bytes).concat();
        first.extend([7, 8, 9]);
        first.extend(200.0_f32.to_le_bytes());
        assert_eq!(bytes[start..][..bytes_a_point], first);
    }

    #[test]
    fn the_header_says_the_frame() {
        let header = |frame| String::from_utf8(encode(&Cloud { points: Vec::new(), frame })).unwrap();
        assert!(header(Frame::Matched).contains("comment frame of the left camera: x right"));
        assert!(header(Frame::Original).contains("comment frame of the original left camera, before"));
    }
}
