//! `mrfgs presets`.

use std::fmt::Write;
use std::path::PathBuf;

use mrfgs::options::{GROUPS, Key, Method, PRESETS, Preset, Takes, Word};
use serde::Serialize;

use crate::failure::Result;
use crate::outputs::files;
use crate::table::Table;
use crate::text::wrapped;

/// Width of the output in characters.
const WIDTH: usize = 100;

const EXAMPLES: &str = "\
Examples:
  mrfgs presets
  mrfgs presets --all
  mrfgs presets default > mine.toml   # edit it, then use it with --method
  mrfgs match left.png right.png out.pfm --max-disparity 63 --method mine.toml";

/// List the options of the method with range, meaning and source, and their values in each preset
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Also lists options that only exist to reproduce alternative readings of the paper
    #[arg(long)]
    all: bool,
    /// Prints this preset as a commented TOML file for --method
    name: Option<String>,
    /// Writes the presets as JSON; `-` prints it instead of the text
    ///
    /// It contains `presets`, each with `name`, `about` and `method`, a table of values per group.
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

/// The contents of `--json`.
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

/// A preset as a TOML file.
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

/// All keys with their values in every preset; without `all`, keys for alternative readings of the paper are left out.
fn listing(all: bool) -> String {
    let mut presets = Table::new("ll");
    for preset in PRESETS {
        presets.row([format!("{} ", preset.name), preset.about.to_owned()]);
    }
    let values: Vec<_> = PRESETS.iter().map(|preset| preset.method().table()).collect();
    // A column for each preset.
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
        "\n`mrfgs presets --all` also lists options for alternative readings of the paper.\n"
    };
    format!("{presets}\n{table}{more}")
}

/// Meaning, source and numeric range of a key; keywords get their own lines.
fn meaning(key: &Key) -> String {
    let text = format!("{} ({}).", key.meaning.trim_end_matches('.'), key.source);
    if matches!(key.takes, Takes::Words(_)) { text } else { format!("{text} [{key}]") }
}

/// The keywords of a key with their meanings, each on a line starting with `lead`.
fn words(key: &Key, lead: &str) -> String {
    let Takes::Words(words) = key.takes else { return String::new() };
    let line =
        |word: &Word| format!("\n{}", wrapped(&format!("{}: {}", word.word, word.meaning), WIDTH, lead));
    words.iter().map(line).collect()
}
