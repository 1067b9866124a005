//! Anchors.

use crate::common::compare::compare_maps;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::stage::{LabelPrior, LevelPriors, NO_ANCHOR};
use pollster::block_on;

#[test]
fn anchor() {
    let mut taken = 0;
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let size = random.pick(crate::SIZES);
        let method = random::method(&mut random, 2);
        let plan = random::plan(size, -3, 9, &method).with_prior(true);
        let pair = random::pair(&mut random, size.0, size.1);
        let maps = random::finest(&mut random, &plan, false);
        let anchors = Plane::from_fn(size.0, size.1, |_, _| {
            (!random.one_in(3)).then(|| random.within(0, 3000) as i32 - 700)
        });
        let levels =
            plan.levels.iter().map(|l| Plane::filled(l.width, l.height, LabelPrior::default())).collect();
        let prior = LevelPriors { levels, anchors: anchors.map(|anchor| anchor.unwrap_or(NO_ANCHOR)) };
        let mut expected = maps.clone();
        twin::anchor::anchor(&anchors, &mut expected);
        for (name, mut backend) in backends() {
            let prepared = Prepared { prior: Some(prior.clone()), ..Prepared::new(&pair) };
            backend.prepare(&plan, prepared).unwrap();
            maps.write(backend.as_mut());
            backend.run(Stage::Anchor).unwrap();
            for (map, expected) in expected.planes() {
                let found = block_on(backend.map(map)).unwrap();
                compare_maps(&format!("{name}, seed {seed}: {map:?}"), &found, expected).unwrap();
            }
            // Control: without anchors, the maps are others.
            if expected != maps {
                taken += 1;
                let found = block_on(backend.map(Map::Validity)).unwrap();
                assert!(compare_maps("validity", &found, &maps.validity).is_err());
            }
        }
    }
    assert!(taken > 40, "{taken} cases with anchors");
}
