//! The GPU path: wgpu on Vulkan or Metal, one shader a stage.
//!
//! Volumes are \[y\]\[x\]\[slot\]\[label\], labels padded to blocks of 16, packed four 8-bit or two 16-bit values a word. Rows start
//! at multiples of 256 bytes, so that any rows of a volume can be bound: where a volume exceeds what a device lets a
//! shader see at once, a stage runs band by band, each band bound with the rows above and below that it reads.

mod device;
mod kernels;
mod stages;
mod upload;

use super::{Backend, Estimate, PaddedRows, Peak, Volume, volume_shape};
use crate::error::{Error, Result};
use crate::graph::LevelGraph;
use crate::image::{Pair, Plane};
use crate::memory;
use crate::plan::Plan;
use device::Device;
pub use device::{Ceiling, DeviceInfo, devices, has_automatic};
pub use kernels::{Kernel, LevelParams, Params, Variant};
use stages::{Binding, Stages};
use std::collections::HashMap;
use std::num::NonZero;
use upload::{member_words, transposed};

/// Largest number of iterations of all loops of one invocation together.
pub const MAX_LOOP_ITERATIONS: usize = 32_768;
/// Passes recorded before they are submitted: short enough for drivers that stop long jobs.
const PASSES_PER_SUBMIT: usize = 16;
const ALIGN_BYTES: u64 = 256;
const WORKGROUP: u32 = 64;

/// The GPU path on one device.
pub struct Gpu {
    device: Device,
    pipelines: HashMap<(Kernel, Variant), wgpu::ComputePipeline>,
    encoder: Option<wgpu::CommandEncoder>,
    passes: usize,
    state: Option<State>,
}

/// Everything that belongs to one match.
struct State {
    plan: Plan,
    buffers: Buffers,
    stages: Stages,
}

struct Buffers {
    levels: Vec<LevelBuffers>,
    /// Sums of the squared changes of each row, lower and upper half.
    change_sums: wgpu::Buffer,
    peaks: wgpu::Buffer,
    offsets: wgpu::Buffer,
    right_labels: wgpu::Buffer,
}

/// Volumes of one level.
struct LevelBuffers {
    params: LevelParams,
    cost: wgpu::Buffer,
    evidence: wgpu::Buffer,
    dependency: wgpu::Buffer,
    down: wgpu::Buffer,
    up: wgpu::Buffer,
    belief: wgpu::Buffer,
    members: wgpu::Buffer,
    starts: wgpu::Buffer,
    incoming: wgpu::Buffer,
    /// First word of each row in `incoming`, and the end.
    incoming_rows: Vec<u32>,
}

#[derive(Clone)]
struct Dispatch {
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
    groups: (u32, u32),
}

impl Gpu {
    /// Opens the device that `wanted` names, by its index or a part of its name, or the best there is.
    ///
    /// # Errors
    /// [`Error::Device`] when there is no driver or the device cannot be opened, [`Error::Option`] when no device has
    /// that name.
    pub fn new(wanted: Option<&str>) -> Result<Self> {
        Self::with_ceiling(wanted, Ceiling::default())
    }

