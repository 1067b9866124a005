//! Generates the JavaScript, types and module of the page's engine: `mrfgs-web-bindgen MODULE FOLDER`.
//!
//! The program `wasm-bindgen` would do the same, but it includes a web server for tests, and must be installed separately in exactly the
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
