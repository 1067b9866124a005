//! Reads the positions of point clouds. PCD, LAS and LAZ need the feature `clouds`.

use std::fs::File;
#[cfg(feature = "clouds")]
use std::io::SeekFrom;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
#[cfg(feature = "clouds")]
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;

#[cfg(feature = "clouds")]
use ::las::Reader as LasReader;

#[cfg(feature = "clouds")]
use super::read_pcd;
use super::read_ply;
use crate::error::{Error, Result};
use crate::text::one_line;

/// The first bytes that decide the form.
const START: usize = 512;
/// Bytes of a point in the scans of KITTI: x, y, z and the reflectance, each a float of 32 bits.
const KITTI_POINT: usize = 16;
/// The number of the record of a LAZ file that says how its points are packed.
#[cfg(feature = "clouds")]
const LAZ_RECORD: u64 = 22_204;
/// Bytes of LAS points that are read at once, unpacked.
#[cfg(feature = "clouds")]
const LAS_BYTES: u64 = 1 << 22;

/// The positions (x, y, z) of the points in a file, without those that are not finite, in the unit of the file.
///
/// The form is found by the first bytes: PLY, and with the feature `clouds` PCD and LAS or LAZ, of all kinds. Otherwise a file that ends
/// in `.bin` is a scan of KITTI, and any other file is a text whose lines begin with x, y and z, after a comment (`#`) perhaps; in COLMAP's
/// `points3D.txt` they come after a number.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read, is damaged, or holds no points.
pub fn positions(path: &Path) -> Result<Vec<[f64; 3]>> {
    found(path, BufReader::new(File::open(path).map_err(|e| Error::opening(path, e))?))
}

/// Like [`positions`], from a file in memory, with its name for errors and its extension.
///
/// # Errors
/// The errors of [`positions`].
pub fn positions_in_memory(name: &Path, bytes: Vec<u8>) -> Result<Vec<[f64; 3]>> {
    found(name, Cursor::new(bytes))
}

fn found(path: &Path, mut file: impl BufRead + Seek + Send + Sync + 'static) -> Result<Vec<[f64; 3]>> {
    let mut start = Vec::new();
    let read = file.by_ref().take(START as u64).read_to_end(&mut start).and_then(|_| file.rewind());
    read.map_err(|e| Error::opening(path, e))?;
    let is_bin = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("bin"));
    let found = if start.starts_with(b"ply") {
        read_ply::positions(file)
    } else if start.starts_with(b"LASF") {
        of_las(file)
    } else if is_pcd(&start) {
        of_pcd(file)
    } else if is_bin {
        of_kitti(file)
    } else {
        of_text(file)
    };
    let mut points = found.map_err(|reason| Error::read(path, reason))?;
    points.retain(|point| point.iter().all(|v| v.is_finite()));
    if points.is_empty() {
        return Err(Error::read(path, "holds no points; give a point cloud"));
    }
    Ok(points)
}

type Found = std::result::Result<Vec<[f64; 3]>, String>;

/// The reason in one line, for any error.
fn reason(error: impl std::fmt::Display) -> String {
    format!("damaged: {}", one_line(&error.to_string()))
}

#[cfg(feature = "clouds")]
fn of_las(mut file: impl BufRead + Seek + Send + Sync + 'static) -> Found {
    if !can_be_unpacked(&mut file).unwrap_or(false) {
        return Err("damaged: its header does not say how its points are packed".into());
    }
    // The decoder of LAZ panics on some damaged files. It owns the file, so nothing is left half done.
    let read = panic::catch_unwind(AssertUnwindSafe(|| of_sound_las(file)));
    read.unwrap_or_else(|_| Err("damaged: its points cannot be unpacked".into()))
}

