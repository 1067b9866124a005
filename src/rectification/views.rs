//! Chooses the rectified views by Bouguet's method, like OpenCV.

use crate::calibration::cameras::{Pose, RectifiedViews};
use crate::calibration::lens::Lens;
use crate::calibration::matrix::{
    Matrix, cross, length, product, rotated, rotation, rotation_vector, scaled, transposed,
};
use crate::error::{Error, Result};
use crate::image::calib::Camera;

use super::options::Options;

/// The rectified views of two cameras with images of `size`. Each turns by half of the rotation between them,
/// then both turn together until the baseline is along the rows, or along the columns if it is closer to those.
///
/// # Errors
/// [`Error::Calibration`] when no such views exist.
pub(super) fn choose(
    lenses: &[Lens; 2],
    pose: &Pose,
    size: (usize, usize),
    options: &Options,
) -> Result<RectifiedViews> {
    let error = |reason: &str| Err(Error::Calibration(reason.into()));
    let vector = rotation_vector(&pose.rotation);
    if length(vector) >= std::f64::consts::FRAC_PI_2 {
        return error(if pose.rotation[2][2] > 0.0 {
            "has one camera on its side or upside down against the other; turn its images, and calibrate with these"
        } else {
            "has cameras that look in directions more than 90 degrees apart; they cannot be rectified"
        });
    }
    let half = rotation(scaled(vector, -0.5));
    let t = rotated(&half, pose.translation);
    let axis = usize::from(t[0].abs() <= t[1].abs());
    if t[2].abs() > t[axis].abs() {
        return error("has one camera in front of the other; they cannot be rectified");
    }
    let mut goal = [0.0; 3];
    goal[axis] = t[axis].signum();
    let turn = cross(t, goal);
    let turn = match length(turn) {
        0.0 => turn,
        norm => scaled(turn, libm::acos((t[axis].abs() / length(t)).min(1.0)) / norm),
    };
    let turn = rotation(turn);
    let rotations = [product(&turn, &transposed(&half)), product(&turn, &half)];
    let t = rotated(&rotations[1], pose.translation);
    let mut cameras = if lenses.iter().any(Lens::is_wide) {
        fisheye(lenses, &rotations, size, options.alpha.unwrap_or(0.0))
    } else {
        pinhole(lenses, &rotations, size, axis)
    };
    share(&mut cameras, axis, options.zero_disparity);
    if let Some(alpha) = options.alpha.filter(|_| !lenses.iter().any(Lens::is_wide)) {
        let scale = scale(lenses, &rotations, &cameras, size, alpha);
        for camera in &mut cameras {
            camera.focal_length = camera.focal_length.map(|f| scale * f);
        }
    }
    let sound = |camera: &Camera| {
        let size = (size.0.max(size.1)) as f64;
        let focal_length = camera.focal_length[0];
        (size / 100.0..size * 100.0).contains(&focal_length)
            && camera.principal_point.iter().all(|v| v.abs() < 100.0 * size)
    };
    if !cameras.iter().all(sound) {
        return error(
            "leads to rectified views that show hardly anything; check its lenses, its rotation and its size",
        );
    }
    let mut translation = [0.0; 2];
    translation[axis] = t[axis];
    Ok(RectifiedViews { rotations, cameras, translation, size: None })
}

/// Averages the principal points, or at least the coordinate across the epipolar lines.
fn share([left, right]: &mut [Camera; 2], axis: usize, zero_disparity: bool) {
    for i in 0..2 {
        if zero_disparity || i != axis {
            let mean = (left.principal_point[i] + right.principal_point[i]) * 0.5;
            (left.principal_point[i], right.principal_point[i]) = (mean, mean);
        }
    }
}

/// The point of a real camera's pixel in the plane z = 1 of its rectified view.
pub(super) fn seen(lens: &Lens, rotation: &Matrix, pixel: [f64; 2]) -> [f64; 2] {
    let [x, y] = lens.nearly_undistorted(pixel);
    let [x, y, z] = rotated(rotation, [x, y, 1.0]);
    [x / z, y / z]
}

