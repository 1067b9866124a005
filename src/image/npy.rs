//! Arrays of NumPy: `.npy`, and `.npz` with a single array.

use std::io::Read;

use flate2::Crc;
use flate2::read::DeflateDecoder;
use half::f16;

use super::file::{self, damaged};
use super::raster::{Raster, Samples};
use crate::error::ReadError;
use crate::memory;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Signatures in a ZIP archive (`.npz`): of a file, of an entry of the file list, and of its end.
const ARCHIVE: &[u8] = b"PK\x03\x04";
const ENTRY: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
/// Longest accepted header; headers of plain arrays have less than 200 bytes.
const MOST_HEADER: usize = 1 << 16;

pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

pub(super) fn is_npz(bytes: &[u8]) -> bool {
    bytes.starts_with(ARCHIVE)
}

/// Decodes an array of rows of pixels, of single numbers or of 1 to 4 channels.
pub(super) fn decode(bytes: &[u8], max_pixels: u64) -> Result<Raster<'static>, ReadError> {
    let header = Header::parse(bytes)?;
    let (size, channels) = header.image()?;
    file::check_size(size.0 as u64, size.1 as u64, max_pixels)?;
    let count = size.0 * size.1 * channels;
    let width = header.kind.bytes();
    let data = bytes.get(header.length..).unwrap_or_default();
    if data.len() as u64 / (width as u64) < count as u64 {
        return Err(format!(
            "truncated: {} x {} pixels need {} bytes of data and {} are there; get the file again",
            size.0,
            size.1,
            count as u64 * width as u64,
            data.len()
        )
        .into());
    }
    // The steps from one row, column and channel to the next.
    let steps =
        if header.by_columns { [1, size.1, size.0 * size.1] } else { [size.0 * channels, channels, 1] };
    let places = (0..size.1).flat_map(move |y| {
        (0..size.0).flat_map(move |x| (0..channels).map(move |c| y * steps[0] + x * steps[1] + c * steps[2]))
    });
    let values = places.map(|place| &data[place * width..][..width]);
    let samples = header.kind.samples(values, count, header.highest_first)?;
    Ok(Raster::of(size, channels, samples))
}

/// (width, height) by the header of an array.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn size(bytes: &[u8], max_pixels: u64) -> Result<(usize, usize), ReadError> {
    let (size, _) = Header::parse(bytes)?.image()?;
    file::check_size(size.0 as u64, size.1 as u64, max_pixels)?;
    Ok(size)
}

/// Decodes the only array of an archive.
pub(super) fn decode_archive(bytes: &[u8], max_pixels: u64) -> Result<Raster<'static>, ReadError> {
    decode(&only_array(bytes, max_pixels)?, max_pixels)
}

/// The number type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bool,
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Kind {
    fn parse(word: &str) -> Option<Self> {
        let (kind, bytes) = word.split_at_checked(1)?;
        let bytes = bytes.parse().ok()?;
        match (kind, bytes) {
            ("b", 1) => Some(Self::Bool),
            ("i", 1 | 2 | 4 | 8) => Some(Self::Signed(bytes)),
            ("u", 1 | 2 | 4 | 8) => Some(Self::Unsigned(bytes)),
            ("f", 2 | 4 | 8) => Some(Self::Float(bytes)),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Bool => 1,
            Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Float(bytes) => bytes,
        }
    }

    /// Converts `values`, of which there are `count`, to samples.
    fn samples<'a>(
        self,
        values: impl Iterator<Item = &'a [u8]>,
        count: usize,
        highest_first: bool,
    ) -> Result<Samples<'static>, ReadError> {
        fn all<S>(values: impl Iterator<Item = S>, count: usize) -> Result<Vec<S>, ReadError> {
            let mut out = memory::reserved(count)?;
            out.extend(values);
            Ok(out)
        }
        // The bits of each number in native order.
        let bits = values.map(|value| {
            let add = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
            if highest_first { value.iter().fold(0, add) } else { value.iter().rev().fold(0, add) }
        });
        Ok(match self {
            Self::Bool => Samples::Byte(all(bits.map(|v| if v == 0 { 0 } else { 255 }), count)?.into()),
            Self::Unsigned(1) => Samples::Byte(all(bits.map(|v| v as u8), count)?.into()),
            Self::Unsigned(2) => Samples::Word(all(bits.map(|v| v as u16), count)?.into()),
            Self::Unsigned(_) => Samples::Double(all(bits.map(|v| v as f64), count)?.into()),
            Self::Signed(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                let value = |v: u64| ((v << unused) as i64 >> unused) as f64;
                Samples::Double(all(bits.map(value), count)?.into())
            }
            Self::Float(2) => {
                Samples::Float(all(bits.map(|v| f16::from_bits(v as u16).to_f32()), count)?.into())
            }
            Self::Float(4) => Samples::Float(all(bits.map(|v| f32::from_bits(v as u32)), count)?.into()),
            Self::Float(_) => Samples::Double(all(bits.map(f64::from_bits), count)?.into()),
        })
    }
}

