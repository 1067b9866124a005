//! Rectifies raw images by a calibration, or by matches of the pair alone.
//!
//! The rectified views are chosen by Bouguet's method, like OpenCV's `stereoRectify`. The source position of
//! each of their pixels is computed in double precision, with the same bits on every platform, and rounded to
//! 1/256 px; values are interpolated by cubics in integers.
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

use crate::calibration::cameras::{RectifiedViews, StereoCalibration};
use crate::calibration::lens::{Distortion, Lens};
use crate::calibration::matrix::{IDENTITY, Matrix, product, rotated, rotation, transposed};
use crate::error::{Error, Purpose, Result};
use crate::image::calib::{Calibration, Camera, Fit, Unit};
use crate::image::{Image, Pair, Plane, Rect};
use crate::memory;
use crate::threads;
use crate::threads::prelude::*;
use sampling::{NOWHERE, Place};
use std::borrow::Cow;

/// The mapping from a pair of images to a rectified pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectification {
    lenses: [Lens; 2],
    /// The rectified views, whose epipolar lines are rows.
    views: RectifiedViews,
    /// (width, height) of the images of both views.
    images: [(usize, usize); 2],
    /// (width, height) of the rectified views: that of the left image, unless the calibration has another.
    size: (usize, usize),
    unit: Unit,
    /// Whether the left view is made from the right image, and the right view from the left image.
    exchanged: bool,
    doubts: Vec<Doubt>,
    /// Set if it comes from matches alone, without a scale.
    trust: Option<Trust>,
    /// The source positions for both rectified views, row by row, if [kept](Self::keep_places).
    places: Option<[Vec<Place>; 2]>,
}

impl Rectification {
    /// The rectification of images of `size` by a calibration: that which the calibration holds, or Bouguet's
    /// if there is none or the options ask for another.
    ///
    /// If one camera is above the other, the views are rotated by a quarter turn, so that rows are epipolar
    /// lines and the right view is to the right: the upper camera is the left one after a quarter turn
    /// counter-clockwise, the lower one after a quarter turn clockwise.
    ///
    /// A calibration for images of another size is used if these are scaled, or cropped as cameras of this
    /// make do. If the right camera is to the left of the left one, the cameras are exchanged, but not the
    /// images: see [`Rectification::for_pair`]. [`Rectification::doubts`] reports both.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the calibration lacks the lenses or the pose, when its rectification contradicts the pose, or when
    /// no rectified views exist or one of them shows next to nothing; [`Error::Mismatch`] when it is for images of another size.
    pub fn new(calibration: &StereoCalibration, size: (usize, usize), options: &Options) -> Result<Self> {
        Self::of_sizes(calibration, [size; 2], options)
    }

    /// Like [`Rectification::new`], for left and right images of these sizes. The rectified views have the
    /// size of the left images, unless the calibration has another.
    ///
    /// # Errors
    /// The errors of [`Rectification::new`].
    pub fn of_sizes(
        calibration: &StereoCalibration,
        sizes: [(usize, usize); 2],
        options: &Options,
    ) -> Result<Self> {
        options.check()?;
        let (calibration, fits) = calibration.of_images(sizes)?;
        let error = |reason: &str| Error::Calibration(reason.into());
        let lenses = calibration
            .lenses
            .ok_or_else(|| error("lacks the lenses (K1, D1, K2 and D2), which rectification needs; give the file that has them, too"))?;
        let views = match (calibration.views, &calibration.pose) {
            (Some(views), pose) if options.alpha.is_none() => {
                pose.as_ref().map_or(Ok(()), |pose| views.check(pose))?;
                views
            }
            (_, Some(pose)) => {
                let [size, right] = sizes;
                let [left_lens, mut right_lens] = lenses;
                if right != size {
                    right_lens = right_lens.in_size(&Fit::centred(right, size));
                }
                views::choose(&[left_lens, right_lens], pose, size, options)?
            }
            _ => {
                return Err(error(
                    "lacks the pose of the right camera (R and T), which rectification needs; give the file that has it, too",
                ));
            }
        };
        let mut doubts: Vec<_> = fits.into_iter().flatten().map(|fit| Doubt::OtherSize { fit }).collect();
        doubts.dedup();
        if calibration.size.is_none() {
            doubts.extend(doubts::of_lenses(&lenses, sizes));
        }
        // Views that are chosen here are always centred.
        if calibration.views.is_some() && options.alpha.is_none() {
            doubts.extend(doubts::of_views(&lenses, &views, sizes));
        }
        let [x, y] = views.translation;
        doubts.extend(doubts::of_baseline(x.abs().max(y.abs()), calibration.unit));
        Self::of_views(&lenses, views, sizes, calibration.unit, doubts)
    }

