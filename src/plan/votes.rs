//! Votes for what no match shows: the constants and the shape of [`Stage::VoteFill`](crate::backend::Stage::VoteFill).

use super::Plan;
use crate::options::{Fill, Method};

/// Distance from a voter's disparity, in 1/256 px, from which on its vote against a label is the same: 4 px.
pub const VOTE_MOST: i32 = 1024;
/// Bits by which such a distance is reduced to what is summed: a vote counts sixteenths of a pixel.
pub const VOTE_BITS: u32 = 4;
/// Vote of a pixel without a disparity against a label by which it would hide what the right view sees: 1.5 px, in sixteenths.
pub const VOTE_HIDING: u32 = 24;
/// Labels by which a surface must be nearer than what the right view sees, to hide it.
pub const HIDING_LABELS: u32 = 2;
/// The least confidence of a sure pixel, in eighths of a nat. Others hide nothing by what they show, and may be outvoted.
pub const VOTE_SURE: u32 = 32;
/// A pixel that is not sure is outvoted by a vote that is further from its disparity than this, in 1/256 px: 2 px. Votes are fronto-parallel,
/// and on slanted surfaces nearer ones say little.
pub const VOTE_OUTVOTES: i32 = 512;
/// Fractional bits of the sums along a row, so that faint votes from behind an edge still count.
pub const VOTE_FRACTION_BITS: u32 = 16;
/// Bits that a sum along a row loses before it is summed along its column.
pub const VOTE_SHIFT: u32 = 3;
/// How far votes reach along a column, in half-size pixels.
pub const VOTE_REACH: usize = 8;
/// What a half-size pixel adds to its difference in colour for each column and row that it is away, in 8-bit levels.
pub const VOTE_AWAY: u32 = 2;
/// Words that the sums of a band take, unless a row takes more (open).
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
    /// Labels that are voted for: those with the indices 0, 2, 4 and so on.
    pub labels: usize,
    /// Number of rows whose votes are counted at a time. It changes no bit of the result.
    pub band: usize,
}

impl Votes {
    /// Those of `plan`.
    #[must_use]
    pub fn of(plan: &Plan) -> Self {
        let level = &plan.levels[0];
        let (width, height) = (level.width.div_ceil(2), level.height.div_ceil(2));
        let labels = level.labels.div_ceil(2);
        Self { width, height, labels, band: (BAND_WORDS / (width * labels)).clamp(1, height) }
    }

    /// Number of rows whose sums that takes, at most.
    #[must_use]
    pub fn summed(&self) -> usize {
        (self.band + 2 * VOTE_REACH).min(self.height)
    }
}
