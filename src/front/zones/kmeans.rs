//! K-means in integers: exact, so the same everywhere.
//!
//! Lloyd's iteration from the random starts of Arthur and Vassilvitskii, *k-means++* (2007).
//! `linfa-clustering` was considered and rejected: its default start depends on how threads share the work,
//! its update counts the old centroid as one more point, and it brings 27 crates for a result that the next
//! version of any of them might change.

use crate::options::ZoneExtent;
use crate::threads::prelude::*;

/// Points per task.
const CHUNK: usize = 512;

/// The parameters of the segmentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Largest number of clusters, up to 255: the K of K-means.
    pub clusters: usize,
    /// Whether a zone is a cluster, or a connected region of one.
    pub extent: ZoneExtent,
    /// Number of clusterings from different starts; the tightest is taken.
    pub replicates: usize,
    /// Largest number of iterations of each clustering; it ends when no sample changes its zone.
    pub iterations: usize,
    /// Seed of the random starts.
    pub seed: u64,
}

impl Default for Options {
    /// The preset `paper`.
    fn default() -> Self {
        Self { clusters: 15, extent: ZoneExtent::Region, replicates: 5, iterations: 500, seed: 0 }
    }
}

/// The centroids of the points, whose `dimensions` values are up to 512 in size, one after the other. There
/// are at most `count` of them, and fewer where there are fewer different points. The replicate with the
/// smallest sum of squared distances is taken, the first one on a tie.
pub(super) fn cluster(points: &[i16], dimensions: usize, count: usize, options: &Options) -> Centroids {
    (0..options.replicates.max(1) as u64)
        .into_par_iter()
        .map(|replicate| {
            let mut random = Random(options.seed.wrapping_add(replicate << 32));
            let starts = starts(points, dimensions, count, &mut random);
            let (inertia, centroids) = lloyd(points, Centroids::new(starts, dimensions), options.iterations);
            ((inertia, replicate), centroids)
        })
        .min_by_key(|(key, _)| *key)
        .map(|(_, centroids)| centroids)
        .expect("there is a replicate")
}

/// Centroids, and their distances.
pub(super) struct Centroids {
    dimensions: usize,
    /// The centroids, concatenated.
    values: Vec<i16>,
    /// For each centroid the others, nearest first, with the squared distance.
    others: Vec<Vec<(u32, usize)>>,
}

impl Centroids {
    fn new(values: Vec<i16>, dimensions: usize) -> Self {
        let centroids = || values.chunks_exact(dimensions).enumerate();
        let others_of = |(i, centroid): (usize, &[i16])| {
            let others = centroids().filter(|(j, _)| *j != i);
            let mut others: Vec<_> =
                others.map(|(j, other)| (squared_distance(centroid, other), j)).collect();
            others.sort_unstable();
            others
        };
        let others = centroids().map(others_of).collect();
        Self { dimensions, values, others }
    }

    #[inline(always)]
    fn at(&self, i: usize) -> &[i16] {
        &self.values[i * self.dimensions..][..self.dimensions]
    }

    /// Index of the centroid nearest to a point, the first one on a tie, and the squared distance to it. The search starts from the
    /// centroid `guess`. A centroid that is more than twice as far from it as the point is farther from the point, by the triangle
    /// inequality, and so are all that follow.
    #[inline(always)]
    fn nearest(&self, point: &[i16], guess: usize) -> (usize, u32) {
        let from_guess = squared_distance(point, self.at(guess));
        let mut best = (from_guess, guess);
        for &(apart, i) in &self.others[guess] {
            if apart > 4 * from_guess {
                break;
            }
            best = best.min((squared_distance(point, self.at(i)), i));
        }
        (best.1, best.0)
    }
}

/// Replaces each guess by the index of the centroid nearest to the point, the first one on a tie. Returns the sum of squared
/// distances.
#[pulp::with_simd(assign = crate::vectors::widest())]
#[inline(always)]
pub(super) fn assign_on<'a, S: pulp::Simd>(
    _: S,
    centroids: &'a Centroids,
    points: &'a [i16],
    guesses: &'a mut [usize],
) -> u64 {
    let mut sum = 0;
    for (point, guess) in points.chunks_exact(centroids.dimensions).zip(guesses) {
        let (nearest, distance) = centroids.nearest(point, *guess);
        *guess = nearest;
        sum += u64::from(distance);
    }
    sum
}

/// For values up to 512 in size, whose squared differences fit in 20 bits.
#[inline(always)]
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
fn starts(points: &[i16], dimensions: usize, count: usize, random: &mut Random) -> Vec<i16> {
    let number = points.len() / dimensions;
    let point = |i: usize| &points[i * dimensions..][..dimensions];
    let mut centroids = point(random.below(number as u64) as usize).to_vec();
    let mut distances = vec![u32::MAX; number];
    while centroids.len() < count * dimensions {
        approach(points, &centroids[centroids.len() - dimensions..], &mut distances);
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
        centroids.extend(drawn.into_iter().flat_map(point));
    }
    centroids
}

