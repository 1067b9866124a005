//! What an evaluation finds, as JSON has it.

use mrfgs::evaluation::{Breakdown, Detection, Report, Sparsification, mean};
use mrfgs::options::Method;
use serde::Serialize;

/// The figures of all pairs, and what they are of.
#[derive(Serialize)]
pub(super) struct Findings {
    pub(super) method: Option<Method>,
    pub(super) ran_on: Option<String>,
    pub(super) pairs: Vec<Figures>,
    pub(super) mean: Mean,
}

/// The figures of one pair.
#[derive(Serialize)]
pub(super) struct Figures {
    pub(super) name: String,
    pub(super) raw: Option<Report>,
    #[serde(rename = "final")]
    pub(super) finished: Report,
    pub(super) breakdown: Option<Breakdown>,
    pub(super) confidence: Option<Sparsification>,
    pub(super) validity: Option<Detection>,
    pub(super) seconds: Option<f64>,
}

/// The means over all pairs.
#[derive(Serialize)]
pub(super) struct Mean {
    pub(super) raw: Option<Report>,
    #[serde(rename = "final")]
    pub(super) finished: Option<Report>,
    pub(super) breakdown: Option<Breakdown>,
    pub(super) confidence: Option<Sparsification>,
    pub(super) validity: Option<Detection>,
}

impl Findings {
    pub(super) fn new(method: Option<Method>, ran_on: Option<String>, pairs: Vec<Figures>) -> Self {
        let raw = pairs.iter().map(|f| f.raw.as_ref()).collect::<Option<Vec<_>>>().and_then(mean);
        let finished = mean(pairs.iter().map(|f| &f.finished));
        let mean = Mean {
            raw,
            finished,
            breakdown: over(&pairs, |f| f.breakdown.as_ref(), Breakdown::mean),
            confidence: over(&pairs, |f| f.confidence.as_ref(), Sparsification::mean),
            validity: over(&pairs, |f| f.validity.as_ref(), Detection::mean),
        };
        Self { method, ran_on, pairs, mean }
    }
}

/// The mean over all pairs; none if one of them lacks the figure.
fn over<T>(pairs: &[Figures], of: fn(&Figures) -> Option<&T>, mean: fn(&[&T]) -> Option<T>) -> Option<T> {
    mean(&pairs.iter().map(of).collect::<Option<Vec<_>>>()?)
}
