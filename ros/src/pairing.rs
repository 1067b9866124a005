//! Images of two cameras that belong together, by the times of their headers.

use std::collections::BTreeMap;

use crate::messages::{SECOND, Stamp};

/// Most images of a camera that wait for their partners, or for older ones that come later.
const WAITING: usize = 32;
/// Most bytes of all that wait, unless a single image has more.
const BYTES: usize = 128 << 20;

/// How many images gave no pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Without a partner, of the left and of the right camera.
    pub alone: [usize; 2],
    /// With the time of another one of the same camera.
    pub repeated: usize,
    /// Behind so many newer ones that they could not be put in order; live, behind a pair that is newer.
    pub late: usize,
}

/// Finds the pairs among images that come in any order, and gives them in the order of their times.
#[derive(Debug)]
pub struct Pairing<T> {
    tolerance: u64,
    sides: [BTreeMap<Stamp, (T, usize)>; 2],
    bytes: usize,
    /// What is as old as this is decided.
    decided: Option<Stamp>,
    tally: Tally,
}

impl<T> Pairing<T> {
    /// Of images whose times differ by at most `tolerance` nanoseconds.
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

    /// Adds an image of the left (0) or right (1) camera, which takes so many bytes.
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

    /// The next pair that is certain, the left image first; with `all` nothing more is to come, and the rest is decided.
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

    /// How many images gave no pair so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }

    fn is_full(&self) -> bool {
        self.sides.iter().any(|side| side.len() > WAITING) || self.bytes > BYTES
    }

    /// Whether `other`, the oldest of the other camera and not older, is near enough, and no image of the same camera is nearer to it.
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

/// Most images of a camera that wait live for their partners.
const WAITING_LIVE: usize = 8;
/// A camera whose times go back by more has begun anew: it was started again, or a recording is played again.
const RESTART: u64 = SECOND.unsigned_abs();

/// Finds the newest pair among images as they arrive, and waits for nothing: a pair is one as soon as its second image is there, and
/// all images before it are given up.
#[derive(Debug)]
pub struct LivePairing<T> {
    tolerance: u64,
    sides: [BTreeMap<Stamp, T>; 2],
    /// The times of the last pair.
    last: [Option<Stamp>; 2],
    tally: Tally,
}

impl<T> LivePairing<T> {
    /// Of images whose times differ by at most `tolerance` nanoseconds. Less than half of the time between two images of a camera leaves
    /// one partner to each.
    #[must_use]
    pub fn new(tolerance: u64) -> Self {
        Self {
            tolerance,
            sides: [BTreeMap::new(), BTreeMap::new()],
            last: [None; 2],
            tally: Tally::default(),
        }
    }

    /// Adds an image of the left (0) or right (1) camera. Returns the pair that it completes, the left image first.
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

    /// How many images gave no pair so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Leaves out what waits on a side and is older than `than`, or all.
    fn give_up(&mut self, side: usize, than: Option<Stamp>) {
        let newer = than.map(|than| self.sides[side].split_off(&than)).unwrap_or_default();
        self.tally.alone[side] += std::mem::replace(&mut self.sides[side], newer).len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pairs of live images, `l` or `r` with a time in milliseconds each, in the order in which they arrive.
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
            // What is older than a pair has no partner any more.
            (0, "l1 l2 r2 r1 l3 r3", "2=2 3=3", tally(1, 0, 0, 1)),
            (0, "l1 l1 r1 r1 l1", "1=1", tally(0, 0, 3, 0)),
            (0, "l10 r11 l20 r21", "", tally(0, 0, 0, 0)),
            (3, "l10 r11 r19 l20 l30 r40", "10=11 20=19", tally(0, 0, 0, 0)),
            (3, "r8 r11 l10", "10=11", tally(0, 1, 0, 0)),
            // The clock of the cameras begins anew.
            (0, "l5000 r5000 l6000 l10 r10 r20 l20", "5000=5000 10=10 20=20", tally(1, 0, 0, 0)),
        ] {
            assert_eq!(live(tolerance, arriving), (pairs.into(), expected), "{arriving}");
        }
        // The right camera is silent: old images are given up.
        let all: Vec<_> = (1..=100).map(|ms| format!("l{ms}")).collect();
        assert_eq!(live(0, &all.join(" ")), (String::new(), tally(100 - WAITING_LIVE, 0, 0, 0)));
    }

    /// What is paired of times in milliseconds, and what is not.
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
        // The nearer one counts, whichever comes first.
        assert_eq!(paired(6, &[0, 10], &[6]), ("10=6".into(), alone(1, 0)));
        assert_eq!(paired(6, &[5], &[0, 4, 11]), ("5=4".into(), alone(0, 2)));
        // Both ways: 6 is nearer to 10 than to 0, and 11 is still nearer.
        assert_eq!(paired(6, &[0, 10], &[6, 11]), ("10=11".into(), alone(1, 1)));
        let times: Vec<i64> = (0..200).collect();
        assert_eq!(paired(0, &times, &times).0.split(' ').count(), 200);
    }

    #[test]
    fn what_waits_is_bounded() {
        let mut pairing = Pairing::new(0);
        // The right camera is silent: old images are given up.
        for time in 1..=1000 {
            pairing.add(0, Stamp(time), (), 1);
            assert!(pairing.next(false).is_none());
            assert!(pairing.sides[0].len() <= WAITING);
        }
        assert_eq!(pairing.tally().alone, [1000 - WAITING, 0]);
        // One that is too late, and one that comes twice.
        pairing.add(1, Stamp(5), (), 1);
        pairing.add(0, Stamp(1000), (), 1);
        assert_eq!((pairing.tally().late, pairing.tally().repeated), (1, 1));
        // Large images: a single pair passes.
        let mut pairing = Pairing::new(0);
        pairing.add(0, Stamp(1), (), BYTES);
        pairing.add(1, Stamp(1), (), BYTES);
        assert!(pairing.next(false).is_some() && pairing.bytes == 0);
    }
}
