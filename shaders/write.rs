//! Writes every variant of every shader to a folder, `NUMBER.STAGE.ENTRY-POINT.wgsl` each:
//! `cargo run --example write-shaders FOLDER`.

mod variants;

use std::fs;
use std::io::{Error, Result};
use std::path::Path;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder] = &args[..] else { return Err(Error::other("give FOLDER")) };
    fs::create_dir_all(folder)?;
    for (number, job) in variants::jobs(&variants::plans()).iter().enumerate() {
        let kernel = &job.kernel;
        let name = format!("{number:03}.{}.{}.wgsl", kernel.stage(), kernel.entry());
        fs::write(Path::new(folder).join(name), kernel.source())?;
    }
    Ok(())
}
