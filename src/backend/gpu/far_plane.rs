//! Planes from far away: see [`Stage::FarPlane`](crate::backend::Stage::FarPlane).

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{Binding, with_halo};
use crate::error::Result;
use crate::plan::patches::{
    PATCH, PATCH_APART, PATCH_AWAY, PATCH_DOUBT, PATCH_FAR_BITS, PATCH_LEAST, PATCH_MOMENT, PATCH_OUTVOTES,
    PATCH_REACH, PATCH_RESIDUAL, PATCH_RIDGE, PATCH_ROUNDS, PATCH_SHARE_BITS, PATCH_SPREAD, PATCH_STEEPEST,
    PATCH_STEP, PATCH_STEP_BITS, PATCH_WEIGHT_BITS, patches,
};
use crate::weights::PATCH_DIFFERENCES;
use std::ops::Range;

shader! {
    "far_plane"(plan, level) {
        across: u32,
        down: u32,
        pitch: u32,
        first_bound: u32,
        again: u32,
    }
    gather: Gather { left, flags, disparity, patches } => kernel(PATCH * PATCH + PATCH);
    carry_rows: CarryRows { patches, shares } => kernel(2 * patches(plan).0);
    rise: Rise { patches, shares } => kernel(patches(plan).1);
    sink: Sink { patches, shares } => kernel(patches(plan).1);
    take: Take { flags, disparity, patches } => kernel(0);
}

fn kernel<B: Bindings>(loops: usize) -> Kernel<B> {
    Kernel::new(loops)
        .with("PATCH", PATCH as u32)
        .with("FAR_BITS", PATCH_FAR_BITS)
        .with("WEIGHT_BITS", PATCH_WEIGHT_BITS)
        .with("SPREAD", PATCH_SPREAD)
        .with("STEP", PATCH_STEP)
        .with("STEP_BITS", PATCH_STEP_BITS)
        .with("AWAY", PATCH_AWAY)
        .with("REACH", PATCH_REACH)
        .with("APART", PATCH_APART)
        .with("MOMENT", PATCH_MOMENT)
        .with("RIDGE", PATCH_RIDGE)
        .with("STEEPEST", PATCH_STEEPEST)
        .with("LEAST", PATCH_LEAST)
        .with("RESIDUAL", PATCH_RESIDUAL)
        .with("SHARE_BITS", PATCH_SHARE_BITS)
        .with("DOUBT", PATCH_DOUBT)
        .with("OUTVOTES", PATCH_OUTVOTES)
        .with("LAST_SHARE", PATCH_DIFFERENCES as u32)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l, plan) = (r.buffers, r.params(), r.plan);
    let Some(p) = &b.patches else { return Ok(()) };
    let (across, down) = patches(plan);
    let (across, down, patch) = (across as u32, down as u32, PATCH as u32);
    let own = Uniform { across, down, pitch: p.pitch, ..Uniform::default() };
    let starts = (0..down).step_by(p.band as usize);
    let bands: Vec<_> = starts.map(|start| start..(start + p.band).min(down)).collect();
    for round in 0..PATCH_ROUNDS {
        let own = Uniform { again: (round > 0).into(), ..own };
        for rows in &bands {
            let own = Uniform { first_bound: rows.start, ..own };
            let pixels = patch * rows.start..(patch * rows.end).min(l.height);
            let height = rows.end - rows.start;
            let patches = || p.patches.bind(rows);
            let bindings = Gather {
                left: b.left.bind(&pixels),
                flags: b.flags.bind(&pixels),
                disparity: b.disparity.bind(&pixels),
                patches: patches(),
            };
            r.dispatch(&gather(plan, 0), &own, rows.clone(), (across, height), bindings)?;
            let bindings = CarryRows { patches: patches(), shares: Binding::whole(&p.shares) };
            r.dispatch(&carry_rows(plan, 0), &own, rows.clone(), (height, 1), bindings)?;
        }
        // Along columns, a band also sees the row that it goes on from.
        for rows in bands.iter().rev() {
            let bound = with_halo(rows, 1, down);
            let own = Uniform { first_bound: bound.start, ..own };
            let bindings = Rise { patches: p.patches.bind(&bound), shares: Binding::whole(&p.shares) };
            r.dispatch(&rise(plan, 0), &own, rows.clone(), (across, 1), bindings)?;
        }
        for rows in &bands {
            let bound = with_halo(rows, 1, down);
            let own = Uniform { first_bound: bound.start, ..own };
            let bindings = Sink { patches: p.patches.bind(&bound), shares: Binding::whole(&p.shares) };
            r.dispatch(&sink(plan, 0), &own, rows.clone(), (across, 1), bindings)?;
        }
    }
    let patches_of = |rows: &Range<u32>| rows.start / patch..rows.end.div_ceil(patch);
    let bind = |rows: &Range<u32>| Take {
        flags: b.flags.bind(rows),
        disparity: b.disparity.bind(rows),
        patches: p.patches.bind(&patches_of(rows)),
    };
    for rows in r.map_bands(&|rows| bind(rows).all())? {
        let own = Uniform { first_bound: patches_of(&rows).start, ..own };
        let (size, bindings) = ((l.width, rows.end - rows.start), bind(&rows));
        r.dispatch(&take(plan, 0), &own, rows, size, bindings)?;
    }
    Ok(())
}
