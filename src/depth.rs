//! From disparities to depths and points, where the cameras are known.
//!
//! A rectified pair of cameras sees a point at depth Z with a disparity d such that d + doffs = baseline * f
//! / Z, where f is the focal length in pixels and doffs the distance of the principal points along the row
//! (cx1 - cx0). Depth has the unit of the baseline.

use crate::calibration::cameras::{Pose, ThirdCamera};
use crate::calibration::lens::{Distortion, Lens};
use crate::calibration::matrix::{Matrix, rotated, transposed};
use crate::error::{Error, Result};
use crate::image::calib::{Calibration, Camera, Unit};
use crate::image::cloud::{Cloud, Point, PointFrame};
use crate::image::{Image, Plane};
use crate::maps::{FRACTION, Maps, flag};
use crate::options::MAX_DISPARITY;
use crate::prior::{Prior, PriorKind, PriorPoint};
use crate::registration;

/// A calibrated pair of cameras, rectified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    camera: Camera,
    doffs: f64,
    baseline: f64,
    unit: Unit,
    /// The rotation from the rectified left camera to the original one, where they differ.
    to_original: Option<Matrix>,
    /// The frame of the points.
    frame: PointFrame,
}

impl Rig {
    /// The rig that a calibration file describes.
    ///
    /// # Errors
    /// [`Error::Calibration`] when the file lacks `cam0`, `doffs` or `baseline` (the error names which), or
    /// the baseline is not above 0.
    pub fn new(calibration: &Calibration) -> Result<Self> {
        let error = |reason: String| Err(Error::Calibration(reason));
        let &Calibration { camera, doffs, baseline, unit, .. } = calibration;
        let (Some(camera), Some(doffs), Some(baseline)) = (camera, doffs, baseline) else {
            let known =
                [("cam0", camera.is_some()), ("doffs", doffs.is_some()), ("baseline", baseline.is_some())];
            let missing: Vec<_> = known.iter().filter(|(_, known)| !known).map(|(key, _)| *key).collect();
            return error(format!(
                "lacks {}; depth needs cam0=[f 0 cx; 0 f cy; 0 0 1], doffs=N and baseline=N",
                missing.join(" and ")
            ));
        };
        if baseline <= 0.0 {
            return error(format!("baseline={baseline} is not above 0; give the distance of the cameras"));
        }
        Ok(Self { camera, doffs, baseline, unit, to_original: None, frame: PointFrame::Matched })
    }

