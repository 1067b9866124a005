//! The command line: one file a subcommand, and here what they share.

mod ablations;
mod batch;
mod batch_list;
mod batch_record;
mod bench;
mod breakdown;
mod claim;
mod devices;
mod evaluate;
mod folder;
mod intermediates;
pub mod list;
mod r#match;
mod match_outputs;
mod outputs;
mod presets;
mod process;
mod progress;
mod report;
mod search;
mod shell;
mod sidecar;
mod sign;
mod stop;
mod submission;
mod synthetic;
mod tables;

use std::fmt::{self, Write as _};
use std::io::Write;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::error::ErrorKind;
use clap::{ArgAction, CommandFactory, Parser, Subcommand, ValueEnum};
use mrfgs::backend::gpu;
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::image::read::{MAX_PIXELS, Reader};
use mrfgs::options::{DeviceChoice, DisparityRange, Execution, MAX_MEMORY, Method};
use mrfgs::solver::Inspector;
use mrfgs::{Error, Matched, Matcher, Result, Timing};
use progress::Bar;

const ABOUT: &str = "\
Stereo disparity by a multi-resolution factor graph, with the same bits on every device.

Takes a rectified pair and writes how far each pixel of the left image has moved to the left in the right one: \
left (x, y) with disparity d is seen at right (x - d, y).";

const EXAMPLES: &str = "\
Examples:
  mrfgs match left.png right.png disparity.pfm --max-disparity 63
  mrfgs match im0.png im1.png disparity.png   # range: calib.txt beside im0.png
  mrfgs batch pairs.csv maps                  # many pairs; again, it resumes
  mrfgs evaluate Teddy Cones --json figures.json
  mrfgs presets paper > paper.toml

Exit status: 0 when all went well, 2 when the command line makes no sense (for this pair, or on this machine), 130 when \
stopped by Ctrl-C or SIGTERM, 1 for any other failure. A failure is one line on standard error and leaves no output behind.";

#[derive(Parser)]
#[command(name = "mrfgs", version, about = ABOUT, after_help = EXAMPLES, max_term_width = 100)]
#[command(disable_version_flag = true)]
struct Cli {
    /// Print the versions of mrfgs, of wgpu and of every driver
    #[arg(short = 'V', long, action = ArgAction::Version)]
    version: (),
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Match(r#match::Args),
    Batch(batch::Args),
    Evaluate(evaluate::Args),
    Bench(bench::Args),
    /// List the devices of this machine, their limits, and which one `auto` takes
    Devices,
    Presets(presets::Args),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

impl Command {
    /// Whether it asks the drivers which devices there are.
    fn asks_for_devices(&self) -> bool {
        match self {
            Self::Match(args) => args.execution.asks_for_devices(),
            Self::Batch(args) => args.execution.asks_for_devices(),
            Self::Evaluate(args) => args.execution.asks_for_devices(),
            Self::Bench(_) | Self::Devices => true,
            Self::Presets(_) | Self::Completions(_) | Self::Man(_) => false,
        }
    }
}

/// Why the program ends early.
pub(crate) enum Failure {
    /// The command line makes no sense.
    Usage(String),
    /// Some pairs of a batch failed.
    Incomplete(String),
    /// The user stopped it.
    Stopped(String),
    /// Anything else.
    Error(Error),
}

impl Failure {
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_) | Self::Error(Error::Option { .. }) => ExitCode::from(2),
            Self::Stopped(_) => ExitCode::from(stop::STOPPED),
            Self::Incomplete(_) | Self::Error(_) => ExitCode::FAILURE,
        }
    }
}

impl fmt::Display for Failure {
    /// One line, whatever names of files hold.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let text = match self {
            Self::Usage(text) | Self::Incomplete(text) | Self::Stopped(text) => text.clone(),
            Self::Error(error) => error.to_string(),
        };
        f.write_str(&single_line(&text))
    }
}

