//! Serialization of numbers, texts and lists.

use std::borrow::Cow;

use super::basics::{Encoding, Result, SECOND, Stamp};

/// Length of the header of a CDR message, which states its byte order.
const HEAD: usize = 4;

/// Decodes a message. Allocations are bounded by the message's size.
pub(super) struct Decoder<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
    highest_first: bool,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(bytes: &'a [u8], encoding: Encoding) -> Result<Self> {
        let (bytes, highest_first) = match (encoding, bytes) {
            (Encoding::Ros1, bytes) => (bytes, false),
            (Encoding::Cdr, [0, kind @ (0 | 1), _, _, content @ ..]) => (content, *kind == 0),
            (Encoding::Cdr, [a, b, _, _, ..]) => {
                return Err(
                    format!("has the encapsulation {a:#04x} {b:#04x}, which is not ROS 2's CDR").into()
                );
            }
            (Encoding::Cdr, bytes) => {
                return Err(format!("has {} bytes, but at least 4 are needed", bytes.len()).into());
            }
        };
        Ok(Self { bytes, at: 0, encoding, highest_first })
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let left = &self.bytes[self.at.min(self.bytes.len())..];
        let Some(taken) = left.get(..count) else {
            return Err(format!("ends early: {count} bytes should follow, but only {} do", left.len()).into());
        };
        self.at += count;
        Ok(taken)
    }

    /// A number of `N` bytes, least significant first.
    fn number<const N: usize>(&mut self) -> Result<[u8; N]> {
        if self.encoding == Encoding::Cdr {
            self.at = self.at.next_multiple_of(N);
        }
        let mut number = [0; N];
        number.copy_from_slice(self.take(N)?);
        if self.highest_first {
            number.reverse();
        }
        Ok(number)
    }

    pub(super) fn u8(&mut self) -> Result<u8> {
        self.number::<1>().map(|[v]| v)
    }

    pub(super) fn u32(&mut self) -> Result<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn double(&mut self) -> Result<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[f64; N]> {
        let mut all = [0.0; N];
        for v in &mut all {
            *v = self.double()?;
        }
        Ok(all)
    }

    pub(super) fn doubles(&mut self) -> Result<Vec<f64>> {
        let count = self.u32()?;
        // Grows with the actual data, not the claimed count.
        (0..count).map(|_| self.double()).collect()
    }

    /// A list of bytes.
    pub(super) fn list(&mut self) -> Result<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    pub(super) fn string(&mut self) -> Result<Cow<'a, str>> {
        let bytes = self.list()?;
        // ROS 2 includes the terminating 0.
        let text =
            if self.encoding == Encoding::Cdr { bytes.strip_suffix(&[0]).unwrap_or(bytes) } else { bytes };
        Ok(String::from_utf8_lossy(text))
    }

    /// The time of a header, after the sequence number of ROS 1.
    pub(super) fn stamp(&mut self) -> Result<Stamp> {
        let seconds = if self.encoding == Encoding::Ros1 {
            let _sequence = self.u32()?;
            i64::from(self.u32()?)
        } else {
            i64::from(self.u32()? as i32)
        };
        Ok(Stamp(seconds * SECOND + i64::from(self.u32()?)))
    }
}

/// Encodes a message as little-endian CDR.
pub(super) struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    /// An encoder with capacity for this many bytes of data and the other fields.
    pub(super) fn with_room_for(data: usize) -> Self {
        let mut bytes = Vec::with_capacity(data + 512);
        bytes.extend([0, 1, 0, 0]);
        Self { bytes }
    }

    fn number<const N: usize>(&mut self, number: [u8; N]) {
        let end = HEAD + (self.bytes.len() - HEAD).next_multiple_of(N);
        self.bytes.resize(end, 0);
        self.bytes.extend(number);
    }

    pub(super) fn u8(&mut self, v: u8) {
        self.bytes.push(v);
    }

    pub(super) fn u32(&mut self, v: u32) {
        self.number(v.to_le_bytes());
    }

    pub(super) fn f32(&mut self, v: f32) {
        self.number(v.to_le_bytes());
    }

    pub(super) fn doubles(&mut self, values: &[f64]) {
        for v in values {
            self.number(v.to_le_bytes());
        }
    }

    pub(super) fn list(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
    }

    /// Bytes of fixed length.
    pub(super) fn array(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    pub(super) fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend(text.as_bytes());
        self.u8(0);
    }

    pub(super) fn stamp(&mut self, Stamp(all): Stamp) {
        self.u32(all.div_euclid(SECOND) as i32 as u32);
        self.u32(all.rem_euclid(SECOND) as u32);
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}
