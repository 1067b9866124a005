//! Frames and maps on the device of a caller.

pub use ::wgpu;
use std::fmt;
use std::ops::Range;

/// A device that the caller has opened. mrfgs submits to its queue, and leaves its handlers for errors and for its
/// loss as they are. It needs no features, and the default limits of WebGPU; larger buffers and bindings allow
/// larger pairs.
#[derive(Clone, Debug)]
pub struct OpenDevice {
    /// Its adapter.
    pub info: wgpu::AdapterInfo,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
}

/// The bytes of a pixel of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PixelFormat {
    /// Red, green, blue, and one that counts for nothing.
    Rgba,
    /// Blue, green, red, and one that counts for nothing.
    Bgra,
    /// One byte, such as the first plane of a frame in NV12.
    Grey,
}

impl PixelFormat {
    /// Bytes per pixel.
    fn bytes(self) -> u64 {
        if self == Self::Grey { 1 } else { 4 }
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Rgba => "RGBA",
            Self::Bgra => "BGRA",
            Self::Grey => "grey",
        })
    }
}

/// A view on a device, in 8 bits per channel. Alpha counts for nothing.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Frame {
    /// A texture with the usage `COPY_SRC`, in RGBA, BGRA or R (grey) with 8 bits per channel, sRGB or not: the bytes
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
        /// The bytes of a pixel.
        format: PixelFormat,
    },
}

impl Frame {
    /// The bytes of a pixel, if the frame passes [`Self::check`].
    pub(super) fn format(&self) -> PixelFormat {
        match self {
            Self::Texture(texture) => of_texture(texture.format()).unwrap_or(PixelFormat::Rgba),
            Self::Buffer { format, .. } => *format,
        }
    }

    /// Refuses a frame that does not hold (width, height) pixels in a known format.
    pub(super) fn check(&self, (width, height): (usize, usize)) -> Result<(), String> {
        match self {
            Self::Texture(texture) => {
                let (format, size) =
                    (texture.format(), (texture.width() as usize, texture.height() as usize));
                if of_texture(format).is_none() {
                    return Err(format!("a texture in {format:?}; give RGBA, BGRA or R in 8 bits"));
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
            Self::Buffer { buffer, offset, bytes_per_row, format } => {
                // Copies are of whole words.
                let row = (format.bytes() * width as u64).next_multiple_of(4);
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

/// The bytes of a pixel of a texture; `None` of a format that is not matched.
fn of_texture(format: wgpu::TextureFormat) -> Option<PixelFormat> {
    use wgpu::TextureFormat::{
        Bgra8Unorm, Bgra8UnormSrgb, R8Uint, R8Unorm, Rgba8Uint, Rgba8Unorm, Rgba8UnormSrgb,
    };
    match format {
        Rgba8Uint | Rgba8Unorm | Rgba8UnormSrgb => Some(PixelFormat::Rgba),
        Bgra8Unorm | Bgra8UnormSrgb => Some(PixelFormat::Bgra),
        R8Uint | R8Unorm => Some(PixelFormat::Grey),
        _ => None,
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

/// Copies rows of a frame of this width to a place in a buffer, given by its offset, with rows of `pitch` words.
pub(super) fn copy(
    encoder: &mut wgpu::CommandEncoder,
    frame: &Frame,
    width: usize,
    rows: Range<usize>,
    (to, offset): (&wgpu::Buffer, u64),
    pitch: u32,
) {
    let (first, height) = (rows.start, rows.len());
    let per_row = 4 * u64::from(pitch);
    match frame {
        Frame::Texture(texture) => {
            let origin = wgpu::Origin3d { x: 0, y: first as u32, z: 0 };
            let source = wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() };
            let layout =
                wgpu::TexelCopyBufferLayout { offset, bytes_per_row: Some(4 * pitch), rows_per_image: None };
            let size =
                wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 };
            encoder.copy_texture_to_buffer(source, wgpu::TexelCopyBufferInfo { buffer: to, layout }, size);
        }
        Frame::Buffer { buffer, offset: begin, bytes_per_row, format } => {
            let row = (format.bytes() * width as u64).next_multiple_of(4);
            let start = begin + first as u64 * bytes_per_row;
            if *bytes_per_row == per_row {
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
