//! The label range of each pixel (section 2.4): labels near the disparities of its zone's matches.
//!
//! The paper models the matches of a zone as normally distributed, N(mu, sigma), and allows the labels in mu
//! +- sigma for all its pixels. That excludes many true disparities, so the multiple of sigma is a parameter
//! here.

use super::matches::SparseMatch;
use super::zones::Zones;
use crate::image::Plane;
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::plan::Plan;

/// A zone with fewer matches keeps the full range: so few give no reliable spread (the paper leaves this
/// open).
pub const MIN_MATCHES: usize = 10;

/// The smallest and the largest label of each pixel of one level. Labels are disparities in pixels of that level, not
/// indices: for an index, subtract the level's smallest label.
pub type LabelRanges = Plane<[i32; 2]>;

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
pub fn zonal(
    range: DisparityRange,
    zones: (&Plane<u32>, usize),
    matches: &[SparseMatch],
    k: f64,
) -> LabelRanges {
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
    let full = [range.min, range.max];
    let intervals: Vec<[i32; 2]> = sums
        .into_iter()
        .map(|(n, sum, squares)| {
            if n < MIN_MATCHES as i64 {
                return full;
            }
            let scale = n as f64 * f64::from(FRACTION);
            // n^2 times the variance, exactly.
            let variance = i128::from(n) * i128::from(squares) - i128::from(sum).pow(2);
            let (mu, reach) = (sum as f64 / scale, k * (variance as f64).sqrt() / scale);
            let low = ((mu - reach).floor() as i32).max(range.min);
            let high = ((mu + reach).ceil() as i32).min(range.max);
            if low <= high { [low, high] } else { full }
        })
        .collect();
    map.map(|zone| intervals.get(*zone as usize).copied().unwrap_or(full))
}

/// First and last label index of each pixel, at every level of `plan`, in the form for backends.
#[must_use]
pub fn levels(plan: &Plan, zones: &Zones, matches: &[SparseMatch]) -> Vec<Plane<[u16; 2]>> {
    let mut label_range =
        zonal(plan.range, (&zones.map, zones.count), matches, plan.method.front.zone_sigmas);
    let mut levels = Vec::new();
    for level in &plan.levels {
        if !levels.is_empty() {
            label_range = coarser(&label_range);
        }
        let index = |label: i32| (label - level.min).clamp(0, level.labels as i32 - 1) as u16;
        levels.push(label_range.map(|ends| ends.map(index)));
    }
    levels
}

/// The label range at the next coarser level: the hull of the intervals of a pixel's up to 2 x 2
/// children, in coarse labels (floor(low / 2) to ceil(high / 2)).
#[must_use]
pub fn coarser(fine: &LabelRanges) -> LabelRanges {
    let (width, height) = fine.size();
    Plane::from_fn(width.div_ceil(2), height.div_ceil(2), |x, y| {
        let rows = 2 * y..(2 * y + 2).min(height);
        let children = rows.flat_map(|v| &fine.row(v)[2 * x..(2 * x + 2).min(width)]);
        let hull = children.fold([i32::MAX, i32::MIN], |[low, high], [l, h]| [low.min(*l), high.max(*h)]);
        [hull[0].div_euclid(2), -(-hull[1]).div_euclid(2)]
    })
}
