//! Beliefs: see [`crate::backend::Stage::Belief`].

use super::units::{Blocks, Units, block, block_mut, each_lane, padding};
use super::volumes::{Level, Volumes};
use crate::graph::LevelGraph;
use crate::plan::Plan;
use rayon::prelude::*;

/// The terms of the beliefs of a level.
pub(super) struct Summands<'a, U> {
    pub(super) graph: &'a LevelGraph,
    evidence: &'a [u8],
    /// Empty where the coarser level has sent no messages yet.
    down: &'a [U],
    /// Empty where the finer level has sent no messages yet.
    up: &'a [U],
    stride: usize,
    most: U,
    padding: Vec<U>,
}

impl<'a, U: Units> Summands<'a, U> {
    /// The terms of level `z`, with its dependency messages, its beliefs, and whether its factors have sent
    /// their messages.
    pub(super) fn of(
        plan: &Plan,
        levels: &'a mut [Level<U>],
        z: usize,
    ) -> (Self, [&'a mut [U]; 2], &'a mut bool) {
        let above = levels.get(z + 1).is_some_and(|above| above.resolution_sent);
        let l = &plan.levels[z];
        let Level { graph, evidence, dependency, dependency_sent, resolution_sent, down, up, belief, .. } =
            &mut levels[z];
        let summands = Self {
            graph,
            evidence,
            // A volume without messages is left out of the sum.
            down: if above { down } else { &[] },
            up: if *resolution_sent { up } else { &[] },
            stride: l.stride,
            most: U::of(plan.belief_most().into()),
            padding: padding(l.labels, l.stride),
        };
        (summands, [dependency, belief], dependency_sent)
    }
}

/// The beliefs of row `y`, from the dependency messages of the factors from row `first` on. `None` means that
/// the factors have not sent any yet.
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

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (summands, [dependency, belief], sent) = Summands::of(&v.plan, &mut v.levels, level);
    let dependency = sent.then_some(&*dependency);
    let cells = summands.graph.width() * summands.stride;
    belief.par_chunks_mut(cells).enumerate().for_each(|(y, belief)| row(&summands, y, 0, dependency, belief));
}

/// A pixel's belief, and its terms.
struct Sum<'a, U> {
    evidence: &'a [u8],
    down: Option<&'a [U]>,
    up: Option<&'a [U]>,
    dependency: &'a [U],
    /// The slot that `dependency` starts at; it is subtracted from the entries of `incoming`.
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
        let evidence = block::<u8, N>(self.evidence, at);
        let mut sum: [U; N] = each_lane(|i| U::from(evidence[i]));
        for message in [self.down, self.up].into_iter().flatten() {
            sum = plus(sum, block(message, at));
        }
        for &entry in self.incoming {
            sum = plus(sum, block(self.dependency, (entry as usize - self.base) * stride + at));
        }
        let padding = block::<U, N>(self.padding, at);
        *block_mut(self.belief, at) = each_lane::<U, N>(|i| sum[i].min(self.most).max(padding[i]));
    }
}

#[inline(always)]
fn plus<U: Units, const N: usize>(sum: [U; N], message: &[U; N]) -> [U; N] {
    each_lane(|i| sum[i].plus(message[i]))
}
