//! Half-size disparities refined at full size.

use crate::common::compare::{compare_finest, compare_maps};
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use crate::common::twin::Finest;
use crate::common::twin::refine::Fit;
use mrfgs::image::{Pair, Plane};
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{MatchSize, Method};

/// Sizes of pairs that are matched at half their size.
pub(crate) const SIZES: &[(usize, usize)] =
    &[(1, 1), (2, 2), (1, 9), (13, 1), (5, 4), (33, 22), (47, 61), (300, 8)];

/// A plan with one level for matching a pair of `size` at half its size, and the halved pair.
pub(crate) fn halved(random: &mut Random, size: (usize, usize)) -> (Plan, Pair) {
    let mut method = random::method(random, 0);
    (method.graph.levels, method.schedule.match_size) = (1, MatchSize::Half);
    let (min, labels) = (random.pick(&[-21, -2, 0, 5]), random.pick(&[1, 2, 9, 40]));
    let plan = random::plan(size, min, labels, &method);
    (plan, random::pair(random, size.0, size.1).halved())
}

/// Plausible labels of a match: some far apart, most near their neighbours; some pixels of the right view have none.
pub(crate) fn labels(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, false);
    let most = plan.levels[0].labels as u32 - 1;
    let (first, apart) = (random.within(0, most), random.pick(&[0, 1, 3]));
    let (width, height) = plan.size();
    if apart < 3 {
        maps.label = Plane::from_fn(width, height, |_, _| (first + random.within(0, apart)).min(most) as i32);
    }
    maps
}

#[test]
fn refine() {
    let mut backends = backends();
    for (&size, seed) in SIZES.iter().flat_map(|size| (0..8).map(move |seed| (size, seed))) {
        let mut random = Random::new(seed);
        let (plan, pair) = halved(&mut random, size);
        let mut maps = labels(&mut random, &plan);
        let input = maps.clone();
        twin::refine::refine(&plan, &pair, &mut maps);
        // Also for exchanged views.
        let mut swapped = input.clone();
        swapped.raw = maps.raw.clone();
        swapped.disparity = maps.disparity.clone();
        twin::swap_views::swap_views(&mut swapped);
        twin::refine::refine(&plan, &pair.mirrored(), &mut swapped);
        for (name, backend) in &mut backends {
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            backend.probe().poison(0x5a).unwrap();
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            input.write(backend.as_mut());
            let mut same = |stages: &[Stage], expected: &Finest| {
                for &stage in stages {
                    backend.run(stage).unwrap();
                }
                if let Err(e) = compare_finest(backend.as_mut(), expected) {
                    panic!("{name}, {size:?}, seed {seed}, {stages:?}: {e}\n{:?}", plan.range);
                }
            };
            same(&[Stage::Refine], &maps);
            same(&[Stage::SwapViews, Stage::Refine], &swapped);
        }
    }
}

/// Negative control: a change of any part of the fit, or of the full-size views, is detected.
#[test]
fn control_a_changed_fit_is_found() {
    let mut random = Random::new(3);
    let mut method = Method::default();
    (method.graph.levels, method.schedule.match_size) = (1, MatchSize::Half);
    let plan = random::plan((60, 40), -3, 30, &method);
    let pair = random::pair(&mut random, 60, 40).halved();
    let mut maps = random::finest(&mut random, &plan, false);
    maps.label = Plane::from_fn(30, 20, |_, _| 4 + random.within(0, 2) as i32);
    let other = random::pair(&mut random, 60, 40).halved();
    let wrong = [
        (Fit { window: (1, 1), ..Fit::DEFINED }, &pair),
        (Fit { window: (2, 0), ..Fit::DEFINED }, &pair),
        (Fit { near: 2, ..Fit::DEFINED }, &pair),
        (Fit { reach: 3, ..Fit::DEFINED }, &pair),
        (Fit::DEFINED, &other),
        (Fit::DEFINED, &pair.mirrored()),
    ];
    for (name, mut backend) in backends() {
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        maps.write(backend.as_mut());
        backend.run(Stage::Refine).unwrap();
        let found = pollster::block_on(backend.map(Map::Raw)).unwrap();
        let mut right = maps.clone();
        twin::refine::refine(&plan, &pair, &mut right);
        compare_maps("raw", &found, &right.raw).unwrap();
        for (at, (fit, pair)) in wrong.iter().enumerate() {
            let mut changed = maps.clone();
            twin::refine::refine_by(fit, &plan, pair, &mut changed);
            assert!(compare_maps("raw", &found, &changed.raw).is_err(), "{name}: {at}");
        }
    }
}
