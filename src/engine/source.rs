//! The images of a running match.

use crate::error::{Purpose, Result};
use crate::front;
use crate::front::conditioning::Conditioning;
use crate::image::Pair;
use crate::memory;
use crate::plan::Plan;
use crate::program::Frame;
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
}

impl Source {
    /// Conditions the `original` pair.
    pub(super) fn condition(&mut self, original: &Pair, plan: &Plan, watch: &mut Watch<'_>) -> Result<()> {
        let (pair, conditioning) = front::condition(original, plan, watch)?;
        (self.pair, self.conditioning) = (Some(pair), conditioning);
        Ok(())
    }

    /// Makes `known` corrections to the `original` pair.
    pub(super) fn correct(
        &mut self,
        original: &Pair,
        plan: &Plan,
        known: Conditioning,
        watch: &mut Watch<'_>,
    ) -> Result<()> {
        let pair = front::correct(original, plan, &known, watch)?;
        (self.pair, self.conditioning) = (Some(pair), known);
        Ok(())
    }

    /// Replaces the pair by the `original` one at twice its size.
    pub(super) fn double(&mut self, original: &Pair, watch: &mut Watch<'_>) -> Result<()> {
        let doubled = watch.host("double_size", || front::doubled(original, &self.conditioning))?;
        (self.pair, self.is_double) = (Some(doubled), true);
        Ok(())
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
