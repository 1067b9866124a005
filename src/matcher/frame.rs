//! A pair of a sequence.

use crate::image::Pair;
use crate::options::DisparityRange;
use crate::prior::Prior;
use std::sync::Arc;

/// A pair of a sequence, with the disparities to search and what is known of the scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Frame {
    /// The pair.
    pub pair: Pair,
    /// The disparities to search.
    pub range: DisparityRange,
    /// What is known of the scene, for the left view.
    pub prior: Option<Arc<Prior>>,
}

impl Frame {
    /// A pair of whose scene nothing is known.
    #[must_use]
    pub fn new(pair: Pair, range: DisparityRange) -> Self {
        Self { pair, range, prior: None }
    }

    /// Takes what is known of the scene. See [`Prior`].
    #[must_use]
    pub fn with_prior(self, prior: Option<Arc<Prior>>) -> Self {
        Self { prior, ..self }
    }
}

impl From<(Pair, DisparityRange)> for Frame {
    fn from((pair, range): (Pair, DisparityRange)) -> Self {
        Self::new(pair, range)
    }
}
