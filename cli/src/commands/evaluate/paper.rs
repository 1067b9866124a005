//! `mrfgs evaluate paper`: the paper's tables with its figures and ours.

use std::fmt::Write;
use std::path::PathBuf;

use mrfgs::Matcher;
use mrfgs::evaluation::Report;
use mrfgs::evaluation::paper::{Figures, Published, SOURCE, published};
use mrfgs::options::Method;
use serde::Serialize;

use crate::args::execution::ExecutionArgs;
use crate::failure::Result;
use crate::outputs::files;
use crate::text::figure;
use crate::{stop, table};

use super::findings::{Findings, Named, object};
use super::metrics;
use super::scenes::{self, SceneArgs};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate paper Teddy Cones Dolls Rocks1 Motorcycle";

/// Print the two tables of the paper, with its figures beside those of the presets fgs, paper and default
///
/// Pairs are recognised by the names of their folders (Teddy, Cones, Dolls, Rocks1, Motorcycle); others have dashes in the
/// paper's columns. A third table shows by how much the preset paper is ahead of fgs, and says in how many figures it is, here
/// and as printed. --json holds `source`, `ran_on`, `methods` (by preset: its keys), `tables`, one for the raw and one
/// for the final maps: `number`, `map`, `pairs` (each: `name`, `published`, `ours`) and `mean` (`published`, `ours`), and
/// `ahead`: the number of `figures`, and of those in which MR-FGS is ahead of FGS, `published` and `ours`.
/// `published` holds `fgs` and `mr-fgs` or is null, `ours` has one entry for each preset; an entry is `avg`, `psnr` and
/// `bad2.0`, over all pixels with known truth.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Folders with the pairs, as `evaluate` takes them
    #[arg(required = true, value_name = "DIR")]
    dirs: Vec<PathBuf>,
    #[command(flatten)]
    scenes: SceneArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    stop::listen();
    args.scenes.check_json(&args.dirs, None)?;
    let folders = args.scenes.folders(&args.dirs)?;
    let mut matcher = Matcher::builder().execution(args.execution.execution()).build()?;
    let mut found = Vec::new();
    for preset in COMPARED {
        let method = Method::preset(preset)?.validated()?;
        let see = |_: &_, _: &_, _| Ok(());
        found.push((
            preset,
            scenes::match_all(&args.scenes, &folders, &mut matcher, method, Some(preset), see)?,
        ));
    }
    let comparison = Comparison::new(&found);
    files::deliver(args.scenes.json(), &comparison, &comparison.text(), |_| Ok(()))
}

/// The presets that stand beside the paper's methods.
const COMPARED: [&str; 3] = ["fgs", "paper", "default"];

/// Both tables. The help explains the fields.
#[derive(Serialize)]
struct Comparison {
    source: &'static str,
    ran_on: Option<String>,
    #[serde(serialize_with = "object")]
    methods: Named<Option<Method>>,
    tables: [Table; 2],
    ahead: Ahead,
}

/// In how many of some figures MR-FGS is ahead of FGS.
#[derive(Serialize)]
struct Ahead {
    figures: usize,
    /// None if the paper lacks one of the pairs.
    published: Option<usize>,
    ours: usize,
}

/// One table of the paper.
#[derive(Serialize)]
struct Table {
    number: u8,
    map: &'static str,
    pairs: Vec<Pair>,
    mean: Line,
}

#[derive(Serialize)]
struct Pair {
    name: String,
    #[serde(flatten)]
    line: Line,
}

/// The figures of a pair, or their mean.
#[derive(Serialize)]
struct Line {
    published: Option<Published>,
    #[serde(serialize_with = "object")]
    ours: Named<Option<Figures>>,
}

