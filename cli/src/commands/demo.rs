//! `mrfgs demo`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fs, io};

use clap::Parser;

use crate::commands::r#match;
use crate::console;
use crate::failure::Result;
use crate::outputs::StagedFolder;

/// A rendered pair. Copies of `testdata/mixed`, as the package must contain them.
const PAIR: [(&str, &[u8]); 2] = [
    ("left.png", include_bytes!("../../demo/left.png")),
    ("right.png", include_bytes!("../../demo/right.png")),
];
/// The flags for this pair.
const FLAGS: &str = "--max-disparity 47 --focal 240 --baseline 0.186m --also view,preview,points";

/// The files that the demo writes, with descriptions.
const MADE: [(&str, &str); 4] = [
    ("disparity.view.html", "the map and the surface in 3-D, for a browser"),
    ("disparity.preview.png", "the map in colours"),
    ("disparity.points.ply", "a point cloud, for MeshLab, CloudCompare or Blender"),
    ("disparity.pfm", "the disparities in pixels"),
];

const EXAMPLES: &str = "\
Examples:
  mrfgs demo
  mrfgs demo /tmp/first-map";

/// Match a built-in pair, and show what to do next
///
/// FOLDER gets the pair, its disparity map, the map in colours, a page for the browser, and a point cloud.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Folder to write; must be new, empty or from an earlier demo, which is replaced
    #[arg(default_value = "mrfgs-demo")]
    folder: PathBuf,
}

/// Parses a command line of `mrfgs match`.
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
Now try your own pair. Hand-held photos: mrfgs match LEFT RIGHT disparity.pfm --show --rectify
A calibrated stereo camera:              mrfgs match LEFT RIGHT disparity.pfm --show --rectify --calib FILE
Already rectified images:                mrfgs match LEFT RIGHT disparity.pfm --show
"
    ))?;
    Ok(())
}

/// Whether `folder` contains the pair and nothing but files of a demo.
fn is_demo(folder: &Path) -> bool {
    let is_ours =
        |name: &OsStr| PAIR.iter().map(|file| file.0).chain(MADE.map(|file| file.0)).any(|own| name == own);
    let is_kept =
        |(name, bytes): &(&str, &[u8])| fs::read(folder.join(name)).is_ok_and(|there| there == *bytes);
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    entries.is_ok_and(|entries| entries.iter().all(|entry| is_ours(&entry.file_name())))
        && PAIR.iter().all(is_kept)
}

/// The paths of the pair and the map in `folder`.
fn words(folder: &Path) -> [PathBuf; 3] {
    ["left.png", "right.png", "disparity.pfm"].map(|name| folder.join(name))
}
