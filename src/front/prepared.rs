//! A pair that is prepared for a match.

#[cfg(feature = "paper")]
use super::{matches::SparseMatch, zones::Zones};
use crate::image::{Pair, Plane};
use crate::stage::prior::LevelPriors;

/// Everything that a backend needs for a match.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The pair to match, its illumination corrected where the method asks for it.
    pub pair: Pair,
    /// First and last label index of each pixel, by level; empty where every label is allowed.
    pub label_ranges: Vec<Plane<[u16; 2]>>,
    /// The prior of each label. Without it, a plan with a prior takes every label alike.
    pub prior: Option<LevelPriors>,
    /// The source of the label ranges: texture zones and sparse matches.
    #[cfg(feature = "paper")]
    pub zones: Option<(Zones, Vec<SparseMatch>)>,
}

impl Prepared {
    /// A pair that is matched as it is, with all labels.
    #[must_use]
    pub fn new(pair: &Pair) -> Self {
        Self {
            pair: pair.clone(),
            label_ranges: Vec::new(),
            prior: None,
            #[cfg(feature = "paper")]
            zones: None,
        }
    }
}
