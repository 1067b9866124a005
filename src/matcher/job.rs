//! A single match with all its options.

use super::search::Search;
use super::{Matched, Matcher, Request};
use crate::engine::Inspection;
use crate::error::{Error, Result};
use crate::front::check;
use crate::front::conditioning::Conditioning;
use crate::image::{Pair, Rect};
use crate::options::{DisparityRange, Method};
use crate::prior::Prior;
#[cfg(doc)]
use crate::region::Region;
use crate::watch::Progress;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The return value of a progress listener: nothing, or whether to go on.
pub trait Answer {
    /// Whether the match goes on.
    fn goes_on(self) -> bool;
}

impl Answer for () {
    fn goes_on(self) -> bool {
        true
    }
}

impl Answer for ControlFlow<()> {
    fn goes_on(self) -> bool {
        self.is_continue()
    }
}

type Listener<'a> = Box<dyn FnMut(Progress) -> bool + Send + 'a>;
type Find<'a> = Box<dyn FnOnce(&Pair) -> Result<DisparityRange> + Send + 'a>;
type Inspect<'a> = Box<dyn FnMut(&mut Inspection) -> Result<()> + Send + 'a>;

/// A match that has not started: [`Matcher::job`] makes one, [`Job::run`] runs it.
#[must_use = "a job does nothing until it is run"]
pub struct Job<'a> {
    matcher: &'a mut Matcher,
    pair: &'a Pair,
    find: Find<'a>,
    /// Whether sparse matches find the range.
    found: bool,
    method: Option<&'a Method>,
    region: Option<Rect>,
    known: Option<Conditioning>,
    prior: Option<Arc<Prior>>,
    cancel: Option<&'a AtomicBool>,
    listener: Option<Listener<'a>>,
    inspect: Option<Inspect<'a>>,
}

impl Matcher {
    /// Matches `pair` over the disparities of `search`: `0..=47`, or `..` for the range that sparse matches find.
    ///
    /// # Errors
    /// The errors of [`Job::run`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run(&mut self, pair: &Pair, search: impl Search) -> Result<Matched> {
        self.job(pair, search).run()
    }

    /// A match of `pair` that can be watched, stopped and inspected. See [`Matcher::run`].
    pub fn job<'a>(&'a mut self, pair: &'a Pair, search: impl Search + 'a) -> Job<'a> {
        Job::new(self, pair, search)
    }
}

