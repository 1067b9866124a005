//! Rectified pairs from images as the cameras took them: by a calibration, or by matches of the pair alone.
//!
//! The rectified views are those of Bouguet's method, as OpenCV's `stereoRectify` chooses them. The place in the image that each
//! of their pixels shows is computed in double precision, with the same bits on every platform, and rounded to 1/256 px;
//! values are interpolated by cubics in integers.
//!
//! ```
//! use mrfgs::rectification::{Options, Rectification};
//! use mrfgs::{Matcher, Pair, calibration, depth::Rig};
//!
//! # fn main() -> mrfgs::Result<()> {
//! let cameras = calibration::read(&["testdata/raw/cameras.yml".into()])?;
//! let raw = Pair::open("testdata/raw/left.png", "testdata/raw/right.png")?;
//! let rectification = Rectification::new(&cameras, raw.size(), &Options::default())?;
//! let pair = rectification.apply(&raw)?;
//! # let pair = pair.crop(&mrfgs::image::Rect { x: 60..124, y: 60..108 });
//! let found = Matcher::new()?.run(&pair, 0..=31)?;
//! let depths = Rig::new(&rectification.calibration()?)?.depths(&found.disparity());
//! # assert_eq!(depths.size(), (64, 48));
//! # Ok(())
//! # }
//! ```

mod doubts;
mod from_matches;
pub(crate) mod least_squares;
mod options;
mod sampling;
mod trust;
mod two_views;
mod views;

pub use doubts::Doubt;
pub use options::Options;
pub use trust::Trust;
pub use two_views::Correspondence;

use crate::calibration::cameras::{StereoCalibration, Views};
use crate::calibration::lens::{Distortion, Lens};
use crate::calibration::matrix::{IDENTITY, Matrix, product, rotated, rotation, transposed};
use crate::error::{Error, Purpose, Result};
use crate::image::calib::{Calibration, Camera, Unit};
use crate::image::{Pair, Plane};
use crate::memory;
use crate::threads;
use rayon::prelude::*;
use sampling::{NOWHERE, Place};

/// How a pair of images becomes a rectified pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectification {
    lenses: [Lens; 2],
    /// Their epipolar lines are rows.
    views: Views,
    /// Of the images, and of the rectified ones: the same, unless the calibration says another.
    sizes: [(usize, usize); 2],
    unit: Unit,
    doubts: Vec<Doubt>,
    /// Where it comes from matches alone, without a scale.
    trust: Option<Trust>,
    /// Where the pixels of both rectified views come from, row by row, where they are [kept](Self::keep_places).
    places: Option<[Vec<Place>; 2]>,
}

impl Rectification {
    /// The rectification of images of `size` by a calibration: that which the calibration holds, unless the options ask for
    /// another one, or else Bouguet's.
    ///
    /// Where one camera is above the other, the views are turned by a quarter, so that rows are epipolar lines and the right
    /// view is to the right: the upper camera is the left one after a quarter turn counter-clockwise, the lower one after a
    /// quarter turn clockwise.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the calibration lacks the lenses or how they stand, when the right camera is on the left of
    /// the left one, when its rectification contradicts how they stand, or when no rectified views exist or one of them shows
    /// next to nothing; [`Error::Mismatch`] when it is for images of another size.
    pub fn new(calibration: &StereoCalibration, size: (usize, usize), options: &Options) -> Result<Self> {
        options.check()?;
        let calibration = calibration.of_size(size);
        let error = |reason: &str| Error::Calibration(reason.into());
        if let Some((width, height)) = calibration.size.filter(|known| *known != size) {
            return Err(Error::Mismatch(format!(
                "the calibration is for images of {width} x {height} and these are {} x {}",
                size.0, size.1
            )));
        }
        let lenses = calibration
            .lenses
            .ok_or_else(|| error("does not say the lenses, K1, D1, K2 and D2, which rectification takes"))?;
        let views = match (calibration.views, &calibration.pose) {
            (Some(views), pose) if options.alpha.is_none() => {
                pose.as_ref().map_or(Ok(()), |pose| views.check(pose))?;
                views
            }
            (_, Some(pose)) => views::choose(&lenses, pose, size, options)?,
            _ => return Err(error("does not say how the cameras stand to each other, R and T")),
        };
        let mut doubts = Vec::new();
        if calibration.size.is_none() {
            doubts.extend(doubts::of_lenses(&lenses, size));
        }
        // Views that are chosen here are around the middle of the images.
        if calibration.views.is_some() && options.alpha.is_none() {
            doubts.extend(doubts::of_views(&lenses, &views, size));
        }
        Self::of_views(&lenses, views, size, calibration.unit, doubts)
    }

