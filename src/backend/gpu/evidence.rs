//! Evidence and the first beliefs: see [`Stage::Evidence`](crate::backend::Stage::Evidence).
//!
//! Floor, a label: 3 bytes moved, 4 asked for (the costs twice, for their minimum), 25 operations for four.

use super::cost;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::{COST_FRACTION_BITS, Plan};

const SHADER: &str = include_str!("../../../shaders/evidence.wgsl");

uniform! { multiplier: u32, limit: u32, up: u32, down: u32, cap: u32 }

pub(super) fn jobs(plan: &Plan, level: usize) -> Vec<Job> {
    let kernel = Kernel::new("evidence", "main", SHADER)
        .of_width(plan.volume_width)
        .with("FINE_NARROW", level == 0)
        .with("COST_FRACTION_BITS", COST_FRACTION_BITS)
        .with("PADDING", u32::from(u8::MAX));
    vec![Job::new::<Uniform>(kernel, 2 * plan.levels[level].quads())]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (here, l, scale) = (r.here(), r.params(), r.plan.levels[r.level].evidence);
    let own = Uniform {
        multiplier: scale.multiplier.into(),
        limit: scale.limit.into(),
        up: scale.up,
        down: scale.down,
        cap: scale.cap.into(),
    };
    if r.level == 0 && !r.plan.holds_all_rows() {
        // What these rows take the place of goes.
        cost::record_costs(r)?;
        r.clear(&here.dependency);
        r.clear(&here.down);
    }
    r.rows(&jobs(r.plan, r.level)[0], &own, l.width, |rows| {
        vec![
            (1, here.cost.bind(rows)),
            (2, here.evidence.bind(rows)),
            (3, here.belief.bind(rows)),
            (4, here.windows.bind(&(0..1))),
        ]
    })?;
    r.renew(&here.belief);
    Ok(())
}
