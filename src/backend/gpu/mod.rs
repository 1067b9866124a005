//! The GPU path: wgpu on Vulkan or Metal, with one or a few shaders per stage.
//!
//! Volumes are \[y\]\[slot\]\[quad\]\[x\]: the first four labels of all pixels of a row, then the next four,
//! and so on, slot by slot, packed as four 8-bit or two 16-bit values per word; labels are padded to blocks
//! of 16. Rows start at multiples of 256 bytes, so that any rows of a volume can be bound. If a volume
//! exceeds the largest binding of a device, a stage runs in bands, each bound with the rows above and below
//! that it reads; if it exceeds the largest buffer, it is split into several (`buffers`). The pair is
//! uploaded once and the maps are downloaded once. If message passing may stop early, [`Stage::Change`]
//! decides that on the device, and then makes the dispatches of messages empty.

mod adapters;
mod allocator;
mod buffers;
mod commands;
mod convergence;
mod device;
mod encode;
mod fit;
mod frame;
mod kernel;
mod pace;
mod probe;
mod queue;
mod recording;
mod rows;
mod shader;
mod stages;
mod timer;
mod uniform;
mod words;

use super::probe::Probe;
use super::{Backend, Map, Promise, Requests, Stage, Ticket, Traffic};
use crate::error::{Error, Purpose, Result};
use crate::front::Prepared;
use crate::image::Plane;
use crate::maps::{FRACTION, Maps};
use crate::memory;
use crate::plan::{LevelPlan, Plan};
use crate::program::schedule::split;
use crate::program::{Program, Run, Sent, SentMessages, joined, sharing, together};
use crate::stage::prior::LabelPrior;
use crate::stage::{Data, NO_ANCHOR};
pub(crate) use adapters::has_automatic_async;
pub use adapters::may_have_gpu;
#[cfg(not(target_arch = "wasm32"))]
pub use adapters::{devices, has_automatic};
use buffers::{Buffers, Exchanged};
use commands::{Command, Pipelines, Recorder};
use convergence::Convergence;
use device::Device;
pub use device::FaultInjection;
pub use frame::{DeviceMap, Frame, OpenDevice, PixelFormat, wgpu};
pub use kernel::{Bound, Kernel, MAX_LOOP_ITERATIONS};
use recording::Recording;
pub use shader::{Constant, Shader, binding_number};
use stages::{Transfer, Unpacking, record, record_levels, record_transfer};
pub use stages::{kernels, other_kernels};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use timer::Timer;
pub use uniform::UniformLayout;
use uniform::full_pitch;
use words::{anchor_words, full_words, image_words, label_range_words, narrow_words, prior_words};

/// The GPU path on one device.
pub struct Gpu {
    device: Device,
    pipelines: Pipelines,
    recording: Recording,
    /// For a match on a caller's device: the commands so far, which the caller submits.
    collected: Option<Vec<wgpu::CommandBuffer>>,
    timer: Option<Timer>,
    state: Option<State>,
    /// State of the other size of a double-size match, kept if both fit in memory.
    other: Option<State>,
    requests: Requests<RequestedMaps>,
}

/// The commands of each run, by the messages that exist at each of its levels (none listed if all do), and by
/// the maps that are in the memory of their successors (none for stages of messages, which bind no such map).
type Commands = HashMap<(Run, Vec<Sent>, Exchanged), Arc<[Command]>>;

/// Everything that depends on the plan.
struct State {
    plan: Plan,
    buffers: Buffers,
    commands: Commands,
    /// The messages that were sent. All others count as 0, whatever is stored.
    messages: SentMessages,
    /// The commands of each transfer.
    transfers: HashMap<(Transfer, Exchanged), Arc<[Command]>>,
}

