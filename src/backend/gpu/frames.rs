//! Matches on the device of a caller: frames that are there already, and commands that the caller submits.

use super::device::Device;
use super::stages::Unpacking;
use super::{Gpu, State, uploaded_rows, uploaded_words};
use crate::backend::Map;
use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::stage::Data;
pub use ::wgpu;

/// A view on a device, in 8 bits per channel. Alpha counts for nothing.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Frame {
    /// A texture with the usage `COPY_SRC`, in RGBA or BGRA with 8 bits per channel, sRGB or not: the bytes
    /// count as they are. Its first layer and mip level are matched.
    Texture(wgpu::Texture),
    /// A buffer with the usage `COPY_SRC`.
    Buffer {
        /// The buffer.
        buffer: wgpu::Buffer,
        /// Offset of the first pixel, in bytes; a multiple of 4.
        offset: u64,
        /// Bytes from row to row; a multiple of 4.
        bytes_per_row: u64,
        /// Whether a pixel is blue, green, red, alpha; otherwise red, green, blue, alpha.
        is_bgra: bool,
    },
}

impl Frame {
    /// Whether a pixel is blue, green, red, alpha.
    fn is_bgra(&self) -> bool {
        use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb};
        match self {
            Self::Texture(texture) => matches!(texture.format(), Bgra8Unorm | Bgra8UnormSrgb),
            Self::Buffer { is_bgra, .. } => *is_bgra,
        }
    }

    /// Refuses a frame that does not hold (width, height) pixels in a known format.
    fn check(&self, (width, height): (usize, usize)) -> std::result::Result<(), String> {
        use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, Rgba8Uint, Rgba8Unorm, Rgba8UnormSrgb};
        match self {
            Self::Texture(texture) => {
                let (format, size) =
                    (texture.format(), (texture.width() as usize, texture.height() as usize));
                if !matches!(format, Bgra8Unorm | Bgra8UnormSrgb | Rgba8Uint | Rgba8Unorm | Rgba8UnormSrgb) {
                    return Err(format!("a texture in {format:?}; give RGBA or BGRA in 8 bits"));
                }
                if size != (width, height) {
                    return Err(format!(
                        "a texture of {} x {} pixels, not {width} x {height}",
                        size.0, size.1
                    ));
                }
                if !texture.usage().contains(wgpu::TextureUsages::COPY_SRC) {
                    return Err("a texture without the usage COPY_SRC".into());
                }
            }
            Self::Buffer { buffer, offset, bytes_per_row, .. } => {
                let row = 4 * width as u64;
                let end = bytes_per_row
                    .checked_mul(height as u64 - 1)
                    .and_then(|end| end.checked_add(offset + row));
                if offset % 4 != 0 || bytes_per_row % 4 != 0 || *bytes_per_row < row {
                    return Err(format!(
                        "rows of {bytes_per_row} bytes from {offset}; a row takes {row}, and both must be multiples of 4"
                    ));
                }
                if end.is_none_or(|end| end > buffer.size()) {
                    return Err(format!(
                        "a buffer of {} bytes, too few for {width} x {height} pixels",
                        buffer.size()
                    ));
                }
                if !buffer.usage().contains(wgpu::BufferUsages::COPY_SRC) {
                    return Err("a buffer without the usage COPY_SRC".into());
                }
            }
        }
        Ok(())
    }
}

/// A map on a device: 32-bit words in rows. The next match overwrites it.
#[derive(Clone, Debug)]
pub struct DeviceMap {
    /// The buffer, with the usages `STORAGE`, `COPY_SRC` and `COPY_DST`.
    pub buffer: wgpu::Buffer,
    /// Offset of the first pixel, in bytes; a multiple of 256.
    pub offset: u64,
    /// Bytes from row to row; a multiple of 256.
    pub bytes_per_row: u64,
}

impl Gpu {
    /// Uses a device that is open already, and its queue. Its handlers for errors and for its loss stay as they
    /// are. It needs no features, and the default limits of WebGPU; larger buffers and bindings allow larger pairs.
    #[must_use]
    pub fn from_wgpu(info: &wgpu::AdapterInfo, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self::on(Device::of_caller(info, device, queue))
    }

    /// Loads the views of a match by `plan`, which are (width, height) pixels large. Nothing is submitted:
    /// [`Self::take_commands`] returns the commands.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for frames of another size or form, and those of [`prepare`](crate::backend::Backend::prepare).
    pub(crate) fn prepare_frames(
        &mut self,
        plan: &Plan,
        frames: [&Frame; 2],
        size: (usize, usize),
    ) -> Result<()> {
        for (side, frame) in ["left", "right"].into_iter().zip(frames) {
            frame.check(size).map_err(|reason| Error::Mismatch(format!("the {side} frame is {reason}")))?;
        }
        if frames[0].is_bgra() != frames[1].is_bgra() {
            return Err(Error::Mismatch(
                "one frame is RGBA and the other BGRA; give both in one order".into(),
            ));
        }
        self.collected = Some(Vec::new());
        let mut state = self.ready(plan)?;
        let loaded = self.load_frames(&mut state, frames, size);
        self.state = Some(state);
        loaded
    }

