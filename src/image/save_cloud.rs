//! Writes point clouds, in the format of the extension.

use std::path::Path;

use super::cloud::Cloud;
#[cfg(feature = "las")]
use super::las;
use super::save::save;
use super::write::{extension, is_special};
use super::{pcd, ply};
use crate::error::{Error, Reason, Result};

/// The extensions of point clouds.
const CLOUDS: &str = if cfg!(feature = "las") { ".ply, .pcd, .las or .laz" } else { ".ply or .pcd" };

/// Writes a point cloud in the format of the extension: `.ply` ([`ply::encode`]) or `.pcd` ([`pcd::encode`]);
/// with the feature `las` also LAS 1.2 as `.las` and `.laz`, whose intensity is 257 times the confidence. An
/// existing path that is not a regular file gets PLY if its name has no such extension.
///
/// # Errors
/// [`Error::Write`] for another extension, points that the format cannot hold, or a file that cannot be written.
pub fn cloud(path: &Path, cloud: &Cloud) -> Result<()> {
    let bytes = match extension(path).as_deref() {
        Some("ply") => ply::encode(cloud),
        Some("pcd") => pcd::encode(cloud),
        #[cfg(feature = "las")]
        Some(word @ ("las" | "laz")) => {
            las::encode(cloud, word == "laz").map_err(|reason| Error::write(path, reason))?
        }
        _ if is_special(path) => ply::encode(cloud),
        _ => {
            return Err(Error::write(path, Reason::of_request(format!("point clouds end in {CLOUDS}"))));
        }
    };
    save(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_extension_of_a_cloud_decides_its_format() {
        let folder = tempfile::tempdir().unwrap();
        for refused in ["a.xyz", "a"] {
            let error = cloud(&folder.path().join(refused), &Cloud::default()).unwrap_err().to_string();
            assert!(error.contains(refused) && error.contains(CLOUDS), "{error}");
        }
        // An empty cloud is valid.
        for (name, end) in [("a.PLY", &b"end_header\n"[..]), ("a.pcd", b"DATA binary\n")] {
            let path = folder.path().join(name);
            cloud(&path, &Cloud::default()).unwrap();
            assert!(fs::read(path).unwrap().ends_with(end), "{name}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
