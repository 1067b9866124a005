//! Drift of a rig: how its right camera has rotated since it was calibrated, from matches in rectified frames.
//!
//! Shocks and warmth rotate cameras by tenths of a degree, and then the rows of rectified views no longer
//! line up. A pitch moves all rows alike, a roll moves them up on one side and down on the other, and a yaw
//! bends them in the corners. [`Drift`] finds the rotation that brings the matches of the last frames back to
//! their rows (robust least squares). A yaw also changes disparities, which no match can tell from another
//! distance; rows show it less well than the other angles, as the reported errors say.
//!
//! ```
//! use mrfgs::drift::Drift;
//! use mrfgs::options::DisparityRange;
//! use mrfgs::rectification::{Options, Rectification};
//! use mrfgs::{Pair, calibration};
//!
//! # fn main() -> mrfgs::Result<()> {
//! let cameras = calibration::read(&["testdata/raw/cameras.yml".into()])?;
//! let raw = Pair::open("testdata/raw/left.png", "testdata/raw/right.png")?;
//! let calibrated = Rectification::new(&cameras, raw.size(), &Options::default())?;
//! let mut drift = Drift::of(&calibrated)?;
//! let mut rectification = calibrated.clone();
//! for frame in [&raw, &raw] {
//!     let pair = rectification.apply(frame)?;
//!     drift.follow(&pair, DisparityRange::new(0, 31)?)?;
//!     if let Some(better) = drift.correct(&calibrated)? {
//!         rectification = better;
//!     }
//! }
//! let turn = drift.turn().expect("there is enough to see");
//! assert!(turn.degrees().iter().all(|angle| angle.abs() < 0.1)); // As it was calibrated.
//! # Ok(())
//! # }
//! ```

use super::matches;
use crate::calibration::matrix::{IDENTITY, Matrix, product, rotated, rotation, rotation_vector, transposed};
use crate::error::{Error, Result};
use crate::image::calib::Camera;
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::rectification::Rectification;
use crate::rectification::least_squares::solved;
use std::collections::VecDeque;

/// Frames that count: the last ones of those that were searched.
const FRAMES: usize = 16;
/// In the long run only one frame in this many is searched, to save time.
const STRIDE: u64 = 64;
/// Matches are searched in a pair whose longer side is at most this, in pixels.
const SIDE: usize = 1024;
/// Approximate number of corners that are searched in a frame.
const CORNERS: usize = 600;
/// Rows above and below its own on which a corner is searched.
const ROWS: usize = 4;
/// Fewer matches than this, in all frames, are not reliable.
const LEAST: usize = 60;
/// A frame is searched at most this many times, each time after the rotation found so far: matches are exact
/// near whole pixels, and biased between them.
const SEARCHES: usize = 3;
/// Iterations of least squares.
const STEPS: usize = 12;
/// Matches that are this far off their row count a quarter, in pixels of the searched pair; or the median distance, if that is more.
const SCALE: f64 = 0.25;
/// The prior of the yaw, in radians: it is rarely larger (open). The other angles need no prior.
const UNUSUAL: f64 = 0.002;
/// Row offset, in pixels of the images, from which on a rotation is worth resampling (open).
const WORTH: f64 = 0.1;
/// Standard errors from which on a rotation is significant.
const SURE: f64 = 3.0;

/// Estimates the rotation of the right camera of a rig from its frames. It takes one frame after the other; the
/// first, the fourth, the sixteenth and then every sixty-fourth is searched, and of these the last sixteen count.
#[derive(Clone, Debug)]
pub struct Drift {
    /// The rectified cameras of the calibration.
    cameras: [Camera; 2],
    size: (usize, usize),
    /// The rotation that the frames are corrected by, from the calibrated right view to the true one.
    applied: Matrix,
    frames: VecDeque<Vec<Sight>>,
    count: u64,
    turn: Option<Turn>,
}

/// A match in rectified views.
#[derive(Clone, Copy, Debug)]
struct Sight {
    /// The ray of its right end, in the calibrated right view.
    right: [f64; 3],
    /// The row of its left end at depth 1.
    row: f64,
    /// Focal length in pixels of the searched pair.
    focal_length: f64,
}

/// A rotation of the right camera of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// The rotation axis in the rectified right view (x right, y down, z forward) times the angle in rad.
    pub axis: [f64; 3],
    /// Standard error of each component, in radians, as if all frames showed one still scene.
    pub errors: [f64; 3],
    /// Number of matches that it comes from.
    pub matches: usize,
    /// The largest row offset that it causes, in pixels of the images.
    pub rows: f64,
    counts: bool,
}

