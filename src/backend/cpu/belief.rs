//! Beliefs: see [`crate::backend::Stage::Belief`].

use super::units::{Blocks, Units, block, block_mut, padding};
use crate::graph::LevelGraph;
use crate::plan::Plan;
use rayon::prelude::*;
use std::array::from_fn;

/// What the beliefs of a level are the sums of.
pub(super) struct Summands<'a, U> {
    pub(super) graph: &'a LevelGraph,
    evidence: &'a [u8],
    /// Empty at the coarsest level.
    down: &'a [U],
    /// Empty at level 0.
    up: &'a [U],
    stride: usize,
    most: U,
    padding: Vec<U>,
}

impl<'a, U: Units> Summands<'a, U> {
    pub(super) fn new(
        plan: &Plan,
        level: usize,
        graph: &'a LevelGraph,
        evidence: &'a [u8],
        [down, up]: [&'a [U]; 2],
    ) -> Self {
        let l = &plan.levels[level];
        let (most, padding) = (U::of(plan.belief_most().into()), padding(l.labels, l.stride));
        Self { graph, evidence, down, up, stride: l.stride, most, padding }
    }
}

/// The beliefs of row `y`, from the dependency messages of the factors from row `first` on; none has spoken yet where there
/// are no messages.
pub(super) fn row<U: Units>(
    summands: &Summands<U>,
    y: usize,
    first: usize,
    dependency: Option<&[U]>,
    belief: &mut [U],
) {
    let Summands { graph, evidence, down, up, stride, most, padding } = summands;
    let width = graph.width();
    let base = first * width * graph.slots();
    for (x, belief) in belief.chunks_exact_mut(*stride).enumerate() {
        let pixel = y * width + x;
        let start = pixel * stride;
        let mut sum = Sum {
            evidence: &evidence[start..][..*stride],
            down: down.get(start..start + stride),
            up: up.get(start..start + stride),
            dependency: dependency.unwrap_or_default(),
            base,
            incoming: if dependency.is_some() { graph.incoming_of(pixel) } else { &[] },
            most: *most,
            padding,
            belief,
        };
        sum.all(*stride);
    }
}

pub(super) fn run<U: Units>(summands: &Summands<U>, dependency: Option<&[U]>, belief: &mut [U]) {
    let cells = summands.graph.width() * summands.stride;
    belief.par_chunks_mut(cells).enumerate().for_each(|(y, belief)| row(summands, y, 0, dependency, belief));
}

/// A pixel's belief, and what it is the sum of.
struct Sum<'a, U> {
    evidence: &'a [u8],
    down: Option<&'a [U]>,
    up: Option<&'a [U]>,
    dependency: &'a [U],
    /// What the entries of `incoming` count from.
    base: usize,
    incoming: &'a [u32],
    most: U,
    padding: &'a [U],
    belief: &'a mut [U],
}

impl<U: Units> Blocks for Sum<'_, U> {
    const LONG: bool = true;

    #[inline(always)]
    fn block<const N: usize>(&mut self, at: usize) {
        let stride = self.evidence.len();
        let mut sum = block::<u8, N>(self.evidence, at).map(U::from);
        for message in [self.down, self.up].into_iter().flatten() {
            sum = plus(sum, block(message, at));
        }
        for &entry in self.incoming {
            sum = plus(sum, block(self.dependency, (entry as usize - self.base) * stride + at));
        }
        let padding = block::<U, N>(self.padding, at);
        *block_mut(self.belief, at) = from_fn::<U, N, _>(|i| sum[i].min(self.most).max(padding[i]));
    }
}

#[inline(always)]
fn plus<U: Units, const N: usize>(sum: [U; N], message: &[U; N]) -> [U; N] {
    from_fn(|i| sum[i].plus(message[i]))
}
