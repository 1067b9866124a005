//! The disparity range to search: given by the user, by a calibration, or estimated from sparse matches.

use std::path::Path;
use std::str::FromStr;

use mrfgs::depth::Rig;
use mrfgs::image::calib::Calibration;
use mrfgs::options::{DisparityRange, MAX_DISPARITY};
use serde::Serialize;

use crate::args::cameras::above_zero;
use crate::args::sign::Sign;
use crate::failure::{self, Failure, Result};

/// The value of `--max-disparity`: a number of pixels, or `auto`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Largest {
    /// Estimate the range from sparse matches.
    Auto,
    /// A number of pixels within ±[`MAX_DISPARITY`].
    #[serde(untagged)]
    Pixels(i32),
}

impl FromStr for Largest {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { pixels(text).map(Self::Pixels) }
    }
}

/// Parses a disparity in pixels.
///
/// # Errors
/// A message with the accepted values, for anything but an integer within ±[`MAX_DISPARITY`].
pub fn pixels(text: &str) -> std::result::Result<i32, String> {
    let reach = -MAX_DISPARITY..=MAX_DISPARITY;
    let number = text.parse().ok().filter(|number| reach.contains(number));
    number.ok_or_else(|| format!("give a whole number of pixels within {MAX_DISPARITY} of 0"))
}

/// Flags of the disparity range.
#[derive(clap::Args, Clone, Copy, Default, Serialize)]
pub(crate) struct Search {
    /// Largest disparity to search, in pixels, inclusive; `auto` estimates the range from the images [default: ndisp - 1 of the calibration
    /// file, or auto without one]
    #[arg(long, value_name = "N|auto", allow_negative_numbers = true, value_parser = str::parse::<Largest>)]
    pub(crate) max_disparity: Option<Largest>,
    /// Smallest disparity to search, in pixels; may be negative [default: 0, or the estimated one]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = pixels)]
    pub(crate) min_disparity: Option<i32>,
    /// Nearest depth to search, in the unit of the baseline, instead of --max-disparity. Needs a calibration
    #[arg(long, value_name = "Z", allow_negative_numbers = true, conflicts_with = "max_disparity", value_parser = depth)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) min_depth: Option<f64>,
    /// Farthest depth to search, instead of --min-disparity
    #[arg(long, value_name = "Z", allow_negative_numbers = true, conflicts_with = "min_disparity", value_parser = depth)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) max_depth: Option<f64>,
}

/// Parses a depth.
pub(crate) fn depth(text: &str) -> std::result::Result<f64, String> {
    above_zero(text).ok_or_else(|| "give a number above 0, in the unit of the baseline".into())
}

impl From<DisparityRange> for Search {
    fn from(DisparityRange { min, max }: DisparityRange) -> Self {
        Self { max_disparity: Some(Largest::Pixels(max)), min_disparity: Some(min), ..Self::default() }
    }
}

/// The range to search, and where it comes from.
pub(crate) struct ResolvedRange {
    pub(crate) range: DisparityRange,
    /// Whether it was estimated from sparse matches.
    pub(crate) by_matches: bool,
}

impl Search {
    /// Whether a calibration can affect the range.
    pub(crate) fn takes_calibration(&self) -> bool {
        self.max_disparity.is_none() || self.takes_cameras().is_some()
    }

