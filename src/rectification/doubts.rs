//! Likely faults of a rectification.

use crate::calibration::cameras::RectifiedViews;
use crate::calibration::lens::Lens;
use crate::image::calib::{Calibration, Fit, Unit};

use super::views::seen;

/// A likely fault of a calibration, or a weakness of matches that replace one. It displays as one line with the cause and the remedy.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// The calibration is for another size of the images.
    #[error("{fit}")]
    OtherSize {
        /// How the images derive from the calibrated ones.
        fit: Fit,
    },
    /// The calibration has the right camera to the left of the left one.
    #[error(
        "has the right camera to the left of the left one, so the two were swapped{}",
        if *images { ", and so were the images, by their matches: the maps belong to the second image" } else { "" }
    )]
    Exchanged {
        /// Whether the images were exchanged too.
        images: bool,
    },
    /// An implausible distance of the cameras.
    #[error(
        "has its cameras {} {} apart, but those of stereo cameras are 1 mm to 20 m apart, so the unit may be wrong",
        digits(*baseline), unit.name()
    )]
    Baseline {
        /// The distance.
        baseline: f64,
        /// Its unit.
        unit: Unit,
    },
    /// An implausible focal length for a rectified pair.
    #[error(
        "has a focal length of {} px, which is so short for images {width} px wide that it may be in millimetres",
        digits(*focal_length)
    )]
    FocalLength {
        /// The focal length, in pixels.
        focal_length: f64,
        /// The width of the images.
        width: usize,
    },
    /// The calibration does not say the size of its images, and the principal point is far from their middle.
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
        /// Its distance, in percent of the size.
        percent: u32,
        /// Width and height of the images.
        size: (usize, usize),
    },
    /// The rectified views show the images far from their middle.
    #[error(
        "shows the middle of the images at ({}, {}) in rectified views of {} x {}, so its projections may be for views of about \
         {} x {}: say their size by newImageSize: [{}, {}], or make them for {} x {}",
        at[0], at[1], size.0, size.1, 2 * at[0], 2 * at[1], 2 * at[0], 2 * at[1], size.0, size.1
    )]
    Middle {
        /// The position of the middle of the images in the rectified views, as the mean of both, in pixels.
        at: [i64; 2],
        /// Width and height of the views.
        size: (usize, usize),
    },
    /// Many of the matches that replace a calibration disagree.
    #[error(
        "only {percent} % of the matches agree, so the rectification may be wrong: check it, or calibrate the cameras"
    )]
    FewAgree {
        /// Matches that agree, in percent of all.
        percent: u32,
    },
    /// The rows of the matches that replace a calibration remain apart.
    #[error(
        "rows are up to {pixels:.1} px apart: the lens may bend lines, or the images were taken with different zooms: calibrate the \
         cameras for better maps"
    )]
    RowsApart {
        /// The 95th percentile, in pixels.
        pixels: f64,
    },
    /// The matches that replace a calibration cover a small part of the image.
    #[error(
        "the matches cover only {percent} % of the image, and elsewhere rows may not line up: check that the images overlap"
    )]
    Coverage {
        /// Parts of the image with matches, in percent of all.
        percent: u32,
    },
    /// Nearly all matches that replace a calibration fit one plane.
    #[error(
        "all but {percent} % of the matches lie on one flat surface, which says little about how the camera moved: show things at \
         different distances"
    )]
    NearlyFlat {
        /// The other matches, in percent of all.
        percent: u32,
    },
}

/// Plausible baselines in millimetres: a few for endoscopes and microscopes, some metres for the widest rigs
/// on the ground. A handheld rig in a unit that is off by a factor of 1000 is outside.
const BASELINES: std::ops::RangeInclusive<f64> = 1.0..=20_000.0;

/// The widest plausible image in focal lengths, which shows 157 degrees.
const WIDEST: f64 = 10.0;

impl Doubt {
    /// The doubts about the calibration of a rectified pair, whose images have this width if it is known.
    #[must_use]
    pub fn about(calibration: &Calibration, width: Option<usize>) -> Vec<Self> {
        let &Calibration { camera, baseline, unit, fit, exchanged, .. } = calibration;
        let mut found = Vec::from_iter(fit.map(|fit| Self::OtherSize { fit }));
        found.extend(exchanged.then_some(Self::Exchanged { images: false }));
        found.extend(baseline.and_then(|baseline| of_baseline(baseline, unit)));
        if let (Some(camera), Some(width)) = (camera, width) {
            let focal_length = camera.focal_length[0];
            let wide = focal_length * WIDEST < width as f64;
            found.extend(wide.then_some(Self::FocalLength { focal_length, width }));
        }
        found
    }
}

/// The doubt about an implausible baseline, if its unit is known.
pub(super) fn of_baseline(baseline: f64, unit: Unit) -> Option<Doubt> {
    let millimetres = baseline * unit.millimetres()?;
    (baseline > 0.0 && !BASELINES.contains(&millimetres)).then_some(Doubt::Baseline { baseline, unit })
}

/// A number with four significant digits, for messages.
fn digits(number: f64) -> String {
    let before = libm::log10(number.abs()).floor() as i32;
    let after = usize::try_from(3 - before).unwrap_or(0).min(12);
    let text = format!("{number:.after$}");
    if after == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').into() }
}

/// Suspect distance from the middle, by size: cameras are within 1/20; a calibration for 3/4 of it gives 1/8.
const FAR: f64 = 0.1;

/// The doubt whether `views` belong to another size of the rectified images, given image `sizes`.
pub(super) fn of_views(
    lenses: &[Lens; 2],
    views: &RectifiedViews,
    sizes: [(usize, usize); 2],
) -> Option<Doubt> {
    let rectified = views.size.unwrap_or(sizes[0]);
    let ends = [rectified.0, rectified.1].map(|end| end as f64);
    let at = [0, 1].map(|view| {
        let middle = [sizes[view].0, sizes[view].1].map(|end| (end as f64 - 1.0) / 2.0);
        let point = seen(&lenses[view], &views.rotations[view], middle);
        let camera = &views.cameras[view];
        [0, 1].map(|i| camera.focal_length[i] * point[i] + camera.principal_point[i])
    });
    // Converging cameras show it shifted to opposite sides.
    let mean = [0, 1].map(|i| f64::midpoint(at[0][i], at[1][i]));
    let far = |i: usize| (mean[i] / ends[i] - 0.5).abs() > FAR;
    let known = mean.iter().all(|v| v.abs() < 1e6);
    (known && (far(0) || far(1)))
        .then(|| Doubt::Middle { at: mean.map(|v| v.round() as i64), size: rectified })
}

/// The doubt about `lenses` that seem to be for images of other sizes.
pub(super) fn of_lenses(lenses: &[Lens; 2], sizes: [(usize, usize); 2]) -> Option<Doubt> {
    let off = |view: usize, axis: usize| {
        let end = [sizes[view].0, sizes[view].1][axis] as f64;
        (lenses[view].principal_point[axis] - (end - 1.0) / 2.0).abs() / end
    };
    let all = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(view, axis)| (off(view, axis), view, axis));
    let (most, view, axis) = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (most > FAR).then(|| Doubt::PrincipalPoint {
        view: ["left", "right"][view],
        at: lenses[view].principal_point,
        axis,
        percent: (100.0 * most).round() as u32,
        size: sizes[view],
    })
}
