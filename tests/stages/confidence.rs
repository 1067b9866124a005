//! The confidence.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;

#[test]
fn confidence() {
    let input = |random: &mut Random, plan: &Plan| random::finest(random, plan, false);
    on_maps(
        Stage::Confidence,
        40,
        |_, _| (),
        input,
        |plan, _, maps| twin::confidence::confidence(plan, maps),
    );
}
