//! Data stored by row on a device, and their bindings.
//!
//! Data larger than the device's largest buffer are split into parts of whole rows. Each part also has a
//! halo: a few rows of its neighbours, so that stages find the neighbourhood of a pixel in one part. Stages
//! that write data with a halo copy these rows at the end. If only some rows are held, several parts share a
//! buffer in turn.

use super::device::Device;
use crate::error::Result;
use crate::plan::GRAPH_WINDOW;
use std::num::NonZero;
use std::ops::Range;

/// Halo of a part, in rows on either side: the largest neighbourhood that a stage reads in a volume.
pub(super) const HALO: u32 = GRAPH_WINDOW as u32 / 2;

/// `rows` with up to `halo` rows above and below.
pub(super) fn with_halo(rows: &Range<u32>, halo: u32, height: u32) -> Range<u32> {
    rows.start.saturating_sub(halo)..rows.end.saturating_add(halo).min(height)
}

/// The intersection of two ranges of rows.
pub(super) fn common(a: &Range<u32>, b: &Range<u32>) -> Range<u32> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// Data stored by row, in as few buffers as the device allows.
#[derive(Clone)]
pub(super) struct Rows {
    parts: Vec<Part>,
    row_bytes: u64,
}

#[derive(Clone)]
struct Part {
    buffer: wgpu::Buffer,
    /// Rows that belong to this part only.
    own: Range<u32>,
    /// Rows stored in it, halo included.
    held: Range<u32>,
    /// Offset of these in the buffer, in bytes.
    offset: u64,
}

impl Part {
    /// Offset of `row` in the buffer, in bytes.
    fn at(&self, row: u32, row_bytes: u64) -> u64 {
        self.offset + u64::from(row - self.held.start) * row_bytes
    }
}

/// A range of a buffer to bind, at a byte offset that is a multiple of 256.
#[derive(Clone)]
pub(super) struct Binding {
    buffer: wgpu::Buffer,
    bytes: Range<u64>,
}

impl Binding {
    pub(super) fn whole(buffer: &wgpu::Buffer) -> Self {
        Self { buffer: buffer.clone(), bytes: 0..buffer.size() }
    }

    /// Number of bound bytes.
    pub(super) fn size(&self) -> u64 {
        let end = self.bytes.end.min(self.buffer.size());
        end.saturating_sub(self.bytes.start)
    }

    pub(super) fn resource(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.buffer,
            offset: self.bytes.start,
            size: NonZero::new(self.size()),
        })
    }
}

/// A copy of bytes from one buffer to another.
#[derive(Clone)]
pub(super) struct Copy {
    pub(super) from: (wgpu::Buffer, u64),
    pub(super) to: (wgpu::Buffer, u64),
    pub(super) bytes: u64,
}

impl Rows {
    /// Rows of `words` words each, in parts that start at `starts`, whose last element is the height.
    /// `allocate` returns the buffer of a part by index, for a number of rows.
    pub(super) fn in_parts(
        words: u32,
        starts: &[u32],
        mut allocate: impl FnMut(usize, u64) -> Result<wgpu::Buffer>,
    ) -> Result<Self> {
        let height = starts[starts.len() - 1];
        let parts = starts.windows(2).enumerate().map(|(i, ends)| {
            let own = ends[0]..ends[1];
            let held = with_halo(&own, HALO, height);
            let buffer = allocate(i, held.len() as u64)?;
            Ok(Part { buffer, own, held, offset: 0 })
        });
        Ok(Self { parts: parts.collect::<Result<_>>()?, row_bytes: 4 * u64::from(words) })
    }

    /// One row of `words` words, in a buffer of its own.
    pub(super) fn of(buffer: wgpu::Buffer, words: u32) -> Self {
        let part = Part { buffer, own: 0..1, held: 0..1, offset: 0 };
        Self { parts: vec![part], row_bytes: 4 * u64::from(words) }
    }

    /// Rows of `words` words each, at most as many as here, in the same memory, which is in one part.
    pub(super) fn with_words(&self, words: u32) -> Self {
        Self { parts: self.parts.clone(), row_bytes: 4 * u64::from(words) }
    }

    /// Binds `rows` of one part, which may be in its halo.
    pub(super) fn bind(&self, rows: &Range<u32>) -> Binding {
        let within = |outer: &Range<u32>| outer.start <= rows.start && rows.end <= outer.end;
        let part = self.parts.iter().find(|p| within(&p.own)).or(self.parts.iter().find(|p| within(&p.held)));
        let part = part.expect("bands stay within parts, and halos within what parts hold");
        let at = |row: u32| part.at(row, self.row_bytes);
        Binding { buffer: part.buffer.clone(), bytes: at(rows.start)..at(rows.end) }
    }

