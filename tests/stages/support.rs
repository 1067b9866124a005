//! The support of each pixel.

use crate::common::compare::compare_finest;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::{on_maps, small_plan};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::Method;

/// Random maps with mostly similar disparities.
fn near(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, false);
    let most = random.pick(&[300, 520, 2000]);
    maps.disparity = maps.disparity.map(|_| random.within(0, most) as i32 - 200);
    for validity in maps.validity.data_mut() {
        *validity &= if random.one_in(4) { 255 } else { i32::from(flag::FILLED) };
    }
    maps
}

#[test]
fn support() {
    let floors = [0, 1, 16, 17, 255];
    let change =
        |random: &mut Random, method: &mut Method| method.refinement.confidence_floor = random.pick(&floors);
    on_maps(Stage::Support, 40, change, near, |plan, _, maps| twin::support::support(plan, maps));
}

const SIZE: (usize, usize) = (64, 40);

/// The support of each pixel, after comparing all backends with the twin.
fn supported(maps: &Finest) -> Plane<i32> {
    let mut random = Random::new(5);
    let pair = random::pair(&mut random, SIZE.0, SIZE.1);
    let plan = small_plan(&mut random, SIZE, |_| ());
    let mut expected = maps.clone();
    twin::support::support(&plan, &mut expected);
    for (name, mut backend) in backends() {
        let backend = backend.as_mut();
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        maps.write(backend);
        backend.run(Stage::Support).unwrap();
        compare_finest(backend, &expected).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    expected.confidence
}

/// On a smooth surface, confidence stays the same. A small deviating patch, pixels beside an edge, and pixels
/// beside filled ones lose some of it.
#[test]
fn isolated_disparities_lose_confidence() {
    let mut maps = Finest::zero(SIZE);
    maps.confidence = Plane::filled(SIZE.0, SIZE.1, 100);
    // A slope of a tenth of a pixel per pixel.
    maps.disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, y| 26 * (x + y) as i32);
    assert!(supported(&maps).data().iter().all(|&c| c == 100));

    let mut patch = maps.clone();
    patch.disparity[(30, 20)] += 800;
    let found = supported(&patch);
    assert_eq!((found[(30, 20)], found[(32, 20)], found[(31, 20)]), (4, 96, 100));

    let mut edge = maps.clone();
    edge.disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, _| if x < 30 { 0 } else { 900 });
    let found = supported(&edge);
    assert_eq!([25, 26, 28, 29, 30, 34].map(|x| found[(x, 20)]), [100, 80, 60, 60, 60, 100]);

    let mut filled = maps;
    for y in 0..SIZE.1 {
        (filled.confidence[(40, y)], filled.validity[(40, y)]) =
            (0, i32::from(flag::OCCLUDED | flag::FILLED));
    }
    let found = supported(&filled);
    assert_eq!([35, 36, 38, 40, 41].map(|x| found[(x, 20)]), [100, 80, 80, 0, 100]);
}
