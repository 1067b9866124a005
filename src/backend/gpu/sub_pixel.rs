//! Disparities between the labels: see [`Stage::SubPixel`](crate::backend::Stage::SubPixel).

use super::cost;
use super::rows::with_halo;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/sub_pixel.wgsl");

uniform! { is_on: u32 }

pub(super) fn jobs(_: &Plan, _: usize) -> Vec<Job> {
    vec![Job::new::<Uniform>(Kernel::new("sub_pixel", "main", SHADER), 3 + 3 * 5)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    if r.only.is_none() && !r.plan.holds_all_rows() {
        return cost::record_as_needed(r, 1, |r, rows| r.at(0, rows, record));
    }
    let (b, here, l) = (r.buffers, r.here(), r.params());
    let own = Uniform { is_on: r.plan.method.refinement.sub_pixel.into() };
    r.rows(&jobs(r.plan, 0)[0], &own, l.width, |rows| {
        let seen = with_halo(rows, 1, l.height);
        vec![
            (1, here.cost.bind(&seen)),
            (2, b.optima.bind(&seen)),
            (3, b.raw.bind(rows)),
            (4, b.disparity.bind(rows)),
        ]
    })
}
