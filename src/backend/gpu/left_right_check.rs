//! What the right view says of each pixel: see [`Stage::LeftRightCheck`](crate::backend::Stage::LeftRightCheck).

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::options::LeftRightCheck;
use crate::plan::Plan;
use crate::stage::NO_LABEL;

const SHADER: &str = include_str!("../../../shaders/left_right_check.wgsl");

uniform! { is_on: u32 }

pub(super) fn jobs(_: &Plan, _: usize) -> Vec<Job> {
    let kernel = Kernel::new("left_right_check", "main", SHADER).with("NO_LABEL", u32::from(NO_LABEL));
    vec![Job::new::<Uniform>(kernel, 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let is_on = r.plan.method.refinement.left_right_check != LeftRightCheck::Off;
    let own = Uniform { is_on: is_on.into() };
    r.rows(&jobs(r.plan, 0)[0], &own, l.width, |rows| {
        vec![
            (1, b.optima.bind(rows)),
            (2, b.right_labels.bind(rows)),
            (3, b.left.bind(rows)),
            (4, b.flags.bind(rows)),
        ]
    })
}
