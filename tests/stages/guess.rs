//! Guesses.

use super::prior::random_prior;
use crate::common::random;
use crate::common::twin;
use crate::{on_all, random_cost, same};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::{LabelPrior, LevelPriors, NO_ANCHOR};
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
                backend.probe().set_windows(z, &case.windows[z]).unwrap();
                let has = twin::label_window::ranges(&plan, z, &case.windows[z]);
                backend.probe().write(Volume::Cost(z), &random_cost(random, &plan, z)).unwrap();
                backend.run(Stage::Evidence(z)).unwrap();
                let evidence = backend.probe().read(Volume::Evidence(z)).unwrap();
                backend.run(Stage::Prior(z)).unwrap();
                let expected = twin::prior::prior(&plan, z, &has, &guessed, &evidence);
                same(&plan, backend, Volume::Evidence(z), &expected)
                    .map_err(|e| format!("look {look}, level {z}: {e}"))?;
                // Control: without guesses, the evidence is another.
                let nothing = Plane::filled(guessed.width(), guessed.height(), LabelPrior::default());
                let without = twin::prior::prior(&plan, z, &has, &nothing, &evidence);
                if without != expected {
                    assert!(same(&plan, backend, Volume::Evidence(z), &without).is_err());
                }
            }
        }
        Ok(())
    });
}
