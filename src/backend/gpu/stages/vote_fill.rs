//! Fills by votes: see [`Stage::VoteFill`](crate::backend::Stage::VoteFill).
//!
//! Sums exist for one band of half-size rows at a time, and for the rows around it in reach of its columns.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::with_halo;
use crate::error::Result;
use crate::options::Nearer;
use crate::plan::votes::{
    HIDING_LABELS, VOTE_AWAY, VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_OUTVOTES,
    VOTE_REACH, VOTE_SHIFT, VOTE_SURE, Votes, are_taken,
};
use crate::stage::{Data, Extent};
use crate::weights::COLOUR_DIFFERENCES;

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
    show { flags, optima, shown } => variant(0);
    halve { left around 2, flags around 2, half_colours, shown } => variant(6 + 42).over(Extent::Half);
    own_votes { flags, disparity, shown, sums } => variant(6).over(Extent::Half);
    sum_rows { half_colours, sums, vote_weights } => variant(2 * Votes::of(plan).width).over(Extent::Half);
    sum_columns { half_colours around VOTE_REACH, sums around VOTE_REACH, totals, vote_weights } => {
        variant(2 * VOTE_REACH).over(Extent::Half)
    };
    elect { half_colours, totals, elected } => variant(Votes::of(plan).labels).over(Extent::Half);
    take { left, flags, disparity, half_colours around 1, elected around 1 } => variant(12);
}

fn variant(loops: usize) -> Variant {
    Variant::new(loops)
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
    if !are_taken(&r.plan.method) {
        return Ok(());
    }
    let (l, plan, votes) = (r.params(), r.plan, Votes::of(r.plan));
    let pitch = |data: Data| data.array(plan).words as u32;
    let own = Uniform {
        half_width: votes.width as u32,
        half_height: votes.height as u32,
        half_pitch: pitch(Data::HalfColours),
        sum_pitch: pitch(Data::Sums),
        labels: votes.labels as u32,
        smaller_is_nearer: (plan.method.refinement.nearer == Nearer::Smaller).into(),
        ..Uniform::default()
    };
    let reach = VOTE_REACH as u32;
    let [halved, counted, summed] =
        [halve(plan, 0).any(), own_votes(plan, 0).any(), sum_columns(plan, 0).any()];
    let bands = r.bands_of(&[(&halved, 0), (&counted, reach), (&summed, 0)], votes.band)?;
    for rows in bands.iter().cloned() {
        let size = (own.half_width, rows.end - rows.start);
        r.dispatch(&halve(plan, 0), &own, rows, size)?;
    }
    r.rows(&show(plan, 0), &own, l.width)?;
    for rows in bands {
        let summed = with_halo(&rows, reach, own.half_height);
        let own = Uniform { first_summed: summed.start, ..own };
        let (cells, height) = (own.half_width * own.labels, summed.end - summed.start);
        r.dispatch(&own_votes(plan, 0), &own, summed.clone(), (cells, height))?;
        r.dispatch(&sum_rows(plan, 0), &own, summed, (own.labels, height))?;
        let height = rows.end - rows.start;
        r.dispatch(&sum_columns(plan, 0), &own, rows.clone(), (cells, height))?;
        r.dispatch(&elect(plan, 0), &own, rows, (own.half_width, height))?;
    }
    for rows in r.bands_of(&[(&take(plan, 0).any(), 0)], usize::MAX)? {
        let first_voted = Extent::Half.rows_of(plan, &rows, Extent::Level(0), 1).start;
        let (own, size) = (Uniform { first_voted, ..own }, (l.width, rows.end - rows.start));
        r.dispatch(&take(plan, 0), &own, rows, size)?;
    }
    Ok(())
}
