//! Frames on a caller's device: the maps are those of the same frames from files, and nothing waits.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::devices;
use mrfgs::image::{Image, Pair, Plane, Rect};
use mrfgs::on_device::wgpu::{self, util::DeviceExt};
use mrfgs::on_device::{DeviceMaps, DeviceMatcher, Frame, OpenDevice, PixelFormat};
use mrfgs::{Matcher, Method};
use pollster::block_on;
use std::ops::RangeInclusive;

/// Puts a view on a device.
type View<'a> = &'a dyn Fn(&Image) -> Frame;

const RANGE: RangeInclusive<i32> = 0..=31;

/// A device as a caller opens it. Without a driver it is `None`, or a [panic](devices::skip).
fn open() -> Option<OpenDevice> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = match block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())) {
        Ok(adapter) => adapter,
        Err(e) => {
            devices::skip(&e);
            return None;
        }
    };
    let (device, queue) = block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
    Some(OpenDevice { info: adapter.get_info(), device, queue })
}

/// Puts frames on a device, and reads its maps.
trait OnDevice {
    fn matcher(&self, size: (usize, usize), method: &Method) -> mrfgs::Result<DeviceMatcher>;
    fn texture(&self, view: &Image, format: wgpu::TextureFormat) -> Frame;
    fn buffer(&self, view: &Image, bytes_per_row: usize, format: PixelFormat) -> Frame;
    fn run(&self, maps: DeviceMaps) -> (Plane<i32>, Plane<u32>);
}

impl OnDevice for OpenDevice {
    fn matcher(&self, size: (usize, usize), method: &Method) -> mrfgs::Result<DeviceMatcher> {
        DeviceMatcher::new(self.clone(), size, RANGE, method)
    }

    /// The view as a texture in `format`.
    fn texture(&self, view: &Image, format: wgpu::TextureFormat) -> Frame {
        let pixels = match format {
            wgpu::TextureFormat::Bgra8UnormSrgb => PixelFormat::Bgra,
            wgpu::TextureFormat::R8Unorm => PixelFormat::Grey,
            _ => PixelFormat::Rgba,
        };
        let descriptor = wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: view.width() as u32,
                height: view.height() as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let bytes = bytes(view, size_of_pixel(pixels) * view.width(), pixels);
        let order = wgpu::util::TextureDataOrder::LayerMajor;
        Frame::Texture(self.device.create_texture_with_data(&self.queue, &descriptor, order, &bytes))
    }

    /// The view as a buffer whose rows are `bytes_per_row` apart, after 8 other bytes.
    fn buffer(&self, view: &Image, bytes_per_row: usize, format: PixelFormat) -> Frame {
        let contents = [vec![7; 8], bytes(view, bytes_per_row, format)].concat();
        let usage = wgpu::BufferUsages::COPY_SRC;
        let descriptor = wgpu::util::BufferInitDescriptor { label: None, contents: &contents, usage };
        let buffer = self.device.create_buffer_init(&descriptor);
        Frame::Buffer { buffer, offset: 8, bytes_per_row: bytes_per_row as u64, format }
    }

    /// Submits the commands of a match, and reads its maps: disparities in 1/256 px, confidence and validity.
    fn run(&self, maps: DeviceMaps) -> (Plane<i32>, Plane<u32>) {
        let (width, height) = maps.size;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let copies = [&maps.disparity, &maps.flags].map(|map| {
            let size = map.bytes_per_row * height as u64;
            let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
            let to = self.device.create_buffer(&descriptor);
            encoder.copy_buffer_to_buffer(&map.buffer, map.offset, &to, 0, size);
            (to, map.bytes_per_row)
        });
        self.queue.submit(maps.commands.into_iter().chain([encoder.finish()]));
        let [disparity, flags] = copies.map(|(buffer, bytes_per_row)| {
            buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
            self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
            let view = buffer.get_mapped_range(..).unwrap();
            let words: &[u32] = bytemuck::cast_slice(&view);
            let at = |x: usize, y: usize| words[y * bytes_per_row as usize / 4 + x];
            Plane::from_fn(width, height, at)
        });
        (disparity.map(|word| word.cast_signed()), flags)
    }
}

