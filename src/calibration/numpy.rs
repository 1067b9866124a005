//! Reads calibrations saved by `np.savez` (`.npz`), as text.

use std::fmt::Write;
use std::io::Read as _;

use flate2::read::DeflateDecoder;

/// The largest array of a calibration has 16 numbers; larger arrays, such as maps, are skipped.
const MOST_NUMBERS: usize = 64;

/// More bytes than such an array has with its header.
const MOST_BYTES: u64 = 1 << 16;

/// Whether a file is a ZIP archive, of numpy or not.
pub(super) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// Whether an archive holds arrays.
pub(super) fn is(bytes: &[u8]) -> bool {
    is_archive(bytes)
        && members(bytes).is_some_and(|all| all.iter().any(|(name, ..)| name.strip_suffix(".npy").is_some()))
}

/// The small arrays of an archive, one per line: `R: [1.0, 0.0, ...]`. The error is one line.
pub(super) fn text(bytes: &[u8]) -> Result<String, String> {
    const DAMAGED: &str = "is a damaged .npz; save it again";
    let mut text = String::new();
    for (name, method, data) in members(bytes).ok_or(DAMAGED)? {
        let Some(name) = name.strip_suffix(".npy").filter(|name| is_plain(name)) else { continue };
        let mut array = Vec::new();
        match method {
            0 => array.extend_from_slice(data),
            8 => {
                let read = DeflateDecoder::new(data).take(MOST_BYTES).read_to_end(&mut array);
                read.map_err(|_| DAMAGED)?;
            }
            _ => return Err(DAMAGED.into()),
        }
        let Some(numbers) = numbers(&array) else { continue };
        if text.lines().any(|line| line.split(':').next() == Some(name)) {
            return Err(format!("{name} is there twice; keep one"));
        }
        let _ = writeln!(text, "{name}: {numbers:?}");
    }
    if text.is_empty() {
        return Err("is an .npz without the arrays of a calibration; expected K1, D1, K2, D2, R and T".into());
    }
    Ok(text)
}

fn is_plain(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Name, method and bytes of each member, from the table at the end. `None` if that is damaged.
fn members(bytes: &[u8]) -> Option<Vec<(String, u64, &[u8])>> {
    let end = bytes.windows(4).rposition(|four| four == b"PK\x05\x06")?;
    let (count, mut at) = (int(bytes, end + 10, 2)?, usize::try_from(int(bytes, end + 16, 4)?).ok()?);
    let mut found = Vec::new();
    for _ in 0..count {
        if bytes.get(at..at.checked_add(4)?)? != b"PK\x01\x02" {
            return None;
        }
        let field = |offset: usize, size: usize| int(bytes, at + offset, size).map(|v| v as usize);
        let (method, length, local) = (int(bytes, at + 10, 2)?, field(20, 4)?, field(42, 4)?);
        let (name, extra, comment) = (field(28, 2)?, field(30, 2)?, field(32, 2)?);
        let text = String::from_utf8_lossy(bytes.get(at + 46..at + 46 + name)?).into_owned();
        // The local header has name and extra lengths of its own.
        let skipped = int(bytes, local.checked_add(26)?, 2)? + int(bytes, local.checked_add(28)?, 2)?;
        let start = local + 30 + skipped as usize;
        found.push((text, method, bytes.get(start..start.checked_add(length)?)?));
        at += 46 + name + extra + comment;
    }
    Some(found)
}

/// The little-endian integer of `size` bytes at `at`.
fn int(bytes: &[u8], at: usize, size: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(size)?)?;
    Some(bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte)))
}

/// The numbers of an array, row by row; `None` for large arrays, and for anything but numbers.
fn numbers(array: &[u8]) -> Option<Vec<f64>> {
    let rest = array.strip_prefix(b"\x93NUMPY")?;
    let size = if *rest.first()? == 1 { 2 } else { 4 };
    let length = usize::try_from(int(rest, 2, size)?).ok()?;
    let (header, data) = rest.get(2 + size..)?.split_at_checked(length)?;
    let header = std::str::from_utf8(header).ok()?;
    let value = |key: &str, end: char| {
        let value = header.split(&format!("'{key}':")).nth(1)?.trim_start();
        Some(value[..value.find(end)?].trim_matches(['(', '\'', ' ']).to_owned())
    };
    let shape: Option<Vec<usize>> = value("shape", ')')?
        .split(',')
        .filter(|word| !word.trim().is_empty())
        .map(|word| word.trim().parse().ok())
        .collect();
    let shape = shape?;
    let count = shape.iter().try_fold(1_usize, |all, length| all.checked_mul(*length))?;
    if count > MOST_NUMBERS {
        return None;
    }
    let all = match value("descr", ',')?.as_str() {
        "<f8" => read(data, count, f64::from_le_bytes),
        "<f4" => read(data, count, |b| f64::from(f32::from_le_bytes(b))),
        "<i8" => read(data, count, |b| i64::from_le_bytes(b) as f64),
        "<i4" => read(data, count, |b| f64::from(i32::from_le_bytes(b))),
        "|u1" | "|b1" => read(data, count, |[b]| f64::from(b)),
        _ => None,
    }?;
    match shape[..] {
        // Stored column by column.
        [rows, columns] if header.contains("'fortran_order': True") => {
            Some((0..count).map(|i| all[i % columns * rows + i / columns]).collect())
        }
        _ => Some(all),
    }
}

fn read<const N: usize>(data: &[u8], count: usize, number: impl Fn([u8; N]) -> f64) -> Option<Vec<f64>> {
    let numbers = data.chunks_exact(N).take(count).map(|bytes| bytes.try_into().ok().map(&number));
    numbers.collect::<Option<Vec<_>>>().filter(|all| all.len() == count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_read_row_by_row() {
        let array = |header: &str, data: &[u8]| {
            let header = format!("{header:117}\n");
            [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
        };
        let data: Vec<u8> = (1..=6).flat_map(|v| f64::from(v).to_le_bytes()).collect();
        let rows = array("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }", &data);
        assert_eq!(numbers(&rows), Some(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        let columns = array("{'descr': '<f8', 'fortran_order': True, 'shape': (2, 3), }", &data);
        assert_eq!(numbers(&columns), Some(vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0]));
        let one = array("{'descr': '<i8', 'fortran_order': False, 'shape': (), }", &7_i64.to_le_bytes());
        assert_eq!(numbers(&one), Some(vec![7.0]));
        for header in [
            "{'descr': '<f8', 'fortran_order': False, 'shape': (200, 300), }",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (7,), }",
            "{'descr': '|O', 'fortran_order': False, 'shape': (2,), }",
            "{'shape': (2,), }",
            "",
        ] {
            assert_eq!(numbers(&array(header, &data)), None, "{header}");
        }
    }
}
