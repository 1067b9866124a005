//! The flags of a prior: known disparities of the left view.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use mrfgs::image::read;
use mrfgs::low_level::text;
use mrfgs::prior::{PriorKind, PriorPoint};
use mrfgs::{Error, Prior};
use serde::Serialize;

use crate::args::Sign;
use crate::failure::{Failure, Result};

/// Largest list of points, in bytes.
const MOST_BYTES: u64 = 1 << 30;

/// How a prior is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Exact but sparse: cleaned, spread, and they decide where no match can be trusted
    Points,
    /// Dense but coarse: it only shifts the balance between disparities
    Surface,
}

/// The prior of a match.
#[derive(clap::Args)]
#[command(next_help_heading = "What is known of the scene")]
pub(crate) struct PriorArgs {
    /// Disparities of LEFT that are known: points of a lidar or of a bundle adjustment, a terrain model, the map of the last frame
    ///
    /// Either a disparity map of the size of LEFT (PFM, TIFF, PNG as in KITTI, NPY; 0 of a PNG, infinity and NaN are unknown), or a .csv or
    /// .txt file with a line `x,y,disparity` or `x,y,disparity,sigma` for each point, in pixels. With --rectify, they belong to the rectified view.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// Standard deviation of the known disparities, in pixels [default: 0.25 for points, 1 for surfaces]
    #[arg(long, value_name = "PIXELS", requires = "prior", allow_negative_numbers = true)]
    prior_sigma: Option<f64>,
    /// How to use them [default: points where at most a fifth of the pixels are known]
    #[arg(long, value_enum, value_name = "KIND", requires = "prior")]
    prior_kind: Option<Kind>,
}

impl PriorArgs {
    /// The file, if there is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.prior.as_deref()
    }

    /// Reads the prior for a left view of (width, height) pixels, with disparities by `sign`.
    pub(crate) fn read(&self, size: (usize, usize), sign: Sign) -> Result<Option<Arc<Prior>>> {
        let Self { prior_sigma: sigma, prior_kind: kind, .. } = *self;
        if let Some(sigma) = sigma.filter(|sigma| !(*sigma > 0.0 && sigma.is_finite())) {
            return Err(Failure::usage("--prior-sigma", format!("{sigma} is not above 0")));
        }
        let names = ["--prior", "--prior-kind"];
        let file = self.file().map(|path| PriorFile { path, sigma, kind, names });
        file.map(|file| file.read(size, sign)).transpose()
    }
}

/// A file of known disparities, and how to use it.
pub(crate) struct PriorFile<'a> {
    pub(crate) path: &'a Path,
    /// Standard deviation in pixels, above 0; `None` for the usual one.
    pub(crate) sigma: Option<f64>,
    pub(crate) kind: Option<Kind>,
    /// The flags or columns that name the file and its kind, for messages.
    pub(crate) names: [&'static str; 2],
}

impl PriorFile<'_> {
    /// Reads the prior for a left view of (width, height) pixels, with disparities by `sign`.
    pub(crate) fn read(&self, size: (usize, usize), sign: Sign) -> Result<Arc<Prior>> {
        let prior = if is_list(self.path) { self.listed(size, sign) } else { self.map(size, sign) };
        prior.map(Arc::new)
    }

    /// The given standard deviation, or the usual one of a prior of this kind.
    fn sigma_of(&self, kind: PriorKind) -> f64 {
        self.sigma.unwrap_or(kind.usual_sigma())
    }

    fn kind(&self) -> Option<PriorKind> {
        self.kind.map(|kind| match kind {
            Kind::Points => PriorKind::Points,
            Kind::Surface => PriorKind::Surface,
        })
    }

    /// A failure that names the file; `reason` follows directly, with its punctuation.
    fn refused(&self, reason: impl Display) -> Failure {
        Failure::usage(self.names[0], format!("{}{reason}", self.path.display()))
    }

    /// The failure of the library to take what the file holds.
    fn of_library(&self, e: Error) -> Failure {
        match e {
            Error::Mismatch(reason) => self.refused(format_args!(": {reason}")),
            e => e.into(),
        }
    }

    fn map(&self, size: (usize, usize), sign: Sign) -> Result<Prior> {
        let map = sign.map(read::read_disparity(self.path)?);
        if map.size() != size {
            let ((w, h), (width, height)) = (map.size(), size);
            let reason = format!(" has {w} x {h} pixels, LEFT {width} x {height}; give a map of LEFT");
            return Err(self.refused(reason));
        }
        let kind = self.kind().unwrap_or_else(|| PriorKind::of_map(&map));
        Prior::map(kind, &map, self.sigma_of(kind)).map_err(|e| self.of_library(e))
    }

    fn listed(&self, size: (usize, usize), sign: Sign) -> Result<Prior> {
        let path = self.path;
        if self.kind() == Some(PriorKind::Surface) {
            let reason = format!("{} holds points; give a map for a surface", path.display());
            return Err(Failure::usage(self.names[1], reason));
        }
        let text = text::read(path, MOST_BYTES, "a list of points")?;
        let text = str::from_utf8(&text).map_err(|_| self.refused(" is not UTF-8 text"))?;
        let points = PriorPoint::listed(text, self.sigma).map_err(|e| self.of_library(e))?;
        let signed = |point: PriorPoint| {
            let disparity = if sign == Sign::default() { point.disparity } else { -point.disparity };
            PriorPoint { disparity, ..point }
        };
        Prior::points(size, points.into_iter().map(signed)).map_err(|e| self.of_library(e))
    }
}

/// Whether a file holds a list of points.
fn is_list(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["csv", "txt"].iter().any(|list| extension.eq_ignore_ascii_case(list))
}

#[cfg(test)]
mod tests {
    use super::*;
    use Sign::{LeftMinusRight, RightMinusLeft};

    fn given(name: &str, text: &str, sigma: Option<f64>) -> (tempfile::TempDir, PriorArgs) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        (folder, PriorArgs { prior: Some(path), prior_sigma: sigma, prior_kind: None })
    }

    fn points(text: &str, sign: Sign) -> std::result::Result<Arc<Prior>, String> {
        let (_folder, args) = given("points.csv", text, None);
        args.read((8, 6), sign).map(Option::unwrap).map_err(|e| e.to_string())
    }

    #[test]
    fn points_are_listed_with_and_without_names_and_sigma() {
        let all = points("x,y,d,sigma\n1,2,3.5,0.5\n 4, 5 , 6\n", LeftMinusRight).unwrap();
        assert_eq!((all.count(), all.kind()), (2, PriorKind::Points));
        assert_eq!(points("1,2,-3.5,0.5\n4,5,-6", RightMinusLeft).unwrap(), all);
    }

    #[test]
    fn bad_lists_are_named_with_their_line() {
        let line = points("1,2,3\n1,2,x\n", LeftMinusRight).unwrap_err();
        assert!(line.contains("points.csv: line 2: "), "{line}");
        assert!(points("", LeftMinusRight).unwrap_err().contains("no point"));
        assert!(points("90,2,3\n", LeftMinusRight).unwrap_err().contains("none of the 1 points"));
        assert!(points("1,2,3,-1\n", LeftMinusRight).unwrap_err().contains("-1 px"));
        let (_folder, args) = given("points.csv", "1,2,3", Some(-1.0));
        assert!(args.read((8, 6), LeftMinusRight).unwrap_err().to_string().contains("--prior-sigma"));
    }
}
