//! `mrfgs bench`.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use mrfgs::backend::Stage;
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::gpu::{self, Gpu};
use mrfgs::image::{Pair, write};
use mrfgs::options::{DeviceChoice, DisparityRange, Execution, Method};
use mrfgs::plan::Plan;
use mrfgs::{Error, Matched, Matcher, Result, Timing, roofline};
use serde::{Deserialize, Serialize};

use crate::folder::{self, Folder};
use crate::process::{peak_memory, processor_time};
use crate::synthetic::{LARGE, SMALL, Synthetic};
use crate::tables::figure;
use crate::{MethodArgs, ReadArgs, ResourceArgs, outputs};

const EXAMPLES: &str = "\
Examples:
  mrfgs bench
  mrfgs bench --large --backend gpu --repeats 20
  mrfgs bench Teddy Motorcycle --preset default --json bench.json
  mrfgs bench Teddy --backend cpu --threads 1 --set levels=4";

const PRESET: &str =
    "Preset to start from; `mrfgs presets` lists them [default: default and paper, or default with --config]";

/// Measure how long matches take, on the CPU path and on a device, and how near that is to what the machine can do
///
/// Of every pair it matches by the presets default and paper, or by the method that is asked for, on each backend once
/// to warm up and then again and again, with everything kept that a `Matcher` keeps from pair to pair; no file is read or
/// written in between. Each pair, preset and backend has a process of its own. Figures are medians; each repeat is one match
/// for the whole time and one more for that of the stages, by the device's own clock where it has one.
///
/// A label update is one value of a dependency message: per iteration pixels x labels x members of a factor, summed over
/// the levels that take part. The message stages are dependency, resolution and belief. They move at least every volume that
/// they read or write once a run; the copy rate (bytes read and written, from one large buffer to another, measured
/// after the matches) says how fast that could be, and can be beaten where volumes fit caches. Processor time is that of
/// all threads, peak memory the most that the process held, the buffers of a software device included. What takes more
/// memory than there is, is left out and named.
///
/// As --json has it: `version`, `threads`, `repeats`, `methods` (by preset: its keys) and `pairs`, one entry a pair and
/// preset: `name`, `preset`, `width`, `height`, `labels` and `backends` (by backend, null without the memory: `ran_on`,
/// `iterations`, `median_ms`, `min_ms`, `max_ms`, `runs_ms`, `processor_ms`, `stages` (ms by stage and level), `message_ms`,
/// `label_updates`, `message_gupdates_per_s`, `match_gupdates_per_s`, `message_bytes`, `message_gb_per_s`, `copy_gb_per_s`,
/// `copy_share` (%), `plan_bytes`, `peak_bytes`, `device_bytes`).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES, mut_arg("preset", |preset| preset.help(PRESET)))]
pub(super) struct Args {
    /// Folders with a pair each, in the layouts that `evaluate` takes; where a calib.txt gives the range, the truth may be
    /// missing [default: a pair of 450 x 375 pixels and 60 labels, made up]
    #[arg(value_name = "DIR")]
    dirs: Vec<PathBuf>,
    /// Makes up a pair of 2964 x 2000 pixels and 280 labels instead
    #[arg(long, conflicts_with = "dirs")]
    large: bool,
    /// How often each match is repeated, 1 to 1000
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    repeats: u16,
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadArgs,

    #[command(flatten)]
    method: MethodArgs,
    /// What runs the stages [default: the CPU path, and the device that `auto` takes where there is one]
    #[arg(long, value_enum, value_name = "WHICH", help_heading = "Where it runs")]
    backend: Option<Which>,
    #[command(flatten)]
    resources: ResourceArgs,
}

/// Which backends are measured.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Which {
    /// The CPU path
    Cpu,
    /// A GPU, or any Vulkan or Metal driver; an error where there is none
    Gpu,
    /// One after the other
    Both,
}

/// What is measured in one process.
struct Case<'a> {
    /// The folder of the pair; none where it is made up.
    dir: Option<&'a Path>,
    preset: &'a str,
    backend: &'static str,
}

