//! The tables of `--breakdown`: where the errors are, and how good confidence and validity are.

use mrfgs::evaluation::{Breakdown, Detection, Report, Sparsification, breakdown::Class};

use crate::table::Table;
use crate::text::figure;

use super::findings::Findings;
use super::metrics::cut;

/// What the tables show of a pair, or of the mean.
type Line<'a> =
    (&'a str, Option<&'a Report>, Option<&'a Breakdown>, Option<&'a Sparsification>, Option<&'a Detection>);

/// Both tables for a terminal, at most 120 characters wide. The help of `--breakdown` explains the columns.
pub(super) fn text(findings: &Findings) -> String {
    let pairs = findings.pairs.iter().map(|p| {
        let report = Some(&p.finished);
        (p.name.as_str(), report, p.breakdown.as_ref(), p.confidence.as_ref(), p.validity.as_ref())
    });
    let pairs: Vec<Line> = pairs.collect();
    let m = &findings.mean;
    let mean: Line =
        ("mean", m.finished.as_ref(), m.breakdown.as_ref(), m.confidence.as_ref(), m.validity.as_ref());

    let mut errors = Table::new(&format!("l{}|r", "|rr".repeat(Class::ALL.len())));
    errors.titles(std::iter::once("").chain(Class::ALL.map(Class::name)).chain(["all"]));
    errors
        .row(std::iter::once("pair").chain(Class::ALL.iter().flat_map(|_| ["share", "bad"])).chain(["bad"]));
    rows(&mut errors, &pairs, &mean, |(_, report, breakdown, ..)| {
        let parts = (0..Class::ALL.len()).flat_map(|i| {
            let part = breakdown.map(|b| &b.parts[i]);
            [part.map(|p| p.share), part.map(|p| p.points)]
        });
        parts.chain([report.map(|r| r.all.bad[2])]).collect()
    });

    let mut worth = Table::new("l|rrr|rr");
    worth.titles(["", "confidence", "validity"]);
    worth.row(["pair", "AUC", "optimal", "random", "precision", "recall"]);
    rows(&mut worth, &pairs, &mean, |(_, _, _, confidence, validity)| {
        let confidence =
            [confidence.map(|c| c.auc), confidence.map(|c| c.optimal), confidence.map(|c| c.random)];
        let validity = [validity.and_then(|v| v.precision), validity.and_then(|v| v.recall)];
        confidence.into_iter().chain(validity).collect()
    });

    format!(
        "\nWhere the errors of the final map are (% of all pixels with known truth)\n\n{errors}\n\
         How good confidence and validity are (%)\n\n{worth}"
    )
}

/// Adds the rows of all pairs, and from two pairs on that of their mean.
fn rows(table: &mut Table, pairs: &[Line], mean: &Line, figures: impl Fn(&Line) -> Vec<Option<f64>>) {
    let cells = |line: &Line| {
        let figures = figures(line).into_iter().map(|value| figure(value, 2));
        std::iter::once(cut(line.0)).chain(figures).collect::<Vec<_>>()
    };
    table.rule();
    for line in pairs {
        table.row(cells(line));
    }
    if pairs.len() > 1 {
        table.rule();
        table.row(cells(mean));
    }
}
