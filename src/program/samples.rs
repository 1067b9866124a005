//! Samples for the tests of the passes.

use super::{Frame, Program, schedule};
use crate::options::{DisparityRange, LeftRightCheck, Method};
use crate::plan::Plan;

/// A plan with a map of the right view, which is computed from the beliefs or by a second match.
pub(super) fn plan(check: LeftRightCheck) -> Plan {
    let mut method = Method::default();
    method.refinement.left_right_check = check;
    method.refinement.right_map = true;
    method.tiles.memory = 24;
    Plan::new(300, 240, DisparityRange::new(0, 31).unwrap(), &method).unwrap()
}

/// The basic program of `plan`.
pub(super) fn plain(plan: &Plan) -> Program {
    Program { frames: vec![Frame::whole(plan)], steps: schedule::steps(plan) }
}
