//! The quality of a confidence map: sparsification curves, after Hu and Mordohai 2012, *A Quantitative
//! Evaluation of Confidence Measures for Stereo Vision*.
//!
//! The pixels with known truth are sorted by confidence, highest first. A good confidence puts the bad pixels
//! (wrong by more than 2 px, or invalid) last.

use serde::Serialize;

use super::dataset::{GroundTruth, same_size};
use super::metrics::{average, is_bad, nothing_known};
use crate::error::Result;
use crate::image::Plane;

/// Points of [`Sparsification::curve`].
pub const POINTS: usize = 20;

/// How well a confidence tells bad pixels from good ones; all in percent.
///
/// Pixels of equal confidence count by expectation: of a group of n pixels with b bad ones, the first k
/// contain k b / n of them. So the order of the pixels in the image does not matter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sparsification {
    /// Area under the curve: the mean over k = 1 ..= N of the share of bad pixels among the k most confident
    /// of N.
    pub auc: f64,
    /// The smallest possible `auc` for this map, where all bad pixels come last.
    pub optimal: f64,
    /// The `auc` of an uninformative confidence: the share of bad pixels among all.
    pub random: f64,
    /// The share of bad pixels among the most confident 5, 10, ... 100 %.
    pub curve: [f64; POINTS],
}

impl Sparsification {
    /// The average of each field over several pairs, every pair with the same weight; `None` for no pairs.
    #[must_use]
    pub fn mean(all: &[&Self]) -> Option<Self> {
        let every = |field: &dyn Fn(&Self) -> f64| average(all.iter().map(|s| Some(field(s))));
        let mut curve = [0.0; POINTS];
        for (i, share) in curve.iter_mut().enumerate() {
            *share = every(&|s| s.curve[i])?;
        }
        Some(Self {
            auc: every(&|s| s.auc)?,
            optimal: every(&|s| s.optimal)?,
            random: every(&|s| s.random)?,
            curve,
        })
    }
}

/// Pixels of equal confidence.
#[derive(Clone, Copy, Default)]
struct Group {
    pixels: u64,
    bad: u64,
}

impl GroundTruth {
    /// How well `confidence` (0 ..= 255, larger is more confident) tells the bad pixels of `estimate` (not finite = invalid)
    /// from the good ones, where the truth is known.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ or no truth is known.
    pub fn sparsify(&self, estimate: &Plane<f32>, confidence: &Plane<u8>) -> Result<Sparsification> {
        let truth = &self.truth;
        same_size("disparity map", estimate.size(), truth.size())?;
        same_size("confidence map", confidence.size(), truth.size())?;
        let (mut groups, mut all) = ([Group::default(); 256], Group::default());
        for ((&d, &t), &c) in estimate.data().iter().zip(truth.data()).zip(confidence.data()) {
            if t.is_finite() {
                for group in [&mut groups[usize::from(255 - c)], &mut all] {
                    group.pixels += 1;
                    group.bad += u64::from(is_bad(d, t));
                }
            }
        }
        let Group { pixels, bad } = all;
        if pixels == 0 {
            return Err(nothing_known());
        }
        let best = [Group { pixels: pixels - bad, bad: 0 }, Group { pixels: bad, bad }];
        Ok(Sparsification {
            auc: area(&groups),
            optimal: area(&best),
            random: 100.0 * bad as f64 / pixels as f64,
            curve: std::array::from_fn(|i| share(&groups, pixels as f64 * (i + 1) as f64 / POINTS as f64)),
        })
    }
}

/// The mean over all k of the share of bad pixels among the first k, in percent.
fn area(groups: &[Group]) -> f64 {
    let (mut before, mut bad, mut sum) = (0, 0.0, 0.0);
    for group in groups.iter().filter(|group| group.pixels > 0) {
        let rate = group.bad as f64 / group.pixels as f64;
        for k in 1..=group.pixels {
            sum += (bad + k as f64 * rate) / (before + k) as f64;
        }
        before += group.pixels;
        bad += group.bad as f64;
    }
    100.0 * sum / before as f64
}

/// The share of bad pixels among the first `count`, which may be a fraction, in percent.
fn share(groups: &[Group], count: f64) -> f64 {
    let (mut left, mut bad) = (count, 0.0);
    for group in groups.iter().filter(|group| group.pixels > 0) {
        let taken = left.min(group.pixels as f64);
        bad += taken * group.bad as f64 / group.pixels as f64;
        left -= taken;
    }
    100.0 * bad / count
}

#[cfg(test)]
mod tests {
    use super::super::cases::{close, ground, row};
    use super::*;
    use crate::Error;

    /// The sparsification of pixels that are bad or not, by their confidences.
    fn sparsified(bad: &[bool], confidence: &[u8]) -> Sparsification {
        let estimate: Vec<f32> = bad.iter().map(|&b| if b { 9.0 } else { 4.0 }).collect();
        let truth = row(&vec![4.0; bad.len()]);
        ground(&truth, None).sparsify(&row(&estimate), &row(confidence)).unwrap()
    }

