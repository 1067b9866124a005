//! Texture zones by unsupervised segmentation with Gabor filters (paper, sections 2.4 and 3.1).
//!
//! The recipe is that of Jain and Farrokhnia, *Unsupervised texture segmentation using Gabor filters* (1991).
//! The features are the magnitudes of a bank of Gabor filters, each smoothed in proportion to its wavelength,
//! and the pixel's coordinates. They are standardised and clustered. The paper gives orientations,
//! wavelengths, and K-means with K = 15 in 5 replicates of up to 500 iterations. A zone is a connected region of a
//! cluster, or a whole cluster.
//!
//! The filters run in single precision (see `gabor`). Their smoothed magnitudes are then rounded to integers,
//! and everything after that is exact: interpolation, clustering, assignment.

mod gabor;
mod kmeans;
mod lanes;
pub mod regions;

use crate::image::{Image, Plane};
use crate::options::ZoneExtent;
use crate::threads::prelude::*;
use gabor::{ORIENTATIONS, Response};
pub use kmeans::Options;
pub use regions::{MASKED, Zones};

/// Features are integers, in 1 / `UNITS` of their standard deviation.
const UNITS: f64 = 64.0;
/// Features are clamped to this many standard deviations from the mean. Larger deviations carry no more
/// information, and a squared difference of two features stays below 2^20.
const REACH: f64 = 8.0;
/// Smaller standard deviations are raised to this fraction of an 8-bit level. Below it, a response is
/// rounding error, not texture, and must not be scaled up to the size of the others.
const MIN_DEVIATION: f64 = 1.0 / 64.0;
/// Approximate number of pixels that are clustered, on a square grid: every sixth in x and y on Middlebury's
/// Teddy, every ninth on Motorcycle. The paper clusters all pixels, but neighbours have nearly the same
/// smoothed features, and K-means needs only their distribution. All other pixels are assigned to the nearest
/// centroid.
const SAMPLES: usize = 4096;
/// Smallest number of samples per cluster. Smaller images get fewer clusters: one of a few pixels is useless.
const SAMPLES_PER_CLUSTER: usize = 16;
/// Largest number of clusters.
const MAX_CLUSTERS: usize = 255;
/// Values of a pixel are padded to a multiple of this.
const VECTOR: usize = 16;
/// Bits of the interpolation weights, across and down.
const WEIGHT_BITS: u32 = 8;

/// Segments an image by its texture.
///
/// Only the grey value counts. Masked pixels are filled with the mean, take no part in the clustering and get
/// the zone [`MASKED`]. Images too small for `options.clusters` get fewer clusters: one for every 16 samples (all
/// pixels, up to about 4096).
///
/// The result is the same on every machine and for any number of threads.
#[must_use]
pub fn segment(image: &Image, options: &Options) -> Zones {
    let (width, height) = image.pixels.size();
    let samples = samples(&image.masked);
    if samples.is_empty() {
        return Zones { map: Plane::filled(width, height, MASKED), count: 0 };
    }
    let features = Features::new(image, &samples);
    let dimensions = features.dimensions();
    let points: Vec<i16> = samples
        .par_chunk_by(|a, b| a.1 == b.1)
        .flat_map_iter(|row| {
            let values = features.row(row[0].1);
            let point = move |&(x, _): &(usize, usize)| values[x * dimensions..][..dimensions].to_vec();
            row.iter().flat_map(point)
        })
        .collect();
    let clusters = options.clusters.min(MAX_CLUSTERS).min(samples.len() / SAMPLES_PER_CLUSTER).max(1);
    let centroids = kmeans::cluster(&points, dimensions, clusters, options);

    let mut map = Plane::filled(width, height, MASKED);
    map.data_mut().par_chunks_exact_mut(width).enumerate().for_each_init(
        || vec![0; width],
        |nearest, (y, clusters)| {
            kmeans::assign(&centroids, &features.row(y), nearest);
            for ((cluster, nearest), masked) in clusters.iter_mut().zip(nearest).zip(image.masked.row(y)) {
                *cluster = if *masked { MASKED } else { *nearest as u32 };
            }
        },
    );
    match options.extent {
        ZoneExtent::Cluster => renumbered(map),
        ZoneExtent::Region => regions::connected(&map),
    }
}

