//! How reliable a rectification by matches alone is.

use std::fmt;

use super::doubts::Doubt;

/// How reliable a rectification from matches alone is. It displays as one line.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Trust {
    /// Number of matches.
    pub matches: usize,
    /// Matches that agree: after rectification they are on the same row, up to 1.5 px or 1/800 of the image's longer side.
    pub agreeing: usize,
    /// Median row distance of the agreeing matches, in pixels of the rectified views.
    pub median: f64,
    /// The 95th percentile of that distance.
    pub percentile95: f64,
    /// The share of 8 x 8 parts of the left image with an agreeing match, from 0 to 1.
    pub coverage: f64,
    /// The share of agreeing matches that no single plane explains, from 0 to 1.
    pub off_one_plane: f64,
}

impl fmt::Display for Trust {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "{} of {} matches agree; their rows are {:.2} px apart in the median and {:.2} px in 95 %; they are in {:.0} % of the image",
            self.agreeing,
            self.matches,
            self.median,
            self.percentile95,
            100.0 * self.coverage
        )
    }
}

impl Trust {
    /// The doubts about a rectification that was not refused.
    pub(super) fn doubts(&self, tolerance: f64) -> Vec<Doubt> {
        const AGREEING: f64 = 0.7;
        const COVERAGE: f64 = 0.4;
        const ROWS: f64 = 2.0 / 3.0;
        const OFF_ONE_PLANE: f64 = 0.15;
        let agreeing = self.agreeing as f64 / self.matches as f64;
        let percent = |share: f64| (100.0 * share).round() as u32;
        let doubts = [
            (agreeing < AGREEING).then(|| Doubt::FewAgree { percent: percent(agreeing) }),
            (self.percentile95 > tolerance * ROWS).then_some(Doubt::RowsApart { pixels: self.percentile95 }),
            (self.coverage < COVERAGE).then(|| Doubt::Coverage { percent: percent(self.coverage) }),
            (self.off_one_plane < OFF_ONE_PLANE)
                .then(|| Doubt::NearlyFlat { percent: percent(self.off_one_plane) }),
        ];
        doubts.into_iter().flatten().collect()
    }
}
