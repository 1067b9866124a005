//! Prepares a [prior](crate::prior) for a match: cleans and spreads its points, compares it with the images, and expresses it in the
//! labels of each level.

mod levels;
mod neighbours;
mod points;
mod trust;

use crate::image::Pair;
use crate::options::DisparityRange;
use crate::prior::{Prior, PriorKind, PriorUse};
pub(crate) use levels::{anchors, levels};

/// A prior that is ready for a match, for the view at the size at which it is matched.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReadyPrior {
    /// Known disparities, spread if they were points.
    pub(crate) known: Prior,
    /// The weight of the prior, in 1/256.
    pub(crate) weight: u32,
    /// What became of the prior.
    pub(crate) used: PriorUse,
}

impl ReadyPrior {
    /// A `prior` for `pair`, which is matched over `range`, at the size of the pair.
    pub(crate) fn new(prior: &Prior, pair: &Pair, range: DisparityRange) -> Self {
        let given = prior.count();
        let (known, kept) = match prior.kind {
            PriorKind::Points => {
                let points = points::cleaned(prior);
                let kept = points.count();
                (points, kept)
            }
            PriorKind::Surface => (prior.clone(), given),
        };
        let weight = trust::weight(&known, pair, range);
        let known = if known.kind == PriorKind::Points { points::spread(&known, pair.left()) } else { known };
        let trust = f64::from(weight) / 256.0;
        Self { known, weight, used: PriorUse { kind: prior.kind, given, dropped: given - kept, trust } }
    }

    /// The same with other known disparities.
    pub(crate) fn with(&self, known: Prior) -> Self {
        Self { known, ..self.clone() }
    }
}
