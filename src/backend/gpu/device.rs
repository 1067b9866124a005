//! An open device: submits commands, reads back buffers, and reports failures.

use super::adapters::{adapters_of, api, driver, select};
use super::frame::OpenDevice;
use super::pace::Pace;
use crate::backend::Traffic;
use crate::error::{DeviceError, Error, MemoryError, Result};
use futures_channel::oneshot;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use web_time::Instant;

/// Limits and failures for tests, which run the engine as if on a weaker or failing device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultInjection {
    /// Largest binding in bytes.
    pub max_binding: Option<u64>,
    /// Largest buffer in bytes.
    pub max_buffer: Option<u64>,
    /// Largest number of workgroups of a dispatch in one dimension.
    pub max_groups: Option<u32>,
    /// Largest number of invocations of a workgroup.
    pub max_invocations: Option<u32>,
    /// Size of its memory in bytes.
    pub memory: Option<u64>,
    /// Time limit of a submission.
    pub patience: Option<Duration>,
    /// Lose the device after this many stages.
    pub lost_after: Option<usize>,
    /// Disable timestamp queries.
    pub no_clock: bool,
    /// Instead of a driver, use a backend that accepts every command and computes nothing.
    pub noop: bool,
}

/// Time limit of a submission, after which the device counts as hung. Drivers with a watchdog stop earlier.
/// Software drivers compete for the processor.
const PATIENCE: Duration = Duration::from_secs(60);
const SOFTWARE_PATIENCE: Duration = Duration::from_secs(600);
/// Largest number of submissions in flight: more would not keep a device busier, and would delay the
/// detection of a hang. In a browser, one is enough, and makes the progress bar exact.
const SUBMISSIONS: usize = if cfg!(target_arch = "wasm32") { 1 } else { 4 };

/// Largest number of buffers that are kept for reading back: those of the maps of three pairs.
const STAGING: usize = 12;

/// Largest number of buffers that are kept for uploads: those of both views of the pair that is matched, and of the next one.
const UPLOADS: usize = 4;

/// Describes the smallest unit of a dispatch in errors.
pub(super) const ONE_ROW: &str = "one row of the image and what it depends on";

/// An open device with its queue and the first failure it reported.
pub(super) struct Device {
    /// `None` once the device has hung.
    open: Option<(wgpu::Device, wgpu::Queue)>,
    pub(super) name: String,
    pub(super) driver: String,
    /// Whether it uses the machine's main memory.
    pub(super) software: bool,
    pub(super) max_binding: u64,
    pub(super) max_buffer: u64,
    pub(super) max_groups: u32,
    pub(super) memory: Option<u64>,
    /// Nanoseconds per timestamp tick, if it has timestamps.
    pub(super) tick: Option<f64>,
    /// Limit of the work per submission.
    pub(super) pace: Pace,
    /// Time limit of a submission, if it is not the usual one.
    patience: Option<Duration>,
    lost_after: Option<usize>,
    under_way: VecDeque<Submission>,
    /// End of the last finished submission, as observed.
    last_end: Instant,
    /// Submissions so far, including those in flight.
    submitted: u64,
    failure: Arc<Mutex<Option<Error>>>,
    /// Buffers for reading back that are not in use.
    staging: Vec<wgpu::Buffer>,
    /// Buffers for uploads, oldest first, with the answer whether each is mapped again.
    uploads: Vec<(wgpu::Buffer, oneshot::Receiver<Mapped>)>,
    pub(super) traffic: Traffic,
}

