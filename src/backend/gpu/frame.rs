//! Frames and maps on the device of a caller.

pub use ::wgpu;

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
    pub(super) fn is_bgra(&self) -> bool {
        use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb};
        match self {
            Self::Texture(texture) => matches!(texture.format(), Bgra8Unorm | Bgra8UnormSrgb),
            Self::Buffer { is_bgra, .. } => *is_bgra,
        }
    }

    /// Refuses a frame that does not hold (width, height) pixels in a known format.
    pub(super) fn check(&self, (width, height): (usize, usize)) -> Result<(), String> {
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

/// Copies a part of a frame, given by its first column and row, width and height, to `offset` in a buffer with
/// rows of `pitch` words.
pub(super) fn copy(
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
