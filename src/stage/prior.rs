//! Adds what is [known of the scene](crate::prior) to the evidence of a level: a unary factor, like the prior of equation 5 in
//! section 2.4, but from any source.
//!
//! The pixel's prior in [`LevelPriors::levels`] has an interval of labels lo ..= hi, a slope per
//! label and a cap, in units. With these:
//!
//! ```text
//! p(k)  = min(slope max(lo - k, k - hi, 0), cap)              rounded down
//! e'(k) = min(e(k) + p(k) - min of e + p over the labels that the pixel has, evidence cap of the level)
//! ```
//!
//! The distance from the interval counts up to `PRIOR_REACH`. The beliefs of these labels become the evidence.
//! Pixels of which nothing is known have cap 0 and keep their evidence.

use super::{Data, Descriptor, Volume, volumes};
use crate::image::Plane;
use crate::plan::{PRIOR_LABEL_BITS, PRIOR_REACH, PRIOR_SLOPE_BITS, PRIOR_SLOPE_MOST};

/// What a prior says of the labels of a pixel of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LabelPrior {
    /// First label without a cost, in 1/32 label from the smallest label of the level.
    pub lo: i32,
    /// Last label without a cost, likewise.
    pub hi: i32,
    /// Cost per label outside, in 1/16 unit.
    pub slope: u32,
    /// The largest cost, in units; 0 where nothing is known.
    pub cap: u8,
}

/// What a prior says of all pixels of a match.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelPriors {
    /// The prior of each pixel, by level.
    pub levels: Vec<Plane<LabelPrior>>,
    /// [`Map::Anchor`](super::Map::Anchor).
    pub anchors: Plane<i32>,
}

impl LabelPrior {
    /// A label, in the fraction of `lo` and `hi`.
    pub(crate) const LABEL: i32 = 1 << PRIOR_LABEL_BITS;

    /// This prior with an interval that begins and ends at most a label outside the `labels` of the level.
    #[must_use]
    pub fn cut(self, labels: usize) -> Self {
        let end = |label: i32| label.clamp(-Self::LABEL, labels as i32 * Self::LABEL);
        Self { lo: end(self.lo), hi: end(self.hi), ..self }
    }

    /// Two words for a device: `lo` and `hi` plus one label in 20 bits each, `slope` in 12, `cap` in 8, after a [cut](Self::cut) to
    /// the `labels` of the level.
    #[must_use]
    pub fn words(self, labels: usize) -> [u32; 2] {
        let Self { lo, hi, slope, cap } = self.cut(labels);
        let end = |label: i32| (label + Self::LABEL).cast_unsigned();
        [end(lo) | slope.min(PRIOR_SLOPE_MOST) << 20, end(hi) | u32::from(cap) << 20]
    }

    /// The cost of label `k` by these words, in units.
    #[must_use]
    #[inline(always)]
    pub fn cost([lo, hi]: [u32; 2], k: u32) -> u32 {
        let at = (k + 1) << PRIOR_LABEL_BITS;
        let (lo, slope, hi, cap) = (lo & 0xf_ffff, lo >> 20, hi & 0xf_ffff, hi >> 20);
        let away = lo.saturating_sub(at).max(at.saturating_sub(hi)).min(PRIOR_REACH);
        ((slope * away) >> (PRIOR_LABEL_BITS + PRIOR_SLOPE_BITS)).min(cap)
    }
}

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| vec![Data::Volume(Volume::Evidence(z)), Data::Windows(z), Data::Prior(z)],
    writes: |z| volumes(&[Volume::Evidence(z), Volume::Belief(z)]),
    reach: Some(0),
    cell: 0.15,
    ..Descriptor::NONE
};
