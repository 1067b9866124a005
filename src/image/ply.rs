//! Point clouds as PLY files, which `MeshLab`, `CloudCompare` and most other programs open.

use super::cloud::{Cloud, encoded};

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
    encoded(header, cloud, 19, |point, bytes| {
        bytes.extend(point.position.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(point.colour);
        bytes.extend(f32::from(point.confidence).to_le_bytes());
    })
}
