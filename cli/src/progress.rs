//! The bars that show how far a match is, how far a batch, and how far a sequence. On a terminal they are drawn from [`PATIENCE`]
//! or the first item on, elsewhere they hide themselves, and what takes long tells a log now and then.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use mrfgs::Progress;

use crate::console;
use crate::stop;

/// What is over sooner than this needs no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: u64 = 1000;
/// How often a log is told.
const SILENCE: Duration = Duration::from_secs(30);

/// A bar of `length` steps where it is known, else a spinner. It goes when it is dropped.
fn bar(length: Option<usize>, template: &str, quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(length.map(|length| length as u64), target);
    bar.with_style(style).with_finish(ProgressFinish::AndClear)
}

/// How far a match is.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    pub(crate) fn new(name: Option<&str>, quiet: bool) -> Self {
        let bar = bar(Some(STEPS as usize), "{prefix} [{bar:40}] {percent:>3} % {msg}", quiet);
        Self(bar.with_prefix(name.unwrap_or("mrfgs").to_owned()))
    }

    /// Shows how far it is, and says whether to go on.
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

/// How many pairs of a batch or frames of a sequence are done.
pub(crate) struct Counter {
    bar: ProgressBar,
    log: Log,
}

impl Counter {
    /// For so many pairs, of which some are done.
    pub(crate) fn of_pairs(pairs: usize, done: usize, quiet: bool) -> Self {
        let bar = bar(Some(pairs), "mrfgs [{bar:40}] {pos} of {len} {msg}", quiet);
        bar.set_position(done as u64);
        Self { bar, log: Log::new(quiet) }
    }

    /// For `all` frames, where their number is known.
    pub(crate) fn of_frames(all: Option<usize>, quiet: bool) -> Self {
        Self { bar: bar(all, "mrfgs {spinner} {msg}", quiet), log: Log::new(quiet) }
    }

    /// Shows the pair at work.
    pub(crate) fn begin_pair(&mut self, name: &str) {
        self.bar.set_message(name.to_owned());
        self.log.tell(|| line(&self.bar, name));
    }

    /// Counts a pair that is done or has failed.
    pub(crate) fn end_pair(&self) {
        self.bar.inc(1);
    }

    /// Counts a frame that is done.
    pub(crate) fn end_frame(&mut self) {
        self.bar.inc(1);
        let frames = self.bar.position();
        let rate = frames as f64 / self.bar.elapsed().as_secs_f64();
        let of = self.bar.length().map(|all| format!(" of {all}")).unwrap_or_default();
        let line = format!("{frames}{of} frames, {rate:.1} a second");
        self.bar.set_message(line.clone());
        self.log.tell(|| line);
    }

    /// Lets `say` write to standard error past the bar.
    pub(crate) fn past(&self, say: impl FnOnce()) {
        self.bar.suspend(say);
    }
}

/// How far a batch is, for a log.
fn line(bar: &ProgressBar, name: &str) -> String {
    format!("{} of {} pairs, now {name}", bar.position(), bar.length().unwrap_or_default())
}

/// When a log was last told; `None` where nothing is to be.
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
        assert_eq!(line(&pairs.bar, "b"), "2 of 9 pairs, now b");
        (0..3).for_each(|_| pairs.end_pair());
        assert_eq!(line(&pairs.bar, "d"), "5 of 9 pairs, now d");
    }
}
