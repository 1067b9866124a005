//! The command line of mrfgs. Imports lead down: text and console, arguments, outputs, image pairs, running a match, and on top the
//! commands.

#![forbid(unsafe_code)]

mod args;
mod blocks;
mod commands;
mod console;
mod failure;
mod ffmpeg;
mod matching;
mod outputs;
mod pairs;
mod plan;
mod process;
mod progress;
mod remedy;
mod sequences;
mod stop;
mod table;
mod text;

use std::panic;
use std::path::Path;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ArgAction, CommandFactory, Parser, Subcommand};

use commands::{
    batch, bench, completions, demo, depth, devices, evaluate, inspect, man, r#match, presets, rectify, ros,
    sequence, view,
};
use failure::Failure;
pub use pairs::list;

const ABOUT: &str = "\
Turns two photos of a scene into a depth map, the same on every GPU and CPU.

Take the second photo a step to the side of the first. Near things then shift farther between the two photos than distant things. \
The map has this shift for every pixel of the left photo, in pixels: its disparity. If the cameras are calibrated, you also get depths and \
points.";

const EXAMPLES: &str = "\
Examples:
  # Two hand-held photos; the browser shows the map and the surface:
  mrfgs match a.jpg b.jpg map.pfm --rectify --show
  # Try it on a built-in pair:
  mrfgs demo
  # Images of a calibrated rig, with depth:
  mrfgs match l.png r.png d.pfm --rectify --calib stereo.yml --also depth
  # Images that are rectified already:
  mrfgs match left.png right.png d.pfm --max-disparity 63
  # Many pairs; run it again to resume:
  mrfgs batch pairs.csv maps
  # The frames of a video:
  mrfgs sequence left right maps
  # Live from two ROS 2 cameras:
  mrfgs ros --method fast --also points
  # Compare with the truth:
  mrfgs evaluate Teddy Cones --json figures.json

Exit status: 0 on success, 2 if the command line is wrong (also for this pair or this machine), 130 if \
stopped by Ctrl-C or another signal, 1 for any other failure. A failure prints one line on standard error and leaves no output behind.";

#[derive(Parser)]
#[command(name = "mrfgs", version, about = ABOUT, after_help = EXAMPLES, max_term_width = 100)]
#[command(disable_version_flag = true)]
struct Cli {
    /// Print the versions of mrfgs, wgpu and every driver
    #[arg(short = 'V', long, action = ArgAction::Version)]
    version: (),
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Args),
    Match(r#match::Args),
    Rectify(rectify::Args),
    Depth(depth::Args),
    View(view::Args),
    Sequence(sequence::Args),
    Ros(ros::Args),
    Batch(batch::Args),
    Evaluate(evaluate::Args),
    Bench(bench::Args),
    Inspect(inspect::Args),
    /// List the devices of this machine, their limits, and the one that `auto` uses
    Devices,
    Presets(presets::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Runs the program and returns its exit status.
#[must_use]
pub fn main() -> ExitCode {
    process::tell_panics_in_one_line();
    stop::tell_of_full_files();
    match panic::catch_unwind(run) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        // The panic hook has already printed a message.
        Err(_) => ExitCode::FAILURE,
        Ok(Err(failure)) => {
            console::say(&failure.to_string());
            failure.exit_code()
        }
    }
}

fn run() -> Result<(), Failure> {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(answer) if answer.use_stderr() => return Err(Failure::Usage(one_line(&answer))),
        Err(answer) if answer.kind() == ErrorKind::DisplayVersion => return Ok(devices::print_versions()?),
        Err(help) => return Ok(console::printed(help.print())?),
    };
    match cli.command {
        Command::Demo(args) => demo::run(&args)?,
        Command::Match(args) => r#match::run(args)?,
        Command::Rectify(args) => rectify::run(args)?,
        Command::Depth(args) => depth::run(&args)?,
        Command::View(args) => view::run(&args)?,
        Command::Sequence(args) => sequence::run(&args)?,
        Command::Ros(args) => ros::run(&args)?,
        Command::Batch(args) => batch::run(&args)?,
        Command::Evaluate(args) => evaluate::run(&args)?,
        Command::Bench(args) => bench::run(&args)?,
        Command::Inspect(args) => inspect::run(args)?,
        Command::Devices => devices::run()?,
        Command::Presets(args) => presets::run(&args)?,
        Command::Completions(args) => completions::run(&args, Cli::command())?,
        Command::Man(args) => man::run(&args, Cli::command())?,
    }
    Ok(())
}

