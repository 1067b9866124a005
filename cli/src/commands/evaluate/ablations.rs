//! `mrfgs evaluate ablations`: what each part of the default preset contributes.

use std::path::PathBuf;

use mrfgs::Matcher;
use mrfgs::evaluation::Metrics;
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
  mrfgs evaluate ablations Teddy Cones --json ablations.json";

/// Print what each part of the preset default contributes: one line for each part switched off or replaced
///
/// Each line shows its changes as --set takes them, and means over the pairs, for the final map and all pixels with known
/// truth: the average error (`avg`, px, over valid pixels) and the pixels wrong by more than 0.5 and 2 px or invalid
/// (`b0.5%`, `b2%`). `change%` is the change of the last against the default, in percent of it; `time` is the time of all
/// matches, relative to the default's in this run. --json holds `ran_on`, `method` (the default's keys), `pairs` and `rows`
/// (each: `name`, `changes`, `avg`, `bad0.5`, `bad2.0`, `change`, `time`).
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
    let mut run = |row: &Row, called: &str| {
        let see = |_: &_, _: &_, _| Ok(());
        scenes::match_all(&args.scenes, &folders, &mut matcher, method(row)?, Some(called), see)
    };
    // The very first run prepares what the others find prepared, so its time is not the default's.
    run(&DEFAULT, "warm-up")?;
    let mut found = Vec::new();
    for row in std::iter::once(&DEFAULT).chain(ROWS) {
        found.push((*row, run(row, row.0)?));
    }
    let ablations = Ablations::new(&found);
    files::deliver(args.scenes.json(), &ablations, &ablations.text(), |_| Ok(()))
}

/// A change to the default preset: its name, and the keys with their values.
type Row = (&'static str, &'static [(&'static str, &'static str)]);

/// What the others are compared with.
const DEFAULT: Row = ("default", &[]);

/// One part switched off, or replaced by the paper's choice or another. A new row needs nothing else.
const ROWS: &[Row] = &[
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
    ("1 final iteration", &[("final-iterations", "1")]),
    ("5 final iterations", &[("final-iterations", "5")]),
    ("no left-right check", &[("left-right-check", "off")]),
    ("second matching", &[("left-right-check", "second-match")]),
    ("no speckle filter", &[("speckle-size", "0")]),
    ("no sub-pixel", &[("sub-pixel", "false")]),
    ("fill by row alone", &[("fill", "row")]),
    ("no fill", &[("fill", "none")]),
    ("no median", &[("median", "off")]),
    ("median on filled only", &[("median", "filled")]),
];

/// The default preset with the change of a row.
fn method(row: &Row) -> Result<Method> {
    let mut method = Method::preset("default")?;
    method.set_all(row.1.iter().copied())?;
    Ok(method.validated()?)
}

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
    #[serde(rename = "bad0.5")]
    bad05: Option<f64>,
    #[serde(rename = "bad2.0")]
    bad2: Option<f64>,
    change: Option<f64>,
    time: Option<f64>,
}

impl Ablations {
    /// From what the rows, the default first, have found on the same pairs.
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
    fn text(&self) -> String {
        let pairs = self.pairs.len();
        let mut table = Table::new("l|l|rrrrr");
        table.text(format!(
            "Final maps, all pixels with known truth, means over {pairs} pair{}\n",
            plural(pairs)
        ));
        table.row(["", "changes", "avg", "b0.5%", "b2%", "change%", "time"]);
        table.rule();
        for row in &self.rows {
            let changes: Vec<_> = row.changes.iter().map(|(key, value)| format!("{key}={value}")).collect();
            table.row([
                row.name.to_owned(),
                changes.join(" "),
                figure(row.avg, 3),
                figure(row.bad05, 2),
                figure(row.bad2, 2),
                row.change.map_or_else(|| "-".into(), |v| format!("{v:+.1}")),
                figure(row.time, 2),
            ]);
        }
        table.to_string()
    }
}

impl Outcome {
    fn new(row: &Row, findings: &Findings, default: &Findings) -> Self {
        let mean = |of: &Findings, value: fn(&Metrics) -> Option<f64>| {
            of.mean.finished.as_ref().and_then(|report| value(&report.all))
        };
        let ratio = |part: Option<f64>, whole: Option<f64>| Some(part? / whole.filter(|&w| w > 0.0)?);
        let seconds = |of: &Findings| of.pairs.iter().map(|pair| pair.seconds).sum::<Option<f64>>();
        let bad2 = mean(findings, |m| Some(m.bad[2]));
        let to_default = ratio(bad2, mean(default, |m| Some(m.bad[2])));
        Self {
            name: row.0,
            changes: row.1.to_vec(),
            avg: mean(findings, |m| m.avg),
            bad05: mean(findings, |m| Some(m.bad[0])),
            bad2,
            change: to_default.map(|r| 100.0 * (r - 1.0)),
            time: ratio(seconds(findings), seconds(default)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_a_method_of_its_own() {
        let mut seen = vec![method(&DEFAULT).unwrap()];
        for row in ROWS {
            let changed = method(row).unwrap_or_else(|e| panic!("{}: {e}", row.0));
            assert!(!seen.contains(&changed), "{} is another row or the default", row.0);
            assert!(ROWS.iter().filter(|other| other.0 == row.0).count() == 1, "{}", row.0);
            seen.push(changed);
        }
    }

    #[test]
    fn rows_fit_a_line() {
        let longest = |text: fn(&Row) -> usize| ROWS.iter().map(text).max().unwrap_or(0);
        let changes = |row: &Row| row.1.iter().map(|(key, value)| key.len() + value.len() + 2).sum::<usize>();
        assert!(longest(|row| row.0.len()) + longest(changes) + 41 <= 120);
    }
}
