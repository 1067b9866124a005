//! Sub-pixel disparities: see [`Stage::SubPixel`](crate::backend::Stage::SubPixel).

use super::cost;
use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;

shader! {
    "sub_pixel"(plan, level) { is_on: u32 }
    main { cost around 1, optima around 1, raw, disparity } => Variant::new(3 + 3 * 5);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    if r.only.is_none() && !r.plan.holds_all_rows() {
        return cost::record_as_needed(r, 1, |r, rows| r.at(0, rows, record));
    }
    let own = Uniform { is_on: r.plan.method.refinement.sub_pixel.into() };
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &own, width)
}