impl Gpu {
    /// Opens the device that `wanted` names by index or part of its name, or the preferred one.
    ///
    /// # Errors
    /// [`crate::Error::Device`] without a driver or if the device cannot be opened;
    /// [`crate::Error::Execution`] if no device has that name.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn new(wanted: Option<&str>) -> Result<Self> {
        Self::with_faults(wanted, FaultInjection::default())
    }

    /// Like `new`, with faults.
    ///
    /// # Errors
    /// The errors of `new`.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn with_faults(wanted: Option<&str>, faults: FaultInjection) -> Result<Self> {
        pollster::block_on(Self::open_async(wanted, faults))
    }

    /// Like `with_faults`, for browsers.
    ///
    /// # Errors
    /// [`crate::Error::Device`] without a driver or if the device cannot be opened;
    /// [`crate::Error::Execution`] if no device has that name.
    pub async fn open_async(wanted: Option<&str>, faults: FaultInjection) -> Result<Self> {
        Device::open(wanted, faults).await.map(Self::on)
    }

    fn on(device: Device) -> Self {
        Self {
            device,
            pipelines: HashMap::new(),
            recording: Recording::default(),
            collected: None,
            timer: None,
            state: None,
            other: None,
            requests: Requests::default(),
        }
    }

    /// The commands of the message stages, if message passing may settle: the workgroup counts of all of them
    /// must be known before [`Stage::Change`] is recorded, which zeroes them. All others are recorded on first use.
    fn commands_that_end(&mut self, plan: &Plan, buffers: &mut Buffers) -> Result<Commands> {
        let mut commands = HashMap::new();
        let mut endings = Vec::new();
        let ends = |stage: &Stage| stage.passes_messages() && plan.settled_change().is_some();
        let runs_whole = |stage: &Stage| plan.holds_all_rows() || !stage.needs_level_0(plan);
        for stage in Stage::all(plan).into_iter().filter(ends).filter(runs_whole) {
            let shares = stage.finest_level(plan) >= buffers.finest_shared && record_levels(stage).is_some();
            let most = if shares { plan.levels.len() - stage.level().unwrap_or(0) } else { 1 };
            for levels in 1..=most {
                let run = Run { levels, ..stage.into() };
                let recorded = self.recorded(&run, &[], plan, buffers, Some(&mut endings))?;
                commands.insert((run, Vec::new(), Exchanged::default()), recorded);
            }
        }
        buffers.end_when_settled(&mut self.device, plan, &endings)?;
        Ok(commands)
    }

    /// The commands of `run`, if the messages `sent` exist at each of its levels; all if none are listed.
    fn recorded(
        &mut self,
        run: &Run,
        sent: &[Sent],
        plan: &Plan,
        buffers: &Buffers,
        endings: Option<&mut Vec<[u32; 3]>>,
    ) -> Result<Arc<[Command]>> {
        let level = run.stage.level().unwrap_or(0);
        self.recorded_at(level, plan, buffers, run.work(plan), endings, |recorder| {
            recorder.sent = sent.to_vec();
            recorder.only = run.band.as_ref().map(|band| band.rows.start as u32..band.rows.end as u32);
            match record_levels(run.stage) {
                Some(record) if run.levels > 1 => record(recorder, level..level + run.levels),
                _ => record(recorder, run.stage),
            }
        })
    }

    /// The commands that `record` records at `level`, for about `work` ns on one thread of a processor.
    fn recorded_at<'a>(
        &'a mut self,
        level: usize,
        plan: &'a Plan,
        buffers: &'a Buffers,
        work: f64,
        endings: Option<&'a mut Vec<[u32; 3]>>,
        record: impl FnOnce(&mut Recorder<'a>) -> Result<()>,
    ) -> Result<Arc<[Command]>> {
        let Self { device, pipelines, .. } = self;
        let mut recorder = Recorder {
            device,
            pipelines,
            plan,
            buffers,
            exchanged: buffers.exchanged,
            level,
            only: None,
            sent: Vec::new(),
            source: None,
            endings,
            commands: Vec::new(),
        };
        record(&mut recorder)?;
        Ok(recorder.complete(work).into())
    }

    fn state(&self) -> &State {
        self.state.as_ref().expect("prepare comes before every stage")
    }

    /// Creates buffers and commands for a plan.
    fn begin(&mut self, plan: &Plan) -> Result<State> {
        if self.device.software {
            memory::check(plan.bytes(), Purpose::Match)?;
        }
        self.device.free_staging();
        let mut buffers = Buffers::new(&mut self.device, plan)?;
        let commands = self.commands_that_end(plan, &mut buffers)?;
        let messages = SentMessages::none(plan.levels.len());
        let transfers = HashMap::new();
        Ok(State { plan: plan.clone(), buffers, commands, messages, transfers })
    }

    /// The state for `plan`, reused if it fits.
    fn ready(&mut self, plan: &Plan) -> Result<State> {
        if self.state.as_ref().is_some_and(|state| plan.fits(&state.plan)) {
            // The maps stay; finish what was recorded for them.
            self.submit()?;
        }
        self.discard();
        self.device.traffic = Traffic::default();
        if !self.state.as_ref().is_some_and(|state| plan.fits(&state.plan)) {
            std::mem::swap(&mut self.state, &mut self.other);
        }
        let state = match self.state.take() {
            Some(mut state) if plan.fits(&state.plan) => {
                if state.plan.core != plan.core {
                    state.plan = plan.clone();
                    state.commands.retain(|(run, ..), _| run.stage != Stage::RightView);
                }
                state
            }
            // Free the match before the last one before allocating.
            older => {
                drop(older);
                let most = u64::from(plan.memory) << 20;
                if self.other.as_ref().is_some_and(|other| other.buffers.bytes() + plan.bytes() > most) {
                    self.other = None;
                }
                match self.begin(plan) {
                    Err(Error::Memory(_)) if self.other.take().is_some() => self.begin(plan)?,
                    begun => begun?,
                }
            }
        };
        let held = [Some(&state), self.other.as_ref()].into_iter().flatten();
        self.device.traffic.bytes_held = held.map(|state| state.buffers.bytes()).sum();
        Ok(state)
    }

    /// Uploads the pair, its label ranges and its prior.
    fn load(&mut self, state: &mut State, prepared: &Prepared) -> Result<()> {
        self.reset(state)?;
        let State { plan, buffers, .. } = state;
        let (pair, pitch) = (&prepared.pair, buffers.levels[0].pixel_pitch);
        let array = |data: Data| buffers.rows(plan, data);
        let larger = pair.full().filter(|_| plan.full.is_some());
        let uploaded = larger.unwrap_or(pair);
        let mut narrow = larger.is_none() || pair.is_exact_half();
        for (image, data) in [uploaded.left(), uploaded.right()].into_iter().zip(uploaded_words(plan)) {
            let pitch = uploaded_rows(plan, buffers).0;
            narrow = narrow && self.upload(array(data), |memory| narrow_words(image, pitch, memory))?;
        }
        let device = &mut self.device;
        if !narrow {
            array(Data::LEFT).write(device, &image_words(pair.left(), pitch))?;
            array(Data::Right).write(device, &image_words(pair.right(), pitch))?;
            if let Some(larger) = larger {
                array(Data::FullLeft).write(device, &full_words(larger.left(), full_pitch(plan)))?;
                array(Data::FullRight).write(device, &full_words(larger.right(), full_pitch(plan)))?;
            }
        }
        for (z, l) in plan.levels.iter().enumerate().filter(|_| plan.limits_labels()) {
            let words = |ranges: &Plane<_>| label_range_words(ranges, &buffers.levels[z]);
            let all = || words(&Plane::filled(l.width, l.height, [0, l.labels as u16 - 1]));
            array(Data::LabelRange(z))
                .write(device, &prepared.label_ranges.get(z).map_or_else(all, words))?;
        }
        let knows = plan.prior || prepared.prior.is_some();
        for (z, l) in plan.levels.iter().enumerate().filter(|_| knows && plan.has_priors()) {
            let words = |prior: &Plane<_>| prior_words(prior, l.labels, &buffers.levels[z]);
            let nothing = || words(&Plane::filled(l.width, l.height, LabelPrior::default()));
            let levels = prepared.prior.as_ref().map(|prior| words(&prior.levels[z]));
            array(Data::Prior(z)).write(device, &levels.unwrap_or_else(nothing))?;
        }
        if plan.prior {
            let none = || Plane::filled(plan.levels[0].width, plan.levels[0].height, NO_ANCHOR);
            let anchors = prepared.prior.as_ref().map_or_else(none, |prior| prior.anchors.clone());
            array(Data::Map(Map::Anchor)).write(device, &anchor_words(&anchors, pitch))?;
        }
        if narrow {
            self.transfer(state, Transfer::Up(Unpacking::OF_HOST))?;
        }
        self.device.check()
    }

    /// Starts a match: no messages, all labels, zeros where they are needed.
    fn reset(&mut self, state: &mut State) -> Result<()> {
        let State { plan, buffers, messages, .. } = state;
        *messages = SentMessages::none(plan.levels.len());
        let array = |data: Data| buffers.rows(plan, data);
        for data in &buffers.zeroed {
            array(*data).held().try_for_each(|(buffer, bytes)| self.clear(buffer, &bytes))?;
        }
        let encoder = self.encoder()?;
        for z in 0..plan.levels.len() {
            for copy in array(Data::FullWindows(z)).copy_to(array(Data::Windows(z))) {
                let ((from, at), (to, to_at)) = (&copy.from, &copy.to);
                encoder.copy_buffer_to_buffer(from, *at, to, *to_at, copy.bytes);
            }
        }
        let size = buffers.all_groups.size();
        encoder.copy_buffer_to_buffer(&buffers.all_groups, 0, &buffers.groups, 0, size);
        Ok(())
    }

    /// Records a transfer between the arrays of stages and those that the host reads and writes.
    fn transfer(&mut self, state: &mut State, transfer: Transfer) -> Result<()> {
        let State { plan, buffers, transfers, .. } = state;
        let key = (transfer, buffers.exchanged);
        let commands = if let Some(commands) = transfers.get(&key) {
            Arc::clone(commands)
        } else {
            let record = |recorder: &mut Recorder| record_transfer(recorder, transfer);
            self.recorded_at(0, plan, buffers, 0.0, None, record)?
        };
        // A transfer is no run of a stage, so it is not timed.
        let timer = self.timer.take();
        let recorded = self.record(&commands);
        self.timer = timer;
        transfers.insert(key, commands);
        recorded
    }

    fn convergence_at(&self) -> (wgpu::Buffer, Range<u64>) {
        let State { plan, buffers, .. } = self.state();
        buffers.rows(plan, Data::Convergence).own().remove(0)
    }

    /// The current state of [`Stage::Change`].
    async fn convergence(&mut self) -> Result<Convergence> {
        let at = self.convergence_at();
        let requested = self.request(&[at])?;
        Ok(Convergence::of(&self.device.collect(requested).await?[0]))
    }

    /// Width, height, and elements per row of a map.
    fn map_shape(&self, map: Map) -> (usize, usize, usize) {
        let plan = &self.state().plan;
        let (width, height) = map.size(plan);
        let array = Data::Map(map).array(plan);
        (width, height, array.words / map.words())
    }
}

