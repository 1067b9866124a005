//! Reads the positions of points in files of the Point Cloud Library (PCD), in text, binary and compressed.

use std::io::{BufRead, Read};

/// The longest line of a header, in bytes.
const LONGEST: u64 = 1 << 16;

/// What the points of a file hold.
#[derive(Default)]
struct Header<'a> {
    fields: Vec<&'a str>,
    sizes: Vec<u64>,
    types: Vec<&'a str>,
    /// Values of each field; empty where each has one.
    counts: Vec<u64>,
    points: Option<u64>,
    width: u64,
    height: u64,
}

/// The value of one axis in each point.
#[derive(Clone, Copy)]
struct Axis {
    /// The values and bytes that come before it.
    values: usize,
    bytes: u64,
    /// Its type, I, U or F, and its size in bytes.
    kind: (u8, u64),
}

impl Axis {
    /// The number in its bytes, the lowest first.
    fn number(self, own: &[u8]) -> f64 {
        let mut bytes = [0; 8];
        bytes[..own.len()].copy_from_slice(own);
        let bits = u64::from_le_bytes(bytes);
        match self.kind {
            (b'F', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'F', _) => f64::from_bits(bits),
            (b'U', _) => bits as f64,
            (_, size) => {
                let unused = 64 - 8 * size as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        }
    }
}

/// The positions of the points.
///
/// # Errors
/// What is wrong with the file.
pub(super) fn positions(mut file: impl BufRead) -> Result<Vec<[f64; 3]>, String> {
    let mut lines = Vec::new();
    loop {
        let mut line = Vec::new();
        let wrong = "damaged: its header does not end with a line `DATA`";
        file.by_ref().take(LONGEST).read_until(b'\n', &mut line).map_err(|_| wrong)?;
        if !line.ends_with(b"\n") {
            return Err(wrong.into());
        }
        lines.push(String::from_utf8_lossy(&line).into_owned());
        if line.starts_with(b"DATA") {
            break;
        }
    }
    let header = Header::parse(&lines)?;
    let (axes, size) = header.axes()?;
    let count = header.points.unwrap_or(header.width.saturating_mul(header.height));
    let missing = |row: u64| format!("damaged: point {} of {count} is missing", row + 1);
    let mut points = Vec::new();
    match lines.last().and_then(|line| line.split_ascii_whitespace().nth(1)) {
        Some("ascii") => {
            for row in 0..count {
                points.push(of_text(&mut file, axes).ok_or_else(|| missing(row))?);
            }
        }
        Some("binary") => {
            let mut record = Vec::new();
            for row in 0..count {
                record.clear();
                let read = file.by_ref().take(size).read_to_end(&mut record);
                if read.ok().map(|read| read as u64) != Some(size) {
                    return Err(missing(row));
                }
                points.push(
                    axes.map(|axis| axis.number(&record[axis.bytes as usize..][..axis.kind.1 as usize])),
                );
            }
        }
        Some("binary_compressed") => {
            let wrong = "damaged: its compressed points cannot be unpacked";
            let bytes = size.checked_mul(count).and_then(|bytes| unpacked(&mut file, bytes)).ok_or(wrong)?;
            for row in 0..count {
                points.push(axes.map(|axis| {
                    let (start, size) = (axis.bytes * count + row * axis.kind.1, axis.kind.1 as usize);
                    axis.number(&bytes[start as usize..][..size])
                }));
            }
        }
        _ => return Err("is a PCD file whose DATA is not ascii, binary or binary_compressed".into()),
    }
    Ok(points)
}

impl<'a> Header<'a> {
    fn parse(lines: &'a [String]) -> Result<Self, String> {
        let mut header = Self::default();
        for (i, line) in lines.iter().enumerate() {
            let wrong = || format!("damaged: line {} is no line of a PCD header", i + 1);
            let mut words = line.split_ascii_whitespace();
            let Some(key) = words.next().filter(|key| !key.starts_with('#')) else { continue };
            let words: Vec<_> = words.collect();
            let numbers = || words.iter().map(|word| word.parse::<u64>()).collect::<Result<Vec<_>, _>>();
            let numbers = || numbers().map_err(|_| wrong());
            let number = || numbers()?.first().copied().ok_or_else(wrong);
            match key {
                "FIELDS" | "COLUMNS" => header.fields = words,
                "SIZE" => header.sizes = numbers()?,
                "TYPE" => header.types = words,
                "COUNT" => header.counts = numbers()?,
                "WIDTH" => header.width = number()?,
                "HEIGHT" => header.height = number()?,
                "POINTS" => header.points = Some(number()?),
                "VERSION" | "VIEWPOINT" | "DATA" => {}
                _ => return Err(wrong()),
            }
        }
        let count = header.fields.len();
        if header.counts.is_empty() {
            header.counts = vec![1; count];
        }
        if [header.sizes.len(), header.types.len(), header.counts.len()] != [count; 3] {
            return Err("damaged: FIELDS, SIZE, TYPE and COUNT of its header differ in number".into());
        }
        Ok(header)
    }

