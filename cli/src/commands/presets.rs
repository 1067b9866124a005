//! `mrfgs presets`.

use std::fmt::Write;
use std::path::PathBuf;

use mrfgs::options::{GROUPS, Key, Method, PRESETS, Preset, Takes, Word};
use serde::Serialize;

use crate::failure::Result;
use crate::outputs::files;
use crate::table::Table;
use crate::text::wrapped;

/// Columns of the output.
const WIDTH: usize = 100;

const EXAMPLES: &str = "\
Examples:
  mrfgs presets
  mrfgs presets --all
  mrfgs presets default > mine.toml   # edit it, and give it to --method
  mrfgs match left.png right.png out.pfm --max-disparity 63 --method mine.toml";

/// List the options of the method by group, with range, meaning and source, and their value in each preset
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// List also the options that only other readings of the paper turn
    #[arg(long)]
    all: bool,
    /// Print this preset alone, with all its options, as a TOML file with comments which --method takes
    name: Option<String>,
    /// Writes the presets as JSON; `-` prints it instead of the text
    ///
    /// It holds `presets`: for each one `name`, `about` and `method`, a table of values for each group.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A preset in JSON.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    about: &'static str,
    method: Method,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Findings {
    presets: Vec<Row>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let (text, shown) = match &args.name {
        Some(name) => (file(name)?, PRESETS.iter().filter(|preset| preset.name == name).collect()),
        None => (listing(args.all), PRESETS.iter().collect::<Vec<_>>()),
    };
    let row = |preset: &Preset| Row { name: preset.name, about: preset.about, method: preset.method() };
    let findings = Findings { presets: shown.into_iter().map(row).collect() };
    files::deliver(args.json.as_deref(), &findings, &text, |_| Ok(()))
}

/// One preset as a TOML file.
fn file(name: &str) -> Result<String> {
    let table = Method::preset(name)?.table();
    let mut out = String::new();
    let about = PRESETS.iter().find(|preset| preset.name == name).map_or("", |preset| preset.about);
    let _ = writeln!(out, "# The preset `{name}` of mrfgs {}: {about}.", env!("CARGO_PKG_VERSION"));
    for group in GROUPS {
        let _ = writeln!(out, "\n{}\n[{}]", wrapped(group.meaning, WIDTH, "# "), group.name);
        for key in group.keys {
            let _ = writeln!(out, "\n{}{}", wrapped(&meaning(key), WIDTH, "# "), words(key, "#   "));
            let _ = writeln!(out, "{} = {}", key.name(), table[group.name][key.name()]);
        }
    }
    Ok(out)
}

/// The keys with the values of all presets; those of readings of the paper only where `all` are asked for.
fn listing(all: bool) -> String {
    let mut presets = Table::new("ll");
    for preset in PRESETS {
        presets.row([format!("{} ", preset.name), preset.about.to_owned()]);
    }
    let values: Vec<_> = PRESETS.iter().map(|preset| preset.method().table()).collect();
    // One column for each preset.
    let mut table = Table::new(&"l".repeat(1 + PRESETS.len()));
    let cells =
        |key: &str, values: Vec<String>| std::iter::once(key.to_owned()).chain(values).collect::<Vec<_>>();
    table.row(cells("key", PRESETS.iter().map(|preset| preset.name.to_owned()).collect()));
    for group in GROUPS {
        table.text(format!("\n[{}] {}", group.name, group.meaning));
        for key in group.keys.iter().filter(|key| all || !key.for_reproduction) {
            let name = key.name();
            let values = values.iter().map(|values| values[group.name][&name].to_string().replace('"', ""));
            table.text("");
            table.row(cells(&name, values.collect()));
            table.text(format!("{}{}", wrapped(&meaning(key), WIDTH, "    "), words(key, "      ")));
        }
    }
    let more = if all {
        ""
    } else {
        "\n`mrfgs presets --all` lists what only other readings of the paper turn, too.\n"
    };
    format!("{presets}\n{table}{more}")
}

/// What a key does, where it comes from, and which numbers it takes; words have lines of their own.
fn meaning(key: &Key) -> String {
    let text = format!("{} ({}).", key.meaning.trim_end_matches('.'), key.source);
    if matches!(key.takes, Takes::Words(_)) { text } else { format!("{text} [{key}]") }
}

/// The words that a key takes, each with its meaning on lines of its own behind `lead`.
fn words(key: &Key, lead: &str) -> String {
    let Takes::Words(words) = key.takes else { return String::new() };
    let line =
        |word: &Word| format!("\n{}", wrapped(&format!("{}: {}", word.word, word.meaning), WIDTH, lead));
    words.iter().map(line).collect()
}
