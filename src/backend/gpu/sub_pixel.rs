//! Disparities between the labels: see [`Stage::SubPixel`](crate::backend::Stage::SubPixel).

use super::commands::Recorder;
use super::cost;
use super::kernel::{Kernel, shader};
use super::rows::with_halo;
use crate::error::Result;

shader! {
    "sub_pixel"(plan, level) { is_on: u32 }
    main: Main { cost, optima, raw, disparity } => Kernel::new(3 + 3 * 5);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    if r.only.is_none() && !r.plan.holds_all_rows() {
        return cost::record_as_needed(r, 1, |r, rows| r.at(0, rows, record));
    }
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let own = Uniform { is_on: r.plan.method.refinement.sub_pixel.into() };
    r.rows(&main(r.plan, 0), &own, l.width, |rows| {
        let seen = with_halo(rows, 1, l.height);
        Main {
            cost: here.cost.bind(&seen),
            optima: b.optima.bind(&seen),
            raw: b.raw.bind(rows),
            disparity: b.disparity.bind(rows),
        }
    })
}
