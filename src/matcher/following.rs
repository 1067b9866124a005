//! Frames that follow from each other: the map of each is known before the next.

use super::corrections::Corrections;
use super::{Frame, Matched, Matcher, Request};
use crate::error::Result;
use crate::maps::Maps;
use crate::plan::Plan;
use crate::prior::Prior;
use crate::watch::{Observer, goes_on};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

impl Matcher {
    /// Like [`Matcher::run_all_until`], for cameras that stand still: the disparities measured in each frame are the [prior](Prior) of the
    /// next, so that maps flicker less. Where the scene moves, the images contradict the prior, and it counts less. Frames wait for each
    /// other. A frame with a prior of its own takes that instead.
    ///
    /// # Errors
    /// The errors of [`Job::run`](super::Job::run), after the results of all earlier frames.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run_following(
        &mut self,
        frames: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        take: impl FnMut(Matched) -> ControlFlow<()>,
    ) -> Result<()> {
        pollster::block_on(self.run_following_async(frames, cancel, take))
    }

    /// Like [`Matcher::run_following`], for cameras that move: `known` tells from the maps of each frame what is known of the next, such as
    /// [`Rig::prior_after`](crate::depth::Rig::prior_after).
    ///
    /// # Errors
    /// The errors of [`Matcher::run_following`] and of `known`.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn run_knowing(
        &mut self,
        frames: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        known: impl FnMut(&Maps) -> Result<Option<Prior>>,
        take: impl FnMut(Matched) -> ControlFlow<()>,
    ) -> Result<()> {
        pollster::block_on(self.follow(frames, cancel, known, take))
    }

    /// Like `run_following`, for a browser.
    ///
    /// # Errors
    /// The errors of [`Job::run_async`](super::Job::run_async), after the results of all earlier frames.
    pub async fn run_following_async(
        &mut self,
        frames: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        take: impl FnMut(Matched) -> ControlFlow<()>,
    ) -> Result<()> {
        self.follow(frames, cancel, |maps| Ok(Some(Prior::of_maps(maps))), take).await
    }

    async fn follow(
        &mut self,
        frames: impl IntoIterator<Item = impl Into<Frame>>,
        cancel: &AtomicBool,
        mut known_next: impl FnMut(&Maps) -> Result<Option<Prior>>,
        mut take: impl FnMut(Matched) -> ControlFlow<()>,
    ) -> Result<()> {
        let method = &self.method.clone();
        let observer: Observer = &mut |_| goes_on([cancel]);
        let mut corrections = Corrections::default();
        let mut last: Option<Arc<Prior>> = None;
        for frame in frames {
            let Frame { pair, range, prior } = frame.into();
            let (width, height) = pair.size();
            let plan = Plan::new(width, height, range, method)?;
            let measured = async || corrections.of(&pair, &plan, &mut *observer);
            let known = self.threads.run(width * height, measured).await??;
            let prior = prior.or_else(|| last.take().filter(|last| last.size() == pair.size()));
            let request = Request { range, method, known, prior: prior.as_ref() };
            let matched = self.solve(&pair, request, &mut *observer, None).await?;
            last = known_next(&matched.maps)?.map(Arc::new);
            if take(matched).is_break() {
                break;
            }
        }
        Ok(())
    }
}