fn size_of_pixel(format: PixelFormat) -> usize {
    if format == PixelFormat::Grey { 1 } else { 4 }
}

/// The pixels in 8 bits per channel, with an alpha that counts for nothing; of grey ones the red channel.
fn bytes(view: &Image, bytes_per_row: usize, format: PixelFormat) -> Vec<u8> {
    let mut bytes = vec![0xa5; bytes_per_row * view.height()];
    for (y, row) in bytes.chunks_exact_mut(bytes_per_row).enumerate() {
        for (pixel, colour) in row.chunks_exact_mut(size_of_pixel(format)).zip(view.pixels.row(y)) {
            let [r, g, b, _] = colour.map(|v| (v >> 8) as u8);
            match format {
                PixelFormat::Grey => pixel[0] = r,
                PixelFormat::Bgra => pixel.copy_from_slice(&[b, g, r, 3]),
                _ => pixel.copy_from_slice(&[r, g, b, 3]),
            }
        }
    }
    bytes
}

/// The view in the grey levels of its red channel.
fn grey(view: &Image) -> Image {
    Image::from_rgb8(&view.to_rgb8().map(|&[r, _, _]| [r; 3]))
}

/// Both views of a rendered scene with odd width and height, and a method that matches them as they are.
fn scene(preset: &str) -> (Pair, Method) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/testdata/slanted");
    let pair = Pair::open(format!("{folder}/im0.png"), format!("{folder}/im1.png")).unwrap();
    let mut method = Method::preset(preset).unwrap();
    let front = &mut method.front;
    (front.level_rows, front.equal_sharpness, front.denoise) = (false, false, false);
    (pair.crop(&Rect { x: 20..187, y: 30..121 }), method)
}

/// The maps of the CPU path, like those of [`OnDevice::run`].
fn expected(pair: &Pair, method: &Method) -> (Plane<i32>, Plane<u32>) {
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let maps = matcher.job(pair, RANGE).method(method).run().unwrap().maps;
    let (width, height) = pair.size();
    let flags = |x, y| u32::from(maps.validity[(x, y)]) | u32::from(maps.confidence[(x, y)]) << 8;
    let flags = Plane::from_fn(width, height, flags);
    (maps.disparity, flags)
}

#[test]
fn frames_on_a_device_give_the_maps_of_the_same_frames_from_files() {
    use PixelFormat::{Bgra, Rgba};
    use wgpu::TextureFormat::{Bgra8UnormSrgb, Rgba8Unorm};
    let Some(open) = open() else { return };
    for preset in ["default", "fast"] {
        let (pair, method) = scene(preset);
        let expected = expected(&pair, &method);
        let mut matcher = open.matcher(pair.size(), &Method::preset(preset).unwrap()).unwrap();
        block_on(matcher.self_test()).unwrap();
        let width = pair.size().0;
        let frames: [(&str, View); 5] = [
            ("RGBA", &|view| open.texture(view, Rgba8Unorm)),
            ("BGRA", &|view| open.texture(view, Bgra8UnormSrgb)),
            ("dense rows", &|view| open.buffer(view, 4 * width, Rgba)),
            ("aligned rows", &|view| open.buffer(view, (4 * width).next_multiple_of(256), Bgra)),
            ("wide rows", &|view| open.buffer(view, 4 * width + 12, Bgra)),
        ];
        for (name, frame) in frames {
            let maps = matcher.encode(&frame(pair.left()), &frame(pair.right())).unwrap();
            assert!(open.run(maps) == expected, "{preset}, {name}");
        }
        // Control: another order of red and blue gives other maps.
        let wrong = |view: &Image| open.buffer(view, 4 * width, Bgra);
        let right = open.texture(pair.right(), Bgra8UnormSrgb);
        let maps = matcher.encode(&open.texture(pair.left(), Bgra8UnormSrgb), &right).unwrap();
        assert!(open.run(maps) == expected, "{preset}");
        let Frame::Buffer { buffer, offset, bytes_per_row, .. } = wrong(pair.left()) else { unreachable!() };
        let left = Frame::Buffer { buffer, offset, bytes_per_row, format: Rgba };
        let maps = matcher.encode(&left, &open.texture(pair.right(), Rgba8Unorm)).unwrap();
        assert!(open.run(maps) != expected, "{preset}");
    }
}

