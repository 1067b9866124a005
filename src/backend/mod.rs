//! The interface of all backends: they run single stages.
//!
//! Only [`crate::program`] knows the order of stages. From the matching cost on, everything is integer
//! arithmetic, so all backends give the same bits. The documentation of each [`Stage`] is its definition.

pub(crate) mod cpu;
pub(crate) mod gpu;
pub(crate) mod probe;

use crate::error::Result;
use crate::front::Prepared;
use crate::image::Plane;
use crate::maps::Maps;
use crate::plan::Plan;
use crate::program::{Program, Run};
use crate::stage::Data;
pub use crate::stage::{Map, NO_LABEL, Stage, Volume, volume_shape};
use probe::Probe;
use std::pin::Pin;
use std::time::Duration;

/// Device work of a match.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Dispatches.
    pub dispatches: u64,
    /// Compute passes.
    pub passes: u64,
    /// Submissions to the queue.
    pub submissions: u64,
    /// Times that the host waited for a submission.
    pub waits: u64,
    /// Buffers that were created, beside those of the plan.
    pub buffers: u64,
    /// Bytes written to the device.
    pub bytes_up: u64,
    /// Bytes read from the device.
    pub bytes_down: u64,
    /// Bytes zeroed on the device.
    pub bytes_cleared: u64,
    /// Bytes of the buffers held for the match.
    pub bytes_held: u64,
}

/// Counters add up; `bytes_held` keeps the maximum.
impl std::ops::AddAssign for Traffic {
    fn add_assign(&mut self, more: Self) {
        self.dispatches += more.dispatches;
        self.passes += more.passes;
        self.submissions += more.submissions;
        self.waits += more.waits;
        self.buffers += more.buffers;
        self.bytes_up += more.bytes_up;
        self.bytes_down += more.bytes_down;
        self.bytes_cleared += more.bytes_cleared;
        self.bytes_held = self.bytes_held.max(more.bytes_held);
    }
}

/// Identifies requested maps, which may not have arrived yet.
#[derive(Debug, PartialEq, Eq)]
pub struct Ticket(u64);

/// The answer of a backend. A native program waits for the device in it. A browser thread, which may not
/// wait, does other work until the answer arrives.
pub type Promise<'a, T> = Pin<Box<dyn Future<Output = Result<T>> + 'a>>;

/// Runs the stages. Every method fails with [`crate::Error::Device`] if the device fails.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Backend {
    /// A readable name: "CPU path, 2 threads", "llvmpipe (Vulkan)".
    fn describe(&self) -> String;

    /// The driver of the device and its version, as far as known; `None` without a device.
    fn driver(&self) -> Option<String> {
        None
    }

    /// Whether it takes pairs at full size and halves them itself, if they have 8 bits per channel and are matched at half size.
    fn halves_pairs(&self) -> bool {
        false
    }

    /// Frees host memory of the last match, so that the next one can be [prepared](crate::front::prepare) in
    /// its place. No stage may run before [`Self::prepare`] is called again.
    fn release(&mut self) {}

    /// Loads the input of a match by `plan`, gives every pixel all labels, and sets all messages and the
    /// previous label map of [`Stage::Change`] to 0. All memory of the stages is allocated here, from the
    /// plan alone. A pair whose plan [fits](Plan::fits) reuses the buffers; maps stay.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] and [`crate::Error::Device`] if the buffers cannot be allocated.
    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()>;

    /// Adapts a program to this backend: the rows of level 0 held, and the stages run together.
    fn fit(&mut self, program: Program) -> Program;

    /// Runs a stage. A device may still be working when this returns. After a band of rows, data of level 0
    /// other than maps may be overwritten.
    fn perform(&mut self, run: &Run) -> Result<()>;

    /// Runs a stage on all rows of its level.
    fn run(&mut self, stage: Stage) -> Result<()> {
        self.perform(&stage.into())
    }

    /// Frees host memory of data that are no longer needed.
    fn free(&mut self, _: Data) {}

    /// To be awaited between stages: until the device is at most a few submissions behind, and in a browser
    /// until other tasks of the thread have run.
    fn keep_up(&mut self) -> Promise<'_, ()>;

    /// Whether [`Stage::Change`] has found that the map has settled. A device returns false unless `wait` is set or times
    /// are taken, because an answer requires waiting; once the map has settled, it skips the messages of further
    /// iterations.
    fn settled(&mut self, wait: bool) -> Promise<'_, bool>;

    /// Number of iterations that ran after the map had settled.
    fn idle_iterations(&mut self) -> Promise<'_, u32>;

    /// Waits until all stages have run.
    fn wait(&mut self) -> Promise<'_, ()>;

    /// The values of `map` after all stages so far.
    fn map(&mut self, map: Map) -> Promise<'_, Plane<i32>>;

    /// Requests the maps after all stages so far. The next pair may be prepared before they arrive.
    fn request_maps(&mut self) -> Result<Ticket>;

    /// The requested maps, once they have arrived, and [`Self::idle_iterations`] at the time of the request.
    /// Older requests that were not collected are dropped.
    ///
    /// # Panics
    /// If the ticket is from another backend.
    fn maps(&mut self, ticket: Ticket) -> Promise<'_, (Maps, u32)>;

    /// Turns per-stage timing on or off.
    fn keep_time(&mut self, on: bool) -> Result<()>;

    /// The time of every run of a stage since the last [`Backend::keep_time`], in order, from the device's
    /// clock if it has one.
    fn times(&mut self) -> Promise<'_, Vec<(Stage, Duration)>>;

    /// Stored cells of a volume of each level: the labels of all pixels, with padding.
    fn cells(&self) -> Vec<u64>;

    /// Device work since the start of [`Backend::prepare`]; all 0 without a device.
    fn traffic(&self) -> Traffic;

    /// Access for tests and diagnosis.
    fn probe(&mut self) -> &mut dyn Probe;
}

/// Requested maps and the numbers of their tickets, oldest first.
struct Requests<T> {
    waiting: std::collections::VecDeque<(u64, T)>,
    next: u64,
}

impl<T> Default for Requests<T> {
    fn default() -> Self {
        Self { waiting: std::collections::VecDeque::new(), next: 0 }
    }
}

impl<T> Requests<T> {
    fn add(&mut self, request: T) -> Ticket {
        self.waiting.push_back((self.next, request));
        self.next += 1;
        Ticket(self.next - 1)
    }

    /// The request of the ticket; drops older ones.
    fn take(&mut self, ticket: &Ticket) -> T {
        loop {
            let (number, request) = self.waiting.pop_front().expect("a ticket of this backend");
            if number == ticket.0 {
                return request;
            }
        }
    }
}
