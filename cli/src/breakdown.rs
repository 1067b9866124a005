//! The tables of `mrfgs evaluate --breakdown`: where the errors are, what confidence and validity are worth.

use std::fmt::Write;

use mrfgs::evaluation::{Breakdown, Detection, Report, Sparsification, breakdown::Class};

use crate::evaluate::Findings;
use crate::tables::{figure, push};

/// What the tables show of a pair, or of all.
type Line<'a> =
    (&'a str, Option<&'a Report>, Option<&'a Breakdown>, Option<&'a Sparsification>, Option<&'a Detection>);

/// Both tables for a terminal, at most 120 characters wide. What the columns hold is told by the help of `--breakdown`.
pub(super) fn text(findings: &Findings) -> String {
    let pairs = findings.pairs.iter().map(|p| {
        let report = Some(&p.finished);
        (p.name.as_str(), report, p.breakdown.as_ref(), p.confidence.as_ref(), p.validity.as_ref())
    });
    let pairs: Vec<Line> = pairs.collect();
    let m = &findings.mean;
    let mean: Line =
        ("mean", m.finished.as_ref(), m.breakdown.as_ref(), m.confidence.as_ref(), m.validity.as_ref());

    let mut out =
        String::from("\nWhere the errors of the final map are (% of all pixels with known truth)\n\n");
    let names = Class::ALL.iter().map(|class| format!("{:^13}", class.name()));
    push(&mut out, "", names.chain(["  all".into()]));
    push(&mut out, "pair", Class::ALL.map(|_| " share    bad".into()).into_iter().chain(["   bad".into()]));
    lines(&mut out, &pairs, &mean, &[13, 13, 13, 13, 13, 13, 6], |(_, report, breakdown, ..)| {
        let parts = Class::ALL.iter().enumerate().map(|(i, _)| {
            let part = breakdown.map(|b| &b.parts[i]);
            format!("{} {}", cell(part.map(|p| p.share), 6), cell(part.map(|p| p.points), 6))
        });
        parts.chain([cell(report.map(|r| r.all.bad[2]), 6)]).collect()
    });

    out.push_str("\nWhat confidence and validity are worth (%)\n\n");
    push(&mut out, "", ["      confidence      ".into(), "     validity".into()].into_iter());
    push(&mut out, "pair", ["   AUC optimal  random".into(), " precision  recall".into()].into_iter());
    lines(&mut out, &pairs, &mean, &[22, 18], |(_, _, _, confidence, validity)| {
        let [auc, optimal, random] =
            [confidence.map(|c| c.auc), confidence.map(|c| c.optimal), confidence.map(|c| c.random)];
        let (precision, recall) = (validity.and_then(|v| v.precision), validity.and_then(|v| v.recall));
        vec![
            format!("{} {} {}", cell(auc, 6), cell(optimal, 7), cell(random, 7)),
            format!("{} {}", cell(precision, 10), cell(recall, 7)),
        ]
    });
    out
}

/// The lines below the heads of a table whose groups of columns have these widths.
fn lines(
    out: &mut String,
    pairs: &[Line],
    mean: &Line,
    widths: &[usize],
    groups: impl Fn(&Line) -> Vec<String>,
) {
    let mut rule = "-".repeat(12);
    for &width in widths {
        let _ = write!(rule, "+{}", "-".repeat(width));
    }
    let _ = writeln!(out, "{rule}");
    for line in pairs {
        push(out, line.0, groups(line).into_iter());
    }
    if pairs.len() > 1 {
        let _ = writeln!(out, "{rule}");
        push(out, mean.0, groups(mean).into_iter());
    }
}

/// A figure with two decimals, or a dash.
fn cell(value: Option<f64>, width: usize) -> String {
    format!("{:>width$}", figure(value, 2))
}
