//! The figures that the paper prints, for comparison with ours.

use serde::Serialize;

use super::Metrics;

/// The source of the figures in [`published`].
pub const SOURCE: &str = "Shabanian and Balasubramanian, Multi-Resolution Factor Graph Based Stereo \
    Correspondence Algorithm, Tables 1 and 2";

/// The paper's metrics of a map, over all pixels with known truth, occluded ones included.
///
/// In JSON the share of bad pixels carries its threshold: `bad2.0`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Mean absolute error in pixels.
    pub avg: Option<f64>,
    /// PSNR against 255 in dB.
    pub psnr: Option<f64>,
    /// Share of pixels whose error is above 2 px, in percent.
    #[serde(rename = "bad2.0")]
    pub bad2: f64,
}

impl From<&Metrics> for Figures {
    fn from(metrics: &Metrics) -> Self {
        Self { avg: metrics.avg, psnr: metrics.psnr, bad2: metrics.bad[2] }
    }
}

/// The figures that the paper prints for one map of a pair, by its two methods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Published {
    /// FGS, the factor graph of a single resolution.
    pub fgs: Figures,
    /// MR-FGS, the factor graph of several resolutions.
    #[serde(rename = "mr-fgs")]
    pub mr_fgs: Figures,
}

/// Avg. err, PSNR and Bad2.0 of FGS, then those of MR-FGS.
type Printed = [f64; 6];

/// Pair, its line in Table 1 (raw), its line in Table 2 (after post-processing).
const PRINTED: [(&str, [Printed; 2]); 5] = [
    ("Teddy", [[2.60, 32.02, 14.17, 2.09, 32.43, 13.90], [1.90, 33.25, 9.55, 1.69, 33.29, 9.24]]),
    ("Cones", [[2.78, 32.35, 17.60, 2.29, 35.14, 16.52], [2.32, 33.33, 15.11, 1.98, 33.43, 15.06]]),
    ("Dolls", [[3.20, 30.75, 22.47, 2.63, 35.11, 18.50], [2.04, 32.52, 18.98, 1.81, 38.27, 16.21]]),
    ("Rocks1", [[3.29, 30.15, 13.58, 3.21, 33.31, 11.96], [2.78, 31.10, 12.06, 2.20, 33.64, 11.91]]),
    ("Motorcycle", [[3.81, 29.45, 20.04, 3.40, 29.90, 19.53], [3.36, 30.02, 18.87, 3.09, 30.84, 18.25]]),
];

/// The paper's figures for `pair`, in upper or lower case: of the raw map (Table 1) and of the final one
/// (Table 2).
#[must_use]
pub fn published(pair: &str) -> Option<[Published; 2]> {
    let (_, tables) = PRINTED.iter().find(|(name, _)| name.eq_ignore_ascii_case(pair))?;
    let figures = |[avg, psnr, bad2]: [f64; 3]| Figures { avg: Some(avg), psnr: Some(psnr), bad2 };
    Some(tables.map(|[a, b, c, d, e, f]| Published { fgs: figures([a, b, c]), mr_fgs: figures([d, e, f]) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_found_by_name() {
        let [raw, finished] = published("Motorcycle").unwrap();
        assert_eq!(raw.mr_fgs, Figures { avg: Some(3.40), psnr: Some(29.90), bad2: 19.53 });
        assert_eq!(finished.fgs, Figures { avg: Some(3.36), psnr: Some(30.02), bad2: 18.87 });
        assert_eq!(published("teddy"), published("Teddy"));
        assert_eq!(published("Aloe"), None);
    }

    #[test]
    fn json_names_carry_the_threshold() {
        let json = serde_json::to_value(published("Cones").unwrap()[1]).unwrap();
        assert_eq!(json["mr-fgs"], serde_json::json!({"avg": 1.98, "psnr": 33.43, "bad2.0": 15.06}));
    }
}
