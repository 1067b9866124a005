//! Pairs images of two cameras by the times in their headers.

use std::collections::{BTreeMap, VecDeque};

use crate::messages::{SECOND, Stamp};

/// Maximum number of images of a camera that wait for a partner, or for older images that arrive later.
const WAITING: usize = 32;
/// Maximum bytes of all waiting images, unless a single image is larger.
const BYTES: usize = 128 << 20;

/// The number of images without a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Left and right images without a partner.
    pub alone: [usize; 2],
    /// Images with the same time as another one of the same camera.
    pub repeated: usize,
    /// Images too far out of order; live, images older than the last pair.
    pub late: usize,
}

/// Pairs images that arrive in any order, and returns the pairs ordered by time.
#[derive(Debug)]
pub struct Pairing<T> {
    tolerance: u64,
    sides: [BTreeMap<Stamp, (T, usize)>; 2],
    bytes: usize,
    /// Images up to this time have been decided.
    decided: Option<Stamp>,
    tally: Tally,
}

impl<T> Pairing<T> {
    /// Pairs images whose times differ by at most `tolerance` nanoseconds.
    #[must_use]
    pub fn new(tolerance: u64) -> Self {
        Self {
            tolerance,
            sides: [BTreeMap::new(), BTreeMap::new()],
            bytes: 0,
            decided: None,
            tally: Tally::default(),
        }
    }

    /// Adds an image of `bytes` bytes from the left (0) or right (1) camera.
    pub fn add(&mut self, side: usize, stamp: Stamp, image: T, bytes: usize) {
        if self.sides[side].contains_key(&stamp) {
            self.tally.repeated += 1;
        } else if self.decided.is_some_and(|decided| stamp <= decided) {
            self.tally.late += 1;
        } else {
            self.sides[side].insert(stamp, (image, bytes));
            self.bytes += bytes;
        }
    }

    /// The next definite pair, left image first; `all` means that no more images will come, so the rest is decided.
    pub fn next(&mut self, all: bool) -> Option<[(Stamp, T); 2]> {
        while all || self.is_full() {
            let oldest = self.sides.each_ref().map(|side| side.keys().next().copied());
            let (side, stamp) = match oldest {
                [None, None] => return None,
                [Some(left), Some(right)] if right < left => (1, right),
                [Some(left), _] => (0, left),
                [None, Some(right)] => (1, right),
            };
            let partner = oldest[1 - side].filter(|other| self.are_partners(side, stamp, *other));
            let one = self.take(side, stamp);
            let other = partner.and_then(|other| Some((other, self.take(1 - side, other)?)));
            self.decided = Some(stamp);
            match (one, other) {
                (Some(one), Some((time, other))) if side == 0 => return Some([(stamp, one), (time, other)]),
                (Some(one), Some((time, other))) => return Some([(time, other), (stamp, one)]),
                _ => self.tally.alone[side] += 1,
            }
        }
        None
    }

    /// The number of images without a pair so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }

    fn is_full(&self) -> bool {
        self.sides.iter().any(|side| side.len() > WAITING) || self.bytes > BYTES
    }

    /// Whether `other`, the other camera's oldest image and not older than `stamp`, is within tolerance and not closer to this camera's
    /// next image.
    fn are_partners(&self, side: usize, stamp: Stamp, other: Stamp) -> bool {
        let apart = |a: Stamp, b: Stamp| a.0.abs_diff(b.0);
        let next = self.sides[side].keys().nth(1);
        apart(stamp, other) <= self.tolerance
            && next.is_none_or(|next| apart(*next, other) >= apart(stamp, other))
    }

    fn take(&mut self, side: usize, stamp: Stamp) -> Option<T> {
        let (image, bytes) = self.sides[side].remove(&stamp)?;
        self.bytes -= bytes;
        Some(image)
    }
}

/// Maximum number of images of a camera that wait for a live partner.
const WAITING_LIVE: usize = 8;
/// If a camera's time jumps back by more than this, it was restarted, or a recording is played again.
const RESTART: u64 = SECOND.unsigned_abs();

/// Pairs live images without delay: a pair is complete as soon as its second image arrives, and all earlier images are dropped.
#[derive(Debug)]
pub struct LivePairing<T> {
    tolerance: u64,
    sides: [BTreeMap<Stamp, T>; 2],
    /// The times of the last pair.
    last: [Option<Stamp>; 2],
    tally: Tally,
}

impl<T> LivePairing<T> {
    /// Pairs images whose times differ by at most `tolerance` nanoseconds. Less than half the time between two images of a camera makes
    /// partners unique.
    #[must_use]
    pub fn new(tolerance: u64) -> Self {
        Self {
            tolerance,
            sides: [BTreeMap::new(), BTreeMap::new()],
            last: [None; 2],
            tally: Tally::default(),
        }
    }

