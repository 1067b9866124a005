//! Frames of one rig, matched as they come. On a GPU, the images stay there, and only the maps come back.

use crate::Thrown;
use crate::pair::{pair_of_samples, rgba};
use crate::words::{doubt, text, thrown};
use futures_channel::oneshot;
use mrfgs::check::{self, Warning};
use mrfgs::error::DeviceError;
use mrfgs::image::Pair;
use mrfgs::maps::{FRACTION, has_disparity};
use mrfgs::on_device::{DeviceMap, DeviceMaps, DeviceMatcher, Frame, OpenDevice, wgpu};
use mrfgs::options::{DeviceChoice, DisparityRange, Execution, Method};
use mrfgs::rectification::{Options, Rectification};
use mrfgs::{Error, Result};
use wasm_bindgen::prelude::wasm_bindgen;
use web_sys::ImageBitmap;

/// Matches frames by the preset `fast`. Every map is the same on a GPU and on the CPU path: what a match measures of a single pair to correct
/// it is left out.
#[wasm_bindgen]
pub struct Video {
    matcher: mrfgs::Matcher,
    open: Option<OpenDevice>,
    device: String,
    method: Method,
    rig: Option<Rig>,
}

/// The rectification and the range that the frames of a video have, as learned from its first ones.
struct Rig {
    /// None if the frames are rectified.
    rectification: Option<Rectification>,
    range: DisparityRange,
    /// The matcher of images that are on the device.
    direct: Option<DeviceMatcher>,
}

#[wasm_bindgen]
impl Video {
    /// Opens "gpu" or "cpu".
    ///
    /// # Errors
    /// If the browser provides no GPU.
    pub async fn open(device: &str) -> Thrown<Video> {
        open(device == "gpu").await.map_err(thrown)
    }

    /// The device that runs matches, for display.
    #[wasm_bindgen(getter)]
    pub fn device(&self) -> String {
        self.device.clone()
    }

    /// Whether [`Video::images`] matches the next frames; otherwise [`Video::pixels`] does.
    #[wasm_bindgen(getter)]
    pub fn direct(&self) -> bool {
        self.rig.as_ref().is_some_and(|rig| rig.direct.is_some())
    }

    /// The range that is searched.
    #[wasm_bindgen(getter)]
    pub fn range(&self) -> Option<crate::pair::Range> {
        self.rig.as_ref().map(|rig| crate::pair::Range { range: rig.range, found: true })
    }

    /// Learns from a frame (RGBA) how the views are rectified, if they are not yet, and which disparities there are, and compares a GPU with
    /// the CPU path. Later frames only widen the range. Returns what was done, and whether the views seem to be exchanged.
    ///
    /// # Errors
    /// If the first frame tells neither, or the device gives wrong maps.
    pub async fn learn(
        &mut self,
        left: &[u8],
        right: &[u8],
        width: usize,
        height: usize,
    ) -> Thrown<Vec<String>> {
        let raw = pair_of_samples((left, (width, height)), (right, (width, height))).map_err(thrown)?;
        self.take(&raw).await.map_err(thrown)
    }

    /// Matches a frame of RGBA pixels.
    ///
    /// # Errors
    /// If nothing was learned, or the device fails.
    pub async fn pixels(
        &mut self,
        left: &[u8],
        right: &[u8],
        width: usize,
        height: usize,
    ) -> Thrown<VideoMap> {
        let raw = pair_of_samples((left, (width, height)), (right, (width, height))).map_err(thrown)?;
        self.on_host(&raw).await.map_err(thrown)
    }

    /// Matches a frame of images, which are copied from where the browser holds them to the device.
    ///
    /// # Errors
    /// If the frames are not [`direct`](Video::direct), or the device fails.
    pub async fn images(&mut self, left: ImageBitmap, right: ImageBitmap) -> Thrown<VideoMap> {
        let direct = self.rig.as_mut().and_then(|rig| rig.direct.as_mut());
        let (Some(open), Some(direct)) = (&self.open, direct) else { return Err(thrown(unlearned())) };
        on_device(open, direct, left, right).await.map_err(thrown)
    }
}

/// The map of a frame.
#[wasm_bindgen]
pub struct VideoMap {
    width: usize,
    height: usize,
    disparity: Vec<f32>,
    left: Option<Vec<u8>>,
}

