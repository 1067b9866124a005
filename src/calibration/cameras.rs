//! The calibration of a pair of cameras.

use super::lens::Lens;
use super::matrix::{IDENTITY, Matrix, degrees, degrees_between, product, rotated, transposed};
use crate::error::{Error, Result};
use crate::image::Rect;
use crate::image::calib::{Calibration, Camera, Fit, Unit};

/// A pair of calibrated cameras. The left camera is the first one.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StereoCalibration {
    /// The original cameras, left and right.
    pub lenses: Option<[Lens; 2]>,
    /// The pose of the right camera relative to the left one.
    pub pose: Option<Pose>,
    /// The calibration of the rectified images, where the file has one.
    pub views: Option<RectifiedViews>,
    /// Width and height of the images, in pixels.
    pub size: Option<(usize, usize)>,
    /// Width and height of the right images, where they differ from those of the left ones.
    pub right_size: Option<(usize, usize)>,
    /// Whether images of another aspect ratio are the middle of these, scaled to fill them.
    pub(super) fills: bool,
    /// The unit of the baseline.
    pub unit: Unit,
    /// The contents of `calib.txt`, if that is the file.
    pub benchmark: Option<Calibration>,
    /// The same cameras with images of other sizes.
    pub others: Vec<StereoCalibration>,
}

/// The pose of a camera relative to another: a point X in the frame of the other one (the left camera of a
/// pair) is R X + T in its own. Frames are x to the right, y down, z forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// R.
    pub rotation: Matrix,
    /// T, in the unit of the calibration.
    pub translation: [f64; 3],
}

/// A rectification: two pinhole cameras at the positions of the real ones that look in the same direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectifiedViews {
    /// The rotations from each real camera to its rectified view (R1 and R2).
    pub rotations: [Matrix; 2],
    /// The rectified cameras.
    pub cameras: [Camera; 2],
    /// The left camera (x, y) in the right view's frame, in the unit of the calibration. One of the two is 0.
    pub translation: [f64; 2],
    /// Width and height of the rectified images, if the calibration has them; else they are those of the images.
    pub size: Option<(usize, usize)>,
}

/// A camera beside the pair, such as the colour camera of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThirdCamera {
    /// Its lens.
    pub lens: Lens,
    /// Its pose relative to the left camera as it took the images, not to the rectified one.
    pub pose: Pose,
    /// Width and height of its images, in pixels.
    pub size: (usize, usize),
    /// The unit of T. If unknown, it is taken to be that of the pair.
    pub unit: Unit,
}

impl Pose {
    /// The pose of a camera relative to itself.
    pub(super) const IN_PLACE: Self = Self { rotation: IDENTITY, translation: [0.0; 3] };

    /// R `point` + T.
    #[must_use]
    pub fn moved(&self, point: [f64; 3]) -> [f64; 3] {
        let turned = rotated(&self.rotation, point);
        std::array::from_fn(|i| turned[i] + self.translation[i])
    }

    /// The inverse pose.
    pub(super) fn inverse(&self) -> Self {
        let rotation = transposed(&self.rotation);
        Self { rotation, translation: rotated(&rotation, self.translation).map(|v| -v) }
    }

    /// This pose, followed by `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        let moved = rotated(&next.rotation, self.translation);
        Self {
            rotation: product(&next.rotation, &self.rotation),
            translation: std::array::from_fn(|i| moved[i] + next.translation[i]),
        }
    }

    /// The pose of the right camera relative to the left one, from the poses of both relative to a third frame.
    pub(super) fn between(left: &Self, right: &Self) -> Self {
        let rotation = product(&right.rotation, &transposed(&left.rotation));
        let moved = rotated(&rotation, left.translation);
        Self { rotation, translation: std::array::from_fn(|i| right.translation[i] - moved[i]) }
    }
}

impl RectifiedViews {
    /// The views of a rectified pair: two cameras like `camera`, `baseline` apart.
    pub(super) fn of_rectified(camera: Camera, baseline: f64) -> Self {
        Self { rotations: [IDENTITY; 2], cameras: [camera; 2], translation: [-baseline, 0.0], size: None }
    }

    /// Whether one camera is above the other, so that epipolar lines are columns.
    #[must_use]
    pub fn is_vertical(&self) -> bool {
        self.translation[1].abs() > self.translation[0].abs()
    }

    /// Checks that the views are rectified for cameras with this `pose`.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the views differ in direction or are not perpendicular to the baseline.
    pub(crate) fn check(&self, pose: &Pose) -> Result<()> {
        // Larger than the rounding of any file.
        const DEGREES: f64 = 0.1;
        let [left, right] = &self.rotations;
        let [x, y] = self.translation;
        let turn = degrees(&product(&product(right, &pose.rotation), &transposed(left)));
        let slant = degrees_between(rotated(right, pose.translation), [x, y, 0.0]);
        let (of, by) = if turn > slant { ("R", turn) } else { ("T", slant) };
        if by <= DEGREES {
            return Ok(());
        }
        Err(Error::Calibration(format!(
            "has a rectification, R1 and R2, that contradicts {of} by {by:.2} degrees; leave out R1, R2, P1 and P2 to rectify by R \
             and T, or calibrate again"
        )))
    }

