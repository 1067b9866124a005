//! What a calibration says of a pair of cameras.

use super::lens::Lens;
use super::matrix::{IDENTITY, Matrix, degrees, degrees_between, product, rotated, transposed};
use crate::error::{Error, Result};
use crate::image::Rect;
use crate::image::calib::{Calibration, Camera, Fit, Unit};

/// A pair of cameras as a calibration program found it. The left camera is the first one.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StereoCalibration {
    /// The cameras as they took their images, left and right.
    pub lenses: Option<[Lens; 2]>,
    /// How the right camera stands to the left one.
    pub pose: Option<Pose>,
    /// A rectification that is part of the calibration.
    pub views: Option<Views>,
    /// Width and height of the images, in pixels.
    pub size: Option<(usize, usize)>,
    /// Width and height of the right images, where they differ from those of the left ones.
    pub right_size: Option<(usize, usize)>,
    /// Whether images of another size are the middle of these, scaled until it fills them.
    pub(super) fills: bool,
    /// The unit of the baseline.
    pub unit: Unit,
    /// What `calib.txt` says, where it is one.
    pub benchmark: Option<Calibration>,
    /// The same cameras with images of other sizes.
    pub others: Vec<StereoCalibration>,
}

/// How the right camera stands to the left one: a point X in the frame of the left camera is R X + T in that of the right
/// one. Frames are x to the right, y down, z forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// R.
    pub rotation: Matrix,
    /// T, in the unit of the calibration.
    pub translation: [f64; 3],
}

/// A rectification: two pinhole cameras that look in the same direction from where the real ones stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Views {
    /// From the frame of each real camera to that of its rectified view (R1 and R2).
    pub rotations: [Matrix; 2],
    /// The rectified cameras.
    pub cameras: [Camera; 2],
    /// Where the left camera is in the frame of the right view: x and y, in the unit of the calibration. One of them is 0.
    pub translation: [f64; 2],
    /// Width and height of the rectified images, where the calibration says them; else they are those of the images.
    pub size: Option<(usize, usize)>,
}

/// A camera beside the pair, such as the colour camera of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThirdCamera {
    /// Where it shows a ray.
    pub lens: Lens,
    /// How it stands to the left camera: a point X in the frame of that one is R X + T in its own. The left camera is the one that took
    /// the images, not the rectified one, where the two differ.
    pub pose: Pose,
    /// Width and height of its images, in pixels.
    pub size: (usize, usize),
    /// The unit of T. One that is unknown is taken for that of the pair.
    pub unit: Unit,
}

impl Pose {
    /// Of one camera to itself.
    pub(super) const IN_PLACE: Self = Self { rotation: IDENTITY, translation: [0.0; 3] };

    /// The way back.
    pub(super) fn inverse(&self) -> Self {
        let rotation = transposed(&self.rotation);
        Self { rotation, translation: rotated(&rotation, self.translation).map(|v| -v) }
    }

    /// This one, and then `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        let moved = rotated(&next.rotation, self.translation);
        Self {
            rotation: product(&next.rotation, &self.rotation),
            translation: std::array::from_fn(|i| moved[i] + next.translation[i]),
        }
    }

    /// How the right camera stands to the left one, where both stand like this to a third frame: from that to each of them.
    pub(super) fn between(left: &Self, right: &Self) -> Self {
        let rotation = product(&right.rotation, &transposed(&left.rotation));
        let moved = rotated(&rotation, left.translation);
        Self { rotation, translation: std::array::from_fn(|i| right.translation[i] - moved[i]) }
    }
}

impl Views {
    /// Of a pair that is rectified already: two like `camera`, `baseline` apart.
    pub(super) fn of_rectified(camera: Camera, baseline: f64) -> Self {
        Self { rotations: [IDENTITY; 2], cameras: [camera; 2], translation: [-baseline, 0.0], size: None }
    }

    /// Whether columns, not rows, are epipolar lines: one camera is above the other.
    #[must_use]
    pub fn is_vertical(&self) -> bool {
        self.translation[1].abs() > self.translation[0].abs()
    }

