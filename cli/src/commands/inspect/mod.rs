//! `mrfgs inspect`: the inside of a match, for developers.

mod steps;

use std::path::PathBuf;

use mrfgs::low_level::engine::{Inspection, Inspector};
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Execution;
use mrfgs::{Matched, Matcher};

use std::time::Duration;

use crate::args::{ExecutionArgs, MethodArgs, Sign};
use crate::failure::Result;
use crate::outputs::{MatchRecord, StagedFolder, files, stage_and_level};
use crate::pairs::input::{Input, PairArgs};
use crate::table::Table;
use crate::text::bytes;
use crate::{matching, stop};

use steps::Steps;

const EXAMPLES: &str = "\
Examples:
  mrfgs inspect left.png right.png --max-disparity 63
  mrfgs inspect im0.png im1.png steps --method paper";

/// Match a pair and time every stage; with DIR, show every step as a picture
///
/// Times come from the device's own clock if it has one. `rest` is all other time: with DIR, mostly that of the pictures.
///
/// DIR gets pictures and small tables: corrected images, zones, sparse matches, label ranges, costs, graphs, a map per level (also as PFM,
/// in pixels of the level), and the change per iteration. With DIR a match takes several times as long and must fit into --memory without tiles.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    pair: PairArgs,
    /// Folder for the pictures, new or empty
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,

    /// Writes a record of the match as JSON; `-` prints it instead of the table
    ///
    /// The fields are those of `match --json`, and `stages` (ms by stage and level).
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    execution: ExecutionArgs,
}

pub(crate) fn run(mut args: Args) -> Result<()> {
    args.pair.leave(&mut args.folder)?;
    let args = &args;
    let execution = Execution { timings: true, ..args.execution.execution() };
    stop::listen();
    let method = args.method.method()?;
    let input = args.pair.read(Sign::default(), false, None, None)?;
    input.say_range(Sign::default(), "");
    let folder = args.folder.as_deref().map(StagedFolder::new_or_empty).transpose()?;
    check_outputs(args, &input, folder.as_ref())?;
    input.warn(None);
    let plan = Plan::new(input.pair.size().0, input.pair.size().1, input.range, &method)?;
    let mut matcher = Matcher::builder().execution(execution).build()?;
    let mut steps = folder.map(|folder| Steps::new(folder, plan));
    let mut look = steps.as_mut().map(|steps| |inspection: &mut Inspection| steps.look(inspection));
    let look: Option<Inspector> = match &mut look {
        Some(look) => Some(look),
        None => None,
    };
    let (matched, time) =
        matching::run(&mut matcher, &input.pair, input.range.into(), &method, None, false, look)?;
    let files = args.pair.files(&input, None);
    let record = MatchRecord::new(&files, &matched, time, Sign::default());
    files::deliver(args.json.as_deref(), &record, &times(&matched, time), |written| {
        match (steps, &args.folder) {
            (Some(steps), Some(folder)) => written.note(folder, steps.finish()),
            _ => Ok(()),
        }
    })
}

/// Checks before any computing that the outputs can be written.
fn check_outputs(args: &Args, input: &Input, folder: Option<&StagedFolder>) -> Result<()> {
    let json = files::json_file(args.json.as_deref());
    match folder {
        Some(folder) => folder.check_json("DIR", args.json.as_deref())?,
        None => files::check_json_path(args.json.as_deref())?,
    }
    let mut inputs = args.pair.inputs(input);
    inputs.extend(args.method.files().map(|path| ("the file of --method", path)));
    let folder = args.folder.as_deref().map(|folder| ("DIR", folder));
    files::distinct(&inputs, &folder.into_iter().chain(json.map(|json| ("--json", json))).collect::<Vec<_>>())
}

/// The table of stage times; `whole` is the time of the match.
fn times(matched: &Matched, whole: Duration) -> String {
    let Matched { timings, traffic, .. } = matched;
    let mut table = Table::new("lrrr");
    table.row(["stage", "  runs", "        ms", "    share"]);
    let mut row = |name: &str, runs: &str, time: Duration| {
        let (time, whole) = (time.as_secs_f64(), whole.as_secs_f64());
        table.row([name, runs, &format!("{:.2}", 1000.0 * time), &format!("{:.1} %", 100.0 * time / whole)]);
    };
    for timing in timings {
        row(&stage_and_level(timing), &timing.runs.to_string(), timing.time);
    }
    row("rest", "", whole.saturating_sub(timings.iter().map(|t| t.time).sum()));
    row("all", "", whole);
    if traffic.dispatches > 0 {
        table.text(format!(
            "{} dispatches in {} submissions, {} up, {} down",
            traffic.dispatches,
            traffic.submissions,
            bytes(traffic.bytes_up),
            bytes(traffic.bytes_down)
        ));
    }
    table.to_string()
}
