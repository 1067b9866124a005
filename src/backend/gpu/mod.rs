//! The GPU path: wgpu on Vulkan or Metal, one shader a stage.
//!
//! Volumes are \[y\]\[x\]\[slot\]\[label\], labels padded to blocks of 16, packed four 8-bit or two 16-bit values a word. Rows start
//! at multiples of 256 bytes, so that any rows of a volume can be bound: where a volume exceeds what a device lets a
//! shader see at once, a stage runs band by band, each band bound with the rows above and below that it reads.

mod device;
mod kernels;

use super::{Backend, Estimate, PaddedRows, Peak, Volume, volume_shape};
use crate::error::{Error, Result};
use crate::graph::LevelGraph;
use crate::image::{Image, Pair, Plane};
use crate::options::Cost;
use crate::plan::Plan;
use crate::tables;
use device::Device;
pub use device::{Ceiling, DeviceInfo, devices, has_automatic};
pub use kernels::{Kernel, LevelParams, Params, Variant};
use std::collections::HashMap;
use std::num::NonZero;
use std::ops::Range;

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

/// The dispatches of every stage, by level where there is one a level.
#[derive(Default)]
struct Stages {
    cost: Vec<Dispatch>,
    pyramid: Vec<Vec<Dispatch>>,
    evidence: Vec<Vec<Dispatch>>,
    dependency: Vec<Vec<Dispatch>>,
    resolution: Vec<Vec<Dispatch>>,
    belief: Vec<Vec<Dispatch>>,
    estimate: Vec<Dispatch>,
    change: Vec<Dispatch>,
}

#[derive(Clone)]
struct Dispatch {
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
    groups: (u32, u32),
}

/// A range of a buffer to bind, at a byte offset that is a multiple of 256.
struct Binding {
    buffer: wgpu::Buffer,
    bytes: Range<u64>,
}

impl Binding {
    /// Rows of `words` 32-bit words each.
    fn rows(buffer: &wgpu::Buffer, words: u32, rows: &Range<u32>) -> Self {
        let bytes = 4 * u64::from(words);
        Self { buffer: buffer.clone(), bytes: bytes * u64::from(rows.start)..bytes * u64::from(rows.end) }
    }

    fn whole(buffer: &wgpu::Buffer) -> Self {
        Self { buffer: buffer.clone(), bytes: 0..buffer.size() }
    }

    /// Bytes that are bound; an empty buffer is bound whole, for shaders that name but never read it.
    fn size(&self) -> u64 {
        let end = self.bytes.end.min(self.buffer.size());
        end.saturating_sub(self.bytes.start)
    }
}

