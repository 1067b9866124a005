//! Cost values in the two widths of volumes, and operations on rows of them.

use crate::plan::{LABEL_BLOCK, Truncation, TruncationRule};
use std::ops::{BitAnd, BitOr, Not};

/// A stored cost in units. Sums saturate, and differences are at least 0.
pub(super) trait Units:
    bytemuck::Pod
    + Default
    + Ord
    + Send
    + Sync
    + From<u8>
    + Into<u16>
    + Into<u32>
    + BitOr<Output = Self>
    + BitAnd<Output = Self>
    + Not<Output = Self>
{
    /// The largest value, used as infinity.
    const MOST: Self;

    /// A block of the largest value, a block of 0, and a block of the largest value.
    const EDGE: &'static [Self; 3 * LABEL_BLOCK];

    /// The saturating sum.
    fn plus(self, other: Self) -> Self;

    /// The difference, at least 0.
    fn less(self, other: Self) -> Self;

    /// A value, clamped to the largest.
    fn of(value: u32) -> Self;

    /// The values at even and odd indices. (Written with words of two values, which compile to shuffles.)
    fn deinterleave(values: &[Self; 2 * LABEL_BLOCK]) -> [[Self; LABEL_BLOCK]; 2];

    /// `even` and `odd`, alternating.
    fn interleave(even: [Self; LABEL_BLOCK], odd: [Self; LABEL_BLOCK], out: &mut [Self; 2 * LABEL_BLOCK]);
}

macro_rules! units {
    ($type:ty, $word:ty) => {
        impl Units for $type {
            const MOST: Self = Self::MAX;

            const EDGE: &'static [Self; 3 * LABEL_BLOCK] = &{
                let mut edge = [Self::MAX; 3 * LABEL_BLOCK];
                let mut i = LABEL_BLOCK;
                while i < 2 * LABEL_BLOCK {
                    edge[i] = 0;
                    i += 1;
                }
                edge
            };

            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                self.saturating_add(other)
            }

            #[inline(always)]
            fn less(self, other: Self) -> Self {
                self.saturating_sub(other)
            }

            fn of(value: u32) -> Self {
                Self::try_from(value).unwrap_or(Self::MOST)
            }

            #[inline(always)]
            fn deinterleave(values: &[Self; 2 * LABEL_BLOCK]) -> [[Self; LABEL_BLOCK]; 2] {
                let pairs: &[[Self; 2]] = values.as_chunks().0;
                let words: [$word; LABEL_BLOCK] =
                    each_lane(|i| <$word>::from(pairs[i][0]) | <$word>::from(pairs[i][1]) << Self::BITS);
                [each_lane(|i| words[i] as Self), each_lane(|i| (words[i] >> Self::BITS) as Self)]
            }

            #[inline(always)]
            fn interleave(
                even: [Self; LABEL_BLOCK],
                odd: [Self; LABEL_BLOCK],
                out: &mut [Self; 2 * LABEL_BLOCK],
            ) {
                let words: [$word; LABEL_BLOCK] =
                    each_lane(|i| <$word>::from(even[i]) | <$word>::from(odd[i]) << Self::BITS);
                for (out, word) in out.as_chunks_mut().0.iter_mut().zip(words) {
                    *out = [word as Self, (word >> Self::BITS) as Self];
                }
            }
        }
    };
}

units!(u8, u16);
units!(u16, u32);

/// The smallest value of a row; the largest possible value for an empty one.
#[inline(always)]
pub(super) fn smallest<U: Units>(row: &[U]) -> U {
    row.iter().fold(U::MOST, |least, &v| least.min(v))
}

/// 0 for each label, and the largest value for the padding after them.
pub(super) fn padding<U: Units>(labels: usize, stride: usize) -> Vec<U> {
    (0..stride).map(|label| if label < labels { U::default() } else { U::MOST }).collect()
}

/// `N` labels of a row from `at` on: a block that stays in registers while several rows are processed
/// together.
#[inline(always)]
pub(super) fn block<T, const N: usize>(row: &[T], at: usize) -> &[T; N] {
    row[at..].first_chunk().expect("rows are whole blocks")
}

/// A mutable [`block`].
#[inline(always)]
pub(super) fn block_mut<T, const N: usize>(row: &mut [T], at: usize) -> &mut [T; N] {
    row[at..].first_chunk_mut().expect("rows are whole blocks")
}

