//! The cameras of a rectified pair, given on the command line.

use std::str::FromStr;

use mrfgs::image::calib::{Calibration, Camera, Unit};
use serde::{Serialize, Serializer};

/// Why the cameras are read: an output or a prior that takes them.
pub(crate) struct CameraNeed {
    /// Its name in messages, a flag.
    pub(crate) flag: String,
    /// Whether it needs the unit of the baseline.
    pub(crate) unit: bool,
    /// Whether it uses the cameras if they are known, but does without.
    pub(crate) optional: bool,
}

impl CameraNeed {
    /// The first need that cannot do without cameras, else the first.
    pub(crate) fn strictest(needs: [Option<Self>; 2]) -> Option<Self> {
        needs.into_iter().flatten().min_by_key(|need| need.optional)
    }
}

/// Flags that give the cameras of a rectified pair in place of a calibration file.
#[derive(clap::Args, Clone, Copy, Serialize)]
pub(crate) struct CameraArgs {
    /// Focal length of the rectified pair in pixels. With --baseline it replaces --calib for depth and points; the principal point is then
    /// the centre of the image
    #[arg(
        long,
        value_name = "PIXELS",
        requires = "baseline",
        conflicts_with = "calib",
        allow_negative_numbers = true,
        value_parser = focal_length
    )]
    focal: Option<f64>,
    /// Distance between the cameras, with --focal: 120mm, 12cm, 0.12m, or a bare number, whose unit then applies to all depths
    #[arg(
        long,
        value_name = "LENGTH",
        requires = "focal",
        conflicts_with = "calib",
        allow_negative_numbers = true,
        value_parser = str::parse::<Baseline>
    )]
    baseline: Option<Baseline>,
}

impl CameraArgs {
    /// The calibration of images of `size` (width, height); `None` without these flags.
    pub(crate) fn calibration(&self, size: (usize, usize)) -> Option<Calibration> {
        let (focal, Baseline { length, unit }) = self.focal.zip(self.baseline)?;
        Some(Calibration::of_cameras(Camera::centred(focal, size), length, unit))
    }

    /// The name of the flag if it was given, for messages.
    pub(crate) fn flag(&self) -> Option<&'static str> {
        self.focal.map(|_| "--focal")
    }
}

/// The distance between the two cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Baseline {
    length: f64,
    unit: Unit,
}

impl Serialize for Baseline {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (self.length, self.unit.name()).serialize(to)
    }
}

impl FromStr for Baseline {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // Millimetres and centimetres come first because their names also end in "m".
        let units = [Unit::Millimetre, Unit::Centimetre, Unit::Metre];
        let with_unit = units.into_iter().find_map(|unit| Some((text.strip_suffix(unit.name())?, unit)));
        let (number, unit) = with_unit.unwrap_or((text, Unit::Unknown));
        let length =
            above_zero(number.trim()).ok_or("give a length above 0, such as 120mm, 12cm or 0.12m")?;
        Ok(Self { length, unit })
    }
}

fn focal_length(text: &str) -> Result<f64, String> {
    above_zero(text).ok_or_else(|| "give a number of pixels above 0".into())
}

/// A number above 0.
pub(crate) fn above_zero(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| *number > 0.0 && number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_baseline_may_say_its_unit() {
        for (text, length, unit) in [
            ("120mm", 120.0, Unit::Millimetre),
            ("12 cm", 12.0, Unit::Centimetre),
            ("0.12m", 0.12, Unit::Metre),
            ("1.2e-1", 0.12, Unit::Unknown),
        ] {
            assert_eq!(text.parse(), Ok(Baseline { length, unit }), "{text}");
        }
        for text in ["", "mm", "0", "-5cm", "inf", "NaN", "12in", "1 2"] {
            assert!(text.parse::<Baseline>().is_err(), "{text}");
        }
    }
}