    /// That by `views`, turned where need be.
    fn of_views(
        lenses: &[Lens; 2],
        views: Views,
        size: (usize, usize),
        unit: Unit,
        doubts: Vec<Doubt>,
    ) -> Result<Self> {
        let (views, rectified) = turned(views, views.size.unwrap_or(size));
        // Says where the right camera is on the left.
        views.calibration(None, unit)?;
        let (lenses, sizes) = (*lenses, [size, rectified]);
        let found = Self { lenses, views, sizes, unit, doubts, trust: None, places: None };
        found.check_shown().map(|()| found)
    }

    /// An error where a view shows next to nothing of its image.
    fn check_shown(&self) -> Result<()> {
        const STEPS: usize = 48;
        const LEAST: f64 = 0.05;
        let [images, views] = self.sizes.map(|(width, height)| [width as f64, height as f64]);
        for (view, name) in ["left", "right"].into_iter().enumerate() {
            let at = |step: usize, i: usize| (step as f64 + 0.5) / STEPS as f64 * views[i] - 0.5;
            let steps = (0..STEPS).flat_map(|y| (0..STEPS).map(move |x| [x, y]));
            let inside = |source: [f64; 2]| (0..2).all(|i| (0.0..=images[i] - 1.0).contains(&source[i]));
            let shown =
                steps.filter(|[x, y]| self.source(view, at(*x, 0), at(*y, 1)).is_some_and(inside)).count();
            let share = shown as f64 / (STEPS * STEPS) as f64;
            if share < LEAST {
                return Err(Error::Calibration(format!(
                    "leads to a {name} view of which {:.1} % shows the image, as of cameras that look past each other; check its \
                     rotations, its projections and that it is of these cameras",
                    100.0 * share
                )));
            }
        }
        Ok(())
    }

    /// What is probably wrong with the calibration, or with the matches.
    #[must_use]
    pub fn doubts(&self) -> &[Doubt] {
        &self.doubts
    }