/// The parser's error in one line, without headings and usage.
fn one_line(error: &clap::Error) -> String {
    let program = Cli::command();
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let names: Vec<_> = program.get_subcommands().map(clap::Command::get_name).collect();
        let (last, others) = names.split_last().unwrap_or((&"", &[]));
        return format!(
            "give a command: {} or {last}; see `mrfgs --help`, or try `mrfgs demo`",
            others.join(", ")
        );
    }
    let first = std::env::args_os().nth(1).unwrap_or_default();
    if error.kind() == ErrorKind::InvalidSubcommand && Path::new(&first).exists() {
        let file = Path::new(&first).display();
        return format!(
            "give a command before {file}, such as `mrfgs match LEFT RIGHT map.pfm`; see `mrfgs --help`"
        );
    }
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more information"))
        .filter(|l| !l.is_empty())
        .collect();
    let text = lines.join(" ").replace(" tip: ", "; ");
    let (mut command, mut called) = (&program, String::from("mrfgs"));
    for word in std::env::args_os().skip(1) {
        let Some(below) = word.to_str().and_then(|name| command.find_subcommand(name)) else { break };
        called = format!("{called} {}", below.get_name());
        command = below;
    }
    format!("{}; see `{called} --help`", text.strip_prefix("error: ").unwrap_or(&text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parser_is_consistent() {
        Cli::command().debug_assert();
    }

    /// The parser's error for an example, if there is one.
    fn fault(line: &str) -> Option<String> {
        let line = ["  #", " | ", " > ", " && "]
            .iter()
            .fold(line, |line, end| line.split(end).next().unwrap_or(line));
        let answer =
            Cli::try_parse_from(line.split_whitespace().map(|word| word.trim_matches(['\'', '"']))).err()?;
        // Prose may name a command without its arguments.
        let is_short = matches!(
            answer.kind(),
            ErrorKind::DisplayHelp
                | ErrorKind::DisplayVersion
                | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
                | ErrorKind::MissingRequiredArgument
        );
        (!is_short).then(|| format!("{line}: {}", one_line(&answer)))
    }

    /// Every command line in the help and the documents parses.
    #[test]
    fn examples_are_command_lines() {
        fn texts(command: &clap::Command) -> Vec<String> {
            let help = [command.get_after_help(), command.get_long_about()]
                .map(|text| text.map(ToString::to_string));
            help.into_iter().flatten().chain(command.get_subcommands().flat_map(texts)).collect()
        }
        // The line of a plug-in, and lines with placeholders.
        let no_lines = ["mrfgs /path/to/asp-plugin", "mrfgs --threads", "mrfgs evaluate map --json"];
        let of_help = texts(&Cli::command());
        let mut lines: Vec<String> = of_help
            .iter()
            .flat_map(|text| text.lines())
            .filter_map(|line| line.strip_prefix("  ").filter(|line| line.starts_with("mrfgs ")))
            .map(str::to_owned)
            .collect();
        let of_help = lines.len();
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
        let pages = ["README.md", "docs/results.md", "docs/guide/*.md"].map(|name| format!("{root}/{name}"));
        for path in pages.iter().flat_map(|pattern| glob::glob(pattern).unwrap()) {
            let path = path.unwrap();
            let text = std::fs::read_to_string(path).unwrap();
            let prose = text.split("\n```").step_by(2).collect::<Vec<_>>().join("\n");
            let spans = prose.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " "));
            lines.extend(spans.filter(|span| span.starts_with("mrfgs ") && !span.contains("...")));
        }
        lines.retain(|line| !no_lines.iter().any(|start| line.starts_with(start)));
        let faults: Vec<_> = lines.iter().filter_map(|line| fault(line)).collect();
        assert!(faults.is_empty(), "{faults:#?}");
        assert!(of_help > 40 && lines.len() > of_help + 30, "{of_help} of {} lines", lines.len());
        assert!(fault("mrfgs match l.png r.png d.pfm --frobnicate  # control").is_some());
        assert!(fault("mrfgs frobnicate").is_some());
    }

    /// Caps the number of flags of each command, not counting --help.
    #[test]
    fn commands_have_few_flags() {
        let caps = [
            ("match", 37),
            ("rectify", 9),
            ("depth", 17),
            ("view", 11),
            ("sequence", 42),
            ("ros", 33),
            ("batch", 21),
            ("evaluate", 15),
            ("evaluate map", 10),
            ("evaluate submission", 11),
            ("bench", 11),
            ("inspect", 16),
            ("presets", 2),
        ];
        let program = Cli::command();
        let count =
            |command: &clap::Command| command.get_arguments().filter(|a| a.get_long().is_some()).count();
        for command in program.get_subcommands() {
            for (name, command) in std::iter::once((command.get_name().to_owned(), command)).chain(
                command
                    .get_subcommands()
                    .map(|below| (format!("{} {}", command.get_name(), below.get_name()), below)),
            ) {
                let cap = caps.iter().find(|(capped, _)| *capped == name).map_or(0, |(_, cap)| *cap);
                assert!(count(command) <= cap, "{name} has {} flags", count(command));
            }
        }
    }
}
