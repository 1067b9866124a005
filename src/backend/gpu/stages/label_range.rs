//! Limits costs to label ranges: see [`Stage::LabelRange`](crate::backend::Stage::LabelRange).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::{COST_FRACTION_BITS, COST_MAX};
use crate::stage::{Data, Volume};

shader! {
    "label_range"(plan, level) {}
    main { cost, label_range } => Variant::new(0)
        .with("FINE_NARROW", level == 0)
        .with("COST_MAX", u32::from(COST_MAX))
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let l = r.params();
    r.rows(&main(r.plan, r.level), &Uniform {}, l.width * l.quads)?;
    r.renew(Data::Volume(Volume::Cost(r.level)));
    Ok(())
}
