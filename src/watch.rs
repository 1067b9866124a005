//! Progress of a running match, its host times, and its interruption.

use crate::error::{Error, Result};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use web_time::Instant;

/// Progress of a match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The next stage, or a host step between stages: "zones", "upload" and so on.
    pub stage: &'static str,
    /// Fraction of the work that is done, 0 to 1.
    pub done: f64,
    /// The current tile, counted from 1, and the number of tiles. If the image is matched at two sizes, the
    /// tiles of both count.
    pub tile: Option<(usize, usize)>,
}

/// Receives the progress of a match, and decides whether it continues.
pub type Observer<'a> = &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + Send);

/// Breaks if any of `stops` is true.
pub(crate) fn goes_on<const N: usize>(stops: [&AtomicBool; N]) -> ControlFlow<()> {
    let stopped = stops.iter().any(|stop| stop.load(Ordering::Relaxed));
    if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// The progress so far.
#[derive(Clone, Debug, Default)]
pub struct Followed {
    done: f64,
    total: f64,
    /// The current tile, and the number of tiles.
    pub tile: Option<(usize, usize)>,
    /// The host steps so far, and the time of each.
    pub times: Vec<(&'static str, Duration)>,
}

impl Followed {
    /// The start of a match whose total work is `total`, in any unit.
    #[must_use]
    pub fn new(total: f64) -> Self {
        Self { total, ..Self::default() }
    }
}

/// Reports the progress of a match, and times its host steps.
pub struct Watch<'a> {
    observer: Observer<'a>,
    /// The progress so far.
    pub followed: Followed,
}

impl<'a> Watch<'a> {
    /// Continues from `followed`.
    pub fn new(observer: Observer<'a>, followed: Followed) -> Self {
        Self { observer, followed }
    }

    /// Reports the start of `stage`, whose share of the work is `work`, in the unit of the total.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks.
    pub fn begin(&mut self, stage: &'static str, work: f64) -> Result<()> {
        let Followed { done, total, tile, .. } = &mut self.followed;
        let progress = Progress { stage, done: (*done / *total).min(1.0), tile: *tile };
        *done += work;
        match (self.observer)(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }

    /// Runs a host step, and records its time.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks, and the errors of `job`.
    pub fn host<T>(&mut self, name: &'static str, job: impl FnOnce() -> Result<T>) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job()?;
        self.followed.times.push((name, clock.elapsed()));
        Ok(done)
    }

    /// Like [`Self::host`], for a step that waits for a device.
    ///
    /// # Errors
    /// The errors of [`Self::host`].
    pub async fn host_async<T>(
        &mut self,
        name: &'static str,
        job: impl Future<Output = Result<T>>,
    ) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job.await?;
        self.followed.times.push((name, clock.elapsed()));
        Ok(done)
    }
}