#[cfg(feature = "clouds")]
fn of_sound_las(file: impl BufRead + Seek + Send + Sync + 'static) -> Found {
    let mut reader = LasReader::new(file).map_err(reason)?;
    // A file may claim that its points are large.
    let at_once = (LAS_BYTES / u64::from(reader.header().point_format().len()).max(1)).max(1);
    let mut points = Vec::new();
    loop {
        let read = reader.read_points(at_once).map_err(reason)?;
        if read.is_empty() {
            return Ok(points);
        }
        points.extend(read.x().zip(read.y()).zip(read.z()).map(|((x, y), z)| [x, y, z]));
    }
}

/// Whether a LAS file is not packed, or says how: its points consist of its fields, and it has a table of at most as many chunks as the
/// file has bytes, since the memory for the table is taken first. Leaves the file at its start.
#[cfg(feature = "clouds")]
fn can_be_unpacked(file: &mut (impl Read + Seek)) -> std::io::Result<bool> {
    let mut word = [0; 8];
    let length = file.seek(SeekFrom::End(0))?;
    let mut at = |place: u64| {
        file.seek(SeekFrom::Start(place))?;
        file.read_exact(&mut word)?;
        Ok::<_, std::io::Error>(u64::from_le_bytes(word))
    };
    // Where the points begin, and whether they are packed.
    let start = at(96)? as u32;
    let fits = at(104)? & 0x80 == 0 || {
        // The place of the table is at the end where the writer could not go back.
        let first = at(start.into())?;
        let is_place = |place: u64| place > start.into() && place < length;
        let place = if is_place(first) { first } else { at(length - 8)? };
        let has_chunks = !is_place(place) || at(place)? >> 32 <= length;
        // The records after the header, of which one lists the fields.
        let (mut record, count) = (at(94)? & 0xffff, at(100)? as u32);
        let mut has_fields = false;
        for _ in 0..count {
            let about = at(record + 14)?;
            let (kind, size) = (about >> 32 & 0xffff, about >> 48);
            if kind == LAZ_RECORD {
                let mut bytes = 0;
                for field in 0..at(record + 54 + 32)? & 0xffff {
                    bytes += at(record + 54 + 34 + 6 * field)? >> 16 & 0xffff;
                }
                // The fields of a point, which the decoder cuts its bytes into.
                has_fields = bytes > 0 && bytes == at(105)? & 0xffff;
            }
            record += 54 + size;
        }
        has_chunks && has_fields
    };
    file.rewind()?;
    Ok(fits)
}

/// Without the feature `clouds`.
#[cfg(not(feature = "clouds"))]
fn of_las(_: impl BufRead) -> Found {
    Err("is LAS, which is not read here; give PLY or a text of points".into())
}

#[cfg(feature = "clouds")]
fn of_pcd(file: impl BufRead) -> Found {
    read_pcd::positions(file)
}

/// Without the feature `clouds`.
#[cfg(not(feature = "clouds"))]
fn of_pcd(_: impl BufRead) -> Found {
    Err("is PCD, which is not read here; give PLY or a text of points".into())
}

/// Whether a header of PCD follows, after comments.
fn is_pcd(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let first = text.lines().find(|line| !line.starts_with('#'));
    first.is_some_and(|line| ["VERSION", "FIELDS"].iter().any(|word| line.starts_with(word)))
}

fn of_kitti(mut file: impl Read) -> Found {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(reason)?;
    let (points, []) = bytes.as_chunks::<KITTI_POINT>() else {
        return Err("is no scan of KITTI, which has 16 bytes per point; give PLY, PCD, LAS or a text".into());
    };
    let value = |point: &[u8; KITTI_POINT], i: usize| {
        f64::from(f32::from_le_bytes([point[4 * i], point[4 * i + 1], point[4 * i + 2], point[4 * i + 3]]))
    };
    Ok(points.iter().map(|point| [0, 1, 2].map(|i| value(point, i))).collect())
}

