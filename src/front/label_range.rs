//! The label range of each pixel (section 2.4): labels near the disparities of its zone's matches.
//!
//! The paper models the matches of a zone as normally distributed, N(mu, sigma), and allows the labels in mu
//! +- sigma for all its pixels. That excludes many true disparities, so the multiple of sigma is a parameter
//! here.

use super::matches::Match;
use super::zones::Zones;
use crate::image::Plane;
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::plan::Plan;

/// A zone with fewer matches keeps the full range: so few give no reliable spread (the paper leaves this
/// open).
pub const MIN_MATCHES: usize = 10;

/// An interval of labels for each pixel of one level. Labels are disparities in pixels of that level, not
/// indices: for an index, subtract the level's smallest label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelRanges {
    /// Smallest label of each pixel.
    pub low: Plane<i32>,
    /// Largest label of each pixel, not below `low`.
    pub high: Plane<i32>,
}

/// The label range at level 0: in each zone mu +- `k` sigma of the disparities of its `matches`, rounded
/// outwards and clipped to `range`. `k` is not negative; the paper uses 1.
///
/// `zones` is a map of zone indices and their number. The full range remains for a pixel whose index is out
/// of range, and for zones that have fewer than [`MIN_MATCHES`] matches or whose interval does not meet
/// `range`. Sigma is that of the matches themselves (divided by n).
///
/// # Panics
/// When a match lies outside the map of zones.
#[must_use]
pub fn zonal(range: DisparityRange, zones: (&Plane<u32>, usize), matches: &[Match], k: f64) -> LabelRanges {
    let (map, count) = zones;
    // Number, sum and sum of squares: integers, so that their order does not matter.
    let mut sums = vec![(0_i64, 0_i64, 0_i64); count];
    for m in matches {
        if let Some((n, sum, squares)) = sums.get_mut(map[(m.x, m.y)] as usize) {
            let d = i64::from(m.disparity);
            *n += 1;
            *sum += d;
            *squares += d * d;
        }
    }
    let intervals: Vec<(i32, i32)> = sums
        .into_iter()
        .map(|(n, sum, squares)| {
            let full = (range.min, range.max);
            if n < MIN_MATCHES as i64 {
                return full;
            }
            let scale = n as f64 * f64::from(FRACTION);
            // n^2 times the variance, exactly.
            let variance = i128::from(n) * i128::from(squares) - i128::from(sum).pow(2);
            let (mu, reach) = (sum as f64 / scale, k * (variance as f64).sqrt() / scale);
            let low = ((mu - reach).floor() as i32).max(range.min);
            let high = ((mu + reach).ceil() as i32).min(range.max);
            if low <= high { (low, high) } else { full }
        })
        .collect();
    let interval = |zone: &u32| intervals.get(*zone as usize).copied().unwrap_or((range.min, range.max));
    LabelRanges { low: map.map(|zone| interval(zone).0), high: map.map(|zone| interval(zone).1) }
}

/// First and last label index of each pixel, at every level of `plan`, in the form that backends take.
#[must_use]
pub fn levels(plan: &Plan, zones: &Zones, matches: &[Match]) -> Vec<Plane<[u16; 2]>> {
    let mut label_range =
        zonal(plan.range, (&zones.map, zones.count), matches, plan.method.front.zone_sigmas);
    let mut levels = Vec::new();
    for level in &plan.levels {
        if !levels.is_empty() {
            label_range = label_range.coarser();
        }
        let index = |label: i32| (label - level.min).clamp(0, level.labels as i32 - 1) as u16;
        levels.push(Plane::from_fn(level.width, level.height, |x, y| {
            [index(label_range.low[(x, y)]), index(label_range.high[(x, y)])]
        }));
    }
    levels
}

impl LabelRanges {
    /// The label range at the next coarser level: the hull of the intervals of a pixel's up to 2 x 2
    /// children, in coarse labels (floor(low / 2) to ceil(high / 2)).
    #[must_use]
    pub fn coarser(&self) -> Self {
        let (width, height) = self.low.size();
        let hull = |plane: &Plane<i32>, pick: fn(i32, i32) -> i32, halve: fn(i32) -> i32| {
            Plane::from_fn(width.div_ceil(2), height.div_ceil(2), |x, y| {
                let right = (2 * x + 1).min(width - 1);
                let below = (2 * y + 1).min(height - 1);
                let above = pick(plane[(2 * x, 2 * y)], plane[(right, 2 * y)]);
                halve(pick(above, pick(plane[(2 * x, below)], plane[(right, below)])))
            })
        };
        Self {
            low: hull(&self.low, i32::min, |low| low.div_euclid(2)),
            high: hull(&self.high, i32::max, |high| -(-high).div_euclid(2)),
        }
    }

    /// Total number of allowed labels over all pixels.
    #[must_use]
    pub fn labels(&self) -> u64 {
        self.low.data().iter().zip(self.high.data()).map(|(low, high)| (high - low + 1) as u64).sum()
    }
}
