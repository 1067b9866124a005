//! The GPU path: wgpu on Vulkan or Metal, one shader or a few a stage.
//!
//! Volumes are \[y\]\[slot\]\[quad\]\[x\]: four labels of all pixels of a row, then the next four, and so of one slot after the
//! other, packed four 8-bit or two 16-bit values a word; labels are padded to blocks of 16. Rows start at multiples of 256
//! bytes, so that any rows of a volume can be bound: where a volume exceeds what a device lets a shader see at once, a stage
//! runs band by band, each band bound with the rows above and below that it reads; where it exceeds the largest buffer, it is
//! several (`buffers`). The pair goes up once, the maps come down once, and in between nothing leaves the device.
//! Where message passing stops by itself, [`Stage::Change`] decides that there: from then on, it makes the dispatches of the
//! messages empty.

mod buffers;
mod convergence;
mod device;
mod probe;
mod shader;
mod steps;
mod timer;
mod uniform;
mod upload;
mod words;

use super::probe::Probe;
use super::{Backend, Map, Requests, Stage, Ticket, Traffic};
use crate::error::{Purpose, Result};
use crate::front::Prepared;
use crate::image::Plane;
use crate::maps::Maps;
use crate::memory;
use crate::plan::{LevelPlan, Plan};
use buffers::{Buffers, LevelBuffers, Rows, Shared};
use convergence::Convergence;
use device::Device;
pub use device::{DeviceInfo, FaultInjection, devices, has_automatic, may_have_gpu};
pub use shader::{Constant, Kernel};
use std::collections::HashMap;
use std::mem;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};
use steps::{Groups, Pipelines, Recorder, Step};
pub use steps::{Job, MAX_LOOP_ITERATIONS};
use timer::{PASSES_PER_SUBMIT, Timer};
pub use uniform::UniformLayout;
use words::{image_words, label_range_words, narrow_words};

