//! K-means in integers: exact, so the same everywhere.
//!
//! Lloyd's iteration from the random starts of Arthur and Vassilvitskii, *k-means++* (2007).
//! `linfa-clustering` was considered and rejected: its default start depends on how threads share the work,
//! its update counts the old centroid as one more point, and it brings 27 crates for a result that the next
//! version of any of them might change.

use rayon::prelude::*;

use super::Options;

/// The centroids of the points, whose `dimensions` values are up to 512 in size, one after the other. There
/// are at most `count` of them, and fewer where there are fewer different points. The replicate with the
/// smallest sum of squared distances is taken, the first one on a tie.
pub(super) fn cluster(points: &[i16], dimensions: usize, count: usize, options: &Options) -> Vec<Vec<i16>> {
    let points: Vec<&[i16]> = points.chunks_exact(dimensions).collect();
    (0..options.replicates.max(1) as u64)
        .into_par_iter()
        .map(|replicate| {
            let mut random = Random(options.seed.wrapping_add(replicate << 32));
            let (inertia, centroids) =
                lloyd(&points, starts(&points, count, &mut random), options.iterations);
            ((inertia, replicate), centroids)
        })
        .min_by_key(|(key, _)| *key)
        .map(|(_, centroids)| centroids)
        .unwrap_or_default()
}

/// Index of the centroid nearest to a point, the first one on a tie, and the squared distance to it.
pub(super) fn nearest(point: &[i16], centroids: &[Vec<i16>]) -> (usize, u32) {
    let mut best = (0, u32::MAX);
    for (i, centroid) in centroids.iter().enumerate() {
        let distance = squared_distance(point, centroid);
        if distance < best.1 {
            best = (i, distance);
        }
    }
    best
}

/// For values up to 512 in size: a square fits in 20 bits.
fn squared_distance(a: &[i16], b: &[i16]) -> u32 {
    let square = |(a, b): (&i16, &i16)| {
        // Two 16-bit factors, for the multiply-add that every vector unit has.
        let difference = a - b;
        (i32::from(difference) * i32::from(difference)) as u32
    };
    a.iter().zip(b).map(square).sum()
}

/// Starting points: each next one is drawn with a probability proportional to its squared distance from those
/// already drawn.
fn starts(points: &[&[i16]], count: usize, random: &mut Random) -> Vec<Vec<i16>> {
    let mut centroids = vec![points[random.below(points.len() as u64) as usize].to_vec()];
    let mut distances = vec![u32::MAX; points.len()];
    while centroids.len() < count {
        let latest = &centroids[centroids.len() - 1];
        for (distance, point) in distances.iter_mut().zip(points) {
            *distance = squared_distance(point, latest).min(*distance);
        }
        let total = distances.iter().map(|d| u64::from(*d)).sum();
        if total == 0 {
            break;
        }
        let mut left = random.below(total);
        let drawn = distances.iter().position(|d| {
            let here = left < u64::from(*d);
            left = left.wrapping_sub(u64::from(*d));
            here
        });
        centroids.extend(drawn.map(|i| points[i].to_vec()));
    }
    centroids
}

/// Assigns and averages until nothing changes. Returns the sum of squared distances, and the centroids
/// rounded to integers.
fn lloyd(points: &[&[i16]], mut centroids: Vec<Vec<i16>>, iterations: usize) -> (u64, Vec<Vec<i16>>) {
    let dimensions = points[0].len();
    let mut assigned = vec![usize::MAX; points.len()];
    let mut inertia = u64::MAX;
    for _ in 0..iterations {
        let mut sums = vec![vec![0i64; dimensions]; centroids.len()];
        let mut counts = vec![0i64; centroids.len()];
        let mut changed = false;
        inertia = 0;
        for (point, assigned) in points.iter().zip(&mut assigned) {
            let (zone, distance) = nearest(point, &centroids);
            changed |= zone != *assigned;
            *assigned = zone;
            inertia += u64::from(distance);
            counts[zone] += 1;
            sums[zone].iter_mut().zip(*point).for_each(|(sum, v)| *sum += i64::from(*v));
        }
        if !changed {
            break;
        }
        // A centroid without points stays where it is.
        for ((centroid, sum), n) in centroids.iter_mut().zip(&sums).zip(&counts).filter(|(_, n)| **n > 0) {
            for (v, sum) in centroid.iter_mut().zip(sum) {
                *v = (2 * sum + n).div_euclid(2 * n) as i16;
            }
        }
    }
    (inertia, centroids)
}

/// The `SplitMix64` generator of Steele, Lea and Flood (2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to below `n`.
    fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(n)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three clusters of 50 points each, far apart.
    fn heaps() -> Vec<i16> {
        let mut random = Random(7);
        let mut near = |centre: i16| centre + random.below(21) as i16 - 10;
        (0..150).flat_map(|i| [[-400, 0], [300, 300], [300, -300]][i % 3].map(&mut near)).collect()
    }

    #[test]
    fn heaps_are_told_apart_and_centroids_are_their_means() {
        let points = heaps();
        let centroids = cluster(&points, 2, 3, &Options::default());
        assert_eq!(centroids.len(), 3);
        let zone = |i: usize| nearest(&points[2 * i..][..2], &centroids).0;
        for i in 0..150 {
            assert_eq!(zone(i), zone(i % 3));
        }
        assert!(zone(0) != zone(1) && zone(1) != zone(2) && zone(2) != zone(0));
        for heap in 0..3 {
            let sum: i32 = (0..50).map(|i| i32::from(points[2 * (3 * i + heap)])).sum();
            let mean = f64::from(sum) / 50.0;
            assert!((f64::from(centroids[zone(heap)][0]) - mean).abs() <= 0.5, "{mean}: {centroids:?}");
        }
    }

    #[test]
    fn more_replicates_are_never_looser() {
        let points = heaps();
        let inertia = |replicates| -> u64 {
            let centroids = cluster(&points, 2, 7, &Options { replicates, ..Options::default() });
            points.chunks_exact(2).map(|p| u64::from(nearest(p, &centroids).1)).sum()
        };
        let all: Vec<u64> = [1, 2, 5, 20].map(inertia).to_vec();
        assert!(all.is_sorted_by(|a, b| a >= b), "{all:?}");
        assert!(all[3] < all[0], "{all:?}: the starts are all alike");
    }

    #[test]
    fn equal_points_make_one_centroid_and_ties_go_to_the_first() {
        assert_eq!(cluster(&[3, -5].repeat(40), 2, 15, &Options::default()), [[3, -5]]);
        assert_eq!(nearest(&[0, 0], &[vec![2, 0], vec![0, 1], vec![1, 0]]), (1, 1));
    }
}
