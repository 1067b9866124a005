//! `mrfgs presets`.

use std::fmt::Write;

use mrfgs::options::{Method, PRESETS, keys};

use crate::console;
use crate::failure::Result;
use crate::table::Table;
use crate::text::wrapped;

/// Columns of the output.
const WIDTH: usize = 100;

const EXAMPLES: &str = "\
Examples:
  mrfgs presets
  mrfgs presets default > mine.toml   # edit it, and give it to --method
  mrfgs match left.png right.png out.pfm --max-disparity 63 --method mine.toml";

/// List the keys of the method with unit and meaning, and what each preset sets them to
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Print this preset alone, as a TOML file with comments, which --method takes
    name: Option<String>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    console::print(&match &args.name {
        Some(name) => file(name)?,
        None => listing()?,
    })
}

/// One preset as a TOML file.
fn file(name: &str) -> Result<String> {
    let table = Method::preset(name)?.table();
    let mut out = String::new();
    let about = PRESETS.iter().find(|p| p.0 == name).map_or("", |p| p.1);
    let _ = writeln!(out, "# The preset `{name}` of mrfgs {}: {about}.", env!("CARGO_PKG_VERSION"));
    for (key, unit, meaning) in keys() {
        let _ = writeln!(out, "\n{}", wrapped(&format!("{meaning} [{unit}]"), WIDTH, "# "));
        let _ = writeln!(out, "{key} = {}", table[&key]);
    }
    Ok(out)
}

/// All keys with the values of all presets.
fn listing() -> Result<String> {
    let mut presets = Table::new("ll");
    for (name, about) in PRESETS {
        presets.row([format!("{name} "), (*about).to_owned()]);
    }
    let values =
        PRESETS.iter().map(|(name, _)| Ok(Method::preset(name)?.table())).collect::<Result<Vec<_>>>()?;
    // One column a preset, and a space more between them.
    let mut table = Table::new(&format!("l{}l", "l".repeat(PRESETS.len())));
    let cells = |key: &str, values: Vec<String>, unit: &str| {
        let cells = std::iter::once(key.to_owned()).chain(values).map(|cell| cell + " ");
        cells.chain([format!("[{unit}]")]).collect::<Vec<_>>()
    };
    table.row(cells("key", PRESETS.iter().map(|p| p.0.to_owned()).collect(), "unit and range"));
    for (key, unit, meaning) in keys() {
        table.text("");
        let values = values.iter().map(|values| values[&key].to_string().replace('"', ""));
        table.row(cells(&key, values.collect(), unit));
        table.text(wrapped(meaning, WIDTH, "    "));
    }
    Ok(format!("{presets}\n{table}"))
}
