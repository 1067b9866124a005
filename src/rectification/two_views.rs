//! Estimates the relative pose of two views of one camera from matches alone.
//!
//! Both views are pinholes of one unknown focal length, with the principal point in the middle: Fusiello and
//! Irsara, *Quasi-Euclidean Uncalibrated Rectification of Images* (2008). The pose is estimated from random
//! samples (RANSAC, Fischler and Bolles 1981, with the truncated error of Torr and Zisserman's MSAC, 2000),
//! and then by least squares of Sampson's distance over all matches, weighted as by Geman and `McClure`. If it
//! is unlikely, the right view may have another focal length, as of a phone that has focused anew.
//!
//! The samples are the same in every run, sums have a fixed order, and only + - * /, square roots and `libm`
//! are used: the same bits on every machine, with any number of threads.

use super::least_squares::solved;
use crate::calibration::cameras::Pose;
use crate::calibration::lens::{Distortion, Lens};
use crate::calibration::matrix::{
    IDENTITY, Matrix, cross, dot, length, product, rotated, rotation, rotation_vector, scaled, transposed,
};
use crate::error::Result;
use crate::threads;
use crate::threads::prelude::*;

/// A point of the scene in both images: x and y in the left and in the right image, in pixels.
pub type Correspondence = [[f64; 2]; 2];

/// Number of random samples from each start.
const SAMPLES: u64 = 400;
/// Matches per sample: one more than the unknowns of the geometry with a fixed focal length and no zoom.
const SAMPLE: usize = 6;
/// Iterations of least squares on a sample, and on all matches.
const STEPS: [usize; 2] = [6, 30];
/// The initial focal length, in longer sides of the image (open). Phones have .7 to .8, other cameras up to 1.5.
const FOCAL_LENGTH: f64 = 1.0;
/// The prior costs as much as a row distance of this many tolerances in each match (open). Matches determine
/// the focal length, and rotations of both views about an axis across the motion, poorly if disparities are
/// nearly the same or a lens bends lines. They determine everything else so well that the prior does not count.
const COST: f64 = 0.1;
/// Standard deviations of the priors: log of the focal length, rotation in radians, forward motion, log of the zoom (open).
const UNUSUAL: [f64; 4] = [1.0, 0.1, 0.2, 0.03];
/// A zoom is tried if the sum of the squared deviations from the priors is above this, and taken if it costs less and leaves this share of
/// the deviations (open). Without it, a long lens, a turned camera and a step forward imitate a zoom.
const UNLIKELY: f64 = 2.0;
const CONVINCING: f64 = 0.6;

/// Two views of one camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoViews {
    /// The rotation from the left view to the right one.
    rotation: Matrix,
    /// The position of the left view in the frame of the right one: a unit vector.
    direction: [f64; 3],
    /// Of the left view, in pixels.
    focal_length: f64,
    /// The focal length of the right view, relative to the left one.
    zoom: f64,
    /// Whether the zoom is unknown; otherwise it is 1.
    zooms: bool,
    size: (usize, usize),
}

/// The unknowns of [`TwoViews::moved`]: three of the rotation, two of the direction, the focal length, the zoom.
const UNKNOWNS: usize = 7;
/// The places of the last two.
const FOCAL: usize = 5;
const ZOOM: usize = 6;

impl TwoViews {
    /// Largest distance of an agreeing match from its epipolar line, in pixels: the accuracy of matches in
    /// images of this size, and the distortion of a phone's lens.
    pub(super) fn tolerance((width, height): (usize, usize)) -> f64 {
        const LEAST: f64 = 1.5;
        const PARTS: f64 = 800.0;
        (width.max(height) as f64 / PARTS).max(LEAST)
    }

    /// The geometry of views of `size` that most `matches` support; `None` of fewer than a sample.
    pub(super) fn estimate(matches: &[Correspondence], size: (usize, usize)) -> Option<Self> {
        let found = Self::searched(matches, size)?;
        if found.deviation() <= UNLIKELY || found.is_forward() {
            return Some(found);
        }
        let scale = Self::tolerance(size) / 2.0;
        let mut zoomed = Self { rotation: found.rotation, zooms: true, ..Self::start(size) };
        for scale in [8.0, 2.0, 1.0].map(|times| times * scale) {
            zoomed = zoomed.fitted(matches, STEPS[1], Some(scale));
        }
        let is_likelier = zoomed.deviation() <= CONVINCING * found.deviation();
        let costs_less = zoomed.cost(matches, Some(scale)) < found.cost(matches, Some(scale));
        Some(if is_likelier && costs_less { zoomed } else { found })
    }

