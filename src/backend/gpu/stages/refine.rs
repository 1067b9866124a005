//! Refines disparities at full size: see [`Stage::Refine`](crate::backend::Stage::Refine).
//!
//! Lower bound per half-size pixel: 150 bytes moved; 700 bytes requested and 1,000 operations for the census
//! of four pixels of both views and their costs, 400 bytes and 300 operations for the fit.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::full_pitch;
use crate::error::Result;
use crate::stage::refine::{COLUMNS, NEAR, NO_CENSUS, REACH};

shader! {
    "refine"(plan, level) { full_pitch: u32 }
    census {
        full_left around 2, full_right around 2, full_left_census_out, full_right_census_out
    } => variant(5 * 6);
    costs { full_left_census, full_right_census, optima, block_costs_out } => variant(2 * 3 * 5);
    fit { optima around 1, block_costs around 1, raw, disparity } => variant(3 * (2 * COLUMNS + 2) + REACH);
}

// The shader relies on the positions of costs in fixed bits of its words.
const _: () = assert!(REACH == 4 && NEAR == 1);

fn variant(loops: usize) -> Variant {
    Variant::new(loops)
        .with("NO_CENSUS", u32::from(NO_CENSUS))
        .with("REACH", REACH as i32)
        .with("COLUMNS", COLUMNS as i32)
        .with("BEFORE", (REACH + 1 + 2 * NEAR) as i32)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, width) = (r.plan, r.params().width);
    let own = Uniform { full_pitch: full_pitch(plan) };
    r.rows(&census(plan, 0), &own, 4 * width)?;
    r.rows(&costs(plan, 0), &own, 4 * width)?;
    r.rows(&fit(plan, 0), &own, width)
}
