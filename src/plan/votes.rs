//! Constants and shape of the votes of [`Stage::VoteFill`](crate::backend::Stage::VoteFill).

use super::Plan;
use crate::options::{Fill, Method};

/// Limit of the distance between a label and a voter's disparity, in 1/256 px: 4 px.
pub const VOTE_MOST: i32 = 1024;
/// Right shift of that distance: votes count sixteenths of a pixel.
pub const VOTE_BITS: u32 = 4;
/// Vote of a pixel without a disparity against labels that would hide a label in the right view: 1.5 px, in sixteenths.
pub const VOTE_HIDING: u32 = 24;
/// A surface hides a label in the right view if it is nearer by at least this many labels.
pub const HIDING_LABELS: u32 = 2;
/// Smallest confidence of a sure pixel, in eighths of a nat. Others hide nothing, and may be outvoted.
pub const VOTE_SURE: u32 = 32;
/// A pixel that is not sure is outvoted if the vote differs from its disparity by more than this, in 1/256
/// px: 2 px. Votes are fronto-parallel, so smaller differences mean little on slanted surfaces.
pub const VOTE_OUTVOTES: i32 = 512;
/// Fractional bits of the sums along a row, so that faint votes from beyond an edge still count.
pub const VOTE_FRACTION_BITS: u32 = 16;
/// Right shift of sums along a row before they are summed along columns.
pub const VOTE_SHIFT: u32 = 3;
/// Reach of votes along a column, in half-size pixels.
pub const VOTE_REACH: usize = 8;
/// Distance of one column or row of half-size pixels, as a difference in colour in 8-bit levels.
pub const VOTE_AWAY: u32 = 2;
/// Words of the sums of a band, unless one row takes more (open).
const BAND_WORDS: usize = 4 << 20;

/// Whether `method` fills by votes.
#[must_use]
pub fn are_taken(method: &Method) -> bool {
    method.refinement.fill == Fill::Votes
}

/// The shape of the votes of a match: half-size pixels, and every second label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Votes {
    /// Half-size pixels in a row.
    pub width: usize,
    /// Rows of half-size pixels.
    pub height: usize,
    /// Number of labels that are voted for: those with the indices 0, 2, 4 and so on.
    pub labels: usize,
    /// Number of rows whose votes are counted at a time. It does not affect the result.
    pub band: usize,
}

impl Votes {
    /// The shape of the votes of `plan`.
    #[must_use]
    pub fn of(plan: &Plan) -> Self {
        let level = &plan.levels[0];
        let (width, height) = (level.width.div_ceil(2), level.height.div_ceil(2));
        let labels = level.labels.div_ceil(2);
        Self { width, height, labels, band: (BAND_WORDS / (width * labels)).clamp(1, height) }
    }

    /// Largest number of rows that are summed for a band.
    #[must_use]
    pub fn summed(&self) -> usize {
        (self.band + 2 * VOTE_REACH).min(self.height)
    }
}