#[test]
fn grey_frames_on_a_device_give_the_maps_of_the_same_frames_from_files() {
    use PixelFormat::Grey;
    let Some(open) = open() else { return };
    for preset in ["default", "fast"] {
        let (pair, method) = scene(preset);
        let coloured = expected(&pair, &method);
        let pair = Pair::new(grey(pair.left()), grey(pair.right())).unwrap();
        let expected = expected(&pair, &method);
        // Control: colour matters.
        assert!(coloured != expected, "{preset}");
        let mut matcher = open.matcher(pair.size(), &Method::preset(preset).unwrap()).unwrap();
        let width = pair.size().0.next_multiple_of(4);
        let frames: [(&str, View); 4] = [
            ("texture", &|view| open.texture(view, wgpu::TextureFormat::R8Unorm)),
            ("dense rows", &|view| open.buffer(view, width, Grey)),
            ("aligned rows", &|view| open.buffer(view, width.next_multiple_of(256), Grey)),
            ("wide rows", &|view| open.buffer(view, width + 12, Grey)),
        ];
        for (name, frame) in frames {
            let maps = matcher.encode(&frame(pair.left()), &frame(pair.right())).unwrap();
            assert!(open.run(maps) == expected, "{preset}, {name}");
        }
    }
}

/// A matcher for host images on a caller's device gives the same maps as well.
#[test]
fn host_images_are_matched_on_a_device_of_the_caller() {
    let Some(open) = open() else { return };
    let (pair, method) = scene("default");
    let mut matcher = Matcher::on_device(open, None).unwrap();
    let maps = matcher.job(&pair, RANGE).method(&method).run().unwrap().maps;
    assert!(maps.disparity == expected(&pair, &method).0);
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let Some(open) = open() else { return };
    let (pair, method) = scene("fast");
    let (width, height) = pair.size();
    let mut matcher = open.matcher((width, height), &method).unwrap();
    let good = open.buffer(pair.left(), 4 * width, PixelFormat::Rgba);
    let Frame::Buffer { buffer, .. } = &good else { unreachable!() };
    let with = |offset, bytes_per_row| Frame::Buffer {
        buffer: buffer.clone(),
        offset,
        bytes_per_row,
        format: PixelFormat::Rgba,
    };
    let row = 4 * width as u64;
    let small = pair.crop(&Rect { x: 0..20, y: 0..20 });
    let float = open.texture(pair.left(), wgpu::TextureFormat::Rgba8Snorm);
    for (frame, says) in [
        (open.texture(small.left(), wgpu::TextureFormat::Rgba8Unorm), "20 x 20 pixels, not 167 x 91"),
        (float, "give RGBA, BGRA or R in 8 bits"),
        (with(8, row - 4), "a row takes 668"),
        (with(6, row), "multiples of 4"),
        (with(12, row), "too few for 167 x 91 pixels"),
        (with(0, u64::MAX - 3), "too few for 167 x 91 pixels"),
        (
            open.buffer(pair.left(), 4 * width, PixelFormat::Bgra),
            "one frame is BGRA and the other RGBA; give both in one format",
        ),
    ] {
        let error = matcher.encode(&frame, &good).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let maps = matcher.encode(&good, &open.buffer(pair.right(), 4 * width, PixelFormat::Rgba)).unwrap();
    assert!(open.run(maps) == expected(&pair, &method), "it goes on after errors");
    for (preset, key, value) in
        [("accurate", "levels", "4"), ("paper", "levels", "3"), ("default", "right-map", "true")]
    {
        let mut method = Method::preset(preset).unwrap();
        method.set(key, value).unwrap();
        let error = open.matcher((width, height), &method).err().expect(preset).to_string();
        assert!(error.contains("frames on a device are matched in one piece"), "{error}");
    }
}
