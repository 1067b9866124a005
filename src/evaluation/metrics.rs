//! The error metrics.
//!
//! The error of a pixel is |estimate - truth| in pixels, computed in `f64`. A pixel counts when its truth is
//! known (finite) and it lies in the requested region. An estimate that is infinite or NaN is *invalid*: it
//! counts as bad at every threshold and is left out of all averages and quantiles.

use serde::{Serialize, Serializer};

use super::dataset::{GroundTruth, same_size};
use crate::error::{Error, Result};
use crate::image::Plane;

/// The thresholds of [`Metrics::bad`], in pixels of disparity.
pub const THRESHOLDS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];

/// The mask's value for a pixel that both views see.
pub(super) const VISIBLE: u8 = 255;

/// The errors of one map over one region.
///
/// In JSON the shares of bad pixels carry their thresholds: `bad0.5`, `bad1.0`, `bad2.0`, `bad4.0`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Pixels of the region whose truth is known.
    pub pixels: u64,
    /// Share of `pixels` with a valid estimate, in percent, rounded to four decimals.
    pub density: f64,
    /// Mean absolute error of the valid pixels; `None` when there are none.
    pub avg: Option<f64>,
    /// Root of the mean squared error of the valid pixels; `None` when there are none.
    pub rms: Option<f64>,
    /// 10 log10(255^2 / MSE) in dB, with the MSE of `rms`; `None` when no pixel is valid, and for a perfect
    /// map, where it is infinite.
    pub psnr: Option<f64>,
    /// Share of `pixels` in percent whose error is above each of [`THRESHOLDS`], or whose estimate is invalid.
    #[serde(flatten, serialize_with = "by_threshold")]
    pub bad: [f64; 4],
    /// Median of the absolute errors of the valid pixels; `None` when there are none.
    ///
    /// All quantiles interpolate linearly, as `numpy.quantile` does by default: of n errors in ascending order,
    /// counted from 0, the quantile q is the value at position (n - 1) q, on the line between its two neighbours.
    pub a50: Option<f64>,
    /// The error that 90 % of the valid pixels stay below, interpolated like `a50`.
    pub a90: Option<f64>,
    /// The error that 95 % of the valid pixels stay below, interpolated like `a50`.
    pub a95: Option<f64>,
    /// The error that 99 % of the valid pixels stay below, interpolated like `a50`.
    pub a99: Option<f64>,
}

/// The shares of bad pixels, each by the name of its threshold.
fn by_threshold<S: Serializer>(bad: &[f64; 4], serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(
        THRESHOLDS.iter().zip(bad).map(|(threshold, share)| (format!("bad{threshold:.1}"), share)),
    )
}

/// The errors of one map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Over every pixel whose truth is known.
    pub all: Metrics,
    /// Over those of these pixels that both views see (mask 255); `None` without a mask, or when no pixel is
    /// left.
    pub nonocc: Option<Metrics>,
}

impl GroundTruth {
    /// The errors of `estimate` (not finite = invalid) over all known pixels and, where there is a mask, over those that both
    /// views see.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the sizes differ or no truth is known.
    pub fn evaluate(&self, estimate: &Plane<f32>) -> Result<Report> {
        let all = self.measure(estimate, |_, _| true)?.ok_or_else(nothing_known)?;
        let nonocc = match &self.mask {
            Some(mask) => self.measure(estimate, |x, y| mask[(x, y)] == VISIBLE)?,
            None => None,
        };
        Ok(Report { all, nonocc })
    }