/// Renumbers clusters in the order of their first pixels, and counts them.
fn renumbered(mut map: Plane<u32>) -> Zones {
    let mut numbers = [MASKED; MAX_CLUSTERS];
    let mut count = 0;
    for cluster in map.data_mut().iter_mut().filter(|cluster| **cluster != MASKED) {
        let number = &mut numbers[*cluster as usize];
        if *number == MASKED {
            *number = count;
            count += 1;
        }
        *cluster = *number;
    }
    Zones { map, count: count as usize }
}

/// The unmasked pixels (x, y) of a grid with about [`SAMPLES`] of them, row by row. Where all pixels of the
/// grid are masked, a finer grid is taken. The result is empty only if every pixel is masked.
fn samples(masked: &Plane<bool>) -> Vec<(usize, usize)> {
    let visible = masked.data().iter().filter(|m| !**m).count();
    let widest = (visible / SAMPLES).isqrt().max(1);
    let grid = |step: usize| {
        let along = move |n: usize| (step / 2..n).step_by(step);
        let row = move |y: usize| along(masked.width()).map(move |x| (x, y));
        along(masked.height()).flat_map(row).filter(|&at| !masked[at]).collect::<Vec<_>>()
    };
    (1..=widest).rev().map(grid).find(|samples| !samples.is_empty()).unwrap_or_default()
}

/// Standardised features of every pixel, in 1/64 of a standard deviation, -512 ..= 512.
struct Features {
    octaves: Vec<Octave>,
    /// By x, then by y.
    coordinates: [Vec<i16>; 2],
}

/// A vector of features: all orientations of a wavelength, and two free places.
const LANES: usize = ORIENTATIONS + 2;

/// The smoothed filter magnitudes of a wavelength at its nodes, and where the pixels lie among these.
struct Octave {
    nodes: Plane<[i16; LANES]>,
    across: Vec<Place>,
    down: Vec<Place>,
}

/// A position between two nodes: the index of the first, and the weight of the second in 1/256.
#[derive(Clone, Copy)]
struct Place {
    node: usize,
    weight: i32,
}

impl Features {
    /// Features whose mean and standard deviation are those of the samples.
    fn new(image: &Image, samples: &[(usize, usize)]) -> Self {
        let bank = gabor::bank(&contrast(image));
        let octave = |responses: &[Response]| {
            let [across, down] = [0, 1].map(|axis| {
                let (pixels, nodes) = (responses[0].pixels[axis], responses[0].nodes_per_period[axis]);
                (0..pixels).map(|x| Place::new(x * nodes, 2 * pixels)).collect::<Vec<_>>()
            });
            let scaled = |Response { nodes, .. }: &Response| {
                let nearby = |&(x, y): &(usize, usize)| nodes[(across[x].node, down[y].node)];
                let scale = Scale::new(samples.iter().map(nearby), MIN_DEVIATION);
                let mut scaled = vec![0; nodes.data().len()];
                apply_all(scale, nodes.data(), &mut scaled);
                scaled
            };
            let scaled: Vec<Vec<i16>> = responses.par_iter().map(scaled).collect();
            let (width, height) = responses[0].nodes.size();
            let mut nodes = Plane::filled(width, height, [0; LANES]);
            for (lane, scaled) in scaled.iter().enumerate() {
                nodes.data_mut().iter_mut().zip(scaled).for_each(|(node, v)| node[lane] = *v);
            }
            Octave { nodes, across, down }
        };
        let octaves = bank.par_chunks(ORIENTATIONS).map(octave).collect();
        let x = Scale::new(samples.iter().map(|s| s.0 as f64), 1.0);
        let y = Scale::new(samples.iter().map(|s| s.1 as f64), 1.0);
        let along = |scale: Scale, n: usize| (0..n).map(|i| scale.apply(i as f64)).collect();
        Self { octaves, coordinates: [along(x, image.width()), along(y, image.height())] }
    }

    /// Values per pixel: the features, padded with 0 to whole vectors.
    fn dimensions(&self) -> usize {
        (self.octaves.len() * ORIENTATIONS + 2).next_multiple_of(VECTOR)
    }

    /// The features of row `y`, \[x\]\[feature\].
    fn row(&self, y: usize) -> Vec<i16> {
        let [by_x, by_y] = &self.coordinates;
        let dimensions = self.dimensions();
        let mut row = vec![0; by_x.len() * dimensions];
        let mut line = Vec::new();
        for (i, octave) in self.octaves.iter().enumerate() {
            line.resize(octave.nodes.width(), [0; LANES]);
            interpolate(octave, y, &mut line, &mut row[i * ORIENTATIONS..], dimensions);
        }
        // The coordinates go to the two places after the features of the last octave.
        for (values, x) in row.chunks_exact_mut(dimensions).zip(by_x) {
            values[self.octaves.len() * ORIENTATIONS..][..2].copy_from_slice(&[*x, by_y[y]]);
        }
        row
    }
}

