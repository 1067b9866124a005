//! A region of the left view, and the crop of the calibrated images.

use std::path::PathBuf;

use mrfgs::image::Rect;
use serde::{Serialize, Serializer};

use crate::args::{Shard, shard};

/// The region to match.
#[derive(clap::Args)]
pub(crate) struct RegionArgs {
    /// Matches only this region of LEFT: first column, first row, width and height in pixels. All outputs cover that region, and a
    /// smaller region takes less time
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    pub(crate) roi: Option<Rect>,
}

/// How a large pair is shared and resumed.
#[derive(clap::Args)]
pub(crate) struct BlockArgs {
    /// Keeps the match in FOLDER, block by block: run it again to go on after a kill, or several times at once to share the work
    ///
    /// The pair is cut into blocks of at most about 4096 x 4096 pixels, smaller ones if --memory asks for it, each matched alone with a
    /// margin. The blocks depend only on the pair, the disparities and the method, so the outputs have the same bytes on any number of
    /// machines that see FOLDER. Each block goes into a file of its own. The run that finds all of them complete writes the outputs. Remove
    /// FOLDER then. Without --blocks, a pair is matched in blocks only where --memory asks for it, in a folder beside OUTPUT that is removed
    /// in the end.
    #[arg(long, value_name = "FOLDER", conflicts_with = "roi")]
    pub(crate) blocks: Option<PathBuf>,
    /// Matches only part K of N of the blocks (K from 1), such as 2/8, where machines share no file system with locks
    #[arg(long, value_name = "K/N", requires = "blocks", value_parser = shard)]
    pub(crate) shard: Option<Shard>,
}

/// The crop that the input images show.
#[derive(clap::Args, Default, Serialize)]
pub(crate) struct CropArgs {
    /// The crop of the calibrated images that your images show, possibly scaled: first column, first row, width and height in pixels
    /// [default: all, or the centre for OAK cameras]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region, requires = "calib")]
    #[serde(serialize_with = "as_given", skip_serializing_if = "Option::is_none")]
    pub(crate) calib_crop: Option<Rect>,
}

/// Serializes a region as it is given: first column, first row, width and height.
#[allow(clippy::ref_option, reason = "serde hands it over so")]
fn as_given<S: Serializer>(part: &Option<Rect>, serializer: S) -> Result<S::Ok, S::Error> {
    part.as_ref().map(|part| [part.x.start, part.y.start, part.x.len(), part.y.len()]).serialize(serializer)
}

fn region(text: &str) -> Result<Rect, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let parsed = || {
        let [x, y, width, height] = *numbers.as_deref()? else { return None };
        let sizes = width > 0 && height > 0;
        let [right, bottom] = [x.checked_add(width)?, y.checked_add(height)?];
        sizes.then_some(Rect { x: x..right, y: y..bottom })
    };
    parsed().ok_or_else(|| "give first column, first row, width and height, such as 200,100,320,240".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_four_numbers() {
        assert_eq!(region("20, 10,30,40"), Ok(Rect { x: 20..50, y: 10..50 }));
        for text in
            ["", "1,2,3", "1,2,3,4,5", "1,2,0,4", "-1,2,3,4", "1,2,3.5,4", "1,2,18446744073709551615,4"]
        {
            assert!(region(text).is_err(), "{text}");
        }
    }
}