#[wasm_bindgen]
impl VideoMap {
    /// Width in pixels.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Disparities in pixels, +infinity where there are none. This moves them out.
    pub fn disparity(&mut self) -> Vec<f32> {
        std::mem::take(&mut self.disparity)
    }

    /// The rectified left view as RGBA, if the frame was rectified. This moves it out.
    pub fn left(&mut self) -> Option<Vec<u8>> {
        self.left.take()
    }
}

impl Video {
    async fn take(&mut self, raw: &Pair) -> Result<Vec<String>> {
        if let Some(rig) = &mut self.rig {
            let pair = rig.rectified(raw)?;
            let (min, max) = (rig.range.min, rig.range.max);
            let Ok(seen) = check::range(pair.as_ref().unwrap_or(raw)) else { return Ok(Vec::new()) };
            rig.range = DisparityRange::new(seen.min.min(min), seen.max.max(max))?;
            if rig.direct.is_some() && (rig.range.min, rig.range.max) != (min, max) {
                rig.direct = direct(self.open.as_ref(), raw.size(), rig.range, &self.method)?;
            }
            return Ok(Vec::new());
        }
        let causes = check::warnings(raw, None);
        let turned = causes.iter().any(|cause| matches!(cause, Warning::NotRectified { .. }));
        let found = if turned { None } else { check::range(raw).ok() };
        if let Some(range) = found {
            let mut direct = direct(self.open.as_ref(), raw.size(), range, &self.method)?;
            if let Some(direct) = &mut direct {
                direct.self_test().await?;
            }
            self.rig = Some(Rig { rectification: None, range, direct });
            let exchanged = causes.iter().filter(|cause| matches!(cause, Warning::Swapped { .. }));
            return Ok(exchanged.map(text).collect());
        }
        let by = Rectification::of_pair(raw, &Options::default())?;
        let range = check::range(&by.apply(raw)?)?;
        let mut notes: Vec<_> = by.doubts().iter().map(doubt).collect();
        if let Some(trust) = by.trust() {
            notes.insert(0, format!("rectified by the matches of the first frame, without a scale: {trust}"));
        }
        self.rig = Some(Rig { rectification: Some(by), range, direct: None });
        Ok(notes)
    }

    async fn on_host(&mut self, raw: &Pair) -> Result<VideoMap> {
        let rig = self.rig.as_ref().ok_or_else(unlearned)?;
        let rectified = rig.rectified(raw)?;
        let pair = rectified.as_ref().unwrap_or(raw);
        let found = self.matcher.job(pair, rig.range).method(&self.method).run_async().await?;
        let (width, height) = pair.size();
        let left = rectified.as_ref().map(|pair| rgba(&pair.left().to_rgb8()));
        Ok(VideoMap { width, height, disparity: found.disparity().into_data(), left })
    }
}

impl Rig {
    /// The frame as it is matched, unless it is matched as it is.
    fn rectified(&self, raw: &Pair) -> Result<Option<Pair>> {
        self.rectification.as_ref().map(|by| by.apply(raw)).transpose()
    }
}

fn unlearned() -> Error {
    Error::Mismatch("no frame has told the range yet: call learn first".into())
}

/// Opens the device with the limits that it offers for buffers and bindings.
async fn open(gpu: bool) -> Result<Video> {
    let mut method = Method::preset("fast")?;
    let front = &mut method.front;
    (front.level_rows, front.equal_sharpness, front.denoise) = (false, false, false);
    if !gpu {
        let cpu = Execution { device: DeviceChoice::Cpu, ..Execution::default() };
        let matcher = mrfgs::Matcher::builder().execution(cpu).build_async().await?;
        return Ok(Video { matcher, open: None, device: "the CPU path".into(), method, rig: None });
    }
    let open = of_browser().await?;
    let matcher = mrfgs::Matcher::on_device(open.clone(), None)?;
    Ok(Video { matcher, device: name(&open), open: Some(open), method, rig: None })
}

