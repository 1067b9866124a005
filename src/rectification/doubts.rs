//! What is probably wrong with a rectification.

use crate::calibration::cameras::Views;
use crate::calibration::lens::Lens;

use super::views::seen;

/// A probable mistake in a calibration, or a weakness of matches that take its place. It displays as one line with the cause and the remedy.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// A calibration that does not say the size of its images, with the optical axis far from the middle of these.
    #[error(
        "the principal point of the {view} camera, ({:.1}, {:.1}), is {percent} % of the {} from the middle of images of \
         {} x {}, so the calibration may be for another size, which it does not say: give images of that size, or add \
         imageSize: [{}, {}] if this is right",
        at[0], at[1], ["width", "height"][*axis], size.0, size.1, size.0, size.1
    )]
    PrincipalPoint {
        /// Name of the view: "left" or "right".
        view: &'static str,
        /// The principal point, in pixels.
        at: [f64; 2],
        /// Whether it is far off along the rows (0) or the columns (1).
        axis: usize,
        /// How far, in percent of the size.
        percent: u32,
        /// Width and height of the images.
        size: (usize, usize),
    },
    /// A rectification that shows the images far from the middle of its views.
    #[error(
        "shows the middle of the images at ({}, {}) in rectified views of {} x {}, so its projections may be for views of about \
         {} x {}: say their size by newImageSize: [{}, {}], or make them for {} x {}",
        at[0], at[1], size.0, size.1, 2 * at[0], 2 * at[1], 2 * at[0], 2 * at[1], size.0, size.1
    )]
    Middle {
        /// Where the middle of the images is in the rectified views, in the mean of both, in pixels.
        at: [i64; 2],
        /// Width and height of the views.
        size: (usize, usize),
    },
    /// Matches alone, many of which do not agree.
    #[error(
        "only {percent} % of the matches agree, so the rectification may be wrong: check it, or calibrate the cameras"
    )]
    FewAgree {
        /// Matches that agree, in percent of all.
        percent: u32,
    },
    /// Matches alone, whose rows stay apart.
    #[error(
        "rows are up to {pixels:.1} px apart: the lens may bend lines, or both images were not taken with one zoom: calibrate the \
         cameras for better maps"
    )]
    RowsApart {
        /// The 95th percentile, in pixels.
        pixels: f64,
    },
    /// Matches alone, in a small part of the image.
    #[error(
        "the matches are in {percent} % of the image, and elsewhere rows may be apart: check that the images overlap"
    )]
    Coverage {
        /// Parts of the image that have some, in percent of all.
        percent: u32,
    },
    /// Matches alone, nearly all of which one plane explains.
    #[error(
        "all but {percent} % of the matches lie on one flat surface, which says little of how the camera moved: show things at \
         different distances"
    )]
    NearlyFlat {
        /// The others, in percent of all.
        percent: u32,
    },
}

/// Cameras have it within a twentieth of the size; a calibration for 3/4 of the size is an eighth away.
const FAR: f64 = 0.1;

/// A doubt about `views`, of images of `size`, that may be for another size of the rectified images.
pub(super) fn of_views(lenses: &[Lens; 2], views: &Views, size: (usize, usize)) -> Option<Doubt> {
    let rectified = views.size.unwrap_or(size);
    let [images, ends] = [size, rectified].map(|(width, height)| [width as f64, height as f64]);
    let middle = images.map(|end| (end - 1.0) / 2.0);
    let at = [0, 1].map(|view| {
        let point = seen(&lenses[view], &views.rotations[view], middle);
        let camera = &views.cameras[view];
        [0, 1].map(|i| camera.focal_length[i] * point[i] + camera.principal_point[i])
    });
    // Cameras that look towards each other show it to the left and to the right.
    let mean = [0, 1].map(|i| f64::midpoint(at[0][i], at[1][i]));
    let far = |i: usize| (mean[i] / ends[i] - 0.5).abs() > FAR;
    let known = mean.iter().all(|v| v.abs() < 1e6);
    (known && (far(0) || far(1)))
        .then(|| Doubt::Middle { at: mean.map(|v| v.round() as i64), size: rectified })
}

/// A doubt about `lenses` that may be for images of another size than `size`.
pub(super) fn of_lenses(lenses: &[Lens; 2], size: (usize, usize)) -> Option<Doubt> {
    let ends = [size.0, size.1].map(|end| end as f64);
    let off = |view: usize, axis: usize| {
        (lenses[view].principal_point[axis] - (ends[axis] - 1.0) / 2.0).abs() / ends[axis]
    };
    let all = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(view, axis)| (off(view, axis), view, axis));
    let (most, view, axis) = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (most > FAR).then(|| Doubt::PrincipalPoint {
        view: ["left", "right"][view],
        at: lenses[view].principal_point,
        axis,
        percent: (100.0 * most).round() as u32,
        size,
    })
}