/// The cameras of ordinary lenses: the mean focal length, with the corners of the images around the centre.
fn pinhole(lenses: &[Lens; 2], rotations: &[Matrix; 2], size: (usize, usize), axis: usize) -> [Camera; 2] {
    let [a, b] = lenses.each_ref().map(|lens| lens.focal_length[1 - axis]);
    let focal_length = (a + b) * 0.5;
    let (right, bottom) = (size.0 as f64 - 1.0, size.1 as f64 - 1.0);
    std::array::from_fn(|view| {
        let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
        let corners = corners.map(|corner| seen(&lenses[view], &rotations[view], corner));
        let mean = |i: usize| focal_length * corners.iter().map(|corner| corner[i]).sum::<f64>() / 4.0;
        let principal_point = [right / 2.0 - mean(0), bottom / 2.0 - mean(1)];
        Camera { focal_length: [focal_length; 2], principal_point }
    })
}

/// The factor of the focal length: 1 - `alpha` of that at which every pixel has a source, plus `alpha` of
/// that at which no source pixel is lost.
fn scale(
    lenses: &[Lens; 2],
    rotations: &[Matrix; 2],
    cameras: &[Camera; 2],
    size: (usize, usize),
    alpha: f64,
) -> f64 {
    const N: usize = 9;
    let end = [size.0 as f64 - 1.0, size.1 as f64 - 1.0];
    let (mut all_known, mut all_kept) = (f64::NEG_INFINITY, f64::INFINITY);
    for view in 0..2 {
        let camera = cameras[view];
        let mut inner = [[f64::NEG_INFINITY; 2], [f64::INFINITY; 2]];
        let mut outer = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for at in (0..N).flat_map(|y| (0..N).map(move |x| [x, y])) {
            let pixel = [0, 1].map(|i| at[i] as f64 * end[i] / (N - 1) as f64);
            let point = seen(&lenses[view], &rotations[view], pixel);
            for i in 0..2 {
                let v = camera.focal_length[i] * point[i] + camera.principal_point[i];
                outer[0][i] = outer[0][i].min(v);
                outer[1][i] = outer[1][i].max(v);
                if at[i] == 0 {
                    inner[0][i] = inner[0][i].max(v);
                } else if at[i] == N - 1 {
                    inner[1][i] = inner[1][i].min(v);
                }
            }
        }
        for i in 0..2 {
            let c = camera.principal_point[i];
            let factors = |[low, high]: [[f64; 2]; 2]| [c / (c - low[i]), (end[i] - c) / (high[i] - c)];
            all_known = factors(inner).into_iter().fold(all_known, f64::max);
            all_kept = factors(outer).into_iter().fold(all_kept, f64::min);
        }
    }
    all_known * (1.0 - alpha) + all_kept * alpha
}

/// The cameras of fisheyes and other wide lenses, from the middles of the image edges. With a `balance` of 0
/// the nearest edge limits the view, with 1 the farthest.
fn fisheye(lenses: &[Lens; 2], rotations: &[Matrix; 2], size: (usize, usize), balance: f64) -> [Camera; 2] {
    let (width, height) = (size.0 as f64, size.1 as f64);
    let (middle, centre) = ((size.0 / 2) as f64, (size.1 / 2) as f64);
    let mut cameras = [0, 1].map(|view| {
        let lens = &lenses[view];
        let aspect = lens.focal_length[0] / lens.focal_length[1];
        let edges = [[middle, 0.0], [width, centre], [middle, height], [0.0, centre]].map(|edge| {
            let [x, y] = seen(lens, &rotations[view], edge);
            [x, y * aspect]
        });
        let mean = |i: usize| edges.iter().map(|edge| edge[i]).sum::<f64>() / 4.0;
        let centre = [mean(0), mean(1)];
        let smallest = |i: usize| edges.iter().map(|edge| edge[i]).fold(f64::INFINITY, f64::min);
        let largest = |i: usize| edges.iter().map(|edge| edge[i]).fold(f64::NEG_INFINITY, f64::max);
        let across = width * 0.5;
        let down = height * 0.5 * aspect;
        let lengths = [
            across / (centre[0] - smallest(0)),
            across / (largest(0) - centre[0]),
            down / (centre[1] - smallest(1)),
            down / (largest(1) - centre[1]),
        ];
        let widest = lengths.into_iter().fold(f64::INFINITY, f64::min);
        let narrowest = lengths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let f = balance * widest + (1.0 - balance) * narrowest;
        let principal_point = [across - centre[0] * f, (down - centre[1] * f) / aspect];
        Camera { focal_length: [f, f / aspect], principal_point }
    });
    let focal_length = cameras[0].focal_length[1].min(cameras[1].focal_length[1]);
    for camera in &mut cameras {
        camera.focal_length = [focal_length; 2];
    }
    cameras
}
