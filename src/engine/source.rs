//! The images of a running match.

use crate::error::{Purpose, Result};
use crate::front;
use crate::front::conditioning::Conditioning;
use crate::front::prior::ReadyPrior;
use crate::image::{Pair, Plane};
use crate::memory;
use crate::plan::Plan;
use crate::prior::{Prior, PriorUse};
use crate::program::Frame;
use crate::stage::prior::LevelPriors;
use crate::watch::Watch;

/// The pair that is matched, and the part of it that the backend holds.
#[derive(Default)]
pub(super) struct Source {
    pair: Option<Pair>,
    /// Kept where the maps of parts are assembled.
    pub(super) part: Option<Pair>,
    /// The corrections that were made to the pair.
    pub(super) conditioning: Conditioning,
    /// Whether the pair is at twice its size.
    pub(super) is_double: bool,
    /// Known disparities of the left view, prepared for the match.
    prior: Option<ReadyPrior>,
    /// Disparities and validity of the last look, if tiles look again.
    guess: Option<(Plane<i32>, Plane<u8>)>,
}

impl Source {
    /// Conditions the `original` pair.
    pub(super) fn condition(&mut self, original: &Pair, plan: &Plan, watch: &mut Watch<'_>) -> Result<()> {
        let (pair, conditioning) = front::condition(original, plan, watch)?;
        (self.pair, self.conditioning) = (Some(pair), conditioning);
        Ok(())
    }

    /// Makes `known` corrections to the `original` pair, for a backend that `halves` pairs or does not.
    pub(super) fn correct(
        &mut self,
        original: &Pair,
        plan: &Plan,
        known: Conditioning,
        halves: bool,
        watch: &mut Watch<'_>,
    ) -> Result<()> {
        let pair = front::correct(original, plan, &known, halves, watch)?;
        (self.pair, self.conditioning) = (Some(pair), known);
        Ok(())
    }

    /// Replaces the pair by the `original` one at twice its size.
    pub(super) fn double(&mut self, original: &Pair, watch: &mut Watch<'_>) -> Result<()> {
        let doubled = watch.host("double_size", || front::doubled(original, &self.conditioning))?;
        (self.pair, self.is_double, self.guess) = (Some(doubled), true, None);
        self.prior = self.prior.take().map(|ready| ready.with(ready.known.doubled()));
        Ok(())
    }

    /// Prepares a `prior` of the scene, of the size of the original pair.
    pub(super) fn know(&mut self, prior: &Prior, plan: &Plan, watch: &mut Watch<'_>) -> Result<()> {
        let pair = self.pair();
        let ready = watch.host("prior", || {
            pair.compute();
            let halved = plan.full.is_some().then(|| prior.halved());
            Ok(ReadyPrior::new(halved.as_ref().unwrap_or(prior), pair, plan.range))
        })?;
        self.prior = Some(ready);
        Ok(())
    }

    /// Takes disparities and validity of a look as the guess of the next one.
    pub(super) fn guess(&mut self, guess: (Plane<i32>, Plane<u8>)) {
        self.guess = Some(guess);
    }

    /// The prior of the pixels of `frame`, in the labels of its levels.
    pub(super) fn prior_of(&self, frame: &Frame) -> Option<LevelPriors> {
        let known = self.known_of(frame);
        let Some((disparity, validity)) = self.guess.as_ref().filter(|_| !frame.mirrored) else {
            return known;
        };
        let guess = (&disparity.crop(&frame.crop), &validity.crop(&frame.crop));
        Some(front::prior::with_guess(known, guess, &frame.plan))
    }

    /// The prior that the caller gave, for the pixels of `frame` and in the labels of its levels.
    fn known_of(&self, frame: &Frame) -> Option<LevelPriors> {
        let ready = self.prior.as_ref().filter(|_| frame.plan.prior)?;
        if frame.tile.is_none() && !frame.mirrored {
            return Some(front::prior::levels(ready, &frame.plan));
        }
        let crop = ready.known.crop(&frame.crop);
        let known = if frame.mirrored { crop.mirrored() } else { crop };
        Some(front::prior::levels(&ready.with(known), &frame.plan))
    }

    /// The anchors of the whole image, if a prior gives any.
    pub(super) fn anchors(&self) -> Option<Plane<i32>> {
        self.prior.as_ref().map(front::prior::anchors)
    }

    /// Reports how much of the prior was used.
    pub(super) fn used(&self) -> Option<PriorUse> {
        self.prior.as_ref().map(|ready| ready.used)
    }

    pub(super) fn pair(&self) -> &Pair {
        self.pair.as_ref().expect("the pair was conditioned")
    }

    pub(super) fn part(&self) -> &Pair {
        self.part.as_ref().expect("a frame was entered")
    }

    /// The part of the pair that belongs to `frame`, if the memory holds a copy.
    pub(super) fn enter(&self, frame: &Frame) -> Result<Pair> {
        let copy = |make: &dyn Fn() -> Pair| {
            memory::check(frame.plan.pair_bytes(), Purpose::Match)?;
            Ok(make())
        };
        let pair = self.pair();
        let crop = if frame.tile.is_none() { pair.clone() } else { copy(&|| pair.crop(&frame.crop))? };
        if frame.mirrored { copy(&|| crop.mirrored()) } else { Ok(crop) }
    }
}
