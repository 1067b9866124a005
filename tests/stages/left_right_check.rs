//! The comparison with the right view.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;

#[test]
fn left_right_check() {
    let input = |random: &mut Random, plan: &Plan| random::finest(random, plan, false);
    on_maps(Stage::LeftRightCheck, 20, |_, _| (), input, twin::left_right_check::left_right_check);
}