    /// The errors of `estimate` over the pixels (x, y) whose truth is known and for which `region(x, y)` holds; `None` when
    /// there is no such pixel.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the sizes differ.
    pub fn measure(
        &self,
        estimate: &Plane<f32>,
        region: impl Fn(usize, usize) -> bool,
    ) -> Result<Option<Metrics>> {
        let truth = &self.truth;
        same_size("disparity map", estimate.size(), truth.size())?;
        let mut pixels = 0_u64;
        let mut bad = [0_u64; 4];
        let mut errors = Vec::new();
        for y in 0..truth.height() {
            for (x, (&d, &t)) in estimate.row(y).iter().zip(truth.row(y)).enumerate() {
                if !t.is_finite() || !region(x, y) {
                    continue;
                }
                pixels += 1;
                let error = (f64::from(d) - f64::from(t)).abs();
                for (count, threshold) in bad.iter_mut().zip(THRESHOLDS) {
                    *count += u64::from(!d.is_finite() || error > threshold);
                }
                if d.is_finite() {
                    errors.push(error);
                }
            }
        }
        if pixels == 0 {
            return Ok(None);
        }
        let percent = |count: u64| 100.0 * count as f64 / pixels as f64;
        let density = four_decimals(percent(errors.len() as u64));
        let avg = average(errors.iter().copied().map(Some));
        let mse = average(errors.iter().map(|error| Some(error * error)));
        errors.sort_unstable_by(f64::total_cmp);
        Ok(Some(Metrics {
            pixels,
            density,
            avg,
            rms: mse.map(f64::sqrt),
            psnr: mse.filter(|&mse| mse > 0.0).map(|mse| 10.0 * (255.0 * 255.0 / mse).log10()),
            bad: bad.map(percent),
            a50: quantile(&errors, 0.50),
            a90: quantile(&errors, 0.90),
            a95: quantile(&errors, 0.95),
            a99: quantile(&errors, 0.99),
        }))
    }
}

/// The average of each field over several pairs, every pair with the same weight; `None` for no reports.
///
/// A mean is over all the pairs or `None`: a field that one of them lacks (`nonocc` without a mask, the PSNR
/// of a perfect map) is `None` in the mean. So no figure silently stands for fewer pairs than the figure next
/// to it. The mean of `pixels` is rounded to the nearest integer, that of `density` is not rounded.
pub fn mean<'a>(reports: impl IntoIterator<Item = &'a Report>) -> Option<Report> {
    let reports: Vec<&Report> = reports.into_iter().collect();
    let all = mean_metrics(&reports.iter().map(|r| &r.all).collect::<Vec<_>>())?;
    let nonocc = reports.iter().map(|r| r.nonocc.as_ref()).collect::<Option<Vec<_>>>();
    Some(Report { all, nonocc: nonocc.and_then(|m| mean_metrics(&m)) })
}

fn mean_metrics(metrics: &[&Metrics]) -> Option<Metrics> {
    let every = |field: fn(&Metrics) -> Option<f64>| average(metrics.iter().map(|m| field(m)));
    Some(Metrics {
        pixels: every(|m| Some(m.pixels as f64))?.round() as u64,
        density: every(|m| Some(m.density))?,
        avg: every(|m| m.avg),
        rms: every(|m| m.rms),
        psnr: every(|m| m.psnr),
        bad: [
            every(|m| Some(m.bad[0]))?,
            every(|m| Some(m.bad[1]))?,
            every(|m| Some(m.bad[2]))?,
            every(|m| Some(m.bad[3]))?,
        ],
        a50: every(|m| m.a50),
        a90: every(|m| m.a90),
        a95: every(|m| m.a95),
        a99: every(|m| m.a99),
    })
}

/// The average of all values; `None` when one is missing or there are none.
pub(super) fn average(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    let mut sum = Sum::default();
    let mut count = 0_u64;
    for value in values {
        sum.add(value?);
        count += 1;
    }
    (count > 0).then(|| sum.value() / count as f64)
}

/// Whether a pixel with known truth counts in `bad2.0`.
pub(super) fn is_bad(estimate: f32, truth: f32) -> bool {
    !estimate.is_finite() || (f64::from(estimate) - f64::from(truth)).abs() > THRESHOLDS[2]
}

/// `part` of `whole` in percent; `None` where `whole` is 0.
pub(super) fn percent(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| 100.0 * part / whole)
}

pub(super) fn nothing_known() -> Error {
    Error::Mismatch(
        "the ground truth holds no known (finite) pixel, so there is nothing to compare with".into(),
    )
}

/// `value` rounded to four decimals, through its exact decimal expansion (ties to even).
fn four_decimals(value: f64) -> f64 {
    format!("{value:.4}").parse().unwrap_or(value)
}

