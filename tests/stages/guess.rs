//! Guesses.

use super::prior::{self, random_prior};
use crate::common::random;
use crate::common::twin;
use crate::on_all;
use mrfgs::image::Plane;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::{LevelPriors, NO_ANCHOR};
use mrfgs::options::Fill;

#[test]
fn guess() {
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        (method.schedule.looks, method.schedule.tolerance) = (2, 0.0);
        method.refinement.fill = random.pick(&[Fill::Row, Fill::Votes]);
        let knows = random.one_in(2);
        let plan = Plan { method, ..case.plan.clone() }.with_prior(knows);
        let (width, height) = plan.size();
        let levels: Vec<_> = (0..plan.levels.len()).map(|z| random_prior(random, &plan, z)).collect();
        let mut known = knows.then(|| levels[0].clone());
        let prior = knows.then(|| LevelPriors { levels, anchors: Plane::filled(width, height, NO_ANCHOR) });
        backend.prepare(&plan, Prepared { prior, ..Prepared::new(&case.pair) }).unwrap();
        // Guesses of an earlier look are forgotten, priors from elsewhere are kept.
        for look in 0..2 {
            let maps = random::finest(random, &plan, true);
            maps.write(backend);
            let mut guessed = twin::guess::take(&plan, &maps.disparity, &maps.validity, known.as_ref());
            if knows {
                known = Some(guessed.clone());
            }
            for z in 0..plan.levels.len() {
                if z > 0 {
                    guessed = twin::guess::pool(&plan, z, &guessed);
                }
                backend.run(Stage::Guess(z)).unwrap();
                // The prior has no access of its own; it shows in the evidence.
                prior::check(case, &plan, backend, random, z, &guessed)
                    .map_err(|e| format!("look {look}, level {z}: {e}"))?;
            }
        }
        Ok(())
    });
}
