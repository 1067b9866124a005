//! Votes on what was filled: see [`Stage::VoteFill`](crate::backend::Stage::VoteFill).
//!
//! The sums of a band of half-size rows are there at a time, with those of the rows around it that its columns reach.

use super::rows::{Binding, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder, Step};
use super::uniform::uniform;
use crate::error::Result;
use crate::options::Nearer;
use crate::plan::Plan;
use crate::plan::votes::{
    HIDING_LABELS, VOTE_AWAY, VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_OUTVOTES,
    VOTE_REACH, VOTE_SHIFT, VOTE_SURE, Votes,
};
use crate::weights::COLOUR_DIFFERENCES;
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/vote_fill.wgsl");

uniform! {
    half_width: u32,
    half_height: u32,
    half_pitch: u32,
    sum_pitch: u32,
    labels: u32,
    smaller_is_nearer: u32,
    first_summed: u32,
    first_voted: u32,
}

/// `show`, `halve`, `own_votes`, `sum_rows`, `sum_columns`, `elect` and `take`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let job = |entry, loops| {
        let kernel = Kernel::new("vote_fill", entry, SHADER)
            .with("VOTE_MOST", VOTE_MOST)
            .with("VOTE_BITS", VOTE_BITS)
            .with("VOTE_HIDING", VOTE_HIDING)
            .with("HIDING_LABELS", HIDING_LABELS)
            .with("VOTE_SURE", VOTE_SURE)
            .with("VOTE_OUTVOTES", VOTE_OUTVOTES)
            .with("VOTE_FRACTION_BITS", VOTE_FRACTION_BITS)
            .with("VOTE_SHIFT", VOTE_SHIFT)
            .with("VOTE_REACH", VOTE_REACH as u32)
            .with("VOTE_AWAY", VOTE_AWAY)
            .with("COLOUR_DIFFERENCES", COLOUR_DIFFERENCES as u32);
        Job::new::<Uniform>(kernel, loops)
    };
    let votes = Votes::of(plan);
    vec![
        job("show", 0),
        job("halve", 6 + 42),
        job("own_votes", 6),
        job("sum_rows", 2 * votes.width),
        job("sum_columns", 2 * VOTE_REACH),
        job("elect", votes.labels),
        job("take", 12),
    ]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l, votes) = (r.buffers, r.params(), Votes::of(r.plan));
    let Some(v) = &b.votes else { return Ok(()) };
    let [show, halve, own_votes, sum_rows, sum_columns, elect, take] = &jobs(r.plan, 0)[..] else {
        unreachable!("seven kernels")
    };
    let own = Uniform {
        half_width: votes.width as u32,
        half_height: votes.height as u32,
        half_pitch: v.half_pitch,
        sum_pitch: v.sum_pitch,
        labels: votes.labels as u32,
        smaller_is_nearer: (r.plan.method.refinement.nearer == Nearer::Smaller).into(),
        ..Uniform::default()
    };
    let shown = &b.spare_flags;
    r.steps.extend(shown.held().map(|(buffer, bytes)| Step::Clear(buffer.clone(), bytes)));
    r.rows(show, &own, l.width, |rows| {
        vec![(2, b.flags.bind(rows)), (3, b.optima.bind(rows)), (5, shown.bind(rows))]
    })?;
    // Rows of pixels of these rows of half-size ones, and so many more around them.
    let pixels = |rows: &Range<u32>, more: u32| {
        with_halo(&(2 * rows.start..(2 * rows.end).min(l.height)), more, l.height)
    };
    let half_rows = |step: u32| {
        let starts = (0..votes.height as u32).step_by(step as usize);
        starts.map(move |start| start..(start + step).min(votes.height as u32))
    };
    for rows in half_rows(v.band) {
        let around = pixels(&rows, 2);
        let size = (own.half_width, rows.end - rows.start);
        let bindings = [(1, b.left.bind(&around)), (2, b.flags.bind(&around)), (6, v.colours.bind(&rows))];
        r.dispatch(halve, &own, rows, size, &bindings)?;
    }
    for rows in half_rows(v.band) {
        let summed = with_halo(&rows, VOTE_REACH as u32, own.half_height);
        let own = Uniform { first_summed: summed.start, ..own };
        let cells = own.half_width * own.labels;
        // They begin at the first row of the buffers.
        let sums = (7, v.sums.bind(&(0..summed.end - summed.start)));
        let totals = (8, v.totals.bind(&(0..rows.end - rows.start)));
        let (seen, colours) = (pixels(&summed, 0), (6, v.colours.bind(&summed)));
        let weights = (10, Binding::whole(&v.weights));
        let height = summed.end - summed.start;
        let bindings =
            [(2, b.flags.bind(&seen)), (4, b.disparity.bind(&seen)), (5, shown.bind(&seen)), sums.clone()];
        r.dispatch(own_votes, &own, summed.clone(), (cells, height), &bindings)?;
        let bindings = [colours.clone(), sums.clone(), weights.clone()];
        r.dispatch(sum_rows, &own, summed, (own.labels, height), &bindings)?;
        let height = rows.end - rows.start;
        let bindings = [colours, sums, totals.clone(), weights];
        r.dispatch(sum_columns, &own, rows.clone(), (cells, height), &bindings)?;
        let bindings = [(6, v.colours.bind(&rows)), totals, (9, v.elected.bind(&rows))];
        r.dispatch(elect, &own, rows, (own.half_width, height), &bindings)?;
    }
    let bind = |rows: &Range<u32>| {
        let voted = with_halo(&(rows.start / 2..rows.end.div_ceil(2)), 1, own.half_height);
        let bindings = vec![
            (1, b.left.bind(rows)),
            (2, b.flags.bind(rows)),
            (4, b.disparity.bind(rows)),
            (6, v.colours.bind(&voted)),
            (9, v.elected.bind(&voted)),
        ];
        (bindings, voted.start)
    };
    for rows in r.map_bands(|rows| bind(rows).0)? {
        let (bindings, first_voted) = bind(&rows);
        let size = (l.width, rows.end - rows.start);
        r.dispatch(take, &Uniform { first_voted, ..own }, rows, size, &bindings)?;
    }
    Ok(())
}