    /// The geometry that most `matches` support, if both views have one focal length.
    fn searched(matches: &[Correspondence], size: (usize, usize)) -> Option<Self> {
        if matches.len() < SAMPLE {
            return None;
        }
        let tolerance = Self::tolerance(size);
        // Start from sideways, vertical and forward motion; the last is detected as no stereo pair.
        let starts = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let sampled = |i: u64| {
            let few = sample(matches.len(), i % SAMPLES).map(|i| matches[i]);
            let direction = starts[(i / SAMPLES) as usize];
            Self { direction, ..Self::start(size) }.fitted(&few, STEPS[0], None)
        };
        let (all, errors) = threads::run(|| {
            let all: Vec<Self> = (0..starts.len() as u64 * SAMPLES).into_par_iter().map(sampled).collect();
            let errors = all.par_iter().map(|views| views.truncated_error(matches, tolerance));
            let errors: Vec<f64> = errors.collect();
            (all, errors)
        });
        let best = errors.iter().zip(&all).min_by(|a, b| a.0.total_cmp(b.0))?.1;
        // Fit twice, because not all agreeing matches are found with the first sample.
        let found = best.fitted(matches, STEPS[1], Some(tolerance));
        Some(found.fitted(matches, STEPS[1], Some(tolerance / 2.0)))
    }

    /// The initial geometry: a step to the right, without rotation.
    pub(super) fn start(size: (usize, usize)) -> Self {
        Self {
            rotation: IDENTITY,
            direction: [-1.0, 0.0, 0.0],
            focal_length: Self::assumed(size),
            zoom: 1.0,
            zooms: false,
            size,
        }
    }

    fn assumed((width, height): (usize, usize)) -> f64 {
        FOCAL_LENGTH * width.max(height) as f64
    }

    /// The rays of a match, each in the frame of its view.
    fn rays(&self, [left, right]: &Correspondence) -> ([f64; 3], [f64; 3]) {
        let [cx, cy] = self.principal_point();
        let ray =
            |[x, y]: [f64; 2], focal_length: f64| [(x - cx) / focal_length, (y - cy) / focal_length, 1.0];
        (ray(*left, self.focal_length), ray(*right, self.zoom * self.focal_length))
    }

    /// The middle of both images, in pixels.
    fn principal_point(&self) -> [f64; 2] {
        [self.size.0, self.size.1].map(|side| (side as f64 - 1.0) / 2.0)
    }

    /// The lenses of both views.
    pub(super) fn lenses(&self) -> Result<[Lens; 2]> {
        let lens = |focal_length: f64| Lens::new([focal_length; 2], self.principal_point(), Distortion::NONE);
        Ok([lens(self.focal_length)?, lens(self.zoom * self.focal_length)?])
    }

