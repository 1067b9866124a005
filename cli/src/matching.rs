//! Running a match, with a progress bar and a summary line.

use std::sync::Arc;
use std::time::{Duration, Instant};

use mrfgs::image::{Pair, Rect};
use mrfgs::low_level::engine::Inspector;
use mrfgs::options::{DisparityRange, Method};
use mrfgs::prior::{PriorKind, PriorUse};
use mrfgs::{AutoRange, Job, Matched, Matcher, Prior, check};

use crate::console;
use crate::failure::Result;
use crate::outputs::Found;
use crate::progress::Bar;
use crate::remedy;
use crate::text::plural;

/// The disparities that a match searches, in which region, and those that are known before.
#[derive(Clone, Copy)]
pub(crate) struct SearchSpace<'a> {
    range: DisparityRange,
    /// Whether a full range is widened (see [`check::wider`]).
    pub(crate) may_widen: bool,
    /// The region of the left view; `None` for all of it.
    region: Option<&'a Rect>,
    /// Known disparities of the left view.
    prior: Option<&'a Arc<Prior>>,
}

impl From<DisparityRange> for SearchSpace<'_> {
    fn from(range: DisparityRange) -> Self {
        Self { range, may_widen: false, region: None, prior: None }
    }
}

impl<'a> SearchSpace<'a> {
    /// Searches `range`. If sparse matches gave it and the wider one `fits` the outputs, it may be widened.
    pub(crate) fn new(
        range: DisparityRange,
        by_matches: bool,
        fits: impl Fn(DisparityRange) -> bool,
    ) -> Self {
        let may_widen = by_matches && check::beyond(range).is_some_and(fits);
        Self { may_widen, ..range.into() }
    }

    /// Restricts the search to `region`, if given.
    pub(crate) fn in_region(self, region: Option<&'a Rect>) -> Self {
        Self { region, ..self }
    }

    /// Adds known disparities, if there are any.
    pub(crate) fn with_prior(self, prior: Option<&'a Arc<Prior>>) -> Self {
        Self { prior, ..self }
    }

    /// A match of `pair` over this search space.
    pub(crate) fn job<'b>(self, matcher: &'b mut Matcher, pair: &'b Pair) -> Job<'b> {
        let job = if self.may_widen {
            matcher.job(pair, AutoRange(self.range))
        } else {
            matcher.job(pair, self.range)
        };
        let job = match self.prior {
            Some(prior) => job.prior(Arc::clone(prior)),
            None => job,
        };
        match self.region {
            Some(region) => job.region(region.clone()),
            None => job,
        }
    }
}

/// Matches a pair with a progress bar, unless the user [stops](crate::stop) it, and prints device and time to standard error. `name`
/// identifies the pair if there are several.
pub(crate) fn run(
    matcher: &mut Matcher,
    pair: &Pair,
    searched: SearchSpace,
    method: &Method,
    name: Option<&str>,
    quiet: bool,
    inspector: Option<Inspector>,
) -> Result<(Matched, Duration)> {
    let start = Instant::now();
    let mut bar = Bar::new(name, quiet);
    let mut job = searched.job(matcher, pair).method(method).on_progress(|progress| bar.update(progress));
    if let Some(inspector) = inspector {
        job = job.inspect(inspector);
    }
    let matched = job.run();
    drop(bar);
    let (matched, time) = (matched?, start.elapsed());
    if !quiet {
        if let Some(note) = &matched.note {
            console::say(&remedy::error(note, &remedy::FLAGS));
        }
        let name = name.map(|name| format!("{name}: ")).unwrap_or_default();
        say_summary(&name, matched.maps.disparity.size(), &Found::of(&matched), time);
    }
    Ok((matched, time))
}

/// Prints what a match of maps of this size has found; `name` is empty, or ends in `: `.
pub(crate) fn say_summary(name: &str, (width, height): (usize, usize), found: &Found, time: Duration) {
    let (labels, iterations) = (found.range.labels(), found.iterations);
    let tiles = match (found.blocks, found.tiles) {
        (1, 1) => String::new(),
        (1, count) => format!(", {count} tiles"),
        (count, _) => format!(", {count} blocks"),
    };
    console::say(&format!(
        "{name}{width} x {height}, {labels} disparit{}{tiles}, {iterations} iteration{} in {:.2} s on {}",
        if labels == 1 { "y" } else { "ies" },
        plural(iterations as usize),
        time.as_secs_f64(),
        found.ran_on
    ));
    let corrected = found.conditioning.to_string();
    if !corrected.is_empty() {
        console::say(&format!("{name}{corrected}"));
    }
    if let Some(used) = found.prior {
        say_prior(name, used);
    }
}

/// Prints how much of a prior was used.
fn say_prior(name: &str, used: PriorUse) {
    let PriorUse { kind, given, dropped, .. } = used;
    let text = match kind {
        PriorKind::Points => format!("{given} point{} of the prior, {dropped} dropped", plural(given)),
        PriorKind::Surface => format!("a prior for {given} pixel{}", plural(given)),
    };
    console::say(&format!("{name}{text}"));
}