    /// The rectification by `views`, rotated if they are vertical.
    fn of_views(
        lenses: &[Lens; 2],
        views: RectifiedViews,
        images: [(usize, usize); 2],
        unit: Unit,
        doubts: Vec<Doubt>,
    ) -> Result<Self> {
        let (views, size) = turned(views, views.size.unwrap_or(images[0]));
        let (lenses, exchanged) = (*lenses, false);
        let mut found =
            Self { lenses, views, images, size, unit, exchanged, doubts, trust: None, places: None };
        if views.is_exchanged() {
            found.lenses.reverse();
            found.views = views.exchanged();
            // Images of another size belong to the camera of that size.
            found.images.reverse();
            found.exchanged = found.images != images;
            found.doubts.insert(0, Doubt::Exchanged { images: found.exchanged });
        }
        // Fails if both cameras are in one place.
        found.views.calibration(None, unit)?;
        found.check_shown().map(|()| found)
    }

    /// Whether the calibration has the right camera to the left of the left one, so that the cameras were exchanged, but not the images.
    pub(crate) fn has_exchanged_cameras(&self) -> bool {
        self.doubts.contains(&Doubt::Exchanged { images: false })
    }

    /// The same rectification, with the images exchanged too.
    pub(crate) fn with_images_exchanged(mut self) -> Self {
        self.exchanged = true;
        for doubt in &mut self.doubts {
            if let Doubt::Exchanged { images } = doubt {
                *images = true;
            }
        }
        self
    }

    /// An error if a view shows next to nothing of its image.
    fn check_shown(&self) -> Result<()> {
        const STEPS: usize = 48;
        const LEAST: f64 = 0.05;
        let side = |(width, height): (usize, usize)| [width as f64, height as f64];
        let views = side(self.size);
        for (view, name) in ["left", "right"].into_iter().enumerate() {
            let images = side(self.images[view]);
            let at = |step: usize, i: usize| (step as f64 + 0.5) / STEPS as f64 * views[i] - 0.5;
            let steps = (0..STEPS).flat_map(|y| (0..STEPS).map(move |x| [x, y]));
            let inside = |source: [f64; 2]| (0..2).all(|i| (0.0..=images[i] - 1.0).contains(&source[i]));
            let shown =
                steps.filter(|[x, y]| self.source(view, at(*x, 0), at(*y, 1)).is_some_and(inside)).count();
            let share = shown as f64 / (STEPS * STEPS) as f64;
            if share < LEAST {
                return Err(Error::Calibration(format!(
                    "leads to a {name} view of which only {:.1} % shows the image, as if the cameras looked past each other; check its \
                     rotations, its projections and that it is of these cameras",
                    100.0 * share
                )));
            }
        }
        Ok(())
    }

    /// Likely faults of the calibration, or of the matches.
    #[must_use]
    pub fn doubts(&self) -> &[Doubt] {
        &self.doubts
    }

    /// (width, height) of the rectified images.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The position in the left image (the right one if they were [exchanged](Doubt::Exchanged)) of the point
    /// (x, y) of the rectified left view, in pixels. `None` if the lens cannot show it; the position may be
    /// outside the image.
    #[must_use]
    pub fn left(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        self.source(0, x, y)
    }

    /// Like [`Rectification::left`], for the right view.
    #[must_use]
    pub fn right(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        self.source(1, x, y)
    }

    /// [`Rectification::left`] and [`Rectification::right`] for every pixel: x, then y; +infinity where there is none.
    ///
    /// # Errors
    /// [`Error::Memory`] when the system has too little memory.
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

    /// Computes the source positions of all pixels once, instead of for each pair: for many pairs of the same
    /// cameras. It takes 16 bytes per pixel, and does not change the result of [`Rectification::apply`].
    ///
    /// # Errors
    /// [`Error::Memory`] when the system has too little memory.
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

