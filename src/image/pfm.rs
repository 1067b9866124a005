//! Portable float maps: the float format that the stereo benchmarks share.

use std::path::Path;

use super::Plane;
use super::file::{self, MAX_PIXELS};
use super::save::save;
use crate::error::{Error, ReadError, Result};

/// The contents of a PFM file, top row first (the file has the bottom row first).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Pfm {
    /// One value per pixel (`Pf`).
    Grey(Plane<f32>),
    /// Red, green and blue of each pixel (`PF`).
    Colour(Plane<[f32; 3]>),
}

/// Reads a PFM file of either byte order. Values are returned as stored; the magnitude of the scale is
/// ignored, as in the stereo benchmarks. Comments in the header are skipped.
///
/// # Errors
/// [`Error::Read`] when there is no such file, it is not a complete PFM file, or it has more than
/// [`MAX_PIXELS`].
pub fn read(path: &Path) -> Result<Pfm> {
    let not_pfm = |bytes: &[u8]| (!is_pfm(bytes)).then(|| NOT_PFM.into());
    decode(&file::load(path, MAX_PIXELS, not_pfm)?, MAX_PIXELS).map_err(|cause| Error::read(path, cause))
}

/// Writes a plane as single-channel PFM, little endian with scale -1.0, completely or not at all.
///
/// # Errors
/// [`Error::Write`] when the file cannot be written.
pub fn write(path: &Path, plane: &Plane<f32>) -> Result<()> {
    save(path, &encode(plane))
}

/// The bytes of the file that [`write()`] would write.
#[must_use]
pub fn encode(plane: &Plane<f32>) -> Vec<u8> {
    let mut bytes = header(plane.size()).into_bytes();
    bytes.reserve_exact(plane.data().len() * 4);
    encode_rows(plane, &mut bytes);
    bytes
}

/// The header of a single-channel file of (width, height) pixels.
pub(super) fn header((width, height): (usize, usize)) -> String {
    format!("Pf\n{width} {height}\n-1.0\n")
}

/// Appends the rows of a plane as the file has them, from the bottom.
pub(super) fn encode_rows(plane: &Plane<f32>, bytes: &mut Vec<u8>) {
    for y in (0..plane.height()).rev() {
        bytes.extend(plane.row(y).iter().flat_map(|v| v.to_le_bytes()));
    }
}

const NOT_PFM: &str = "not a PFM file: it does not begin with Pf or PF";

/// Whether the bytes begin like a PFM file.
pub(super) fn is_pfm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', c, ..] if c.is_ascii_whitespace() || *c == b'#')
}

/// Parses a whole file of at most `max_pixels` pixels; the error describes the fault.
pub(super) fn decode(bytes: &[u8], max_pixels: u64) -> Result<Pfm, ReadError> {
    let ((width, height), mut at) = size(bytes, max_pixels)?;
    let colour = bytes[1] == b'F';
    let word = token(bytes, &mut at).ok_or("the PFM header ends before the scale")?;
    let scale = word.parse::<f64>().ok().filter(|s| s.is_finite() && *s != 0.0);
    let Some(scale) = scale else {
        return Err(format!("the PFM header has the scale {word:?}, which is no number other than 0").into());
    };

    let channels = if colour { 3 } else { 1 };
    let need = (width * height).saturating_mul(channels * 4);
    // Exactly one byte ends the header, but some writers end lines with two: the file length decides.
    let two = bytes[at..].starts_with(b"\r\n") && (bytes.len() - at).checked_sub(2) == Some(need);
    at += if two { 2 } else { 1 };
    let data = bytes.get(at..).unwrap_or_default();
    if data.len() < need {
        return Err(format!(
            "truncated: {width} x {height} pixels need {need} bytes of data and {} are there; get the file again",
            data.len()
        )
        .into());
    }

    let from = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let value = |x: usize, y: usize, c: usize| {
        let i = (((height - 1 - y) * width + x) * channels + c) * 4;
        from([data[i], data[i + 1], data[i + 2], data[i + 3]])
    };
    Ok(if colour {
        Pfm::Colour(Plane::from_fn(width, height, |x, y| [0, 1, 2].map(|c| value(x, y, c))))
    } else {
        Pfm::Grey(Plane::from_fn(width, height, |x, y| value(x, y, 0)))
    })
}

/// (width, height) by the header, and the position after them.
pub(super) fn size(bytes: &[u8], max_pixels: u64) -> Result<((usize, usize), usize), ReadError> {
    if !is_pfm(bytes) {
        return Err(NOT_PFM.into());
    }
    let mut at = 2;
    let width = dimension(bytes, &mut at, "width")?;
    let height = dimension(bytes, &mut at, "height")?;
    file::check_size(width as u64, height as u64, max_pixels)?;
    Ok(((width, height), at))
}

