//! Disparities of half-size pixels by the full size: see [`Stage::Refine`](crate::backend::Stage::Refine).
//!
//! Floor, a pixel of half the size: 150 bytes moved; 700 bytes asked for and 1,000 operations for the census of four pixels of both
//! views and their costs, 400 bytes and 300 operations for the fit.

use super::commands::Recorder;
use super::full_buffers::FullBuffers;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::with_halo;
use crate::error::Result;
use crate::stage::refine::{COLUMNS, NEAR, NO_CENSUS, REACH};

shader! {
    "refine"(plan, level) { full_pitch: u32 }
    census: Census { left, right, left_census_out, right_census_out } => kernel(5 * 6);
    costs: Blocks { left_census, right_census, optima, costs_out } => kernel(2 * 3 * 5);
    fit: Fit { optima, costs_in, raw, disparity } => kernel(3 * (2 * COLUMNS + 2) + REACH);
}

// The shader finds the costs of a disparity in fixed bits of its words.
const _: () = assert!(REACH == 4 && NEAR == 1);

fn kernel<B: Bindings>(loops: usize) -> Kernel<B> {
    Kernel::new(loops)
        .with("NO_CENSUS", u32::from(NO_CENSUS))
        .with("REACH", REACH as i32)
        .with("COLUMNS", COLUMNS as i32)
        .with("BEFORE", (REACH + 1 + 2 * NEAR) as i32)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let full = b.full.as_ref().expect("buffers for the full size");
    let own = Uniform { full_pitch: full.pitch };
    r.rows(&census(r.plan, 0), &own, 4 * l.width, |rows| {
        let rows = FullBuffers::rows(rows);
        let seen = with_halo(&rows, 2, 2 * l.height);
        Census {
            left: full.left.bind(&seen),
            right: full.right.bind(&seen),
            left_census_out: full.census[0].bind(&rows),
            right_census_out: full.census[1].bind(&rows),
        }
    })?;
    r.rows(&costs(r.plan, 0), &own, 4 * l.width, |rows| Blocks {
        left_census: full.census[0].bind(&FullBuffers::rows(rows)),
        right_census: full.census[1].bind(&FullBuffers::rows(rows)),
        optima: b.optima.bind(rows),
        costs_out: full.costs.bind(rows),
    })?;
    r.rows(&fit(r.plan, 0), &own, l.width, |rows| {
        let seen = with_halo(rows, 1, l.height);
        Fit {
            optima: b.optima.bind(&seen),
            costs_in: full.costs.bind(&seen),
            raw: b.raw.bind(rows),
            disparity: b.disparity.bind(rows),
        }
    })
}