impl Device {
    pub(super) async fn open(wanted: Option<&str>, faults: FaultInjection) -> Result<Self> {
        let adapter = if faults.noop {
            let noop = adapters_of(wgpu::Backends::NOOP).await.pop();
            noop.ok_or(DeviceError::NoDriver)?
        } else {
            select(wanted).await?
        };
        let info = adapter.get_info();
        let offered = adapter.limits();
        // Only the default WebGPU limits, except for the sizes of buffers and bindings.
        let mut limits = wgpu::Limits::default().or_worse_values_from(&offered);
        limits.max_buffer_size = offered.max_buffer_size.min(faults.max_buffer.unwrap_or(u64::MAX));
        limits.max_storage_buffer_binding_size =
            offered.max_storage_buffer_binding_size.min(faults.max_binding.unwrap_or(u64::MAX));
        if let Some(groups) = faults.max_groups {
            limits.max_compute_workgroups_per_dimension = groups;
        }
        if let Some(invocations) = faults.max_invocations {
            limits.max_compute_invocations_per_workgroup = invocations;
            limits.max_compute_workgroup_size_x = invocations;
        }
        let clock = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let features = if faults.no_clock { wgpu::Features::empty() } else { clock };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("mrfgs"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let (device, queue) = adapter
            .request_device(&descriptor)
            .await
            .map_err(|e| failed(&info.name, &format!("the device cannot be opened: {e}")))?;
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<Error>>>| {
            let failure = Arc::clone(failure);
            move |error: Error| {
                if let Ok(mut failure) = failure.lock() {
                    failure.get_or_insert(error);
                }
            }
        };
        let (uncaptured, device_name) = (note(&failure), name_of(&info));
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            uncaptured(match e {
                wgpu::Error::OutOfMemory { .. } => {
                    MemoryError::Exhausted { name: device_name.clone() }.into()
                }
                e => failed(&device_name, &e),
            });
        }));
        let (lost, device_name) = (note(&failure), name_of(&info));
        device.set_device_lost_callback(move |reason, message| {
            // Dropping the device also calls this, when it no longer matters.
            lost(failed(&device_name, &format!("the device was lost ({reason:?}) {message}")));
        });
        Ok(Self {
            tick: (!features.is_empty()).then(|| queue.get_timestamp_period().into()),
            patience: faults.patience,
            lost_after: faults.lost_after,
            memory: faults.memory,
            failure,
            ..Self::of(&info, limits, device, queue)
        })
    }

    /// A device that a caller has opened, with the handlers that the caller has set.
    pub(super) fn of_caller(OpenDevice { info, device, queue }: OpenDevice) -> Self {
        Self::of(&info, device.limits(), device, queue)
    }

    fn of(info: &wgpu::AdapterInfo, limits: wgpu::Limits, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let software = info.device_type == wgpu::DeviceType::Cpu;
        Self {
            name: name_of(info),
            driver: driver(info),
            software,
            max_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            max_groups: limits.max_compute_workgroups_per_dimension,
            memory: None,
            tick: None,
            pace: if cfg!(target_arch = "wasm32") { Pace::in_browser() } else { Pace::new(software) },
            patience: None,
            lost_after: None,
            under_way: VecDeque::new(),
            last_end: Instant::now(),
            submitted: 0,
            failure: Arc::default(),
            staging: Vec::new(),
            uploads: Vec::new(),
            traffic: Traffic::default(),
            open: Some((device, queue)),
        }
    }

    pub(super) fn inner(&self) -> Result<&wgpu::Device> {
        self.check()?;
        self.open.as_ref().map(|open| &open.0).ok_or_else(|| self.hung())
    }

    fn queue(&self) -> Result<&wgpu::Queue> {
        self.check()?;
        self.open.as_ref().map(|open| &open.1).ok_or_else(|| self.hung())
    }

    /// The first failure since the device was opened, if any. A lack of memory is reported once and then
    /// cleared.
    pub(super) fn check(&self) -> Result<()> {
        let Ok(mut failure) = self.failure.lock() else { return Ok(()) };
        match &*failure {
            None => Ok(()),
            Some(Error::Memory(_)) => failure.take().map_or(Ok(()), Err),
            Some(e) => Err(e.clone()),
        }
    }

    /// A new buffer of `size` bytes.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        Ok(self.inner()?.create_buffer(&descriptor))
    }

    /// A buffer of `size` bytes for reading back. [`Self::read`] keeps it for the next request of that size.
    pub(super) fn staging(&mut self, size: u64) -> Result<wgpu::Buffer> {
        if let Some(at) = self.staging.iter().position(|buffer| buffer.size() == size) {
            return Ok(self.staging.swap_remove(at));
        }
        self.traffic.buffers += 1;
        self.buffer("staging", size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
    }

    /// A mapped buffer of `size` bytes for an upload. [`Self::keep_uploads`] keeps it for the next upload of that size.
    pub(super) fn upload(&mut self, size: u64) -> Result<wgpu::Buffer> {
        let is_ready = |(buffer, mapped): &mut (wgpu::Buffer, oneshot::Receiver<Mapped>)| {
            buffer.size() == size && matches!(mapped.try_recv(), Ok(Some(Ok(()))))
        };
        if let Some(at) = self.uploads.iter_mut().position(is_ready) {
            return Ok(self.uploads.remove(at).0);
        }
        self.traffic.buffers += 1;
        let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
        let descriptor =
            wgpu::BufferDescriptor { label: Some("upload"), size, usage, mapped_at_creation: true };
        let buffer = self.inner()?.create_buffer(&descriptor);
        self.check()?;
        Ok(buffer)
    }

    /// The memory of a mapped buffer.
    pub(super) fn mapped(&self, buffer: &wgpu::Buffer) -> Result<wgpu::BufferViewMut> {
        let unmapped = |e| self.check().err().unwrap_or_else(|| failed(&self.name, &e));
        buffer.get_mapped_range_mut(..).map_err(unmapped)
    }

    /// Maps buffers for uploads again, as soon as what was submitted has read them.
    pub(super) fn keep_uploads(&mut self, buffers: Vec<wgpu::Buffer>) {
        for buffer in buffers {
            let (sender, mapped) = oneshot::channel();
            buffer.map_async(wgpu::MapMode::Write, .., move |result| {
                // The receiver is gone if the buffer is.
                let _ = sender.send(result);
            });
            self.uploads.push((buffer, mapped));
        }
        let surplus = self.uploads.len().saturating_sub(UPLOADS);
        self.uploads.drain(..surplus);
    }

    /// Frees the buffers for uploads and for reading back that are not in use.
    pub(super) fn free_staging(&mut self) {
        self.uploads.clear();
        self.staging.clear();
    }

    /// The error that a buffer, or its binding, for `what` exceeds the limit of this device.
    pub(super) fn too_large(&self, what: impl Into<String>, needed: u64, allowed: u64) -> Error {
        MemoryError::Buffer { name: self.name.clone(), what: what.into(), needed, allowed }.into()
    }

    pub(super) fn write(&mut self, buffer: &wgpu::Buffer, bytes: &[u8]) -> Result<()> {
        self.write_at(buffer, 0, bytes)
    }

    pub(super) fn write_at(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) -> Result<()> {
        self.queue()?.write_buffer(buffer, offset, bytes);
        self.traffic.bytes_up += bytes.len() as u64;
        Ok(())
    }

    /// Submits the recorded commands. `is_full` if they reach the limit of work per submission.
    pub(super) fn submit(&mut self, encoder: wgpu::CommandEncoder, is_full: bool) -> Result<()> {
        let queue = self.queue()?;
        let index = queue.submit([encoder.finish()]);
        let (sender, done) = oneshot::channel();
        if cfg!(target_arch = "wasm32") {
            // The receiver is gone if the match was stopped.
            queue.on_submitted_work_done(move || {
                let _ = sender.send(());
            });
        }
        self.under_way.push_back(Submission { index, done, begun: Instant::now(), is_full });
        self.submitted += 1;
        self.traffic.submissions += 1;
        self.check()
    }

    /// Waits until only a few submissions are in flight.
    pub(super) async fn keep_up(&mut self) -> Result<()> {
        self.wait_until_left(SUBMISSIONS).await
    }

    /// Waits for everything submitted so far.
    pub(super) async fn wait(&mut self) -> Result<()> {
        self.wait_until_left(0).await
    }

    async fn wait_until_left(&mut self, count: usize) -> Result<()> {
        while self.under_way.len() > count {
            self.wait_for_one().await?;
        }
        self.check()
    }

    async fn wait_for_one(&mut self) -> Result<()> {
        let Some(Submission { index, done, begun, is_full }) = self.under_way.pop_front() else {
            return Ok(());
        };
        self.traffic.waits += 1;
        if cfg!(target_arch = "wasm32") {
            // The browser ends work that takes too long, and then the device is lost.
            done.await.map_err(|e| failed(&self.name, &e))?;
            let last = std::mem::replace(&mut self.last_end, Instant::now());
            if is_full {
                self.pace.end(self.last_end - last.max(begun));
            }
            return self.check();
        }
        let waiting = wgpu::PollType::Wait { submission_index: Some(index), timeout: Some(self.patience()) };
        match self.inner()?.poll(waiting) {
            Err(wgpu::PollError::Timeout) => {
                // Closing a device waits for its work, and this device's work never ends.
                std::mem::forget(self.open.take());
                self.under_way.clear();
                Err(self.hung())
            }
            // A lost device accepts submissions silently, but they do not exist.
            Err(wgpu::PollError::WrongSubmissionIndex(..)) => {
                self.check()?;
                Err(failed(&self.name, &"the device was lost"))
            }
            Ok(_) => self.check(),
        }
    }

    /// Learns of what has happened so far. A lost device reports it here; otherwise the next buffers would seem invalid.
    pub(super) fn look(&self) -> Result<()> {
        self.inner()?.poll(wgpu::PollType::Poll).map_err(|e| failed(&self.name, &e))?;
        self.check()
    }

    /// Requests buffers in their state after all submissions so far.
    pub(super) fn request(&mut self, buffers: Vec<wgpu::Buffer>) -> Result<Requested> {
        self.look()?;
        let mut requested = Requested { buffers: Vec::new(), submitted: self.submitted };
        for buffer in buffers {
            self.traffic.bytes_down += buffer.size();
            let (sender, mapped) = oneshot::channel();
            buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                // The receiver is gone if waiting failed.
                let _ = sender.send(result);
            });
            requested.buffers.push((buffer, mapped));
        }
        Ok(requested)
    }

    /// The words of each requested buffer; later submissions may still be in flight.
    pub(super) async fn collect(&mut self, requested: Requested) -> Result<Vec<Vec<u32>>> {
        self.read(requested, |all| all.iter().map(|words| words.to_vec()).collect()).await
    }

    /// Calls `read` on the words of all requested buffers.
    pub(super) async fn read<T>(
        &mut self,
        requested: Requested,
        read: impl FnOnce(&[&[u32]]) -> T,
    ) -> Result<T> {
        let later = (self.submitted - requested.submitted) as usize;
        self.wait_until_left(later).await?;
        // Any poll maps buffers whose submission has finished.
        self.look()?;
        let mut views = Vec::new();
        let mut buffers = Vec::new();
        for (buffer, mut mapped) in requested.buffers {
            let answer =
                if cfg!(target_arch = "wasm32") { mapped.await.map(Some) } else { mapped.try_recv() };
            match answer {
                Ok(Some(Ok(()))) => {}
                Ok(Some(Err(e))) => return Err(self.unread(&e)),
                Ok(None) => return Err(self.unread(&"it is not there yet")),
                Err(e) => return Err(self.unread(&e)),
            }
            views.push(buffer.get_mapped_range(..).map_err(|e| self.unread(&e))?);
            buffers.push(buffer);
        }
        let words = views.iter().map(|view| {
            // An empty view may be unaligned.
            if view.is_empty() { &[][..] } else { bytemuck::cast_slice(view) }
        });
        let words: Vec<&[u32]> = words.collect();
        let read = read(&words);
        drop(views);
        buffers.iter().for_each(wgpu::Buffer::unmap);
        self.staging.append(&mut buffers);
        let surplus = self.staging.len().saturating_sub(STAGING);
        self.staging.drain(..surplus);
        self.check()?;
        Ok(read)
    }

    /// The device's failure, or else the failure to read a buffer.
    fn unread(&self, reason: &dyn std::fmt::Display) -> Error {
        self.check().err().unwrap_or_else(|| failed(&self.name, reason))
    }

    fn patience(&self) -> Duration {
        self.patience.unwrap_or(if self.software { SOFTWARE_PATIENCE } else { PATIENCE })
    }

    fn hung(&self) -> Error {
        failed(&self.name, &format!("it did not finish its work within {:?}: it hangs", self.patience()))
    }

    /// Destroys the device once it has run as many stages as its fault injection allows.
    pub(super) fn count_stage(&mut self) {
        if let (Some(left), Some((device, _))) = (&mut self.lost_after, &self.open) {
            match left.checked_sub(1) {
                Some(fewer) => *left = fewer,
                None => device.destroy(),
            }
        }
    }
}

/// Commands in flight.
struct Submission {
    index: wgpu::SubmissionIndex,
    /// Reports the end in a browser, which cannot poll.
    done: oneshot::Receiver<()>,
    /// When it was submitted.
    begun: Instant,
    /// Whether it reached the limit of work per submission.
    is_full: bool,
}

/// The answer to a request to map a buffer.
type Mapped = std::result::Result<(), wgpu::BufferAsyncError>;

/// Buffers being read back from the device, and whether each has arrived.
pub(super) struct Requested {
    buffers: Vec<(wgpu::Buffer, oneshot::Receiver<Mapped>)>,
    /// Number of submissions after which they are complete.
    submitted: u64,
}

/// The name of a device and its interface; a browser may hide the former.
fn name_of(info: &wgpu::AdapterInfo) -> String {
    let api = api(info.backend);
    if info.name.is_empty() { api.into() } else { format!("{} ({api})", info.name) }
}

/// The failure of the device called `name`, in one line.
pub(super) fn failed(name: &str, reason: &dyn std::fmt::Display) -> Error {
    let reason = reason.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    DeviceError::Failed { name: name.into(), reason }.into()
}
