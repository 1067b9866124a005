//! `mrfgs evaluate ablations`: what each part of the default preset contributes, and what each reading of the paper costs.

use std::path::PathBuf;

use clap::ValueEnum;
use mrfgs::Matcher;
use mrfgs::evaluation::Metrics;
use mrfgs::evaluation::paper::Figures;
use mrfgs::options::Method;
use serde::Serialize;

use crate::args::execution::ExecutionArgs;
use crate::failure::Result;
use crate::outputs::files;
use crate::stop;
use crate::table::Table;
use crate::text::{figure, plural};

use super::findings::{Findings, Named, object};
use super::scenes::{self, SceneArgs};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate ablations Teddy Cones --json ablations.json
  mrfgs evaluate ablations Teddy Cones Dolls Rocks1 Motorcycle --method paper";

/// Print what each part of a preset contributes: one line for each part switched off or replaced
///
/// Around the preset default, these are its parts. Around paper, they are other readings of the paper's text, and other
/// choices where it leaves one open.
///
/// Each line shows its changes as --set takes them, and means over the pairs, for the final map and all pixels with known
/// truth: the average error (`avg`, px, over valid pixels) and the pixels wrong by more than 0.5 and 2 px or invalid
/// (`b0.5%`, `b2%`); around paper its figures, that is `avg`, `PSNR` (dB) and `b2%`, of the raw and of the final map.
/// `change%` is the change of the last `b2%` against the preset, in percent of it; `time` is the time of all matches,
/// relative to the preset's in this run. --json holds `ran_on`, `method` (the preset's keys), `pairs` and `rows` (each:
/// `name`, `changes`, `avg`, `psnr`, `bad0.5` and `bad2.0` of the final map, `raw` with `avg`, `psnr` and `bad2.0`, `change`,
/// `time`).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Folders with the pairs, as `evaluate` takes them
    #[arg(required = true, value_name = "DIR")]
    dirs: Vec<PathBuf>,
    /// Preset to change
    #[arg(long, value_name = "NAME", default_value_t, value_enum)]
    method: Base,
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
    let mut run = |row: &Row, called: &str| {
        let see = |_: &_, _: &_, _| Ok(());
        scenes::match_all(&args.scenes, &folders, &mut matcher, args.method.changed(row)?, Some(called), see)
    };
    let unchanged = (args.method.name(), &[][..]);
    // The very first run prepares what the others find prepared, so its time is not the preset's.
    run(&unchanged, "warm-up")?;
    let mut found = Vec::new();
    for row in std::iter::once(&unchanged).chain(args.method.rows()) {
        found.push((*row, run(row, row.0)?));
    }
    let ablations = Ablations::new(&found);
    files::deliver(args.scenes.json(), &ablations, &ablations.text(args.method), |_| Ok(()))
}

/// A change to a preset: its name, and the keys with their values.
type Row = (&'static str, &'static [(&'static str, &'static str)]);

/// A preset that rows change.
#[derive(Clone, Copy, Default, ValueEnum)]
enum Base {
    #[default]
    Default,
    Paper,
}

impl Base {
    fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Paper => "paper",
        }
    }

    fn rows(self) -> &'static [Row] {
        match self {
            Self::Default => ROWS,
            Self::Paper => READINGS,
        }
    }

    /// The preset with the change of a row.
    fn changed(self, row: &Row) -> Result<Method> {
        let mut method = Method::preset(self.name())?;
        method.set_all(row.1.iter().copied())?;
        Ok(method.validated()?)
    }
}