    /// Binds the whole buffer of its first part, including other data.
    pub(super) fn whole(&self) -> Binding {
        Binding::whole(&self.parts[0].buffer)
    }

    /// Copies of `written` rows to the halos of other parts.
    pub(super) fn exchange(&self, written: &Range<u32>) -> Vec<Copy> {
        let mut copies = Vec::new();
        for (i, to) in self.parts.iter().enumerate() {
            // The smallest parts have two rows, so halos reach the part after the next.
            for (j, from) in self.parts.iter().enumerate().take(i + 3).skip(i.saturating_sub(2)) {
                let rows = common(&common(&to.held, &from.own), written);
                if i != j && !rows.is_empty() {
                    let at = |part: &Part| part.at(rows.start, self.row_bytes);
                    copies.push(Copy {
                        from: (from.buffer.clone(), at(from)),
                        to: (to.buffer.clone(), at(to)),
                        bytes: rows.len() as u64 * self.row_bytes,
                    });
                }
            }
        }
        copies
    }

    /// Copies of all rows to `to`, which has the same rows.
    pub(super) fn copy_to(&self, to: &Self) -> Vec<Copy> {
        let pairs = self.parts.iter().zip(&to.parts);
        pairs
            .map(|(from, to)| Copy {
                from: (from.buffer.clone(), from.offset),
                to: (to.buffer.clone(), to.offset),
                bytes: from.held.len() as u64 * self.row_bytes,
            })
            .collect()
    }

    /// Copies of all rows from `buffer`, which holds them one after the other.
    pub(super) fn copy_from(&self, buffer: &wgpu::Buffer) -> Vec<Copy> {
        let copies = self.parts.iter().map(|part| Copy {
            from: (buffer.clone(), u64::from(part.held.start) * self.row_bytes),
            to: (part.buffer.clone(), part.offset),
            bytes: part.held.len() as u64 * self.row_bytes,
        });
        copies.collect()
    }

    /// Bytes of a row.
    pub(super) fn row_bytes(&self) -> u64 {
        self.row_bytes
    }

    /// Number of rows.
    pub(super) fn height(&self) -> u32 {
        self.parts.last().map_or(0, |part| part.own.end)
    }

    /// First row of each part.
    pub(super) fn starts(&self) -> impl Iterator<Item = u32> {
        self.parts.iter().map(|p| p.own.start)
    }

    pub(super) fn buffers(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        self.parts.iter().map(|p| &p.buffer)
    }

    /// Each part's buffer, and the byte range of its own rows in it.
    pub(super) fn own(&self) -> Vec<(wgpu::Buffer, Range<u64>)> {
        let at = |p: &Part, row: u32| p.at(row, self.row_bytes);
        self.parts.iter().map(|p| (p.buffer.clone(), at(p, p.own.start)..at(p, p.own.end))).collect()
    }

    /// Each part's buffer, and the byte range of all its rows in it.
    pub(super) fn held(&self) -> impl Iterator<Item = (&wgpu::Buffer, Range<u64>)> {
        let at = |p: &Part, row: u32| p.at(row, self.row_bytes);
        self.parts.iter().map(move |p| (&p.buffer, at(p, p.held.start)..at(p, p.held.end)))
    }

    /// Offset of the first row in its buffer, in elements of `bytes` bytes.
    pub(super) fn start(&self, bytes: u64) -> u32 {
        (self.parts[0].offset / bytes) as u32
    }

    /// Writes the words of all rows.
    pub(super) fn write(&self, device: &mut Device, words: &[u32]) -> Result<()> {
        let per_row = self.row_bytes as usize / 4;
        for part in &self.parts {
            let held = part.held.start as usize * per_row..part.held.end as usize * per_row;
            device.write_at(&part.buffer, part.offset, bytemuck::cast_slice(&words[held]))?;
        }
        Ok(())
    }
}

/// One buffer for several levels, coarsest first.
pub(super) struct Pool {
    pub(super) buffer: wgpu::Buffer,
    /// Words in use.
    taken: u64,
}

impl Pool {
    pub(super) fn new(buffer: wgpu::Buffer) -> Self {
        Self { buffer, taken: 0 }
    }

    /// The next `height` rows of `words` words each.
    pub(super) fn rows(&mut self, words: u32, height: u32) -> Rows {
        let (all, offset) = (0..height, 4 * self.taken);
        self.taken += u64::from(words) * u64::from(height);
        let part = Part { buffer: self.buffer.clone(), own: all.clone(), held: all, offset };
        Rows { parts: vec![part], row_bytes: 4 * u64::from(words) }
    }
}
