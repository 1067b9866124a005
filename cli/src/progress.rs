//! The bars that show how far a match is, how far a batch, and how far a sequence.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use mrfgs::Progress;

use crate::console;
use crate::stop;

/// What is over sooner than this needs no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: u64 = 1000;
/// How often a batch tells a log how far it is.
const SILENCE: Duration = Duration::from_secs(30);

/// A bar on a terminal, from [`PATIENCE`] on.
pub(crate) struct Bar {
    start: Instant,
    wanted: bool,
    name: String,
    drawn: Option<ProgressBar>,
}

impl Bar {
    pub(crate) fn new(name: Option<&str>, quiet: bool) -> Self {
        let wanted = !quiet && std::io::stderr().is_terminal();
        Self { start: Instant::now(), wanted, name: name.unwrap_or("mrfgs").into(), drawn: None }
    }

    /// Shows how far it is, and says whether to go on.
    pub(crate) fn update(&mut self, progress: Progress) -> ControlFlow<()> {
        if self.wanted && self.start.elapsed() > PATIENCE {
            let bar = self.drawn.get_or_insert_with(|| {
                let style = ProgressStyle::with_template("{prefix} [{bar:40}] {percent:>3} % {msg}");
                ProgressBar::new(STEPS)
                    .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
                    .with_prefix(self.name.clone())
            });
            bar.set_message(match progress.tile {
                Some((tile, all)) => format!("tile {tile} of {all}: {}", progress.stage),
                None => progress.stage.into(),
            });
            bar.set_position((progress.done * STEPS as f64) as u64);
        }
        stop::go_on()
    }

    /// Takes the bar away.
    pub(crate) fn finish(self) {
        if let Some(bar) = self.drawn {
            bar.finish_and_clear();
        }
    }
}

/// The pairs done of all those of a batch: a bar on a terminal, elsewhere a line now and then.
pub(crate) struct PairBar {
    drawn: Option<ProgressBar>,
    log: Option<Log>,
}

impl PairBar {
    /// For so many pairs, of which some are done.
    pub(crate) fn new(pairs: usize, done: usize, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = || {
            let style = ProgressStyle::with_template("mrfgs [{bar:40}] {pos} of {len} {msg}");
            let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(pairs as u64).with_style(style);
            bar.set_position(done as u64);
            bar
        };
        Self {
            drawn: (terminal && !quiet).then(bar),
            log: (!terminal && !quiet).then(|| Log { pairs, done, last: Instant::now() }),
        }
    }

    /// Shows the pair at work.
    pub(crate) fn begin(&mut self, name: &str) {
        if let Some(bar) = &self.drawn {
            bar.set_message(name.to_owned());
        }
        if let Some(line) = self.log.as_mut().and_then(|log| log.line(name, Instant::now())) {
            console::say(&line);
        }
    }

    /// Counts a pair that is done or has failed.
    pub(crate) fn end(&mut self) {
        if let Some(bar) = &self.drawn {
            bar.inc(1);
        }
        if let Some(log) = &mut self.log {
            log.done += 1;
        }
    }

    /// Lets `say` write to standard error past the bar.
    pub(crate) fn past(&self, say: impl FnOnce()) {
        match &self.drawn {
            Some(bar) => bar.suspend(say),
            None => say(),
        }
    }
}

impl Drop for PairBar {
    fn drop(&mut self) {
        if let Some(bar) = &self.drawn {
            bar.finish_and_clear();
        }
    }
}

/// The frames done of a sequence: a line on a terminal that is drawn anew, elsewhere one now and then.
pub(crate) struct FrameBar {
    start: Instant,
    frames: usize,
    all: Option<usize>,
    drawn: Option<ProgressBar>,
    /// When a log was last told; `None` where nothing is to be.
    told: Option<Instant>,
}

impl FrameBar {
    /// For `all` frames, where their number is known.
    pub(crate) fn new(all: Option<usize>, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let start = Instant::now();
        let drawn = (terminal && !quiet).then(|| {
            let style = ProgressStyle::with_template("mrfgs {spinner} {msg}");
            ProgressBar::new_spinner().with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
        });
        Self { start, frames: 0, all, drawn, told: (!terminal && !quiet).then_some(start) }
    }

    /// Counts a frame that is done.
    pub(crate) fn end(&mut self) {
        self.frames += 1;
        if let Some(bar) = &self.drawn {
            bar.set_message(self.line());
            bar.tick();
        }
        let now = Instant::now();
        if self.told.is_some_and(|told| now.duration_since(told) >= SILENCE) {
            console::say(&self.line());
            self.told = Some(now);
        }
    }

    fn line(&self) -> String {
        let rate = self.frames as f64 / self.start.elapsed().as_secs_f64();
        let of = self.all.map(|all| format!(" of {all}")).unwrap_or_default();
        format!("{}{of} frames, {rate:.1} a second", self.frames)
    }
}

impl Drop for FrameBar {
    fn drop(&mut self) {
        if let Some(bar) = &self.drawn {
            bar.finish_and_clear();
        }
    }
}

/// How far a batch is, for logs.
struct Log {
    pairs: usize,
    done: usize,
    /// When it last was told.
    last: Instant,
}

impl Log {
    /// What to tell before the pair `name`, if it is time.
    fn line(&mut self, name: &str, now: Instant) -> Option<String> {
        (now.duration_since(self.last) >= SILENCE).then(|| {
            self.last = now;
            format!("{} of {} pairs, now {name}", self.done, self.pairs)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_tells_now_and_then() {
        let start = Instant::now();
        let mut log = Log { pairs: 9, done: 2, last: start };
        assert_eq!(log.line("a", start + SILENCE / 2), None);
        assert_eq!(log.line("b", start + SILENCE), Some("2 of 9 pairs, now b".into()));
        assert_eq!(log.line("c", start + SILENCE + SILENCE / 2), None);
        log.done = 5;
        assert_eq!(log.line("d", start + 2 * SILENCE), Some("5 of 9 pairs, now d".into()));
    }
}