    /// Whether the right camera is to the left of the left one.
    pub(crate) fn is_exchanged(&self) -> bool {
        !self.is_vertical() && self.translation[0] > 0.0
    }

    /// The views with left and right camera exchanged.
    pub(crate) fn exchanged(&self) -> Self {
        let Self { rotations: [r1, r2], cameras: [left, right], translation, size } = *self;
        Self { rotations: [r2, r1], cameras: [right, left], translation: translation.map(|v| -v), size }
    }

    /// The calibration of the rectified images, of the given size. If the right camera is to the left of the
    /// left one, they are exchanged.
    ///
    /// # Errors
    /// [`Error::Calibration`] when one camera is above the other, or both are in one place.
    pub fn calibration(&self, size: Option<(usize, usize)>, unit: Unit) -> Result<Calibration> {
        let error = |reason: &str| Err(Error::Calibration(reason.into()));
        if self.is_vertical() {
            return error("has one camera above the other, but only rows are matched");
        }
        if self.is_exchanged() {
            return Ok(Calibration { exchanged: true, ..self.exchanged().calibration(size, unit)? });
        }
        if self.translation[0] == 0.0 {
            return error("puts both cameras in one place; calibrate again");
        }
        let [left, right] = self.cameras;
        let count = |count: usize| u32::try_from(count).ok();
        Ok(Calibration {
            camera: Some(left),
            doffs: Some(right.principal_point[0] - left.principal_point[0]),
            baseline: Some(-self.translation[0]),
            width: size.and_then(|(width, _)| count(width)),
            height: size.and_then(|(_, height)| count(height)),
            unit,
            ..Calibration::default()
        })
    }
}

impl StereoCalibration {
    /// Sets the unit of the baseline, whatever the files say.
    pub fn set_unit(&mut self, unit: Unit) {
        self.unit = unit;
        if let Some(benchmark) = &mut self.benchmark {
            benchmark.unit = unit;
        }
        self.others.iter_mut().for_each(|other| other.set_unit(unit));
    }

    /// Joins calibrations of the same cameras for different image sizes; `None` if there are none.
    pub(super) fn of_sizes(sizes: Vec<Self>) -> Option<Self> {
        let mut sizes = sizes.into_iter();
        let first = sizes.next()?;
        Some(Self { others: sizes.collect(), ..first })
    }

    /// Width and height of the left and right images, if known.
    #[must_use]
    pub fn sizes(&self) -> Option<[(usize, usize); 2]> {
        self.size.map(|left| [left, self.right_size.unwrap_or(left)])
    }

    /// The calibration of an unscaled part of the images, such as a region of the sensor or a crop. Both
    /// cameras have the same part.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the part is empty or not inside the images, and when the calibration is for several sizes.
    pub fn of_part(&self, part: &Rect) -> Result<Self> {
        let (width, height) = part.size();
        let error = |reason: String| Err(Error::Calibration(reason));
        if !self.others.is_empty() {
            return error(format!(
                "is for images of {}, but a part needs cameras of the same size",
                self.shown_sizes()
            ));
        }
        let outside = |(w, h): &(usize, usize)| part.x.end > *w || part.y.end > *h;
        if width.min(height) == 0 || self.sizes().into_iter().flatten().any(|size| outside(&size)) {
            return error(format!(
                "is for images of {}, and the part of {width} x {height} from ({}, {}) on is not inside",
                self.shown_sizes(),
                part.x.start,
                part.y.start
            ));
        }
        let fits = [Some(Fit::part(part)); 2];
        let benchmark = self.benchmark.as_ref().map(|benchmark| benchmark.of_part(part));
        Ok(Self { fills: false, benchmark, ..self.in_sizes(fits) })
    }

    /// The calibration of images of these sizes, left and right, and how they derive from the calibrated images if the sizes differ.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when that is not clear.
    pub(crate) fn of_images(&self, sizes: [(usize, usize); 2]) -> Result<(Self, [Option<Fit>; 2])> {
        let is_of = |one: &&Self| one.sizes().is_none_or(|known| known == sizes);
        if let Some(one) = self.all().find(is_of) {
            return Ok((one.clone(), [None; 2]));
        }
        let fitting: Vec<_> = self.all().filter_map(|one| Some((one, one.fits(sizes)?))).collect();
        if let [(one, fits)] = fitting[..] {
            return Ok((one.in_sizes(fits), fits));
        }
        let [left, right] = sizes.map(shown);
        let these = if left == right { left } else { format!("{left} and {right}") };
        Err(Error::Mismatch(format!(
            "the calibration is for images of {}, but these are {these}",
            self.shown_sizes()
        )))
    }

