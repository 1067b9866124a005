//! The seam: what every backend can do, stage by stage.
//!
//! A backend knows stages, not their order; [`crate::program`] alone knows that. Everything from the matching cost on is integer
//! arithmetic, so all backends give the same bits. The documentation of each [`Stage`] is its definition.

pub mod cpu;
pub mod gpu;
pub mod probe;

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

/// What a match asked of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Dispatches.
    pub dispatches: u64,
    /// Submissions to the queue.
    pub submissions: u64,
    /// Bytes written to the device.
    pub bytes_up: u64,
    /// Bytes read from it.
    pub bytes_down: u64,
    /// Bytes of the buffers that it holds for the match.
    pub bytes_held: u64,
}

/// Of one match after another: what went through adds up, and the most was held.
impl std::ops::AddAssign for Traffic {
    fn add_assign(&mut self, more: Self) {
        self.dispatches += more.dispatches;
        self.submissions += more.submissions;
        self.bytes_up += more.bytes_up;
        self.bytes_down += more.bytes_down;
        self.bytes_held = self.bytes_held.max(more.bytes_held);
    }
}

/// Maps that a backend was asked for and that may still be on their way.
#[derive(Debug, PartialEq, Eq)]
pub struct Ticket(u64);

/// What a backend is asked for, to be awaited. A native program waits for the device there. In a browser, where nobody may wait, the
/// thread does other work until the answer comes.
pub type Promise<'a, T> = Pin<Box<dyn Future<Output = Result<T>> + 'a>>;

/// What runs the stages. Every method fails with [`crate::Error::Device`] when the device does.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Backend {
    /// What runs the stages, for people: "CPU path, 2 threads", "llvmpipe (Vulkan)".
    fn describe(&self) -> String;

    /// The driver of the device and its version, as far as it says; `None` where there is no device.
    fn driver(&self) -> Option<String> {
        None
    }

    /// Frees what the host holds for the last match alone, so that the next one can be [prepared](crate::front::prepare) in its
    /// place. No stage runs before [`Self::prepare`] is called again.
    fn release(&mut self) {}

    /// Takes what a match by `plan` needs, gives every pixel all labels, and sets all messages, and the map that [`Stage::Change`] compares with, to 0. All
    /// that the stages need is allocated here, from the plan alone; a second pair whose plan [fits](Plan::fits) goes into the same
    /// buffers, and maps stay.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] and [`crate::Error::Device`] when the buffers cannot be had.
    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()>;

    /// The same match as this backend runs it: which rows of level 0 it holds, and which stages go together.
    fn fit(&mut self, program: Program) -> Program;

    /// Runs a stage, as a list says. Devices may still be at it when this returns. What the rows of a part leave of level 0 beside
    /// maps may be gone afterwards.
    fn perform(&mut self, run: &Run) -> Result<()>;

    /// Runs a stage on all rows of its level.
    fn run(&mut self, stage: Stage) -> Result<()> {
        self.perform(&stage.into())
    }

    /// Frees what nobody needs any more of the match, where that is memory of the host.
    fn free(&mut self, _: Data) {}

    /// To be awaited between stages: until a device is no more than a few submissions behind, and in a browser until the other work
    /// of the thread has had its turn.
    fn keep_up(&mut self) -> Promise<'_, ()>;

    /// Whether [`Stage::Change`] has found that the map has settled. A device returns false unless it is to `wait` or takes
    /// times, since an answer takes waiting; once the map has settled, it skips the messages of further iterations.
    fn settled(&mut self, wait: bool) -> Promise<'_, bool>;

    /// How many iterations found the map settled already.
    fn idle_iterations(&mut self) -> Promise<'_, u32>;

    /// Waits until every stage has run.
    fn wait(&mut self) -> Promise<'_, ()>;

    /// The values of `map`, as they are once all stages before have run.
    fn map(&mut self, map: Map) -> Promise<'_, Plane<i32>>;

    /// Asks for the maps as they are once all stages before have run. The next pair may be prepared before they arrive.
    fn request_maps(&mut self) -> Result<Ticket>;

    /// The maps that this backend was asked for, once they have arrived, and [`Self::idle_iterations`] as it was then. What was
    /// asked for earlier and never collected is dropped.
    ///
    /// # Panics
    /// When the ticket is of another backend.
    fn maps(&mut self, ticket: Ticket) -> Promise<'_, (Maps, u32)>;

    /// Starts to take the time of every stage, or stops.
    fn keep_time(&mut self, on: bool) -> Result<()>;

    /// The time of every run of a stage since [`Backend::keep_time`] was last called, in order: a device's own where it has
    /// a clock.
    fn times(&mut self) -> Promise<'_, Vec<(Stage, Duration)>>;

    /// Cells of a volume of each level, as they are stored: the labels of all pixels, with padding.
    fn cells(&self) -> Vec<u64>;

    /// What went through since [`Backend::prepare`], which is included; all 0 where there is no device.
    fn traffic(&self) -> Traffic;

    /// The backend as tests and diagnosis see it.
    fn probe(&mut self) -> &mut dyn Probe;
}

/// Maps on their way, each with its ticket, the oldest first.
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

    /// What belongs to the ticket; what is older goes.
    fn take(&mut self, ticket: &Ticket) -> T {
        loop {
            let (number, request) = self.waiting.pop_front().expect("a ticket of this backend");
            if number == ticket.0 {
                return request;
            }
        }
    }
}