    /// Adds an image of the left (0) or right (1) camera. Returns the pair that it completes, left image first.
    pub fn add(&mut self, side: usize, stamp: Stamp, image: T) -> Option<[(Stamp, T); 2]> {
        if let Some(last) = self.last[side].filter(|last| stamp <= *last) {
            if stamp.0.abs_diff(last.0) <= RESTART {
                let which = if stamp == last { &mut self.tally.repeated } else { &mut self.tally.late };
                *which += 1;
                return None;
            }
            self.last = [None; 2];
            (0..2).for_each(|side| self.give_up(side, None));
        }
        let apart = |other: &Stamp| stamp.0.abs_diff(other.0);
        let nearest = self.sides[1 - side].keys().copied().min_by_key(apart);
        let Some(partner) = nearest.filter(|other| apart(other) <= self.tolerance) else {
            if self.sides[side].insert(stamp, image).is_some() {
                self.tally.repeated += 1;
            }
            if self.sides[side].len() > WAITING_LIVE {
                self.sides[side].pop_first();
                self.tally.alone[side] += 1;
            }
            return None;
        };
        let other = self.sides[1 - side].remove(&partner)?;
        self.give_up(side, Some(stamp));
        self.give_up(1 - side, Some(partner));
        (self.last[side], self.last[1 - side]) = (Some(stamp), Some(partner));
        let (one, other) = ((stamp, image), (partner, other));
        Some(if side == 0 { [one, other] } else { [other, one] })
    }

    /// The number of images without a pair so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Drops the waiting images of a camera that are older than `than`, or all.
    fn give_up(&mut self, side: usize, than: Option<Stamp>) {
        let newer = than.map(|than| self.sides[side].split_off(&than)).unwrap_or_default();
        self.tally.alone[side] += std::mem::replace(&mut self.sides[side], newer).len();
    }
}

/// Messages of another sensor, such as a lidar, of which an image takes the one that is nearest in time.
#[derive(Debug)]
pub struct Companions<T> {
    waiting: VecDeque<(Stamp, T, usize)>,
    bytes: usize,
}

impl<T> Default for Companions<T> {
    fn default() -> Self {
        Self { waiting: VecDeque::new(), bytes: 0 }
    }
}

impl<T> Companions<T> {
    /// Adds a message of `bytes` bytes. The ones that came first go if all together are too large.
    pub fn add(&mut self, stamp: Stamp, message: T, bytes: usize) {
        self.waiting.push_back((stamp, message, bytes));
        self.bytes += bytes;
        while self.bytes > BYTES && self.waiting.len() > 1 {
            self.bytes -= self.waiting.pop_front().map_or(0, |(.., bytes)| bytes);
        }
    }

    /// The message nearest to the time `stamp`, if that is at most `within` nanoseconds away. Of two as near, the last one.
    #[must_use]
    pub fn nearest(&self, stamp: Stamp, within: u64) -> Option<&T> {
        let apart = |other: &Stamp| other.0.abs_diff(stamp.0);
        let nearest = self.waiting.iter().rev().min_by_key(|(other, ..)| apart(other));
        nearest.filter(|(other, ..)| apart(other) <= within).map(|(_, message, _)| message)
    }