/// The words of both views as uploaded.
fn uploaded_words(plan: &Plan) -> [Data; 2] {
    if plan.full.is_some() {
        [Data::FullLeftWords, Data::FullRightWords]
    } else {
        [Data::LeftWords, Data::RightWords]
    }
}

/// Words per row of an uploaded view, and its number of rows.
fn uploaded_rows(plan: &Plan, buffers: &Buffers) -> (u32, usize) {
    let height = plan.size().1;
    if plan.full.is_some() { (full_pitch(plan), 2 * height) } else { (buffers.levels[0].pixel_pitch, height) }
}

/// Converts the words of a map, of the shape (width, height, words per row), with `value`.
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

/// Packed disparities of a map of the shape (width, height, words per row), two in a word; `low` is the lowest, in 1/256 px.
fn packed_plane(words: &[u32], (width, height, pitch): (usize, usize, usize), low: i32) -> Plane<i32> {
    let mut values = Vec::with_capacity(width * height);
    for row in words.chunks_exact(pitch) {
        let pairs = row.iter().flat_map(|&word| [word & 0xffff, word >> 16]);
        values.extend(pairs.take(width).map(|above| low + above.cast_signed()));
    }
    Plane::new(width, height, values)
}

/// Maps being read back from the device.
struct RequestedMaps {
    /// The maps: two packed ones, or disparity, raw disparity and flags; and [`Convergence`] if message passing may stop early.
    parts: device::Requested,
    /// Width, height, and words per row of the maps in whole words.
    shape: (usize, usize, usize),
    /// If they are packed: words per row of the raw map, and the lowest disparity in 1/256 px.
    packed: Option<(usize, i32)>,
}