/// The values of `lane` at 0 .. `N`. Unlike `std::array::from_fn`, it is always inlined; where calls inside
/// `from_fn` remained, nothing was vectorized and a stage took three times as long.
#[inline(always)]
pub(super) fn each_lane<T: Copy + Default, const N: usize>(mut lane: impl FnMut(usize) -> T) -> [T; N] {
    let mut lanes = [T::default(); N];
    for (i, out) in lanes.iter_mut().enumerate() {
        *out = lane(i);
    }
    lanes
}

/// The minimum in each of `LABEL_BLOCK` lanes.
pub(super) type Least<U> = [U; LABEL_BLOCK];

/// The minimum of all lanes, in each lane.
#[inline(always)]
fn least_in_all<U: Units>(lanes: Least<U>) -> Least<U> {
    least_of_pairs::<U, 1>(least_of_pairs::<U, 2>(least_of_pairs::<U, 4>(least_of_pairs::<U, 8>(lanes))))
}

/// The minimum of each lane and the lane `APART` from it. (A constant, so that it becomes a shuffle.)
#[inline(always)]
fn least_of_pairs<U: Units, const APART: usize>(lanes: Least<U>) -> Least<U> {
    each_lane(|i| lanes[i].min(lanes[i ^ APART]))
}

/// Lowers each lane of `least` to the minimum of all `values` in that lane.
#[inline(always)]
pub(super) fn keep_least<U: Units, const N: usize>(least: &mut Least<U>, values: &[U; N]) {
    for values in values.as_chunks().0 {
        let values: &Least<U> = values;
        *least = each_lane(|i| least[i].min(values[i]));
    }
}

/// An operation on rows of labels, block by block.
pub(super) trait Blocks {
    /// Whether the registers hold four vectors of each row.
    const LONG: bool = false;

    /// Processes `N` labels from `at` on.
    fn block<const N: usize>(&mut self, at: usize);

    /// Processes all of `stride` labels.
    #[inline(always)]
    fn all(&mut self, stride: usize) {
        let mut at = 0;
        while Self::LONG && at + 4 * LABEL_BLOCK <= stride {
            self.block::<{ 4 * LABEL_BLOCK }>(at);
            at += 4 * LABEL_BLOCK;
        }
        while at + 2 * LABEL_BLOCK <= stride {
            self.block::<{ 2 * LABEL_BLOCK }>(at);
            at += 2 * LABEL_BLOCK;
        }
        if at < stride {
            self.block::<LABEL_BLOCK>(at);
        }
    }
}

/// Truncates sums to a message, with [`Truncation::bounds`] for the minimum of `least`.
#[inline(always)]
pub(super) fn truncate<U: Units>(sums: &[U], least: Least<U>, cut: Truncation, out: &mut [U]) {
    let (low, high) = bounds(least, cut);
    for at in (0..out.len()).step_by(LABEL_BLOCK) {
        *block_mut(out, at) = cut_block(block(sums, at), &low, &high);
    }
}

/// [`Truncation::bounds`], (low, high), in every lane. The bounds stay in vectors: passing them through
/// scalars made a factor wait longer than it computed.
#[inline(always)]
pub(super) fn bounds<U: Units>(least: Least<U>, cut: Truncation) -> (Least<U>, Least<U>) {
    let tau = U::of(cut.tau.into());
    match cut.rule {
        TruncationRule::Relative => {
            let least = least_in_all(least);
            let low = each_lane(|i| least[i].min(U::MOST.less(tau)));
            (low, each_lane(|i| low[i].plus(tau)))
        }
        TruncationRule::Absolute => ([U::default(); LABEL_BLOCK], [tau; LABEL_BLOCK]),
    }
}

#[inline(always)]
pub(super) fn cut_block<U: Units>(sums: &Least<U>, low: &Least<U>, high: &Least<U>) -> Least<U> {
    each_lane(|i| sums[i].min(high[i]).less(low[i]))
}

/// Index and value of the minimum of whole blocks, the lowest index on ties.
#[inline(always)]
pub(super) fn argmin<U: Units>(row: &[U]) -> (usize, U) {
    let mut least = [u32::MAX; LABEL_BLOCK];
    for (i, block) in row.as_chunks::<LABEL_BLOCK>().0.iter().enumerate() {
        let at = (i * LABEL_BLOCK) as u32;
        // Value and index in one number.
        let keys: [u32; LABEL_BLOCK] =
            each_lane(|lane| Into::<u32>::into(block[lane]) << u16::BITS | (at + lane as u32));
        least = each_lane(|lane| least[lane].min(keys[lane]));
    }
    let key = least.iter().fold(u32::MAX, |first, &key| first.min(key));
    (usize::from(key as u16), U::of(key >> u16::BITS))
}
