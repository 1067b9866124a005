//! The confidence.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Method;

#[test]
fn confidence() {
    let floors = [0, 1, 16, 17, 255];
    let change =
        |random: &mut Random, method: &mut Method| method.refinement.confidence_floor = random.pick(&floors);
    let input = |random: &mut Random, plan: &Plan| random::finest(random, plan, false);
    on_maps(Stage::Confidence, 40, change, input, |plan, _, maps| twin::confidence::confidence(plan, maps));
}
