//! The disparities to search: as the user says, by a calibration, or by sparse matches.

use std::path::Path;

use mrfgs::front::check;
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::options::{DisparityRange, MAX_DISPARITY};
use mrfgs::{Error, Result};
use serde::Serialize;

/// What the user says of the range.
#[derive(clap::Args, Clone, Copy, Serialize)]
pub(super) struct Search {
    /// Largest disparity to search, in pixels, itself included; `auto` takes the range from sparse matches [default: ndisp
    /// - 1 of the calibration file, else auto]
    #[arg(long, value_name = "N|auto", allow_negative_numbers = true, value_parser = pixels_or_auto)]
    pub(super) max_disparity: Option<Largest>,
    /// Smallest disparity to search, in pixels; may be negative [default: 0, or that of the range found]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = pixels)]
    pub(super) min_disparity: Option<i32>,
}

/// The largest disparity to search.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Largest {
    Auto,
    #[serde(untagged)]
    Pixels(i32),
}

/// A range, and where it is from.
pub(super) struct Found {
    pub(super) range: DisparityRange,
    /// Whether sparse matches gave it.
    pub(super) by_matches: bool,
}

pub(super) fn pixels(text: &str) -> std::result::Result<i32, String> {
    text.parse().map_err(|_| format!("give a whole number of pixels within {MAX_DISPARITY} of 0"))
}

pub(super) fn pixels_or_auto(text: &str) -> std::result::Result<Largest, String> {
    if text == "auto" { Ok(Largest::Auto) } else { pixels(text).map(Largest::Pixels) }
}

impl Search {
    /// The range to search in `pair`; a `calibration` comes with its path.
    pub(super) fn range(&self, pair: &Pair, calibration: Option<(&Path, &Calibration)>) -> Result<Found> {
        let min = self.min_disparity.unwrap_or(0);
        let calibrated = || calibration.map_or(Ok(None), |(path, c)| super::calibrated_range(path, c, min));
        let given = match self.max_disparity {
            Some(Largest::Pixels(max)) => Some(DisparityRange::new(min, max)?),
            Some(Largest::Auto) => None,
            None => calibrated()?,
        };
        let range = given.map_or_else(|| self.by_matches(pair), Ok)?;
        let width = i64::from(u32::try_from(pair.size().0).unwrap_or(u32::MAX));
        if i64::from(range.min) >= width || i64::from(range.max) <= -width {
            let reason = format!(
                "no disparity from {} to {} is inside images {width} pixels wide; give those of the pair",
                range.min, range.max
            );
            return Err(Error::option("--max-disparity", reason));
        }
        Ok(Found { range, by_matches: given.is_none() })
    }

    fn by_matches(&self, pair: &Pair) -> Result<DisparityRange> {
        let found = check::range(pair).ok_or_else(|| {
            let reason =
                "give the largest disparity to search, in pixels: there are too few matches to find it";
            Error::option("--max-disparity", reason)
        })?;
        DisparityRange::new(self.min_disparity.unwrap_or(found.min), found.max)
    }
}
