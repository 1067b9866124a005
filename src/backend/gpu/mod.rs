//! The GPU path: wgpu on Vulkan or Metal, one shader or a few a stage.
//!
//! Volumes are \[y\]\[slot\]\[quad\]\[x\]: four labels of all pixels of a row, then the next four, and so of one slot after the
//! other, packed four 8-bit or two 16-bit values a word; labels are padded to blocks of 16. Rows start at multiples of 256
//! bytes, so that any rows of a volume can be bound: where a volume exceeds what a device lets a shader see at once, a stage
//! runs band by band, each band bound with the rows above and below that it reads; where it exceeds the largest buffer, it is
//! several (`buffers`). The pair and its graph go up once, the maps come down once, and in between nothing leaves the device
//! but the sum of [`Stage::Change`].

mod buffers;
mod device;
mod kernels;
mod stages;
mod timer;
mod upload;
mod values;

use super::{Backend, Map, Requested, Stage, Traffic, Volume};
use crate::error::{DeviceError, Error, Purpose, Result};
use crate::graph::LevelGraph;
use crate::image::{Pair, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::plan::{LevelPlan, Plan};
use crate::weights::MedianWeights;
use buffers::{Buffers, LevelBuffers, Rows};
use device::Device;
pub use device::{DeviceInfo, FaultInjection, devices, has_automatic, may_have_gpu};
pub use kernels::{Kernel, LevelParams, Params, Variant};
use stages::{Step, Steps};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use timer::Timer;
use upload::{image_words, member_words, transposed};

/// Largest number of iterations of all loops of one invocation together.
pub const MAX_LOOP_ITERATIONS: usize = 32_768;
/// Passes recorded before they are submitted.
const PASSES_PER_SUBMIT: usize = 16;
/// Iterations of all loops of all invocations that are submitted at once, about: short enough for drivers that stop
/// long jobs, and for a bar that moves.
const WORK_PER_SUBMIT: u64 = 1 << 30;
const WORKGROUP: u32 = 64;
/// What [`Gpu::copy_rate`] copies, how often it tries, and how long the copies of a try must take together, so that what a
/// submission takes of itself no longer counts.
const COPIED_BYTES: u64 = 1 << 28;
const COPY_TRIES: u32 = 12;
const LONG_COPY: Duration = Duration::from_millis(100);

/// The GPU path on one device.
pub struct Gpu {
    device: Device,
    pipelines: HashMap<(Kernel, Variant), wgpu::ComputePipeline>,
    encoder: Option<wgpu::CommandEncoder>,
    passes: usize,
    work: u64,
    timer: Option<Timer>,
    state: Option<State>,
}

/// Everything that belongs to one plan.
struct State {
    plan: Plan,
    buffers: Buffers,
    steps: Steps,
}

impl Gpu {
    /// Opens the device that `wanted` names, by its index or a part of its name, or the best there is.
    ///
    /// # Errors
    /// [`Error::Device`] when there is no driver or the device cannot be opened, [`Error::Option`] when no device has
    /// that name.
    pub fn new(wanted: Option<&str>) -> Result<Self> {
        Self::with_faults(wanted, FaultInjection::default())
    }

    /// As [`Gpu::new`], with a faults.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn with_faults(wanted: Option<&str>, faults: FaultInjection) -> Result<Self> {
        Ok(Self {
            device: Device::open(wanted, faults)?,
            pipelines: HashMap::new(),
            encoder: None,
            passes: 0,
            work: 0,
            timer: None,
            state: None,
        })
    }

    /// The rate at which the device copies from one large buffer to another: bytes read and written a second.
    ///
    /// # Errors
    /// [`Error::Memory`] when there is no room for two such buffers, [`Error::Device`] when the device fails.
    pub fn copy_rate(&mut self) -> Result<f64> {
        let size = COPIED_BYTES.min(self.device.max_buffer) & !3;
        let buffer = || {
            let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
            let descriptor =
                wgpu::BufferDescriptor { label: Some("copy"), size, usage, mapped_at_creation: false };
            Ok::<_, Error>(self.device.inner()?.create_buffer(&descriptor))
        };
        let (from, to) = (buffer()?, buffer()?);
        let mut time = |copies: u64| {
            let start = Instant::now();
            for _ in 0..copies {
                self.encoder()?.copy_buffer_to_buffer(&from, 0, &to, 0, size);
            }
            self.wait()?;
            Ok::<_, Error>(start.elapsed())
        };
        // Memory is given at first touch.
        time(1)?;
        let (mut best, mut copies) = (0.0, 1);
        for _ in 0..COPY_TRIES {
            let time = time(copies)?;
            best = f64::max(best, (2 * copies * size) as f64 / time.as_secs_f64());
            if time < LONG_COPY {
                copies *= 2;
            }
        }
        Ok(best)
    }

    /// The pipeline of `kernel` at `level`, compiled on first use.
    fn pipeline(&mut self, kernel: Kernel, plan: &Plan, level: usize) -> Result<wgpu::ComputePipeline> {
        let loops = kernel.loop_iterations(plan, level);
        if loops > MAX_LOOP_ITERATIONS {
            let LevelPlan { width, height, labels, .. } = plan.levels[0];
            let (neighbours, shader) = (plan.neighbours, kernel.name());
            return Err(DeviceError::TooLargeForShader { width, height, labels, neighbours, shader }.into());
        }
        let variant = Variant::new(kernel, plan, level);
        if let Some(pipeline) = self.pipelines.get(&(kernel, variant)) {
            return Ok(pipeline.clone());
        }
        let device = self.device.inner()?;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.name()),
            source: wgpu::ShaderSource::Wgsl(kernel.source(variant).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
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

    fn encoder(&mut self) -> Result<&mut wgpu::CommandEncoder> {
        if self.encoder.is_none() {
            let descriptor = wgpu::CommandEncoderDescriptor::default();
            self.encoder = Some(self.device.inner()?.create_command_encoder(&descriptor));
        }
        Ok(self.encoder.as_mut().expect("just made"))
    }

    /// Records steps, and submits whenever enough is recorded.
    fn record(&mut self, steps: &[Step]) -> Result<()> {
        let mut rest = steps;
        while let Some(first) = rest.first() {
            let mut recorded = 1;
            match first {
                Step::Copy(copy) => {
                    let (from, to) = (&copy.from, &copy.to);
                    self.encoder()?.copy_buffer_to_buffer(&from.0, from.1, &to.0, to.1, copy.bytes);
                }
                Step::Dispatch(_) => {
                    let mut timer = self.timer.take();
                    let writes = timer.as_mut().and_then(Timer::pass);
                    let mut work = self.work;
                    {
                        let mut pass = self.encoder()?.begin_compute_pass(&wgpu::ComputePassDescriptor {
                            label: None,
                            timestamp_writes: writes,
                        });
                        recorded = 0;
                        while let Some(Step::Dispatch(dispatch)) = rest.get(recorded) {
                            pass.set_pipeline(&dispatch.pipeline);
                            pass.set_bind_group(0, &dispatch.bind_group, &[]);
                            pass.dispatch_workgroups(dispatch.groups.0, dispatch.groups.1, 1);
                            work += dispatch.work;
                            recorded += 1;
                            if work >= WORK_PER_SUBMIT {
                                break;
                            }
                        }
                    }
                    self.timer = timer;
                    self.work = work;
                    self.passes += 1;
                    self.device.traffic.dispatches += recorded as u64;
                }
            }
            rest = &rest[recorded..];
            if self.passes >= PASSES_PER_SUBMIT || self.work >= WORK_PER_SUBMIT {
                self.submit()?;
            }
        }
        Ok(())
    }

    fn submit(&mut self) -> Result<()> {
        (self.passes, self.work) = (0, 0);
        if let Some(mut encoder) = self.encoder.take() {
            if let Some(timer) = &mut self.timer {
                timer.submit(&self.device, &mut encoder)?;
            }
            self.device.submit(encoder)?;
        }
        self.device.check()
    }

    /// Asks for each range of bytes, after everything recorded so far.
    fn request(&mut self, ranges: &[(wgpu::Buffer, std::ops::Range<u64>)]) -> Result<device::Requested> {
        let mut staged = Vec::new();
        for (buffer, bytes) in ranges {
            let size = bytes.end - bytes.start;
            let staging = self.device.inner()?.create_buffer(&wgpu::BufferDescriptor {
                label: Some("staging"),
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            self.encoder()?.copy_buffer_to_buffer(buffer, bytes.start, &staging, 0, size);
            staged.push(staging);
        }
        self.submit()?;
        Ok(self.device.request(staged))
    }

    /// Asks for the words of all rows.
    fn request_rows(&mut self, rows: &[&Rows]) -> Result<RequestedRows> {
        let parts: Vec<_> = rows.iter().flat_map(|r| r.own()).collect();
        let counts = rows.iter().map(|r| r.own().len()).collect();
        Ok(RequestedRows { counts, parts: self.request(&parts)? })
    }

    /// The words of all rows that were asked for.
    fn collect_rows(&mut self, rows: RequestedRows) -> Result<Vec<Vec<u32>>> {
        let mut words = self.device.collect(rows.parts)?.into_iter();
        Ok(rows.counts.into_iter().map(|n| words.by_ref().take(n).collect::<Vec<_>>().concat()).collect())
    }

    /// The words of all rows.
    fn rows(&mut self, rows: &[&Rows]) -> Result<Vec<Vec<u32>>> {
        let requested = self.request_rows(rows)?;
        self.collect_rows(requested)
    }

    fn state(&self) -> &State {
        self.state.as_ref().expect("prepare comes before every stage")
    }

    /// Puts the pair and its graphs into the buffers, and messages at their start.
    fn load(&mut self, state: &mut State, pair: &Pair, graphs: &[LevelGraph]) -> Result<()> {
        let State { plan, buffers, steps } = state;
        let device = &mut self.device;
        let pitch = buffers.levels[0].params.pixel_pitch;
        buffers.left.write(device, &image_words(pair.left(), pitch))?;
        buffers.right.write(device, &image_words(pair.right(), pitch))?;
        for (weights, buffer) in [
            (MedianWeights::of(&plan.method), &buffers.median_weights),
            (MedianWeights::stretched(&plan.method), &buffers.stretched_weights),
        ] {
            device.write(buffer, bytemuck::cast_slice(&weights.words()))?;
        }
        for (level, graph) in buffers.levels.iter_mut().zip(graphs) {
            level.members.write(device, &member_words(graph, &level.params))?;
            level.write_incoming(device, transposed(graph, &level.params))?;
        }
        for z in 0..plan.levels.len() {
            steps.insert(Stage::Belief(z), self.belief(plan, buffers, z)?.into());
        }
        let zeroed = buffers.levels.iter().flat_map(LevelBuffers::messages).chain([&buffers.labels]);
        let encoder = self.encoder()?;
        for buffer in zeroed.flat_map(Rows::buffers) {
            encoder.clear_buffer(buffer, 0, None);
        }
        self.device.check()
    }

    /// Width, height, and elements in a row of maps.
    fn map_shape(&self) -> (usize, usize, usize) {
        let (width, height) = self.state().plan.size();
        (width, height, self.state().buffers.levels[0].params.pixel_pitch as usize)
    }
}

/// Rows on their way from the device, each in so many parts.
struct RequestedRows {
    counts: Vec<usize>,
    parts: device::Requested,
}

/// Maps on their way from the device.
pub struct RequestedMaps {
    rows: RequestedRows,
    shape: (usize, usize, usize),
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn driver(&self) -> Option<String> {
        Some(self.device.driver.clone())
    }

    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()> {
        (self.encoder, self.passes, self.work) = (None, 0, 0);
        self.device.traffic = Traffic::default();
        let mut state = match self.state.take() {
            Some(mut state) if plan.fits(&state.plan) => {
                if state.plan.core != plan.core {
                    state.plan = plan.clone();
                    state.steps.insert(Stage::RightView, self.right_view(plan, &state.buffers)?.into());
                }
                state
            }
            other => {
                // What the last match holds goes before the next one asks for more.
                drop(other);
                if self.device.software {
                    memory::check(plan.bytes(), Purpose::Match)?;
                }
                let buffers = Buffers::new(&self.device, plan)?;
                let steps = self.steps(plan, &buffers)?;
                State { plan: plan.clone(), buffers, steps }
            }
        };
        self.load(&mut state, pair, &graphs)?;
        self.device.traffic.bytes_held = state.buffers.all().iter().map(wgpu::Buffer::size).sum();
        self.state = Some(state);
        Ok(())
    }

    fn label_range(&mut self, label_ranges: &[Plane<[u16; 2]>]) -> Result<()> {
        for (z, label_range) in label_ranges.iter().enumerate() {
            let level = &self.state().buffers.levels[z];
            let (rows, pitch) = (level.label_range.clone(), level.params.pixel_pitch as usize);
            let mut words = vec![0; pitch * label_range.height()];
            for (y, row) in words.chunks_exact_mut(pitch).enumerate() {
                for (word, &[first, last]) in row.iter_mut().zip(label_range.row(y)) {
                    *word = u32::from(first) | u32::from(last) << 16;
                }
            }
            rows.write(&mut self.device, &words)?;
        }
        Ok(())
    }

    fn run(&mut self, stage: Stage) -> Result<()> {
        if let Stage::Flood(z) = stage {
            // The device goes over all pixels at once: there is nothing to gain by going over them together.
            self.run(Stage::Dependency(z))?;
            return self.run(Stage::Belief(z));
        }
        self.device.count_stage();
        let steps = Arc::clone(&self.state().steps[&stage]);
        let Some(timer) = &mut self.timer else { return self.record(&steps) };
        timer.begin(stage);
        if timer.has_clock() {
            return self.record(&steps);
        }
        let start = Instant::now();
        self.record(&steps)?;
        self.wait()?;
        if let Some(timer) = &mut self.timer {
            timer.measured(start.elapsed());
        }
        Ok(())
    }

    fn change(&mut self) -> Result<u64> {
        self.run(Stage::Change)?;
        let sums = self.state().buffers.change_sums.clone();
        let rows = self.state().plan.levels[0].height;
        let requested = self.request(&[(sums, 0..8 * rows as u64)])?;
        let words = self.device.collect(requested)?;
        Ok(words[0].chunks_exact(2).map(|half| u64::from(half[1]) << 32 | u64::from(half[0])).sum())
    }

    fn wait(&mut self) -> Result<()> {
        self.submit()?;
        self.device.wait()
    }

    fn request_maps(&mut self) -> Result<Requested> {
        let b = &self.state().buffers;
        let (disparity, raw, flags) = (b.disparity.clone(), b.raw.clone(), b.flags.clone());
        let rows = self.request_rows(&[&disparity, &raw, &flags])?;
        Ok(Requested::Device(RequestedMaps { rows, shape: self.map_shape() }))
    }

    fn maps(&mut self, requested: Requested) -> Result<Maps> {
        let RequestedMaps { rows, shape: (width, height, pitch) } = match requested {
            Requested::Here(maps) => return Ok(maps),
            Requested::Device(requested) => requested,
        };
        let words = self.collect_rows(rows)?;
        let plane = |i: usize| Plane::from_fn(width, height, |x, y| words[i][y * pitch + x].cast_signed());
        let byte =
            |bit: u32| Plane::from_fn(width, height, |x, y| (words[2][y * pitch + x] >> bit & 0xff) as u8);
        Ok(Maps { disparity: plane(0), raw: plane(1), confidence: byte(8), validity: byte(0) })
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.timer = on.then(|| Timer::new(&self.device)).transpose()?;
        Ok(())
    }

    fn times(&mut self) -> Result<Vec<(Stage, Duration)>> {
        self.wait()?;
        self.timer.as_mut().map_or(Ok(Vec::new()), |timer| timer.times(&mut self.device))
    }

    fn traffic(&self) -> Traffic {
        self.device.traffic
    }

    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        self.volume_values(volume)
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        self.set_volume_values(volume, values)
    }

    fn read_map(&mut self, map: Map) -> Result<Plane<i32>> {
        self.map_values(map)
    }

    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()> {
        self.set_map_values(map, values)
    }

    fn poison(&mut self, byte: u8) -> Result<()> {
        self.submit()?;
        let all = self.state().buffers.all().to_vec();
        for buffer in all {
            self.device.write(&buffer, &vec![byte; buffer.size() as usize])?;
        }
        Ok(())
    }
}