fn of_text(file: impl BufRead) -> Found {
    let mut points = Vec::new();
    // COLMAP names the columns in a comment.
    let mut skipped = 0;
    for (i, line) in file.lines().enumerate() {
        let wrong = || format!("line {}: not x, y and z; give PLY, PCD, LAS, LAZ or a text of points", i + 1);
        let line = line.map_err(|_| wrong())?;
        if line.starts_with('#') {
            skipped = skipped.max(usize::from(line.contains("POINT3D_ID")));
            continue;
        }
        let is_between = |c: char| c.is_whitespace() || [',', ';'].contains(&c);
        let words: Vec<&str> = line.split(is_between).filter(|word| !word.is_empty()).collect();
        let position = words.get(skipped..skipped + 3).and_then(|words| {
            let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
            <[f64; 3]>::try_from(numbers?).ok()
        });
        match position {
            Some(position) => points.push(position),
            // A number of points (PTS), names of columns, or the last line.
            None if words.len() < 2 || points.is_empty() && i < 2 => {}
            None => return Err(wrong()),
        }
    }
    Ok(points)
}

#[cfg(feature = "clouds")]
#[cfg(test)]
mod tests {
    use super::super::cloud::{Cloud, Point};
    use super::super::{las, pcd, ply};
    use super::*;
    use std::fs;

    const POINTS: [[f64; 3]; 2] = [[1.5, -2.0, 3.25], [0.0, 4.0, 8.5]];