impl Comparison {
    /// From what each preset, by name, has found on the same pairs.
    fn new(found: &[(&'static str, Findings)]) -> Self {
        let tables = [(1, "raw"), (2, "final")].map(|(number, map)| {
            let figures = |raw: Option<&Report>, finished: Option<&Report>| {
                let report = if number == 1 { raw } else { finished };
                report.map(|report| Figures::from(&report.all))
            };
            let names = found.iter().take(1).flat_map(|(_, findings)| &findings.pairs).map(|pair| &pair.name);
            let pairs: Vec<Pair> = names
                .enumerate()
                .map(|(i, name)| {
                    let ours = found.iter().map(|(preset, findings)| {
                        let pair = &findings.pairs[i];
                        (*preset, figures(pair.raw.as_ref(), Some(&pair.finished)))
                    });
                    let published = published(name).map(|tables| tables[number as usize - 1]);
                    Pair { name: name.clone(), line: Line { published, ours: ours.collect() } }
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
            ahead: Ahead::new(&tables),
            tables,
        }
    }

    /// By how much the preset paper is ahead of fgs.
    fn leads(&self) -> table::Table {
        let mut table = table::Table::new("l|rrr|rrr");
        table.text("What the preset paper gains over fgs: positive where it is ahead\n");
        table.titles(["", "raw", "final"]);
        table.row(["pair", "avg", "PSNR", "bad2.0", "avg", "PSNR", "bad2.0"]);
        table.rule();
        let [raw, finished] = &self.tables;
        for (pair, same) in raw.pairs.iter().zip(&finished.pairs) {
            let leads = [&pair.line, &same.line].into_iter().flat_map(|line| lead(line.ours()));
            let cells = leads.map(|lead| lead.map_or_else(|| "-".into(), |lead| format!("{lead:+.3}")));
            table.row(std::iter::once(metrics::cut(&pair.name)).chain(cells));
        }
        table
    }

    /// Both tables for a terminal, at most 120 characters wide.
    fn text(&self) -> String {
        let mut out = String::new();
        for Table { number, map, pairs, mean } in &self.tables {
            let when = if *number == 1 { "before" } else { "after" };
            let _ = writeln!(
                out,
                "Table {number}: {map} maps, {when} post-processing. Avg. err (px), PSNR (dB), Bad2.0 (%)\n"
            );
            let ours = mean.ours.iter().map(|(preset, _)| format!("ours: {preset}"));
            let paper = ["", "paper: FGS", "paper: MR-FGS"].map(String::from);
            let mut table = table::Table::new(&format!("l{}", "|rrr".repeat(2 + mean.ours.len())));
            table.titles(paper.into_iter().chain(ours));
            let heads = ["avg", "PSNR", "bad2.0"].into_iter().cycle().take(3 * (2 + mean.ours.len()));
            table.row(std::iter::once("pair").chain(heads));
            table.rule();
            for Pair { name, line } in pairs {
                table.row(line.cells(&metrics::cut(name)));
            }
            if pairs.len() > 1 {
                table.rule();
                table.row(mean.cells("mean"));
            }
            let _ = writeln!(out, "{table}");
        }
        let Ahead { figures, published, ours } = self.ahead;
        let _ = writeln!(out, "{}", self.leads());
        let _ = write!(out, "MR-FGS is ahead of FGS in {ours} of {figures} figures");
        let _ = match published {
            Some(published) => writeln!(out, "; the paper prints it ahead in {published}."),
            None => writeln!(out, "."),
        };
        let _ = writeln!(out, "\n{SOURCE}.");
        out
    }
}

impl Ahead {
    fn new(tables: &[Table]) -> Self {
        let lines: Vec<&Line> = tables.iter().flat_map(|table| &table.pairs).map(|pair| &pair.line).collect();
        let ahead =
            |figures: [Option<Figures>; 2]| lead(figures).into_iter().flatten().filter(|l| *l > 0.0).count();
        Self {
            figures: 3 * lines.len(),
            published: lines
                .iter()
                .map(|line| line.published.map(|p| ahead([p.fgs, p.mr_fgs].map(Some))))
                .sum(),
            ours: lines.iter().map(|line| ahead(line.ours())).sum(),
        }
    }
}

/// By how much the second of two methods is ahead of the first in average error, PSNR and share of bad pixels.
fn lead([fgs, mr_fgs]: [Option<Figures>; 2]) -> [Option<f64>; 3] {
    let (Some(fgs), Some(mr_fgs)) = (fgs, mr_fgs) else { return [None; 3] };
    let gain = |more: Option<f64>, less: Option<f64>| Some(more? - less?);
    [gain(fgs.avg, mr_fgs.avg), gain(mr_fgs.psnr, fgs.psnr), Some(fgs.bad2 - mr_fgs.bad2)]
}

impl Line {
    /// Our FGS and MR-FGS.
    fn ours(&self) -> [Option<Figures>; 2] {
        ["fgs", "paper"].map(|wanted| self.ours.iter().find(|(preset, _)| *preset == wanted)?.1)
    }

    /// The cells of its row.
    fn cells(&self, name: &str) -> Vec<String> {
        let paper = [self.published.map(|p| p.fgs), self.published.map(|p| p.mr_fgs)];
        let all = paper.into_iter().chain(self.ours.iter().map(|(_, figures)| *figures));
        let figures = all.flat_map(|figures| {
            let values = figures.map_or([None; 3], |f| [f.avg, f.psnr, Some(f.bad2)]);
            values.map(|value| figure(value, 2))
        });
        std::iter::once(name.to_owned()).chain(figures).collect()
    }
}

/// The means of the paper's figures; none if it lacks one of the pairs.
fn mean_published(pairs: &[Pair]) -> Option<Published> {
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