/// The quantile `q` of ascending values, linearly interpolated; `None` for no values.
fn quantile(ascending: &[f64], q: f64) -> Option<f64> {
    let last = ascending.len().checked_sub(1)?;
    let position = last as f64 * q;
    let below = (position.floor() as usize).min(last);
    let above = (below + 1).min(last);
    let (a, b) = (ascending[below], ascending[above]);
    Some(a + (b - a) * (position - below as f64))
}

/// A compensated sum (Neumaier): rounding errors are summed separately, so that long sums lose no digits.
#[derive(Clone, Copy, Default)]
pub(super) struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    pub(super) fn add(&mut self, value: f64) {
        let total = self.total + value;
        self.lost += if self.total.abs() >= value.abs() {
            (self.total - total) + value
        } else {
            (value - total) + self.total
        };
        self.total = total;
    }

    pub(super) fn value(self) -> f64 {
        self.total + self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::super::cases::{close, ground, row};
    use super::*;

    const INF: f32 = f32::INFINITY;

    /// The errors over all pixels of a row.
    fn all(estimate: &[f32], truth: &[f32]) -> Metrics {
        ground(&row(truth), None).evaluate(&row(estimate)).unwrap().all
    }

    fn close_all(got: [f64; 4], expected: [f64; 4]) {
        for (got, expected) in got.into_iter().zip(expected) {
            close(got, expected);
        }
    }

    #[test]
    fn a_case_computed_by_hand() {
        // errors 0, 0.5, 1.5, 3, 5: at a threshold is not above it
        let m = all(&[10.0, 10.5, 8.5, 13.0, 5.0], &[10.0; 5]);
        assert_eq!(m.pixels, 5);
        let mse = (0.25 + 2.25 + 9.0 + 25.0) / 5.0;
        for (got, expected) in [
            (Some(m.density), 100.0),
            (m.avg, 2.0),
            (m.rms, f64::sqrt(mse)),
            (m.psnr, 20.0 * f64::log10(255.0) - 10.0 * f64::log10(mse)),
            (m.a50, 1.5),
            (m.a90, 3.0 + 0.6 * 2.0),
            (m.a95, 3.0 + 0.8 * 2.0),
            (m.a99, 3.0 + 0.96 * 2.0),
        ] {
            close(got, expected);
        }
        close_all(m.bad, [60.0, 60.0, 40.0, 20.0]);
    }

    #[test]
    fn invalid_pixels_are_bad_everywhere_and_averaged_nowhere() {
        let m = all(&[4.25, 3.75, INF, f32::NAN, f32::NEG_INFINITY, 7.0], &[4.0; 6]);
        assert_eq!((m.pixels, m.density), (6, 50.0));
        close(m.avg, 3.5 / 3.0);
        close(m.rms, f64::sqrt((0.0625 + 0.0625 + 9.0) / 3.0));
        close_all(m.bad, [4.0, 4.0, 4.0, 3.0].map(|n| 100.0 * n / 6.0));
        close(m.a50, 0.25);
        // Without a valid pixel there are shares only.
        let m = all(&[INF, f32::NAN], &[1.0, 2.0]);
        assert_eq!((m.pixels, m.density, m.bad), (2, 0.0, [100.0; 4]));
        assert_eq!([m.avg, m.rms, m.psnr, m.a50, m.a90, m.a95, m.a99], [None; 7]);
    }

    #[test]
    fn unknown_truth_does_not_count() {
        let m = all(&[99.0, 3.0, INF, 5.0], &[INF, 3.0, f32::NAN, 3.0]);
        assert_eq!((m.pixels, m.density, m.avg, m.bad), (2, 100.0, Some(1.0), [50.0, 50.0, 0.0, 0.0]));
    }

    #[test]
    fn a_perfect_map_has_no_psnr() {
        let m = all(&[1.0, 2.5, -3.0], &[1.0, 2.5, -3.0]);
        assert_eq!((m.avg, m.rms, m.psnr, m.bad), (Some(0.0), Some(0.0), None, [0.0; 4]));
        assert_eq!((m.a50, m.a99), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn the_mask_selects_pixels_that_both_views_see() {
        let report = ground(&row(&[1.0, 1.0, INF, 1.0]), Some(&row(&[255, 128, 255, 255])))
            .evaluate(&row(&[1.0, 6.0, 9.0, 2.0]))
            .unwrap();
        let nonocc = report.nonocc.unwrap();
        assert_eq!((report.all.pixels, report.all.avg), (3, Some(2.0)));
        assert_eq!((nonocc.pixels, nonocc.avg, nonocc.bad), (2, Some(0.5), [50.0, 0.0, 0.0, 0.0]));
    }

    #[test]
    fn an_empty_region_has_no_metrics() {
        let truth = row(&[1.0, INF]);
        let ground = |mask| ground(&truth, mask);
        assert_eq!(ground(None).measure(&truth, |_, _| false).unwrap(), None);
        assert_eq!(ground(None).measure(&truth, |x, _| x == 1).unwrap(), None);
        assert_eq!(ground(Some(&row(&[128, 255]))).evaluate(&truth).unwrap().nonocc, None);
        let unknown = GroundTruth::new(row(&[INF, INF]), None).unwrap();
        assert!(matches!(unknown.evaluate(&truth), Err(Error::Mismatch(_))));
    }

    #[test]
    fn sizes_must_agree() {
        let truth = Plane::filled(3, 2, 0.0);
        let error = ground(&truth, None).evaluate(&Plane::filled(2, 3, 0.0)).unwrap_err().to_string();
        assert!(error.contains("disparity map is 2 x 3") && error.contains("truth 3 x 2"), "{error}");
        let error = GroundTruth::new(truth, Some(Plane::filled(3, 3, 255))).unwrap_err().to_string();
        assert!(error.contains("mask is 3 x 3") && error.contains("truth 3 x 2"), "{error}");
    }

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(quantile(&[7.0], 0.99), Some(7.0));
        assert_eq!(quantile(&[1.0, 2.0], 0.5), Some(1.5));
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 1.0), Some(4.0));
    }

    #[test]
    fn the_sum_keeps_what_plain_addition_loses() {
        let mut sum = Sum::default();
        for value in [1e16, 1.0, 1.0, -1e16] {
            sum.add(value);
        }
        close(sum.value(), 2.0);
    }

    #[test]
    fn means_are_over_all_pairs_or_none() {
        let truth = row(&[4.0, 4.0]);
        let masked = ground(&truth, Some(&row(&[255, 255])));
        let one = masked.evaluate(&row(&[5.0, 5.0])).unwrap();
        let two = masked.evaluate(&row(&[7.0, INF])).unwrap();
        let perfect = ground(&truth, None).evaluate(&truth).unwrap();

        let m = mean([&one, &two]).unwrap();
        assert_eq!(m.all.pixels, 2);
        close(m.all.density, 75.0);
        close(m.all.avg, 2.0);
        close(m.all.rms, 2.0);
        close(m.all.psnr, 20.0 * f64::log10(255.0) - 10.0 * f64::log10(9.0) / 2.0);
        close_all(m.all.bad, [100.0, 50.0, 50.0, 25.0]);
        close(m.all.a50, 2.0);
        assert_eq!(m.nonocc.as_ref(), Some(&m.all));

        let m = mean([&one, &perfect]).unwrap();
        close(m.all.avg, 0.5);
        assert_eq!((m.all.psnr, m.nonocc), (None, None));

        assert_eq!(mean([]), None);
    }

    #[test]
    fn json_names_carry_the_thresholds() {
        let report = ground(&row(&[1.0, 2.75]), None).evaluate(&row(&[1.0, 2.0])).unwrap();
        let json = serde_json::to_string(&report).unwrap();
        for part in [
            r#""all":{"pixels":2,"density":100.0,"avg":0.375,"rms":"#,
            r#""nonocc":null"#,
            r#""bad0.5":50.0,"bad1.0":0.0,"bad2.0":0.0,"bad4.0":0.0,"a50":0.375,"a90":"#,
        ] {
            assert!(json.contains(part), "{json}");
        }
    }

    #[test]
    fn density_has_four_decimals() {
        assert_eq!(all(&[1.0, INF, INF], &[1.0; 3]).density.to_string(), "33.3333");
    }
}
