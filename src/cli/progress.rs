//! The bars that show how far a match is, and how far a batch.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use mrfgs::solver::Progress;

use super::stop;

/// What is over sooner than this needs no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: u64 = 1000;

/// A bar on a terminal, from [`PATIENCE`] on.
pub(super) struct Bar {
    start: Instant,
    wanted: bool,
    name: String,
    drawn: Option<ProgressBar>,
}

impl Bar {
    pub(super) fn new(name: Option<&str>, quiet: bool) -> Self {
        let wanted = !quiet && std::io::stderr().is_terminal();
        Self { start: Instant::now(), wanted, name: name.unwrap_or("mrfgs").into(), drawn: None }
    }

    /// Shows how far it is, and says whether to go on.
    pub(super) fn update(&mut self, progress: Progress) -> ControlFlow<()> {
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
    pub(super) fn finish(self) {
        if let Some(bar) = self.drawn {
            bar.finish_and_clear();
        }
    }
}

/// The pairs done of all those of a batch, on a terminal.
pub(super) struct PairBar(ProgressBar);

impl PairBar {
    /// A bar for so many pairs, of which some are done.
    pub(super) fn new(pairs: usize, done: usize, quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let style = ProgressStyle::with_template("mrfgs [{bar:40}] {pos} of {len} {msg}");
        let bar =
            ProgressBar::new(pairs as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_position(done as u64);
        Self(bar)
    }

    /// Shows the pair at work.
    pub(super) fn begin(&self, name: &str) {
        self.0.set_message(name.to_owned());
    }

    /// Counts a pair that is done or has failed.
    pub(super) fn end(&self) {
        self.0.inc(1);
    }

    /// Lets `say` write to standard error past the bar.
    pub(super) fn past(&self, say: impl FnOnce()) {
        self.0.suspend(say);
    }
}

impl Drop for PairBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
