//! The votes on filled pixels.

use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{Fill, Nearer};

/// Maps after the fill: what is neither valid nor masked is filled.
fn filled(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, false);
    for validity in maps.validity.data_mut() {
        if twin::fill::invalid(*validity) && *validity & i32::from(flag::MASKED) == 0 {
            *validity |= i32::from(flag::FILLED);
        }
    }
    maps
}

#[test]
fn vote_fill() {
    let method = |random: &mut Random, method: &mut mrfgs::options::Method| {
        method.refinement.fill = Fill::Votes;
        method.refinement.nearer = random.pick(&[Nearer::Larger, Nearer::Smaller]);
    };
    on_maps(Stage::VoteFill, 20, method, filled, twin::vote_fill::vote_fill);
}
