//! Tables of integer weights: for the median's window, and for votes.

use crate::options::Method;

/// Weight of the centre of the median's window, the largest weight.
pub(crate) const MEDIAN_WEIGHT: u8 = 127;
/// The largest part of the centre's weight that distance alone subtracts.
const MEDIAN_SPACE: f64 = 96.0;
/// The row spacing in the windows of the median is 2 to this many pixels; all columns are used.
pub(crate) const WINDOW_ROW_BITS: u32 = 1;
/// Spacing of the places in the two windows that fill pixels, along rows and along columns: 2 to this many pixels.
/// The first window reaches far in all directions, the second along rows, where roads and floors keep one disparity.
pub(crate) const FILL_STEP_BITS: [[u32; 2]; 2] = [[3, 3], [4, 0]];
/// Side of these windows, in places.
const FILL_WINDOW: usize = 13;
/// Spatial sigma of these windows, in places.
const FILL_SIGMA_SPACE: f64 = 4.3;
/// Their range sigma is the median's divided by this.
const FILL_SIGMA_RANGE: f64 = 3.0;

/// Number of differences in colour: the sum over three channels of 8 bits.
pub(crate) const COLOUR_DIFFERENCES: usize = 3 * 255 + 1;
/// Weight of a vote after a step along a row and along a column, between half-size pixels of the same colour: about
/// exp(-sqrt(2) / 134) and exp(-sqrt(2) / 6.7). Disparities change from row to row on the ground, and stay along rows.
const VOTE_STEP: [f64; 2] = [0.9895, 0.81];
/// The decrease of that weight's logarithm per level of colour difference.
const VOTE_EDGE: f64 = 0.0345;

/// Weights of votes after a step along a row, and along a column, in 1/65536, by the difference d in colour between the two
/// half-size pixels: round(65536 a exp(-0.0345 d)), with a = 0.9895 along rows and 0.81 along columns.
#[must_use]
pub(crate) fn vote_weights() -> [Vec<u32>; 2] {
    let weight = |step: f64, difference: usize| {
        (65536.0 * step * libm::exp(-VOTE_EDGE * difference as f64) + 0.5).floor() as u32
    };
    VOTE_STEP.map(|step| (0..COLOUR_DIFFERENCES).map(|difference| weight(step, difference)).collect())
}

/// Share of the weight that passes from a patch to the next one of the same colour: about exp(-sqrt(2) / 37.5).
const PATCH_FADE: f64 = 0.961;
/// The decrease of that share's logarithm per level of colour difference.
const PATCH_EDGE: f64 = 0.0185;
/// From this difference on, the share is 0.
pub(crate) const PATCH_DIFFERENCES: usize = 336;

/// Share of the weight that passes from a patch to the next one, in 1/256, by the difference d in colour:
/// round(256 x 0.961 exp(-0.0185 d)), and 0 at the last.
#[must_use]
pub fn patch_weights() -> Vec<u32> {
    let share = |difference: usize| 256.0 * PATCH_FADE * libm::exp(-PATCH_EDGE * difference as f64);
    (0..=PATCH_DIFFERENCES).map(|difference| (share(difference) + 0.5).floor() as u32).collect()
}

/// Bilateral weights of the median's window, as 8-bit integers: max(0, `MEDIAN_WEIGHT` - colour - space).
///
/// space = round(96 (1 - exp(-(dx^2 + dy^2) / 2 `sigma_space`^2))), with dx and dy in steps of the window.
/// colour = the sum over r, g and b of the differences of the guides, times 2^`doublings`, where a guide is
/// the 16-bit channel times `scale` >> 16. `scale` / 256 times 2^`doublings` is 0.1 / `sigma_range`: a
/// difference of 1270 `sigma_range` 8-bit levels, summed over the channels, takes all of the weight.
///
/// A straight line approximates the Gaussian of colour, and a sum replaces the product of both: this is as
/// accurate, and fits in bytes throughout.
#[derive(Clone, Debug)]
pub struct MedianWeights {
    /// Radius of the window, in steps.
    pub radius: usize,
    /// Spacing of the window's places along rows and along columns: 2 to this many pixels.
    pub step_bits: [u32; 2],
    /// Whether only every second place counts, as on a checkerboard: those with dx + dy / 2 even, in steps of the window.
    pub checkered: bool,
    /// By |dy| and by dx from -radius to radius, in steps of the window, \[dy\]\[dx\].
    space: Vec<u8>,
    /// Factor of a 16-bit channel, 1 ..= 256; the upper 16 bits of the product are its guide.
    pub scale: u32,
    /// Number of times that a sum of guide differences is doubled, 0 ..= 7.
    pub doublings: u32,
}