/// One part switched off, or replaced by the paper's choice or another. A new row needs nothing else.
const ROWS: &[Row] = &[
    ("rows as they are", &[("level-rows", "false")]),
    ("sharpness as it is", &[("equal-sharpness", "false")]),
    ("noise as it is", &[("denoise", "false")]),
    ("homomorphic illumination", &[("illumination", "homomorphic")]),
    ("texture zones, k = 1", &[("zone-sigmas", "1")]),
    ("texture zones, k = 2", &[("zone-sigmas", "2")]),
    ("texture zones, k = 3", &[("zone-sigmas", "3")]),
    ("SAD cost", &[("matching", "sad"), ("outside-cost", "20"), ("temperature", "10")]),
    ("no colour in the cost", &[("matching", "census")]),
    ("colour counted in full", &[("colour-contrast", "0")]),
    ("no pyramid minimum", &[("pyramid", "low-pass")]),
    ("one level", &[("levels", "1")]),
    ("4 levels", &[("levels", "4")]),
    ("strict resolution", &[("agreement", "strict")]),
    ("4 neighbours", &[("percentile", "92")]),
    ("8 neighbours", &[("percentile", "84")]),
    ("hard potential", &[("potential", "hard")]),
    ("exact potential", &[("potential", "exact")]),
    ("all levels together", &[("order", "together"), ("iterations", "12")]),
    ("no final iteration", &[("final-iterations", "0")]),
    ("3 final iterations", &[("final-iterations", "3")]),
    ("no left-right check", &[("left-right-check", "off")]),
    ("second matching", &[("left-right-check", "second-match")]),
    ("no speckle filter", &[("speckle-size", "0")]),
    ("no sub-pixel", &[("sub-pixel", "false")]),
    ("fill by row alone", &[("fill", "row")]),
    ("no fill", &[("fill", "none")]),
    ("no planes", &[("plane", "false")]),
    ("no median", &[("median", "off")]),
    ("median on filled only", &[("median", "filled")]),
    ("at twice the size, too", &[("double-size", "true")]),
];

/// Another reading of the paper, or another choice where it leaves one open. `docs/paper.md` tells what the text says.
const READINGS: &[Row] = &[
    ("exact double labels", &[("agreement", "strict")]),
    ("whole clusters as zones", &[("zone-extent", "cluster")]),
    ("30 clusters", &[("clusters", "30")]),
    ("labels within 2 sigma", &[("zone-sigmas", "2")]),
    ("labels within 3 sigma", &[("zone-sigmas", "3")]),
    ("all labels", &[("zone-sigmas", "0")]),
    ("zones corrected, too", &[("illumination", "homomorphic-first")]),
    ("nothing corrected", &[("illumination", "none")]),
    ("weaker evidence", &[("temperature", "1")]),
    ("much weaker evidence", &[("temperature", "10")]),
    ("evidence without a cap", &[("evidence-cap", "63.75")]),
    ("evidence grows by level", &[("evidence-gain", "4")]),
    ("more cost outside", &[("outside-cost", "40")]),
    ("low-pass along labels", &[("pyramid", "low-pass")]),
    ("97 % with the centre", &[("percentile", "98")]),
    ("4 neighbours", &[("percentile", "92")]),
    ("soft potential", &[("potential", "soft")]),
    ("1 level", &[("levels", "1")]),
    ("2 levels", &[("levels", "2")]),
    ("4 levels", &[("levels", "4")]),
    ("coarse levels first", &[("order", "coarse-first")]),
    ("10 iterations", &[("iterations", "10")]),
    ("60 iterations", &[("iterations", "60"), ("tolerance", "0")]),
    ("no median", &[("median", "off")]),
    ("median of the default", &[("median-window", "17"), ("median-sigma-space", "5.75")]),
    ("median where occluded", &[("left-right-check", "right-view"), ("median", "filled")]),
    ("left-right check", &[("left-right-check", "right-view")]),
    ("sub-pixel", &[("sub-pixel", "true")]),
];

/// The table. The help explains the fields.
#[derive(Serialize)]
struct Ablations {
    ran_on: Option<String>,
    method: Option<Method>,
    pairs: Vec<String>,
    rows: Vec<Outcome>,
}

/// The effect of one change: means over the pairs.
#[derive(Serialize)]
struct Outcome {
    name: &'static str,
    #[serde(serialize_with = "object")]
    changes: Named<&'static str>,
    avg: Option<f64>,
    psnr: Option<f64>,
    #[serde(rename = "bad0.5")]
    bad05: Option<f64>,
    #[serde(rename = "bad2.0")]
    bad2: Option<f64>,
    raw: Option<Figures>,
    change: Option<f64>,
    time: Option<f64>,
}

impl Ablations {
    /// From what the rows, the unchanged preset first, have found on the same pairs.
    fn new(found: &[(Row, Findings)]) -> Self {
        let first = found.first().map(|(_, findings)| findings);
        Self {
            ran_on: first.and_then(|f| f.ran_on.clone()),
            method: first.and_then(|f| f.method.clone()),
            pairs: first.iter().flat_map(|f| &f.pairs).map(|pair| pair.name.clone()).collect(),
            rows: found.iter().map(|(row, f)| Outcome::new(row, f, first.unwrap_or(f))).collect(),
        }
    }