    fn read(name: &str, bytes: &[u8]) -> std::result::Result<Vec<[f64; 3]>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        positions(&path).map_err(|e| e.to_string())
    }

    fn cloud() -> Cloud {
        let point = |position: [f64; 3]| Point {
            position: position.map(|v| v as f32),
            colour: [1, 2, 3],
            confidence: 9,
        };
        Cloud { points: POINTS.map(point).to_vec(), ..Cloud::default() }
    }

    #[test]
    fn the_own_forms_are_read() {
        let of = |compressed| las::encode(&cloud(), compressed).unwrap();
        for bytes in [ply::encode(&cloud()), pcd::encode(&cloud()), of(false), of(true)] {
            let found = read("any.name", &bytes).unwrap();
            assert_eq!(found.len(), 2);
            let off = found.as_flattened().iter().zip(POINTS.as_flattened()).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn foreign_forms_are_read() {
        let big = [1.5_f32, -2.0, 3.25, 0.0, 4.0, 8.5].map(f32::to_be_bytes).concat();
        let header = "ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
        let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let mesh =
            [header.as_bytes(), faces.as_bytes(), &big, &[3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1]].concat();
        // Two elements come before the points, and a list stands between their axes.
        let header = "ply\r\nformat binary_little_endian 1.0\r\nobj_info x\r\nelement none 9999999999\r\nelement strip 2\r\n\
            property list int short at\r\nproperty uint8 x\r\nelement vertex 2\r\nproperty int8 x1\r\nproperty double x\r\n\
            property list uchar float64 w\r\nproperty double y\r\nproperty double z\r\nend_header\r\n";
        let double = |v: f64| v.to_le_bytes();
        let strips = [&[2, 0, 0, 0, 7, 7, 7, 7, 9][..], &[0xff, 0xff, 0xff, 0xff, 9]].concat();
        let vertex =
            |[x, y, z]: [f64; 3]| [&[5][..], &double(x), &[1], &double(8.0), &double(y), &double(z)].concat();
        let lists = [header.as_bytes(), &strips, &vertex(POINTS[0]), &vertex(POINTS[1])].concat();
        // Axes of several types between fields that are left out, one of two values; and columns that LZF packs.
        let header = "VERSION 0.7\nFIELDS a x y b z\nSIZE 8 8 1 2 4\nTYPE F F I U F\nCOUNT 1 1 1 2 1\nWIDTH 2\nHEIGHT 1\nDATA binary\n";
        let point = |x: f64, y: i8, z: f32| {
            [&double(9.0)[..], &double(x), &y.to_le_bytes(), &[7; 4], &z.to_le_bytes()].concat()
        };
        let integers = [header.as_bytes(), &point(1.5, -2, 3.25), &point(0.0, 4, 8.5)].concat();
        let header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n";
        let columns = [1.5_f32, 0.0, -2.0, 4.0, 3.25, 8.5].map(f32::to_le_bytes).concat();
        // 4 literal bytes, 4 zeros as a literal and three that repeat it, and the rest as it is.
        let mut lzf = [&[3][..], &columns[..4], &[0, 0], &[1 << 5, 0], &[15], &columns[8..]].concat();
        lzf.splice(0..0, [lzf.len() as u32, 24].map(u32::to_le_bytes).concat());
        let packed = [header.as_bytes(), &lzf].concat();
        let scan = [1.5_f32, -2.0, 3.25, 0.5, 0.0, 4.0, 8.5, 0.25].map(f32::to_le_bytes).concat();
        for (name, bytes) in [
            ("mesh.ply", &mesh[..]),
            ("lists.ply", &lists),
            (
                "text.ply",
                b"ply\nformat ascii 1.0\nelement vertex 2\nproperty uchar red\nproperty double z\nproperty float y\nproperty float x\nend_header\n7 3.25 -2 1.5\n7 8.5 4 0\n",
            ),
            (
                "text.pcd",
                b"# .PCD v.7\nVERSION .7\nFIELDS intensity x y z\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n1 1.5 -2 3.25\n1 nan nan nan\n1 0 4 8.5\n",
            ),
            ("integers.pcd", &integers),
            ("packed.pcd", &packed),
            ("000000.bin", &scan),
            ("text.xyz", b"# a comment\n1.5 -2 3.25 255 0 0\n\n0 4 8.5 255 0 0\n"),
            ("text.xyz", b"x,y,z\n1.5,-2,3.25\n0,4,8.5\n"),
            ("text.pts", b"2\n1.5 -2 3.25\n0 4 8.5\n"),
            (
                "points3D.txt",
                b"# 3D point list\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n63 1.5 -2 3.25 1 2 3 0.5 1 2\n64 0 4 8.5 1 2 3 0.5 1 3\n",
            ),
        ] {
            assert_eq!(read(name, bytes), Ok(POINTS.to_vec()), "{name}");
        }
    }

    #[test]
    fn files_without_points_are_refused() {
        let cut = &ply::encode(&cloud())[..250];
        let las = &las::encode(&cloud(), true).unwrap();
        let header = &b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA "[..];
        for (name, bytes, word) in [
            ("a.ply", cut, "damaged"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n", "vertex"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999\nproperty float x\nend_header\n", "lack x, y or z"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n", "point 2 of 999999999 is missing"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2\n", "damaged: point 1"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty word x\nend_header\n1\n", "line 4"),
            ("a.ply", b"ply\nelement vertex 0\nend_header\n", "`format`"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\n", "line 4"),
            ("a.laz", &las[..las.len() / 2], "damaged"),
            ("a.pcd", b"VERSION 0.7\nFIELDS a\nSIZE 4\nTYPE F\nCOUNT 1\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1\n", "x, y and z"),
            ("a.pcd", b"VERSION 0.7\nFIELDS x y z\nnonsense\n", "damaged"),
            ("a.pcd", &[header, b"binary\n0123456789ab"].concat(), "point 2 of 2 is missing"),
            ("a.pcd", &[header, b"ascii\n1 2 3\n1 2\n"].concat(), "point 2 of 2"),
            ("a.pcd", &[header, b"binary_compressed\n\x04\0\0\0\x18\0\0\0\x3f\x40\0\0"].concat(), "unpacked"),
            ("a.pcd", &[header, b"words\n"].concat(), "DATA"),
            ("a.bin", &[0; 17], "16 bytes"),
            ("a.xyz", b"1 2 3\n1 2\n", "line 2"),
            ("a.xyz", b"", "no points"),
            ("a.xyz", b"\xff\xfe\x00 1 2 3\n1 2 3 \xff\n", "line"),
        ] {
            let error = read(name, bytes).unwrap_err();
            assert!(error.contains(name) && error.contains(word), "{name}: {error}");
        }
    }
}
