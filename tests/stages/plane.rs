//! Planes fitted to disparities, starting from the weighted median.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use crate::median::{any_maps, any_method};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{Median, Method};

/// Random maps, often with slanted disparities, with some noise and steps.
pub(crate) fn slanted(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = any_maps(random, plan);
    if !random.one_in(3) {
        let [across, down] = [0; 2].map(|_: i32| random.within(0, 800) as i32 - 400);
        let (noise, step) = (random.pick(&[0, 40, 600]), random.pick(&[0, 300, 5000]));
        let (width, height) = plan.size();
        maps.disparity = Plane::from_fn(width, height, |x, y| {
            let beyond = if x > width / 2 { step } else { 0 };
            across * x as i32 + down * y as i32 + beyond + random.within(0, noise) as i32
        });
    }
    maps
}

#[test]
fn plane() {
    on_maps(Stage::Plane, 30, any_method, slanted, twin::plane::plane);
}

/// The largest possible sums: the largest window, full weight everywhere, and disparities as far apart as
/// they count. The twin checks every number.
#[test]
fn the_largest_sums_fit() {
    let size = (40, 40);
    let flat = Image::from_rgb8(&Plane::filled(size.0, size.1, [90; 3]));
    let pair = Pair::new(flat.clone(), flat).unwrap();
    let mut method = Method::default();
    (method.refinement.median_window, method.refinement.median) = (31, Median::All);
    (method.refinement.median_sigma_space, method.refinement.median_sigma_range) = (100.0, 10.0);
    let plan = random::plan(size, 0, 64, &method);
    let mut random = Random::new(3);
    let far = |x: usize, middle: usize| (x as i32 - middle as i32).signum();
    for reach in [3, 130, 250, 510, 1000, 1023, 1024, 5000] {
        let shapes: [&dyn Fn(usize, usize, u32) -> i32; 6] = [
            &|x, _, _| far(x, 20),
            &|_, y, _| -far(y, 20),
            &|x, y, _| far(x + y, 40),
            &|x, y, _| far(x, y),
            &|x, y, _| i32::from(x < 3 || y < 3),
            &|_, _, any| any as i32 - 1,
        ];
        for shape in shapes {
            let mut maps = Finest::zero(size);
            maps.disparity =
                Plane::from_fn(size.0, size.1, |x, y| 8000 + reach * shape(x, y, random.within(0, 2)));
            let mut expected = maps.clone();
            twin::plane::plane(&plan, &pair, &mut expected);
            for (name, mut backend) in backends() {
                backend.prepare(&plan, Prepared::new(&pair)).unwrap();
                maps.write(backend.as_mut());
                backend.run(Stage::Plane).unwrap();
                let disparity = pollster::block_on(backend.map(Map::Disparity)).unwrap();
                assert!(disparity == expected.disparity, "{name}, {reach}");
            }
        }
    }
}

/// A slanted surface quantized to whole labels becomes smooth again.
#[test]
fn a_staircase_becomes_a_slope() {
    let size = (60, 30);
    let flat = Image::from_rgb8(&Plane::filled(size.0, size.1, [90; 3]));
    let pair = Pair::new(flat.clone(), flat).unwrap();
    let plan = random::plan(size, 0, 30, &Method::default());
    let exact = |x: usize| 512 + 64 * x as i32;
    let mut maps = Finest::zero(size);
    maps.disparity = Plane::from_fn(size.0, size.1, |x, _| (exact(x) + 128) & !255);
    for (name, mut backend) in backends() {
        let mut error = |stage| {
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            maps.write(backend.as_mut());
            backend.run(stage).unwrap();
            let disparity = pollster::block_on(backend.map(Map::Disparity)).unwrap();
            (8..52).map(|x| (disparity[(x, 15)] - exact(x)).abs()).max().unwrap()
        };
        let (median, plane) = (error(Stage::Median), error(Stage::Plane));
        assert!(median > 100 && plane < 40, "{name}: {median} and {plane} / 256 px off");
    }
}