/// Everything that was measured. What the fields hold is told by the help.
#[derive(Serialize, Deserialize)]
struct Findings {
    version: String,
    threads: usize,
    repeats: u16,
    methods: BTreeMap<String, Method>,
    pairs: Vec<Row>,
}

/// One pair by one preset.
#[derive(Serialize, Deserialize)]
struct Row {
    name: String,
    preset: String,
    width: usize,
    height: usize,
    labels: usize,
    backends: BTreeMap<String, Option<Figures>>,
}

/// What a backend took for it.
#[derive(Serialize, Deserialize)]
struct Figures {
    ran_on: String,
    iterations: u32,
    median_ms: f64,
    min_ms: f64,
    max_ms: f64,
    runs_ms: Vec<f64>,
    processor_ms: Option<f64>,
    stages: BTreeMap<String, f64>,
    message_ms: f64,
    label_updates: u64,
    message_gupdates_per_s: f64,
    match_gupdates_per_s: f64,
    message_bytes: u64,
    message_gb_per_s: f64,
    copy_gb_per_s: f64,
    copy_share: f64,
    plan_bytes: u64,
    peak_bytes: Option<u64>,
    device_bytes: Option<u64>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    check_output(args)?;
    // What is missing in the last folder is said before the first is matched.
    args.dirs.iter().try_for_each(|dir| Folder::to_match(dir).map(drop))?;
    let presets = presets(args);
    let method = |preset: &&str| Ok((String::from(*preset), args.method.on(preset)?));
    let methods = presets.iter().map(method).collect::<Result<_>>()?;
    let backends = backends(args)?;
    let dirs: Vec<Option<&Path>> = match args.dirs.as_slice() {
        [] => vec![None],
        dirs => dirs.iter().map(|dir| Some(dir.as_path())).collect(),
    };
    let alone = dirs.len() * presets.len() * backends.len() == 1;
    let mut pairs = Vec::new();
    for dir in dirs {
        for preset in &presets {
            let mut rows = Vec::new();
            for backend in &backends {
                let case = Case { dir, preset, backend };
                rows.push(if alone { case.measure(args)? } else { case.apart(args)? });
            }
            pairs.extend(rows.into_iter().reduce(|mut all, row| {
                all.backends.extend(row.backends);
                all
            }));
        }
    }
    let findings = Findings {
        version: env!("CARGO_PKG_VERSION").into(),
        threads: pool(args)?.current_num_threads(),
        repeats: args.repeats,
        methods,
        pairs,
    };
    outputs::deliver(args.json.as_deref(), &findings, &findings.text(), |_| Ok(()))
}

/// Finds out before any computing whether the output can be written.
fn check_output(args: &Args) -> Result<()> {
    let Some(path) = outputs::json_file(args.json.as_deref()) else { return Ok(()) };
    write::check_path(path)?;
    let inputs: Vec<PathBuf> = args.dirs.iter().flat_map(|dir| folder::inputs(dir)).collect();
    let inputs = inputs.iter().chain(&args.method.config).map(|path| ("an input", path.as_path()));
    outputs::distinct(&inputs.collect::<Vec<_>>(), &[("--json", path)])
}

fn presets(args: &Args) -> Vec<&str> {
    match (&args.method.preset, &args.method.config) {
        (Some(preset), _) => vec![preset],
        (None, Some(_)) => vec!["default"],
        (None, None) => vec!["default", "paper"],
    }
}

/// The pair where no folder is given.
fn made_up(args: &Args) -> Synthetic {
    if args.large { LARGE } else { SMALL }
}

/// The backends to measure; that a device is not there is said before the CPU path is measured.
fn backends(args: &Args) -> Result<Vec<&'static str>> {
    let device = args.resources.device.as_deref();
    if args.backend == Some(Which::Cpu) && device.is_some() {
        return Err(crate::no_device());
    }
    let (cpu, gpu) = match args.backend {
        Some(which) => (which != Which::Gpu, which != Which::Cpu),
        None => (true, device.is_some() || gpu::has_automatic()),
    };
    if cpu && gpu {
        Gpu::new(device)?;
    }
    Ok([("cpu", cpu), ("gpu", gpu)].into_iter().filter_map(|(name, wanted)| wanted.then_some(name)).collect())
}

