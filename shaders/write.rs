//! Writes every variant of every shader to a folder, as `NUMBER.STAGE.ENTRY-POINT.wgsl`: `cargo run --example
//! write-shaders FOLDER`.

mod variants;

use std::fs;
use std::io::{Error, Result};
use std::path::Path;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder] = &args[..] else { return Err(Error::other("give FOLDER")) };
    fs::create_dir_all(folder)?;
    for (number, kernel) in variants::kernels(&variants::plans()).iter().enumerate() {
        let shader = &kernel.shader;
        let name = format!("{number:03}.{}.{}.wgsl", shader.stage, shader.entry);
        fs::write(Path::new(folder).join(name), shader.source())?;
    }
    Ok(())
}
