//! The paper's tables with its figures and ours, for `mrfgs evaluate --tables`.

use std::fmt::Write;

use mrfgs::evaluation::Report;
use mrfgs::evaluation::paper::{Figures, Published, SOURCE, published};
use mrfgs::options::Method;
use serde::{Serialize, Serializer};

use crate::evaluate::Findings;

/// The presets that stand beside the paper's methods.
pub(super) const COMPARED: [&str; 3] = ["fgs", "paper", "default"];

/// Something of each preset, in their order.
pub(super) type Each<T> = Vec<(&'static str, T)>;

/// Both tables. What the fields hold is told by the help of `--tables`.
#[derive(Serialize)]
pub(super) struct Comparison {
    source: &'static str,
    ran_on: Option<String>,
    #[serde(serialize_with = "entries")]
    methods: Each<Option<Method>>,
    tables: [Table; 2],
}

/// One table of the paper.
#[derive(Serialize)]
struct Table {
    number: u8,
    map: &'static str,
    pairs: Vec<Named>,
    mean: Line,
}

#[derive(Serialize)]
struct Named {
    name: String,
    #[serde(flatten)]
    line: Line,
}

/// The figures of a pair, or their mean.
#[derive(Serialize)]
struct Line {
    published: Option<Published>,
    #[serde(serialize_with = "entries")]
    ours: Each<Option<Figures>>,
}

/// As an object.
pub(super) fn entries<T: Serialize, S: Serializer>(each: &Each<T>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(each.iter().map(|(name, value)| (name, value)))
}

impl Comparison {
    /// From what each preset, by name, has found on the same pairs.
    pub(super) fn new(found: &[(&'static str, Findings)]) -> Self {
        let tables = [(1, "raw"), (2, "final")].map(|(number, map)| {
            let figures = |raw: Option<&Report>, finished: Option<&Report>| {
                let report = if number == 1 { raw } else { finished };
                report.map(|report| Figures::from(&report.all))
            };
            let names = found.iter().take(1).flat_map(|(_, findings)| &findings.pairs).map(|pair| &pair.name);
            let pairs: Vec<Named> = names
                .enumerate()
                .map(|(i, name)| {
                    let ours = found.iter().map(|(preset, findings)| {
                        let pair = &findings.pairs[i];
                        (*preset, figures(pair.raw.as_ref(), Some(&pair.finished)))
                    });
                    let published = published(name).map(|tables| tables[number as usize - 1]);
                    Named { name: name.clone(), line: Line { published, ours: ours.collect() } }
                })
                .collect();
            let ours = found.iter().map(|(preset, findings)| {
                (*preset, figures(findings.mean.raw.as_ref(), findings.mean.finished.as_ref()))
            });
            let mean = Line { published: mean_published(&pairs), ours: ours.collect() };
            Table { number, map, pairs, mean }
        });
        Self {
            source: SOURCE,
            ran_on: found.last().and_then(|(_, findings)| findings.ran_on.clone()),
            methods: found.iter().map(|(preset, findings)| (*preset, findings.method.clone())).collect(),
            tables,
        }
    }

    /// Both tables for a terminal, at most 120 characters wide.
    pub(super) fn text(&self) -> String {
        let mut out = String::new();
        for table in &self.tables {
            let (when, presets) = (if table.number == 1 { "before" } else { "after" }, &table.mean.ours);
            let _ = writeln!(
                out,
                "Table {}: {} maps, {when} post-processing. Avg. err (px), PSNR (dB), Bad2.0 (%)\n",
                table.number, table.map
            );
            let ours = presets.iter().map(|(preset, _)| format!("ours: {preset}"));
            let heads: Vec<_> =
                ["paper: FGS".into(), "paper: MR-FGS".into()].into_iter().chain(ours).collect();
            push(&mut out, "", heads.iter().map(|head| format!("{head:^20}")));
            push(&mut out, "pair", heads.iter().map(|_| "   avg   PSNR bad2.0".into()));
            let rule = format!("{}{}\n", "-".repeat(12), format!("+{}", "-".repeat(20)).repeat(heads.len()));
            out.push_str(&rule);
            for Named { name, line } in &table.pairs {
                push(&mut out, name, line.cells());
            }
            if table.pairs.len() > 1 {
                out.push_str(&rule);
                push(&mut out, "mean", table.mean.cells());
            }
            out.push('\n');
        }
        let _ = writeln!(out, "{SOURCE}.");
        out
    }
}

impl Line {
    /// The text of each group of columns.
    fn cells(&self) -> impl Iterator<Item = String> {
        let paper = [self.published.map(|p| p.fgs), self.published.map(|p| p.mr_fgs)];
        paper.into_iter().chain(self.ours.iter().map(|(_, figures)| *figures)).map(|figures| {
            let [avg, psnr, bad2] = match figures {
                Some(f) => [f.avg, f.psnr, Some(f.bad2)],
                None => [None; 3],
            }
            .map(|value| figure(value, 2));
            format!("{avg:>6} {psnr:>6} {bad2:>6}")
        })
    }
}

/// A figure with so many decimals, or a dash.
pub(super) fn figure(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.decimals$}"))
}

/// One line: a name, cut where it is too long, and the groups of columns.
pub(super) fn push(out: &mut String, name: &str, groups: impl Iterator<Item = String>) {
    let name: String = name.chars().take(11).collect();
    let groups: Vec<_> = groups.collect();
    out.push_str(format!("{name:12}|{}", groups.join("|")).trim_end());
    out.push('\n');
}

/// The means of the paper's figures; none where it lacks one of the pairs.
fn mean_published(pairs: &[Named]) -> Option<Published> {
    let all = pairs.iter().map(|pair| pair.line.published).collect::<Option<Vec<_>>>()?;
    let mean = |method: fn(&Published) -> Figures| {
        let average = |value: fn(&Figures) -> Option<f64>| {
            let values = all.iter().map(|p| value(&method(p))).collect::<Option<Vec<_>>>()?;
            Some(values.iter().sum::<f64>() / values.len() as f64)
        };
        Some(Figures { avg: average(|f| f.avg), psnr: average(|f| f.psnr), bad2: average(|f| Some(f.bad2))? })
    };
    Some(Published { fgs: mean(|p| p.fgs)?, mr_fgs: mean(|p| p.mr_fgs)? })
}