    fn load_frames(&mut self, state: &mut State, frames: [&Frame; 2], size: (usize, usize)) -> Result<()> {
        self.reset(state)?;
        let State { plan, buffers, .. } = &*state;
        let (pitch, rows) = uploaded_rows(plan, buffers);
        // Pairs that are matched at half their size are extended to an even size by repeating the last column and row.
        let more = (usize::from(plan.full.is_some() && size.0 % 2 == 1), rows - size.1);
        for (frame, data) in frames.into_iter().zip(uploaded_words(plan)) {
            let [(to, place)] = &buffers.rows(plan, data).own()[..] else {
                let height = size.1;
                return Err(self.device.too_large(
                    format!("{height} rows of a frame"),
                    4 * u64::from(pitch) * height as u64,
                    self.device.max_buffer,
                ));
            };
            // (first column and row in the frame, first column and row in the view, width and height)
            let mut parts = vec![([0, 0], [0, 0], [size.0, size.1])];
            let last = [size.0 - 1, size.1 - 1];
            parts.extend((more.0 > 0).then_some(([last[0], 0], [size.0, 0], [1, size.1])));
            parts.extend((more.1 > 0).then_some(([0, last[1]], [0, size.1], [size.0, 1])));
            parts.extend((more.0 > 0 && more.1 > 0).then_some((last, [size.0, size.1], [1, 1])));
            for (from, at, part) in parts {
                let offset = place.start + 4 * (u64::from(pitch) * at[1] as u64 + at[0] as u64);
                copy(self.encoder()?, frame, (from, part), to, offset, pitch);
            }
        }
        self.unpack(state, Unpacking { is_opaque: true, is_bgra: frames[0].is_bgra() })
    }

    /// The commands that were recorded since [`Self::prepare_frames`], in order.
    pub(crate) fn take_commands(&mut self) -> Result<Vec<wgpu::CommandBuffer>> {
        self.submit()?;
        Ok(self.collected.take().unwrap_or_default())
    }

    /// The final disparities, and the validity with the confidence above it.
    pub(crate) fn final_maps(&self) -> Result<[DeviceMap; 2]> {
        let State { plan, buffers, .. } = self.state();
        let maps = if plan.full.is_some() {
            [Map::FullDisparity, Map::FullValidity]
        } else {
            [Map::Disparity, Map::Validity]
        };
        let [disparity, flags] = maps.map(|map| {
            let bytes_per_row = 4 * Data::Map(map).array(plan).words as u64;
            match &buffers.map(plan, map).own()[..] {
                [(buffer, place)] => {
                    Ok(DeviceMap { buffer: buffer.clone(), offset: place.start, bytes_per_row })
                }
                parts => {
                    let needed = bytes_per_row * parts.len() as u64;
                    Err(self.device.too_large("a map", needed, self.device.max_buffer))
                }
            }
        });
        Ok([disparity?, flags?])
    }
}

/// Copies a part of a frame, given by its first column and row, width and height, to `offset` in a buffer with
/// rows of `pitch` words.
fn copy(
    encoder: &mut wgpu::CommandEncoder,
    frame: &Frame,
    ([x, y], [width, height]): ([usize; 2], [usize; 2]),
    to: &wgpu::Buffer,
    offset: u64,
    pitch: u32,
) {
    match frame {
        Frame::Texture(texture) => {
            let origin = wgpu::Origin3d { x: x as u32, y: y as u32, z: 0 };
            let source = wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() };
            let layout =
                wgpu::TexelCopyBufferLayout { offset, bytes_per_row: Some(4 * pitch), rows_per_image: None };
            let size =
                wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 };
            encoder.copy_texture_to_buffer(source, wgpu::TexelCopyBufferInfo { buffer: to, layout }, size);
        }
        Frame::Buffer { buffer, offset: first, bytes_per_row, .. } => {
            let (row, start) = (4 * width as u64, first + y as u64 * bytes_per_row + 4 * x as u64);
            let per_row = 4 * u64::from(pitch);
            if *bytes_per_row == per_row && x == 0 {
                let bytes = per_row * (height as u64 - 1) + row;
                encoder.copy_buffer_to_buffer(buffer, start, to, offset, bytes);
                return;
            }
            for y in 0..height as u64 {
                encoder.copy_buffer_to_buffer(
                    buffer,
                    start + y * bytes_per_row,
                    to,
                    offset + y * per_row,
                    row,
                );
            }
        }
    }
}
