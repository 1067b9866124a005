//! Reads the positions of point clouds: the feature `clouds`.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use ::las::Reader as LasReader;
use pcd_rs::{DynReader, Field};
use ply_rs_bw::parser::{Parser, Reader as PlyReader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use crate::error::{Error, Result};
use crate::text::one_line;

/// The first bytes that decide the form.
const START: usize = 512;
/// Bytes of a point in the scans of KITTI: x, y, z and the reflectance, each a float of 32 bits.
const KITTI_POINT: usize = 16;
/// Points of LAS that are read at once.
const LAS_POINTS: u64 = 1 << 16;

/// The positions (x, y, z) of the points in a file, without those that are not finite, in the unit of the file.
///
/// The form is found by the first bytes: PLY, PCD and LAS or LAZ of all kinds. Otherwise a file that ends in `.bin` is a scan of KITTI, and
/// any other file is a text whose lines begin with x, y and z, after a comment (`#`) perhaps; in COLMAP's `points3D.txt` they come after a
/// number.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read, is damaged, or holds no points.
pub fn positions(path: &Path) -> Result<Vec<[f64; 3]>> {
    let mut file = BufReader::new(File::open(path).map_err(|e| Error::opening(path, e))?);
    let mut start = Vec::new();
    let read = file.by_ref().take(START as u64).read_to_end(&mut start).and_then(|_| file.rewind());
    read.map_err(|e| Error::opening(path, e))?;
    let is_bin = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("bin"));
    let found = if start.starts_with(b"ply") {
        of_ply(file)
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

/// A point of PLY. Properties other than the position are ignored.
struct PlyPoint([f64; 3]);

impl PropertyAccess for PlyPoint {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(v) => v.into(),
            Property::UChar(v) => v.into(),
            Property::Short(v) => v.into(),
            Property::UShort(v) => v.into(),
            Property::Int(v) => v.into(),
            Property::UInt(v) => v.into(),
            Property::Float(v) => v.into(),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::Ignored,
        };
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

/// Reads the element `vertex`, and what comes before it.
fn of_ply(file: impl BufRead) -> Found {
    let (parser, mut reader) = (Parser::<PlyPoint>::new(), PlyReader::new(file));
    let header = parser.read_header(&mut reader).map_err(reason)?;
    for (name, element) in &header.elements {
        let read = parser.read_payload_for_element(&mut reader, element, &header).map_err(reason)?;
        if name == "vertex" {
            return Ok(read.into_iter().map(|point| point.0).collect());
        }
    }
    Err("is a PLY file without points (the element vertex)".into())
}

fn of_las(file: impl BufRead + Seek + Send + Sync + 'static) -> Found {
    let mut reader = LasReader::new(file).map_err(reason)?;
    let mut points = Vec::new();
    loop {
        let read = reader.read_points(LAS_POINTS).map_err(reason)?;
        if read.is_empty() {
            return Ok(points);
        }
        points.extend(read.x().zip(read.y()).zip(read.z()).map(|((x, y), z)| [x, y, z]));
    }
}

/// Whether a header of PCD follows, after comments.
fn is_pcd(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let first = text.lines().find(|line| !line.starts_with('#'));
    first.is_some_and(|line| ["VERSION", "FIELDS"].iter().any(|word| line.starts_with(word)))
}

fn of_pcd(file: impl BufRead) -> Found {
    let reader = DynReader::from_reader(file).map_err(reason)?;
    let fields = &reader.meta().field_defs.fields;
    let place = |axis: &str| fields.iter().position(|field| field.name == axis && field.count == 1);
    let (Some(x), Some(y), Some(z)) = (place("x"), place("y"), place("z")) else {
        return Err("is a PCD file without the fields x, y and z".into());
    };
    let read = reader.map(|record| {
        let record = record.map_err(reason)?;
        Ok([x, y, z].map(|i| record.0.get(i).and_then(number).unwrap_or(f64::NAN)))
    });
    read.collect()
}

/// The first value of a field.
fn number(field: &Field) -> Option<f64> {
    match field {
        Field::I8(v) => v.first().map(|v| (*v).into()),
        Field::I16(v) => v.first().map(|v| (*v).into()),
        Field::I32(v) => v.first().map(|v| (*v).into()),
        Field::I64(v) => v.first().map(|v| *v as f64),
        Field::U8(v) => v.first().map(|v| (*v).into()),
        Field::U16(v) => v.first().map(|v| (*v).into()),
        Field::U32(v) => v.first().map(|v| (*v).into()),
        Field::U64(v) => v.first().map(|v| *v as f64),
        Field::F32(v) => v.first().map(|v| (*v).into()),
        Field::F64(v) => v.first().copied(),
    }
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
        let scan = [1.5_f32, -2.0, 3.25, 0.5, 0.0, 4.0, 8.5, 0.25].map(f32::to_le_bytes).concat();
        for (name, bytes) in [
            ("mesh.ply", &mesh[..]),
            (
                "text.ply",
                b"ply\nformat ascii 1.0\nelement vertex 2\nproperty uchar red\nproperty double z\nproperty float y\nproperty float x\nend_header\n7 3.25 -2 1.5\n7 8.5 4 0\n",
            ),
            (
                "text.pcd",
                b"# .PCD v.7\nVERSION .7\nFIELDS intensity x y z\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n1 1.5 -2 3.25\n1 nan nan nan\n1 0 4 8.5\n",
            ),
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
        for (name, bytes, word) in [
            ("a.ply", cut, "damaged"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n", "vertex"),
            ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999\nproperty float x\nend_header\n", "damaged"),
            ("a.laz", &las[..las.len() / 2], "damaged"),
            ("a.pcd", b"VERSION 0.7\nFIELDS a\nSIZE 4\nTYPE F\nCOUNT 1\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1\n", "x, y and z"),
            ("a.pcd", b"VERSION 0.7\nFIELDS x y z\nnonsense\n", "damaged"),
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