/// The threads of the CPU path.
fn pool(args: &Args) -> Result<rayon::ThreadPool> {
    let threads = args.resources.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::option("--threads", e.to_string()))
}

impl Case<'_> {
    /// Measures in a process of its own, whose memory no case before has touched.
    fn apart(&self, args: &Args) -> Result<Row> {
        let failed = |reason: String| Error::Device(reason);
        let program = std::env::current_exe().map_err(|e| Error::read("this program", e))?;
        let run = Command::new(program).args(self.arguments(args)).output();
        let run = run.map_err(|e| failed(format!("a process for a measurement cannot be started: {e}")))?;
        let said = String::from_utf8_lossy(&run.stderr);
        if !run.status.success() {
            let said = said.trim().trim_start_matches("mrfgs: ");
            let ended = format!("{} on {}: {}", self.name(args), self.backend, run.status);
            return Err(failed(if said.is_empty() { ended } else { said.into() }));
        }
        let findings: Findings =
            serde_json::from_slice(&run.stdout).map_err(|e| failed(format!("{}: {e}", self.name(args))))?;
        let _ = std::io::stderr().write_all(said.as_bytes());
        let row = findings.pairs.into_iter().next();
        row.ok_or_else(|| failed(format!("{}: nothing was measured", self.name(args))))
    }

    /// The command line that measures this case alone.
    fn arguments(&self, args: &Args) -> Vec<OsString> {
        let mut all: Vec<OsString> = vec!["bench".into(), "--json=-".into()];
        let mut flag = |name: &str, value: &dyn AsRef<std::ffi::OsStr>| {
            let mut text = OsString::from(name);
            text.push(value);
            all.push(text);
        };
        flag("--preset=", &self.preset);
        flag("--backend=", &self.backend);
        flag("--repeats=", &args.repeats.to_string());
        flag("--max-pixels=", &args.reading.max_pixels.to_string());
        if let Some(value) = args.reading.no_data {
            flag("--no-data=", &value.to_string());
        }
        if let Some(config) = &args.method.config {
            flag("--config=", config);
        }
        for (key, value) in &args.method.set {
            flag("--set=", &format!("{key}={value}"));
        }
        if let Some(threads) = args.resources.threads {
            flag("--threads=", &threads.to_string());
        }
        if let Some(device) = args.resources.device.as_ref().filter(|_| self.backend == "gpu") {
            flag("--device=", device);
        }
        all.extend(args.large.then(|| "--large".into()));
        all.extend(self.dir.into_iter().flat_map(|dir| ["--".into(), dir.into()]));
        all
    }

    fn name(&self, args: &Args) -> String {
        match self.dir {
            Some(dir) => folder::name(dir),
            None => made_up(args).name.into(),
        }
    }

    /// Measures here.
    fn measure(&self, args: &Args) -> Result<Row> {
        let (pair, range) = if let Some(dir) = self.dir {
            Folder::to_match(dir)?.read_pair(args.reading.reader())?
        } else {
            let made_up = made_up(args);
            (made_up.pair()?, made_up.range()?)
        };
        let (name, preset) = (self.name(args), self.preset);
        let what = format!("{name}, preset {preset}, {}", self.backend);
        let figures = match self.figures(args, &pair, range) {
            Err(Error::Memory(reason)) => {
                crate::say(&format!("{what}: left out: {reason}"));
                None
            }
            figures => Some(figures?),
        };
        if let Some(figures) = &figures {
            crate::say(&format!("{what}: {:.1} ms", figures.median_ms));
        }
        let (width, height) = pair.size();
        let backends = BTreeMap::from([(self.backend.into(), figures)]);
        Ok(Row { name, preset: preset.into(), width, height, labels: range.labels(), backends })
    }

    fn figures(&self, args: &Args, pair: &Pair, range: DisparityRange) -> Result<Figures> {
        let method = args.method.on(self.preset)?;
        let device = args.resources.device.clone();
        let mut matcher = Matcher::new(&Execution {
            device: match (self.backend, device.clone()) {
                ("gpu", Some(name)) => DeviceChoice::Named(name),
                ("gpu", None) => DeviceChoice::Gpu,
                _ => DeviceChoice::Cpu,
            },
            threads: args.resources.threads.map(usize::from),
            timings: false,
        })?;
        let mut run = |timings: bool| {
            matcher.keep_time(timings);
            matcher.run(pair, range, &method, &mut |_| ControlFlow::Continue(()))
        };
        let Matched { plan, tiles, iterations, ran_on, traffic, .. } = run(false)?;
        let (mut runs_ms, mut processor, mut timed) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..args.repeats {
            let (start, before) = (Instant::now(), processor_time());
            run(false)?;
            runs_ms.push(ms(start.elapsed()));
            processor
                .extend(processor_time().zip(before).map(|(after, before)| ms(after.saturating_sub(before))));
            timed.push(run(true)?.timings);
        }
        let peak_bytes = peak_memory();
        drop(matcher);
        let copy_gb_per_s = giga(match self.backend {
            "gpu" => Gpu::new(device.as_deref())?.copy_rate()?,
            _ => pool(args)?.install(Cpu::copy_rate),
        });
        let message_time = |timings: &Vec<Timing>| ms(messages(&plan, timings).map(|(_, t)| t.time).sum());
        let message_ms = median(timed.iter().map(message_time));
        let stages = timed[0].iter().enumerate().map(|(i, timing)| {
            (crate::stage_and_level(timing), median(timed.iter().map(|timings| ms(timings[i].time))))
        });
        let counted = |of: fn(&Plan, Stage) -> u64| -> u64 {
            // Every tile has run as often as any other.
            let counts = messages(&plan, &timed[0]).map(|(stage, timing)| {
                let once: u64 = tiles.list().iter().map(|tile| of(&tile.plan, stage)).sum();
                u64::from(timing.runs) * once / tiles.count() as u64
            });
            counts.sum()
        };
        let (label_updates, message_bytes) = (counted(roofline::label_updates), counted(roofline::bytes));
        let median_ms = median(runs_ms.iter().copied());
        let giga_per_s = |count: u64, ms: f64| giga(1000.0 * count as f64 / ms);
        let message_gb_per_s = giga_per_s(message_bytes, message_ms);
        Ok(Figures {
            ran_on,
            iterations,
            median_ms,
            min_ms: runs_ms.iter().copied().fold(f64::INFINITY, f64::min),
            max_ms: runs_ms.iter().copied().fold(0.0, f64::max),
            processor_ms: (!processor.is_empty()).then(|| median(processor)),
            stages: stages.collect(),
            message_ms,
            label_updates,
            message_gupdates_per_s: giga_per_s(label_updates, message_ms),
            match_gupdates_per_s: giga_per_s(label_updates, median_ms),
            message_bytes,
            message_gb_per_s,
            copy_gb_per_s,
            copy_share: 100.0 * message_gb_per_s / copy_gb_per_s,
            plan_bytes: tiles.bytes(),
            peak_bytes,
            device_bytes: Some(traffic.bytes_held).filter(|&bytes| bytes > 0),
            runs_ms,
        })
    }
}