impl<'a> Job<'a> {
    pub(super) fn new<S: Search + 'a>(matcher: &'a mut Matcher, pair: &'a Pair, search: S) -> Self {
        let find = Box::new(move |pair: &Pair| search.range(pair));
        Self {
            matcher,
            pair,
            find,
            found: S::AUTOMATIC,
            method: None,
            region: None,
            known: None,
            prior: None,
            cancel: None,
            listener: None,
            inspect: None,
        }
    }

    /// Uses `method` instead of the matcher's own.
    pub fn method(self, method: &'a Method) -> Self {
        Self { method: Some(method), ..self }
    }

    /// Matches only this part of the left view, with its counterpart in the right view, in the time of that
    /// part; the maps have its size. See [`Region`].
    pub fn region(self, part: Rect) -> Self {
        Self { region: Some(part), ..self }
    }

    /// Corrects the pair as an earlier frame of the same cameras, whose [`Matched::conditioning`] this is, instead of measuring the
    /// corrections. [`Matcher::run_all`](Matcher::run_all_async) does that by itself.
    pub fn conditioning(self, known: Conditioning) -> Self {
        Self { known: Some(known), ..self }
    }

    /// Takes what is known of the scene, for the left view. See [`Prior`].
    pub fn prior(self, prior: impl Into<Arc<Prior>>) -> Self {
        Self { prior: Some(prior.into()), ..self }
    }

    /// `listener` receives the progress as each stage begins. If the pair is matched [again](Search::AUTOMATIC), it
    /// restarts at 0. The listener may return a [`ControlFlow`]; a break ends the match with [`Error::Interrupted`].
    pub fn on_progress<A: Answer>(self, mut listener: impl FnMut(Progress) -> A + Send + 'a) -> Self {
        Self { listener: Some(Box::new(move |progress| listener(progress).goes_on())), ..self }
    }

    /// Ends the match with [`Error::Interrupted`] soon after `cancel` becomes true.
    pub fn cancel(self, cancel: &'a AtomicBool) -> Self {
        Self { cancel: Some(cancel), ..self }
    }

    /// `inspect` inspects the running match for diagnosis. It may read any volume and map, which takes time.
    #[cfg(not(target_arch = "wasm32"))]
    #[doc(hidden)]
    pub fn inspect(self, inspect: impl FnMut(&mut Inspection) -> Result<()> + Send + 'a) -> Self {
        Self { inspect: Some(Box::new(inspect)), ..self }
    }

    /// Matches the pair.
    ///
    /// # Errors
    /// [`Error::Range`] for the disparities to search, [`Error::Option`] for options out of range, [`Error::Budget`]
    /// when no tile is small enough for the method's memory, [`Error::Device`] when the wanted device fails,
    /// [`Error::Memory`] when the machine or the device cannot hold the match, [`Error::Interrupted`] when it was
    /// stopped, [`Error::Mismatch`] for a [region](Job::region) outside the view, and those of [`Job::inspect`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run(self) -> Result<Matched> {
        pollster::block_on(self.run_async())
    }

    /// Like `run`, for a browser: between stages the thread can do other work.
    ///
    /// # Errors
    /// The errors of `run`.
    pub async fn run_async(self) -> Result<Matched> {
        let Self {
            matcher,
            pair,
            find,
            found,
            method,
            region,
            known,
            prior,
            cancel,
            mut listener,
            mut inspect,
        } = self;
        let (width, height) = pair.size();
        let range = matcher.threads.run(width * height, async || find(pair)).await??;
        let own = matcher.method.clone();
        let mut observer = |progress| {
            let stopped = cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
            let goes_on = !stopped && listener.as_mut().is_none_or(|listener| listener(progress));
            if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let inspector = inspect.as_mut().map(|inspect| &mut **inspect as _);
        let method = method.unwrap_or(&own);
        // An inspector sees a single match.
        let once = !found || inspector.is_some();
        let region = region.as_ref();
        let request = Request { range, method, known, prior: prior.as_ref() };
        let matched = matcher.solve_part(pair, region, request, &mut observer, inspector).await?;
        let matched = Matched { range_found: found, ..matched };
        let Some(wider) = check::wider(&matched.maps, range).filter(|_| !once) else { return Ok(matched) };
        let again = Request { range: wider, ..request };
        match matcher.solve_part(pair, region, again, &mut observer, None).await {
            Ok(again) if check::goes_beyond(&again.maps, range) => {
                Ok(Matched { range_found: found, ..again })
            }
            // Keep the first match if the wider range finds nothing more or does not fit.
            Ok(_) | Err(Error::Range(_) | Error::Budget(_) | Error::Memory(_)) => Ok(matched),
            Err(e) => Err(e),
        }
    }

    /// Matches the pair, and also writes the disparities to `out`, row by row, in pixels, `+inf` where there is none.
    ///
    /// # Errors
    /// The errors of [`Job::run`], and [`Error::Mismatch`] when `out` does not have one element per pixel of the maps.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run_into(self, out: &mut [f32]) -> Result<Matched> {
        pollster::block_on(self.run_into_async(out))
    }

    /// Like `run_into`, for a browser.
    ///
    /// # Errors
    /// The errors of `run_into`.
    pub async fn run_into_async(self, out: &mut [f32]) -> Result<Matched> {
        let (width, height) = self.region.as_ref().map_or(self.pair.size(), Rect::size);
        if out.len() != width * height {
            let reason = format!("{} values for a map of {width} x {height} pixels", out.len());
            return Err(Error::Mismatch(reason));
        }
        let matched = self.run_async().await?;
        out.copy_from_slice(matched.disparity().data());
        Ok(matched)
    }
}
