//! Options of the matching cost.

use super::row::{odd, one_of, options, real, words};
use crate::error::OptionError;

words! {
    /// Matching cost of a pixel and a label.
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

impl MatchingCost {
    /// The largest cost of a label.
    pub(crate) const fn most(self) -> f64 {
        match self {
            Self::Sad => 254.0,
            Self::Census | Self::AdCensus => 1.625,
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
        /// From this standard deviation of the grey around a pixel on, ad-census weighs colour in full; below
        /// it, the weight falls with the variance.
        colour_contrast: f64 = 5.0, takes real(0.0..=128.0), unit "8-bit levels", source "not in the paper";
        /// Cost of a label that falls outside the right image or on a masked pixel. It is the same for all such labels, so
        /// that none is preferred. It may not be larger than the largest matching cost.
        outside_cost: f64 = 0.7, takes real(0.0..=MatchingCost::Sad.most()), unit "as the matching cost", source "open";
        /// How a level's cost volume comes from the next finer one.
        pyramid: Pyramid = Pyramid::Minimum, takes one_of(Pyramid::WORDS), source "section 2.4: low-pass; open along the labels";
    }
}

impl CostOptions {
    /// Checks what a row alone cannot: the range of `outside_cost` depends on `matching`.
    pub(super) fn check(&self) -> Result<(), (String, OptionError)> {
        let (value, high) = (self.outside_cost, self.matching.most());
        if value <= high {
            return Ok(());
        }
        Err(("outside-cost".to_owned(), OptionError::OutOfRange { value, low: 0.0, high }))
    }
}
