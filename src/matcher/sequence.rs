//! Sequences of pairs: a device always has work queued, and the CPU path matches several pairs in parallel.

use super::check::check;
use super::corrections::Corrections;
use super::{Frame, Matched, Matcher, Request, fits};
use crate::backend::Backend;
use crate::engine::{self, MatchRun};
use crate::error::Result;
use crate::front::conditioning::Conditioning;
#[cfg(doc)]
use crate::image::Pair;
#[cfg(doc)]
use crate::options::DisparityRange;
use crate::options::Method;
use crate::plan::Plan;
use crate::program::Program;
use crate::program::tiles::Tiles;
use crate::watch::{Observer, goes_on};
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

impl Matcher {
    /// Matches pairs in order, each over its range, and passes each result to `take` until it breaks. A pair is a [`Frame`], or
    /// a tuple of [`Pair`] and [`DisparityRange`].
    ///
    /// While a device matches one pair, the graphs of the next are built and uploaded, and the maps of the
    /// previous one are downloaded, unless a pair is cut into tiles or matched at twice its size. The CPU path
    /// matches as many pairs in parallel as it has threads, if they fit in the memory of the method and of the
    /// machine; `take` runs on its own thread there. With per-stage timing, pairs are matched one at a time.
    ///
    /// The pairs are frames of one rig: what conditioning corrects is measured on every so many frames
    /// ([`measure_every`](crate::options::FrontOptions::measure_every)), and the others are corrected alike. So the
    /// maps depend on the order of the pairs, but not on the device.
    ///
    /// # Errors
    /// The errors of [`Job::run`](super::Job::run), after the results of all earlier pairs.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run_all(
        &mut self,
        pairs: impl IntoIterator<Item = impl Into<Frame>>,
        take: impl FnMut(Matched) -> ControlFlow<()> + Send,
    ) -> Result<()> {
        pollster::block_on(self.run_all_async(pairs, take))
    }

    /// Like `run_all`, but ends with [`Interrupted`](crate::Error::Interrupted) soon after `cancel` is set.
    ///
    /// # Errors
    /// The errors of [`Job::run`](super::Job::run), after the results of all earlier pairs.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run_all_until(
        &mut self,
        pairs: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        take: impl FnMut(Matched) -> ControlFlow<()> + Send,
    ) -> Result<()> {
        pollster::block_on(self.run_each(pairs, cancel, take))
    }

    /// Like `run_all`, for a browser: one pair at a time, and `take` on the only thread.
    ///
    /// # Errors
    /// The errors of [`Job::run_async`](super::Job::run_async), after the results of all earlier pairs.
    pub async fn run_all_async(
        &mut self,
        pairs: impl IntoIterator<Item = impl Into<Frame>>,
        take: impl FnMut(Matched) -> ControlFlow<()> + Send,
    ) -> Result<()> {
        self.run_each(pairs, &AtomicBool::new(false), take).await
    }

    async fn run_each(
        &mut self,
        pairs: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        mut take: impl FnMut(Matched) -> ControlFlow<()> + Send,
    ) -> Result<()> {
        let mut pairs = pairs.into_iter().map(Into::into).fuse();
        let method = &self.method.clone();
        let observer: Observer = &mut |_| goes_on([cancel]);
        let mut last: Option<Flight> = None;
        let mut corrections = Corrections::default();
        // The device may be lost during the sequence.
        while self.gpu.is_some() || self.timings || cfg!(target_arch = "wasm32") {
            let Some(frame) = pairs.next() else { break };
            let started = self.start(&frame, method, &mut corrections, &mut *observer).await;
            if let Some(last) = last.take()
                && take(self.land(last, method, &mut *observer).await?).is_break()
            {
                return Ok(());
            }
            match started? {
                (known, Some((tiles, started))) => last = Some(Flight { frame, known, tiles, started }),
                (known, None) => {
                    let Frame { pair, range, prior } = &frame;
                    let request = Request { range: *range, method, known, prior: prior.as_ref() };
                    if take(self.solve(pair, request, &mut *observer, None).await?).is_break() {
                        return Ok(());
                    }
                }
            }
        }
        if let Some(last) = last
            && take(self.land(last, method, observer).await?).is_break()
        {
            return Ok(());
        }
        #[cfg(not(target_arch = "wasm32"))]
        super::side_by_side::side_by_side(self, pairs, corrections, cancel, take)?;
        Ok(())
    }

    /// The corrections of the pair, if they are known, and its match, which is started on the device if it needs no host steps in
    /// between.
    async fn start(
        &mut self,
        Frame { pair, range, prior }: &Frame,
        method: &Method,
        corrections: &mut Corrections,
        observer: Observer<'_>,
    ) -> Result<(Option<Conditioning>, Option<(Tiles, MatchRun)>)> {
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, *range, method)?.with_prior(prior.is_some());
        if let Some(prior) = prior {
            fits(prior, pair)?;
        }
        let tiles = Tiles::new(&plan)?;
        let measured = async || corrections.of(pair, &plan, &mut *observer);
        let known = self.threads.run(width * height, measured).await??;
        let Self { threads, gpu: Some(device), checked, timings: false, .. } = self else {
            return Ok((known, None));
        };
        let program = Program::new(&tiles)?.corrected(known).knowing(prior.clone());
        if !program.waits_once() {
            return Ok((known, None));
        }
        let started = async || {
            check(device, &plan.method, checked).await?;
            device.keep_time(false)?;
            engine::start(device, &program, pair, observer).await
        };
        match threads.run(width * height, started).await? {
            Ok(started) => Ok((known, Some((tiles, started)))),
            Err(e) => self.without_device(e).map(|_| (known, None)),
        }
    }

    /// Completes a match that was started on the device; if the device has failed, matches again without it.
    async fn land(&mut self, flight: Flight, method: &Method, observer: Observer<'_>) -> Result<Matched> {
        let Flight { frame: Frame { pair, range, prior }, known, tiles, started } = flight;
        let (width, height) = pair.size();
        if let Some(device) = &mut self.gpu {
            let finished = async || engine::finish(device, started, &pair).await;
            match self.threads.run(width * height, finished).await? {
                Ok(solution) => return Ok(Matched::new(device, &tiles, solution, Vec::new())),
                Err(e) => self.without_device(e)?,
            };
        }
        let request = Request { range, method, known, prior: prior.as_ref() };
        self.solve(&pair, request, observer, None).await
    }
}

/// A match that was started on a device.
struct Flight {
    frame: Frame,
    known: Option<Conditioning>,
    tiles: Tiles,
    started: MatchRun,
}
