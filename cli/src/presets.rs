//! `mrfgs presets`.

use std::fmt::Write;

use mrfgs::Result;
use mrfgs::options::{Method, PRESETS, keys};

/// Columns of the output.
const WIDTH: usize = 100;

const EXAMPLES: &str = "\
Examples:
  mrfgs presets
  mrfgs presets default > mine.toml      edit it, and give it to --config
  mrfgs match left.png right.png out.pfm --max-disparity 63 --config mine.toml";

/// List the keys of the method with unit and meaning, and what each preset sets them to
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Print this preset alone, as a TOML file with comments that --config takes
    name: Option<String>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    crate::print(&match &args.name {
        Some(name) => file(name)?,
        None => listing()?,
    })
}

/// One preset as a config file.
fn file(name: &str) -> Result<String> {
    let table = Method::preset(name)?.table();
    let mut out = String::new();
    let about = PRESETS.iter().find(|p| p.0 == name).map_or("", |p| p.1);
    let _ = writeln!(out, "# The preset `{name}` of mrfgs {}: {about}.", env!("CARGO_PKG_VERSION"));
    for (key, unit, meaning) in keys() {
        let _ = writeln!(out, "\n{}", wrapped(&format!("{meaning} [{unit}]"), "# "));
        let _ = writeln!(out, "{key} = {}", table[&key]);
    }
    Ok(out)
}

/// All keys with the values of all presets.
fn listing() -> Result<String> {
    let mut out = String::new();
    for (name, about) in PRESETS {
        let _ = writeln!(out, "{name:10} {about}");
    }
    let tables =
        PRESETS.iter().map(|(name, _)| Ok(Method::preset(name)?.table())).collect::<Result<Vec<_>>>()?;
    let line = |key: &str, values: &mut dyn Iterator<Item = String>, unit: &str| {
        let values = values.map(|v| format!("{v:14}")).collect::<Vec<_>>().concat();
        format!("\n{key:20}{values}[{unit}]")
    };
    let names = &mut PRESETS.iter().map(|p| p.0.to_owned());
    let _ = writeln!(out, "{}", line("key", names, "unit and range"));
    for (key, unit, meaning) in keys() {
        let values = &mut tables.iter().map(|t| t[&key].to_string().replace('"', ""));
        let _ = writeln!(out, "{}\n{}", line(&key, values, unit), wrapped(meaning, "    "));
    }
    Ok(out)
}

/// A text in lines of at most [`WIDTH`] columns, each behind `lead`.
fn wrapped(text: &str, lead: &str) -> String {
    let mut lines = vec![lead.to_owned()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if lines[last].len() + 1 + word.len() > WIDTH && lines[last] != lead {
            lines.push(lead.to_owned());
        }
        if let Some(line) = lines.last_mut() {
            if line != lead {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}