/// The lines of a text in one.
fn single_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Interrupted => Self::Stopped("stopped; nothing is left behind".into()),
            error => Self::Error(error),
        }
    }
}

/// Does what the command line says; the exit status of the program.
#[must_use]
pub fn main() -> ExitCode {
    process::tell_panics_in_one_line();
    match panic::catch_unwind(run) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        // It has been told.
        Err(_) => ExitCode::FAILURE,
        Ok(Err(failure)) => {
            // Where standard error is closed there is nobody left to tell.
            let _ = writeln!(std::io::stderr(), "mrfgs: {failure}");
            failure.exit_code()
        }
    }
}

fn run() -> std::result::Result<(), Failure> {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) if answer.use_stderr() => return Err(Failure::Usage(one_line(&answer))),
        Err(answer) if answer.kind() == ErrorKind::DisplayVersion => {
            process::quiet_loader();
            return Ok(devices::print_versions()?);
        }
        Err(help) => return Ok(printed(help.print())?),
    };
    if cli.command.asks_for_devices() {
        process::quiet_loader();
    }
    match cli.command {
        Command::Match(args) => r#match::run(&args)?,
        Command::Batch(args) => batch::run(&args)?,
        Command::Evaluate(args) => evaluate::run(&args)?,
        Command::Bench(args) => bench::run(&args)?,
        Command::Devices => devices::run()?,
        Command::Presets(args) => presets::run(&args)?,
        Command::Completions(args) => shell::completions(&args)?,
        Command::Man(args) => shell::man(&args)?,
    }
    Ok(())
}

/// The parser's complaint without its headings and the usage.
fn one_line(error: &clap::Error) -> String {
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return "give a subcommand: match, batch, evaluate, bench, devices, presets, completions or man; `mrfgs --help` explains"
            .into();
    }
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more information"))
        .filter(|l| !l.is_empty())
        .collect();
    let text = lines.join(" ").replace(" tip: ", "; ");
    let subcommand = std::env::args_os()
        .nth(1)
        .and_then(|name| name.into_string().ok())
        .filter(|name| Cli::command().find_subcommand(name).is_some())
        .map_or(String::new(), |name| format!(" {name}"));
    format!("{}; `mrfgs{subcommand} --help` explains", text.strip_prefix("error: ").unwrap_or(&text))
}

/// Writes to standard output.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    printed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// What became of a text for standard output. That a reader like `head` has seen enough is no error.
fn printed(result: std::io::Result<()>) -> Result<()> {
    match result {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::write("standard output", e)),
        _ => Ok(()),
    }
}

/// Says something on standard error.
fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "mrfgs: {text}");
}

/// The parameters that determine the result.
#[derive(clap::Args)]
#[command(next_help_heading = "Method")]
struct MethodArgs {
    /// Preset to start from; `mrfgs presets` lists them, with every key [default: default]
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// TOML file of keys that replace the preset's, such as `mrfgs presets NAME` prints
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Sets one key, after preset and config file: `--set levels=4 --set matching=sad`
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_and_value)]
    set: Vec<(String, String)>,
    /// Memory that a match may take, such as 2GiB or 512MiB; a pair that needs more is matched tile by tile, which changes
    /// some bits of the result [default: 4GiB, the preset's]
    #[arg(long, value_name = "SIZE", value_parser = mebibytes)]
    memory: Option<u32>,
}

/// A size of memory, in MiB.
fn mebibytes(text: &str) -> std::result::Result<u32, String> {
    let units = [("MiB", 0), ("GiB", 10), ("TiB", 20)];
    let size = units.into_iter().find_map(|(unit, shift)| {
        let count: u64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
        u32::try_from(count.checked_mul(1 << shift)?).ok()
    });
    let size = size.filter(|size| (1..=MAX_MEMORY).contains(size));
    size.ok_or_else(|| "give a whole number of MiB, GiB or TiB, from 1MiB to 16TiB, like 2GiB".into())
}