/// Lowers the distance of each point to that from `centroid`.
#[pulp::with_simd(approach = crate::vectors::widest())]
#[inline(always)]
fn approach_on<'a, S: pulp::Simd>(_: S, points: &'a [i16], centroid: &'a [i16], distances: &'a mut [u32]) {
    for (distance, point) in distances.iter_mut().zip(points.chunks_exact(centroid.len())) {
        *distance = squared_distance(point, centroid).min(*distance);
    }
}

/// Assigns and averages until nothing changes. Returns the sum of squared distances, and the centroids
/// rounded to integers.
fn lloyd(points: &[i16], mut centroids: Centroids, iterations: usize) -> (u64, Centroids) {
    let dimensions = centroids.dimensions;
    let count = centroids.others.len();
    // Before the first assignment, no point counts.
    let mut assigned = vec![0; points.len() / dimensions];
    let mut sums = vec![0; count * dimensions];
    let mut counts = vec![0; count];
    let mut inertia = u64::MAX;
    for iteration in 0..iterations {
        let mut zones = assigned.clone();
        let chunks = points.par_chunks(CHUNK * dimensions).zip(zones.par_chunks_mut(CHUNK));
        inertia = chunks.map(|(points, zones)| assign(&centroids, points, zones)).sum();
        if iteration > 0 && zones == assigned {
            break;
        }
        // Only the points that move change the sums.
        for ((point, &from), &to) in points.chunks_exact(dimensions).zip(&assigned).zip(&zones) {
            let mut add = |zone: usize, sign: i64| {
                counts[zone] += sign;
                let sums = &mut sums[zone * dimensions..][..dimensions];
                sums.iter_mut().zip(point).for_each(|(sum, v)| *sum += sign * i64::from(*v));
            };
            if iteration == 0 {
                add(to, 1);
            } else if from != to {
                add(from, -1);
                add(to, 1);
            }
        }
        assigned = zones;
        // A centroid without points stays where it is.
        let mut values = centroids.values;
        let means = values.chunks_exact_mut(dimensions).zip(sums.chunks_exact(dimensions)).zip(&counts);
        for ((centroid, sums), n) in means.filter(|(_, n)| **n > 0) {
            for (v, sum) in centroid.iter_mut().zip(sums) {
                *v = (2 * sum + n).div_euclid(2 * n) as i16;
            }
        }
        centroids = Centroids::new(values, dimensions);
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

    /// Three separate clusters of 50 points each.
    fn heaps() -> Vec<i16> {
        let mut random = Random(7);
        let mut near = |centre: i16| centre + random.below(21) as i16 - 10;
        (0..150).flat_map(|i| [[-400, 0], [300, 300], [300, -300]][i % 3].map(&mut near)).collect()
    }

    #[test]
    fn separate_clusters_are_found_with_their_means() {
        let points = heaps();
        let centroids = cluster(&points, 2, 3, &Options::default());
        assert_eq!(centroids.others.len(), 3);
        let mut zones = vec![0; 150];
        assign(&centroids, &points, &mut zones);
        let zone = |i: usize| zones[i];
        for i in 0..150 {
            assert_eq!(zone(i), zone(i % 3));
        }
        assert!(zone(0) != zone(1) && zone(1) != zone(2) && zone(2) != zone(0));
        for heap in 0..3 {
            let sum: i32 = (0..50).map(|i| i32::from(points[2 * (3 * i + heap)])).sum();
            let mean = f64::from(sum) / 50.0;
            let centroid = f64::from(centroids.at(zone(heap))[0]);
            assert!((centroid - mean).abs() <= 0.5, "{mean}: {centroid}");
        }
    }

    #[test]
    fn more_replicates_are_never_looser() {
        let points = heaps();
        let inertia = |replicates| -> u64 {
            let centroids = cluster(&points, 2, 7, &Options { replicates, ..Options::default() });
            assign(&centroids, &points, &mut [0; 150])
        };
        let all: Vec<u64> = [1, 2, 5, 20].map(inertia).to_vec();
        assert!(all.is_sorted_by(|a, b| a >= b), "{all:?}");
        assert!(all[3] < all[0], "{all:?}: the starts are all alike");
    }

    #[test]
    fn equal_points_make_one_centroid_and_ties_go_to_the_first() {
        assert_eq!(cluster(&[3, -5].repeat(40), 2, 15, &Options::default()).values, [3, -5]);
        let centroids = Centroids::new(vec![2, 0, 0, 1, 1, 0], 2);
        for guess in 0..3 {
            assert_eq!(centroids.nearest(&[0, 0], guess), (1, 1));
        }
    }

    #[test]
    fn any_guess_finds_the_nearest() {
        let mut random = Random(3);
        let mut draw = |count: usize| (0..count).map(|_| random.below(7) as i16).collect::<Vec<_>>();
        for _ in 0..200 {
            let (centroids, point) = (Centroids::new(draw(3 * 6), 3), draw(3));
            let distances: Vec<u32> = (0..6).map(|i| squared_distance(&point, centroids.at(i))).collect();
            let least = *distances.iter().min().unwrap();
            let expected = (distances.iter().position(|d| *d == least).unwrap(), least);
            for guess in 0..6 {
                assert_eq!(centroids.nearest(&point, guess), expected, "{distances:?} from {guess}");
            }
        }
    }
}