    /// Where x, y and z are, and the bytes of a point.
    fn axes(&self) -> Result<([Axis; 3], u64), String> {
        let mut found = [None; 3];
        let (mut values, mut bytes) = (0_u64, 0_u64);
        let damaged = "damaged: SIZE, TYPE or COUNT of its header is none of a point";
        for (i, name) in self.fields.iter().enumerate() {
            let (size, count) = (self.sizes[i], self.counts[i]);
            let at = ["x", "y", "z"].iter().position(|axis| axis == name);
            if let Some(at) = at.filter(|_| count == 1) {
                let kind = match (self.types[i], size) {
                    ("F", 4 | 8) => b'F',
                    ("U", 1 | 2 | 4 | 8) => b'U',
                    ("I", 1 | 2 | 4 | 8) => b'I',
                    _ => return Err(damaged.into()),
                };
                found[at] = Some(Axis { values: values as usize, bytes, kind: (kind, size) });
            }
            values = values.checked_add(count).ok_or(damaged)?;
            bytes = size.checked_mul(count).and_then(|more| bytes.checked_add(more)).ok_or(damaged)?;
        }
        let [Some(x), Some(y), Some(z)] = found else {
            return Err("is a PCD file without the fields x, y and z".into());
        };
        Ok(([x, y, z], bytes))
    }
}

/// The position in the next line.
fn of_text(file: &mut impl BufRead, axes: [Axis; 3]) -> Option<[f64; 3]> {
    let mut line = Vec::new();
    while line.trim_ascii().is_empty() {
        line.clear();
        file.read_until(b'\n', &mut line).ok().filter(|read| *read > 0)?;
    }
    let line = String::from_utf8_lossy(&line);
    let words: Vec<_> = line.split_ascii_whitespace().collect();
    let [x, y, z] = axes.map(|axis| words.get(axis.values).and_then(|word| word.parse().ok()));
    Some([x?, y?, z?])
}

/// The bytes of compressed points, of which there must be so many: LZF, one field after another.
fn unpacked(file: &mut impl Read, bytes: u64) -> Option<Vec<u8>> {
    let mut sizes = [0; 8];
    file.read_exact(&mut sizes).ok()?;
    let [a, b, c, d, sizes @ ..] = sizes;
    let packed_size = u64::from(u32::from_le_bytes([a, b, c, d]));
    if u64::from(u32::from_le_bytes(sizes)) != bytes {
        return None;
    }
    // Grows with what is there, whatever the file claims.
    let mut packed = Vec::new();
    file.take(packed_size).read_to_end(&mut packed).ok().filter(|read| *read as u64 == packed_size)?;
    let (mut packed, mut found) = (packed.into_iter(), Vec::new());
    while let Some(code) = packed.next() {
        let code = usize::from(code);
        if code < 32 {
            for _ in 0..=code {
                found.push(packed.next()?);
            }
        } else {
            let mut length = code >> 5;
            if length == 7 {
                length += usize::from(packed.next()?);
            }
            let back = ((code & 31) << 8 | usize::from(packed.next()?)) + 1;
            let start = found.len().checked_sub(back)?;
            for i in start..start + length + 2 {
                found.push(found[i]);
            }
        }
        if found.len() as u64 > bytes {
            return None;
        }
    }
    (found.len() as u64 == bytes).then_some(found)
}