impl Turn {
    /// How far the camera has turned up, to the right and clockwise since its calibration, in degrees.
    #[must_use]
    pub fn degrees(&self) -> [f64; 3] {
        self.axis.map(f64::to_degrees)
    }

    /// Whether it moves rows by a tenth of a pixel or more, and is significant.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.counts
    }
}

impl Drift {
    /// The drift of a rig with this rectification; no frame has been seen yet.
    ///
    /// # Errors
    /// [`Error::Calibration`] for a rectification by matches alone, which is no calibration.
    pub fn of(calibrated: &Rectification) -> Result<Self> {
        calibrated.calibration()?;
        Ok(Self {
            cameras: *calibrated.cameras(),
            size: calibrated.size(),
            applied: IDENTITY,
            frames: VecDeque::new(),
            count: 0,
            turn: None,
        })
    }

    /// Takes the next frame, rectified by the last result of [`Drift::correct`], and searches it if it is due.
    /// `range` holds its disparities. It finds matches up to four rows off, in a pair of at most 1024 pixels a side.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for a pair of another size than the rectified views, [`Error::Memory`] when the
    /// machine has too little memory for the search.
    pub fn follow(&mut self, pair: &Pair, range: DisparityRange) -> Result<()> {
        if pair.size() != self.size {
            let ((width, height), (w, h)) = (self.size, pair.size());
            return Err(Error::Mismatch(format!(
                "the rectified views have {width} x {height} pixels, but these images have {w} x {h}"
            )));
        }
        self.count += 1;
        if ![1, 4, 16].contains(&self.count) && !self.count.is_multiple_of(STRIDE) {
            return Ok(());
        }
        matches::check_memory(pair)?;
        let (mut small, mut scale) = (pair.clone(), 1);
        while small.size().0.max(small.size().1) > SIDE {
            small = small.map(Image::downsampled);
            scale *= 2;
        }
        let range = DisparityRange { min: range.min.div_euclid(scale), max: range.max.div_euclid(scale) + 1 };
        if self.frames.len() == FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(Vec::new());
        for _ in 0..SEARCHES {
            let by = self.turn.map_or(self.applied, |turn| rotation(turn.axis));
            let sights = self.search(&small, f64::from(scale), range, &by)?;
            self.frames.pop_back();
            self.frames.push_back(sights);
            self.turn = self.fitted();
            let found = self.turn.map_or(by, |turn| rotation(turn.axis));
            if self.rows(&between(&by, &found)) < WORTH {
                break;
            }
        }
        Ok(())
    }

    /// The matches of a pair reduced by `scale`, searched after rotating the calibrated right view `by` this.
    fn search(&self, small: &Pair, scale: f64, range: DisparityRange, by: &Matrix) -> Result<Vec<Sight>> {
        let (width, height) = small.size();
        let cameras = self.cameras.map(|camera| Camera {
            focal_length: camera.focal_length.map(|f| f / scale),
            principal_point: camera.principal_point.map(|c| c / scale),
        });
        let change = between(&self.applied, by);
        let turned = if self.rows(&change) < WORTH {
            None
        } else {
            let by = Rectification::of_cameras(cameras, small.size())?
                .with_right_turned(rotation_vector(&change))?;
            Some(by.apply(small)?)
        };
        let by = if turned.is_some() { by } else { &self.applied };
        let pair = turned.as_ref().unwrap_or(small);
        let found = matches::search(pair, None, Some(range), width * height / CORNERS, ROWS);
        let back = transposed(by);
        let sight = |m: &matches::SparseMatch| {
            let [disparity, dy] = [m.disparity, m.dy].map(|v| f64::from(v) / f64::from(FRACTION));
            let at = |x: f64, y: f64, camera: &Camera| {
                let ([fx, fy], [cx, cy]) = (camera.focal_length, camera.principal_point);
                [(x - cx) / fx, (y - cy) / fy, 1.0]
            };
            let (x, y) = (m.x as f64, m.y as f64);
            Sight {
                right: rotated(&back, at(x - disparity, y + dy, &cameras[1])),
                row: at(x, y, &cameras[0])[1],
                focal_length: cameras[1].focal_length[1],
            }
        };
        Ok(found.iter().map(sight).collect())
    }

