//! The parameters that determine the result.

use std::path::{Path, PathBuf};

use mrfgs::options::{Method, PRESETS, Preset, mebibytes};

use crate::failure::{Failure, Result};

#[derive(clap::Args, Clone)]
#[command(next_help_heading = "Method")]
pub(crate) struct MethodArgs {
    /// A preset, or a TOML file that overrides keys of the preset; `mrfgs presets` lists both. May be repeated: later files override
    /// earlier ones [default: default]
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) method: Vec<PathBuf>,
    /// Sets one option, after --method: `--set levels=4 --set matching=sad`
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_and_value)]
    pub(crate) set: Vec<(String, String)>,
    /// Memory limit of a match, such as 2GiB or 512MiB. A pair that needs more is matched in tiles, and a larger one in blocks, which
    /// changes the result slightly [default: 4GiB, set by the preset]
    #[arg(long, value_name = "SIZE", value_parser = mebibytes)]
    pub(crate) memory: Option<u32>,
}

fn key_and_value(text: &str) -> std::result::Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().into(), value.trim().into())),
        _ => Err("give a key and a value, such as levels=4".into()),
    }
}

/// The preset called `word`, if there is one.
fn preset(word: &Path) -> Option<&'static Preset> {
    PRESETS.iter().find(|preset| word == Path::new(preset.name))
}

impl MethodArgs {
    /// The method: the preset, then each file, then each `--set`, then the memory.
    pub(crate) fn method(&self) -> Result<Method> {
        self.on("default")
    }

    /// Like [`Self::method`], but based on the preset `base` if `--method` names none.
    pub(crate) fn on(&self, base: &str) -> Result<Method> {
        let mut method = Method::preset(base)?;
        for (i, word) in self.method.iter().enumerate() {
            if let Some(preset) = preset(word) {
                if i > 0 {
                    let name = preset.name;
                    let reason =
                        format!("the preset {name} would override everything before it; put it first");
                    return Err(Failure::usage("--method", reason));
                }
                method = preset.method();
            } else if word.extension().is_some_and(|extension| extension == "toml") || word.exists() {
                method.load(word)?;
            } else {
                let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
                let reason = format!(
                    "`{}` is neither a preset nor a file; give one of {}, or a TOML file",
                    word.display(),
                    names.join(", ")
                );
                return Err(Failure::usage("--method", reason));
            }
        }
        method.set_all(self.set.iter().map(|(key, value)| (key.as_str(), value.as_str())))?;
        method.tiles.memory = self.memory.unwrap_or(method.tiles.memory);
        Ok(method.validated()?)
    }

    /// The first method and any others: each preset among the words of `--method` begins one, and files after it override it. Other flags
    /// apply to all.
    pub(crate) fn each(&self) -> (Self, Vec<Self>) {
        let with = |method| Self { method, ..self.clone() };
        let mut words = self.method.chunk_by(|_, next| preset(next).is_none()).map(<[_]>::to_vec);
        (with(words.next().unwrap_or_default()), words.map(with).collect())
    }

    /// The files among the arguments of `--method`.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Path> {
        self.method.iter().map(PathBuf::as_path).filter(|word| preset(word).is_none())
    }

    /// The arguments of `--method`, joined by " + "; `None` without any.
    pub(crate) fn name(&self) -> Option<String> {
        let words: Vec<_> = self.method.iter().map(|word| word.display().to_string()).collect();
        (!words.is_empty()).then(|| words.join(" + "))
    }
}
