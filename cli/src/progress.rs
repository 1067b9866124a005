//! Progress bars of a match, a batch and a sequence. A terminal shows them after [`PATIENCE`] or the first item; a log gets a line from
//! time to time.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use mrfgs::Progress;

use crate::console;
use crate::stop;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: u64 = 1000;
/// Interval between lines in a log.
const SILENCE: Duration = Duration::from_secs(30);

/// A bar of `length` steps, or a spinner if the length is unknown. It disappears when dropped.
fn bar(length: Option<usize>, template: &str, quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(length.map(|length| length as u64), target);
    bar.with_style(style).with_finish(ProgressFinish::AndClear)
}

/// The progress of a match.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    pub(crate) fn new(name: Option<&str>, quiet: bool) -> Self {
        let bar = bar(Some(STEPS as usize), "{prefix} [{bar:40}] {percent:>3} % {msg}", quiet);
        Self(bar.with_prefix(name.unwrap_or("mrfgs").to_owned()))
    }

    /// Updates the bar, and tells the matcher whether to go on.
    pub(crate) fn update(&mut self, progress: Progress) -> ControlFlow<()> {
        if self.0.elapsed() > PATIENCE {
            self.0.set_message(match progress.tile {
                Some((tile, all)) => format!("tile {tile} of {all}: {}", progress.stage),
                None => progress.stage.into(),
            });
            self.0.set_position((progress.done * STEPS as f64) as u64);
        }
        stop::go_on()
    }
}

/// The number of finished pairs of a batch or frames of a sequence.
pub(crate) struct Counter {
    bar: ProgressBar,
    log: Log,
    /// What is counted, in the plural.
    what: &'static str,
}

impl Counter {
    /// A counter of `pairs`, of which `done` are already finished.
    pub(crate) fn of_pairs(pairs: usize, done: usize, quiet: bool) -> Self {
        Self::of("pairs", pairs, done, quiet)
    }

    /// A counter of `blocks`, of which `done` are already complete.
    pub(crate) fn of_blocks(blocks: usize, done: usize, quiet: bool) -> Self {
        Self::of("blocks", blocks, done, quiet)
    }

    fn of(what: &'static str, all: usize, done: usize, quiet: bool) -> Self {
        let bar = bar(Some(all), "mrfgs [{bar:40}] {pos} of {len} {msg}", quiet);
        bar.set_position(done as u64);
        Self { bar, log: Log::new(quiet), what }
    }

    /// A counter of frames; `all` is their number, if known.
    pub(crate) fn of_frames(all: Option<usize>, quiet: bool) -> Self {
        Self { bar: bar(all, "mrfgs {spinner} {msg}", quiet), log: Log::new(quiet), what: "frames" }
    }

    /// Shows the pair or block being matched.
    pub(crate) fn begin(&mut self, name: &str) {
        self.bar.set_message(name.to_owned());
        self.log.tell(|| line(&self.bar, self.what, name));
    }

    /// Counts a pair or block as finished or failed.
    pub(crate) fn end(&self) {
        self.bar.inc(1);
    }

    /// Counts a frame as finished.
    pub(crate) fn end_frame(&mut self) {
        self.bar.inc(1);
        let frames = self.bar.position();
        let rate = frames as f64 / self.bar.elapsed().as_secs_f64();
        let of = self.bar.length().map(|all| format!(" of {all}")).unwrap_or_default();
        let line = format!("{frames}{of} frames, {rate:.1} per second");
        self.bar.set_message(line.clone());
        self.log.tell(|| line);
    }

    /// Runs `say`, which prints to standard error, with the bar hidden.
    pub(crate) fn past(&self, say: impl FnOnce()) {
        self.bar.suspend(say);
    }
}

/// The line for a log.
fn line(bar: &ProgressBar, what: &str, name: &str) -> String {
    format!("{} of {} {what}, now {name}", bar.position(), bar.length().unwrap_or_default())
}

/// The time of the last line in the log; `None` without a log.
struct Log(Option<Instant>);

impl Log {
    fn new(quiet: bool) -> Self {
        Self((!quiet && !std::io::stderr().is_terminal()).then(Instant::now))
    }

    fn tell(&mut self, line: impl FnOnce() -> String) {
        if self.is_due(Instant::now()) {
            console::say(&line());
        }
    }

    fn is_due(&mut self, now: Instant) -> bool {
        let due = self.0.is_some_and(|last| now.duration_since(last) >= SILENCE);
        if due {
            self.0 = Some(now);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_tells_now_and_then() {
        let start = Instant::now();
        let mut log = Log(Some(start));
        assert!(!log.is_due(start + SILENCE / 2));
        assert!(log.is_due(start + SILENCE));
        assert!(!log.is_due(start + SILENCE + SILENCE / 2));
        assert!(log.is_due(start + 2 * SILENCE));
        assert!(!Log(None).is_due(start + 2 * SILENCE));
        let pairs = Counter::of_pairs(9, 2, true);
        assert_eq!(line(&pairs.bar, pairs.what, "b"), "2 of 9 pairs, now b");
        (0..3).for_each(|_| pairs.end());
        assert_eq!(line(&pairs.bar, pairs.what, "d"), "5 of 9 pairs, now d");
    }
}
