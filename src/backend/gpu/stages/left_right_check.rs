//! The left-right check: see [`Stage::LeftRightCheck`](crate::backend::Stage::LeftRightCheck).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::options::LeftRightCheck;
use crate::stage::NO_LABEL;

shader! {
    "left_right_check"(plan, level) { is_on: u32 }
    main { optima, right_labels, left, flags } => Variant::new(0).with("NO_LABEL", u32::from(NO_LABEL));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let is_on = r.plan.method.refinement.left_right_check != LeftRightCheck::Off;
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform { is_on: is_on.into() }, width)
}
