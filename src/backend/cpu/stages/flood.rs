//! Dependency messages and beliefs in one sweep: see [`crate::backend::Stage::Flood`].
//!
//! A belief is summed as soon as the last factor that contains its pixel, three rows below, has sent its
//! messages. By then no factor needs the old belief, and the messages are still in the cache. Every thread
//! sweeps a band of rows; beliefs within three rows of a border between bands wait until all bands are done.

use super::belief::{self, Summands};
use super::dependency::{self, Around, Factors, REACH, Scratch};
use crate::backend::Stage;
use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::threads::prelude::*;
use std::array::from_fn;
use std::ops::Range;

/// Bands per thread, so that one slow thread does not delay all others.
const BANDS: usize = 4;
/// Smallest number of rows of a band.
const LEAST_ROWS: usize = 4 * REACH;

/// A band of rows, with the beliefs that no other band accesses.
struct Band<'a, U> {
    /// Rows of its factors, and rows of its own beliefs.
    rows: Range<usize>,
    rows_own: Range<usize>,
    messages: &'a mut [U],
    own: &'a mut [U],
}

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let sent = v.begin(Stage::Flood(level));
    let plan = &v.plan;
    let (summands, [messages, belief]) = Summands::of(plan, &mut v.levels, level, sent);
    let summands = &summands;
    let l = &plan.levels[level];
    let (height, windows) = (l.height, summands.windows);
    let slots = summands.graph.slots();
    let threads = current_num_threads();
    let most = (BANDS * threads).min(height / LEAST_ROWS).max(1);
    // The same number of bands for each thread.
    let count = if most > threads { most / threads * threads } else { most };
    let starts: Vec<usize> = (0..=count).map(|i| i * height / count).collect();
    let cells = |rows: Range<usize>| rows.map(|y| windows.length(y)).sum::<usize>();

    // Beliefs alternate: those of one band alone, those around the border to the next band, and so on.
    let (mut own, mut edges) = (Vec::new(), Vec::new());
    let mut rest = &mut *belief;
    let mut row = 0;
    for &start in &starts[1..count] {
        let (alone, after) = rest.split_at_mut(cells(row..start - REACH));
        let (edge, after) = after.split_at_mut(cells(start - REACH..start + REACH));
        own.push(alone);
        edges.push(edge);
        (rest, row) = (after, start + REACH);
    }
    own.push(rest);

    let shared: Vec<&[U]> = edges.iter().map(|edge| &**edge).collect();
    let mut messages_left = &mut *messages;
    let mut bands: Vec<Band<U>> = Vec::new();
    for (i, own) in own.into_iter().enumerate() {
        let rows = starts[i]..starts[i + 1];
        let (here, after) = messages_left.split_at_mut(cells(rows.clone()) * slots);
        messages_left = after;
        let first_own = if i == 0 { 0 } else { rows.start + REACH };
        let end_own = if i + 1 == count { height } else { rows.end - REACH };
        bands.push(Band { rows, rows_own: first_own..end_own, messages: here, own });
    }
    let (cut, step) = (plan.dependency, plan.label_step(level));
    let factors = Factors { graph: summands.graph, windows, cut, step };
    bands.into_par_iter().enumerate().for_each(|(i, mut band)| {
        let above = if i == 0 { &[][..] } else { shared[i - 1] };
        let below = shared.get(i).copied().unwrap_or_default();
        band.sweep(&factors, summands, Scratch::new(l.stride, slots), [above, below], !sent.dependency);
    });

    let messages = &*messages;
    edges.into_par_iter().zip(&starts[1..count]).for_each(|(edge, &start)| {
        for y in start - REACH..start + REACH {
            let first = windows.start(start - REACH);
            let belief = &mut edge[windows.start(y) - first..][..windows.length(y)];
            belief::row(summands, y, 0, Some(messages), belief);
        }
    });
}

impl<U: Units> Band<'_, U> {
    /// Sweeps the band; `edges` are the beliefs around its borders. If `initial`, the old messages count as
    /// 0, whatever is stored, and need not be loaded from memory.
    fn sweep(
        &mut self,
        factors: &Factors,
        summands: &Summands<U>,
        mut scratch: Scratch<U>,
        edges: [&[U]; 2],
        initial: bool,
    ) {
        let (windows, slots) = (factors.windows, factors.graph.slots());
        let (rows, rows_own) = (self.rows.clone(), self.rows_own.clone());
        for y in rows.start..rows.end + REACH {
            if y < rows.end {
                let around: Around<U> = from_fn(|k| {
                    let Some(ny) = (y + k).checked_sub(REACH).filter(|&ny| ny < windows.height()) else {
                        return &[][..];
                    };
                    let (beliefs, first) = if ny < rows_own.start {
                        (edges[0], rows_own.start - 2 * REACH)
                    } else if ny < rows_own.end {
                        (&*self.own, rows_own.start)
                    } else {
                        (edges[1], rows_own.end)
                    };
                    let start = windows.start(first);
                    &beliefs[windows.start(ny) - start..][..windows.length(ny)]
                });
                let here = windows.start(y) - windows.start(rows.start);
                let length = windows.length(y);
                let messages = &mut self.messages[slots * here..][..slots * length];
                if initial {
                    messages.fill(U::default());
                }
                dependency::row(factors, y, &around, messages, &mut scratch);
            }
            // All factors of this row's pixels have sent their messages.
            if let Some(done) = y.checked_sub(REACH).filter(|done| rows_own.contains(done)) {
                let start = windows.start(rows_own.start);
                let belief = &mut self.own[windows.start(done) - start..][..windows.length(done)];
                belief::row(summands, done, windows.start(rows.start), Some(&*self.messages), belief);
            }
        }
    }
}
