//! Which way disparities count.

use clap::ValueEnum;
use mrfgs::check::Warning;
use mrfgs::image::Plane;
use mrfgs::options::DisparityRange;
use serde::Serialize;

/// Which way disparities count for the user. The library always counts by the default.
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
    /// A disparity of the library as the user counts it, or the other way round.
    pub(crate) fn disparity(self, disparity: i32) -> i32 {
        match self {
            Self::LeftMinusRight => disparity,
            Self::RightMinusLeft => -disparity,
        }
    }

    /// The same for a range.
    pub(crate) fn range(self, DisparityRange { min, max }: DisparityRange) -> DisparityRange {
        let ends = [min, max].map(|end| self.disparity(end));
        DisparityRange { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) }
    }

    /// The same for a map; what is not finite stays as it is.
    pub(crate) fn map(self, map: Plane<f32>) -> Plane<f32> {
        match self {
            Self::LeftMinusRight => map,
            Self::RightMinusLeft => map.map(|&d| if d.is_finite() { -d } else { d }),
        }
    }

    /// A warning about the user's range.
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
