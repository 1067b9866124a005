//! Filling from neighbours.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{Method, Nearer};
use pollster::block_on;

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
    on_maps(Stage::Fill, 60, |_, _| (), input, |plan, _, maps| twin::fill::fill(plan, maps));
}

/// In a mirror, disparities change sign, so that the nearer ones are the larger instead of the smaller.
#[test]
fn fill_in_a_mirror() {
    let mut random = Random::new(8);
    let plans = [Nearer::Larger, Nearer::Smaller].map(|nearer| {
        let mut method = Method::default();
        (method.graph.levels, method.refinement.nearer) = (1, nearer);
        random::plan((40, 21), 0, 9, &method)
    });
    let pair = random::pair(&mut random, 40, 21);
    let maps = random::finest(&mut random, &plans[0], false);
    let mut mirrored = maps.clone();
    (mirrored.disparity, mirrored.validity) =
        (maps.disparity.mirrored().map(|d| -d), maps.validity.mirrored());
    for (name, mut backend) in backends() {
        let mut filled = |plan: &Plan, maps: &Finest| {
            backend.prepare(plan, Prepared::new(&pair)).unwrap();
            maps.write(backend.as_mut());
            backend.run(Stage::Fill).unwrap();
            (block_on(backend.map(Map::Disparity)).unwrap(), block_on(backend.map(Map::Validity)).unwrap())
        };
        let smaller = filled(&plans[1], &maps);
        let mirror = |(disparity, validity): (Plane<i32>, Plane<i32>)| {
            (disparity.mirrored().map(|d| -d), validity.mirrored())
        };
        assert!(mirror(filled(&plans[0], &mirrored)) == smaller, "{name}");
        assert!(filled(&plans[0], &maps) != smaller, "{name}: both sides are the same");
    }
}