/// The header of an array.
struct Header {
    kind: Kind,
    highest_first: bool,
    /// Whether columns, not rows, are contiguous (Fortran order).
    by_columns: bool,
    shape: Vec<usize>,
    /// Its length in bytes.
    length: usize,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, ReadError> {
        let cut = || damaged("the header of the array is cut off");
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(cut)?;
        let (start, length) = match rest {
            [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([*a, *b]))),
            [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize),
            [version, ..] => {
                return Err(format!(
                    "is an array in version {version} of .npy, and 1 to 3 are read; save it again"
                )
                .into());
            }
            [] => return Err(cut()),
        };
        if length > MOST_HEADER {
            return Err(damaged(format!("the header of the array claims {length} bytes")));
        }
        let text = bytes.get(start..start + length).ok_or_else(cut)?;
        let text = String::from_utf8_lossy(text);
        let value = |key: &str| {
            let at = text.find(&format!("'{key}':"))? + key.len() + 3;
            Some(text[at..].trim_start())
        };
        let wrong = || damaged("the header of the array makes no sense");
        // Structured types begin with a bracket.
        let kind = value("descr").ok_or_else(wrong)?;
        let kind = kind.strip_prefix('\'').and_then(|kind| kind.split('\'').next()).unwrap_or("a structure");
        let (order, word) = kind.split_at(kind.len().min(1));
        let Some(known) = Kind::parse(word).filter(|_| ["<", ">", "|", "="].contains(&order)) else {
            let kind: String = kind.chars().filter(|c| !c.is_control()).take(20).collect();
            return Err(
                format!("is an array of {kind}; save it as float32: array.astype(\"float32\")").into()
            );
        };
        let shape =
            value("shape").and_then(|shape| shape.strip_prefix('(')?.split(')').next()).ok_or_else(wrong)?;
        let shape = shape.split(',').map(str::trim).filter(|length| !length.is_empty());
        let shape = shape.map(|length| length.parse::<u32>().map(|length| length as usize));
        Ok(Self {
            kind: known,
            highest_first: order == ">",
            by_columns: value("fortran_order").is_some_and(|value| value.starts_with("True")),
            shape: shape.collect::<Result<_, _>>().map_err(|_| wrong())?,
            length: start + length,
        })
    }

    /// (width, height) and the number of channels of the image. Leading lengths of 1, such as a batch of one, are dropped.
    fn image(&self) -> Result<((usize, usize), usize), ReadError> {
        let mut shape = &self.shape[..];
        while let [1, rest @ ..] = shape
            && (shape.len() > 3 || shape.len() == 3 && shape[2] > 4)
        {
            shape = rest;
        }
        match *shape {
            [height, width] => Ok(((width, height), 1)),
            [height, width, channels @ 1..=4] => Ok(((width, height), channels)),
            _ => {
                let shape: Vec<_> = self.shape.iter().map(ToString::to_string).collect();
                Err(format!(
                    "is an array of the shape ({}), and an image has the shape (height, width) or (height, width, channels)",
                    shape.join(", ")
                )
                .into())
            }
        }
    }
}