/// The message stages among `timings`.
fn messages<'a>(plan: &Plan, timings: &'a [Timing]) -> impl Iterator<Item = (Stage, &'a Timing)> {
    roofline::message_stages(plan).filter_map(|stage| {
        Some((stage, timings.iter().find(|t| (t.stage, t.level) == (stage.name(), stage.level()))?))
    })
}

fn ms(time: Duration) -> f64 {
    1000.0 * time.as_secs_f64()
}

fn giga(count: f64) -> f64 {
    count / 1e9
}

/// The median of at least one value.
fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { f64::midpoint(values[middle - 1], values[middle]) }
}

/// A line of the table: its name, and what it tells of the figures of a backend.
type Line = (&'static str, fn(&Figures) -> String);

const LINES: [Line; 16] = [
    ("match, median (ms)", |f| format!("{:.1}", f.median_ms)),
    ("  least", |f| format!("{:.1}", f.min_ms)),
    ("  most", |f| format!("{:.1}", f.max_ms)),
    ("  processor time", |f| figure(f.processor_ms, 1)),
    ("message stages (ms)", |f| format!("{:.1}", f.message_ms)),
    ("iterations", |f| f.iterations.to_string()),
    ("label updates (G)", |f| format!("{:.2}", giga(f.label_updates as f64))),
    ("  a second of the message stages", |f| format!("{:.2}", f.message_gupdates_per_s)),
    ("  a second of the match", |f| format!("{:.2}", f.match_gupdates_per_s)),
    ("message stages move at least (GB)", |f| format!("{:.2}", giga(f.message_bytes as f64))),
    ("  a second of their time", |f| format!("{:.1}", f.message_gb_per_s)),
    ("  share of the copy rate (%)", |f| format!("{:.0}", f.copy_share)),
    ("copy rate (GB/s)", |f| format!("{:.1}", f.copy_gb_per_s)),
    ("memory: plan", |f| size(Some(f.plan_bytes))),
    ("  peak of the process", |f| size(f.peak_bytes)),
    ("  buffers on the device", |f| size(f.device_bytes)),
];

fn size(bytes: Option<u64>) -> String {
    bytes.map_or_else(|| "-".into(), crate::bytes)
}

impl Findings {
    /// The figures for a terminal, the backends side by side.
    fn text(&self) -> String {
        let (repeats, plural) = (self.repeats, crate::plural(self.repeats.into()));
        let mut out =
            format!("mrfgs {}, {repeats} repeat{plural} after one match to warm up\n", self.version);
        for row in &self.pairs {
            let Row { name, preset, width, height, labels, .. } = row;
            let plural = crate::plural(*labels);
            let _ =
                writeln!(out, "\n{name}, preset {preset}: {width} x {height} pixels, {labels} label{plural}");
            for (backend, figures) in &row.backends {
                let ran_on = figures.as_ref().map_or("left out: too little memory", |f| &f.ran_on);
                let _ = writeln!(out, "{backend}: {ran_on}");
            }
            if row.backends.values().any(Option::is_some) {
                out.push('\n');
                row.write(&mut out);
            }
        }
        out
    }
}

impl Row {
    fn write(&self, out: &mut String) {
        let mut line = |name: &str, cells: &mut dyn Iterator<Item = String>| {
            let cells: Vec<_> = cells.map(|cell| format!("{cell:>14}")).collect();
            let _ = writeln!(out, "{}", format!("{name:<36}{}", cells.concat()).trim_end());
        };
        line("", &mut self.backends.keys().cloned());
        for (name, told) in LINES {
            let told = |figures: &Option<Figures>| figures.as_ref().map_or_else(|| "-".into(), told);
            line(name, &mut self.backends.values().map(told));
        }
        line("stages, all levels (ms)", &mut std::iter::empty());
        // The dearest first.
        let stages: BTreeSet<&str> =
            self.backends.values().flatten().flat_map(|f| f.stages.keys()).map(|name| stage(name)).collect();
        let time = |figures: &Option<Figures>, wanted: &str| {
            let of_stage = figures.as_ref()?.stages.iter().filter(|(name, _)| stage(name) == wanted);
            // A backend keeps the time of a sweep or of its parts.
            of_stage.map(|(_, ms)| *ms).reduce(|sum, ms| sum + ms)
        };
        let mut stages: Vec<(&str, Vec<Option<f64>>)> = stages
            .into_iter()
            .map(|stage| (stage, self.backends.values().map(|figures| time(figures, stage)).collect()))
            .collect();
        let all = |(_, times): &(&str, Vec<Option<f64>>)| times.iter().flatten().sum::<f64>();
        stages.sort_by(|a, b| all(b).total_cmp(&all(a)));
        for (stage, times) in stages {
            line(&format!("  {stage}"), &mut times.into_iter().map(|ms| figure(ms, 2)));
        }
    }
}

/// The stage of "dependency, level 0" and the like.
fn stage(name: &str) -> &str {
    name.split(',').next().unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_lie_in_the_middle() {
        for (values, expected) in [(&[3.0][..], 3.0), (&[5.0, 1.0, 4.0], 4.0), (&[8.0, 1.0, 4.0, 2.0], 3.0)] {
            assert!((median(values.iter().copied()) - expected).abs() < 1e-12, "{values:?}");
        }
    }
}