    /// The flag that needs camera values, if it was given.
    pub(crate) fn takes_cameras(&self) -> Option<&'static str> {
        let nearest = self.min_depth.map(|_| "--min-depth");
        nearest.or(self.max_depth.map(|_| "--max-depth"))
    }

    /// The range that `--max-disparity` gives, for flags that count by `sign`; `None` without it or for an invalid range.
    pub(crate) fn given(&self, sign: Sign) -> Option<DisparityRange> {
        let Some(Largest::Pixels(max)) = self.max_disparity else { return None };
        DisparityRange::new(self.min_disparity.unwrap_or(max.min(0)), max).ok().map(|range| sign.range(range))
    }

    /// The disparities of `--min-depth` and `--max-depth`, rounded outward so that both depths are searched.
    fn of_depths(&self, calibration: Option<(&Path, &Calibration)>) -> Result<[Option<i32>; 2]> {
        let Some(flag) = self.takes_cameras() else { return Ok([None, None]) };
        if let (Some(nearest), Some(farthest)) = (self.min_depth, self.max_depth)
            && nearest > farthest
        {
            return Err(Failure::usage(
                "--max-depth",
                format!("{farthest} is nearer than --min-depth {nearest}"),
            ));
        }
        let (path, calibration) = calibration.ok_or_else(|| {
            Failure::usage(flag, "needs a calibration; add --calib FILE, or use --max-disparity")
        })?;
        let rig = Rig::new(calibration).map_err(|e| failure::in_file(e, path, ""))?;
        // The cast saturates, so a huge disparity is refused later as out of range.
        let nearest = self.min_depth.map(|depth| rig.disparity(depth).ceil() as i32);
        Ok([nearest, self.max_depth.map(|depth| rig.disparity(depth).floor() as i32)])
    }

    /// The range to search in a pair of this `width`, for flags that count by `sign`. `calibration` comes with its path. `find` gives the
    /// range of its sparse matches, with the offset of the principal points if that is known.
    pub(crate) fn range(
        &self,
        width: usize,
        calibration: Option<(&Path, &Calibration)>,
        sign: Sign,
        find: impl FnOnce(Option<f64>) -> Result<DisparityRange>,
    ) -> Result<ResolvedRange> {
        let (max, auto) = match self.max_disparity {
            Some(Largest::Pixels(max)) => (Some(max), false),
            other => (None, other.is_some()),
        };
        // Infinity has disparity 0, so the far end defaults to 0 with either sign.
        let (near, far) = match sign {
            Sign::LeftMinusRight => (max, self.min_disparity),
            Sign::RightMinusLeft => (self.min_disparity, max),
        };
        let [nearest, farthest] = self.of_depths(calibration)?.map(|end| end.map(|end| sign.disparity(end)));
        let (near, far) = (nearest.or(near), farthest.or(far));
        let between = |near: i32, far: i32| {
            let range = match sign {
                Sign::LeftMinusRight => DisparityRange::new(far, near),
                Sign::RightMinusLeft => DisparityRange::new(near, far),
            };
            range.map(|range| sign.range(range))
        };
        let given = match near {
            Some(near) if !auto => Some(between(near, far.unwrap_or(0))?),
            None if !auto => calibration
                .map_or(Ok(None), |(path, c)| calibrated_range(path, c, sign.disparity(far.unwrap_or(0))))?,
            _ => None,
        };
        let range = if let Some(range) = given {
            range
        } else {
            let found = find(calibration.and_then(|(_, calibration)| calibration.doffs))?;
            let [farthest, nearest] = [found.min, found.max].map(|end| sign.disparity(end));
            between(near.unwrap_or(nearest), far.unwrap_or(farthest))?
        };
        // Checked in the user's sign, so that a message quotes the user's numbers.
        sign.range(range).within(width)?;
        Ok(ResolvedRange { range, by_matches: given.is_none() })
    }
}

/// The range from `min` to `ndisp` - 1 of the `calibration` in the file `path`; `None` without `ndisp`.
pub(crate) fn calibrated_range(
    path: &Path,
    calibration: &Calibration,
    min: i32,
) -> mrfgs::Result<Option<DisparityRange>> {
    let Some(ndisp) = calibration.ndisp else { return Ok(None) };
    let max = i32::try_from(ndisp).unwrap_or(i32::MAX) - 1;
    let range = DisparityRange::new(min, max);
    range.map(Some).map_err(|e| failure::in_file(e, path, &format!("ndisp={ndisp}: ")))
}