/// The next word of the header, after white space and comments. `at` moves to the byte after it.
fn token<'a>(bytes: &'a [u8], at: &mut usize) -> Option<&'a str> {
    loop {
        match bytes.get(*at)? {
            b'#' => *at += bytes[*at..].iter().position(|&c| c == b'\n')?,
            c if c.is_ascii_whitespace() => *at += 1,
            _ => break,
        }
    }
    let rest = &bytes[*at..];
    // No valid number in a header is longer. Without a limit, an error could quote a whole malicious file.
    let length = rest.iter().take(40).position(u8::is_ascii_whitespace)?;
    *at += length;
    std::str::from_utf8(&rest[..length]).ok()
}

fn dimension(bytes: &[u8], at: &mut usize, name: &str) -> Result<usize, String> {
    let word = token(bytes, at).ok_or_else(|| format!("the PFM header ends before the {name}"))?;
    match word.parse::<u32>() {
        Ok(n) => Ok(n as usize),
        Err(_) => Err(format!("the PFM header has the {name} {word:?}, which is not a number of pixels")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8]) -> std::result::Result<Pfm, String> {
        super::decode(bytes, MAX_PIXELS).map_err(|cause| cause.to_string())
    }

    fn plane() -> Plane<f32> {
        Plane::new(3, 2, vec![1.5, -2.0, f32::INFINITY, 0.0, 1e-30, 7.25])
    }

    #[test]
    fn planes_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        write(&path, &plane()).unwrap();
        assert_eq!(read(&path).unwrap(), Pfm::Grey(plane()));
    }

    #[test]
    fn the_bottom_row_is_first_in_the_file() {
        let bytes = encode(&plane());
        let header = b"Pf\n3 2\n-1.0\n";
        assert!(bytes.starts_with(header));
        assert_eq!(bytes[header.len()..][..4], 0.0_f32.to_le_bytes());
        assert_eq!(bytes[header.len() + 20..][..4], f32::INFINITY.to_le_bytes());
    }

    #[test]
    fn big_endian_colour_and_comments() {
        let mut bytes = b"PF # made by hand\n# and commented\n2\n# between\n1 255.0\n".to_vec();
        for v in [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0] {
            bytes.extend(v.to_be_bytes());
        }
        let expected = Pfm::Colour(Plane::new(2, 1, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        assert_eq!(decode(&bytes).unwrap(), expected);
    }

    #[test]
    fn lines_may_end_in_two_bytes() {
        let mut bytes = b"Pf\r\n1 1\r\n-1\r\n".to_vec();
        bytes.extend(2.5_f32.to_le_bytes());
        assert_eq!(decode(&bytes).unwrap(), Pfm::Grey(Plane::new(1, 1, vec![2.5])));
        // One byte ends the header here, and the first value happens to begin with a line feed.
        let mut bytes = b"Pf 1 1 -1\r".to_vec();
        let value = [b'\n', 1, 2, 3];
        bytes.extend(value);
        assert_eq!(decode(&bytes).unwrap(), Pfm::Grey(Plane::new(1, 1, vec![f32::from_le_bytes(value)])));
    }

    #[test]
    fn hostile_files_are_refused() {
        let refused = |bytes: &[u8], word: &str| {
            let reason = decode(bytes).unwrap_err();
            assert!(reason.contains(word), "{reason}");
            assert!(reason.len() < 200 && !reason.contains('\n'), "{reason}");
        };
        refused(b"", "not a PFM");
        refused(b"P5\n1 1\n255\n0", "not a PFM");
        refused(b"Pf\n", "width");
        refused(b"Pf\n# no end", "width");
        refused(b"Pf\n-3 1\n-1\n", "width");
        refused(b"Pf\n3 x\n-1\n", "height");
        refused(b"Pf\n0 4\n-1\n", "no pixel");
        refused(b"Pf\n4294967295 4294967295\n-1\n", "at most");
        refused(b"Pf\n99999999999999999999 1\n-1\n", "width");
        refused(b"Pf\n1 1\n0\n\0\0\0\0", "scale");
        refused(b"Pf\n1 1\nNaN\n\0\0\0\0", "scale");
        refused(b"Pf\n1 1\n-1", "scale");
        refused(b"Pf\n1 1\n-1\n\0\0\0", "truncated");
        refused(b"Pf\n16384 16384\n-1\n\0\0\0", "truncated");
        refused(b"Pf\n16385 16384\n-1\n\0\0\0", "at most 268435456");
        // The arithmetic does not overflow, whatever limit the caller sets.
        let reason = super::decode(b"PF\n4294967295 4294967295\n-1\n\0", u64::MAX).unwrap_err().to_string();
        assert!(reason.contains("truncated"), "{reason}");
        refused(&[b"Pf\n".as_slice(), &[b'7'; 5000]].concat(), "width");
        refused(b"Pf\n\xff\xfe 1\n-1\n", "width");
    }

    #[test]
    fn every_truncation_is_an_error() {
        let whole = encode(&plane());
        for length in 0..whole.len() {
            assert!(decode(&whole[..length]).is_err(), "{length} bytes");
        }
        assert!(decode(&whole).is_ok());
    }
}