    #[test]
    fn a_case_computed_by_hand() {
        // By confidence: bad | good, bad | good. Invalid counts as bad; unknown truth does not count.
        let truth = row(&[4.0, 4.0, 4.0, 4.0, f32::INFINITY]);
        let estimate = row(&[6.0, f32::INFINITY, 9.0, 4.0, 4.0]);
        let found = ground(&truth, None).sparsify(&estimate, &row(&[7, 200, 7, 0, 255])).unwrap();
        close(found.auc, 100.0 * (1.0 + 1.5 / 2.0 + 2.0 / 3.0 + 2.0 / 4.0) / 4.0);
        close(found.optimal, 100.0 * (0.0 + 0.0 + 1.0 / 3.0 + 2.0 / 4.0) / 4.0);
        close(found.random, 50.0);
        // 5 %, 25 %, 40 % (of 4 pixels: 1.6), 75 %, 100 %
        for (i, expected) in [(0, 100.0), (4, 100.0), (7, 100.0 * 1.3 / 1.6), (14, 200.0 / 3.0), (19, 50.0)] {
            close(found.curve[i], expected);
        }
    }

    #[test]
    fn the_perfect_confidence_is_optimal_and_a_constant_one_random() {
        let bad: Vec<bool> = (0..50).map(|i| i % 7 == 3).collect();
        let by = |confidence: fn(bool) -> u8| {
            sparsified(&bad, &bad.iter().map(|&b| confidence(b)).collect::<Vec<_>>())
        };
        let perfect = by(|bad| if bad { 3 } else { 90 });
        let constant = by(|_| 17);
        let inverted = by(|bad| if bad { 90 } else { 3 });
        close(perfect.auc, perfect.optimal);
        close(constant.auc, constant.random);
        assert!(constant.curve.iter().all(|share| (share - constant.random).abs() < 1e-9));
        assert!(perfect.auc < constant.auc && constant.auc < inverted.auc);
        assert!((inverted.optimal, inverted.random) == (perfect.optimal, perfect.random));
        // All pixels good, or all bad.
        let none = sparsified(&[false; 9], &[1, 2, 3, 4, 5, 6, 7, 8, 9]);
        assert_eq!((none.auc, none.optimal, none.random), (0.0, 0.0, 0.0));
        let all = sparsified(&[true; 3], &[1, 2, 2]);
        assert_eq!((all.auc, all.optimal, all.random), (100.0, 100.0, 100.0));
    }

    /// Small pseudo-random numbers.
    fn noise(state: &mut u32) -> u32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *state >> 16
    }

    #[test]
    fn prefixes_by_brute_force_agree_in_any_order() {
        let state = &mut 1;
        for case in 0..200 {
            let pixels = 1 + noise(state) as usize % 24;
            let mut all: Vec<(u8, bool)> = (0..pixels)
                .map(|_| ((noise(state) % (1 + case % 9)) as u8, noise(state).is_multiple_of(3)))
                .collect();
            let of = |all: &[(u8, bool)]| {
                let (confidence, bad): (Vec<u8>, Vec<bool>) = all.iter().copied().unzip();
                sparsified(&bad, &confidence)
            };
            let found = of(&all);

            // Each pixel counts with the average of its group.
            let rate = |confidence: u8| {
                let equals: Vec<bool> =
                    all.iter().filter(|(c, _)| *c == confidence).map(|(_, b)| *b).collect();
                equals.iter().filter(|b| **b).count() as f64 / equals.len() as f64
            };
            let mut expected: Vec<(u8, f64)> = all.iter().map(|&(c, _)| (c, rate(c))).collect();
            expected.sort_by_key(|(c, _)| 255 - c);
            let mean_share = |rates: &[f64]| {
                let prefix = |k: usize| rates[..k].iter().sum::<f64>() / k as f64;
                100.0 * (1..=rates.len()).map(prefix).sum::<f64>() / rates.len() as f64
            };
            close(found.auc, mean_share(&expected.iter().map(|(_, rate)| *rate).collect::<Vec<_>>()));
            let mut best: Vec<f64> = all.iter().map(|(_, bad)| f64::from(u8::from(*bad))).collect();
            best.sort_by(f64::total_cmp);
            close(found.optimal, mean_share(&best));
            assert!(found.optimal <= found.auc + 1e-9);

            for i in (1..pixels).rev() {
                all.swap(i, noise(state) as usize % (i + 1));
            }
            assert_eq!(of(&all), found);
        }
    }

    #[test]
    fn means_are_of_each_field() {
        let (one, two) = (sparsified(&[true, false], &[1, 2]), sparsified(&[true, false], &[2, 1]));
        let mean = Sparsification::mean(&[&one, &two]).unwrap();
        close(mean.auc, f64::midpoint(one.auc, two.auc));
        close(mean.curve[0], 50.0);
        assert_eq!(Sparsification::mean(&[&one]).unwrap(), one);
        assert_eq!(Sparsification::mean(&[]), None);
    }

    #[test]
    fn sizes_must_agree_and_some_truth_be_known() {
        let truth = row(&[1.0, 2.0]);
        let error = ground(&truth, None).sparsify(&truth, &row(&[1])).unwrap_err().to_string();
        assert!(error.contains("confidence map is 1 x 1"), "{error}");
        let unknown = ground(&row(&[f32::NAN; 2]), None);
        assert!(matches!(unknown.sparsify(&truth, &row(&[1, 2])), Err(Error::Mismatch(_))));
    }
}
