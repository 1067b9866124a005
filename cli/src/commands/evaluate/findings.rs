//! The results of an evaluation, as in JSON.

use mrfgs::evaluation::{Breakdown, Detection, Report, Sparsification, mean};
use mrfgs::options::Method;
use serde::Serialize;

use crate::table::Table;

/// The figures of all pairs, with method and device.
#[derive(Serialize)]
pub(super) struct Findings {
    /// The preset or file by which `--method` names the method; `None` if only one method is evaluated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) name: Option<String>,
    pub(super) method: Option<Method>,
    pub(super) ran_on: Option<String>,
    pub(super) pairs: Vec<Scored>,
    /// The means over all pairs.
    pub(super) mean: Figures,
    /// The figures of the other methods, if there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) beside: Vec<Self>,
}

/// The figures of one pair.
#[derive(Serialize)]
pub(super) struct Scored {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) figures: Figures,
    pub(super) seconds: Option<f64>,
}

/// Figures of a pair, or means over all pairs. A finished map only has `finished`.
#[derive(Default, Serialize)]
pub(super) struct Figures {
    pub(super) raw: Option<Report>,
    #[serde(rename = "final")]
    pub(super) finished: Option<Report>,
    pub(super) breakdown: Option<Breakdown>,
    pub(super) confidence: Option<Sparsification>,
    pub(super) validity: Option<Detection>,
}

impl Figures {
    /// The errors of each available map, with its name.
    pub(super) fn maps(&self) -> impl Iterator<Item = (&'static str, &Report)> {
        let maps = [("raw", &self.raw), ("final", &self.finished)].into_iter();
        maps.filter_map(|(map, report)| Some((map, report.as_ref()?)))
    }
}

impl Findings {
    pub(super) fn new(method: Option<Method>, ran_on: Option<String>, pairs: Vec<Scored>) -> Self {
        let mean = Figures {
            raw: over(&pairs, |f| f.raw.as_ref(), |reports| mean(reports.iter().copied())),
            finished: over(&pairs, |f| f.finished.as_ref(), |reports| mean(reports.iter().copied())),
            breakdown: over(&pairs, |f| f.breakdown.as_ref(), Breakdown::mean),
            confidence: over(&pairs, |f| f.confidence.as_ref(), Sparsification::mean),
            validity: over(&pairs, |f| f.validity.as_ref(), Detection::mean),
        };
        Self { name: None, method, ran_on, pairs, mean, beside: Vec::new() }
    }

    /// These findings, then those of the other methods.
    pub(super) fn of_each_method(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.beside)
    }

    /// `word`, followed by the name of the method if there is one.
    pub(super) fn qualified(&self, word: &str) -> String {
        self.name.as_ref().map_or_else(|| word.into(), |name| format!("{word} by {name}"))
    }

    /// Adds the rows of all pairs to a table, and for two or more pairs of their mean, each after a rule.
    pub(super) fn add_rows(&self, table: &mut Table, add: impl Fn(&mut Table, &str, &Figures)) {
        table.rule();
        for pair in &self.pairs {
            add(table, &pair.name, &pair.figures);
        }
        if self.pairs.len() > 1 {
            table.rule();
            add(table, "mean", &self.mean);
        }
    }
}

/// The mean over all pairs; `None` if one of them lacks the figure.
fn over<T>(pairs: &[Scored], of: fn(&Figures) -> Option<&T>, mean: fn(&[&T]) -> Option<T>) -> Option<T> {
    mean(&pairs.iter().map(|pair| of(&pair.figures)).collect::<Option<Vec<_>>>()?)
}