    /// Drops the messages before the time `stamp`.
    pub fn forget_before(&mut self, stamp: Stamp) {
        self.waiting.retain(|(other, ..)| *other >= stamp);
        self.bytes = self.waiting.iter().map(|(.., bytes)| bytes).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_companion_is_taken() {
        let mut all = Companions::default();
        for ms in [100, 300, 200, 400] {
            all.add(Stamp(ms), ms, 1);
        }
        for (stamp, expected) in [
            (100, Some(100)),
            (240, Some(200)),
            (250, Some(200)),
            (251, Some(300)),
            (500, Some(400)),
            (501, None),
            (-1, None),
        ] {
            assert_eq!(all.nearest(Stamp(stamp), 100).copied(), expected, "{stamp}");
        }
        all.forget_before(Stamp(300));
        assert_eq!((all.nearest(Stamp(240), 100), all.nearest(Stamp(199), 100)), (Some(&300), None));
        assert_eq!(all.bytes, 2);
        // The memory is bounded, unless one alone is larger.
        all.add(Stamp(700), 700, BYTES);
        assert_eq!((all.waiting.len(), all.bytes), (1, BYTES));
        all.add(Stamp(800), 800, 2 * BYTES);
        assert_eq!((all.nearest(Stamp(700), 99), all.nearest(Stamp(800), 0)), (None, Some(&800)));
    }

    /// The pairs among live images, each `l` or `r` with a time in milliseconds, in order of arrival.
    fn live(tolerance: u64, arriving: &str) -> (String, Tally) {
        let mut pairing = LivePairing::new(tolerance * 1_000_000);
        let mut pairs = Vec::new();
        for image in arriving.split(' ') {
            let (side, ms) = image.split_at(1);
            let stamp = Stamp(ms.parse::<i64>().unwrap() * 1_000_000);
            if let Some([(_, l), (_, r)]) = pairing.add(usize::from(side == "r"), stamp, ms) {
                pairs.push(format!("{l}={r}"));
            }
        }
        (pairs.join(" "), pairing.tally())
    }

    #[test]
    fn live_pairs_come_at_once() {
        let tally = |left, right, repeated, late| Tally { alone: [left, right], repeated, late };
        for (tolerance, arriving, pairs, expected) in [
            (0, "l1 r1 r2 l2", "1=1 2=2", tally(0, 0, 0, 0)),
            // Images older than a pair have no partner any more.
            (0, "l1 l2 r2 r1 l3 r3", "2=2 3=3", tally(1, 0, 0, 1)),
            (0, "l1 l1 r1 r1 l1", "1=1", tally(0, 0, 3, 0)),
            (0, "l10 r11 l20 r21", "", tally(0, 0, 0, 0)),
            (3, "l10 r11 r19 l20 l30 r40", "10=11 20=19", tally(0, 0, 0, 0)),
            (3, "r8 r11 l10", "10=11", tally(0, 1, 0, 0)),
            // The cameras' clock restarts.
            (0, "l5000 r5000 l6000 l10 r10 r20 l20", "5000=5000 10=10 20=20", tally(1, 0, 0, 0)),
        ] {
            assert_eq!(live(tolerance, arriving), (pairs.into(), expected), "{arriving}");
        }
        // The right camera is silent, so old images are dropped.
        let all: Vec<_> = (1..=100).map(|ms| format!("l{ms}")).collect();
        assert_eq!(live(0, &all.join(" ")), (String::new(), tally(100 - WAITING_LIVE, 0, 0, 0)));
    }

    /// The pairs of images with these times in milliseconds, and the tally.
    fn paired(tolerance: u64, left: &[i64], right: &[i64]) -> (String, Tally) {
        let mut pairing = Pairing::new(tolerance * 1_000_000);
        for (side, times) in [left, right].into_iter().enumerate() {
            for ms in times {
                pairing.add(side, Stamp(ms * 1_000_000), *ms, 1);
            }
        }
        let pairs = std::iter::from_fn(|| pairing.next(true));
        let pairs: Vec<_> = pairs.map(|[(_, l), (_, r)]| format!("{l}={r}")).collect();
        (pairs.join(" "), pairing.tally())
    }

    #[test]
    fn times_are_equal_or_near() {
        let alone = |left, right| Tally { alone: [left, right], ..Tally::default() };
        assert_eq!(paired(0, &[1, 2, 3], &[3, 2, 1]), ("1=1 2=2 3=3".into(), alone(0, 0)));
        assert_eq!(paired(0, &[1, 2, 5], &[2, 3, 5, 9]), ("2=2 5=5".into(), alone(1, 2)));
        assert_eq!(paired(0, &[10, 20], &[11, 21]), (String::new(), alone(2, 2)));
        assert_eq!(paired(1, &[10, 20], &[11, 19]), ("10=11 20=19".into(), alone(0, 0)));
        // The nearer image wins, whichever comes first.
        assert_eq!(paired(6, &[0, 10], &[6]), ("10=6".into(), alone(1, 0)));
        assert_eq!(paired(6, &[5], &[0, 4, 11]), ("5=4".into(), alone(0, 2)));
        // In both directions: 6 is nearer to 10 than to 0, but 11 is nearer still.
        assert_eq!(paired(6, &[0, 10], &[6, 11]), ("10=11".into(), alone(1, 1)));
        let times: Vec<i64> = (0..200).collect();
        assert_eq!(paired(0, &times, &times).0.split(' ').count(), 200);
    }

    #[test]
    fn waiting_images_are_bounded() {
        let mut pairing = Pairing::new(0);
        // The right camera is silent, so old images are dropped.
        for time in 1..=1000 {
            pairing.add(0, Stamp(time), (), 1);
            assert!(pairing.next(false).is_none());
            assert!(pairing.sides[0].len() <= WAITING);
        }
        assert_eq!(pairing.tally().alone, [1000 - WAITING, 0]);
        // One late and one repeated image.
        pairing.add(1, Stamp(5), (), 1);
        pairing.add(0, Stamp(1000), (), 1);
        assert_eq!((pairing.tally().late, pairing.tally().repeated), (1, 1));
        // A single pair of large images passes.
        let mut pairing = Pairing::new(0);
        pairing.add(0, Stamp(1), (), BYTES);
        pairing.add(1, Stamp(1), (), BYTES);
        assert!(pairing.next(false).is_some() && pairing.bytes == 0);
    }
}