/// `rows` with up to `halo` rows above and below.
fn with_halo(rows: &Range<u32>, halo: u32, height: u32) -> Range<u32> {
    rows.start.saturating_sub(halo)..(rows.end + halo).min(height)
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

    /// The dispatches of `kernel` at `level`, one a band: `row_threads` invocations a row (`None`: an invocation a row),
    /// `bind` the buffers for rows of the level.
    fn stage(
        &mut self,
        kernel: Kernel,
        plan: &Plan,
        level: usize,
        params: &Params,
        row_threads: Option<u32>,
        bind: impl Fn(&Range<u32>) -> Vec<Binding>,
    ) -> Result<Vec<Dispatch>> {
        let pipeline = self.pipeline(kernel, plan, level)?;
        let bands = self.bands(params.level.height, &bind)?;
        let dispatches = bands.into_iter().map(|rows| {
            let params = Params { first_row: rows.start, rows: rows.len() as u32, ..*params };
            let threads = row_threads.map_or((params.rows, 1), |threads| (threads, params.rows));
            self.dispatch(&pipeline, &params, &bind(&rows), threads)
        });
        Ok(dispatches.collect())
    }

    /// Bands of rows, as few as possible, for which no binding exceeds what the device lets a shader see.
    fn bands(&self, height: u32, bind: impl Fn(&Range<u32>) -> Vec<Binding>) -> Result<Vec<Range<u32>>> {
        let largest = |rows: &Range<u32>| bind(rows).iter().map(Binding::size).max().unwrap_or(0);
        // No more rows than a device has workgroups in a dimension.
        let mut rows = height.min(65_535);
        loop {
            let bands: Vec<_> =
                (0..height.div_ceil(rows)).map(|i| i * rows..((i + 1) * rows).min(height)).collect();
            let most = bands.iter().map(largest).max().unwrap_or(0);
            if most <= self.device.max_binding {
                return Ok(bands);
            }
            if rows == 1 {
                return Err(Error::Memory(format!(
                    "what a row of the image depends on takes {} KiB and {} lets a shader see {} KiB at once: use \
                     --backend cpu, or a smaller image or range",
                    most >> 10,
                    self.device.name,
                    self.device.max_binding >> 10
                )));
            }
            rows -= rows.div_ceil(8).min(rows - 1);
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

    fn stages(&mut self, plan: &Plan, pair: &Pair, state: &Buffers) -> Result<Stages> {
        let mut stages = Stages::default();
        for (z, b) in state.levels.iter().enumerate() {
            let l = b.params;
            let scale = plan.levels[z].evidence;
            let base = Params {
                level: l,
                fine: state.levels[z.saturating_sub(1)].params,
                outside_cost: plan.outside_cost.into(),
                sad_radius: (plan.method.sad_window / 2) as i32,
                label_offset: if z == 0 { 0 } else { plan.label_offset(z) },
                evidence_multiplier: scale.multiplier,
                evidence_limit: scale.limit,
                evidence_cap: scale.cap,
                ..Params::default()
            };
            let words = plan.message_bytes() as u32;
            let cost_words = if z == 0 { l.pitch } else { 2 * l.pitch };
            if z == 0 {
                stages.cost = self.cost_stages(plan, pair, &base, &b.cost)?;
                stages.pyramid.push(Vec::new());
                stages.resolution.push(Vec::new());
            } else {
                let finer = &state.levels[z - 1];
                let f = finer.params;
                let fine_cost_words = if z == 1 { f.pitch } else { 2 * f.pitch };
                let threads = Some(2 * l.width * l.quads);
                stages.pyramid.push(self.stage(Kernel::Pyramid, plan, z, &base, threads, |rows| {
                    let fine_rows = with_halo(&(2 * rows.start..(2 * rows.end).min(f.height)), 2, f.height);
                    vec![
                        Binding::rows(&finer.cost, fine_cost_words, &fine_rows),
                        Binding::rows(&b.cost, cost_words, rows),
                    ]
                })?);
                let params = Params { tau: plan.resolution.tau.into(), ..base };
                stages.resolution.push(self.stage(
                    Kernel::Resolution,
                    plan,
                    z,
                    &params,
                    Some(l.width),
                    |rows| {
                        let fine_rows = 2 * rows.start..(2 * rows.end).min(f.height);
                        vec![
                            Binding::rows(&finer.belief, 2 * f.pitch, &fine_rows),
                            Binding::rows(&b.belief, 2 * l.pitch, rows),
                            Binding::rows(&finer.down, words * f.pitch, &fine_rows),
                            Binding::rows(&b.up, words * l.pitch, rows),
                        ]
                    },
                )?);
            }
            stages.evidence.push(self.stage(Kernel::Evidence, plan, z, &base, Some(l.width), |rows| {
                vec![
                    Binding::rows(&b.cost, cost_words, rows),
                    Binding::rows(&b.evidence, l.pitch, rows),
                    Binding::rows(&b.belief, 2 * l.pitch, rows),
                ]
            })?);
            let params = Params { tau: plan.dependency.tau.into(), ..base };
            stages.dependency.push(self.stage(
                Kernel::Dependency,
                plan,
                z,
                &params,
                Some(l.width),
                |rows| {
                    vec![
                        Binding::rows(&b.members, l.member_pitch, rows),
                        Binding::rows(&b.belief, 2 * l.pitch, &with_halo(rows, 3, l.height)),
                        Binding::rows(&b.dependency, l.dependency_pitch, rows),
                    ]
                },
            )?);
            let incoming = |rows: &Range<u32>| {
                let bytes = |row: u32| 4 * u64::from(b.incoming_rows[row as usize]);
                Binding { buffer: b.incoming.clone(), bytes: bytes(rows.start)..bytes(rows.end) }
            };
            let threads = Some(l.width * (l.quads / 4));
            stages.belief.push(self.stage(Kernel::Belief, plan, z, &base, threads, |rows| {
                vec![
                    Binding::rows(&b.evidence, l.pitch, rows),
                    Binding::rows(&b.dependency, l.dependency_pitch, &with_halo(rows, 3, l.height)),
                    Binding::rows(&b.starts, l.starts_pitch, rows),
                    incoming(rows),
                    if z + 1 == state.levels.len() {
                        Binding::whole(&b.down)
                    } else {
                        Binding::rows(&b.down, words * l.pitch, rows)
                    },
                    if z == 0 { Binding::whole(&b.up) } else { Binding::rows(&b.up, words * l.pitch, rows) },
                    Binding::rows(&b.belief, 2 * l.pitch, rows),
                ]
            })?);
            if z == 0 {
                stages.estimate = self.estimate_stages(plan, &base, b, state)?;
                stages.change = self.change_stages(plan, &base, &b.belief, state)?;
            }
        }
        Ok(stages)
    }

    fn cost_stages(
        &mut self,
        plan: &Plan,
        pair: &Pair,
        base: &Params,
        cost: &wgpu::Buffer,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let images = [
            self.uploaded("left", &image_words(pair.left(), l.pixel_pitch))?,
            self.uploaded("right", &image_words(pair.right(), l.pixel_pitch))?,
        ];
        let image_rows =
            |image: &wgpu::Buffer, rows: &Range<u32>| Binding::rows(image, 4 * l.pixel_pitch, rows);
        if plan.method.cost == Cost::Sad {
            let threads = Some(l.width.div_ceil(8) * l.quads);
            return self.stage(Kernel::Sad, plan, 0, base, threads, |rows| {
                let seen = with_halo(rows, plan.method.sad_window / 2, l.height);
                vec![
                    image_rows(&images[0], &seen),
                    image_rows(&images[1], &seen),
                    Binding::rows(cost, l.pitch, rows),
                ]
            });
        }
        let words = 2 * u64::from(l.pixel_pitch) * u64::from(l.height);
        let census = [self.buffer("left census", words)?, self.buffer("right census", words)?];
        let census_rows =
            |census: &wgpu::Buffer, rows: &Range<u32>| Binding::rows(census, 2 * l.pixel_pitch, rows);
        let mut dispatches = Vec::new();
        for (image, census) in images.iter().zip(&census) {
            dispatches.extend(self.stage(Kernel::Census, plan, 0, base, Some(l.width), |rows| {
                vec![image_rows(image, &with_halo(rows, 3, l.height)), census_rows(census, rows)]
            })?);
        }
        let entries: Vec<u32> =
            tables::ad_cost().into_iter().chain(tables::census_cost()).map(u32::from).collect();
        let table = self.uploaded("tables", &entries)?;
        dispatches.extend(self.stage(Kernel::AdCensus, plan, 0, base, Some(l.width * l.quads), |rows| {
            vec![
                image_rows(&images[0], rows),
                image_rows(&images[1], rows),
                census_rows(&census[0], rows),
                census_rows(&census[1], rows),
                Binding::whole(&table),
                Binding::rows(cost, l.pitch, rows),
            ]
        })?);
        Ok(dispatches)
    }

    fn estimate_stages(
        &mut self,
        plan: &Plan,
        base: &Params,
        level: &LevelBuffers,
        state: &Buffers,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let belief_rows = |rows: &Range<u32>| Binding::rows(&level.belief, 2 * l.pitch, rows);
        let peak_rows = |rows: &Range<u32>| Binding::rows(&state.peaks, 2 * l.pixel_pitch, rows);
        let threads = Some(l.width);
        let mut dispatches = self.stage(Kernel::Estimate, plan, 0, base, threads, |rows| {
            vec![belief_rows(rows), peak_rows(rows)]
        })?;
        dispatches.extend(self.stage(Kernel::SubPixel, plan, 0, base, threads, |rows| {
            let seen = with_halo(rows, 1, l.height);
            vec![
                Binding::rows(&level.cost, l.pitch, &seen),
                peak_rows(&seen),
                Binding::rows(&state.offsets, l.pixel_pitch, rows),
            ]
        })?);
        dispatches.extend(self.stage(Kernel::RightView, plan, 0, base, threads, |rows| {
            vec![belief_rows(rows), Binding::rows(&state.right_labels, l.pixel_pitch, rows)]
        })?);
        Ok(dispatches)
    }

    fn change_stages(
        &mut self,
        plan: &Plan,
        base: &Params,
        belief: &wgpu::Buffer,
        state: &Buffers,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let words = u64::from(l.pixel_pitch) * u64::from(l.height);
        let (labels, squares) = (self.buffer("labels", words)?, self.buffer("squares", words)?);
        let mut dispatches = self.stage(Kernel::Change, plan, 0, base, Some(l.width), |rows| {
            vec![
                Binding::rows(belief, 2 * l.pitch, rows),
                Binding::rows(&labels, l.pixel_pitch, rows),
                Binding::rows(&squares, l.pixel_pitch, rows),
            ]
        })?;
        dispatches.extend(self.stage(Kernel::ChangeSum, plan, 0, base, None, |rows| {
            vec![Binding::rows(&squares, l.pixel_pitch, rows), Binding::whole(&state.change_sums)]
        })?);
        Ok(dispatches)
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

/// Pixels as the shaders read them: red | green << 16, blue | grey << 16, 1 if masked, 0.
fn image_words(image: &Image, pitch: u32) -> Vec<u32> {
    let pitch = 4 * pitch as usize;
    let mut words = vec![0; pitch * image.height()];
    for (y, row) in words.chunks_exact_mut(pitch).enumerate() {
        let pixels = image.pixels.row(y).iter().zip(image.masked.row(y));
        for (out, (pixel, &masked)) in row.chunks_exact_mut(4).zip(pixels) {
            let [r, g, b, grey] = pixel.map(u32::from);
            out.copy_from_slice(&[r | g << 16, b | grey << 16, masked.into(), 0]);
        }
    }
    words
}

/// Codes of the factors' neighbours, four a word.
fn member_words(graph: &LevelGraph, params: &LevelParams) -> Vec<u32> {
    let neighbours = graph.slots() - 1;
    let (per_pixel, pitch) = (neighbours.div_ceil(4), params.member_pitch as usize);
    let mut words = vec![u32::MAX; pitch * graph.height()];
    if neighbours > 0 {
        for (factor, codes) in graph.codes().chunks_exact(neighbours).enumerate() {
            let (x, y) = (factor % graph.width(), factor / graph.width());
            for (slot, &code) in codes.iter().enumerate() {
                let word = &mut words[y * pitch + x * per_pixel + slot / 4];
                let shift = 8 * (slot % 4);
                *word = *word & !(0xff << shift) | u32::from(code) << shift;
            }
        }
    }
    words
}

/// The transposed table as the shader reads it: where each pixel's entries start, the entries, and where each row's
/// entries start, aligned so that any rows can be bound.
fn transposed(graph: &LevelGraph, params: &LevelParams) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let (width, slots, pitch) = (graph.width(), graph.slots(), params.starts_pitch as usize);
    let mut starts = vec![0; pitch * graph.height()];
    let mut entries = Vec::with_capacity(graph.incoming().len() + kernels::ALIGN_WORDS * graph.height());
    let mut rows = vec![0];
    for (y, starts) in starts.chunks_exact_mut(pitch).enumerate() {
        for (x, start) in starts[..width].iter_mut().enumerate() {
            *start = entries.len() as u32;
            for &entry in graph.incoming_of(y * width + x) {
                let (factor, slot) = (entry as usize / slots, entry as usize % slots);
                // From the pixel to the factor: against the way from the factor to its member.
                let dx = (factor % width) as i32 - x as i32;
                let dy = (factor / width) as i32 - y as i32;
                entries.push((dx + 3) as u32 | ((dy + 3) as u32) << 3 | (slot as u32) << 6);
            }
        }
        starts[width] = entries.len() as u32;
        entries.resize(entries.len().next_multiple_of(kernels::ALIGN_WORDS), 0);
        rows.push(entries.len() as u32);
    }
    (starts, entries, rows)
}
