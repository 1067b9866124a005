//! Maps at full size of a pair matched at half its size.

use crate::common::compare::compare_maps;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use crate::common::twin::Finest;
use crate::common::twin::enlarge::Edges;
use crate::refine::{SIZES, halved};
use mrfgs::image::{Pair, Plane};
use mrfgs::low_level::backend::{Backend, Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use pollster::block_on;

/// Disparities of slanted surfaces with a step between them, within and slightly beyond the range.
fn surfaces(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, true);
    let (low, high) = (256 * plan.range.min, 256 * plan.range.max);
    let (slope, step) = (random.pick(&[0, 10, 100]), random.pick(&[0, 200, 2000]));
    let edge = random.within(0, 2 * plan.size().0 as u32) as i32;
    let noise = random.pick(&[1, 60, 400]);
    if !random.one_in(4) {
        maps.disparity = Plane::from_fn(plan.size().0, plan.size().1, |x, y| {
            let behind = if 2 * x as i32 + y as i32 > edge { step } else { 0 };
            low - 300 + slope * x as i32 + behind + random.within(0, noise) as i32
        });
        maps.disparity = maps.disparity.map(|&d| d.min(high + 300));
    }
    maps
}

fn same(backend: &mut dyn Backend, expected: &[(Map, Plane<i32>)]) -> Result<(), String> {
    let mut maps = expected.iter();
    maps.try_for_each(|(map, plane)| {
        compare_maps(&format!("{map:?}"), &block_on(backend.map(*map)).unwrap(), plane)
    })
}

fn run(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, maps: &Finest) {
    backend.prepare(plan, Prepared::new(pair)).unwrap();
    maps.write(backend);
    backend.run(Stage::Enlarge).unwrap();
}

#[test]
fn enlarge() {
    let mut backends = backends();
    for (&size, seed) in SIZES.iter().flat_map(|size| (0..12).map(move |seed| (size, seed))) {
        let mut random = Random::new(seed);
        let (plan, pair) = halved(&mut random, size);
        let maps = surfaces(&mut random, &plan);
        let expected = twin::enlarge::enlarge(&plan, &pair, &maps);
        for (name, backend) in &mut backends {
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            backend.probe().poison(0x5a).unwrap();
            run(backend.as_mut(), &plan, &pair, &maps);
            if let Err(e) = same(backend.as_mut(), &expected) {
                panic!("{name}, {size:?}, seed {seed}: {e}");
            }
        }
    }
}

/// Disparities at the ends of the largest ranges do not overflow.
#[test]
fn the_farthest_ranges() {
    let mut method = mrfgs::options::Method::default();
    (method.graph.levels, method.schedule.match_size) = (1, mrfgs::options::MatchSize::Half);
    let most = mrfgs::options::MAX_DISPARITY;
    for min in [-most, most - 10] {
        let mut random = Random::new(1);
        let plan = random::plan((12, 8), min, 11, &method);
        let pair = random::pair(&mut random, 12, 8).halved();
        let mut maps = random::finest(&mut random, &plan, true);
        let low = 256 * plan.range.min;
        maps.disparity = Plane::from_fn(6, 4, |_, _| low + random.within(0, 900) as i32);
        maps.raw = maps.disparity.clone();
        let expected = twin::enlarge::enlarge(&plan, &pair, &maps);
        for (_, mut backend) in backends() {
            run(backend.as_mut(), &plan, &pair, &maps);
            same(backend.as_mut(), &expected).unwrap();
        }
    }
}

/// Negative control: a change of any part of the definition is detected.
#[test]
fn control_changed_edges_are_found() {
    let mut random = Random::new(9);
    let mut method = random::method(&mut random, 0);
    (method.graph.levels, method.schedule.match_size) = (1, mrfgs::options::MatchSize::Half);
    let plan = random::plan((60, 40), 0, 40, &method);
    // Faint enough that colours are similar.
    let faint = |random: &mut Random| {
        Plane::from_fn(60, 40, |_, _| [0; 3].map(|_: i32| random.within(100, 140) as u8))
    };
    let image = |random: &mut Random| mrfgs::image::Image::from_rgb8(&faint(random));
    let pair = Pair::new(image(&mut random), image(&mut random)).unwrap().halved();
    let mut maps = random::finest(&mut random, &plan, true);
    maps.disparity = Plane::from_fn(30, 20, |x, _| {
        let step = if x > 14 { 1500 } else { 0 };
        600 + step + random.within(0, 150) as i32
    });
    let narrower = {
        let mut plan = plan.clone();
        plan.full = plan.full.map(|mut full| {
            full.range.max = 14;
            full
        });
        plan
    };
    for (name, mut backend) in backends() {
        run(backend.as_mut(), &plan, &pair, &maps);
        same(backend.as_mut(), &twin::enlarge::enlarge(&plan, &pair, &maps)).unwrap();
        for (at, edges) in [
            Edges { away: 7, ..Edges::DEFINED },
            Edges { near: 60, ..Edges::DEFINED },
            Edges { flat: 200, ..Edges::DEFINED },
        ]
        .into_iter()
        .enumerate()
        {
            let wrong = twin::enlarge::enlarge_by(&edges, &plan, &pair, &maps);
            assert!(same(backend.as_mut(), &wrong).is_err(), "{name}: {at}");
        }
        for (plan, pair) in [(&narrower, pair.clone()), (&plan, pair.mirrored())] {
            assert!(same(backend.as_mut(), &twin::enlarge::enlarge(plan, &pair, &maps)).is_err(), "{name}");
        }
    }
}
