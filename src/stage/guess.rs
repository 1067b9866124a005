//! Takes what a look has filled in as a weak prior for the next look.
//!
//! At level 0, the [`Prior`](Data::Prior) of a pixel that has a flag of [`INVALID`](crate::maps::flag::INVALID) and
//! [`FILLED`](crate::maps::flag::FILLED), with its disparity D and the smallest disparity low of the level:
//!
//! ```text
//! lo = hi = (D - 256 low) >> 3       slope = GUESS_SLOPE       cap = GUESS_CAP
//! ```
//!
//! Nothing is known of all other pixels. Where something is known from elsewhere, with a larger cap, it stays.
//!
//! At a coarser level, the prior of a pixel is that of its known children in the next finer level, up to 2 x 2 inside the image: the
//! smallest interval that holds theirs, with the offset o, 2 low - (low of the finer level), and F = 32, the fractions of a label.
//! Nothing is known without such children.
//!
//! ```text
//! lo    = floor((smallest lo - F o - F) / 2)          cut to -F ..= F labels, like hi
//! hi    = ceil((largest hi - F o + F) / 2)
//! slope = min(2 (sum of slopes) / n, 4095)            rounded down, n children
//! cap   = (sum of caps) / n                           rounded down; a guess counts GUESS_FADE less than its cap, at least 0
//! ```
//!
//! So a guess counts less at coarser levels, and nothing from the third one on: there, it would carry too far from plain walls whose
//! few matches are wrong.
//!
//! Smoothing ([`median`](super::median), [`plane`](super::plane)) is left out between two looks: the guesses become no better by it.
//!
//! (A match cannot decide where a surface is hidden or plain; what was filled in from its surroundings often can. A prior of little more
//! than a nat loses against any clear match, so that the next look corrects wrong guesses, and its messages carry right ones farther.)

use super::{Data, Descriptor, Map, maps};

/// The largest cost of a guess, in units: 1.25 nats.
pub(crate) const GUESS_CAP: u8 = 5;
/// The largest cost of a guess is smaller by this at each coarser level, in units: half a nat.
pub(crate) const GUESS_FADE: u8 = 2;
/// The cost of a guess per label, in 1/16 unit: one nat.
pub(crate) const GUESS_SLOPE: u32 = 64;

/// The cap with which a prior of this `cap` enters the mean cap of the next coarser level. A guess loses [`GUESS_FADE`]. A prior of
/// the caller, whose cap is larger than [`GUESS_CAP`], loses nothing.
pub(crate) const fn faded(cap: u8) -> u8 {
    if cap > GUESS_CAP { cap } else { cap.saturating_sub(GUESS_FADE) }
}

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| match z.checked_sub(1) {
        None => [maps(&[Map::Disparity, Map::Validity]), vec![Data::Prior(0)]].concat(),
        Some(finer) => vec![Data::Prior(finer)],
    },
    writes: |z| vec![Data::Prior(z)],
    pixel: 1.5,
    ..Descriptor::NONE
};
