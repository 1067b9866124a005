//! Reads the positions of points in PLY files, in text and binary, with any elements and properties.

use std::io::{self, BufRead, Read};

/// The longest line of a header, in bytes.
const LONGEST: u64 = 1 << 16;

/// How the numbers are written.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Text,
    Binary { highest_first: bool },
}

/// The type of a number.
#[derive(Clone, Copy)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads a binary number.
    fn read(self, file: &mut impl Read, highest_first: bool) -> io::Result<f64> {
        let mut bytes = [0; 8];
        let own = &mut bytes[..self.bytes()];
        file.read_exact(own)?;
        if highest_first {
            own.reverse();
        }
        let bits = u64::from_le_bytes(bytes);
        Ok(match self {
            Self::I8 => f64::from(bits as i8),
            Self::U8 => f64::from(bits as u8),
            Self::I16 => f64::from(bits as i16),
            Self::U16 => f64::from(bits as u16),
            Self::I32 => f64::from(bits as i32),
            Self::U32 => f64::from(bits as u32),
            Self::F32 => f64::from(f32::from_bits(bits as u32)),
            Self::F64 => f64::from_bits(bits),
        })
    }
}

/// A property of an element.
struct Property {
    /// The axis that it is the position on, if it is one of a vertex: 0 for x, 1 for y, 2 for z.
    axis: Option<usize>,
    /// The type of the length of a list; `None` for a single number.
    length: Option<Kind>,
    /// The type of its numbers.
    kind: Kind,
}

/// Elements of one name.
struct Element {
    is_vertex: bool,
    count: u64,
    properties: Vec<Property>,
}

/// The positions of the points: those of the element `vertex`, after which nothing is read.
///
/// # Errors
/// What is wrong with the file.
pub(super) fn positions(mut file: impl BufRead) -> Result<Vec<[f64; 3]>, String> {
    let (form, elements) = header(&mut file)?;
    for element in &elements {
        if element.is_vertex {
            let axes =
                |axis| element.properties.iter().filter(|property| property.axis == Some(axis)).count();
            if (0..3).any(|axis| axes(axis) != 1) {
                return Err("is a PLY file whose points (the element vertex) lack x, y or z".into());
            }
        }
        let mut points = Vec::new();
        // Elements without properties take no bytes, whatever their number.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for row in 0..count {
            let read = match form {
                Form::Text => of_text(&mut file, element),
                Form::Binary { highest_first } => of_bytes(&mut file, element, highest_first),
            };
            let point = read.map_err(|reason| {
                let what = if element.is_vertex { "point" } else { "element" };
                format!("damaged: {what} {} of {count} {reason}", row + 1)
            })?;
            if element.is_vertex {
                points.push(point);
            }
        }
        if element.is_vertex {
            return Ok(points);
        }
    }
    Err("is a PLY file without points (the element vertex)".into())
}

/// Reads the header.
fn header(file: &mut impl BufRead) -> Result<(Form, Vec<Element>), String> {
    let (mut form, mut elements) = (None, Vec::<Element>::new());
    for number in 1.. {
        let mut line = Vec::new();
        let wrong = || format!("damaged: line {number} is no line of a PLY header");
        file.take(LONGEST).read_until(b'\n', &mut line).map_err(|_| wrong())?;
        let line = String::from_utf8_lossy(line.strip_suffix(b"\n").ok_or_else(wrong)?);
        let words: Vec<_> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(wrong()),
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, "1.0"] => {
                form = Some(match name {
                    "ascii" => Form::Text,
                    "binary_little_endian" => Form::Binary { highest_first: false },
                    "binary_big_endian" => Form::Binary { highest_first: true },
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong())?;
                elements.push(Element { is_vertex: name == "vertex", count, properties: Vec::new() });
            }
            ["property", "list", length, kind, _] => {
                let (Some(length), Some(kind)) = (Kind::of(length), Kind::of(kind)) else {
                    return Err(wrong());
                };
                let properties = &mut elements.last_mut().ok_or_else(wrong)?.properties;
                properties.push(Property { axis: None, length: Some(length), kind });
            }
            ["property", kind, name] => {
                let (Some(kind), Some(element)) = (Kind::of(kind), elements.last_mut()) else {
                    return Err(wrong());
                };
                let axis = ["x", "y", "z"].iter().position(|axis| element.is_vertex && *axis == name);
                element.properties.push(Property { axis, length: None, kind });
            }
            ["end_header"] => return Ok((form.ok_or("is a PLY file without a line `format`")?, elements)),
            _ => return Err(wrong()),
        }
    }
    unreachable!("a header of that many lines")
}

/// The position in the next line.
fn of_text(file: &mut impl BufRead, element: &Element) -> Result<[f64; 3], String> {
    let mut line = Vec::new();
    while line.trim_ascii().is_empty() {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(|_| "cannot be read")? == 0 {
            return Err("is missing".into());
        }
    }
    let line = String::from_utf8_lossy(&line);
    let mut words = line.split_ascii_whitespace();
    let mut next =
        || words.next().and_then(|word| word.parse::<f64>().ok()).ok_or("is not a line of its numbers");
    let mut point = [f64::NAN; 3];
    for property in &element.properties {
        if property.length.is_some() {
            let length = next()?;
            for _ in 0..length as u64 {
                next()?;
            }
        } else {
            let value = next()?;
            if let Some(axis) = property.axis {
                point[axis] = value;
            }
        }
    }
    Ok(point)
}

/// The position in the next bytes.
fn of_bytes(file: &mut impl Read, element: &Element, highest_first: bool) -> Result<[f64; 3], String> {
    let mut point = [f64::NAN; 3];
    for Property { axis, length, kind } in &element.properties {
        let mut next = |kind: Kind| kind.read(file, highest_first).map_err(|_| "is missing");
        if let Some(length) = length {
            // Negative lengths become 0.
            let bytes = (next(*length)? as u64).saturating_mul(kind.bytes() as u64);
            let skipped = io::copy(&mut file.take(bytes), &mut io::sink());
            if skipped.ok() != Some(bytes) {
                return Err("is missing".into());
            }
            continue;
        }
        let value = next(*kind)?;
        if let Some(axis) = axis {
            point[*axis] = value;
        }
    }
    Ok(point)
}
