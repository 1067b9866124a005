//! The left-right check.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::maps::on_maps;
use mrfgs::low_level::backend::{NO_LABEL, Stage};
use mrfgs::low_level::plan::Plan;

#[test]
fn left_right_check() {
    let input = |random: &mut Random, plan: &Plan| {
        let mut maps = random::finest(random, plan, false);
        // Some pixels have no label, like in the right view.
        for label in maps.label.data_mut() {
            *label = if random.one_in(9) { NO_LABEL.into() } else { *label };
        }
        maps
    };
    on_maps(Stage::LeftRightCheck, 20, |_, _| (), input, twin::left_right_check::left_right_check);
}
