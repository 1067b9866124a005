//! Options of the matching cost.

use super::row::{odd, one_of, options, real, whole, words};
use crate::error::OptionError;

words! {
    /// Matching cost of a pixel and a label.
    ///
    /// Where both pixels are inside and unmasked, left (x, y) and right (x - d, y) cost as follows, with channels
    /// and grey as [`Pixel`](crate::image::Pixel) holds them (`>> 8` makes them 8-bit), and dr, dg and db the
    /// differences of the channels between left and right:
    ///
    /// - **SAD**, over the places (i, j) of a square of side `sad_window` around the pixel at which
    ///   left (x + i, y + j) and right (x - d + i, y + j) are both inside and unmasked:
    ///
    ///   ```text
    ///   n    = the number of these places
    ///   S    = sum of |dr| + |dg| + |db| over them
    ///   cost = min(floor((`sad_steps` S + 384 n) / (768 n)), COST_MAX)     the mean in steps of 8-bit levels, ties up
    ///   ```
    ///
    /// - **Census**. The census of a pixel has a bit for each other place of its 9 x 7 neighbourhood,
    ///   clamped to the image: set where the place is unmasked and its grey is below the centre's.
    ///
    ///   ```text
    ///   h    = the number of bits in which the two censuses differ
    ///   cost = 4 min(h, 40)
    ///   ```
    ///
    /// - **AD-census** adds the difference in colour, with a weight w that grows with the contrast of
    ///   the left image. g is the grey `>> 8` of each of the 63 clamped places of the 9 x 7
    ///   neighbourhood of left (x, y), that of the centre where the place is masked; t is
    ///   [`colour_variance`](crate::plan::Plan::colour_variance).
    ///
    ///   ```text
    ///   A    = min(|dr| + |dg| + |db|, 64)                         of channels >> 8
    ///   v    = 63 (sum of g^2) - (sum of g)^2                      63^2 times the variance
    ///   w    = floor(48 min(v, t) / t)                             48 where t = 0
    ///   cost = 4 min(h, 40) + ((w A + 32) >> 6)
    ///   ```
    MatchingCost {
        /// Mean absolute colour difference over a square window, in 8-bit levels.
        Sad = "sad",
        /// Hamming distance of 9 x 7 census transforms (Zabih and Woodfill 1994), 1/32 per bit, at most 1.25.
        Census = "census",
        /// The census cost plus the colour difference, which adds at most 0.375, and less where the left image has little
        /// contrast: on a plain surface the colour changes with the light alone and misleads (after Mei et al. 2011, who
        /// weigh both alike).
        AdCensus = "ad-census",
    }
}

/// Properties of a matching cost.
#[derive(Clone, Copy, Debug)]
pub struct CostFacts {
    /// Largest cost of a label, and so of one outside the image, if `sad_steps` is 1.
    pub most: f64,
    /// Cost units that stand for a cost of 1, if `sad_steps` is 1.
    pub units: f64,
    /// Cost units of the largest colour difference at full weight.
    pub colour_weight: u32,
    /// Whether the costs of a row can be computed at any time from features of both views, so that level 0
    /// need not be held whole.
    pub by_rows: bool,
}

impl MatchingCost {
    /// The properties of the cost.
    #[must_use]
    pub const fn facts(self) -> CostFacts {
        match self {
            Self::Sad => CostFacts { most: 254.0, units: 1.0, colour_weight: 0, by_rows: false },
            Self::Census => CostFacts { most: 1.625, units: 128.0, colour_weight: 0, by_rows: true },
            Self::AdCensus => CostFacts { most: 1.625, units: 128.0, colour_weight: 48, by_rows: true },
        }
    }
}

words! {
    /// How a level's cost volume comes from the next finer one.
    Pyramid {
        /// Binomial low-pass in x, y and d, then every second sample of each (Burt and Adelson 1983).
        LowPass = "low-pass",
        /// Binomial low-pass in x and y; in d the minimum over the labels within one of twice the coarse label.
        Minimum = "minimum",
    }
}

options! {
    /// The cost of matching a pixel at a label, and its pyramid.
    "cost" CostOptions {
        /// Matching cost.
        matching: MatchingCost = MatchingCost::AdCensus, takes one_of(MatchingCost::WORDS),
            source "section 2.4: sad";
        /// Side of the window of the cost sad.
        sad_window: u32 = 7, takes odd(1..=31), unit "pixels", source "section 3.1: 7";
        /// Steps per 8-bit level to which the cost sad is rounded. A cost is at most 254 steps, so finer steps cut
        /// large costs off earlier.
        sad_steps: u32 = 1, takes whole(1..=16), unit "steps per 8-bit level", source "not in the paper", for reproduction;
        /// From this standard deviation of the grey around a pixel on, ad-census weighs colour in full; below
        /// it, the weight falls with the variance.
        colour_contrast: f64 = 5.0, takes real(0.0..=128.0), unit "8-bit levels", source "not in the paper";
        /// Cost of a label that falls outside the right image or on a masked pixel. It is the same for all such labels, so
        /// that none is preferred. It may not be larger than the largest matching cost.
        outside_cost: f64 = 0.7, takes real(0.0..=MatchingCost::Sad.facts().most), unit "as the matching cost", source "open";
        /// How a level's cost volume comes from the next finer one.
        pyramid: Pyramid = Pyramid::Minimum, takes one_of(Pyramid::WORDS), source "section 2.4: low-pass; open along the labels", for reproduction;
    }
}

impl CostOptions {
    /// Cost units that stand for a cost of 1: those of the matching cost, times `sad_steps` for the cost sad.
    #[must_use]
    pub fn units(&self) -> f64 {
        self.matching.facts().units * self.steps()
    }

    /// Largest cost of a label, and so of one outside the image: that of the matching cost, divided by `sad_steps`
    /// for the cost sad.
    #[must_use]
    pub fn most(&self) -> f64 {
        self.matching.facts().most / self.steps()
    }

    fn steps(&self) -> f64 {
        if self.matching == MatchingCost::Sad { f64::from(self.sad_steps) } else { 1.0 }
    }

    /// Checks what a single row cannot: the range of `outside_cost` depends on `matching` and `sad_steps`.
    pub(super) fn check(&self) -> Result<(), (String, OptionError)> {
        let (value, high) = (self.outside_cost, self.most());
        if value <= high {
            return Ok(());
        }
        Err(("outside-cost".to_owned(), OptionError::OutOfRange { value, low: 0.0, high }))
    }
}
