//! Status lines of a running node: matched frames, their times, and skipped ones.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mrfgs_ros::messages::{CompressedImage, Image, Type};

use crate::console;
use crate::text::plural;

use super::arrivals::{Arrivals, Arrived, CameraTopics, Count};

/// Interval of the status line.
const PERIOD: Duration = Duration::from_secs(10);
/// Maximum number of complaints per period.
const MOST: usize = 4;
/// A longer wait for calibrations is reported; cameras may send them after their first images.
const LONG: Duration = Duration::from_secs(2);
/// Stamps further from now than this belong to another clock, that of a played recording or a simulation.
const SAME_CLOCK: Duration = Duration::from_secs(60);

/// Counts of pairs in a period.
#[derive(Default)]
struct Frames {
    /// From the arrival of the second image to the publication, in milliseconds.
    delays: Vec<f64>,
    /// From the stamp of the left image to the publication, in milliseconds, if both clocks agree.
    ages: Vec<f64>,
    failed: usize,
    unheard: usize,
    /// Pairs without a calibration of both cameras.
    waiting: usize,
}

pub(super) struct Log {
    quiet: bool,
    start: Instant,
    period: Instant,
    frames: Frames,
    /// Counts at the start of the period.
    before: Count,
    /// Published and failed frames before the period.
    published: usize,
    failed: usize,
    /// Complaints printed in this period, without digits.
    told: Vec<String>,
}

impl Log {
    pub(super) fn new(quiet: bool) -> Self {
        let now = Instant::now();
        let (frames, before) = (Frames::default(), Count::default());
        Self { quiet, start: now, period: now, frames, before, published: 0, failed: 0, told: Vec::new() }
    }

    /// Counts a published pair.
    pub(super) fn published(&mut self, arrived: &Arrived) {
        let milliseconds = |time: Duration| 1e3 * time.as_secs_f64();
        self.frames.delays.push(milliseconds(arrived.at.elapsed()));
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let stamp = Duration::from_nanos(arrived.header.stamp.0.max(0).unsigned_abs());
        if let Some(age) = since_epoch.checked_sub(stamp).filter(|age| *age <= SAME_CLOCK) {
            self.frames.ages.push(milliseconds(age));
        }
    }

    /// Counts a pair without subscribers.
    pub(super) fn unheard(&mut self) {
        self.frames.unheard += 1;
    }

    /// Counts a failed pair, and reports the reason.
    pub(super) fn failed(&mut self, reason: &str) {
        self.frames.failed += 1;
        self.complain(reason);
    }

    /// Reports that part of an image may be damaged.
    pub(super) fn doubted(&mut self, doubt: &str) {
        if !self.quiet {
            self.complain(&format!("warning: {doubt}"));
        }
    }

    /// Counts a pair without a calibration, and reports it if that lasts.
    pub(super) fn waits(&mut self, cameras: &CameraTopics) {
        self.frames.waiting += 1;
        if self.start.elapsed() >= LONG {
            let [left, right] = [0, 1].map(|side| cameras.info(side));
            self.complain(&format!(
                "no calibration of both cameras arrives on {left} and {right}; give one with --calib"
            ));
        }
    }

    /// Prints a complaint, once per period whatever its numbers, and at most [`MOST`].
    fn complain(&mut self, reason: &str) {
        let words = reason.replace(|c: char| c.is_ascii_digit(), "");
        if self.told.len() < MOST && !self.told.contains(&words) {
            self.told.push(words);
            console::say(reason);
        }
    }

    /// Prints the status line if it is due.
    pub(super) fn tell(&mut self, cameras: &CameraTopics, arrivals: &Arrivals) {
        if let Some((topic, reason)) = arrivals.unreadable() {
            let [name, _] = cameras.topic(topic);
            self.complain(&format!("a message of {name} {reason}"));
        }
        for (topic, others) in arrivals.mistyped() {
            let [name, expected] = cameras.topic(topic);
            self.complain(&mistyped(name, expected, &others.join(" and ")));
        }
        let passed = self.period.elapsed();
        if passed < PERIOD {
            return;
        }
        let count = arrivals.count();
        let frames = std::mem::take(&mut self.frames);
        if !self.quiet {
            console::say(&line(cameras, &frames, &self.before, &count, passed));
        }
        self.published += frames.delays.len();
        self.failed += frames.failed;
        self.told.clear();
        (self.before, self.period) = (count, Instant::now());
    }

    /// Prints the totals.
    pub(super) fn end(&self, arrivals: &Arrivals) {
        if self.quiet {
            return;
        }
        let (count, published) = (arrivals.count(), self.published + self.frames.delays.len());
        let mut said = vec![format!(
            "{published} frame{} in {:.0} s",
            plural(published),
            self.start.elapsed().as_secs_f64()
        )];
        said.extend(left_out(&Count::default(), &count, self.failed + self.frames.failed));
        console::say(&said.join("; "));
    }
}

/// The warning about a topic whose messages have an unexpected type.
fn mistyped(name: &str, expected: &str, found: &str) -> String {
    let remedy = if [expected, found] == [Image::NAME, CompressedImage::NAME] {
        ", or one whose name ends with /compressed"
    } else {
        ""
    };
    format!(
        "{name} is published with {found}, and {expected} is expected: remap to a topic of that type{remedy}"
    )
}

/// The status line of a period.
fn line(cameras: &CameraTopics, frames: &Frames, before: &Count, count: &Count, passed: Duration) -> String {
    let published = frames.delays.len();
    let came = |side: usize| count.images[side] - before.images[side];
    let mut said = Vec::new();
    if published > 0 {
        let (median, most) = spread(&frames.delays);
        said.push(format!(
            "{published} frame{} in {:.1} s, {median:.0} ms each from arrival to publication, {most:.0} at most",
            plural(published),
            passed.as_secs_f64()
        ));
        if !frames.ages.is_empty() {
            let (median, most) = spread(&frames.ages);
            said.push(format!("{median:.0} ms from the stamp, {most:.0} at most"));
        }
    } else if frames.unheard > 0 {
        said.push(format!("no subscribers; {} pairs are not matched", frames.unheard));
    } else if frames.waiting > 0 {
        said.push(format!("{} pairs without the calibration of both cameras", frames.waiting));
    } else if frames.failed == 0 {
        let (left, right) = (cameras.image(0), cameras.image(1));
        said.push(format!(
            "no pair in {:.0} s: {} images on {left}, {} on {right}",
            passed.as_secs_f64(),
            came(0),
            came(1)
        ));
    }
    said.extend(left_out(before, count, frames.failed));
    said.join("; ")
}

/// Texts about skipped images and pairs between two counts.
fn left_out(before: &Count, count: &Count, failed: usize) -> Vec<String> {
    let since = |of: fn(&Count) -> usize| of(count) - of(before);
    let mut said = Vec::new();
    let mut add = |number: usize, what: &str| {
        if number > 0 {
            said.push(format!("{number} {what}"));
        }
    };
    add(since(|count| count.replaced), "skipped for newer ones");
    add(failed, "failed");
    add(since(|count| count.tally.alone[0]), "left images without a partner");
    add(since(|count| count.tally.alone[1]), "right images without a partner");
    add(since(|count| count.tally.repeated), "repeated images");
    add(since(|count| count.tally.late), "late images");
    add(since(|count| count.unreadable), "malformed messages");
    said
}

/// The median and the maximum.
fn spread(times: &[f64]) -> (f64, f64) {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    (sorted[sorted.len() / 2], sorted[sorted.len() - 1])
}