    /// Whether it makes rectified views of cameras that stand like `pose`.
    ///
    /// # Errors
    /// [`Error::Calibration`] where the views look past each other, or not at right angles to the baseline.
    pub(crate) fn check(&self, pose: &Pose) -> Result<()> {
        // What the digits of a file leave open is far less.
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

    /// Whether the right camera is on the left of the left one.
    pub(crate) fn is_exchanged(&self) -> bool {
        !self.is_vertical() && self.translation[0] > 0.0
    }

    /// The calibration with left and right camera exchanged.
    pub(crate) fn exchanged(&self) -> Self {
        let Self { rotations: [r1, r2], cameras: [left, right], translation, size } = *self;
        Self { rotations: [r2, r1], cameras: [right, left], translation: translation.map(|v| -v), size }
    }

    /// The calibration of the rectified images, of the given size. Where the right camera is on the left of the left one, each counts as
    /// the other.
    ///
    /// # Errors
    /// [`Error::Calibration`] where one camera is above the other, or both are in one place.
    pub fn calibration(&self, size: Option<(usize, usize)>, unit: Unit) -> Result<Calibration> {
        let error = |reason: &str| Err(Error::Calibration(reason.into()));
        if self.is_vertical() {
            return error("has one camera above the other, and only rows are matched");
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
    /// States the unit of the baseline, whatever the files say.
    pub fn set_unit(&mut self, unit: Unit) {
        self.unit = unit;
        if let Some(benchmark) = &mut self.benchmark {
            benchmark.unit = unit;
        }
        self.others.iter_mut().for_each(|other| other.set_unit(unit));
    }

    /// That of the same cameras with images of all these sizes; `None` without any.
    pub(super) fn of_sizes(sizes: Vec<Self>) -> Option<Self> {
        let mut sizes = sizes.into_iter();
        let first = sizes.next()?;
        Some(Self { others: sizes.collect(), ..first })
    }

    /// Width and height of the left and of the right images, where they are known.
    #[must_use]
    pub fn sizes(&self) -> Option<[(usize, usize); 2]> {
        self.size.map(|left| [left, self.right_size.unwrap_or(left)])
    }

    /// The calibration of a part of the images, unscaled, such as a camera reads of its sensor or a program cuts out. Both cameras have the same
    /// part.
    ///
    /// # Errors
    /// [`Error::Calibration`] where the part is empty or not inside the images, and where it is for images of several sizes.
    pub fn of_part(&self, part: &Rect) -> Result<Self> {
        let (width, height) = part.size();
        let error = |reason: String| Err(Error::Calibration(reason));
        if !self.others.is_empty() {
            return error(format!("is for images of {}, and a part takes one size", self.shown_sizes()));
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

    /// What it says of images of these sizes, left and right, and how these come out of those that it is of, where they are others.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where nothing tells that.
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
            "the calibration is for images of {} and these are {these}",
            self.shown_sizes()
        )))
    }

    /// How images of these sizes come out of those that it is of, where that is clear.
    fn fits(&self, sizes: [(usize, usize); 2]) -> Option<[Option<Fit>; 2]> {
        let fit = |known: (usize, usize), size: (usize, usize)| match Fit::scaled(known, size) {
            _ if known == size => Some(None),
            None if self.fills => Some(Some(Fit::middle(known, size))),
            fit => fit.map(Some),
        };
        let [left, right] = self.sizes()?;
        Some([fit(left, sizes[0])?, fit(right, sizes[1])?])
    }

    /// The calibration of images that come out of the calibrated ones by `fits`, left and right.
    fn in_sizes(&self, fits: [Option<Fit>; 2]) -> Self {
        let lens = |lenses: [Lens; 2], i: usize| fits[i].map_or(lenses[i], |fit| lenses[i].in_size(&fit));
        let views = self.views.map(|views| match fits[0] {
            // Views of a size of their own stay what they are.
            Some(fit) if views.size.is_none_or(|size| Some(size) == self.size) => {
                Views { cameras: views.cameras.map(|camera| camera.in_size(&fit)), size: None, ..views }
            }
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

    /// It, and those of the same cameras with images of other sizes.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.others)
    }

    fn shown_sizes(&self) -> String {
        let mut sizes: Vec<_> = self.all().filter_map(Self::sizes).flatten().map(shown).collect();
        sizes.dedup();
        if sizes.is_empty() { "a size that it does not say".into() } else { sizes.join(", ") }
    }

    /// The calibration of images that are rectified already and of this `size`: where the file is of several, of that, and where they
    /// are those of the file in another size, as [`Calibration::of_size`] makes it. `None` where it does not say how they were rectified.
    ///
    /// # Errors
    /// Those of [`Views::calibration`], and [`Error::Calibration`] where it is for several sizes and not for this one.
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
        let of = size.map_or("; say which".into(), |size| format!(", and these are {}", shown(size)));
        Err(Error::Calibration(format!("is for images of {sizes}{of}")))
    }

    /// With the pose that the rectification implies, where a file gives that alone.
    pub(super) fn with_pose_of_views(mut self) -> Self {
        self.pose = self.pose.or_else(|| {
            let Views { rotations: [left, right], translation: [x, y], .. } = self.views?;
            // A point goes to the left view, along to the right one, and back to the right camera.
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
    fn a_unit_that_is_stated_holds_for_images_of_every_size() {
        let other = StereoCalibration { size: Some((320, 240)), unit: Unit::Metre, ..Default::default() };
        let benchmark = Some(Calibration::default());
        let mut all = StereoCalibration { others: vec![other], benchmark, ..Default::default() };
        all.set_unit(Unit::Centimetre);
        assert!(all.all().all(|one| one.unit == Unit::Centimetre));
        assert_eq!(all.of_rectified_images(Some((320, 240))).unwrap().unwrap().unit, Unit::Centimetre);
    }
}
