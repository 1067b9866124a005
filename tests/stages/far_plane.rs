//! Far planes.

use crate::common::compare::compare_finest;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use crate::plane::slanted;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{Fill, Method};

/// Slanted maps with mostly valid pixels; the others are filled unless masked.
fn filled(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = slanted(random, plan);
    let few = random.one_in(4);
    for validity in maps.validity.data_mut() {
        if !few && !random.one_in(3) {
            *validity &= i32::from(flag::MASKED);
        }
        if twin::fill::invalid(*validity) && *validity & i32::from(flag::MASKED) == 0 {
            *validity |= i32::from(flag::FILLED);
        }
    }
    maps
}

#[test]
fn far_plane() {
    let votes = |_: &mut Random, method: &mut Method| {
        (method.refinement.fill, method.refinement.plane) = (Fill::Votes, true);
    };
    on_maps(Stage::FarPlane, 30, votes, filled, twin::far_plane::far_plane);
}

const SIZE: (usize, usize) = (300, 120);

/// The result in 1/256 px for a slanted wall that is measured in its first 120 columns, and filled with 9 px elsewhere.
fn wall(image: &Image, measured: impl Fn(usize, usize) -> i32) -> Vec<(String, Plane<i32>)> {
    let plan = random::plan(SIZE, 0, 64, &Method::default());
    let pair = Pair::new(image.clone(), image.clone()).unwrap();
    let mut maps = Finest::zero(SIZE);
    maps.disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, y| if x < 120 { measured(x, y) } else { 9 * 256 });
    let flags = i32::from(flag::OCCLUDED | flag::FILLED);
    maps.validity = Plane::from_fn(SIZE.0, SIZE.1, |x, _| if x < 120 { 0 } else { flags });
    maps.confidence = Plane::from_fn(SIZE.0, SIZE.1, |x, _| if x < 120 { 60 } else { 0 });
    run(&plan, &pair, &maps)
}

/// The disparities of all backends, after a comparison with the twin.
fn run(plan: &Plan, pair: &Pair, maps: &Finest) -> Vec<(String, Plane<i32>)> {
    let mut expected = maps.clone();
    twin::far_plane::far_plane(plan, pair, &mut expected);
    let results = backends().into_iter().map(|(name, mut backend)| {
        let backend = backend.as_mut();
        backend.prepare(plan, Prepared::new(pair)).unwrap();
        maps.write(backend);
        backend.run(Stage::FarPlane).unwrap();
        compare_finest(backend, &expected).unwrap_or_else(|e| panic!("{name}: {e}"));
        let disparity = pollster::block_on(backend.map(Map::Disparity)).unwrap();
        (name, disparity)
    });
    results.collect()
}

fn slant(x: usize, y: usize) -> i32 {
    256 * 20 + 12 * x as i32 - 5 * y as i32
}

/// A wall continues as far as its colour, but not if the measured disparities form no plane.
#[test]
fn planes_continue_where_nothing_is_measured() {
    let plain = Image::from_rgb8(&Plane::filled(SIZE.0, SIZE.1, [90; 3]));
    for (name, disparity) in wall(&plain, slant) {
        for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
            let away = (disparity[(x, y)] - slant(x, y)).abs();
            assert!(away <= if x < 120 { 0 } else { 128 }, "{name}: {away} / 256 px off at {x}, {y}");
        }
    }
    let edge = |x: usize, _: usize| [if x < 200 { 90 } else { 200 }; 3];
    for (name, disparity) in wall(&Image::from_rgb8(&Plane::from_fn(SIZE.0, SIZE.1, edge)), slant) {
        assert!((disparity[(180, 100)] - slant(180, 100)).abs() <= 128, "{name}");
        assert_eq!(disparity[(210, 100)], 9 * 256, "{name}: behind an edge nothing is known");
    }
    let rough = |x: usize, y: usize| 256 * 20 + 2000 * ((x / 5 + y / 7) % 2) as i32;
    for (name, disparity) in wall(&plain, rough) {
        assert_eq!(disparity[(140, 100)], 9 * 256, "{name}: this is no plane");
    }
}

/// A measured wall; 6 x 6 pixels are 3 px off with this `confidence`, and one pixel is slightly off.
fn patched(confidence: i32) -> Finest {
    let mut maps = Finest::zero(SIZE);
    maps.disparity = Plane::from_fn(SIZE.0, SIZE.1, slant);
    maps.confidence = Plane::filled(SIZE.0, SIZE.1, 60);
    for at in (50..56).flat_map(|y| (80..86).map(move |x| (x, y))) {
        maps.disparity[at] += 3 * 256;
        maps.confidence[at] = confidence;
    }
    maps.disparity[(30, 30)] += 50;
    maps.confidence[(30, 30)] = confidence;
    maps
}

