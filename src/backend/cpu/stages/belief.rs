//! Beliefs: see [`crate::backend::Stage::Belief`].

use super::dependency::{REACH, touch};
use crate::backend::cpu::units::{Blocks, Units, block, block_mut, each_lane, padding};
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::{AlignedCells, Window, Windows};
use crate::graph::{Incoming, LevelGraph};
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan};
use crate::program::Sent;
use crate::threads::prelude::*;
use std::ops::Range;

/// The terms of the beliefs of a level.
pub(super) struct Summands<'a, U> {
    pub(super) graph: &'a LevelGraph,
    pub(super) windows: &'a Windows,
    evidence: &'a [u8],
    /// Empty if the coarser level has sent no messages yet.
    down: &'a [U],
    /// Empty if the finer level has sent no messages yet.
    up: &'a [U],
    most: U,
    /// The message of a dependency factor at labels that its own pixel does not have.
    tau: U,
    padding: Vec<U>,
}

impl<'a, U: Units> Summands<'a, U> {
    /// The terms of level `z`, its dependency messages, and its beliefs.
    pub(super) fn of(
        plan: &Plan,
        levels: &'a mut [Level<U>],
        z: usize,
        sent: Sent,
    ) -> (Self, [&'a mut [U]; 2]) {
        let l = &plan.levels[z];
        let Level { graph, windows, evidence, dependency, down, up, belief, .. } = &mut levels[z];
        let summands = Self {
            graph,
            windows,
            evidence,
            // Volumes without messages are left out of the sum.
            down: if sent.above { down } else { &[] },
            up: if sent.below { up } else { &[] },
            most: U::of(plan.belief_most().into()),
            tau: U::of(plan.dependency.tau.into()),
            padding: padding(l.labels, l.stride),
        };
        (summands, [dependency, belief])
    }
}

/// The beliefs of row `y`; `dependency` has messages from cell `first` on, or is `None` if none were sent.
#[pulp::with_simd(row = crate::vectors::widest())]
#[inline(always)]
pub(super) fn row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    summands: &'a Summands<'a, U>,
    y: usize,
    first: usize,
    dependency: Option<&'a [U]>,
    belief: &'a mut [U],
) {
    let Summands { graph, windows, evidence, down, up, .. } = summands;
    let (width, row) = (graph.width(), windows.start(y));
    let near = windows.around(y);
    let mut starts = windows.starts_around(y, first);
    for start in &mut starts {
        *start *= graph.slots();
    }
    if let Some(dependency) = dependency {
        // The lowest row with factors that hold pixels of this row; the rows above are already cached.
        let lowest = (y + REACH).min(windows.height() - 1);
        let start = windows.start(lowest) - first;
        touch(&dependency[graph.slots() * start..][..graph.slots() * windows.length(lowest)]);
    }
    // Start indices of the messages of the factors that hold a pixel.
    let mut messages = [0; GRAPH_WINDOW * GRAPH_WINDOW];
    for (x, &window) in windows.row(y).iter().enumerate() {
        let own = window.cells();
        let cells = row + own.start..row + own.end;
        let incoming = if dependency.is_some() { graph.incoming_of(y * width + x) } else { &[] };
        let mut same = true;
        for (start, entry) in messages.iter_mut().zip(incoming) {
            let (dx, dy, slot) = entry.parts();
            let row = REACH.wrapping_add_signed(dy);
            let factor = near[row][x.wrapping_add_signed(dx)];
            *start = starts[row] + graph.slots() * factor.start() + slot * factor.stride();
            same &= factor.matches(window);
        }
        let mut sum = Sum {
            summands,
            window,
            evidence: &evidence[cells.clone()],
            down: down.get(cells.clone()),
            up: up.get(cells),
            dependency: dependency.unwrap_or_default(),
            messages: &messages[..incoming.len()],
            belief: &mut belief[own],
        };
        if same {
            sum.all(window.stride());
        } else {
            let window_of = |entry: Incoming| {
                let (dx, dy, _) = entry.parts();
                near[REACH.wrapping_add_signed(dy)][x.wrapping_add_signed(dx)]
            };
            for at in (0..window.stride()).step_by(LABEL_BLOCK) {
                sum.block_in_window(at, incoming.iter().map(|&entry| window_of(entry)));
            }
        }
    }
}

/// The beliefs of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, level: usize, sent: Sent, rows: Range<usize>) {
    let (summands, [dependency, belief]) = Summands::of(&v.plan, &mut v.levels, level, sent);
    let dependency = sent.dependency.then_some(&*dependency);
    let beliefs = summands.windows.rows_mut(belief, 1, 1, rows.clone()).into_par_iter();
    beliefs.zip(rows).for_each(|(belief, y)| row(&summands, y, 0, dependency, belief));
}

/// The belief of a pixel, and its terms.
struct Sum<'a, U> {
    summands: &'a Summands<'a, U>,
    window: Window,
    evidence: &'a [u8],
    down: Option<&'a [U]>,
    up: Option<&'a [U]>,
    dependency: &'a [U],
    /// Start indices in `dependency` of the messages of the factors that hold the pixel.
    messages: &'a [usize],
    belief: &'a mut [U],
}

impl<U: Units> Sum<'_, U> {
    #[inline(always)]
    fn own_terms<const N: usize>(&self, at: usize) -> [U; N] {
        let evidence = block::<u8, N>(self.evidence, at);
        let mut sum: [U; N] = each_lane(|i| U::from(evidence[i]));
        if let Some(message) = self.down {
            sum = plus(sum, block(message, at));
        }
        if let Some(message) = self.up {
            sum = plus(sum, block(message, at));
        }
        sum
    }

    #[inline(always)]
    fn store<const N: usize>(&mut self, at: usize, sum: [U; N]) {
        let Summands { most, padding, .. } = self.summands;
        let padding = block::<U, N>(padding, self.window.first() + at);
        *block_mut(self.belief, at) = each_lane::<U, N>(|i| sum[i].min(*most) | padding[i]);
    }

    /// The block of labels at `at`, from factors with other windows than the pixel's.
    #[inline(always)]
    fn block_in_window(&mut self, at: usize, factors: impl Iterator<Item = Window>) {
        let Summands { windows, tau, .. } = self.summands;
        let mut sum: [U; LABEL_BLOCK] = self.own_terms(at);
        for (window, &start) in factors.zip(self.messages) {
            let seen = AlignedCells::new(windows, window, self.dependency, start, self.window.first());
            let (m, outside) = seen.block(at);
            sum = plus(sum, &each_lane(|i| m[i] & !outside[i] | *tau & outside[i]));
        }
        self.store(at, sum);
    }
}

impl<U: Units> Blocks for Sum<'_, U> {
    const LONG: bool = true;

    #[inline(always)]
    fn block<const N: usize>(&mut self, at: usize) {
        let mut sum: [U; N] = self.own_terms(at);
        for &start in self.messages {
            sum = plus(sum, block(self.dependency, start + at));
        }
        self.store(at, sum);
    }
}

#[inline(always)]
fn plus<U: Units, const N: usize>(sum: [U; N], message: &[U; N]) -> [U; N] {
    each_lane(|i| sum[i].plus(message[i]))
}