    /// As [`Gpu::new`], staying below `ceiling`.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn with_ceiling(wanted: Option<&str>, ceiling: Ceiling) -> Result<Self> {
        Ok(Self {
            device: Device::open(wanted, ceiling)?,
            pipelines: HashMap::new(),
            encoder: None,
            passes: 0,
            state: None,
        })
    }

    /// The pipeline of `kernel` at `level`, compiled on first use.
    fn pipeline(&mut self, kernel: Kernel, plan: &Plan, level: usize) -> Result<wgpu::ComputePipeline> {
        let loops = kernel.loop_iterations(plan, level);
        if loops > MAX_LOOP_ITERATIONS {
            return Err(Error::Device(format!(
                "{} labels with {} neighbours are too many for one invocation of the shader `{}`: use --backend cpu",
                plan.levels[0].labels,
                plan.neighbours,
                kernel.name()
            )));
        }
        let variant = Variant::new(kernel, plan, level);
        if let Some(pipeline) = self.pipelines.get(&(kernel, variant)) {
            return Ok(pipeline.clone());
        }
        let module = self.device.inner.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.name()),
            source: wgpu::ShaderSource::Wgsl(kernel.source(variant).into()),
        });
        let pipeline = self.device.inner.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name()),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.device.check()?;
        self.pipelines.insert((kernel, variant), pipeline.clone());
        Ok(pipeline)
    }

    fn buffer(&self, label: &str, words: u64) -> Result<wgpu::Buffer> {
        let size = (4 * words).max(ALIGN_BYTES);
        if size > self.device.max_buffer {
            return Err(Error::Memory(format!(
                "the {label} buffer needs {} MiB and {} allows {}: use --backend cpu, or a smaller image or range",
                size >> 20,
                self.device.name,
                self.device.max_buffer >> 20
            )));
        }
        Ok(self.device.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        }))
    }

    fn uploaded(&self, label: &str, words: &[u32]) -> Result<wgpu::Buffer> {
        let buffer = self.buffer(label, words.len() as u64)?;
        self.device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(words));
        Ok(buffer)
    }

    fn dispatch(
        &self,
        pipeline: &wgpu::ComputePipeline,
        params: &Params,
        bindings: &[Binding],
        threads: (u32, u32),
    ) -> Dispatch {
        let device = &self.device.inner;
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: size_of::<Params>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.device.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(params));
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
        entries.extend(bindings.iter().zip(1..).map(|(binding, place)| wgpu::BindGroupEntry {
            binding: place,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &binding.buffer,
                offset: binding.bytes.start,
                size: NonZero::new(binding.size()),
            }),
        }));
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Dispatch {
            pipeline: pipeline.clone(),
            bind_group,
            groups: (threads.0.div_ceil(WORKGROUP), threads.1),
        }
    }

    /// Records the dispatches of a stage, in order.
    fn record(&mut self, dispatches: &[Dispatch]) -> Result<()> {
        let device = &self.device.inner;
        let encoder = self
            .encoder
            .get_or_insert_with(|| device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()));
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            for dispatch in dispatches {
                pass.set_pipeline(&dispatch.pipeline);
                pass.set_bind_group(0, &dispatch.bind_group, &[]);
                pass.dispatch_workgroups(dispatch.groups.0, dispatch.groups.1, 1);
            }
        }
        self.passes += 1;
        if self.passes >= PASSES_PER_SUBMIT { self.submit() } else { Ok(()) }
    }

    fn submit(&mut self) -> Result<()> {
        self.passes = 0;
        if let Some(encoder) = self.encoder.take() {
            self.device.queue.submit([encoder.finish()]);
        }
        self.device.check()
    }

    /// The words of `buffer`, after everything recorded so far.
    fn download(&mut self, buffer: &wgpu::Buffer) -> Result<Vec<u32>> {
        self.submit()?;
        let staging = self.device.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder =
            self.device.inner.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.device.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |mapped| {
            // Nobody listens when the wait below failed.
            let _ = sender.send(mapped);
        });
        self.device.wait()?;
        let failed = |e: &dyn std::fmt::Display| Error::Device(format!("{}: {e}", self.device.name));
        receiver.recv().map_err(|e| failed(&e))?.map_err(|e| failed(&e))?;
        let view = staging.get_mapped_range(..).map_err(|e| failed(&e))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }

    fn level_buffers(&self, plan: &Plan, z: usize, graph: &LevelGraph) -> Result<LevelBuffers> {
        let params = LevelParams::new(plan, &plan.levels[z]);
        let rows = u64::from(params.height);
        let narrow = u64::from(params.pitch) * rows;
        let message = narrow * plan.message_bytes() as u64;
        let last = plan.levels.len() - 1;
        let (starts, incoming, incoming_rows) = transposed(graph, &params);
        Ok(LevelBuffers {
            cost: self.buffer("cost", if z == 0 { narrow } else { 2 * narrow })?,
            evidence: self.buffer("evidence", narrow)?,
            dependency: self.buffer("dependency", u64::from(params.dependency_pitch) * rows)?,
            down: self.buffer("down", if z == last { 0 } else { message })?,
            up: self.buffer("up", if z == 0 { 0 } else { message })?,
            belief: self.buffer("belief", 2 * narrow)?,
            members: self.uploaded("members", &member_words(graph, &params))?,
            starts: self.uploaded("starts", &starts)?,
            incoming: self.uploaded("incoming", &incoming)?,
            incoming_rows,
            params,
        })
    }

    fn state(&self) -> &State {
        self.state.as_ref().expect("prepare comes before every stage")
    }

    fn run(&mut self, pick: impl Fn(&Stages) -> &[Dispatch]) -> Result<()> {
        let dispatches = pick(&self.state().stages).to_vec();
        self.record(&dispatches)
    }

    /// Buffer, words a row and values a word of a volume.
    fn volume(&self, volume: Volume) -> (wgpu::Buffer, usize, usize) {
        let state = self.state();
        let narrow = if state.plan.message_bytes() == 1 { 4 } else { 2 };
        let (z, buffer, per_word): (usize, fn(&LevelBuffers) -> &wgpu::Buffer, usize) = match volume {
            Volume::Cost(z) => (z, |b| &b.cost, if z == 0 { 4 } else { 2 }),
            Volume::Evidence(z) => (z, |b| &b.evidence, 4),
            Volume::Dependency(z) => (z, |b| &b.dependency, narrow),
            Volume::Down(z) => (z, |b| &b.down, narrow),
            Volume::Up(z) => (z, |b| &b.up, narrow),
            Volume::Belief(z) => (z, |b| &b.belief, 2),
        };
        let b = &state.buffers.levels[z];
        let pitch = match volume {
            Volume::Dependency(_) => b.params.dependency_pitch,
            _ => b.params.pitch * (4 / per_word as u32),
        };
        (buffer(b).clone(), pitch as usize, per_word)
    }
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()> {
        // What the last match holds goes before the next one asks for more.
        self.encoder = None;
        self.state = None;
        if self.device.software {
            memory::check(plan)?;
        }
        let levels = graphs
            .iter()
            .enumerate()
            .map(|(z, graph)| self.level_buffers(plan, z, graph))
            .collect::<Result<Vec<_>>>()?;
        let fine = levels[0].params;
        let pixels = u64::from(fine.pixel_pitch) * u64::from(fine.height);
        let buffers = Buffers {
            change_sums: self.buffer("change", 2 * u64::from(fine.height))?,
            peaks: self.buffer("peaks", 2 * pixels)?,
            offsets: self.buffer("offsets", pixels)?,
            right_labels: self.buffer("right labels", pixels)?,
            levels,
        };
        let stages = self.stages(plan, pair, &buffers)?;
        self.device.check()?;
        self.state = Some(State { plan: plan.clone(), buffers, stages });
        Ok(())
    }

    fn cost(&mut self) -> Result<()> {
        self.run(|s| &s.cost)
    }

    fn pyramid(&mut self, level: usize) -> Result<()> {
        self.run(|s| &s.pyramid[level])
    }

    fn evidence(&mut self, level: usize) -> Result<()> {
        self.run(|s| &s.evidence[level])
    }

    fn dependency(&mut self, level: usize) -> Result<()> {
        self.run(|s| &s.dependency[level])
    }

    fn resolution(&mut self, level: usize) -> Result<()> {
        self.run(|s| &s.resolution[level])
    }

    fn belief(&mut self, level: usize) -> Result<()> {
        self.run(|s| &s.belief[level])
    }

    fn change(&mut self) -> Result<u64> {
        self.run(|s| &s.change)?;
        let sums = self.state().buffers.change_sums.clone();
        let words = self.download(&sums)?;
        let rows = self.state().plan.levels[0].height;
        Ok(words.chunks_exact(2).take(rows).map(|half| u64::from(half[1]) << 32 | u64::from(half[0])).sum())
    }

    fn estimate(&mut self) -> Result<Estimate> {
        self.run(|s| &s.estimate)?;
        let Buffers { peaks, offsets, right_labels, .. } = &self.state().buffers;
        let (peaks, offsets, right) = (peaks.clone(), offsets.clone(), right_labels.clone());
        let (peaks, offsets, right) =
            (self.download(&peaks)?, self.download(&offsets)?, self.download(&right)?);
        let state = self.state();
        let (width, height) = state.plan.size();
        let pitch = state.buffers.levels[0].params.pixel_pitch as usize;
        Ok(Estimate {
            peaks: Plane::from_fn(width, height, |x, y| {
                let [first, second] = [0, 1].map(|i| peaks[2 * (y * pitch + x) + i]);
                Peak { label: first as u16, best: (first >> 16) as u16, rival: second as u16 }
            }),
            offsets: Plane::from_fn(width, height, |x, y| offsets[y * pitch + x] as i16),
            right: Plane::from_fn(width, height, |x, y| right[y * pitch + x] as u16),
        })
    }

    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        let (buffer, pitch, per_word) = self.volume(volume);
        let words = self.download(&buffer)?;
        let plan = &self.state().plan;
        let (rows, labels, stride) = volume_shape(plan, volume);
        let lines = rows / plan.levels[volume.level()].height;
        let bits = 32 / per_word;
        let mut values = Vec::with_capacity(rows * labels);
        for line in words.chunks_exact(pitch) {
            for i in (0..lines).flat_map(|i| i * stride..i * stride + labels) {
                let word = line[i / per_word] >> (bits * (i % per_word));
                values.push(word & (u32::MAX >> (32 - bits)));
            }
        }
        Ok(values)
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        self.submit()?;
        let (buffer, pitch, per_word) = self.volume(volume);
        let plan = &self.state().plan;
        let height = plan.levels[volume.level()].height;
        let rows = PaddedRows::new(plan, volume, values);
        let per_line = volume_shape(plan, volume).0 / height;
        let bits = 32 / per_word;
        let mut words = vec![0u32; pitch * height];
        for (i, row) in rows.iter().enumerate() {
            let line = &mut words[i / per_line * pitch..];
            for (d, value) in row.into_iter().enumerate() {
                let at = i % per_line * rows.stride + d;
                line[at / per_word] |= value << (bits * (at % per_word));
            }
        }
        self.device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&words));
        self.device.check()
    }
}
