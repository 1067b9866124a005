//! Planes over any distance: see [`Stage::FarPlane`](crate::backend::Stage::FarPlane).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::with_halo;
use crate::error::Result;
use crate::plan::patches::{
    PATCH, PATCH_APART, PATCH_AWAY, PATCH_DOUBT, PATCH_FAR_BITS, PATCH_LEAST, PATCH_MOMENT, PATCH_OUTVOTES,
    PATCH_REACH, PATCH_RESIDUAL, PATCH_RIDGE, PATCH_ROUNDS, PATCH_SHARE_BITS, PATCH_SPREAD, PATCH_STEEPEST,
    PATCH_STEP, PATCH_STEP_BITS, PATCH_WEIGHT_BITS, are_taken, patches,
};
use crate::stage::{Data, Extent};
use crate::weights::PATCH_DIFFERENCES;

shader! {
    "far_plane"(plan, level) {
        across: u32,
        down: u32,
        pitch: u32,
        first_bound: u32,
        again: u32,
    }
    gather { left, flags, disparity, patches } => variant(PATCH * PATCH + PATCH).over(Extent::Patches);
    carry_rows { patches, patch_shares } => variant(2 * patches(plan).0).over(Extent::Patches);
    rise { patches around 1, patch_shares } => variant(patches(plan).1).over(Extent::Patches);
    sink { patches around 1, patch_shares } => variant(patches(plan).1).over(Extent::Patches);
    take { flags, disparity, patches } => variant(0);
}

fn variant(loops: usize) -> Variant {
    Variant::new(loops)
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
    if !are_taken(&r.plan.method) {
        return Ok(());
    }
    let (l, plan) = (r.params(), r.plan);
    let (across, down) = patches(plan);
    let (across, down) = (across as u32, down as u32);
    let pitch = Data::Patches.array(plan).words as u32;
    let own = Uniform { across, down, pitch, ..Uniform::default() };
    // Along columns, a band also reads the adjacent row from which it continues.
    let [gathered, sunk] = [gather(plan, 0).any(), sink(plan, 0).any()];
    let bands = r.bands_of(&[(&gathered, 0), (&sunk, 0)], usize::MAX)?;
    for round in 0..PATCH_ROUNDS {
        let own = Uniform { again: (round > 0).into(), ..own };
        for rows in &bands {
            let own = Uniform { first_bound: rows.start, ..own };
            let height = rows.end - rows.start;
            r.dispatch(&gather(plan, 0), &own, rows.clone(), (across, height))?;
            r.dispatch(&carry_rows(plan, 0), &own, rows.clone(), (height, 1))?;
        }
        for rows in bands.iter().rev() {
            let own = Uniform { first_bound: with_halo(rows, 1, down).start, ..own };
            r.dispatch(&rise(plan, 0), &own, rows.clone(), (across, 1))?;
        }
        for rows in &bands {
            let own = Uniform { first_bound: with_halo(rows, 1, down).start, ..own };
            r.dispatch(&sink(plan, 0), &own, rows.clone(), (across, 1))?;
        }
    }
    for rows in r.bands_of(&[(&take(plan, 0).any(), 0)], usize::MAX)? {
        let first_bound = Extent::Patches.rows_of(plan, &rows, Extent::Level(0), 0).start;
        let (own, size) = (Uniform { first_bound, ..own }, (l.width, rows.end - rows.start));
        r.dispatch(&take(plan, 0), &own, rows, size)?;
    }
    Ok(())
}