    /// (width, height) of the rectified images.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.sizes[1]
    }

    /// Where the left image shows what the rectified left view has at (x, y), in pixels. `None` where it cannot show it; what
    /// is found may still be outside of the image.
    #[must_use]
    pub fn left(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        self.source(0, x, y)
    }

    /// The same for the right views.
    #[must_use]
    pub fn right(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        self.source(1, x, y)
    }

    /// [`Rectification::left`] and [`Rectification::right`] of every pixel: x, then y; +infinity where there is nothing.
    ///
    /// # Errors
    /// [`Error::Memory`] when the system has not enough memory.
    pub fn maps(&self) -> Result<[[Plane<f32>; 2]; 2]> {
        let (width, height) = self.size();
        let values = (width as u64).saturating_mul(height as u64).saturating_mul(4);
        memory::check(values.saturating_mul(size_of::<f32>() as u64), Purpose::Image)?;
        Ok([0, 1].map(|view| {
            [0, 1].map(|i| {
                Plane::from_fn(width, height, |x, y| {
                    self.source(view, x as f64, y as f64).map_or(f32::INFINITY, |at| at[i] as f32)
                })
            })
        }))
    }

    /// Finds out now where each pixel comes from, instead of for each pair: for many pairs of the same cameras. It keeps 16
    /// bytes a pixel, and changes no bit of what [`Rectification::apply`] gives.
    ///
    /// # Errors
    /// [`Error::Memory`] when the system has not enough memory.
    pub fn keep_places(&mut self) -> Result<()> {
        let (width, height) = self.size();
        let of_view = |view: usize| {
            let mut places = memory::filled(width * height, NOWHERE)?;
            let rows = places.par_chunks_mut(width).enumerate();
            let of_row = |(y, places): (usize, &mut [Place])| {
                places.iter_mut().enumerate().for_each(|(x, place)| *place = self.place(view, x, y));
            };
            threads::run(|| rows.for_each(of_row));
            Ok::<_, Error>(places)
        };
        self.places = Some([of_view(0)?, of_view(1)?]);
        Ok(())
    }

    fn place(&self, view: usize, x: usize, y: usize) -> Place {
        self.source(view, x as f64, y as f64).map_or(NOWHERE, sampling::place)
    }

    fn source(&self, view: usize, x: f64, y: f64) -> Option<[f64; 2]> {
        let Camera { focal_length: [fx, fy], principal_point: [cx, cy] } = self.views.cameras[view];
        let back = transposed(&self.views.rotations[view]);
        self.lenses[view].project(rotated(&back, [(x - cx) / fx, (y - cy) / fy, 1.0]))
    }

    /// The rectified pair. A pixel is masked where its source is not in the image, or masked, or where one of the sixteen pixels
    /// is that its value takes. A pair of 8-bit levels stays one.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the pair is of another size; [`Error::Memory`] when the system has not enough memory.
    pub fn apply(&self, pair: &Pair) -> Result<Pair> {
        let [(width, height), rectified] = self.sizes;
        if pair.size() != (width, height) {
            let (w, h) = pair.size();
            return Err(Error::Mismatch(format!(
                "the rectification is of images of {width} x {height} and these are {w} x {h}"
            )));
        }
        let images = [pair.left(), pair.right()];
        let bytes = images.iter().all(|image| image.holds_bytes());
        let view = |view: usize| match &self.places {
            Some(places) => {
                sampling::resample(images[view], rectified, bytes, |x, y| places[view][y * rectified.0 + x])
            }
            None => sampling::resample(images[view], rectified, bytes, |x, y| self.place(view, x, y)),
        };
        Ok(Pair::new(view(0)?, view(1)?)?.doubted_as(pair))
    }

    /// The calibration of the rectified pair.
    ///
    /// # Errors
    /// [`Error::Calibration`] where the pair was rectified by [matches alone](Self::of_matches), which show no scale.
    pub fn calibration(&self) -> Result<Calibration> {
        if self.trust.is_some() {
            return Err(Error::Calibration(
                "is unknown, since the pair was rectified by its own matches, which show no scale".into(),
            ));
        }
        self.views.calibration(Some(self.size()), self.unit)
    }

    /// That of a pair that is rectified already, which changes nothing: by the cameras of its calibration.
    ///
    /// # Errors
    /// [`Error::Calibration`] where it lacks the camera or the baseline.
    pub fn of_rectified(calibration: &Calibration, size: (usize, usize)) -> Result<Self> {
        let Calibration { camera: Some(left), baseline: Some(baseline), .. } = *calibration else {
            return Err(Error::Calibration("does not say the cameras, cam0 and baseline".into()));
        };
        let mut right = left;
        right.principal_point[0] += calibration.doffs.unwrap_or(0.0);
        let found = Self::of_cameras([left, right], size)?;
        let translation = [-baseline, 0.0];
        Ok(Self { views: Views { translation, ..found.views }, unit: calibration.unit, ..found })
    }

    /// The same by these cameras, whose distance does not matter.
    pub(crate) fn of_cameras(cameras: [Camera; 2], size: (usize, usize)) -> Result<Self> {
        let lens = |camera: Camera| Lens::new(camera.focal_length, camera.principal_point, Distortion::NONE);
        let lenses = [lens(cameras[0])?, lens(cameras[1])?];
        let views = Views { rotations: [IDENTITY; 2], cameras, translation: [-1.0, 0.0], size: None };
        Self::of_views(&lenses, views, size, Unit::default(), Vec::new())
    }

    /// The same of a rig whose right camera has turned about this axis of its rectified view, as long as the angle in radians:
    /// [`Turn::axis`](crate::drift::Turn::axis).
    ///
    /// # Errors
    /// [`Error::Memory`] where it [keeps its places](Self::keep_places) and the machine has not enough for others.
    pub fn with_right_turned(&self, axis: [f64; 3]) -> Result<Self> {
        let mut turned = Self { places: None, ..self.clone() };
        turned.views.rotations[1] = product(&rotation(axis), &self.views.rotations[1]);
        if self.places.is_some() {
            turned.keep_places()?;
        }
        Ok(turned)
    }

    /// The cameras of the rectified views.
    pub(crate) fn cameras(&self) -> &[Camera; 2] {
        &self.views.cameras
    }

    /// The rotations from the frame of each camera to that of its rectified view.
    #[must_use]
    pub fn rotations(&self) -> &[Matrix; 2] {
        &self.views.rotations
    }
}

/// Views whose epipolar lines are columns, turned so that they are rows and the right view is to the right; and their size.
fn turned(views: Views, (width, height): (usize, usize)) -> (Views, (usize, usize)) {
    if !views.is_vertical() {
        return (views, (width, height));
    }
    let (right, bottom) = (width as f64 - 1.0, height as f64 - 1.0);
    let Views { rotations, cameras, translation: [_, down], size } = views;
    // The left camera is above the right one where it is up in the frame of the right view.
    let above = down < 0.0;
    let turn: Matrix = if above {
        [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    } else {
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    };
    let cameras = cameras.map(|Camera { focal_length: [fx, fy], principal_point: [cx, cy] }| Camera {
        focal_length: [fy, fx],
        principal_point: if above { [cy, right - cx] } else { [bottom - cy, cx] },
    });
    let rotations = rotations.map(|rotation| product(&turn, &rotation));
    let size = size.map(|(width, height)| (height, width));
    (Views { rotations, cameras, translation: [-down.abs(), 0.0], size }, (height, width))
}