/// A doubtful patch takes the plane around it; a sure patch does not, nor does a pixel near the plane.
#[test]
fn planes_outvote_doubtful_patches() {
    let plan = random::plan(SIZE, 0, 64, &Method::default());
    let plain = Image::from_rgb8(&Plane::filled(SIZE.0, SIZE.1, [90; 3]));
    let pair = Pair::new(plain.clone(), plain).unwrap();
    for (confidence, outvoted) in [(0, true), (23, true), (24, false), (60, false)] {
        let maps = patched(confidence);
        let mut expected = maps.clone();
        twin::far_plane::far_plane(&plan, &pair, &mut expected);
        for (name, disparity) in run(&plan, &pair, &maps) {
            let away = (disparity[(82, 52)] - slant(82, 52)).abs();
            assert!(
                if outvoted { away <= 128 } else { away == 3 * 256 },
                "{name}: {away} / 256 px, {confidence}"
            );
            assert_eq!(disparity[(30, 30)], maps.disparity[(30, 30)], "{name}");
        }
        let state = |at: (usize, usize)| (expected.validity[at], expected.confidence[at]);
        let taken = (i32::from(flag::OUTVOTED | flag::FILLED), 0);
        assert_eq!(state((82, 52)), if outvoted { taken } else { (0, confidence) });
        assert_eq!(state((30, 30)), (0, confidence));
    }
}

/// Negative control: one missing or slightly wrong pixel is detected.
#[test]
fn control_one_wrong_pixel_is_found() {
    let size = (24, 16);
    let plan = random::plan(size, 0, 64, &Method::default());
    let flat = Image::from_rgb8(&Plane::filled(size.0, size.1, [90; 3]));
    let pair = Pair::new(flat.clone(), flat).unwrap();
    let mut maps = Finest::zero(size);
    maps.disparity = Plane::from_fn(size.0, size.1, slant);
    let filled = i32::from(flag::OCCLUDED | flag::FILLED);
    maps.validity = Plane::from_fn(size.0, size.1, |x, _| if x < 16 { 0 } else { filled });
    maps.confidence = Plane::filled(size.0, size.1, 60);
    let changed = |change: fn(&mut Finest)| {
        let mut other = maps.clone();
        change(&mut other);
        twin::far_plane::far_plane(&plan, &pair, &mut other);
        other.disparity
    };
    let less = changed(|maps| maps.validity[(12, 5)] = i32::from(flag::OCCLUDED));
    let off = changed(|maps| maps.disparity[(12, 5)] += 300);
    let doubted = changed(|maps| {
        maps.disparity[(12, 5)] += 300;
        maps.confidence[(12, 5)] = 23;
    });
    for (name, disparity) in run(&plan, &pair, &maps) {
        assert!(disparity[(12, 5)] + 300 == off[(12, 5)] && doubted[(12, 5)] != off[(12, 5)], "{name}");
        for other in [&less, &off] {
            let beyond = |x: usize, y: usize| disparity[(x, y)] != other[(x, y)];
            assert!((0..size.1).any(|y| (16..size.0).any(|x| beyond(x, y))), "{name}");
        }
    }
}

/// The largest disparities and weights fit in 32 bits: the twin, with 64 bits, gives the same.
#[test]
fn the_largest_moments_fit() {
    let size = (600, 12);
    let plan = random::plan(size, 0, 3000, &Method::default());
    let flat = Image::from_rgb8(&Plane::filled(size.0, size.1, [90; 3]));
    let pair = Pair::new(flat.clone(), flat).unwrap();
    let shapes: [&dyn Fn(usize, usize) -> i32; 5] = [
        &|x, _| 3000 * i32::from(x > 300),
        &|x, _| 5 * x as i32,
        &|x, y| 3000 - 2 * x as i32 - 30 * y as i32,
        &|x, y| 500 * ((x + y) % 7) as i32,
        &|x, _| 1500 + x as i32 / 8,
    ];
    for shape in shapes {
        let mut maps = Finest::zero(size);
        maps.disparity = Plane::from_fn(size.0, size.1, |x, y| 256 * shape(x, y));
        let flags = i32::from(flag::OCCLUDED | flag::FILLED);
        maps.validity = Plane::from_fn(size.0, size.1, |x, _| if x % 7 == 0 { flags } else { 0 });
        maps.confidence = Plane::filled(size.0, size.1, 255);
        run(&plan, &pair, &maps);
    }
}