/// Interpolates the features of an octave for row `y`, `dimensions` apart; the two free places of each pixel
/// are overwritten by the next octave. `line` is scratch memory for the row's nodes.
#[pulp::with_simd(interpolate = crate::vectors::widest())]
#[inline(always)]
fn interpolate_on<'a, S: pulp::Simd>(
    _: S,
    octave: &'a Octave,
    y: usize,
    line: &'a mut [[i32; LANES]],
    out: &'a mut [i16],
    dimensions: usize,
) {
    let Octave { nodes, across, down } = octave;
    let Place { node, weight } = down[y];
    for ((line, a), b) in line.iter_mut().zip(nodes.row(node)).zip(nodes.row(node + 1)) {
        for lane in 0..LANES {
            line[lane] = blend(a[lane].into(), b[lane].into(), weight);
        }
    }
    for (values, place) in out.chunks_mut(dimensions).zip(across) {
        let (a, b) = (&line[place.node], &line[place.node + 1]);
        for lane in 0..LANES {
            let value = blend(a[lane], b[lane], place.weight);
            values[lane] = ((value + (1 << (2 * WEIGHT_BITS - 1))) >> (2 * WEIGHT_BITS)) as i16;
        }
    }
}

/// `a` and `b` weighted, times 256.
#[inline(always)]
fn blend(a: i32, b: i32, weight: i32) -> i32 {
    (a << WEIGHT_BITS) + (b - a) * weight
}

impl Place {
    /// Position `numerator / denominator`, in nodes.
    fn new(numerator: usize, denominator: usize) -> Self {
        let weight = ((numerator % denominator) << WEIGHT_BITS) / denominator;
        Self { node: numerator / denominator, weight: weight as i32 }
    }
}

/// Maps values to standard deviations from their mean.
#[derive(Clone, Copy)]
struct Scale {
    mean: f64,
    factor: f64,
}

impl Scale {
    /// The scale of `values`, with a standard deviation of at least `min_deviation`.
    fn new(values: impl Iterator<Item = f64> + Clone, min_deviation: f64) -> Self {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
        Self { mean, factor: UNITS / variance.sqrt().max(min_deviation) }
    }

    #[inline(always)]
    fn apply(self, value: f64) -> i16 {
        let reach = REACH * UNITS;
        ((value - self.mean) * self.factor).round().clamp(-reach, reach) as i16
    }
}

/// [`Scale::apply`] to many values.
#[pulp::with_simd(apply_all = crate::vectors::widest())]
#[inline(always)]
fn apply_all_on<'a, S: pulp::Simd>(_: S, scale: Scale, values: &'a [f64], out: &'a mut [i16]) {
    out.iter_mut().zip(values).for_each(|(out, value)| *out = scale.apply(*value));
}

/// Grey in 8-bit levels less its mean over the unmasked pixels; 0 where masked.
fn contrast(image: &Image) -> Plane<f32> {
    let (pixels, masked) = (image.pixels.data(), image.masked.data());
    let visible = || pixels.iter().zip(masked).filter(|(_, masked)| !**masked).map(|(p, _)| u64::from(p[3]));
    let mean = visible().sum::<u64>() as f64 / visible().count() as f64;
    let level = |(p, masked): (&[u16; 4], &bool)| {
        if *masked { 0.0 } else { ((f64::from(p[3]) - mean) / 256.0) as f32 }
    };
    Plane::new(image.width(), image.height(), pixels.iter().zip(masked).map(level).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The clusters of an image of Teddy's size come from every sixth pixel in x and y.
    #[test]
    fn samples_are_about_as_many_as_said() {
        let seen = samples(&Plane::filled(450, 375, false));
        assert_eq!((seen.len(), seen[0], seen[1]), (75 * 62, (3, 3), (9, 3)));
        assert!(seen.len().abs_diff(SAMPLES) < SAMPLES / 4);
        // Control: a small image gives all its pixels.
        assert_eq!(samples(&Plane::filled(60, 60, false)).len(), 3600);
    }
}
