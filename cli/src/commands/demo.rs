//! `mrfgs demo`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fs, io};

use clap::Parser;

use crate::commands::r#match;
use crate::console;
use crate::failure::Result;
use crate::outputs::StagedFolder;

/// A rendered pair: copies of `testdata/mixed`, since the package must hold what is compiled into it.
const PAIR: [(&str, &[u8]); 2] = [
    ("left.png", include_bytes!("../../demo/left.png")),
    ("right.png", include_bytes!("../../demo/right.png")),
];
/// Its range and cameras, and what else is made of it.
const FLAGS: &str = "--max-disparity 47 --focal 240 --baseline 0.186m --also preview,points";

/// The files that the demo makes of its pair, and what each is.
const MADE: [(&str, &str); 3] = [
    ("disparity.preview.png", "the map in colours"),
    ("disparity.points.ply", "the points; MeshLab, CloudCompare and Blender show them"),
    ("disparity.pfm", "the disparities in pixels"),
];

const EXAMPLES: &str = "\
Examples:
  mrfgs demo
  mrfgs demo /tmp/first-map";

/// Match a rendered pair that is part of the program, and say what to do next
///
/// FOLDER gets the pair, its map, the map in colours, and the points in 3-D.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The folder for the pair and what is made of it; it must be new or empty, or hold what a demo has made, which is made anew
    #[arg(default_value = "mrfgs-demo")]
    folder: PathBuf,
}

/// The command line of `mrfgs match`.
#[derive(Parser)]
struct Matching {
    #[command(flatten)]
    args: r#match::Args,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let folder = if is_demo(&args.folder) {
        StagedFolder::new(&args.folder)?
    } else {
        StagedFolder::new_or_empty(&args.folder)?
    };
    for (name, bytes) in PAIR {
        fs::write(folder.path().join(name), bytes).map_err(|e| folder.error(e))?;
    }
    let line = words(&folder.path()).into_iter().chain(FLAGS.split(' ').map(Into::into));
    let matching = Matching::parse_from(std::iter::once("match".into()).chain(line));
    r#match::run(matching.args)?;
    folder.publish()?;
    let shown = words(&args.folder).map(|path| path.display().to_string()).join(" ");
    let made = MADE.map(|(name, what)| (args.folder.join(name).display().to_string(), what));
    let width = made.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let made = made.map(|(name, what)| format!("  {name:width$}  {what}\n")).concat();
    console::print(&format!(
        "\
This was mrfgs match {shown} {FLAGS}

{made}
Now your own pair. If it is rectified:        mrfgs match LEFT RIGHT disparity.pfm --also preview
If it is not, and the cameras are calibrated: mrfgs match LEFT RIGHT disparity.pfm --also preview --rectify --calib FILE
If it is not, and they are not:               mrfgs match LEFT RIGHT disparity.pfm --also preview --rectify
"
    ))?;
    Ok(())
}

/// Whether `folder` holds the pair and nothing but what is made of it.
fn is_demo(folder: &Path) -> bool {
    let is_ours =
        |name: &OsStr| PAIR.iter().map(|file| file.0).chain(MADE.map(|file| file.0)).any(|own| name == own);
    let is_kept =
        |(name, bytes): &(&str, &[u8])| fs::read(folder.join(name)).is_ok_and(|there| there == *bytes);
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    entries.is_ok_and(|entries| entries.iter().all(|entry| is_ours(&entry.file_name())))
        && PAIR.iter().all(is_kept)
}

/// The pair and the map in `folder`.
fn words(folder: &Path) -> [PathBuf; 3] {
    ["left.png", "right.png", "disparity.pfm"].map(|name| folder.join(name))
}
