//! Costs outside the label range of their pixel: see [`Stage::LabelRange`](crate::backend::Stage::LabelRange).

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::{COST_FRACTION_BITS, COST_MAX, Plan};

const SHADER: &str = include_str!("../../../shaders/label_range.wgsl");

pub(super) fn jobs(_: &Plan, level: usize) -> Vec<Job> {
    let kernel = Kernel::new("label_range", "main", SHADER)
        .with("FINE_NARROW", level == 0)
        .with("COST_MAX", u32::from(COST_MAX))
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS);
    vec![Job::new::<()>(kernel, 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l) = (r.here(), r.params());
    r.rows(&jobs(r.plan, r.level)[0], &(), l.width * l.quads, |rows| {
        vec![(1, here.cost.bind(rows)), (2, here.label_range.bind(rows))]
    })?;
    r.renew(&here.cost);
    Ok(())
}
