//! Writes the JavaScript, the types and the module of the page's engine: `mrfgs-web-bindgen MODULE FOLDER`.
//!
//! The program `wasm-bindgen` would do the same, but brings a web server for its tests, and must be installed apart in the very
//! version of the crate.

use std::path::PathBuf;

use anyhow::Context;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [module, folder] = arguments.as_slice() else {
        anyhow::bail!("usage: mrfgs-web-bindgen MODULE FOLDER");
    };
    Bindgen::new()
        .input_path(module)
        .web(true)?
        .typescript(true)
        .generate(folder)
        .with_context(|| format!("{}", module.display()))
}
