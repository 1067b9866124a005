//! The weights of the median's window, as tables of integers.

use crate::options::Method;

/// Weight of the centre of the median's window, the largest there is.
pub const MEDIAN_WEIGHT: u8 = 127;
/// The largest part of it that distance alone subtracts.
const MEDIAN_SPACE: f64 = 96.0;
/// Distance between the rows of the window, as a power of two: every second row is used, with all of its
/// columns.
const SPARSE_ROW_BITS: u32 = 1;
/// Spacing of the samples of the stretched window in pixels, as a power of two.
const STRETCH_BITS: u32 = 2;
/// The range sigma of the stretched window is smaller by this factor.
const STRETCH_SIGMA: f64 = 4.0;

/// Bilateral weights of the median's window, as 8-bit integers: max(0, [`MEDIAN_WEIGHT`] - colour - space).
///
/// space = round(96 (1 - exp(-(dx^2 + dy^2) / 2 `sigma_space`^2))), with dx and dy in steps of the window.
/// colour = the sum over r, g and b of the differences of the guides, times 2^`doublings`, where a guide is
/// the 16-bit channel times `scale` >> 16. `scale` / 256 times 2^`doublings` is 0.1 / `sigma_range`: a
/// difference of 1270 `sigma_range` 8-bit levels, summed over the channels, takes all of the weight.
///
/// A straight line stands for the Gaussian of colour, and a sum for the product of both: this is as accurate,
/// and fits in bytes throughout.
#[derive(Clone, Debug)]
pub struct MedianWeights {
    radius: usize,
    step_bits: u32,
    row_bits: u32,
    /// By |dy| and by dx from -radius to radius, in steps of the window, \[dy\]\[dx\].
    space: Vec<u8>,
    scale: u32,
    doublings: u32,
}

impl MedianWeights {
    /// The weights of `method`, with every second row of the window.
    #[must_use]
    pub fn of(method: &Method) -> Self {
        let window = method.refinement.median_window as usize;
        let weights =
            Self::new(window, method.refinement.median_sigma_space, method.refinement.median_sigma_range);
        Self { row_bits: SPARSE_ROW_BITS, ..weights }
    }

    /// The weights of the stretched window: all of its samples, four pixels apart. Each loses weight by its
    /// distance in steps, and the range sigma is a quarter.
    #[must_use]
    pub fn stretched(method: &Method) -> Self {
        let window = method.refinement.median_window as usize;
        let weights = Self::new(
            window,
            method.refinement.median_sigma_space,
            method.refinement.median_sigma_range / STRETCH_SIGMA,
        );
        Self { step_bits: STRETCH_BITS, ..weights }
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
        Self { radius, step_bits: 0, row_bits: 0, space, scale, doublings }
    }

    /// Radius of the window, in steps.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.radius
    }

    /// Spacing of the window's samples: 2 to this many pixels.
    #[must_use]
    pub fn step_bits(&self) -> u32 {
        self.step_bits
    }

    /// Spacing of the window's rows: 2 to this many steps, with the centre's row among them.
    #[must_use]
    pub fn row_bits(&self) -> u32 {
        self.row_bits
    }

    /// Factor of a 16-bit channel, 1 ..= 256; the upper 16 bits of the product are its guide.
    #[must_use]
    pub fn scale(&self) -> u32 {
        self.scale
    }

    /// Number of times that a sum of guide differences is doubled, 0 ..= 7.
    #[must_use]
    pub fn doublings(&self) -> u32 {
        self.doublings
    }

    /// The weight that distance subtracts, by |dy| and |dx|, as the shader reads it.
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
