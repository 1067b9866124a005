//! Progress of a running match, its times on the host, and how it is interrupted.

use crate::error::{Error, Result};
use std::ops::ControlFlow;
use std::time::Duration;
use web_time::Instant;

/// Progress of a match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The stage about to run, or a step of the host between stages: "zones", "upload" and so on.
    pub stage: &'static str,
    /// Fraction of the work that is done, 0 to 1.
    pub done: f64,
    /// The current tile, counted from 1, and the number of tiles: twice that of the image where it is matched
    /// twice.
    pub tile: Option<(usize, usize)>,
}

/// Receives the progress of a match, and decides whether it continues.
pub type Observer<'a> = &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + Send);

/// Follows one match: its progress, and the time of the host's steps between stages.
pub struct Watch<'a> {
    observer: Observer<'a>,
    done: f64,
    total: f64,
    /// The current tile, and the number of tiles.
    tile: Option<(usize, usize)>,
    times: Vec<(&'static str, Duration)>,
}

impl<'a> Watch<'a> {
    /// Follows a match whose total work is `total`, in any unit.
    pub fn new(observer: Observer<'a>, total: f64) -> Self {
        Self { observer, done: 0.0, total, tile: None, times: Vec::new() }
    }

    /// The same for a match in this many tiles.
    #[must_use]
    pub fn in_tiles(self, count: usize) -> Self {
        Self { tile: Some((0, count)), ..self }
    }

    /// Starts the next tile.
    pub fn next_tile(&mut self) {
        self.tile = self.tile.map(|(tile, all)| (tile + 1, all));
    }

    /// All tiles are done.
    pub fn end_tiles(&mut self) {
        self.tile = None;
    }

    /// Starts `stage`, whose share of the work is `work`, in the unit of the total.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks.
    pub fn begin(&mut self, stage: &'static str, work: f64) -> Result<()> {
        let progress = Progress { stage, done: (self.done / self.total).min(1.0), tile: self.tile };
        self.done += work;
        match (self.observer)(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }

    /// Runs a step of the host, and records its time.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks, and the errors of `job`.
    pub fn host<T>(&mut self, name: &'static str, job: impl FnOnce() -> Result<T>) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job()?;
        self.times.push((name, clock.elapsed()));
        Ok(done)
    }

    /// As [`Self::host`], for a step that waits for a device.
    ///
    /// # Errors
    /// Those of [`Self::host`].
    pub async fn host_async<T>(
        &mut self,
        name: &'static str,
        job: impl Future<Output = Result<T>>,
    ) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job.await?;
        self.times.push((name, clock.elapsed()));
        Ok(done)
    }

    /// The steps of the host so far, and the time of each.
    #[must_use]
    pub fn into_times(self) -> Vec<(&'static str, Duration)> {
        self.times
    }
}