impl MedianWeights {
    /// The weights of `method`.
    #[must_use]
    pub fn of(method: &Method) -> Self {
        let refinement = &method.refinement;
        let window = refinement.median_window as usize;
        Self::new(window, refinement.median_sigma_space, refinement.median_sigma_range)
    }

    /// The weights for fitting planes, and for the medians that planes start from: every second place.
    #[must_use]
    pub fn of_planes(method: &Method) -> Self {
        Self { checkered: true, ..Self::of(method) }
    }

    /// The weights for filled pixels, in a window of 13 x 13 places that are 2 to `step_bits` pixels apart
    /// along rows and along columns: with a spatial sigma of 4.3 places, and a third of the range sigma.
    #[must_use]
    pub fn of_filled(method: &Method, step_bits: [u32; 2]) -> Self {
        let range = method.refinement.median_sigma_range / FILL_SIGMA_RANGE;
        Self { step_bits, ..Self::new(FILL_WINDOW, FILL_SIGMA_SPACE, range) }
    }

    /// Weights for a window of `window` pixels, sigmas in pixels and in the intensity range 0 to 1.
    #[must_use]
    pub fn new(window: usize, sigma_space: f64, sigma_range: f64) -> Self {
        let radius = window / 2;
        let taken =
            |d: f64| (MEDIAN_SPACE * (1.0 - libm::exp(-d / (2.0 * sigma_space * sigma_space))) + 0.5) as u8;
        let space = (0..=radius)
            .flat_map(|dy| (0..=2 * radius).map(move |x| (x.abs_diff(radius).pow(2) + dy * dy) as f64))
            .map(taken)
            .collect();
        let (mut slope, mut doublings) = (0.1 / sigma_range, 0);
        // Seven doublings turn a difference of one level into more than the largest weight.
        while slope > 1.0 && doublings < 7 {
            slope /= 2.0;
            doublings += 1;
        }
        let scale = (256.0 * slope + 0.5).floor().clamp(1.0, 256.0) as u32;
        Self { radius, step_bits: [0; 2], checkered: false, space, scale, doublings }
    }

    /// The weight that distance subtracts, by |dy| and |dx|, in the layout of the shader.
    #[must_use]
    pub fn words(&self) -> Vec<u32> {
        let rows = self.space.chunks_exact(2 * self.radius + 1).flat_map(|row| &row[self.radius..]);
        rows.map(|&taken| taken.into()).collect()
    }

    /// The weight that distance subtracts in the row |dy| steps away, for dx from -radius to radius.
    #[must_use]
    pub fn space_row(&self, dy: usize) -> &[u8] {
        let side = 2 * self.radius + 1;
        &self.space[dy * side..][..side]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::votes::{VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_SHIFT};

    /// The worst case: a large image of one colour with the largest votes everywhere.
    #[test]
    fn sums_of_votes_fit_in_32_bits() {
        let vote = (VOTE_MOST as u64 >> VOTE_BITS).max(VOTE_HIDING.into());
        let own = (4 * vote) << VOTE_FRACTION_BITS;
        let [row, column] = vote_weights().map(|weights| u64::from(weights[0]));
        // The limit of the votes that come from one side.
        let from_side = |own: u64, weight: u64| own * weight / (65536 - weight);
        let along_row = own + 2 * from_side(own, row);
        assert!(along_row <= u32::MAX.into(), "{along_row}");
        let summed = along_row >> VOTE_SHIFT;
        let in_all = summed + 2 * from_side(summed, column);
        assert!(in_all <= u32::MAX.into(), "{in_all}");
        // The bits that votes keep are needed, and so are those that sums drop.
        assert!(2 * along_row > u32::MAX.into() && 2 * in_all > u32::MAX.into());
    }
}
