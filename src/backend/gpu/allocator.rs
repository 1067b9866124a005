//! Allocation of the buffers of a match.

use super::device::Device;
use super::rows::{HALO, Rows};
use super::uniform::ALIGN_WORDS;
use crate::error::Result;

/// Usage of the buffers of stages and copies.
pub(super) const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST).union(wgpu::BufferUsages::COPY_SRC);

/// Allocates and tracks buffers.
pub(super) struct Allocator<'a> {
    pub(super) device: &'a mut Device,
    pub(super) written: Vec<wgpu::Buffer>,
    pub(super) constant: Vec<wgpu::Buffer>,
    /// Buffers whose data are no longer needed in post-processing.
    pub(super) spare: Vec<wgpu::Buffer>,
}

impl<'a> Allocator<'a> {
    pub(super) fn new(device: &'a mut Device) -> Self {
        Self { device, written: Vec::new(), constant: Vec::new(), spare: Vec::new() }
    }

    /// A buffer that matches write.
    pub(super) fn buffer(&mut self, label: &str, words: u64) -> Result<wgpu::Buffer> {
        let buffer = self.allocate(label, words, USAGE)?;
        self.written.push(buffer.clone());
        Ok(buffer)
    }

    /// The smallest spare buffer of at least `words` words, or else a new buffer that matches write.
    pub(super) fn spare_or_new(&mut self, label: &str, words: u64) -> Result<wgpu::Buffer> {
        let fits = |(_, buffer): &(usize, &wgpu::Buffer)| buffer.size() >= 4 * words;
        let spare = self.spare.iter().enumerate().filter(fits).min_by_key(|(_, buffer)| buffer.size());
        match spare.map(|(at, _)| at) {
            Some(at) => Ok(self.spare.swap_remove(at)),
            None => self.buffer(label, words),
        }
    }

    /// A buffer with constant contents.
    pub(super) fn constant(&mut self, label: &str, words: &[u32]) -> Result<wgpu::Buffer> {
        let buffer = self.allocate(label, words.len() as u64, USAGE)?;
        self.device.write(&buffer, bytemuck::cast_slice(words))?;
        self.constant.push(buffer.clone());
        Ok(buffer)
    }

    pub(super) fn allocate(
        &self,
        label: &str,
        words: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer> {
        let size = (4 * words).max(4 * ALIGN_WORDS as u64);
        let largest = self.device.max_buffer;
        if size > largest {
            return Err(self.device.too_large(format!("the {label}"), size, largest));
        }
        let buffer = self.device.buffer(label, size, usage)?;
        self.device.check()?;
        Ok(buffer)
    }

    /// Rows of `words` words each, in parts that start at `starts`, whose last element is the height.
    pub(super) fn rows(&mut self, label: &str, words: u32, starts: &[u32]) -> Result<Rows> {
        Rows::in_parts(words, starts, |_, rows| self.buffer(label, u64::from(words) * rows))
    }

    /// Like `rows`, with memory for `count` parts at a time.
    pub(super) fn ring(&mut self, label: &str, words: u32, starts: &[u32], count: usize) -> Result<Rows> {
        let rows = u64::from(starts[1] - starts[0] + 2 * HALO);
        let buffers = starts[1..].iter().take(count).map(|_| self.buffer(label, u64::from(words) * rows));
        let buffers: Vec<_> = buffers.collect::<Result<_>>()?;
        Rows::in_parts(words, starts, |i, _| Ok(buffers[i % count].clone()))
    }
}