impl Backend for Gpu {
    fn describe(&self) -> String {
        self.device.name.clone()
    }

    fn driver(&self) -> Option<String> {
        Some(self.device.driver.clone())
    }

    fn halves_pairs(&self) -> bool {
        true
    }

    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()> {
        self.collected = None;
        let mut state = self.ready(plan)?;
        self.load(&mut state, &prepared)?;
        self.state = Some(state);
        Ok(())
    }

    fn fit(&mut self, program: Program) -> Program {
        let program = program.each_frame(|plan, steps| {
            let steps = if self.holds_all_rows(plan) { steps } else { together::pass(plan, steps) };
            let steps = sharing::pass(plan, steps);
            // Levels are timed separately, so they are not joined.
            let shared = Buffers::finest_shared(&self.device, plan);
            if self.timer.is_none() { joined::join(plan, shared, steps) } else { steps }
        });
        self.compile(&program);
        program
    }

    fn perform(&mut self, run: &Run) -> Result<()> {
        let parts = split(run.clone());
        if let [_, _, ..] = parts[..] {
            if let Some(timer) = self.timer.as_mut().filter(|timer| !timer.has_clock()) {
                timer.begin(run.stage);
            }
            return parts.iter().try_for_each(|part| self.perform(part));
        }
        let commands = self.commands_of(run)?;
        (0..run.levels).for_each(|_| self.device.count_stage());
        if let Some(timer) = &mut self.timer {
            timer.begin(run.stage);
        }
        self.record(&commands)
    }

