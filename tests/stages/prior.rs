//! The prior in the evidence.

use crate::common::random::Random;
use crate::common::twin;
use crate::{Case, on_all, random_cost, same};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::{LabelPrior, LevelPriors, NO_ANCHOR};

/// Random priors of all kinds: nothing known, sharp and flat ones, also far outside the labels.
pub(super) fn random_prior(random: &mut Random, plan: &Plan, z: usize) -> Plane<LabelPrior> {
    let l = &plan.levels[z];
    let most = 32 * l.labels as u32 + 200;
    Plane::from_fn(l.width, l.height, |_, _| {
        if random.one_in(3) {
            return LabelPrior::default();
        }
        let (a, b) = (random.within(0, most) as i32 - 100, random.within(0, most) as i32 - 100);
        let most_slope = random.pick(&[0, 5, 300, 4095]);
        LabelPrior {
            lo: a.min(b),
            hi: if random.one_in(2) { a.min(b) + 16 } else { a.max(b) },
            slope: random.within(0, most_slope),
            cap: random.within(1, 60) as u8,
        }
    })
}

/// Runs the stage at level `z` on random costs, and compares it with the twin, which takes this `prior`.
pub(super) fn check(
    case: &Case,
    plan: &Plan,
    backend: &mut dyn Backend,
    random: &mut Random,
    z: usize,
    prior: &Plane<LabelPrior>,
) -> Result<(), String> {
    backend.probe().set_windows(z, &case.windows[z]).unwrap();
    let has = twin::label_window::ranges(plan, z, &case.windows[z]);
    backend.probe().write(Volume::Cost(z), &random_cost(random, plan, z)).unwrap();
    backend.run(Stage::Evidence(z)).unwrap();
    let evidence = backend.probe().read(Volume::Evidence(z)).unwrap();
    backend.run(Stage::Prior(z)).unwrap();
    let expected = twin::prior::prior(plan, z, &has, prior, &evidence);
    same(plan, backend, Volume::Evidence(z), &expected)?;
    same(plan, backend, Volume::Belief(z), &twin::evidence::beliefs(plan, &expected))?;
    // Control: without a prior, the evidence is another.
    let nothing = Plane::filled(plan.levels[z].width, plan.levels[z].height, LabelPrior::default());
    let without = twin::prior::prior(plan, z, &has, &nothing, &evidence);
    if without != expected {
        assert!(same(plan, backend, Volume::Evidence(z), &without).is_err());
    }
    Ok(())
}

#[test]
fn prior() {
    on_all(|case, backend, random| {
        let plan = case.plan.clone().with_prior(true);
        let levels: Vec<_> = (0..plan.levels.len()).map(|z| random_prior(random, &plan, z)).collect();
        let (width, height) = plan.size();
        let anchors = Plane::filled(width, height, NO_ANCHOR);
        let prior = Some(LevelPriors { levels: levels.clone(), anchors });
        backend.prepare(&plan, Prepared { prior, ..Prepared::new(&case.pair) }).unwrap();
        for (z, prior) in levels.iter().enumerate() {
            check(case, &plan, backend, random, z, prior)?;
        }
        Ok(())
    });
}