/// How images, masks and maps are read.
#[derive(clap::Args)]
struct ReadArgs {
    /// Most pixels that an image may have; a file that claims more is refused before it takes memory
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = MAX_PIXELS,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    max_pixels: u64,
    /// Ignores pixels that have this value in every channel, as the file stores it [default: what a TIFF file says itself]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    no_data: Option<f64>,
}

impl ReadArgs {
    fn reader(&self) -> Reader {
        Reader { max_pixels: self.max_pixels, no_data: self.no_data }
    }
}

fn key_and_value(text: &str) -> std::result::Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().into(), value.trim().into())),
        _ => Err("give a key and its value, like levels=4".into()),
    }
}

impl MethodArgs {
    /// The method: the preset, then the config file, then each `--set`, then the memory.
    fn method(&self) -> Result<Method> {
        self.on(self.preset.as_deref().unwrap_or("default"))
    }

    /// The same on another preset.
    fn on(&self, preset: &str) -> Result<Method> {
        let mut method = Method::preset(preset)?;
        if let Some(path) = &self.config {
            method.load(path)?;
        }
        method.set_all(self.set.iter().map(|(key, value)| (key.as_str(), value.as_str())))?;
        method.tiles.memory = self.memory.unwrap_or(method.tiles.memory);
        method.validated()
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Backend {
    /// A GPU where there is one, else the CPU path
    #[default]
    Auto,
    /// A GPU, or any Vulkan or Metal driver; an error where there is none
    Gpu,
    /// The CPU path
    Cpu,
}

/// Where the work runs. No choice changes a bit of the result.
#[derive(clap::Args)]
#[command(next_help_heading = "Where it runs (changes no bit of the result)")]
struct ExecutionArgs {
    /// What runs the stages
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    backend: Backend,
    #[command(flatten)]
    resources: ResourceArgs,
    /// Prints the time of every stage to standard error, by the device's own clock where it has one
    #[arg(long)]
    timings: bool,
}

/// What each backend may use.
#[derive(clap::Args)]
struct ResourceArgs {
    /// A device by its index in `mrfgs devices` or a part of its name [default: the fastest kind there is]
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
    /// Threads of the CPU path, 1 to 1024 [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl ExecutionArgs {
    fn asks_for_devices(&self) -> bool {
        match self.backend {
            Backend::Auto => self.resources.device.is_some() || gpu::may_have_gpu(),
            Backend::Gpu => true,
            Backend::Cpu => false,
        }
    }

    fn execution(&self) -> Result<Execution> {
        let ResourceArgs { device, threads } = &self.resources;
        if self.backend == Backend::Cpu && device.is_some() {
            return Err(no_device());
        }
        if let Some(threads) = threads {
            // What is done around a match (reading, the look at what may be wrong) is bound by it too. A second call changes
            // nothing.
            let _ = rayon::ThreadPoolBuilder::new().num_threads((*threads).into()).build_global();
        }
        Ok(Execution {
            device: match (device, self.backend) {
                (Some(name), _) => DeviceChoice::Named(name.clone()),
                (None, Backend::Auto) => DeviceChoice::Auto,
                (None, Backend::Gpu) => DeviceChoice::Gpu,
                (None, Backend::Cpu) => DeviceChoice::Cpu,
            },
            threads: threads.map(usize::from),
            timings: self.timings,
        })
    }
}

/// `--device` beside `--backend cpu`.
fn no_device() -> Error {
    Error::option("--device", "`--backend cpu` runs on no device; leave one of the two away")
}

/// The range that `path`, a calib.txt, has read as `calibration`, gives from `min` on; `None` where it gives none.
fn calibrated_range(path: &Path, calibration: &Calibration, min: i32) -> Result<Option<DisparityRange>> {
    let Some(ndisp) = calibration.ndisp else { return Ok(None) };
    let max = i32::try_from(ndisp).unwrap_or(i32::MAX) - 1;
    match DisparityRange::new(min, max) {
        Err(Error::Option { reason, .. }) => Err(Error::read(path, format!("ndisp={ndisp}: {reason}"))),
        range => range.map(Some),
    }
}

/// Matches a pair with a progress bar, unless it is [stopped](stop), and says on standard error what ran where and how long.
/// `name` tells pairs apart where there are several.
fn match_and_tell(
    matcher: &mut Matcher,
    pair: &Pair,
    range: DisparityRange,
    method: &Method,
    name: Option<&str>,
    quiet: bool,
    inspector: Option<Inspector>,
) -> Result<(Matched, Duration)> {
    let start = Instant::now();
    let mut bar = Bar::new(name, quiet);
    let matched = matcher.inspect(pair, range, method, &mut |progress| bar.update(progress), inspector);
    bar.finish();
    let (matched, time) = (matched?, start.elapsed());
    if !quiet {
        if let Some(note) = &matched.note {
            say(note);
        }
        let (width, height) = matched.plan.size();
        let name = name.map(|name| format!("{name}: ")).unwrap_or_default();
        let (labels, iterations) = (range.labels(), matched.iterations);
        let tiles = match matched.tiles.count() {
            1 => String::new(),
            count => format!(", {count} tiles"),
        };
        say(&format!(
            "{name}{width} x {height}, {labels} label{}{tiles}, {iterations} iteration{} in {:.2} s on {}",
            plural(labels),
            plural(iterations as usize),
            time.as_secs_f64(),
            matched.ran_on
        ));
        if !matched.timings.is_empty() {
            let _ = std::io::stderr().write_all(timing_table(&matched, time).as_bytes());
        }
    }
    Ok((matched, time))
}

/// The name of what was timed: "dependency, level 0".
fn stage_and_level(timing: &Timing) -> String {
    let level = timing.level.map_or(String::new(), |z| format!(", level {z}"));
    format!("{}{level}", timing.stage)
}

/// Stages and their times for people; `whole` is the time of it all.
fn timing_table(matched: &Matched, whole: Duration) -> String {
    let Matched { timings, traffic, .. } = matched;
    let mut out = format!("{:<24}{:>6}{:>12}{:>9}\n", "stage", "runs", "ms", "share");
    let mut row = |name: &str, runs: &str, time: Duration| {
        let share = 100.0 * time.as_secs_f64() / whole.as_secs_f64();
        let _ = writeln!(out, "{name:<24}{runs:>6}{:>12.2}{share:>7.1} %", 1000.0 * time.as_secs_f64());
    };
    for timing in timings {
        row(&stage_and_level(timing), &timing.runs.to_string(), timing.time);
    }
    row("rest", "", whole.saturating_sub(timings.iter().map(|t| t.time).sum()));
    row("all", "", whole);
    if traffic.dispatches > 0 {
        let _ = writeln!(
            out,
            "{} dispatches in {} submissions, {} up, {} down",
            traffic.dispatches,
            traffic.submissions,
            bytes(traffic.bytes_up),
            bytes(traffic.bytes_down)
        );
    }
    out
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// A number of bytes for people.
fn bytes(count: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if count < 1024 {
        return format!("{count} B");
    }
    let mut value = count as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1023.5 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.*} {}", usize::from(value < 9.95), UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parser_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn no_subcommand_has_more_than_twenty_eight_flags() {
        for command in Cli::command().get_subcommands() {
            let flags = command.get_arguments().filter(|a| a.get_long().is_some()).count();
            assert!(flags <= 28, "{}: {flags}", command.get_name());
        }
    }

    #[test]
    fn bytes_have_two_digits_that_matter() {
        for (count, text) in [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.0 KiB"),
            (10 * 1024, "10 KiB"),
            (1_048_000, "1023 KiB"),
            (1_048_570, "1.0 MiB"),
            (5 << 30, "5.0 GiB"),
            (u64::MAX, "16384 PiB"),
        ] {
            assert_eq!(bytes(count), text);
        }
    }
}
