//! Messages of the dependency factors and beliefs in one sweep: see [`crate::backend::Stage::Flood`].
//!
//! A belief is summed as soon as the last factor that contains its pixel has sent its messages, three rows
//! below. By then no factor needs the old belief any more, and the messages are still in the cache. Every
//! thread sweeps a band of rows. Beliefs within three rows of the border between two bands wait until all
//! bands are done.

use super::belief::{self, Summands};
use super::dependency::{self, Around, REACH, Scratch};
use super::units::Units;
use super::volumes::Volumes;
use crate::plan::Plan;
use rayon::prelude::*;
use std::array::from_fn;
use std::mem;

/// Bands per thread, so that one slow thread does not delay all others.
const BANDS: usize = 4;
/// Smallest number of rows of a band.
const LEAST_ROWS: usize = 8 * REACH;

/// A band of rows, with the beliefs that no other band changes.
struct Band<'a, U> {
    /// First row of its factors; `first_own` is the first row of its own beliefs.
    first: usize,
    first_own: usize,
    messages: &'a mut [U],
    own: &'a mut [U],
}

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let plan = &v.plan;
    let (summands, [messages, belief], sent) = Summands::of(plan, &mut v.levels, level);
    let summands = &summands;
    // The first messages count as 0, whatever is stored.
    let initial = !mem::replace(sent, true);
    let l = &plan.levels[level];
    let (cells, height) = (l.width * l.stride, l.height);
    let slots = summands.graph.slots();
    let count = (BANDS * rayon::current_num_threads()).min(height / LEAST_ROWS).max(1);
    let starts: Vec<usize> = (0..=count).map(|i| i * height / count).collect();

    // The beliefs alternate: those of one band alone, then those around the border to the next band, and so
    // on.
    let (mut own, mut edges) = (Vec::new(), Vec::new());
    let mut rest = &mut *belief;
    let mut row = 0;
    for &start in &starts[1..count] {
        let (alone, after) = rest.split_at_mut((start - REACH - row) * cells);
        let (edge, after) = after.split_at_mut(2 * REACH * cells);
        own.push(alone);
        edges.push(edge);
        (rest, row) = (after, start + REACH);
    }
    own.push(rest);

    let shared: Vec<&[U]> = edges.iter().map(|edge| &**edge).collect();
    let mut factors = &mut *messages;
    let mut bands: Vec<Band<U>> = Vec::new();
    for (i, own) in own.into_iter().enumerate() {
        let (here, after) = factors.split_at_mut((starts[i + 1] - starts[i]) * cells * slots);
        factors = after;
        let first_own = if i == 0 { 0 } else { starts[i] + REACH };
        bands.push(Band { first: starts[i], first_own, messages: here, own });
    }
    bands.into_par_iter().enumerate().for_each(|(i, mut band)| {
        let above = if i == 0 { &[][..] } else { shared[i - 1] };
        let below = shared.get(i).copied().unwrap_or_default();
        band.sweep(plan, level, summands, [above, below], initial);
    });

    let messages = &*messages;
    edges.into_par_iter().zip(&starts[1..count]).for_each(|(edge, &start)| {
        for (i, belief) in edge.chunks_exact_mut(cells).enumerate() {
            belief::row(summands, start - REACH + i, 0, Some(messages), belief);
        }
    });
}

impl<U: Units> Band<'_, U> {
    /// Sweeps the band; `edges` are the beliefs around its borders. If the messages are `initial`, the old
    /// ones are 0 whatever is stored, and nothing has to be loaded from memory for them.
    fn sweep(&mut self, plan: &Plan, level: usize, summands: &Summands<U>, edges: [&[U]; 2], initial: bool) {
        let l = &plan.levels[level];
        let (cells, slots) = (l.width * l.stride, summands.graph.slots());
        let mut scratch = Scratch::new(l.stride, slots);
        let rows = self.messages.len() / (cells * slots);
        let end_own = self.first_own + self.own.len() / cells;
        for y in self.first..self.first + rows + REACH {
            if y < self.first + rows {
                let around: Around<U> = from_fn(|k| match (y + k).checked_sub(REACH) {
                    None => &[][..],
                    Some(ny) if ny < self.first_own => {
                        &edges[0][(ny + 2 * REACH - self.first_own) * cells..][..cells]
                    }
                    Some(ny) if ny < end_own => &self.own[(ny - self.first_own) * cells..][..cells],
                    Some(ny) => edges[1]
                        .get((ny - end_own) * cells..)
                        .map_or(&[][..], |rows| rows.get(..cells).unwrap_or_default()),
                });
                let messages = &mut self.messages[(y - self.first) * cells * slots..][..cells * slots];
                if initial {
                    messages.fill(U::default());
                }
                dependency::row(plan, level, summands.graph, y, &around, messages, &mut scratch);
            }
            // All factors of this row's pixels have sent their messages.
            if let Some(done) = y.checked_sub(REACH).filter(|done| (self.first_own..end_own).contains(done)) {
                let belief = &mut self.own[(done - self.first_own) * cells..][..cells];
                belief::row(summands, done, self.first, Some(&*self.messages), belief);
            }
        }
    }
}
