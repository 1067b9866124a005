//! Messages of the dependency factors: see [`crate::backend::Stage::Dependency`].
//!
//! A factor reads old beliefs and its own old messages and writes only its own messages, so flooding in place
//! is exact. Padding labels go through the same arithmetic as real labels. Their belief is the largest value,
//! and no real label exceeds [`Plan::belief_most`], so a minimum never comes from padding alone.

use super::units::{Blocks, Least, Truncating, Units, block, block_mut, each_lane, keep_least, smallest};
use super::volumes::{Level, Volumes};
use crate::graph::{LevelGraph, NO_MEMBER, offset};
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan, Truncation, TruncationRule};
use rayon::prelude::*;
use std::array::from_fn;
use std::mem;

/// Working memory of a thread.
pub(super) struct Scratch<U> {
    /// q of each member, \[member\]\[label\]; `after` has the sum of q over the members after it.
    q: Vec<U>,
    after: Vec<U>,
    /// Sum of q over the members before.
    before: Vec<U>,
    /// Sums of q over the other members.
    sums: Vec<U>,
    /// For each member its slot, the row that holds its belief (relative to the factor's), and its start in
    /// that row.
    members: Vec<(usize, usize, usize)>,
}

impl<U: Units> Scratch<U> {
    pub(super) fn new(stride: usize, slots: usize) -> Self {
        Self {
            q: vec![U::default(); slots * stride],
            after: vec![U::default(); slots * stride],
            before: vec![U::default(); stride],
            sums: vec![U::default(); 3 * stride],
            members: Vec::with_capacity(slots),
        }
    }
}

/// Radius of a factor, in rows and columns.
pub(super) const REACH: usize = GRAPH_WINDOW / 2;

/// Beliefs of the rows around a factor, from [`REACH`] above to [`REACH`] below; empty outside the image.
pub(super) type Around<'a, U> = [&'a [U]; GRAPH_WINDOW];

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (plan, l) = (&v.plan, &v.plan.levels[level]);
    let Level { graph, belief, dependency: messages, dependency_sent, .. } = &mut v.levels[level];
    // The first messages count as 0, whatever is stored.
    let initial = !mem::replace(dependency_sent, true);
    let cells = l.width * l.stride;
    messages.par_chunks_mut(cells * graph.slots()).enumerate().for_each_init(
        || Scratch::new(l.stride, graph.slots()),
        |scratch, (y, messages)| {
            if initial {
                messages.fill(U::default());
            }
            let around: Around<U> = from_fn(|k| {
                let ny = (y + k).checked_sub(REACH).filter(|&ny| ny < l.height);
                ny.map_or(&[][..], |ny| &belief[ny * cells..][..cells])
            });
            row(plan, level, graph, y, &around, messages, scratch);
        },
    );
}

/// The messages of the factors of row `y`.
pub(super) fn row<U: Units>(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    y: usize,
    around: &Around<U>,
    messages: &mut [U],
    scratch: &mut Scratch<U>,
) {
    let (cut, stride, slots) = (plan.dependency, plan.levels[level].stride, graph.slots());
    // Row and offset within the row, for every code.
    let places: [(usize, isize); GRAPH_WINDOW * GRAPH_WINDOW] = from_fn(|code| {
        let (dx, dy) = offset(code as u8);
        (REACH.wrapping_add_signed(dy as isize), dx as isize * stride as isize)
    });
    touch(around[2 * REACH]);
    for (x, messages) in messages.chunks_exact_mut(slots * stride).enumerate() {
        let own = x * stride;
        let place = |code: u8| {
            let (row, way) = places[usize::from(code)];
            (row, own.wrapping_add_signed(way))
        };
        let belief = |(row, start): (usize, usize)| &around[row][start..][..stride];
        match *graph.neighbours_of(x, y) {
            [a, b] if b != NO_MEMBER && a != NO_MEMBER && cut.rule == TruncationRule::Relative => {
                let beliefs = [belief((REACH, own)), belief(place(a)), belief(place(b))];
                three(cut, beliefs, messages, &mut scratch.sums);
            }
            ref codes => {
                let members = &mut scratch.members;
                members.clear();
                members.push((0, REACH, own));
                let slots = (1..).zip(codes).filter(|(_, code)| **code != NO_MEMBER);
                members.extend(slots.map(|(slot, &code)| {
                    let (row, start) = place(code);
                    (slot, row, start)
                }));
                if members.len() > 1 {
                    any(cut, stride, around, messages, scratch);
                }
            }
        }
    }
}

/// Brings a row into the cache in sequential order, which the prefetcher predicts. It cannot predict the
/// order in which factors access the row.
fn touch<U: Units>(row: &[U]) {
    const CACHE_LINE: usize = 64;
    let step = CACHE_LINE / size_of::<U>();
    std::hint::black_box(row.iter().step_by(step).fold(U::default(), |most, &v| most.max(v)));
}

/// A factor of three members. Each sum has two terms.
struct Three<'a, U> {
    beliefs: [&'a [U]; 3],
    messages: &'a [U],
    sums: &'a mut [U],
    least: [Least<U>; 3],
}