    /// Rectifies a pair. A pixel is masked if its source is masked or outside the image, or if one of the
    /// sixteen pixels around it that contribute is. A pair of 8-bit levels stays one.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the pair is of another size; [`Error::Memory`] when the system has too little memory.
    pub fn apply(&self, pair: &Pair) -> Result<Pair> {
        let (mut images, mut sizes) = ([pair.left(), pair.right()], pair.own_sizes());
        if self.exchanged {
            images.reverse();
            sizes.reverse();
        }
        if let Some(i) = (0..2).find(|i| sizes[*i] != self.images[*i]) {
            let [(width, height), (w, h)] = [self.images[i], sizes[i]];
            return Err(Error::Mismatch(format!(
                "the rectification is of images of {width} x {height} but these are {w} x {h}"
            )));
        }
        let bytes = images.iter().all(|image| image.holds_bytes());
        let view = |view: usize| {
            let (image, rectified): (Cow<Image>, _) = match sizes[view] {
                size if size == pair.size() => (Cow::Borrowed(images[view]), self.size),
                size => (Cow::Owned(images[view].crop(&Rect::whole(size))), self.size),
            };
            match &self.places {
                Some(places) => {
                    sampling::resample(&image, rectified, bytes, |x, y| places[view][y * rectified.0 + x])
                }
                None => sampling::resample(&image, rectified, bytes, |x, y| self.place(view, x, y)),
            }
        };
        Ok(Pair::new(view(0)?, view(1)?)?.doubted_as(pair))
    }

    /// The calibration of the rectified pair.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the pair was rectified by [matches alone](Self::of_matches), which show no scale.
    pub fn calibration(&self) -> Result<Calibration> {
        if self.trust.is_some() {
            return Err(Error::Calibration(
                "is unknown, since the pair was rectified by its own matches, which show no scale".into(),
            ));
        }
        self.views.calibration(Some(self.size()), self.unit)
    }

    /// The identity for a rectified pair, with the cameras of its calibration.
    ///
    /// # Errors
    /// [`Error::Calibration`] when it lacks the camera or the baseline.
    pub fn of_rectified(calibration: &Calibration, size: (usize, usize)) -> Result<Self> {
        let Calibration { camera: Some(left), baseline: Some(baseline), .. } = *calibration else {
            return Err(Error::Calibration("does not say the cameras, cam0 and baseline".into()));
        };
        let mut right = left;
        right.principal_point[0] += calibration.doffs.unwrap_or(0.0);
        let found = Self::of_cameras([left, right], size)?;
        let translation = [-baseline, 0.0];
        Ok(Self { views: RectifiedViews { translation, ..found.views }, unit: calibration.unit, ..found })
    }

    /// The identity for these cameras, with an arbitrary baseline.
    pub(crate) fn of_cameras(cameras: [Camera; 2], size: (usize, usize)) -> Result<Self> {
        let lens = |camera: Camera| Lens::new(camera.focal_length, camera.principal_point, Distortion::NONE);
        let lenses = [lens(cameras[0])?, lens(cameras[1])?];
        let views =
            RectifiedViews { rotations: [IDENTITY; 2], cameras, translation: [-1.0, 0.0], size: None };
        Self::of_views(&lenses, views, [size; 2], Unit::default(), Vec::new())
    }

    /// The same rectification for a rig whose right camera has rotated about this axis of its rectified view,
    /// with the angle in radians as length: [`Turn::axis`](crate::drift::Turn::axis).
    ///
    /// # Errors
    /// [`Error::Memory`] if it [keeps its places](Self::keep_places) and memory is too small for new ones.
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

    /// The rotations from each camera to its rectified view.
    #[must_use]
    pub fn rotations(&self) -> &[Matrix; 2] {
        &self.views.rotations
    }
}

/// Rotates vertical views so that epipolar lines are rows and the right view is to the right; with their size.
fn turned(views: RectifiedViews, (width, height): (usize, usize)) -> (RectifiedViews, (usize, usize)) {
    if !views.is_vertical() {
        return (views, (width, height));
    }
    let (right, bottom) = (width as f64 - 1.0, height as f64 - 1.0);
    let RectifiedViews { rotations, cameras, translation: [_, down], size } = views;
    // The left camera is above the right one if it is up in the frame of the right view.
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
    (RectifiedViews { rotations, cameras, translation: [-down.abs(), 0.0], size }, (height, width))
}