    /// How images of these sizes derive from the calibrated images, if that is clear.
    fn fits(&self, sizes: [(usize, usize); 2]) -> Option<[Option<Fit>; 2]> {
        let fit = |known: (usize, usize), size: (usize, usize)| match Fit::scaled(known, size) {
            _ if known == size => Some(None),
            None if self.fills => Some(Some(Fit::middle(known, size))),
            fit => fit.map(Some),
        };
        let [left, right] = self.sizes()?;
        Some([fit(left, sizes[0])?, fit(right, sizes[1])?])
    }

    /// The calibration of images that derive from the calibrated ones by `fits`, left and right.
    fn in_sizes(&self, fits: [Option<Fit>; 2]) -> Self {
        let lens = |lenses: [Lens; 2], i: usize| fits[i].map_or(lenses[i], |fit| lenses[i].in_size(&fit));
        let views = self.views.map(|views| match fits[0] {
            // Views with a size of their own stay as they are.
            Some(fit) if views.size.is_none_or(|size| Some(size) == self.size) => RectifiedViews {
                cameras: views.cameras.map(|camera| camera.in_size(&fit)),
                size: None,
                ..views
            },
            _ => views,
        });
        let size = |i: usize| fits[i].map(|fit| fit.size).or(self.sizes().map(|sizes| sizes[i]));
        Self {
            lenses: self.lenses.map(|lenses| [lens(lenses, 0), lens(lenses, 1)]),
            views,
            size: size(0),
            right_size: size(1).filter(|right| Some(*right) != size(0)),
            ..self.clone()
        }
    }

    /// This calibration and those of the same cameras for other image sizes.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.others)
    }

    fn shown_sizes(&self) -> String {
        let mut sizes: Vec<_> = self.all().filter_map(Self::sizes).flatten().map(shown).collect();
        sizes.dedup();
        if sizes.is_empty() { "a size that it does not say".into() } else { sizes.join(", ") }
    }

    /// The calibration of rectified images of this `size`: the entry of that size if the file has several,
    /// else scaled as in [`Calibration::of_size`]. `None` if the file has no rectification.
    ///
    /// # Errors
    /// The errors of [`RectifiedViews::calibration`], and [`Error::Calibration`] when it is for several sizes but not for this one.
    pub fn of_rectified_images(&self, size: Option<(usize, usize)>) -> Result<Option<Calibration>> {
        let in_size = |of: Calibration| size.map_or_else(|| of.clone(), |size| of.of_size(size));
        if let Some(benchmark) = &self.benchmark {
            return Ok(Some(in_size(benchmark.clone())));
        }
        let one = self.all().find(|one| one.size.is_some() && one.size == size);
        if let Some(one) = one.or(Some(self).filter(|one| one.others.is_empty() || one.views.is_none())) {
            let Some(views) = one.views else { return Ok(None) };
            return views.calibration(views.size.or(one.size), one.unit).map(|found| Some(in_size(found)));
        }
        let mut fitting = Vec::new();
        for one in self.all() {
            if let Some(views) = one.views {
                let found = in_size(views.calibration(views.size.or(one.size), one.unit)?);
                fitting.extend(Some(found).filter(|found| found.fit.is_some()));
            }
        }
        if fitting.len() == 1 {
            return Ok(fitting.pop());
        }
        let sizes = self.shown_sizes();
        let of = size.map_or("; say which".into(), |size| format!(", but these are {}", shown(size)));
        Err(Error::Calibration(format!("is for images of {sizes}{of}")))
    }

    /// Derives the pose from the rectification, in files without a pose.
    pub(super) fn with_pose_of_views(mut self) -> Self {
        self.pose = self.pose.or_else(|| {
            let RectifiedViews { rotations: [left, right], translation: [x, y], .. } = self.views?;
            // A point goes to the left view, along the baseline to the right one, and to the right camera.
            let back = transposed(&right);
            Some(Pose { rotation: product(&back, &left), translation: rotated(&back, [x, y, 0.0]) })
        });
        self
    }
}

fn shown((width, height): (usize, usize)) -> String {
    format!("{width} x {height}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_unit_applies_to_every_size() {
        let other = StereoCalibration { size: Some((320, 240)), unit: Unit::Metre, ..Default::default() };
        let benchmark = Some(Calibration::default());
        let mut all = StereoCalibration { others: vec![other], benchmark, ..Default::default() };
        all.set_unit(Unit::Centimetre);
        assert!(all.all().all(|one| one.unit == Unit::Centimetre));
        assert_eq!(all.of_rectified_images(Some((320, 240))).unwrap().unwrap().unit, Unit::Centimetre);
    }
}
