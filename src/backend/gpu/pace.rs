//! How much is submitted at once.

use std::time::Duration;

/// Iterations of all loops of all invocations that are submitted at once, about: short enough for drivers that stop long jobs,
/// and on a processor for a bar that moves.
const WORK: u64 = 1 << 32;
const SOFTWARE_WORK: u64 = 1 << 30;
/// The same in a browser at first.
const BROWSER_WORK: u64 = 1 << 24;
/// Submissions that take less than this double.
const SHORT: Duration = Duration::from_millis(30);
/// Submissions that take longer than this shrink: meanwhile there is no progress, and software drivers draw no page.
const LONG: Duration = Duration::from_millis(200);
/// Over so many submissions times are averaged. Browsers may tell of the end of two at once.
const ROUND: u32 = 2;

/// How much is submitted at once. A browser does not say whether its device is a driver in software. So submissions there begin small and
/// double, as long as they are short, or take hardly longer than those of half the size: then most of the time is the browser's, which
/// looks only now and then for what has ended. One that takes too long makes the next ones smaller. That happens because the work is
/// partly an estimate, and iterations after messages have settled take no time.
#[derive(Debug)]
pub(super) struct Pace {
    work: u64,
    grows: bool,
    /// The mean time of submissions of half the size, once there were any.
    half: Option<Duration>,
    /// How many full submissions of this size have ended, and their time together.
    ended: (u32, Duration),
}

impl Pace {
    /// That of a device that is a driver in software, or is not.
    pub(super) fn new(software: bool) -> Self {
        let work = if software { SOFTWARE_WORK } else { WORK };
        Self { work, grows: false, half: None, ended: (0, Duration::ZERO) }
    }

    /// That in a browser.
    pub(super) fn in_browser() -> Self {
        Self { work: BROWSER_WORK, grows: true, ..Self::new(false) }
    }

    /// Iterations of loops that are submitted at once.
    pub(super) fn work(&self) -> u64 {
        self.work
    }

    /// A full submission has ended. `took` counts from when it was submitted, or from the end of the one before it if that was later.
    pub(super) fn end(&mut self, took: Duration) {
        if !self.grows {
            return;
        }
        let (count, together) = (self.ended.0 + 1, self.ended.1 + took);
        self.ended = (count, together);
        if took > LONG {
            let parts = took.as_micros().div_ceil(LONG.as_micros()) as u64;
            self.work = (self.work / parts).max(BROWSER_WORK);
            self.half = Some(LONG / 2);
        } else if count < ROUND {
            return;
        } else {
            let mean = together / count;
            if mean < SHORT || self.half.is_none_or(|half| 4 * mean < 5 * half) {
                self.work = (2 * self.work).min(WORK);
                self.half = Some(mean);
            }
        }
        self.ended = (0, Duration::ZERO);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is submitted at once after many submissions, where two are told of together at the end of every `look`, and a device does so
    /// many iterations in a microsecond.
    fn settled(look: Duration, per_microsecond: u64) -> u64 {
        let mut pace = Pace::in_browser();
        for _ in 0..100 {
            let two = Duration::from_micros(2 * pace.work() / per_microsecond);
            let looks = two.as_nanos().div_ceil(look.as_nanos().max(1)).max(1) as u32;
            pace.end(if look.is_zero() { two / 2 } else { looks * look });
            pace.end(if look.is_zero() { two / 2 } else { Duration::ZERO });
        }
        pace.work()
    }

    #[test]
    fn it_grows_to_what_the_device_does_in_a_moment() {
        let slow = 400;
        for (look, most) in [(0, 100), (100, 400)] {
            let work = settled(Duration::from_millis(look), slow);
            let milliseconds = work / slow / 1000;
            assert!((15..=most).contains(&milliseconds), "looked for every {look} ms: {milliseconds} ms");
        }
        // A browser that looks seldom holds no fast device back.
        for look in [0, 100] {
            assert_eq!(settled(Duration::from_millis(look), 400_000), WORK, "{look}");
        }
    }

    #[test]
    fn what_takes_too_long_shrinks_it() {
        let mut pace = Pace::in_browser();
        (0..40).for_each(|_| pace.end(Duration::ZERO));
        assert_eq!(pace.work(), WORK);
        pace.end(50 * LONG);
        assert_eq!(pace.work(), WORK / 50);
        (0..10).for_each(|_| pace.end(LONG));
        assert_eq!(pace.work(), WORK / 50, "this is what it may take");
        (0..10).for_each(|_| pace.end(10_000 * LONG));
        assert_eq!(pace.work(), BROWSER_WORK);
    }

    #[test]
    fn it_stays_on_devices_that_are_known() {
        for (software, work) in [(true, SOFTWARE_WORK), (false, WORK)] {
            let mut pace = Pace::new(software);
            (0..10).for_each(|_| pace.end(Duration::ZERO));
            assert_eq!(pace.work(), work);
        }
    }
}
