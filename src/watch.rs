//! What a running match tells, and how it is stopped.

use crate::error::{Error, Result};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How far a match is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The stage about to run, or what the host does around the stages: "graph", "upload" and the like.
    pub stage: &'static str,
    /// Share of the work that is done, 0 to 1.
    pub done: f64,
    /// The tile at hand, from 1 on, and how many there are: twice those of the image where it is matched twice.
    pub tile: Option<(usize, usize)>,
}

/// Told how far a match is; answers whether to go on.
pub type Observer<'a> = &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + Send);

/// Follows one match: its progress, and the time of what the host does around the stages.
pub struct Watch<'a> {
    observer: Observer<'a>,
    done: f64,
    total: f64,
    /// The tile at hand, and how many there are.
    tile: Option<(usize, usize)>,
    times: Vec<(&'static str, Duration)>,
}

impl<'a> Watch<'a> {
    /// Of a match whose work is `total`, in any unit.
    pub fn new(observer: Observer<'a>, total: f64) -> Self {
        Self { observer, done: 0.0, total, tile: None, times: Vec::new() }
    }

    /// The same match in so many tiles.
    #[must_use]
    pub fn in_tiles(self, count: usize) -> Self {
        Self { tile: Some((0, count)), ..self }
    }

    /// The next tile begins.
    pub fn next_tile(&mut self) {
        self.tile = self.tile.map(|(tile, all)| (tile + 1, all));
    }

    /// All tiles are done.
    pub fn end_tiles(&mut self) {
        self.tile = None;
    }

    /// `stage` begins, which is so much of the work.
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

    /// Does what the host does around the stages, and takes the time.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer breaks, and those of `job`.
    pub fn host<T>(&mut self, name: &'static str, job: impl FnOnce() -> Result<T>) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job()?;
        self.times.push((name, clock.elapsed()));
        Ok(done)
    }

    /// What the host did around the stages, and how long each took.
    #[must_use]
    pub fn into_times(self) -> Vec<(&'static str, Duration)> {
        self.times
    }
}
