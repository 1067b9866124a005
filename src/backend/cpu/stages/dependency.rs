//! Messages of the dependency factors: see [`crate::backend::Stage::Dependency`].
//!
//! A factor reads old beliefs and its own old messages and writes only its own messages, so flooding in place
//! is exact. Messages are stored for the labels of the factor's own pixel only: at all others its belief is
//! infinite, and the message is tau.

use crate::backend::cpu::units::{
    Least, Units, block, block_mut, bounds, cut_block, each_lane, keep_least, smallest, truncate,
};
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::{AlignedCells, Window, Windows};
use crate::graph::{LevelGraph, NO_MEMBER, offset};
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Truncation, TruncationRule};
use crate::program::Sent;
use crate::threads::prelude::*;
use std::array::from_fn;
use std::ops::Range;

/// Working memory of a thread.
pub(super) struct Scratch<U> {
    /// q of each member, \[member\]\[label\]; `after` has the sums of q over later members.
    q: Vec<U>,
    after: Vec<U>,
    /// The largest value at labels that the member does not have, else 0.
    outside: Vec<U>,
    /// Sum of q over earlier members.
    before: Vec<U>,
    /// Sums of q over the other members, for each of three members, with one extra value at either end.
    sums: Vec<U>,
    /// The occupied slots.
    slots: Vec<usize>,
}

impl<U: Units> Scratch<U> {
    pub(super) fn new(stride: usize, slots: usize) -> Self {
        let rows = |n: usize| vec![U::default(); n * stride];
        Self {
            q: rows(slots),
            after: rows(slots),
            outside: rows(slots),
            before: rows(1),
            sums: vec![U::default(); 3 * (stride + 2)],
            slots: Vec::with_capacity(slots),
        }
    }
}

/// Radius of a factor, in rows and columns.
pub(super) const REACH: usize = GRAPH_WINDOW / 2;

/// Beliefs of the rows around a factor, from [`REACH`] above to [`REACH`] below; empty outside the image.
pub(super) type Around<'a, U> = [&'a [U]; GRAPH_WINDOW];

/// The factors of a level.
pub(super) struct Factors<'a> {
    pub(super) graph: &'a LevelGraph,
    pub(super) windows: &'a Windows,
    pub(super) cut: Truncation,
    /// See [`Plan::label_step`](crate::plan::Plan::label_step).
    pub(super) step: Option<u16>,
}

/// The messages of the factors of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, level: usize, sent: Sent, rows: Range<usize>) {
    let (plan, l) = (&v.plan, &v.plan.levels[level]);
    let Level { graph, windows, belief, dependency: messages, .. } = &mut v.levels[level];
    let factors = Factors { graph, windows, cut: plan.dependency, step: plan.label_step(level) };
    let messages = windows.rows_mut(messages, graph.slots(), 1, rows.clone());
    messages.into_par_iter().zip(rows).for_each_init(
        || Scratch::new(l.stride, graph.slots()),
        |scratch, (messages, y)| {
            // The first messages count as 0, whatever is stored.
            if !sent.dependency {
                messages.fill(U::default());
            }
            let around: Around<U> = from_fn(|k| {
                let ny = (y + k).checked_sub(REACH).filter(|&ny| ny < l.height);
                ny.map_or(&[][..], |ny| windows.row_of(belief, ny))
            });
            row(&factors, y, &around, messages, scratch);
        },
    );
}

/// The messages of the factors of row `y`.
#[pulp::with_simd(row = crate::vectors::widest())]
#[inline(always)]
pub(super) fn row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    factors: &'a Factors<'a>,
    y: usize,
    around: &'a Around<'a, U>,
    messages: &'a mut [U],
    scratch: &'a mut Scratch<U>,
) {
    let Factors { graph, windows, cut, step } = *factors;
    let slots = graph.slots();
    let near = Near { windows, rows: windows.around(y), around };
    let offsets: [(isize, usize); GRAPH_WINDOW * GRAPH_WINDOW] = from_fn(|code| {
        let (dx, dy) = offset(code as u8);
        (dx as isize, REACH.wrapping_add_signed(dy as isize))
    });
    touch(around[2 * REACH]);
    for (x, &window) in near.rows[REACH].iter().enumerate() {
        let messages = &mut messages[slots * window.start()..][..slots * window.stride()];
        let place = |code: u8| {
            let (dx, row) = offsets[usize::from(code)];
            (x.wrapping_add_signed(dx), row)
        };
        match *graph.neighbours_of(x, y) {
            [a, b] if b != NO_MEMBER && a != NO_MEMBER && cut.rule == TruncationRule::Relative => {
                let (a, b) = (near.window(place(a)), near.window(place(b)));
                // Listed one by one, because `map` would copy them through memory.
                let members = [
                    near.seen((window, around[REACH]), window.first()),
                    near.seen(a, window.first()),
                    near.seen(b, window.first()),
                ];
                let factor = Three { members, stride: window.stride() };
                if a.0.matches(window) && b.0.matches(window) {
                    factor.send::<true>(cut, step, messages, &mut scratch.sums);
                } else {
                    factor.send::<false>(cut, step, messages, &mut scratch.sums);
                }
            }
            ref codes => {
                let present = (1..).zip(codes).filter(|(_, code)| **code != NO_MEMBER);
                scratch.slots.clear();
                scratch.slots.push(0);
                scratch.slots.extend(present.map(|(slot, _)| slot));
                if scratch.slots.len() > 1 {
                    let member = |slot: usize| {
                        let place = if slot == 0 { (x, REACH) } else { place(codes[slot - 1]) };
                        near.seen(near.window(place), window.first())
                    };
                    any(cut, step, window.stride(), member, messages, scratch);
                }
            }
        }
    }
}

