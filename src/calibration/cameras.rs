//! What a calibration says of a pair of cameras.

use super::lens::Lens;
use super::matrix::{IDENTITY, Matrix, degrees, degrees_between, product, rotated, transposed};
use crate::error::{Error, Result};
use crate::image::calib::{Calibration, Camera, Unit};

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

    /// The calibration of the rectified images, of the given size.
    ///
    /// # Errors
    /// [`Error::Calibration`] where the right camera is not to the right of the left one.
    pub fn calibration(&self, size: Option<(usize, usize)>, unit: Unit) -> Result<Calibration> {
        let error = |reason: &str| Err(Error::Calibration(reason.into()));
        if self.is_vertical() {
            return error("has one camera above the other, and only rows are matched");
        }
        if self.translation[0] >= 0.0 {
            return error(
                "puts the right camera on the left of the left one; exchange the two in it, or the images",
            );
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

    /// What it says of images of this size, where it is for several; else itself.
    pub(crate) fn of_size(&self, size: (usize, usize)) -> &Self {
        std::iter::once(self).chain(&self.others).find(|one| one.size == Some(size)).unwrap_or(self)
    }

    /// The calibration of images that are rectified already and of this `size`, which counts where the file is for several; `None`
    /// where it does not say how they were rectified.
    ///
    /// # Errors
    /// Those of [`Views::calibration`], and [`Error::Calibration`] where it is for several sizes and not for this one.
    pub fn of_rectified_images(&self, size: Option<(usize, usize)>) -> Result<Option<Calibration>> {
        if let Some(benchmark) = &self.benchmark {
            return Ok(Some(benchmark.clone()));
        }
        let one = size.map_or(self, |size| self.of_size(size));
        let Some(views) = one.views else { return Ok(None) };
        if !self.others.is_empty() && one.size != size {
            let sizes = std::iter::once(self).chain(&self.others).filter_map(|one| one.size);
            let shown = |(width, height): (usize, usize)| format!("{width} x {height}");
            let sizes = sizes.map(shown).collect::<Vec<_>>().join(", ");
            let of = size.map_or("; say which".into(), |size| format!(", and these are {}", shown(size)));
            return Err(Error::Calibration(format!("is for images of {sizes}{of}")));
        }
        views.calibration(views.size.or(one.size), one.unit).map(Some)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_that_is_stated_holds_for_images_of_every_size() {
        let other = StereoCalibration { size: Some((320, 240)), unit: Unit::Metre, ..Default::default() };
        let benchmark = Some(Calibration::default());
        let mut all = StereoCalibration { others: vec![other], benchmark, ..Default::default() };
        all.set_unit(Unit::Centimetre);
        assert_eq!([all.unit, all.of_size((320, 240)).unit], [Unit::Centimetre; 2]);
        assert_eq!(all.of_rectified_images(Some((320, 240))).unwrap().unwrap().unit, Unit::Centimetre);
    }
}
