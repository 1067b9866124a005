//! Pairs matched at half size: devices agree for every shape, range and mask, and the full-size maps keep their invariants.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::devices;
use mrfgs::image::{Image, Pair, Plane, Rect, read};
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::low_level::program::together::streamed;
use mrfgs::maps::{FRACTION, Maps, flag, has_disparity};
use mrfgs::options::{DisparityRange, Execution, Fill, LeftRightCheck, MatchSize, Median};
use mrfgs::{Matcher, Method};
use std::path::{Path, PathBuf};

const RANGE: DisparityRange = DisparityRange { min: 0, max: 31 };

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

fn scene(name: &str) -> Pair {
    Pair::open(folder(name).join("im0.png"), folder(name).join("im1.png")).unwrap()
}

/// A crop of a rendered scene with odd width and height.
fn odd(name: &str) -> Pair {
    scene(name).crop(&Rect { x: 20..187, y: 30..121 })
}

fn matched(pair: &Pair, range: DisparityRange, method: &Method) -> Maps {
    Matcher::builder().device("cpu").build().unwrap().job(pair, range).method(method).run().unwrap().maps
}

/// The preset `fast`, with the map of the right view.
fn half() -> Method {
    let mut method = Method::fast();
    method.refinement.right_map = true;
    assert_eq!(method.schedule.match_size, MatchSize::Half);
    method
}

/// Checks that a device matches each pair, twice in sequence, as the CPU path does.
fn agree<'a>(cases: impl IntoIterator<Item = (&'a str, Pair, DisparityRange, Method)>) {
    let Some(gpu) = devices::open(FaultInjection::default()) else { return };
    let mut matcher = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
    for (name, pair, range, method) in cases {
        let expected = matched(&pair, range, &method);
        assert_eq!(expected.disparity.size(), pair.size(), "{name}");
        assert_eq!(expected.right.as_ref().unwrap().disparity.size(), pair.size(), "{name}");
        matcher.set_method(method);
        let mut count = 0;
        let pairs = [(pair.clone(), range), (pair, range)];
        matcher
            .run_all(pairs, |found| {
                assert!(found.maps == expected, "{name}: {} differs", found.ran_on);
                count += 1;
                std::ops::ControlFlow::Continue(())
            })
            .unwrap();
        assert_eq!(count, 2);
    }
}

#[test]
fn devices_agree() {
    let with = |change: fn(&mut Method)| {
        let mut method = half();
        change(&mut method);
        method
    };
    let mut masked = odd("slanted").left().clone();
    for (x, y) in (30..60).flat_map(|x| (20..47).map(move |y| (x, y))).chain([(3, 3), (90, 80), (166, 90)]) {
        masked.masked[(x, y)] = true;
    }
    let masked = Pair::new(masked, odd("slanted").right().clone()).unwrap();
    agree([
        ("plain", odd("slanted"), RANGE, half()),
        ("rows", odd("rows"), RANGE, half()),
        ("masked", masked, RANGE, half()),
        ("negative", odd("thin"), DisparityRange { min: -9, max: 20 }, half()),
        ("few labels", odd("thin"), DisparityRange { min: 3, max: 9 }, half()),
        ("one label", odd("thin"), DisparityRange { min: 7, max: 7 }, half()),
        ("no fill", odd("thin"), RANGE, with(|m| m.refinement.fill = Fill::None)),
        (
            "second match",
            odd("thin"),
            RANGE,
            with(|m| m.refinement.left_right_check = LeftRightCheck::SecondMatch),
        ),
        ("zones", odd("thin"), RANGE, with(|m| m.front.zone_sigmas = 1.0)),
        ("sad", odd("thin"), RANGE, with(|m| m.cost.matching = mrfgs::options::MatchingCost::Sad)),
    ]);
    // Control: matching at full size gives a different map.
    let mut full = half();
    full.schedule.match_size = MatchSize::Full;
    assert!(matched(&odd("slanted"), RANGE, &full) != matched(&odd("slanted"), RANGE, &half()));
}

#[test]
fn every_shape_has_maps_of_its_size() {
    let pair = scene("mixed");
    let sizes = [(1, 1), (2, 1), (1, 40), (90, 1), (2, 2), (3, 3), (64, 2), (41, 33)];
    agree(sizes.map(|(width, height)| {
        let part = pair.crop(&Rect { x: 100..100 + width, y: 50..50 + height });
        ("shape", part, DisparityRange { min: -3, max: 20 }, half())
    }));
}

/// The right map equals the map of the mirrored pair if no step reads runners-up, which are unknown for the right view.
#[test]
fn the_right_map_is_that_of_the_mirrored_pair() {
    let pair = scene("slanted").crop(&Rect { x: 20..188, y: 30..121 });
    let mut method = half();
    let refinement = &mut method.refinement;
    (refinement.speckle_size, refinement.fill, refinement.median) = (0, Fill::None, Median::Off);
    refinement.left_right_check = LeftRightCheck::SecondMatch;
    let right = matched(&pair, RANGE, &method).right.unwrap();
    let mirrored = matched(&pair.mirrored(), RANGE, &method);
    let known = |validity: &u8| validity & !flag::LOW_CONFIDENCE;
    assert_eq!(right.validity.map(known), mirrored.validity.mirrored().map(known));
    assert!(right.disparity == mirrored.disparity.mirrored());
    // Control: the left view has a different map.
    assert!(right.disparity != matched(&pair, RANGE, &method).disparity);
}