impl<U: Units> Blocks for Three<'_, U> {
    #[inline(always)]
    fn block<const N: usize>(&mut self, at: usize) {
        let q: [[U; N]; 3] = [self.q(0, at), self.q(1, at), self.q(2, at)];
        self.sum(0, at, &q[1], &q[2]);
        self.sum(1, at, &q[0], &q[2]);
        self.sum(2, at, &q[0], &q[1]);
    }
}

impl<U: Units> Three<'_, U> {
    #[inline(always)]
    fn q<const N: usize>(&self, slot: usize, at: usize) -> [U; N] {
        let b = block::<U, N>(self.beliefs[slot], at);
        let m = block::<U, N>(self.messages, slot * self.beliefs[0].len() + at);
        each_lane(|i| b[i].less(m[i]))
    }

    /// The sum for the member in `slot`: the q of the other two.
    #[inline(always)]
    fn sum<const N: usize>(&mut self, slot: usize, at: usize, a: &[U; N], b: &[U; N]) {
        let sums: [U; N] = each_lane(|i| a[i].plus(b[i]));
        keep_least(&mut self.least[slot], &sums);
        *block_mut(self.sums, slot * self.beliefs[0].len() + at) = sums;
    }
}

/// The messages of a factor of three.
#[inline(always)]
fn three<U: Units>(cut: Truncation, beliefs: [&[U]; 3], messages: &mut [U], sums: &mut [U]) {
    let stride = beliefs[0].len();
    let mut factor = Three { beliefs, messages: &*messages, sums, least: [[U::MOST; LABEL_BLOCK]; 3] };
    factor.all(stride);
    let (least, tau) = (factor.least, U::of(cut.tau.into()));
    for ((out, sums), least) in messages.chunks_exact_mut(stride).zip(sums.chunks_exact(stride)).zip(least) {
        let least = least_in_all(least);
        RelativeCutting { sums, least, high: each_lane(|i| least[i].plus(tau)), out }.all(stride);
    }
}

/// The smallest of all lanes, in each of them. This keeps the bounds of a message in vectors. When they
/// passed through single bytes, a factor waited longer than it computed.
#[inline(always)]
fn least_in_all<U: Units>(lanes: Least<U>) -> Least<U> {
    least_of_pairs::<U, 1>(least_of_pairs::<U, 2>(least_of_pairs::<U, 4>(least_of_pairs::<U, 8>(lanes))))
}

/// The smaller of each lane and the one `APART` from it. (A constant, so that it becomes a shuffle.)
#[inline(always)]
fn least_of_pairs<U: Units, const APART: usize>(lanes: Least<U>) -> Least<U> {
    each_lane(|i| lanes[i].min(lanes[i ^ APART]))
}

/// [`Truncating`] by [`TruncationRule::Relative`], with bounds in vectors.
struct RelativeCutting<'a, U> {
    sums: &'a [U],
    least: Least<U>,
    high: Least<U>,
    out: &'a mut [U],
}

impl<U: Units> Blocks for RelativeCutting<'_, U> {
    #[inline(always)]
    fn block<const N: usize>(&mut self, at: usize) {
        let out = block_mut::<U, N>(self.out, at).as_chunks_mut().0;
        for (out, sums) in out.iter_mut().zip(block::<U, N>(self.sums, at).as_chunks().0) {
            let (out, sums): (&mut Least<U>, &Least<U>) = (out, sums);
            *out = each_lane(|i| sums[i].min(self.high[i]).less(self.least[i]));
        }
    }
}

/// The messages of a factor of any number of members.
fn any<U: Units>(
    cut: Truncation,
    stride: usize,
    around: &Around<U>,
    messages: &mut [U],
    scratch: &mut Scratch<U>,
) {
    let Scratch { q, after, before, sums, members } = scratch;
    for (q, &(slot, row, start)) in q.chunks_exact_mut(stride).zip(members.iter()) {
        let b = &around[row][start..][..stride];
        let f = &messages[slot * stride..][..stride];
        for ((q, &b), &f) in q.iter_mut().zip(b).zip(f) {
            *q = b.less(f);
        }
        if cut.rule == TruncationRule::Absolute {
            let least = smallest(q);
            for q in q.iter_mut() {
                *q = q.less(least);
            }
        }
    }
    // Saturated sums cannot be undone by subtraction, so the sums of the members before and after are added
    // instead.
    let last = (members.len() - 1) * stride;
    after[last..][..stride].fill(U::default());
    for at in (0..last).step_by(stride).rev() {
        let (here, next) = after[at..].split_at_mut(stride);
        here.copy_from_slice(&next[..stride]);
        add(here, &q[at + stride..][..stride]);
    }
    let sum = &mut sums[..stride];
    before.fill(U::default());
    for (i, &(slot, ..)) in members.iter().enumerate() {
        sum.copy_from_slice(&after[i * stride..][..stride]);
        add(sum, before);
        add(before, &q[i * stride..][..stride]);
        Truncating::new(sum, smallest(sum), cut, &mut messages[slot * stride..][..stride]).all(stride);
    }
}

fn add<U: Units>(sum: &mut [U], q: &[U]) {
    for (sum, &q) in sum.iter_mut().zip(q) {
        *sum = sum.plus(q);
    }
}
