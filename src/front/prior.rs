//! Prepares a [prior](crate::prior) for a match: cleans and spreads its points, compares it with the images, and expresses it in the
//! labels of each level.

mod levels;
mod neighbours;
mod points;
mod trust;

use crate::image::Pair;
use crate::options::DisparityRange;
use crate::prior::{Prior, PriorKind, PriorUse};
pub(crate) use levels::{anchors, coarser, guessed, levels, with_guess};

/// A prior that is ready for a match, for the view at the size at which it is matched.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReadyPrior {
    /// Known disparities, spread if they were points.
    pub(crate) known: Prior,
    /// How much of the prior was used.
    pub(crate) used: PriorUse,
}

impl ReadyPrior {
    /// A `prior` for `pair`, which is matched over `range`, at the size of the pair.
    pub(crate) fn new(prior: &Prior, pair: &Pair, range: DisparityRange) -> Self {
        let points = prior.kind == PriorKind::Points;
        let cleaned = if points { points::cleaned(prior) } else { prior.clone() };
        let (known, trust) = trust::weighed(&cleaned, pair, range);
        let (given, kept) = (prior.count(), cleaned.count());
        let known = if points { points::spread(&known, pair.left()) } else { known };
        let trust = f64::from(trust) / 256.0;
        Self { known, used: PriorUse { kind: prior.kind, given, dropped: given - kept, trust } }
    }

    /// The same with other known disparities.
    pub(crate) fn with(&self, known: Prior) -> Self {
        Self { known, used: self.used }
    }
}