    fn keep_up(&mut self) -> Promise<'_, ()> {
        Box::pin(async {
            if self.timer.as_ref().is_some_and(Timer::waits) {
                self.wait().await?;
                self.timer.iter_mut().for_each(Timer::end);
            }
            self.device.keep_up().await
        })
    }

    fn settled(&mut self, wait: bool) -> Promise<'_, bool> {
        // Timed matches must not contain idle iterations.
        let asked = wait || self.timer.is_some();
        Box::pin(async move { Ok(asked && self.convergence().await?.settled != 0) })
    }

    fn idle_iterations(&mut self) -> Promise<'_, u32> {
        let may_settle = self.state().plan.settled_change().is_some();
        Box::pin(async move { if may_settle { Ok(self.convergence().await?.idle) } else { Ok(0) } })
    }

    fn wait(&mut self) -> Promise<'_, ()> {
        Box::pin(async {
            self.submit()?;
            self.device.wait().await
        })
    }

    fn map(&mut self, map: Map) -> Promise<'_, Plane<i32>> {
        Box::pin(self.map_values(map))
    }

    fn request_maps(&mut self) -> Result<Ticket> {
        let mut state = self.state.take().expect("a match has maps");
        let packs = state.plan.packs_maps();
        let recorded = if packs { self.transfer(&mut state, Transfer::Down) } else { Ok(()) };
        let State { plan, buffers, .. } = self.state.insert(state);
        recorded?;
        let data = match (packs, plan.full.is_some()) {
            (true, false) => vec![Data::PackedMaps, Data::PackedRaw],
            (true, true) => vec![Data::FullPackedMaps, Data::FullPackedRaw],
            (false, false) => [Map::Disparity, Map::Raw, Map::Validity].map(Data::Map).to_vec(),
            (false, true) => [Map::FullDisparity, Map::FullRaw, Map::FullValidity].map(Data::Map).to_vec(),
        };
        let mut parts: Vec<_> = data.iter().flat_map(|&data| buffers.rows(plan, data).own()).collect();
        let (width, height) =
            if plan.full.is_some() { Map::FullDisparity } else { Map::Disparity }.size(plan);
        let shape = (width, height, data[0].array(plan).words);
        let packed = packs.then(|| (data[1].array(plan).words, FRACTION * plan.of_pair().range.min));
        parts.extend(plan.settled_change().map(|_| self.convergence_at()));
        let parts = self.request(&parts)?;
        Ok(self.requests.add(RequestedMaps { parts, shape, packed }))
    }

    fn maps(&mut self, ticket: Ticket) -> Promise<'_, (Maps, u32)> {
        let RequestedMaps { parts, shape, packed } = self.requests.take(&ticket);
        Box::pin(self.device.read(parts, move |words| {
            let (disparity, raw, flags) = if let Some((pitch, low)) = packed {
                let disparity = plane(words[0], shape, |word| low + (word >> 16).cast_signed());
                (disparity, packed_plane(words[1], (shape.0, shape.1, pitch), low), 0)
            } else {
                let [disparity, raw] = [0, 1].map(|at| plane(words[at], shape, u32::cast_signed));
                (disparity, raw, 2)
            };
            let maps = Maps {
                disparity,
                raw,
                confidence: plane(words[flags], shape, |word| (word >> 8) as u8),
                validity: plane(words[flags], shape, |word| word as u8),
                right: None,
            };
            let convergence = words.get(if packed.is_some() { 2 } else { 3 });
            (maps, convergence.map_or(0, |words| Convergence::of(words).idle))
        }))
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.timer = on.then(|| Timer::new(&self.device)).transpose()?;
        Ok(())
    }

    fn times(&mut self) -> Promise<'_, Vec<(Stage, Duration)>> {
        Box::pin(async {
            self.wait().await?;
            match &mut self.timer {
                Some(timer) => timer.times(&mut self.device).await,
                None => Ok(Vec::new()),
            }
        })
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
