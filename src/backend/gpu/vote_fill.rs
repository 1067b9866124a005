//! Votes on what was filled: see [`Stage::VoteFill`](crate::backend::Stage::VoteFill).
//!
//! The sums of a band of half-size rows are there at a time, with those of the rows around it that its columns reach.

use super::commands::{Command, Recorder};
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{Binding, with_halo};
use crate::error::Result;
use crate::options::Nearer;
use crate::plan::votes::{
    HIDING_LABELS, VOTE_AWAY, VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_OUTVOTES,
    VOTE_REACH, VOTE_SHIFT, VOTE_SURE, Votes,
};
use crate::weights::COLOUR_DIFFERENCES;
use std::ops::Range;

shader! {
    "vote_fill"(plan, level) {
        half_width: u32,
        half_height: u32,
        half_pitch: u32,
        sum_pitch: u32,
        labels: u32,
        smaller_is_nearer: u32,
        first_summed: u32,
        first_voted: u32,
    }
    show: Show { flags, optima, shown } => kernel(0);
    halve: Halve { left, flags, colours } => kernel(6 + 42);
    own_votes: OwnVotes { flags, disparity, shown, sums } => kernel(6);
    sum_rows: SumRows { colours, sums, weights } => kernel(2 * Votes::of(plan).width);
    sum_columns: SumColumns { colours, sums, totals, weights } => kernel(2 * VOTE_REACH);
    elect: Elect { colours, totals, votes } => kernel(Votes::of(plan).labels);
    take: Take { left, flags, disparity, colours, votes } => kernel(12);
}

fn kernel<B: Bindings>(loops: usize) -> Kernel<B> {
    Kernel::new(loops)
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
        .with("COLOUR_DIFFERENCES", COLOUR_DIFFERENCES as u32)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l, plan, votes) = (r.buffers, r.params(), r.plan, Votes::of(r.plan));
    let Some(v) = &b.votes else { return Ok(()) };
    let own = Uniform {
        half_width: votes.width as u32,
        half_height: votes.height as u32,
        half_pitch: v.half_pitch,
        sum_pitch: v.sum_pitch,
        labels: votes.labels as u32,
        smaller_is_nearer: (plan.method.refinement.nearer == Nearer::Smaller).into(),
        ..Uniform::default()
    };
    let shown = &b.spare_flags;
    r.commands.extend(shown.held().map(|(buffer, bytes)| Command::Clear(buffer.clone(), bytes)));
    r.rows(&show(plan, 0), &own, l.width, |rows| Show {
        flags: b.flags.bind(rows),
        optima: b.optima.bind(rows),
        shown: shown.bind(rows),
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
        let bindings = Halve {
            left: b.left.bind(&around),
            flags: b.flags.bind(&around),
            colours: v.colours.bind(&rows),
        };
        r.dispatch(&halve(plan, 0), &own, rows, size, bindings)?;
    }
    for rows in half_rows(v.band) {
        let summed = with_halo(&rows, VOTE_REACH as u32, own.half_height);
        let own = Uniform { first_summed: summed.start, ..own };
        let cells = own.half_width * own.labels;
        // They begin at the first row of the buffers.
        let sums = v.sums.bind(&(0..summed.end - summed.start));
        let totals = v.totals.bind(&(0..rows.end - rows.start));
        let (seen, colours) = (pixels(&summed, 0), v.colours.bind(&summed));
        let weights = Binding::whole(&v.weights);
        let height = summed.end - summed.start;
        let bindings = OwnVotes {
            flags: b.flags.bind(&seen),
            disparity: b.disparity.bind(&seen),
            shown: shown.bind(&seen),
            sums: sums.clone(),
        };
        r.dispatch(&own_votes(plan, 0), &own, summed.clone(), (cells, height), bindings)?;
        let bindings = SumRows { colours: colours.clone(), sums: sums.clone(), weights: weights.clone() };
        r.dispatch(&sum_rows(plan, 0), &own, summed, (own.labels, height), bindings)?;
        let height = rows.end - rows.start;
        let bindings = SumColumns { colours, sums, totals: totals.clone(), weights };
        r.dispatch(&sum_columns(plan, 0), &own, rows.clone(), (cells, height), bindings)?;
        let bindings = Elect { colours: v.colours.bind(&rows), totals, votes: v.elected.bind(&rows) };
        r.dispatch(&elect(plan, 0), &own, rows, (own.half_width, height), bindings)?;
    }
    let voted = |rows: &Range<u32>| with_halo(&(rows.start / 2..rows.end.div_ceil(2)), 1, own.half_height);
    let bind = |rows: &Range<u32>| Take {
        left: b.left.bind(rows),
        flags: b.flags.bind(rows),
        disparity: b.disparity.bind(rows),
        colours: v.colours.bind(&voted(rows)),
        votes: v.elected.bind(&voted(rows)),
    };
    for rows in r.map_bands(&|rows| bind(rows).all())? {
        let own = Uniform { first_voted: voted(&rows).start, ..own };
        let (size, bindings) = ((l.width, rows.end - rows.start), bind(&rows));
        r.dispatch(&take(plan, 0), &own, rows, size, bindings)?;
    }
    Ok(())
}
