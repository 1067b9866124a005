//! Point clouds as PCD files, which the Point Cloud Library, ROS and `Open3D` read.

use super::cloud::{Cloud, encoded};

/// A cloud as binary PCD 0.7 with the fields `x`, `y`, `z`, `rgb` and `intensity`, of four bytes each. `rgb` is
/// 0x00RRGGBB in the bits of a float, as in the Point Cloud Library; `intensity` is the confidence, 0 to 255.
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
    encoded(header, cloud, 20, |point, bytes| {
        let [red, green, blue] = point.colour;
        bytes.extend(point.position.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(u32::from_be_bytes([0, red, green, blue]).to_le_bytes());
        bytes.extend(f32::from(point.confidence).to_le_bytes());
    })
}
