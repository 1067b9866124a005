//! `mrfgs presets`.

use std::fmt::Write;

use mrfgs::Result;
use mrfgs::options::{GROUPS, Key, Method, PRESETS, Takes, Word};

/// Columns of the output.
const WIDTH: usize = 100;

const EXAMPLES: &str = "\
Examples:
  mrfgs presets
  mrfgs presets default > mine.toml      edit it, and give it to --config
  mrfgs match left.png right.png out.pfm --max-disparity 63 --config mine.toml";

/// List the options of the method by group, with range, meaning and source, and their value in each preset
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
    for group in GROUPS {
        let _ = writeln!(out, "\n{}\n[{}]", wrapped(group.meaning, "# "), group.name);
        for key in group.keys {
            let _ = match key.takes {
                Takes::Words(_) => writeln!(out, "\n{}{}", wrapped(&meaning(key), "# "), words(key, "#   ")),
                _ => writeln!(out, "\n{}", wrapped(&format!("{} [{key}]", meaning(key)), "# ")),
            };
            let _ = writeln!(out, "{} = {}", key.name(), table[group.name][key.name()]);
        }
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
    let line = |key: &str, values: &mut dyn Iterator<Item = String>, takes: &str| {
        let values = values.map(|v| format!("{v:14}")).collect::<Vec<_>>().concat();
        format!("{key:22}{values}[{takes}]")
    };
    let names = &mut PRESETS.iter().map(|p| p.0.to_owned());
    let _ = writeln!(out, "\n{}", line("key", names, "unit and range"));
    for group in GROUPS {
        let _ = writeln!(out, "\n[{}] {}", group.name, group.meaning);
        for key in group.keys {
            let name = key.name();
            let values = &mut tables.iter().map(|t| t[group.name][&name].to_string().replace('"', ""));
            let _ = writeln!(out, "\n{}", line(&name, values, &key.to_string()));
            let _ = writeln!(out, "{}{}", wrapped(&meaning(key), "    "), words(key, "      "));
        }
    }
    Ok(out)
}

/// What a key does, and where it comes from.
fn meaning(key: &Key) -> String {
    format!("{} ({}).", key.meaning.trim_end_matches('.'), key.source)
}

/// The words that a key takes, each with its meaning on lines of its own behind `lead`.
fn words(key: &Key, lead: &str) -> String {
    let Takes::Words(words) = key.takes else { return String::new() };
    let line = |word: &Word| format!("\n{}", wrapped(&format!("{}: {}", word.word, word.meaning), lead));
    words.iter().map(line).collect()
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
