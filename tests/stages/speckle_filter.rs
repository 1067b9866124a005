//! The speckle filter.

use crate::common::compare::compare_finest;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::{on_maps, small_plan};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::Method;
use pollster::block_on;

#[test]
fn speckle_filter() {
    let sizes = [0, 1, 2, 3, 5, 20, 10_000];
    let change =
        |random: &mut Random, method: &mut Method| method.refinement.speckle_size = random.pick(&sizes);
    let input = |random: &mut Random, plan: &Plan| {
        let mut maps = random::finest(random, plan, false);
        // Flags that the left-right check may set.
        for validity in maps.validity.data_mut() {
            *validity &= i32::from(flag::OUTSIDE | flag::OCCLUDED | flag::MASKED);
        }
        maps
    };
    on_maps(Stage::SpeckleFilter, 40, change, input, |plan, _, maps| {
        twin::speckle_filter::speckle_filter(plan, maps);
    });
}

/// Ties are flagged in a region of any size, and only there.
#[test]
fn ties() {
    let (width, height) = (70, 33);
    let mut random = Random::new(4);
    let pair = random::pair(&mut random, width, height);
    let plan = small_plan(&mut random, (width, height), |m| m.refinement.speckle_size = 2);
    let tie = |x: usize, y: usize| x > 20 && (y == 7 || x + y == 64);
    for lead in [0, 1] {
        let mut maps = Finest::zero((width, height));
        maps.best = Plane::filled(width, height, 9);
        maps.runner_up = Plane::from_fn(width, height, |x, y| if tie(x, y) { 9 + lead } else { 900 });
        for (name, mut backend) in backends() {
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            maps.write(backend.as_mut());
            backend.run(Stage::SpeckleFilter).unwrap();
            let flags = block_on(backend.map(Map::Validity)).unwrap();
            let expected = |x, y| i32::from(lead == 0 && tie(x, y)) * i32::from(flag::TIE);
            assert_eq!(flags, Plane::from_fn(width, height, expected), "{name}");
        }
    }
}

/// Whether a pixel belongs to a region.
type Shape<'a> = &'a dyn Fn(usize, usize) -> bool;

/// Regions that defeat shortcuts: a spiral, a comb, rows that meet only at their ends.
#[test]
fn winding_regions() {
    let (width, height) = (131, 70);
    let spiral = |x: usize, y: usize| {
        let ring = x.min(y).min(width - 1 - x).min(height - 1 - y);
        let door = ring % 2 == 1 && (x, y) == (ring, ring + 1);
        ring.is_multiple_of(2) || door
    };
    let comb = |x: usize, y: usize| x.is_multiple_of(2) || y == height - 1;
    let snake = |x: usize, y: usize| y.is_multiple_of(2) || x == if y % 4 == 1 { width - 1 } else { 0 };
    let stairs = |x: usize, y: usize| !(x + y).is_multiple_of(3);
    let shapes: [(&str, Shape); 4] =
        [("spiral", &spiral), ("comb", &comb), ("snake", &snake), ("stairs", &stairs)];
    let mut random = Random::new(3);
    let pair = random::pair(&mut random, width, height);
    for (shape, inside) in shapes {
        let area = (0..width * height).filter(|i| inside(i % width, i / width)).count() as u32;
        for speckle_size in [2, 3, area / 2, area, area + 1] {
            let plan = small_plan(&mut random, (width, height), |m| m.refinement.speckle_size = speckle_size);
            let labels = plan.levels[0].labels as i32;
            let mut maps = Finest::zero((width, height));
            maps.validity = Plane::from_fn(width, height, |x, y| i32::from(!inside(x, y)) * 2);
            // No ties.
            maps.runner_up = Plane::from_fn(width, height, |x, y| 1 + (x + y) as i32);
            maps.label = Plane::from_fn(width, height, |x, _| (x as i32 / 50).min(labels - 1));
            let mut expected = maps.clone();
            twin::speckle_filter::speckle_filter(&plan, &mut expected);
            for (name, mut backend) in backends() {
                backend.prepare(&plan, Prepared::new(&pair)).unwrap();
                maps.write(backend.as_mut());
                backend.run(Stage::SpeckleFilter).unwrap();
                if let Err(e) = compare_finest(backend.as_mut(), &expected) {
                    panic!("{name}, {shape}, {speckle_size}: {e}");
                }
            }
        }
    }
}