/// Opens a GPU, with buffers and bindings as large as it offers.
async fn of_browser() -> Result<OpenDevice> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let wanted = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    let adapter = instance.request_adapter(&wanted).await.map_err(|_| DeviceError::NoDriver)?;
    let offered = adapter.limits();
    let required_limits = wgpu::Limits {
        max_buffer_size: offered.max_buffer_size,
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        ..wgpu::Limits::default().or_worse_values_from(&offered)
    };
    let descriptor = wgpu::DeviceDescriptor { label: Some("video"), required_limits, ..Default::default() };
    let info = adapter.get_info();
    let opened = adapter.request_device(&descriptor).await;
    let (device, queue) =
        opened.map_err(|e| DeviceError::Failed { name: info.name.clone(), reason: e.to_string() })?;
    Ok(OpenDevice { info, device, queue })
}

/// The name of a device, which a browser may hide.
fn name(open: &OpenDevice) -> String {
    let name = &open.info.name;
    if name.is_empty() { "WebGPU".into() } else { name.clone() }
}

/// The matcher of images that are on the device.
fn direct(
    open: Option<&OpenDevice>,
    size: (usize, usize),
    range: DisparityRange,
    method: &Method,
) -> Result<Option<DeviceMatcher>> {
    open.map(|open| DeviceMatcher::new(open.clone(), size, range.min..=range.max, method)).transpose()
}

/// Copies the images to textures, matches them, and reads the map.
async fn on_device(
    open: &OpenDevice,
    matcher: &mut DeviceMatcher,
    left: ImageBitmap,
    right: ImageBitmap,
) -> Result<VideoMap> {
    let frames = [left, right].map(|image| Frame::Texture(texture(open, image)));
    let DeviceMaps { commands, disparity, flags, size: (width, height) } =
        matcher.encode(&frames[0], &frames[1])?;
    open.queue.submit(commands);
    let [disparity, flags] = [words(open, &disparity, height), words(open, &flags, height)];
    let (disparity, flags) = (disparity.await?, flags.await?);
    let at = |of: &Read, x: usize, y: usize| of.words[y * of.pitch + x];
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let there = has_disparity(at(&flags, x, y) as u8);
        if there { at(&disparity, x, y).cast_signed() as f32 / FRACTION as f32 } else { f32::INFINITY }
    };
    let disparity = (0..width * height).map(pixel).collect();
    Ok(VideoMap { width, height, disparity, left: None })
}

/// An image as a texture in RGBA.
fn texture(open: &OpenDevice, image: ImageBitmap) -> wgpu::Texture {
    let size = wgpu::Extent3d { width: image.width(), height: image.height(), depth_or_array_layers: 1 };
    let texture = open.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("frame"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let source = wgpu::CopyExternalImageSourceInfo {
        source: wgpu::ExternalImageSource::ImageBitmap(image),
        origin: wgpu::Origin2d::ZERO,
        flip_y: false,
    };
    let to = wgpu::CopyExternalImageDestInfo {
        texture: &texture,
        mip_level: 0,
        origin: wgpu::Origin3d::ZERO,
        aspect: wgpu::TextureAspect::All,
        color_space: wgpu::PredefinedColorSpace::Srgb,
        premultiplied_alpha: false,
    };
    open.queue.copy_external_image_to_texture(&source, to, size);
    texture
}

/// A map on the host, in rows of `pitch` words.
struct Read {
    words: Vec<u32>,
    pitch: usize,
}

/// Reads a map of `height` rows. The copy is submitted at once.
fn words(open: &OpenDevice, map: &DeviceMap, height: usize) -> impl Future<Output = Result<Read>> + use<> {
    let (sender, done) = oneshot::channel();
    let part = map.buffer.slice(map.offset..map.offset + map.bytes_per_row * height as u64);
    wgpu::util::DownloadBuffer::read_buffer(&open.device, &open.queue, &part, move |mapped| {
        let read = mapped.map(|bytes| {
            bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect::<Vec<u32>>()
        });
        // The receiver may have gone.
        let _ = sender.send(read);
    });
    let pitch = map.bytes_per_row as usize / 4;
    let name = name(open);
    async move {
        match done.await {
            Ok(Ok(words)) => Ok(Read { words, pitch }),
            _ => Err(DeviceError::Failed { name, reason: "the map of a frame did not arrive".into() }.into()),
        }
    }
}