    /// The values that it was made from: focal lengths, principal point and doffs in pixels, and the baseline with its unit. The inverse of
    /// [`Rig::new`].
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let of_cameras = Calibration::of_cameras(self.camera, self.baseline, self.unit);
        Calibration { doffs: Some(self.doffs), ..of_cameras }
    }

    /// The rig with the rotation of the original left camera, to which third cameras in [`Rig::registered`]
    /// refer. `rectifying` is the rotation from that camera to the rectified one, the first of
    /// [`Rectification::rotations`](crate::rectification::Rectification::rotations).
    #[must_use]
    pub fn rectified_by(self, rectifying: &Matrix) -> Self {
        Self { to_original: Some(transposed(rectifying)), ..self }
    }

    /// The same rig, with points in the frame of the original left camera. Depths stay along the axis of the rectified camera.
    #[must_use]
    pub fn in_original_frame(self, rectifying: &Matrix) -> Self {
        Self { frame: PointFrame::Original, ..self.rectified_by(rectifying) }
    }

    /// The rig of a part of the images, whose first pixel is (x, y).
    #[must_use]
    pub fn of_part(mut self, x: usize, y: usize) -> Self {
        self.camera.principal_point[0] -= x as f64;
        self.camera.principal_point[1] -= y as f64;
        self
    }

    /// The depth at disparity `d` (pixels), along the optical axis and in the unit of the baseline. `None`
    /// where `d` is not finite or d + doffs is not above 0: such a point is at infinity or beyond.
    #[must_use]
    pub fn depth(&self, d: f64) -> Option<f64> {
        let apart = d + self.doffs;
        let depth = self.baseline * self.camera.focal_length[0] / apart;
        (apart > 0.0 && d.is_finite() && depth.is_finite()).then_some(depth)
    }

    /// The disparity, in pixels, at `depth` along the optical axis, in the unit of the baseline: the inverse of [`Rig::depth`].
    #[must_use]
    pub fn disparity(&self, depth: f64) -> f64 {
        self.baseline * self.camera.focal_length[0] / depth - self.doffs
    }

    /// The point that the left pixel (x, y) shows at disparity `d`: x to the right, y down, z forward, in the unit of the
    /// baseline. The frame is that of the left camera, the rectified one unless [`Rig::in_original_frame`] has changed that.
    /// `None` where [`Rig::depth`] is `None`.
    #[must_use]
    pub fn point(&self, x: f64, y: f64, d: f64) -> Option<[f64; 3]> {
        let point = self.matched(x, y, d)?;
        Some(if self.frame == PointFrame::Original { self.original(point) } else { point })
    }

    /// [`Rig::point`] in the frame of the rectified left camera.
    fn matched(&self, x: f64, y: f64, d: f64) -> Option<[f64; 3]> {
        let Camera { focal_length: [fx, fy], principal_point: [cx, cy] } = self.camera;
        self.depth(d).map(|z| [(x - cx) * z / fx, (y - cy) * z / fy, z])
    }

    /// Rotates a point from the frame of the rectified left camera to that of the original one.
    fn original(&self, point: [f64; 3]) -> [f64; 3] {
        self.to_original.map_or(point, |matrix| rotated(&matrix, point))
    }

    /// Where the left view shows a point: its column, row and disparity, in pixels. The inverse of [`Rig::point`]. `None` for a point that
    /// is not in front of the cameras.
    #[must_use]
    pub fn seen(&self, point: [f64; 3]) -> Option<[f64; 3]> {
        let Camera { focal_length: [fx, fy], principal_point: [cx, cy] } = self.camera;
        let [x, y, z] = self.in_matched_frame(point);
        let seen = [x * fx / z + cx, y * fy / z + cy, self.disparity(z)];
        (z > 0.0 && seen.iter().all(|v| v.is_finite())).then_some(seen)
    }

    /// Rotates a point from the frame of [`Rig::point`] to that of the rectified left camera.
    fn in_matched_frame(&self, point: [f64; 3]) -> [f64; 3] {
        let from_original = self.to_original.filter(|_| self.frame == PointFrame::Original);
        from_original.map_or(point, |matrix| rotated(&transposed(&matrix), point))
    }

    /// The prior of the left view after the rig has moved, from the maps before: their measured disparities as a surface, drawn where the
    /// rig sees it after the motion. `motion` takes points from the frame of [`Rig::point`] before the motion into that after it, in the unit of the
    /// baseline. Of several surfaces the nearest counts, and nothing is known of what the maps do not show.
    ///
    /// # Errors
    /// [`Error::Calibration`] for a focal length that no camera has.
    pub fn prior_after(&self, maps: &Maps, motion: &Pose) -> Result<Prior> {
        let size @ (width, height) = maps.disparity.size();
        let measured = Plane::from_fn(width, height, |x, y| {
            let is_known = maps.validity[(x, y)] & flag::INVALID == 0;
            if is_known { maps.disparity[(x, y)] as f32 / FRACTION as f32 } else { f32::INFINITY }
        });
        let Camera { focal_length, principal_point } = self.camera;
        let lens = Lens::new(focal_length, principal_point, Distortion::NONE)?;
        let camera = ThirdCamera { lens, pose: *motion, size, unit: self.unit };
        let depths = registration::render(&measured, &camera, |x, y, d| {
            Some(self.in_matched_frame(motion.moved(self.point(x, y, d)?)))
        });
        let disparities = depths.map(|&depth| {
            let disparity = self.disparity(depth.into()) as f32;
            let is_known = depth.is_finite() && disparity.abs() <= MAX_DISPARITY as f32;
            if is_known { disparity } else { f32::INFINITY }
        });
        let kind = PriorKind::Surface;
        Prior::map(kind, &disparities, kind.usual_sigma())
    }

    /// What is known of a left view of (width, height) pixels that shows these points, which are in the frame of [`Rig::point`] and in the
    /// unit of the baseline. All have the same standard deviation of their disparities, in px. Points behind the camera or beyond
    /// [`MAX_DISPARITY`] are left out.
    ///
    /// # Errors
    /// The errors of [`Prior::points`].
    pub fn prior(
        &self,
        size: (usize, usize),
        points: impl IntoIterator<Item = [f64; 3]>,
        sigma: f64,
    ) -> Result<Prior> {
        let mut count = 0_usize;
        let seen = points.into_iter().inspect(|_| count += 1).filter_map(|point| self.seen(point));
        let seen = seen.filter(|[.., d]| d.abs() <= f64::from(MAX_DISPARITY));
        let points: Vec<_> = seen.map(|[x, y, disparity]| PriorPoint { x, y, disparity, sigma }).collect();
        if points.is_empty() && count > 0 {
            let reason = format!("none of the {count} points of the prior is in front of the camera");
            return Err(Error::Mismatch(reason));
        }
        Prior::points(size, points)
    }

    /// The depths of a map of disparities in pixels; +infinity where there is no depth.
    #[must_use]
    pub fn depths(&self, disparities: &Plane<f32>) -> Plane<f32> {
        disparities.map(|&d| self.depth(f64::from(d)).map_or(f32::INFINITY, |depth| depth as f32))
    }

    /// The expected error of the depth at disparity `d`, whose own error is `sigma` (both in pixels), in the unit of
    /// the baseline: Z sigma / (d + doffs) to first order, where Z is the depth. `None` where [`Rig::depth`] is `None`.
    #[must_use]
    pub fn depth_sigma(&self, d: f64, sigma: f64) -> Option<f64> {
        self.depth(d).map(|depth| depth * sigma / (d + self.doffs))
    }

    /// The expected errors of the depths of a map, from its disparities and [their errors](crate::sigma);
    /// +infinity where there is no depth, or no finite error.
    ///
    /// # Panics
    /// When the maps differ in size.
    #[must_use]
    pub fn depth_sigmas(&self, disparities: &Plane<f32>, sigmas: &Plane<f32>) -> Plane<f32> {
        assert_eq!(disparities.size(), sigmas.size(), "both are of one view");
        let (width, height) = disparities.size();
        Plane::from_fn(width, height, |x, y| {
            let (d, sigma) = (f64::from(disparities[(x, y)]), f64::from(sigmas[(x, y)]));
            self.depth_sigma(d, sigma).map_or(f32::INFINITY, |sigma| sigma as f32)
        })
    }

    /// The unit of the baseline.
    #[must_use]
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The depths of a map of disparities in whole millimetres, as in ROS and TUM: 0 where there is no depth,
    /// or where it rounds to 0 or to more than 65535. `None` where the unit of the baseline is unknown.
    #[must_use]
    pub fn millimetres(&self, disparities: &Plane<f32>) -> Option<Plane<u16>> {
        let unit = self.unit.millimetres()?;
        Some(disparities.map(|&d| whole(self.depth(f64::from(d)).map_or(0.0, |depth| depth * unit))))
    }

    /// The depths of a map of disparities as a third camera sees them: along its axis, at its pixels, in the unit of the baseline,
    /// and +infinity where the map shows nothing. Of several surfaces the nearest counts, and each pixel of the map covers its own
    /// footprint. If both units are known, that of the camera's pose is converted.
    ///
    /// The camera's pose is relative to the original left camera if the rig [knows it](Rig::rectified_by), else to the rectified one.
    #[must_use]
    pub fn registered(&self, disparities: &Plane<f32>, camera: &ThirdCamera) -> Plane<f32> {
        let per_unit =
            camera.unit.millimetres().zip(self.unit.millimetres()).map_or(1.0, |(theirs, own)| theirs / own);
        let Pose { rotation, translation } = camera.pose;
        registration::render(disparities, camera, |x, y, d| {
            let turned = rotated(&rotation, self.original(self.matched(x, y, d)?));
            Some(std::array::from_fn(|i| turned[i] + per_unit * translation[i]))
        })
    }

    /// The [registered](Rig::registered) depths in whole millimetres, like [`Rig::millimetres`].
    #[must_use]
    pub fn registered_millimetres(
        &self,
        disparities: &Plane<f32>,
        camera: &ThirdCamera,
    ) -> Option<Plane<u16>> {
        let unit = self.unit.millimetres()?;
        let millimetres = |&depth: &f32| whole(if depth.is_finite() { f64::from(depth) * unit } else { 0.0 });
        Some(self.registered(disparities, camera).map(millimetres))
    }

    /// The points with validity 0, measured and trusted, row by row, with the colours of the `left` image.
    /// Filled pixels and pixels of low confidence are guesses from their surroundings, and give no points.
    ///
    /// # Panics
    /// When maps and image differ in size.
    #[must_use]
    pub fn cloud(&self, maps: &Maps, left: &Image) -> Cloud {
        assert_eq!(maps.disparity.size(), left.pixels.size(), "the maps of this image");
        let (width, height) = maps.disparity.size();
        let colours = left.to_rgb8();
        let mut points = Vec::new();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            if maps.validity[(x, y)] != 0 {
                continue;
            }
            let d = f64::from(maps.disparity[(x, y)]) / f64::from(FRACTION);
            points.extend(self.point(x as f64, y as f64, d).map(|position| Point {
                position: position.map(|v| v as f32),
                colour: colours[(x, y)],
                confidence: maps.confidence[(x, y)],
            }));
        }
        Cloud { points, frame: self.frame, unit: self.unit }
    }
}