/// The neighbourhood of a row's pixels.
struct Near<'a, U> {
    windows: &'a Windows,
    rows: [&'a [Window]; GRAPH_WINDOW],
    around: &'a Around<'a, U>,
}

impl<'a, U: Units> Near<'a, U> {
    /// The window of the pixel in column `x` of a row, and the beliefs of the row.
    #[inline(always)]
    fn window(&self, (x, row): (usize, usize)) -> (Window, &'a [U]) {
        (self.rows[row][x], self.around[row])
    }

    /// The beliefs of a pixel, with labels counted from `first`.
    #[inline(always)]
    fn seen(&self, (window, beliefs): (Window, &'a [U]), first: usize) -> AlignedCells<'a, U> {
        AlignedCells::new(self.windows, window, beliefs, window.start(), first)
    }
}

/// Brings a row into the cache sequentially, which prefetchers predict, unlike the accesses of factors.
pub(super) fn touch<U: Units>(row: &[U]) {
    const CACHE_LINE: usize = 64;
    let step = CACHE_LINE / size_of::<U>();
    std::hint::black_box(row.iter().step_by(step).fold(U::default(), |most, &v| most.max(v)));
}

/// A block of labels.
type Block<U> = [U; LABEL_BLOCK];

/// A factor with three members, where each sum has two terms.
struct Three<'a, U> {
    members: [AlignedCells<'a, U>; 3],
    stride: usize,
}

impl<U: Units> Three<'_, U> {
    /// The sums for each member at the block of labels at `at`, and the sums made infinite at labels that the
    /// member does not have. `SAME` if all members have the same labels.
    #[inline(always)]
    fn sums<const SAME: bool>(&self, messages: &[U], at: usize) -> ([Block<U>; 3], [Block<U>; 3]) {
        let [(q0, out0), (q1, out1), (q2, out2)] = [
            self.q::<SAME>(messages, 0, at),
            self.q::<SAME>(messages, 1, at),
            self.q::<SAME>(messages, 2, at),
        ];
        let sums = [plus(&q1, &q2), plus(&q0, &q2), plus(&q0, &q1)];
        let own = [or(&sums[0], &out0), or(&sums[1], &out1), or(&sums[2], &out2)];
        (sums, own)
    }

    #[inline(always)]
    fn q<const SAME: bool>(&self, messages: &[U], slot: usize, at: usize) -> (Block<U>, Block<U>) {
        let member = &self.members[slot];
        let (b, outside) = if SAME { member.same_block(at) } else { member.block(at) };
        let m: &Block<U> = block(messages, slot * self.stride + at);
        (each_lane(|i| b[i].less(m[i]) | outside[i]), outside)
    }

    /// Writes the messages of the factor.
    #[inline(always)]
    fn send<const SAME: bool>(
        &self,
        cut: Truncation,
        step: Option<u16>,
        messages: &mut [U],
        scratch: &mut [U],
    ) {
        let stride = self.stride;
        if let Some(step) = step {
            self.send_near::<SAME>(cut, step, messages, scratch);
            return;
        }
        if stride == LABEL_BLOCK {
            let (sums, own) = self.sums::<SAME>(messages, 0);
            for slot in 0..3 {
                let (low, high) = bounds(own[slot], cut);
                *block_mut(messages, slot * stride) = cut_block(&sums[slot], &low, &high);
            }
            return;
        }
        let mut least = [[U::MOST; LABEL_BLOCK]; 3];
        for at in (0..stride).step_by(LABEL_BLOCK) {
            let (sums, own) = self.sums::<SAME>(messages, at);
            for slot in 0..3 {
                keep_least(&mut least[slot], &own[slot]);
                *block_mut(scratch, slot * stride + at) = sums[slot];
            }
        }
        for (slot, least) in least.into_iter().enumerate() {
            let (low, high) = bounds(least, cut);
            for at in (slot * stride..(slot + 1) * stride).step_by(LABEL_BLOCK) {
                *block_mut(messages, at) = cut_block(block(scratch, at), &low, &high);
            }
        }
    }

    /// Like `send`, with the cost `step` for labels that differ by one.
    #[inline(always)]
    fn send_near<const SAME: bool>(&self, cut: Truncation, step: u16, messages: &mut [U], scratch: &mut [U]) {
        let (stride, whole) = (self.stride, self.stride + 2);
        let mut least = [[U::MOST; LABEL_BLOCK]; 3];
        for at in (0..stride).step_by(LABEL_BLOCK) {
            let (_, own) = self.sums::<SAME>(messages, at);
            for slot in 0..3 {
                keep_least(&mut least[slot], &own[slot]);
                *block_mut(scratch, slot * whole + 1 + at) = own[slot];
            }
        }
        for (slot, least) in least.into_iter().enumerate() {
            let sums = &mut scratch[slot * whole..][..whole];
            (sums[0], sums[whole - 1]) = (U::MOST, U::MOST);
            truncate_near(sums, least, cut, step, &mut messages[slot * stride..][..stride]);
        }
    }
}

/// Truncates sums to a message, with the cost `step` for labels that differ by one. `sums` has the largest
/// value before and after the labels, and at labels that no pixel has.
#[inline(always)]
fn truncate_near<U: Units>(sums: &[U], least: Least<U>, cut: Truncation, step: u16, out: &mut [U]) {
    let (low, high) = bounds(least, cut);
    let step = U::of(step.into());
    for at in (0..out.len()).step_by(LABEL_BLOCK) {
        let (below, here, above): (&Block<U>, &Block<U>, &Block<U>) =
            (block(sums, at), block(sums, at + 1), block(sums, at + 2));
        let near = each_lane(|i| here[i].min(below[i].min(above[i]).plus(step)));
        *block_mut(out, at) = cut_block(&near, &low, &high);
    }
}

#[inline(always)]
fn plus<U: Units>(a: &Block<U>, b: &Block<U>) -> Block<U> {
    each_lane(|i| a[i].plus(b[i]))
}

#[inline(always)]
fn or<U: Units>(a: &Block<U>, b: &Block<U>) -> Block<U> {
    each_lane(|i| a[i] | b[i])
}

/// The messages of a factor with any number of members.
fn any<'a, U: Units>(
    cut: Truncation,
    step: Option<u16>,
    stride: usize,
    member: impl Fn(usize) -> AlignedCells<'a, U>,
    messages: &mut [U],
    scratch: &mut Scratch<U>,
) {
    let Scratch { q, after, outside, before, sums, slots } = scratch;
    for (i, &slot) in slots.iter().enumerate() {
        let seen = member(slot);
        let (q, outside) = (&mut q[i * stride..][..stride], &mut outside[i * stride..][..stride]);
        for at in (0..stride).step_by(LABEL_BLOCK) {
            let (b, out) = seen.block(at);
            let m: &Block<U> = block(messages, slot * stride + at);
            *block_mut(q, at) = each_lane::<U, LABEL_BLOCK>(|i| b[i].less(m[i]) | out[i]);
            *block_mut(outside, at) = out;
        }
        if cut.rule == TruncationRule::Absolute {
            let least = smallest(q);
            for (q, &outside) in q.iter_mut().zip(&*outside) {
                *q = q.less(least) | outside;
            }
        }
    }
    // Saturated sums cannot be undone by subtraction, so the sums of earlier and later members are added.
    let last = (slots.len() - 1) * stride;
    after[last..][..stride].fill(U::default());
    for at in (0..last).step_by(stride).rev() {
        let (here, next) = after[at..].split_at_mut(stride);
        here.copy_from_slice(&next[..stride]);
        add(here, &q[at + stride..][..stride]);
    }
    let sums = &mut sums[..stride + 2];
    (sums[0], sums[stride + 1]) = (U::MOST, U::MOST);
    before[..stride].fill(U::default());
    for (i, &slot) in slots.iter().enumerate() {
        let sum = &mut sums[1..=stride];
        sum.copy_from_slice(&after[i * stride..][..stride]);
        add(sum, before);
        add(before, &q[i * stride..][..stride]);
        let mut least = [U::MOST; LABEL_BLOCK];
        for at in (0..stride).step_by(LABEL_BLOCK) {
            let own = or(block(sum, at), block(outside, i * stride + at));
            keep_least(&mut least, &own);
            *block_mut(sum, at) = own;
        }
        let message = &mut messages[slot * stride..][..stride];
        match step {
            Some(step) => truncate_near(sums, least, cut, step, message),
            None => truncate(&sums[1..=stride], least, cut, message),
        }
    }
}

fn add<U: Units>(sum: &mut [U], q: &[U]) {
    for (sum, &q) in sum.iter_mut().zip(q) {
        *sum = sum.plus(q);
    }
}
