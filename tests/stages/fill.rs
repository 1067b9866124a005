//! The fill.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;

#[test]
fn fill() {
    let input = |random: &mut Random, plan: &Plan| {
        let mut maps = random::finest(random, plan, false);
        let (width, height) = plan.size();
        if random.one_in(2) {
            // Whole rows without a valid pixel.
            for y in 0..height {
                if random.one_in(2) {
                    for x in 0..width {
                        let reason = if random.one_in(3) { flag::MASKED } else { flag::OCCLUDED };
                        maps.validity[(x, y)] = reason.into();
                    }
                }
            }
        }
        maps
    };
    on_maps(Stage::Fill, 60, |_, _| (), input, |_, _, maps| twin::fill::fill(maps));
}
