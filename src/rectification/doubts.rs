//! What is probably wrong with a calibration.

use crate::calibration::lens::Lens;

/// A probable mistake in a calibration. It displays as one line with the cause and the remedy.
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
}

/// Cameras have it within a twentieth of the size; a calibration for 3/4 of the size is an eighth away.
const FAR: f64 = 0.1;

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