/// A depth in whole millimetres; 0 where it is above 65535.
fn whole(millimetres: f64) -> u16 {
    let rounded = millimetres.round();
    if rounded <= f64::from(u16::MAX) { rounded as u16 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::matrix::IDENTITY;

    fn calibration() -> Calibration {
        Calibration {
            camera: Some(Camera { focal_length: [1000.0, 500.0], principal_point: [2.0, 1.0] }),
            doffs: Some(20.0),
            baseline: Some(160.0),
            ..Calibration::default()
        }
    }

    #[test]
    fn a_rig_gives_its_calibration_back() {
        let metres = Calibration { unit: Unit::Metre, ..calibration() };
        for known in [calibration(), metres] {
            assert_eq!(Rig::new(&known).unwrap().calibration(), known);
        }
    }

    #[test]
    fn depth_is_baseline_times_focal_length_over_disparity() {
        let rig = Rig::new(&calibration()).unwrap();
        // 160 * 1000 / (60 + 20), and so on.
        for (d, depth) in [(60.0, 2000.0), (-4.0, 10_000.0), (12.0, 5000.0)] {
            assert_eq!(rig.depth(d), Some(depth));
        }
        // At a disparity of -doffs a point is at infinity, and below it there is none.
        for d in [-20.0, -20.5, -1e9, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(rig.depth(d), None, "{d}");
        }
        let map = Plane::new(3, 1, vec![60.0, -20.0, f32::INFINITY]);
        assert_eq!(rig.depths(&map).data(), [2000.0, f32::INFINITY, f32::INFINITY]);
    }

    #[test]
    fn errors_of_depths_follow_from_those_of_disparities() {
        let rig = Rig::new(&calibration()).unwrap();
        let row = |values: &[f32]| Plane::new(values.len(), 1, values.to_vec());
        let (none, map) = (f32::INFINITY, row(&[60.0, 12.0, 60.0, -20.0, f32::INFINITY]));
        let sigmas = rig.depth_sigmas(&map, &row(&[0.2, 0.4, none, 0.2, 0.2]));
        // 2000 * 0.2 / 80, and 5000 * 0.4 / 32.
        assert_eq!(sigmas.data(), [5.0, 62.5, none, none, none]);
        // A small step of the disparity moves the depth by as much.
        let moved = rig.depth(60.0 - 0.001).unwrap() - rig.depth(60.0).unwrap();
        assert!((moved / 0.001 - 25.0).abs() < 1e-3, "{moved}");
    }

    #[test]
    fn millimetres_take_a_known_unit() {
        let millimetres = |unit, map: &[f32]| {
            let rig = Rig::new(&Calibration { unit, ..calibration() }).unwrap();
            rig.millimetres(&Plane::new(map.len(), 1, map.to_vec())).map(Plane::into_data)
        };
        // 160,000 over 80, 100,000 (1.6, rounded), 4 and 2; then two disparities without a depth.
        let map = [60.0, 99_980.0, -16.0, -18.0, -20.0, f32::INFINITY];
        assert_eq!(millimetres(Unit::Millimetre, &map), Some(vec![2000, 2, 40_000, 0, 0, 0]));
        assert_eq!(millimetres(Unit::Centimetre, &map[..2]), Some(vec![20_000, 16]));
        assert_eq!(millimetres(Unit::Metre, &map[..2]), Some(vec![0, 1600]));
        assert_eq!(millimetres(Unit::Unknown, &map), None);
    }

    #[test]
    fn points_are_right_down_and_forward_of_the_left_camera() {
        let rig = Rig::new(&calibration()).unwrap();
        assert_eq!(rig.point(2.0, 1.0, 60.0), Some([0.0, 0.0, 2000.0]));
        assert_eq!(rig.point(3.0, 2.0, 60.0), Some([2.0, 4.0, 2000.0]));
        assert_eq!(rig.point(3.0, 2.0, -20.0), None);
    }

    #[test]
    fn points_are_seen_where_they_come_from() {
        let rig = Rig::new(&calibration()).unwrap();
        let turned = rig.in_original_frame(&[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        for rig in [rig, turned] {
            let seen = rig.seen(rig.point(3.0, 2.0, 60.0).unwrap()).unwrap();
            assert!(seen.iter().zip([3.0, 2.0, 60.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{seen:?}");
            assert_eq!(
                [[1.0, 1.0, 0.0], [1.0, 1.0, -5.0], [f64::NAN; 3]].map(|point| rig.seen(point)),
                [None; 3]
            );
        }
    }

    #[test]
    fn a_surface_is_known_where_the_rig_sees_it_after_a_motion() {
        // A far wall, and one at half its depth in front, at 0 ..= 1 columns; the last pixel has not been measured.
        let rig = Rig::new(&Calibration { doffs: Some(0.0), ..calibration() }).unwrap();
        let maps = Maps {
            disparity: Plane::from_fn(8, 1, |x, _| FRACTION * if x < 2 { 16 } else { 8 }),
            raw: Plane::filled(8, 1, 0),
            confidence: Plane::filled(8, 1, 0),
            validity: Plane::from_fn(8, 1, |x, _| if x == 7 { flag::OCCLUDED } else { 0 }),
            right: None,
        };
        let turn = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        // The same motion, in the frame of the matched camera, and of one that was turned upright.
        for (rig, left) in [(rig, [-1.0, 0.0, 0.0]), (rig.in_original_frame(&turn), [0.0, -1.0, 0.0])] {
            let seen = |way: f64| -> Vec<_> {
                let motion = Pose { rotation: IDENTITY, translation: left.map(|v| v * way) };
                let prior = rig.prior_after(&maps, &motion).unwrap();
                (0..8)
                    .map(|x| (prior.sigma[(x, 0)] > 0).then(|| prior.disparity[(x, 0)] / FRACTION))
                    .collect()
            };
            let known =
                |values: &[i32]| -> Vec<_> { values.iter().map(|d| (*d > 0).then_some(*d)).collect() };
            assert_eq!(seen(0.0), known(&[16, 16, 8, 8, 8, 8, 8, 0]));
            // By a quarter of the baseline to the right: what is near moves twice as far, by 4 px, and hides what is behind.
            assert_eq!(seen(-160.0 / 4.0), known(&[0, 0, 0, 0, 16, 16, 8, 8]));
        }
    }

    #[test]
    fn only_measured_and_trusted_pixels_are_points() {
        let rig = Rig::new(&calibration()).unwrap();
        let validity = vec![0, flag::LOW_CONFIDENCE, flag::OCCLUDED | flag::FILLED, flag::MASKED, 0, 0];
        let maps = Maps {
            disparity: Plane::new(6, 1, [60, 60, 60, 60, -20, 12].map(|d| d * FRACTION).to_vec()),
            raw: Plane::filled(6, 1, 0),
            confidence: Plane::new(6, 1, vec![200, 3, 0, 0, 70, 255]),
            validity: Plane::new(6, 1, validity),
            right: None,
        };
        let left = Image::from_rgb8(&Plane::from_fn(6, 1, |x, _| [x as u8, 10, 20]));
        let cloud = rig.cloud(&maps, &left);
        let point = |position, red, confidence| Point { position, colour: [red, 10, 20], confidence };
        // The fifth pixel is at infinity.
        let expected = [point([-4.0, -4.0, 2000.0], 0, 200), point([15.0, -10.0, 5000.0], 5, 255)];
        assert_eq!((&cloud.points[..], cloud.frame), (&expected[..], PointFrame::Matched));
        // A quarter turn about the axis: right in the rectified camera is down in the original one.
        let turned = rig.in_original_frame(&[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        let cloud = turned.cloud(&maps, &left);
        let expected = [point([4.0, -4.0, 2000.0], 0, 200), point([10.0, 15.0, 5000.0], 5, 255)];
        assert_eq!((&cloud.points[..], cloud.frame), (&expected[..], PointFrame::Original));
        assert_eq!(turned.depth(60.0), rig.depth(60.0));
    }

    #[test]
    fn missing_keys_are_named() {
        let refused = |change: fn(&mut Calibration), words: &[&str]| {
            let mut calibration = calibration();
            change(&mut calibration);
            let error = Rig::new(&calibration).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        };
        refused(|c| c.camera = None, &["lacks cam0;"]);
        refused(|c| c.doffs = None, &["lacks doffs;"]);
        refused(|c| (c.camera, c.baseline) = (None, None), &["lacks cam0 and baseline;"]);
        refused(|c| c.baseline = Some(0.0), &["baseline=0 is not above 0"]);
    }
}
