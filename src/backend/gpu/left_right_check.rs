//! What the right view says of each pixel: see [`Stage::LeftRightCheck`](crate::backend::Stage::LeftRightCheck).

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::options::LeftRightCheck;
use crate::stage::NO_LABEL;

shader! {
    "left_right_check"(plan, level) { is_on: u32 }
    main: Main { optima, right_labels, left, flags } => Kernel::new(0).with("NO_LABEL", u32::from(NO_LABEL));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let is_on = r.plan.method.refinement.left_right_check != LeftRightCheck::Off;
    let own = Uniform { is_on: is_on.into() };
    r.rows(&main(r.plan, 0), &own, l.width, |rows| Main {
        optima: b.optima.bind(rows),
        right_labels: b.right_labels.bind(rows),
        left: b.left.bind(rows),
        flags: b.flags.bind(rows),
    })
}
