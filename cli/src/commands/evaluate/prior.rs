//! `--prior-from-truth`: a simulated prior of points, sampled from the ground truth.

use std::sync::Arc;

use mrfgs::Prior;
use mrfgs::evaluation::GroundTruth;
use mrfgs::prior::{PriorKind, PriorPoint};

/// Points that are sampled from the ground truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SampledPoints {
    /// Share of the known pixels that are given.
    share: f64,
    /// Standard deviation of their noise in px.
    noise: f64,
    /// Share of the points that have a random disparity.
    outliers: f64,
    /// Number of image rows that the points lie in, like those of a lidar; 0 for all.
    rows: usize,
}

impl SampledPoints {
    /// Reads `SHARE[,NOISE[,OUTLIERS[,ROWS]]]`.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let bad = "give the share of the pixels, and if you like the noise in pixels, the share of outliers and the rows, such as 0.01,0.5,0.2,16";
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        let numbers = numbers.filter(|numbers| (1..=4).contains(&numbers.len())).ok_or(bad)?;
        let number = |i: usize| numbers.get(i).copied().unwrap_or(0.0);
        let [share, noise, outliers, rows] = [number(0), number(1), number(2), number(3)];
        let shares = [share, outliers].iter().all(|share| (0.0..=1.0).contains(share));
        let fits =
            shares && (0.0..=100.0).contains(&noise) && (0.0..=1e6).contains(&rows) && rows.fract() == 0.0;
        if fits { Ok(Self { share, noise, outliers, rows: rows as usize }) } else { Err(bad.into()) }
    }

    /// Samples points by `seed`. Returns the prior, and the ground truth without the sampled pixels.
    pub(super) fn sample(self, ground: &GroundTruth, seed: u64) -> mrfgs::Result<(Arc<Prior>, GroundTruth)> {
        let mut truth = ground.truth().clone();
        let (width, height) = truth.size();
        let known = truth.data().iter().filter(|d| d.is_finite());
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (least, most) = known.fold(ends, |(least, most), &d| (least.min(d.into()), most.max(d.into())));
        let mut random = Random(seed);
        // Evenly spaced rows.
        let is_row = |y: usize| self.rows == 0 || (y + 1) * self.rows / height != y * self.rows / height;
        let mut points = Vec::new();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let d = f64::from(truth[(x, y)]);
            if !d.is_finite() || !is_row(y) || random.uniform() >= self.share {
                continue;
            }
            let disparity = if random.uniform() < self.outliers {
                least + random.uniform() * (most - least)
            } else {
                d + self.noise * random.normal()
            };
            points.push(PriorPoint {
                x: x as f64,
                y: y as f64,
                disparity,
                sigma: self.noise.max(PriorKind::Points.usual_sigma()),
            });
            truth[(x, y)] = f32::INFINITY;
        }
        let prior = Prior::points((width, height), points)?;
        Ok((Arc::new(prior), GroundTruth::new(truth, ground.mask().cloned())?))
    }
}

/// Random numbers that are the same everywhere (`SplitMix64`).
struct Random(u64);

impl Random {
    /// From 0 to below 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of mean 0 and variance 1: the sum of twelve uniform numbers, less its mean.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mrfgs::image::Plane;

    #[test]
    fn given_points_leave_the_truth() {
        let truth = Plane::from_fn(60, 40, |x, _| if x < 10 { f32::INFINITY } else { x as f32 });
        let ground = GroundTruth::new(truth, None).unwrap();
        let of = |text: &str, seed| SampledPoints::parse(text).unwrap().sample(&ground, seed).unwrap();
        let (prior, rest) = of("0.1", 1);
        let left = rest.truth().data().iter().filter(|d| d.is_finite()).count();
        assert_eq!(prior.count() + left, 50 * 40);
        assert!((150..250).contains(&prior.count()), "{}", prior.count());
        assert_eq!(of("0.1", 1).0, prior);
        assert_ne!(of("0.1", 2).0, prior);
        assert_eq!(of("1,0,0,4", 1).0.count(), 4 * 50);
    }

    #[test]
    fn bad_samples_are_refused() {
        for text in ["", "a", "2", "-0.1", "0.1,-1", "0.1,0,2", "0.1,0,0,1.5", "0.1,0,0,4,5", "nan"] {
            assert!(SampledPoints::parse(text).is_err(), "{text}");
        }
    }
}
