//! The sign convention of disparities.

use clap::ValueEnum;
use mrfgs::check::Warning;
use mrfgs::image::Plane;
use mrfgs::options::DisparityRange;
use serde::Serialize;

/// The user's sign convention. The library always uses the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Sign {
    /// x in LEFT minus x in RIGHT: near is large
    #[default]
    LeftMinusRight,
    /// x in RIGHT minus x in LEFT, as in the Ames Stereo Pipeline
    RightMinusLeft,
}

impl Sign {
    /// Converts a disparity between the conventions of the library and the user, in either direction.
    pub(crate) fn disparity(self, disparity: i32) -> i32 {
        match self {
            Self::LeftMinusRight => disparity,
            Self::RightMinusLeft => -disparity,
        }
    }

    /// Converts a range, in either direction.
    pub(crate) fn range(self, DisparityRange { min, max }: DisparityRange) -> DisparityRange {
        let ends = [min, max].map(|end| self.disparity(end));
        DisparityRange { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) }
    }

    /// Converts a map, in either direction; non-finite values are kept.
    pub(crate) fn map(self, map: Plane<f32>) -> Plane<f32> {
        match self {
            Self::LeftMinusRight => map,
            Self::RightMinusLeft => map.map(|&d| if d.is_finite() { -d } else { d }),
        }
    }

    /// Converts a warning to the user's convention.
    pub(crate) fn warning(self, warning: Warning) -> Warning {
        match warning {
            Warning::Clipped { end, upper, percent } => Warning::Clipped {
                end: self.disparity(end),
                upper: upper == (self == Self::LeftMinusRight),
                percent,
            },
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_sign_mirrors_what_is_said() {
        let range = DisparityRange::new(-3, 20).unwrap();
        assert_eq!(Sign::LeftMinusRight.range(range), range);
        assert_eq!(Sign::RightMinusLeft.range(range), DisparityRange::new(-20, 3).unwrap());
        let clipped = |end, upper| Warning::Clipped { end, upper, percent: 9 };
        assert_eq!(Sign::RightMinusLeft.warning(clipped(20, true)), clipped(-20, false));
        assert_eq!(Sign::RightMinusLeft.warning(clipped(-3, false)), clipped(3, true));
        assert_eq!(Sign::LeftMinusRight.warning(clipped(20, true)), clipped(20, true));
        assert_eq!(Sign::RightMinusLeft.warning(Warning::Identical), Warning::Identical);
    }
}