    /// The table for a terminal.
    fn text(&self, base: Base) -> String {
        let pairs = format!("{} pair{}", self.pairs.len(), plural(self.pairs.len()));
        let mut table = match base {
            Base::Default => {
                let mut table = Table::new("l|l|rrrrr");
                table.text(format!("Final maps, all pixels with known truth, means over {pairs}\n"));
                table.row(["", "changes", "avg", "b0.5%", "b2%", "change%", "time"]);
                table
            }
            Base::Paper => {
                let mut table = Table::new("l|l|rrr|rrrrr");
                table.text(format!("All pixels with known truth, means over {pairs}\n"));
                table.titles(["", "", "raw maps", "final maps"]);
                table.row(["", "changes", "avg", "PSNR", "b2%", "avg", "PSNR", "b2%", "change%", "time"]);
                table
            }
        };
        table.rule();
        for row in &self.rows {
            let changes: Vec<_> = row.changes.iter().map(|(key, value)| format!("{key}={value}")).collect();
            let mut cells = vec![row.name.to_owned(), changes.join(" ")];
            match base {
                Base::Default => {
                    cells.extend([figure(row.avg, 3), figure(row.bad05, 2), figure(row.bad2, 2)]);
                }
                Base::Paper => {
                    let raw = row.raw.map_or([None; 3], |raw| [raw.avg, raw.psnr, Some(raw.bad2)]);
                    let all = raw.into_iter().chain([row.avg, row.psnr, row.bad2]);
                    cells.extend(all.map(|value| figure(value, 2)));
                }
            }
            cells.push(row.change.map_or_else(|| "-".into(), |v| format!("{v:+.1}")));
            cells.push(figure(row.time, 2));
            table.row(cells);
        }
        table.to_string()
    }
}

impl Outcome {
    fn new(row: &Row, findings: &Findings, unchanged: &Findings) -> Self {
        let mean = |of: &Findings, value: fn(&Metrics) -> Option<f64>| {
            of.mean.finished.as_ref().and_then(|report| value(&report.all))
        };
        let ratio = |part: Option<f64>, whole: Option<f64>| Some(part? / whole.filter(|&w| w > 0.0)?);
        let seconds = |of: &Findings| of.pairs.iter().map(|pair| pair.seconds).sum::<Option<f64>>();
        let bad2 = mean(findings, |m| Some(m.bad[2]));
        let to_unchanged = ratio(bad2, mean(unchanged, |m| Some(m.bad[2])));
        Self {
            name: row.0,
            changes: row.1.to_vec(),
            avg: mean(findings, |m| m.avg),
            psnr: mean(findings, |m| m.psnr),
            bad05: mean(findings, |m| Some(m.bad[0])),
            bad2,
            raw: findings.mean.raw.as_ref().map(|report| Figures::from(&report.all)),
            change: to_unchanged.map(|r| 100.0 * (r - 1.0)),
            time: ratio(seconds(findings), seconds(unchanged)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_a_method_of_its_own() {
        for base in Base::value_variants() {
            let mut seen = vec![Method::preset(base.name()).unwrap()];
            for row in base.rows() {
                let changed = base.changed(row).unwrap_or_else(|e| panic!("{}: {e}", row.0));
                assert!(!seen.contains(&changed), "{} is another row or the preset", row.0);
                assert!(base.rows().iter().filter(|other| other.0 == row.0).count() == 1, "{}", row.0);
                seen.push(changed);
            }
        }
    }

    #[test]
    fn rows_fit_a_line() {
        // The width of the other columns.
        for (base, figures) in [(Base::Default, 41), (Base::Paper, 54)] {
            let longest = |text: fn(&Row) -> usize| base.rows().iter().map(text).max().unwrap_or(0);
            let changes =
                |row: &Row| row.1.iter().map(|(key, value)| key.len() + value.len() + 2).sum::<usize>();
            assert!(longest(|row| row.0.len()) + longest(changes) + figures <= 120, "{}", base.name());
        }
    }
}
