//! The lead of labels without guesses.

use super::prior::random_prior;
use crate::common::compare::compare_finest;
use crate::common::twin::belief::belief_most;
use crate::common::{random, twin};
use crate::on_all;
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::{LevelPriors, NO_ANCHOR};
use mrfgs::options::Fill;
use std::cell::Cell;

#[test]
fn lead() {
    let changed = Cell::new(0);
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        (method.schedule.looks, method.schedule.tolerance) = (2, 0.0);
        method.refinement.fill = random.pick(&[Fill::Row, Fill::Votes]);
        let plan = Plan { method, ..case.plan.clone() }.with_prior(true);
        let (width, height) = plan.size();
        let mut levels: Vec<_> = (0..plan.levels.len()).map(|z| random_prior(random, &plan, z)).collect();
        for prior in levels[0].data_mut() {
            // Guesses, and a few priors from elsewhere.
            prior.cap = if random.one_in(4) { prior.cap } else { prior.cap.min(random.within(0, 6) as u8) };
        }
        let prior = LevelPriors { levels: levels.clone(), anchors: Plane::filled(width, height, NO_ANCHOR) };
        backend.prepare(&plan, Prepared { prior: Some(prior), ..Prepared::new(&case.pair) }).unwrap();
        backend.probe().set_windows(0, &case.windows[0]).unwrap();
        for most in [0, 9, belief_most(&plan)] {
            let belief = case.beliefs(random, most);
            backend.probe().write(Volume::Belief(0), &belief).unwrap();
            let mut maps = random::finest(random, &plan, false);
            maps.write(backend);
            backend.run(Stage::WinnerTakesAll).unwrap();
            backend.run(Stage::Lead).unwrap();
            twin::winner_takes_all::winner_takes_all(&plan, &belief, &mut maps);
            let with_guess = maps.clone();
            twin::lead::lead(&plan, &belief, &levels[0], &mut maps);
            compare_finest(backend, &maps)?;
            // Control: with the guess, leads are others.
            if with_guess.runner_up != maps.runner_up {
                changed.set(changed.get() + 1);
                assert!(compare_finest(backend, &with_guess).is_err());
            }
        }
        Ok(())
    });
    assert!(changed.get() > 20, "{} maps with other leads", changed.get());
}
