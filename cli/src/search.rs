//! The disparities to search: as the user says, by a calibration, or by sparse matches.

use std::path::Path;

use crate::list::{self, Largest};
use mrfgs::Result;
use mrfgs::error::RangeError;
use mrfgs::front::check;
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::options::DisparityRange;
use serde::Serialize;

use crate::sign::Sign;

/// What the user says of the range.
#[derive(clap::Args, Clone, Copy, Serialize)]
pub(super) struct Search {
    /// Largest disparity to search, in pixels, itself included; `auto` takes the range from sparse matches [default: ndisp
    /// - 1 of the calibration file, else auto]
    #[arg(long, value_name = "N|auto", allow_negative_numbers = true, value_parser = str::parse::<Largest>)]
    pub(super) max_disparity: Option<Largest>,
    /// Smallest disparity to search, in pixels; may be negative [default: 0, or that of the range found]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = list::pixels)]
    pub(super) min_disparity: Option<i32>,
}

/// A range, and where it is from.
pub(super) struct Found {
    pub(super) range: DisparityRange,
    /// Whether sparse matches gave it.
    pub(super) by_matches: bool,
}

impl Search {
    /// The range to search in `pair`, where the user counts by `sign`; a `calibration` comes with its path.
    pub(super) fn range(
        &self,
        pair: &Pair,
        calibration: Option<(&Path, &Calibration)>,
        sign: Sign,
    ) -> Result<Found> {
        let (max, auto) = match self.max_disparity {
            Some(Largest::Pixels(max)) => (Some(max), false),
            other => (None, other.is_some()),
        };
        // What is far is at 0 unless told otherwise, whichever end of the range that is.
        let (near, far) = match sign {
            Sign::LeftMinusRight => (max, self.min_disparity),
            Sign::RightMinusLeft => (self.min_disparity, max),
        };
        let between = |near: i32, far: i32| {
            let range = match sign {
                Sign::LeftMinusRight => DisparityRange::new(far, near),
                Sign::RightMinusLeft => DisparityRange::new(near, far),
            };
            range.map(|range| sign.range(range))
        };
        let given = match near {
            Some(near) if !auto => Some(between(near, far.unwrap_or(0))?),
            None if !auto => calibration.map_or(Ok(None), |(path, c)| {
                crate::calibrated_range(path, c, sign.disparity(far.unwrap_or(0)))
            })?,
            _ => None,
        };
        let range = if let Some(range) = given {
            range
        } else {
            let found = by_matches(pair)?;
            let [farthest, nearest] = [found.min, found.max].map(|end| sign.disparity(end));
            between(near.unwrap_or(nearest), far.unwrap_or(farthest))?
        };
        sign.range(range).within(pair.size().0)?;
        Ok(Found { range, by_matches: given.is_none() })
    }
}

fn by_matches(pair: &Pair) -> Result<DisparityRange> {
    check::range(pair)?.ok_or_else(|| RangeError::NotFound.into())
}