macro_rules! declare {
    (
        levels { $( $(#[$_of_level:meta])* $level:ident $level_name:ident; )* }
        finest { $( $(#[$_of_finest:meta])* $finest:ident $finest_name:ident; )* }
        maps { $( $(#[$_of_map:meta])* $map:ident $map_name:ident; )* }
    ) => {
        $( mod $level_name; )*
        $( mod $finest_name; )*
        $( mod $map_name; )*

        /// What `stage` runs of its shader, for `plan`, without a device.
        #[must_use]
        pub fn jobs(stage: Stage, plan: &Plan) -> Vec<Job> {
            match stage {
                $( Stage::$level(z) => $level_name::jobs(plan, z), )*
                $( Stage::$finest => $finest_name::jobs(plan, 0), )*
                $( Stage::$map => $map_name::jobs(plan, 0), )*
            }
        }

        fn record(recorder: &mut Recorder, stage: Stage) -> Result<()> {
            match stage {
                $( Stage::$level(_) => $level_name::record(recorder), )*
                $( Stage::$finest => $finest_name::record(recorder), )*
                $( Stage::$map => $map_name::record(recorder), )*
            }
        }
    };
}

crate::for_every_stage!(declare);

/// What a match by `plan` may run, beside the [`jobs`] of its stages.
#[must_use]
pub fn other_jobs(plan: &Plan) -> Vec<Job> {
    upload::jobs(plan)
}

/// The GPU path on one device.
pub struct Gpu {
    device: Device,
    pipelines: Pipelines,
    encoder: Option<wgpu::CommandEncoder>,
    passes: usize,
    work: u64,
    timer: Option<Timer>,
    /// The same stage at one level after the other, which can run together.
    waiting: Vec<Stage>,
    state: Option<State>,
    requests: Requests<RequestedMaps>,
}

/// The steps of a stage at its level and the next ones, so many together.
type Steps = HashMap<(Stage, usize), Arc<[Step]>>;

/// Records a stage at several levels at once.
type RecordLevels = fn(&mut Recorder, &Shared, Range<usize>) -> Result<()>;

/// How `stage` goes over levels at once, where it can.
fn record_levels(stage: Stage) -> Option<RecordLevels> {
    match stage {
        Stage::Graph(_) => Some(graph::record_levels),
        Stage::Dependency(_) => Some(dependency::record_levels),
        Stage::Resolution(_) => Some(resolution::record_levels),
        Stage::Belief(_) => Some(belief::record_levels),
        _ => None,
    }
}

/// Whether all that `stage` reads and writes is shared.
fn can_share(stage: Stage, shared: &Shared) -> bool {
    match stage {
        Stage::Resolution(z) => z > shared.finest,
        stage => stage.level().is_some_and(|z| z >= shared.finest),
    }
}

/// The same stage at the next coarser level, where the two can run together.
fn next_level(stage: Stage) -> Option<Stage> {
    match stage {
        Stage::Graph(z) => Some(Stage::Graph(z + 1)),
        Stage::Dependency(z) => Some(Stage::Dependency(z + 1)),
        Stage::Resolution(z) => Some(Stage::Resolution(z + 1)),
        Stage::Belief(z) => Some(Stage::Belief(z + 1)),
        Stage::Flood(z) => Some(Stage::Flood(z + 1)),
        _ => None,
    }
}

/// Everything that belongs to one plan.
struct State {
    plan: Plan,
    buffers: Buffers,
    steps: Steps,
    /// Those of [`upload`].
    upload: Arc<[Step]>,
    /// Words of an image on their way up.
    words: Vec<u32>,
}

impl State {
    /// Whether `stage` may wait for others that run together with it.
    fn may_wait(&self, stage: Stage) -> bool {
        next_level(stage).is_some() && self.buffers.shared.as_ref().is_some_and(|s| can_share(stage, s))
    }
}

impl Gpu {
    /// Opens the device that `wanted` names, by its index or a part of its name, or the best there is.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when there is no driver or the device cannot be opened, [`crate::Error::Option`] when no device has
    /// that name.
    pub fn new(wanted: Option<&str>) -> Result<Self> {
        Self::with_faults(wanted, FaultInjection::default())
    }

    /// As [`Gpu::new`], with faults.
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
            waiting: Vec::new(),
            state: None,
            requests: Requests::default(),
        })
    }

    /// The steps of `stage` for `plan` on these buffers.
    fn steps(&mut self, stage: Stage, plan: &Plan, buffers: &Buffers) -> Result<Arc<[Step]>> {
        self.recorded(stage.level().unwrap_or(0), plan, buffers, None, |recorder| record(recorder, stage))
    }

    /// The steps of all stages, at single levels and where these share buffers at several together.
    fn all_steps(&mut self, plan: &Plan, buffers: &mut Buffers) -> Result<Steps> {
        let mut steps = HashMap::new();
        let mut endings = Vec::new();
        for stage in Stage::all(plan).into_iter().filter(|stage| *stage != Stage::Change) {
            let is_message = matches!(stage, Stage::Dependency(_) | Stage::Resolution(_) | Stage::Belief(_));
            let ends = is_message && plan.settled_change().is_some();
            let ending = ends.then_some(&mut endings);
            let level = stage.level().unwrap_or(0);
            let recorded = self.recorded(level, plan, buffers, ending, |recorder| record(recorder, stage))?;
            steps.insert((stage, 1), recorded);
            let Some(shared) = &buffers.shared else { continue };
            for end in level + 2..=plan.levels.len() {
                let Some(record) = record_levels(stage).filter(|_| can_share(stage, shared)) else { break };
                let ending = ends.then_some(&mut endings);
                let recorded = self.recorded(level, plan, buffers, ending, |recorder| {
                    record(recorder, shared, level..end)
                })?;
                steps.insert((stage, end - level), recorded);
            }
        }
        // This stage makes the dispatches of messages empty: it comes when these are known.
        buffers.end_when_settled(&mut self.device, &endings)?;
        steps.insert((Stage::Change, 1), self.steps(Stage::Change, plan, buffers)?);
        Ok(steps)
    }

    /// The steps that `record` records at `level`.
    fn recorded<'a>(
        &'a mut self,
        level: usize,
        plan: &'a Plan,
        buffers: &'a Buffers,
        endings: Option<&'a mut Vec<[u32; 3]>>,
        record: impl FnOnce(&mut Recorder<'a>) -> Result<()>,
    ) -> Result<Arc<[Step]>> {
        let Self { device, pipelines, .. } = self;
        let mut recorder = Recorder { device, pipelines, plan, buffers, level, endings, steps: Vec::new() };
        record(&mut recorder)?;
        Ok(recorder.steps.into())
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
                    let (mut work, most) = (self.work, self.device.work_per_submit);
                    let groups = self.state.as_ref().map(|state| state.buffers.groups.clone());
                    {
                        let mut pass = self.encoder()?.begin_compute_pass(&wgpu::ComputePassDescriptor {
                            label: None,
                            timestamp_writes: writes,
                        });
                        recorded = 0;
                        while let Some(Step::Dispatch(dispatch)) = rest.get(recorded) {
                            pass.set_pipeline(&dispatch.pipeline);
                            pass.set_bind_group(0, &dispatch.bind_group, &[]);
                            match &dispatch.groups {
                                Groups::Fixed(x, y) => pass.dispatch_workgroups(*x, *y, 1),
                                Groups::UntilSettled(at) => {
                                    let groups = groups.as_ref().expect("a stage has a state to run on");
                                    pass.dispatch_workgroups_indirect(groups, 12 * *at as u64);
                                }
                            }
                            work += dispatch.work;
                            recorded += 1;
                            if work >= most {
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
            let timed = self.timer.is_some() && self.passes >= PASSES_PER_SUBMIT;
            if timed || self.work >= self.device.work_per_submit {
                self.submit_recorded()?;
            }
        }
        Ok(())
    }

    /// Records the stages that wait.
    fn gather(&mut self) -> Result<()> {
        let waiting = mem::take(&mut self.waiting);
        let Some(&first) = waiting.first() else { return Ok(()) };
        let parts = if matches!(first, Stage::Flood(_)) { 0..2 } else { 0..1 };
        for part in parts {
            let stages = waiting.iter().map(|&stage| match stage {
                Stage::Flood(z) => flood::parts(z)[part],
                stage => stage,
            });
            let stages: Vec<Stage> = stages.collect();
            let state = self.state();
            let steps = match state.steps.get(&(stages[0], stages.len())) {
                Some(steps) => vec![Arc::clone(steps)],
                None => stages.iter().map(|stage| Arc::clone(&state.steps[&(*stage, 1)])).collect(),
            };
            for steps in steps {
                self.record(&steps)?;
            }
        }
        Ok(())
    }

    /// Submits everything.
    fn submit(&mut self) -> Result<()> {
        self.gather()?;
        self.submit_recorded()
    }

    fn submit_recorded(&mut self) -> Result<()> {
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
    fn request(&mut self, ranges: &[(wgpu::Buffer, Range<u64>)]) -> Result<device::Requested> {
        self.gather()?;
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
        self.device.request(staged)
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
        let joined = |n| words.by_ref().take(n).reduce(|all, part| [all, part].concat()).unwrap_or_default();
        Ok(rows.counts.into_iter().map(joined).collect())
    }

    /// The words of all rows.
    fn rows(&mut self, rows: &[&Rows]) -> Result<Vec<Vec<u32>>> {
        let requested = self.request_rows(rows)?;
        self.collect_rows(requested)
    }

    fn state(&self) -> &State {
        self.state.as_ref().expect("prepare comes before every stage")
    }

    /// Puts the pair and its label ranges into the buffers, and messages at their start.
    fn load(&mut self, state: &mut State, prepared: &Prepared) -> Result<()> {
        let State { plan, buffers, words, upload, .. } = state;
        let device = &mut self.device;
        let (pair, pitch) = (&prepared.pair, buffers.levels[0].params.pixel_pitch);
        let mut narrow = true;
        for (image, spare) in [(pair.left(), &buffers.spare_disparity), (pair.right(), &buffers.spare_flags)]
        {
            narrow = narrow && narrow_words(image, pitch, words);
            if narrow {
                spare.write(device, words)?;
            }
        }
        if !narrow {
            buffers.left.write(device, &image_words(pair.left(), pitch))?;
            buffers.right.write(device, &image_words(pair.right(), pitch))?;
        }
        for (z, (level, l)) in buffers.levels.iter().zip(&plan.levels).enumerate() {
            if plan.limits_labels() {
                let words = |ranges: &Plane<_>| label_range_words(ranges, &level.params);
                let all = || words(&Plane::filled(l.width, l.height, [0, l.labels as u16 - 1]));
                level.label_range.write(device, &prepared.label_ranges.get(z).map_or_else(all, words))?;
            }
        }
        let zeroed = buffers.levels.iter().flat_map(LevelBuffers::messages).chain([&buffers.labels]);
        let encoder = self.encoder()?;
        for (buffer, place) in zeroed.flat_map(Rows::held) {
            encoder.clear_buffer(buffer, place.start, Some(place.end - place.start));
        }
        for level in &buffers.levels {
            for (windows, place) in level.windows.held() {
                let size = place.end - place.start;
                encoder.copy_buffer_to_buffer(&level.full_windows, 0, windows, place.start, size);
            }
        }
        encoder.clear_buffer(&buffers.convergence, 0, None);
        let size = buffers.all_groups.size();
        encoder.copy_buffer_to_buffer(&buffers.all_groups, 0, &buffers.groups, 0, size);
        if narrow {
            // No run of a stage.
            let timer = self.timer.take();
            self.record(upload)?;
            self.timer = timer;
        }
        self.device.check()
    }

    fn convergence_at(&self) -> (wgpu::Buffer, Range<u64>) {
        (self.state().buffers.convergence.clone(), 0..size_of::<Convergence>() as u64)
    }

    /// What [`Stage::Change`] has found so far.
    fn convergence(&mut self) -> Result<Convergence> {
        let at = self.convergence_at();
        let requested = self.request(&[at])?;
        Ok(Convergence::of(&self.device.collect(requested)?[0]))
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

/// A plane of what `value` makes of the words of a map, which has so many (columns, rows, words a row).
fn plane<T>(
    words: &[u32],
    (width, height, pitch): (usize, usize, usize),
    value: impl Fn(u32) -> T,
) -> Plane<T> {
    let mut values = Vec::with_capacity(width * height);
    for row in words.chunks_exact(pitch) {
        values.extend(row[..width].iter().map(|&word| value(word)));
    }
    Plane::new(width, height, values)
}

/// Maps on their way from the device.
struct RequestedMaps {
    /// Disparity, raw disparity, flags; and where message passing may stop by itself, its [`Convergence`].
    parts: device::Requested,
    shape: (usize, usize, usize),
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn driver(&self) -> Option<String> {
        Some(self.device.driver.clone())
    }

    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()> {
        if self.state.as_ref().is_some_and(|state| plan.fits(&state.plan)) {
            // The maps stay, as all that was asked for leaves them.
            self.submit()?;
        }
        (self.encoder, self.passes, self.work) = (None, 0, 0);
        self.waiting.clear();
        self.device.traffic = Traffic::default();
        let mut state = match self.state.take() {
            Some(mut state) if plan.fits(&state.plan) => {
                if state.plan.core != plan.core {
                    state.plan = plan.clone();
                    let steps = self.steps(Stage::RightView, plan, &state.buffers)?;
                    state.steps.insert((Stage::RightView, 1), steps);
                }
                state
            }
            other => {
                // What the last match holds goes before the next one asks for more.
                drop(other);
                if self.device.software {
                    memory::check(plan.whole().bytes(), Purpose::Match)?;
                }
                let mut buffers = Buffers::new(&mut self.device, plan)?;
                let steps = self.all_steps(plan, &mut buffers)?;
                let upload = self.recorded(0, plan, &buffers, None, |recorder| upload::record(recorder))?;
                let words = buffers.levels[0].params.pixel_pitch as usize * plan.size().1;
                State { plan: plan.clone(), buffers, steps, upload, words: vec![0; words] }
            }
        };
        self.load(&mut state, &prepared)?;
        self.device.traffic.bytes_held = state.buffers.bytes();
        self.state = Some(state);
        Ok(())
    }

    fn run(&mut self, stage: Stage) -> Result<()> {
        if self.timer.is_none() && self.state().may_wait(stage) {
            for _ in 0..if matches!(stage, Stage::Flood(_)) { 2 } else { 1 } {
                self.device.count_stage();
            }
            if self.waiting.last().is_some_and(|&last| next_level(last) != Some(stage)) {
                self.gather()?;
            }
            self.waiting.push(stage);
            return self.device.check();
        }
        self.gather()?;
        if let Stage::Flood(z) = stage {
            return flood::parts(z).into_iter().try_for_each(|part| self.run(part));
        }
        self.device.count_stage();
        let steps = Arc::clone(&self.state().steps[&(stage, 1)]);
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

    fn settled(&mut self, wait: bool) -> Result<bool> {
        // Where times are kept, idle iterations are not to be among them.
        Ok((wait || self.timer.is_some()) && self.convergence()?.settled())
    }

    fn idle_iterations(&mut self) -> Result<u32> {
        if self.state().plan.settled_change().is_none() {
            return Ok(0);
        }
        Ok(self.convergence()?.idle())
    }

    fn wait(&mut self) -> Result<()> {
        self.submit()?;
        self.device.wait()
    }

    fn map(&mut self, map: Map) -> Result<Plane<i32>> {
        self.map_values(map)
    }

    fn request_maps(&mut self) -> Result<Ticket> {
        let b = &self.state().buffers;
        let (disparity, raw, flags) = (b.disparity.clone(), b.raw.clone(), b.flags.clone());
        let mut parts: Vec<_> = [disparity, raw, flags].iter().flat_map(Rows::own).collect();
        parts.extend(self.state().plan.settled_change().map(|_| self.convergence_at()));
        let parts = self.request(&parts)?;
        let shape = self.map_shape();
        Ok(self.requests.add(RequestedMaps { parts, shape }))
    }

    fn maps(&mut self, ticket: Ticket) -> Result<(Maps, u32)> {
        let RequestedMaps { parts, shape } = self.requests.take(&ticket);
        self.device.read(parts, |words| {
            let maps = Maps {
                disparity: plane(words[0], shape, u32::cast_signed),
                raw: plane(words[1], shape, u32::cast_signed),
                confidence: plane(words[2], shape, |word| (word >> 8) as u8),
                validity: plane(words[2], shape, |word| word as u8),
                right: None,
            };
            (maps, words.get(3).map_or(0, |words| Convergence::of(words).idle()))
        })
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.timer = on.then(|| Timer::new(&self.device)).transpose()?;
        Ok(())
    }

    fn times(&mut self) -> Result<Vec<(Stage, Duration)>> {
        self.wait()?;
        self.timer.as_mut().map_or(Ok(Vec::new()), |timer| timer.times(&mut self.device))
    }

    fn cells(&self) -> Vec<u64> {
        self.state().plan.levels.iter().map(LevelPlan::cells).collect()
    }

    fn traffic(&self) -> Traffic {
        self.device.traffic
    }

    fn probe(&mut self) -> &mut dyn Probe {
        self
    }
}
