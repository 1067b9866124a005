//! The tables of `--breakdown`: where errors occur, and how good confidence and validity are.

use mrfgs::evaluation::breakdown::Class;

use crate::table::Table;
use crate::text::figure;

use super::findings::{Figures, Findings};
use super::metrics::cut;

/// Both tables for a terminal, at most 120 characters wide. The help of `--breakdown` explains the columns.
pub(super) fn text(findings: &Findings) -> String {
    let mut errors = Table::new(&format!("l{}|r", "|rr".repeat(Class::ALL.len())));
    errors.titles(std::iter::once("").chain(Class::ALL.map(Class::name)).chain(["all"]));
    errors
        .row(std::iter::once("pair").chain(Class::ALL.iter().flat_map(|_| ["share", "bad"])).chain(["bad"]));
    rows(&mut errors, findings, |figures| {
        let parts = (0..Class::ALL.len()).flat_map(|i| {
            let part = figures.breakdown.as_ref().map(|b| &b.parts[i]);
            [part.map(|p| p.share), part.map(|p| p.points)]
        });
        parts.chain([figures.finished.as_ref().map(|r| r.all.bad[2])]).collect()
    });

    let mut worth = Table::new("l|rrr|rr");
    worth.titles(["", "confidence", "validity"]);
    worth.row(["pair", "AUC", "optimal", "random", "precision", "recall"]);
    rows(&mut worth, findings, |Figures { confidence, validity, .. }| {
        let (confidence, validity) = (confidence.as_ref(), validity.as_ref());
        let confidence =
            [confidence.map(|c| c.auc), confidence.map(|c| c.optimal), confidence.map(|c| c.random)];
        let validity = [validity.and_then(|v| v.precision), validity.and_then(|v| v.recall)];
        confidence.into_iter().chain(validity).collect()
    });

    format!(
        "\nWhere the errors of the final map are (% of all pixels with ground truth)\n\n{errors}\n\
         How good confidence and validity are (%)\n\n{worth}"
    )
}

/// Adds the rows of all pairs and of their mean.
fn rows(table: &mut Table, findings: &Findings, figures: impl Fn(&Figures) -> Vec<Option<f64>>) {
    findings.add_rows(table, |table, name, of| {
        let cells = figures(of).into_iter().map(|value| figure(value, 2));
        table.row(std::iter::once(cut(name)).chain(cells));
    });
}