    /// E: the rays p and q of a match satisfy q E p = 0.
    fn essential(&self) -> Matrix {
        let [x, y, z] = self.direction;
        product(&[[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], &self.rotation)
    }

    /// Sampson's distance over both points, in pixels: about the row distance of a match after rectification.
    pub(super) fn distance(&self, of: &Correspondence) -> f64 {
        self.distance_by(&self.essential(), of)
    }

    fn distance_by(&self, essential: &Matrix, of: &Correspondence) -> f64 {
        let (p, q) = self.rays(of);
        let (in_right, in_left) = (rotated(essential, p), rotated(&transposed(essential), q));
        let squares = [in_right[0], in_right[1], in_left[0], in_left[1]].map(|v| v * v);
        let norm = squares.iter().sum::<f64>() / 2.0;
        if norm > 0.0 { self.focal_length * dot(q, in_right) / norm.sqrt() } else { 0.0 }
    }

    /// The sum of the squared distances of `matches`, each limited to `tolerance`.
    fn truncated_error(&self, matches: &[Correspondence], tolerance: f64) -> f64 {
        let essential = self.essential();
        let most = tolerance * tolerance;
        matches
            .iter()
            .map(|of| {
                let distance = self.distance_by(&essential, of);
                // NaN counts as far.
                let square = distance * distance;
                if square < most { square } else { most }
            })
            .sum()
    }

    /// Deviations from the prior: the focal length, the rotation about each axis, the forward motion, and the zoom.
    fn unusual(&self) -> [f64; 6] {
        let [focal_length, turn, forward, zoom] = UNUSUAL;
        let by = rotation_vector(&self.rotation);
        let [_, _, z] = rotated(&rotation(scaled(by, -0.5)), self.direction);
        let longer = libm::log(self.focal_length / Self::assumed(self.size));
        let zoomed = libm::log(self.zoom);
        [longer / focal_length, by[0] / turn, by[1] / turn, by[2] / turn, z / forward, zoomed / zoom]
    }

    /// The sum of the squared deviations from the priors.
    fn deviation(&self) -> f64 {
        self.unusual().iter().map(|v| v * v).sum()
    }

    /// The cost that [`TwoViews::fitted`] minimizes: squared row distances of `matches`, robust with a `scale`, and the priors.
    fn cost(&self, matches: &[Correspondence], scale: Option<f64>) -> f64 {
        let essential = self.essential();
        let of_matches: f64 = matches
            .iter()
            .map(|of| {
                let distance = self.distance_by(&essential, of);
                let square = distance * distance;
                scale.map_or(square, |scale| square / (1.0 + square / (scale * scale)))
            })
            .sum();
        of_matches + Self::weight_of_priors(matches, scale) * self.deviation()
    }

    /// The weight of a squared deviation from a prior.
    fn weight_of_priors(matches: &[Correspondence], scale: Option<f64>) -> f64 {
        scale.map_or(0.0, |scale| COST * scale * COST * scale * matches.len() as f64)
    }

    /// The views after a small change of the unknowns.
    fn moved(&self, by: [f64; UNKNOWNS]) -> Self {
        let [x, y, z, a, b, focal_length, zoom] = by;
        // Two directions perpendicular to the direction of the left view.
        let smallest = (0..3).min_by(|&i, &j| self.direction[i].abs().total_cmp(&self.direction[j].abs()));
        let across = cross(self.direction, IDENTITY[smallest.unwrap_or(0)]);
        let across = scaled(across, 1.0 / length(across));
        let other = cross(self.direction, across);
        let direction: [f64; 3] = std::array::from_fn(|i| self.direction[i] + a * across[i] + b * other[i]);
        Self {
            rotation: product(&rotation([x, y, z]), &self.rotation),
            direction: scaled(direction, 1.0 / length(direction)),
            focal_length: self.focal_length * libm::exp(focal_length),
            zoom: self.zoom * libm::exp(zoom),
            ..*self
        }
    }

    /// Refines the views to bring the rows of `matches` together, by Levenberg and Marquardt. With a `scale`, in
    /// pixels, matches that are farther off count less, and the focal length changes too; without one it is fixed.
    fn fitted(self, matches: &[Correspondence], steps: usize, scale: Option<f64>) -> Self {
        const STEP: f64 = 1e-6;
        let each = Self::weight_of_priors(matches, scale);
        let cost = |views: &Self| views.cost(matches, scale);
        let (mut views, mut damping) = (self, 1e-3);
        let mut least = cost(&views);
        for _ in 0..steps {
            let essential = views.essential();
            let changed: [(Self, Matrix); UNKNOWNS] = std::array::from_fn(|i| {
                let changed = views.moved(std::array::from_fn(|j| if i == j { STEP } else { 0.0 }));
                (changed, changed.essential())
            });
            let (mut normal, mut right) = ([[0.0; UNKNOWNS]; UNKNOWNS], [0.0; UNKNOWNS]);
            let mut add = |value: f64, changed: [f64; UNKNOWNS], weight: f64| {
                let slopes = changed.map(|changed| (changed - value) / STEP);
                for (i, slope) in slopes.iter().enumerate() {
                    right[i] -= weight * slope * value;
                    normal[i].iter_mut().zip(&slopes).for_each(|(sum, other)| *sum += weight * slope * other);
                }
            };
            for of in matches {
                let distance = views.distance_by(&essential, of);
                let weight = scale.map_or(1.0, |scale| {
                    let root = 1.0 / (1.0 + distance * distance / (scale * scale));
                    root * root
                });
                let changed = changed.each_ref().map(|(views, essential)| views.distance_by(essential, of));
                add(distance, changed, weight);
            }
            if scale.is_some() {
                let unusual = changed.each_ref().map(|(views, _)| views.unusual());
                for (i, value) in views.unusual().into_iter().enumerate() {
                    add(value, unusual.map(|unusual| unusual[i]), each);
                }
            }
            for (unknown, is_free) in [(FOCAL, scale.is_some()), (ZOOM, self.zooms)] {
                if !is_free {
                    normal[unknown] = [0.0; UNKNOWNS];
                    (0..UNKNOWNS).for_each(|i| normal[i][unknown] = 0.0);
                    (normal[unknown][unknown], right[unknown]) = (1.0, 0.0);
                }
            }
            let mut damped = normal;
            (0..UNKNOWNS).for_each(|i| damped[i][i] += damping * (normal[i][i] + f64::MIN_POSITIVE));
            let next = solved(damped, right).map(|by| views.moved(by));
            match next.map(|next| (cost(&next), next)).filter(|(cost, _)| *cost < least) {
                Some((cost, next)) => {
                    (least, views) = (cost, next);
                    damping *= 0.1;
                }
                None => damping *= 10.0,
            }
        }
        views
    }

    /// The pose of the right view relative to the left one, with a baseline of 1. Matches determine its sign
    /// poorly if the angle between the views is uncertain: the right view is to the right, as the user says.
    /// If one view is above the other, most matches must be in front of both.
    pub(super) fn pose(&self, matches: &[Correspondence]) -> Pose {
        let half = rotation(scaled(rotation_vector(&self.rotation), -0.5));
        let [x, y, _] = rotated(&half, self.direction);
        let backwards = if x.abs() > y.abs() { x > 0.0 } else { self.votes_behind(matches) };
        let sign = if backwards { -1.0 } else { 1.0 };
        Pose { rotation: self.rotation, translation: scaled(self.direction, sign) }
    }

    /// Whether most matches are behind a view.
    fn votes_behind(&self, matches: &[Correspondence]) -> bool {
        let behind = matches.iter().filter(|of| {
            // a p + t = b q, with p rotated into the frame of the right view.
            let (p, q) = self.rays(of);
            let normal = cross(q, rotated(&self.rotation, p));
            dot(cross(q, self.direction), normal) > 0.0
        });
        2 * behind.count() > matches.len()
    }

    /// Whether the camera moved forward or backward: an image shows the position of the other one, or the
    /// motion is more forward than sideways.
    pub(super) fn is_forward(&self) -> bool {
        let half = rotation(scaled(rotation_vector(&self.rotation), -0.5));
        let [x, y, z] = rotated(&half, self.direction).map(f64::abs);
        let other = rotated(&transposed(&self.rotation), self.direction);
        let [width, height] = [self.size.0, self.size.1].map(|side| side as f64 / self.focal_length / 2.0);
        let shown = |[x, y, z]: [f64; 3]| x.abs() < width * z.abs() && y.abs() < height * z.abs();
        z > x.max(y) || shown(self.direction) || shown(other)
    }

    /// The share of `matches` that neither one plane nor a mere rotation of the camera explains: those
    /// farther than the tolerance from the homography of most.
    pub(super) fn share_off_one_plane(&self, matches: &[Correspondence]) -> f64 {
        const ROUNDS: usize = 20;
        let tolerance = Self::tolerance(self.size);
        let rays: Vec<_> = matches.iter().map(|of| self.rays(of)).collect();
        let mut plane = IDENTITY;
        let apart = |plane: &Matrix, p: [f64; 3], q: [f64; 3]| {
            let [x, y, z] = rotated(plane, p);
            let (dx, dy) = (x / z - q[0], y / z - q[1]);
            self.focal_length * (dx * dx + dy * dy).sqrt()
        };
        for round in 0..ROUNDS {
            let (mut normal, mut right) = ([[0.0; 8]; 8], [0.0; 8]);
            for &(p, q) in &rays {
                let relative = apart(&plane, p, q) / tolerance;
                let root = if round == 0 { 1.0 } else { 1.0 / (1.0 + relative * relative) };
                let ([x, y, _], [u, v, _]) = (p, q);
                for (row, goal) in [
                    ([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u),
                    ([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v),
                ] {
                    for i in 0..8 {
                        right[i] += root * root * row[i] * goal;
                        (0..8).for_each(|j| normal[i][j] += root * root * row[i] * row[j]);
                    }
                }
            }
            let Some([a, b, c, d, e, f, g, h]) = solved(normal, right) else { return 0.0 };
            plane = [[a, b, c], [d, e, f], [g, h, 1.0]];
        }
        let off = rays.iter().filter(|(p, q)| apart(&plane, *p, *q) > tolerance);
        off.count() as f64 / matches.len().max(1) as f64
    }
}

/// Distinct random indices below `count`.
fn sample(count: usize, seed: u64) -> [usize; SAMPLE] {
    // The generator SplitMix64.
    let mut state = seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) % count as u64) as usize
    };
    let mut out = [usize::MAX; SAMPLE];
    for i in 0..SAMPLE {
        out[i] = loop {
            let index = next();
            if !out[..i].contains(&index) {
                break index;
            }
        };
    }
    out
}