    /// The rotation of the right camera since the calibration, from the last frames; `None` if they have too few matches.
    #[must_use]
    pub fn turn(&self) -> Option<Turn> {
        self.turn
    }

    /// The rectification for the next frames, if that of the last ones is outdated: `calibrated`, with the right camera rotated.
    ///
    /// # Errors
    /// [`Error::Memory`] when `calibrated` [keeps its places](Rectification::keep_places) and the machine has
    /// too little memory for new ones.
    pub fn correct(&mut self, calibrated: &Rectification) -> Result<Option<Rectification>> {
        let Some(turn) = self.turn.filter(Turn::counts) else { return Ok(None) };
        let by = rotation(turn.axis);
        if self.rows(&between(&self.applied, &by)) < WORTH {
            return Ok(None);
        }
        self.applied = by;
        calibrated.with_right_turned(turn.axis).map(Some)
    }

    /// The largest row offset that a rotation causes, in pixels of the images.
    fn rows(&self, by: &Matrix) -> f64 {
        let [fx, fy] = self.cameras[1].focal_length;
        let [cx, cy] = self.cameras[1].principal_point;
        let (right, bottom) = (self.size.0 as f64 - 1.0, self.size.1 as f64 - 1.0);
        let places = [0.0, right / 2.0, right].map(|x| [0.0, bottom / 2.0, bottom].map(|y| [x, y]));
        let apart = places.iter().flatten().map(|[x, y]| {
            let ray = [(x - cx) / fx, (y - cy) / fy, 1.0];
            let [_, down, forward] = rotated(by, ray);
            fy * (down / forward - ray[1]).abs()
        });
        apart.fold(0.0, f64::max)
    }

    fn fitted(&self) -> Option<Turn> {
        let sights: Vec<&Sight> = self.frames.iter().flatten().collect();
        if sights.len() < LEAST {
            return None;
        }
        let mut by = IDENTITY;
        let mut fit = Fit::at(&sights, &by)?;
        for _ in 0..STEPS {
            let step = solved(fit.normal, fit.right)?;
            by = product(&rotation(step), &by);
            fit = Fit::at(&sights, &by)?;
        }
        let axis = rotation_vector(&by);
        // More frames of a static scene do not improve the estimate.
        let frames = self.frames.len() as f64;
        let mut errors = [0.0; 3];
        for i in 0..3 {
            let column = solved(fit.normal, std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))?;
            errors[i] = (frames * fit.variance * column[i]).max(0.0).sqrt();
        }
        let sure = (0..3).any(|i| axis[i].abs() > SURE * errors[i]);
        let rows = self.rows(&by);
        Some(Turn { axis, errors, matches: sights.len(), rows, counts: sure && rows >= WORTH })
    }
}

/// The rotation that takes a view from one orientation to another.
fn between(from: &Matrix, to: &Matrix) -> Matrix {
    product(to, &transposed(from))
}

/// The normal equations of one iteration.
struct Fit {
    normal: [[f64; 3]; 3],
    right: [f64; 3],
    /// Variance of the row offsets, in pixels².
    variance: f64,
}

impl Fit {
    /// The equations at the rotation `by`.
    fn at(sights: &[&Sight], by: &Matrix) -> Option<Self> {
        let turned: Vec<(f64, [f64; 3])> = sights
            .iter()
            .map(|sight| {
                let [x, y, z] = rotated(by, sight.right);
                let (x, y, f) = (x / z, y / z, sight.focal_length);
                // The row offset, and its derivative by a small rotation about each axis.
                (f * (y - sight.row), [-f * (1.0 + y * y), f * x * y, f * x])
            })
            .collect();
        let mut off: Vec<f64> = turned.iter().map(|(row, _)| row.abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        let scale = off.get(off.len() / 2)?.max(SCALE);
        let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
        let (mut squares, mut weights) = (0.0, 0.0);
        for (row, slopes) in &turned {
            let root = 1.0 / (1.0 + row * row / (scale * scale));
            let weight = root * root;
            squares += weight * row * row;
            weights += weight;
            for i in 0..3 {
                right[i] -= weight * slopes[i] * row;
                (0..3).for_each(|j| normal[i][j] += weight * slopes[i] * slopes[j]);
            }
        }
        let variance = squares / weights;
        let known = variance / (UNUSUAL * UNUSUAL);
        normal[1][1] += known;
        right[1] -= known * rotation_vector(by)[1];
        Some(Self { normal, right, variance })
    }
}
