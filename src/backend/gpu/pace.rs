//! The amount of work per submission.

use std::time::Duration;

/// Work per submission, as the approximate time on one thread of a processor in ns: short enough for drivers
/// that stop long jobs, and for progress bars with software drivers.
const WORK: u64 = 1_000_000_000;
const SOFTWARE_WORK: u64 = 250_000_000;
/// Initial value in browsers.
const BROWSER_WORK: u64 = 4_000_000;
/// Submissions that take less than this grow twofold.
const SHORT: Duration = Duration::from_millis(30);
/// Longer submissions shrink, because they delay progress bars, and the page itself with software drivers.
const LONG: Duration = Duration::from_millis(200);
/// Number of submissions to average times over. Browsers may report the ends of two at once.
const ROUND: u32 = 2;

/// The amount of work per submission. Browsers hide whether a device is a software driver, so submissions
/// there start small. They double while they are short, or hardly longer than those of half the size, when
/// most of the time is spent in the browser, which polls rarely. A submission that takes too long shrinks the
/// next ones. That occurs because work is an estimate, and iterations after convergence take no time.
#[derive(Debug)]
pub(super) struct Pace {
    work: u64,
    grows: bool,
    /// Mean time of submissions of half the size, if there were any.
    half: Option<Duration>,
    /// Number of full submissions of this size that have ended, and their total time.
    ended: (u32, Duration),
}

impl Pace {
    /// For a software driver, or another device.
    pub(super) fn new(software: bool) -> Self {
        let work = if software { SOFTWARE_WORK } else { WORK };
        Self { work, grows: false, half: None, ended: (0, Duration::ZERO) }
    }

    /// For a device in a browser.
    pub(super) fn in_browser() -> Self {
        Self { work: BROWSER_WORK, grows: true, ..Self::new(false) }
    }

    /// Work per submission, in ns on one thread of a processor.
    pub(super) fn work(&self) -> u64 {
        self.work
    }

    /// Records the end of a full submission. `took` counts from its start or the previous end, whichever was later.
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

    /// Work per submission after many submissions, if the browser polls every `look` and reports two at once,
    /// and the device is `times` as fast as one thread of a processor.
    fn settled(look: Duration, times: u64) -> u64 {
        let mut pace = Pace::in_browser();
        for _ in 0..100 {
            let two = Duration::from_nanos(2 * pace.work() / times);
            let looks = two.as_nanos().div_ceil(look.as_nanos().max(1)).max(1) as u32;
            pace.end(if look.is_zero() { two / 2 } else { looks * look });
            pace.end(if look.is_zero() { two / 2 } else { Duration::ZERO });
        }
        pace.work()
    }

    #[test]
    fn work_grows_until_submissions_take_long() {
        let slow = 2;
        for (look, most) in [(0, 100), (100, 400)] {
            let work = settled(Duration::from_millis(look), slow);
            let milliseconds = work / slow / 1_000_000;
            assert!((15..=most).contains(&milliseconds), "looked for every {look} ms: {milliseconds} ms");
        }
        // Rare polling does not slow down a fast device.
        for look in [0, 100] {
            assert_eq!(settled(Duration::from_millis(look), 2_000), WORK, "{look}");
        }
    }

    #[test]
    fn work_shrinks_after_long_submissions() {
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
    fn work_is_constant_outside_browsers() {
        for (software, work) in [(true, SOFTWARE_WORK), (false, WORK)] {
            let mut pace = Pace::new(software);
            (0..10).for_each(|_| pace.end(Duration::ZERO));
            assert_eq!(pace.work(), work);
        }
    }
}
