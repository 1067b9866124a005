//! Costs outside the label range of their pixel: see [`Stage::LabelRange`](crate::backend::Stage::LabelRange).

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::plan::{COST_FRACTION_BITS, COST_MAX};

shader! {
    "label_range"(plan, level) {}
    main: Main { cost, label_range } => Kernel::new(0)
        .with("FINE_NARROW", level == 0)
        .with("COST_MAX", u32::from(COST_MAX))
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    r.rows(&main(r.plan, r.level), &Uniform {}, l.width * l.quads, |rows| Main {
        cost: here.cost.bind(rows),
        label_range: here.label_range.bind(rows),
    })?;
    r.renew(&here.cost);
    Ok(())
}
