//! What the tests of the passes share.

use super::{Frame, Program, schedule};
use crate::options::{DisparityRange, LeftRightCheck, Method};
use crate::plan::Plan;

/// A plan whose right view is wanted, and read off the beliefs or found by a second match.
pub(super) fn plan(check: LeftRightCheck) -> Plan {
    let mut method = Method::default();
    method.refinement.left_right_check = check;
    method.refinement.right_map = true;
    method.tiles.memory = 24;
    Plan::new(300, 240, DisparityRange::new(0, 31).unwrap(), &method).unwrap()
}

/// The plain list of it.
pub(super) fn plain(plan: &Plan) -> Program {
    Program { frames: vec![Frame::whole(plan)], steps: schedule::steps(plan) }
}
