//! Matches what a renderer has drawn, without a way through the host: `cargo run --release --example on-device PICTURE.png`.
//!
//! Two cameras see a scene that is drawn on a GPU. The views are matched there, and the map lights the left view anew, all in commands of one
//! queue. Only the finished picture is read: on the left what the left camera sees, on the right the same with a lamp and haze.

use std::path::Path;
use std::process::ExitCode;

use mrfgs::Method;
use mrfgs::image::Plane;
use mrfgs::image::picture::Picture as _;
use mrfgs::on_device::wgpu::util::{BufferInitDescriptor, DeviceExt as _};
use mrfgs::on_device::{DeviceMatcher, Frame, OpenDevice, wgpu};
use pollster::block_on;

const SIZE: (u32, u32) = (640, 480);
/// In metres, as in the shaders.
const BASELINE: f32 = 0.12;
/// Bytes from row to row of a copied picture, a multiple of 256.
const ROW: u32 = 4 * SIZE.0;

type Failure = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let Some(path) = std::env::args_os().nth(1) else {
        eprintln!("on-device: give PICTURE.png");
        return ExitCode::FAILURE;
    };
    match block_on(run(Path::new(&path))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("on-device: {reason}");
            ExitCode::FAILURE
        }
    }
}

async fn run(path: &Path) -> Result<(), Failure> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    let (device, queue) = adapter.request_device(&wgpu::DeviceDescriptor::default()).await?;
    let open = OpenDevice { info: adapter.get_info(), device: device.clone(), queue: queue.clone() };
    let mut matcher = DeviceMatcher::new(open, (SIZE.0 as usize, SIZE.1 as usize), 0..=63, &Method::fast())?;

    // The renderer. Its commands are submitted before those of the match, and so they run before.
    let shaders = device.create_shader_module(wgpu::include_wgsl!("on-device.wgsl"));
    let stage = |entry_point: &str| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: None,
            module: &shaders,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    };
    let views = [texture(&device), texture(&device)];
    let scene = stage("scene");
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for (view, shift) in views.iter().zip([0.0, BASELINE]) {
        let uniform = uniform(&device, 0, shift);
        let bound = [(0, uniform.as_entire_binding()), (1, wgpu::BindingResource::TextureView(&seen(view)))];
        draw(&mut encoder, &device, &scene, &bound);
    }
    queue.submit([encoder.finish()]);

    // The match, and the shading that reads its map.
    let [left, right] = views.clone().map(Frame::Texture);
    let found = matcher.encode(&left, &right)?;
    queue.submit(found.commands);
    let map = &found.disparity;
    let picture = texture(&device);
    let uniform = uniform(&device, map.bytes_per_row as u32 / 4, 0.0);
    let disparity = wgpu::BufferBinding { buffer: &map.buffer, offset: map.offset, size: None };
    let bound = [
        (0, uniform.as_entire_binding()),
        (1, wgpu::BindingResource::TextureView(&seen(&picture))),
        (2, wgpu::BindingResource::Buffer(disparity)),
        (3, wgpu::BindingResource::TextureView(&seen(&views[0]))),
    ];
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    draw(&mut encoder, &device, &stage("relit"), &bound);

    // The end of what a program with a window would do: here the pictures are read, to save them.
    let [one, other] = [&views[0], &picture].map(|texture| copied(&mut encoder, &device, texture));
    queue.submit([encoder.finish()]);
    let (one, other) = (pixels(&device, &one)?, pixels(&device, &other)?);
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let both = Plane::from_fn(2 * width, height, |x, y| {
        let (bytes, x) = if x < width { (&one, x) } else { (&other, x - width) };
        let at = y * ROW as usize + 4 * x;
        [bytes[at], bytes[at + 1], bytes[at + 2]]
    });
    std::fs::write(path, both.png(path)?)?;
    Ok(())
}

fn texture(device: &wgpu::Device) -> wgpu::Texture {
    use wgpu::TextureUsages as Usages;
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE.0, height: SIZE.1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: Usages::STORAGE_BINDING | Usages::TEXTURE_BINDING | Usages::COPY_SRC,
        view_formats: &[],
    })
}

fn seen(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// The size, the words from row to row of a map, and how far the camera is to the right.
fn uniform(device: &wgpu::Device, pitch: u32, shift: f32) -> wgpu::Buffer {
    let words = [SIZE.0, SIZE.1, pitch, shift.to_bits()];
    let usage = wgpu::BufferUsages::UNIFORM;
    device.create_buffer_init(&BufferInitDescriptor {
        label: None,
        contents: bytemuck::bytes_of(&words),
        usage,
    })
}

fn draw(
    encoder: &mut wgpu::CommandEncoder,
    device: &wgpu::Device,
    pipeline: &wgpu::ComputePipeline,
    bound: &[(u32, wgpu::BindingResource<'_>)],
) {
    let entries: Vec<_> = bound
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    let layout = &pipeline.get_bind_group_layout(0);
    let group =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(SIZE.0.div_ceil(8), SIZE.1.div_ceil(8), 1);
}

fn copied(
    encoder: &mut wgpu::CommandEncoder,
    device: &wgpu::Device,
    texture: &wgpu::Texture,
) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(ROW * SIZE.1),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(ROW), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    buffer
}

fn pixels(device: &wgpu::Device, buffer: &wgpu::Buffer) -> Result<Vec<u8>, Failure> {
    let (sender, mapped) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
    device.poll(wgpu::PollType::wait_indefinitely())?;
    mapped.recv()??;
    Ok(buffer.get_mapped_range(..)?.to_vec())
}