/// The bytes of the only file in an archive.
fn only_array(bytes: &[u8], max_pixels: u64) -> Result<Vec<u8>, ReadError> {
    let cut = || damaged("the archive is cut off: its list of files is missing");
    let short = |bytes: &[u8], at: usize| {
        bytes.get(at..at + 2).map(|v| usize::from(u16::from_le_bytes([v[0], v[1]])))
    };
    let long = |bytes: &[u8], at: usize| {
        bytes.get(at..at + 4).map(|v| u32::from_le_bytes([v[0], v[1], v[2], v[3]]) as usize)
    };
    let end = bytes.windows(4).rposition(|window| window == END).ok_or_else(cut)?;
    let mut at = long(bytes, end + 16).ok_or_else(cut)?;
    let mut entries = Vec::new();
    while bytes.get(at..at + 4) == Some(ENTRY) {
        let entry = &bytes[at..];
        let part = || {
            let [name, extra, comment] = [short(entry, 28)?, short(entry, 30)?, short(entry, 32)?];
            Some((entry.get(46..46 + name)?, 46 + name + extra + comment))
        };
        let (name, length) = part().ok_or_else(cut)?;
        let name: String =
            String::from_utf8_lossy(name).chars().filter(|c| !c.is_control()).take(40).collect();
        entries.push((name, entry));
        at += length;
    }
    let entry = match &entries[..] {
        [(_, entry)] => entry,
        [] => return Err(cut()),
        _ => {
            let names: Vec<_> =
                entries.iter().take(12).map(|(name, _)| name.trim_end_matches(".npy")).collect();
            return Err(format!(
                "holds several arrays ({}); save the one that counts by numpy.save as .npy",
                names.join(", ")
            )
            .into());
        }
    };
    let fields = || {
        Some((short(entry, 10)?, long(entry, 16)?, [long(entry, 20)?, long(entry, 24)?], long(entry, 42)?))
    };
    let (method, crc, [packed, size], start) = fields().ok_or_else(cut)?;
    let body = || {
        // The local header may be longer than the entry in the list.
        let start = start + 30 + short(bytes, start + 26)? + short(bytes, start + 28)?;
        bytes.get(start..start.checked_add(packed)?)
    };
    let body = body().ok_or_else(|| damaged("the archive is cut off"))?;
    let most = file::max_bytes_of(max_pixels).min(size as u64);
    let mut out = Vec::new();
    let read = match method {
        0 => body.take(most).read_to_end(&mut out),
        8 => DeflateDecoder::new(body).take(most).read_to_end(&mut out),
        _ => return Err("is packed in another way than numpy.savez does it; save the array as .npy".into()),
    };
    read.map_err(damaged)?;
    let mut sum = Crc::new();
    sum.update(&out);
    if out.len() != size || sum.sum() as usize != crc {
        return Err(damaged("the archive's checksum does not agree"));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::raster::Sample;
    use super::*;
    use std::io::Write;

    const MANY: u64 = 1 << 20;

    /// An array as NumPy writes it.
    fn npy(kind: &str, by_columns: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let order = if by_columns { "True" } else { "False" };
        let text = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        [MAGIC, &[1, 0], &(text.len() as u16).to_le_bytes(), text.as_bytes(), data].concat()
    }

    /// An archive of arrays, packed or not.
    fn npz(arrays: &[(&str, &[u8])], packs: bool) -> Vec<u8> {
        let (mut out, mut list) = (Vec::new(), Vec::new());
        for (name, array) in arrays {
            let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(array).unwrap();
            let body = if packs { encoder.finish().unwrap() } else { array.to_vec() };
            let mut sum = Crc::new();
            sum.update(array);
            let start = (out.len() as u32).to_le_bytes();
            let method = [if packs { 8 } else { 0 }, 0];
            let sizes = [sum.sum(), body.len() as u32, array.len() as u32].map(u32::to_le_bytes).concat();
            let name_length = (name.len() as u16).to_le_bytes();
            // NumPy reserves room for large sizes only in the local header.
            out.extend(
                [ARCHIVE, &[45, 0, 0, 0], &method, &[0; 4], &sizes, &name_length, &[20, 0], name.as_bytes()]
                    .concat(),
            );
            out.extend([0; 20]);
            out.extend(body);
            list.extend(
                [ENTRY, &[45, 3, 45, 0, 0, 0], &method, &[0; 4], &sizes, &name_length, &[0; 12], &start]
                    .concat(),
            );
            list.extend(name.as_bytes());
        }
        let places = [list.len() as u32, out.len() as u32].map(u32::to_le_bytes).concat();
        out.extend(list);
        out.extend([END, &[0; 8], &places, &[0; 2]].concat());
        out
    }

    fn doubles(raster: &Raster) -> Vec<f64> {
        super::super::raster::of_any!(raster.samples(), v => v.iter().map(|v| v.double()).collect())
    }

    /// -1, 2, 3, 4, 5, 6 in two rows of three, as far as the type can represent them.
    #[test]
    fn numbers_of_all_kinds_are_read() {
        let values = [-1_i64, 2, 3, 4, 5, 6];
        let bytes = |each: &dyn Fn(i64) -> Vec<u8>| values.iter().flat_map(|v| each(*v)).collect::<Vec<u8>>();
        let signed: Vec<f64> = values.iter().map(|v| *v as f64).collect();
        for (kind, data) in [
            ("<i1", bytes(&|v| vec![v as u8])),
            ("<i2", bytes(&|v| (v as i16).to_le_bytes().into())),
            (">i4", bytes(&|v| (v as i32).to_be_bytes().into())),
            ("<i8", bytes(&|v| v.to_le_bytes().into())),
            ("<f2", bytes(&|v| f16::from_f32(v as f32).to_le_bytes().into())),
            ("<f4", bytes(&|v| (v as f32).to_le_bytes().into())),
            (">f4", bytes(&|v| (v as f32).to_be_bytes().into())),
            ("<f8", bytes(&|v| (v as f64).to_le_bytes().into())),
        ] {
            let raster = decode(&npy(kind, false, "(2, 3)", &data), MANY).unwrap();
            assert_eq!(
                (raster.size(), raster.channels(), doubles(&raster)),
                ((3, 2), 1, signed.clone()),
                "{kind}"
            );
        }
        for (kind, first, data) in [
            ("|u1", 255.0, bytes(&|v| vec![v as u8])),
            (">u2", 65535.0, bytes(&|v| (v as u16).to_be_bytes().into())),
            ("<u4", 4_294_967_295.0, bytes(&|v| (v as u32).to_le_bytes().into())),
        ] {
            let raster = decode(&npy(kind, false, "(2, 3)", &data), MANY).unwrap();
            assert_eq!(doubles(&raster), [first, 2.0, 3.0, 4.0, 5.0, 6.0], "{kind}");
        }
        let raster = decode(&npy("|b1", false, "(1, 2)", &[0, 1]), MANY).unwrap();
        assert_eq!(doubles(&raster), [0.0, 255.0]);
    }

    #[test]
    fn shapes_of_images_are_read() {
        let data: Vec<u8> = (0..12).collect();
        let read = |by_columns, shape| {
            let raster = decode(&npy("|u1", by_columns, shape, &data), MANY).unwrap();
            (
                raster.size(),
                raster.channels(),
                doubles(&raster).into_iter().map(|v| v as u8).collect::<Vec<_>>(),
            )
        };
        assert_eq!(read(false, "(2, 6)"), ((6, 2), 1, data.clone()));
        assert_eq!(read(true, "(2, 6)"), ((6, 2), 1, vec![0, 2, 4, 6, 8, 10, 1, 3, 5, 7, 9, 11]));
        assert_eq!(read(false, "(2, 2, 3)"), ((2, 2), 3, data.clone()));
        assert_eq!(read(true, "(2, 2, 3)"), ((2, 2), 3, vec![0, 4, 8, 2, 6, 10, 1, 5, 9, 3, 7, 11]));
        assert_eq!(read(false, "(1, 2, 6)"), ((6, 2), 1, data.clone()));
        assert_eq!(read(false, "(1, 1, 2, 6)"), ((6, 2), 1, data.clone()));
        for (shape, words) in
            [("(12,)", "(12)"), ("()", "()"), ("(3, 2, 2, 1)", "(3, 2, 2, 1)"), ("(0, 3)", "no pixel")]
        {
            let said = decode(&npy("|u1", false, shape, &data), MANY).unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }

    #[test]
    fn archives_of_one_array_are_read() {
        let array = npy("<f4", false, "(1, 2)", &[1.5_f32, -2.0].map(f32::to_le_bytes).concat());
        for packs in [false, true] {
            let whole = npz(&[("arr_0.npy", &array)], packs);
            assert!(is_npz(&whole));
            assert_eq!(doubles(&decode_archive(&whole, MANY).unwrap()), [1.5, -2.0]);
            for length in 0..whole.len() - 22 {
                assert!(decode_archive(&whole[..length], MANY).is_err(), "{length}");
            }
            // A byte of the array, after the header of the archive.
            let mut damaged = whole.clone();
            damaged[80] ^= 1;
            assert!(decode_archive(&damaged, MANY).is_err());
        }
        let said =
            decode_archive(&npz(&[("left.npy", &array), ("right.npy", &array)], false), MANY).unwrap_err();
        assert!(said.to_string().contains("holds several arrays (left, right)"), "{said}");
    }

    #[test]
    fn hostile_arrays_are_refused() {
        let data = [0; 24];
        for (bytes, words) in [
            (npy("<c8", false, "(1, 3)", &data), "array of <c8; save it as float32"),
            (npy("|O", false, "(1, 3)", &data), "array of |O"),
            (npy("<f4", false, "(1, 7)", &data), "need 28 bytes of data and 24 are there"),
            (npy("<f4", false, "(4294967295, 4294967295)", &data), "at most"),
            (npy("<f4", false, "(99999999999, 1)", &data), "makes no sense"),
            (npy("<f4", false, "(-1, 1)", &data), "makes no sense"),
            ([MAGIC, &[9, 0, 1, 0]].concat(), "version 9"),
            ([MAGIC, &[2, 0, 255, 255, 255, 255]].concat(), "claims 4294967295 bytes"),
            (MAGIC.to_vec(), "cut off"),
        ] {
            let said = decode(&bytes, MANY).unwrap_err().to_string();
            assert!(said.contains(words) && said.len() < 200, "{said}");
        }
        let whole = npy("<f4", false, "(2, 3)", &data);
        (0..whole.len()).for_each(|length| assert!(decode(&whole[..length], MANY).is_err(), "{length}"));
    }
}