#[test]
fn masked_pixels_stay_masked() {
    let pair = odd("slanted");
    let hidden = [(40, 40), (41, 40), (91, 11), (166, 90)];
    let with = |value: u16| {
        let mut left = pair.left().clone();
        for at in hidden {
            (left.masked[at], left.pixels[at]) = (true, [value; 4]);
        }
        matched(&Pair::new(left, pair.right().clone()).unwrap(), RANGE, &half())
    };
    let maps = with(0);
    assert!(maps == with(65_280), "what is masked has no influence");
    let masked = |at: &(usize, usize)| maps.validity[*at] == flag::MASKED;
    assert!(hidden.iter().all(masked));
    assert_eq!(maps.validity.data().iter().filter(|bits| **bits & flag::MASKED != 0).count(), 4);
    assert!(has_disparity(maps.validity[(42, 40)]) && has_disparity(maps.validity[(40, 41)]));
}

#[test]
fn identical_views_have_no_disparity() {
    let left = odd("mixed").left().clone();
    let maps = matched(&Pair::new(left.clone(), left).unwrap(), DisparityRange { min: -4, max: 12 }, &half());
    let off = maps.disparity.data().iter().filter(|d| d.abs() > FRACTION / 4).count();
    assert!(off * 500 < maps.disparity.data().len(), "{off}");
}

/// Mean error in px, and the percentage of pixels with an error above 2 px.
fn errors(name: &str, maps: &Maps) -> [f64; 2] {
    let truth = read::read_disparity(&folder(name).join("disp0GT.pfm")).unwrap();
    let found = maps.final_map();
    let errors = found.data().iter().zip(truth.data()).filter(|(_, t)| t.is_finite());
    let errors: Vec<f64> = errors.map(|(d, t)| f64::from((d - t).abs())).collect();
    let count = errors.len() as f64;
    [errors.iter().sum::<f64>() / count, 100.0 * errors.iter().filter(|e| **e > 2.0).count() as f64 / count]
}

/// Thin objects, slanted surfaces and depth steps survive matching at half size.
#[test]
fn scenes_stay_within_their_floors() {
    for (name, most) in
        [("thin", [0.9, 11.5]), ("slanted", [0.24, 1.5]), ("mixed", [0.48, 4.6]), ("steep", [0.58, 5.8])]
    {
        let pair = scene(name);
        let found = errors(name, &matched(&pair, DisparityRange { min: 0, max: 47 }, &half()));
        println!("{name}: {:.3} px, {:.2} %", found[0], found[1]);
        assert!(found[0] < most[0] && found[1] < most[1], "{name}: {found:?}");
    }
}

/// Progress goes from 0 to 1, and tiling changes few pixels.
#[test]
fn progress_and_tiles() {
    // Eight scenes stacked vertically are large enough for tiles.
    let stacked = |image: &Image| {
        let (width, height) = image.pixels.size();
        let pixels = Plane::from_fn(width, 8 * height, |x, y| image.pixels[(x, y % height)]);
        Image { pixels, masked: Plane::filled(width, 8 * height, false) }
    };
    let one = scene("slanted");
    let pair = Pair::new(stacked(one.left()), stacked(one.right())).unwrap();
    // With many labels, volumes take more memory than maps.
    let wide = DisparityRange { min: 0, max: 255 };
    let plan = streamed(&Plan::new(pair.size().0, pair.size().1, wide, &half()).unwrap());
    let cpu = || Matcher::builder().device("cpu").build().unwrap();
    let run = |mut matcher: Matcher, memory: u32| {
        let mut method = half();
        method.tiles.memory = memory;
        let (mut done, mut tiles) = (Vec::new(), 1);
        let job = matcher.job(&pair, wide).method(&method).on_progress(|p| {
            done.push(p.done);
            tiles = tiles.max(p.tile.map_or(1, |(_, count)| count));
        });
        let maps = job.run().unwrap().maps;
        assert!(done.is_sorted() && done[0] == 0.0 && *done.last().unwrap() > 0.9, "{done:?}");
        (maps, tiles)
    };
    let few = (plan.bytes() >> 20) as u32 * 3 / 4;
    let (whole, one) = run(cpu(), 4096);
    let (tiled, some) = run(cpu(), few);
    assert!(one == 1 && some > 1, "{one} and {some} tiles");
    if let Some(gpu) = devices::open(FaultInjection::default()) {
        let (found, count) = run(Matcher::on(Ok(gpu), false, &Execution::default()).unwrap(), few);
        assert!(found == tiled && count == some, "devices agree on tiles");
    }
    let far = |(a, b): &(&i32, &i32)| a.abs_diff(**b) > 256;
    let off = |a: &Plane<i32>, b: &Plane<i32>| a.data().iter().zip(b.data()).filter(far).count();
    assert!(off(&whole.disparity, &tiled.disparity) * 100 < whole.disparity.data().len());
    let right = |maps: &Maps| maps.right.as_ref().unwrap().disparity.clone();
    assert!(off(&right(&whole), &right(&tiled)) * 100 < whole.disparity.data().len());
}

/// A plan states the size and range of the pair as well as those that are matched.
#[test]
fn plans_tell_both_sizes() {
    let range = DisparityRange::new(-3, 20).unwrap();
    let plan = Plan::new(167, 91, range, &half()).unwrap();
    assert_eq!((plan.size(), plan.range), ((84, 46), DisparityRange { min: -2, max: 10 }));
    assert_eq!((plan.of_pair().size, plan.of_pair().range), ((167, 91), range));
    assert_eq!(Tiles::new(&plan).unwrap().count(), 1);
    let full = Plan::new(167, 91, range, &Method::default()).unwrap();
    assert_eq!((full.of_pair().size, full.size()), ((167, 91), (167, 91)));
    // Control: the plan counts the memory of full-size maps and images.
    let alone = Plan { full: None, ..plan.clone() };
    assert!(plan.map_bytes() > alone.map_bytes() && plan.pair_bytes() == 5 * alone.pair_bytes());
}
