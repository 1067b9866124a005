//! Regions of the left view: nearly the maps of the whole pair, the same on every device, at the cost of the region.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use mrfgs::image::{Image, Pair, Plane, Rect};
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Execution, Method};
use mrfgs::region::Region;
use mrfgs::{Error, Matcher};
use std::path::Path;

const RANGE: DisparityRange = DisparityRange { min: 0, max: 31 };

fn scene(name: &str) -> Pair {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name);
    Pair::open(folder.join("im0.png"), folder.join("im1.png")).unwrap()
}

fn cpu() -> Matcher {
    Matcher::builder().device("cpu").build().unwrap()
}

fn part_of(pair: &Pair, part: &Rect, method: &Method) -> Maps {
    cpu().job(pair, RANGE).method(method).region(part.clone()).run().unwrap().maps
}

/// The percentage of pixels that differ by more than 1 px.
fn moved(some: &Plane<f32>, others: &Plane<f32>) -> f64 {
    assert_eq!(some.size(), others.size());
    let pixels = some.data().iter().zip(others.data());
    let moved = pixels.filter(|(a, b)| a.is_finite() != b.is_finite() || (**a - **b).abs() > 1.0).count();
    100.0 * moved as f64 / some.data().len() as f64
}

#[test]
fn a_region_is_nearly_a_part_of_the_whole() {
    let part = Rect { x: 83..171, y: 41..120 };
    for name in ["slanted", "steep", "thin", "mixed"] {
        for method in [Method::default(), Method::fast()] {
            let pair = scene(name);
            let whole = cpu().job(&pair, RANGE).method(&method).run().unwrap().maps;
            let found = part_of(&pair, &part, &method);
            let off = moved(&found.final_map(), &whole.crop(&part).final_map());
            assert!(off <= 2.5, "{name}: {off} %");
            // Control: the pair cropped to the region gives a different map.
            let alone = cpu().job(&pair.crop(&part), RANGE).method(&method).run().unwrap().maps;
            let off_alone = moved(&alone.final_map(), &whole.crop(&part).final_map());
            assert!(off_alone > 4.0 * off && off_alone > 4.0, "{name}: {off_alone} % and {off} %");
        }
    }
    // The region of the whole image gives the same bits as the pair.
    let pair = scene("slanted");
    let whole = cpu().run(&pair, RANGE).unwrap().maps;
    assert!(part_of(&pair, &Rect::whole(pair.size()), &Method::default()) == whole);
}

/// Pixels outside the window of a region have no influence.
#[test]
fn pixels_outside_have_no_influence() {
    let (pair, part) = (scene("slanted"), Rect { x: 130..190, y: 100..140 });
    let found = part_of(&pair, &part, &Method::default());
    let without = |image: &Image, x: usize, y: usize| {
        let mut image = image.clone();
        for (px, py) in (0..x).flat_map(|px| (0..y).map(move |py| (px, py))) {
            image.pixels[(px, py)] = [0; 4];
        }
        image
    };
    let changed = |x, y| Pair::new(without(pair.left(), x, y), without(pair.right(), x, y)).unwrap();
    assert!(part_of(&changed(64, 64), &part, &Method::default()) == found);
    // Control: pixels inside the window do have influence.
    assert!(part_of(&changed(120, 130), &part, &Method::default()) != found);
}

#[test]
fn devices_agree_on_regions() {
    let Some(gpu) = devices::open(FaultInjection::default()) else { return };
    let mut matcher = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
    let pair = scene("thin");
    for method in [Method::default(), Method::fast()] {
        for part in
            [Rect { x: 3..4, y: 9..10 }, Rect { x: 51..120, y: 30..101 }, Rect { x: 200..240, y: 0..180 }]
        {
            let found = matcher.job(&pair, RANGE).method(&method).region(part.clone()).run().unwrap();
            assert!(found.maps == part_of(&pair, &part, &method), "{part:?}: {} differs", found.ran_on);
        }
    }
}

#[test]
fn regions_have_their_size_and_lie_inside() {
    let pair = scene("slanted");
    let mut out = vec![0.0; 12];
    let part = Rect { x: 100..104, y: 50..53 };
    let matched = cpu().job(&pair, RANGE).region(part.clone()).run_into(&mut out).unwrap();
    assert_eq!(matched.disparity().data(), out);
    let outside = Rect { x: 100..500, y: 50..53 };
    let error = cpu().job(&pair, RANGE).region(outside.clone()).run().unwrap_err();
    assert!(matches!(&error, Error::Mismatch(reason) if reason.contains("100 to 500")), "{error}");
    assert!(Region::new(outside, pair.size(), RANGE).is_err());
    // An automatic range is that of the whole pair.
    let found = cpu().job(&pair, ..).region(part).run().unwrap();
    assert!(found.range_found && found.maps.disparity.size() == (4, 3));
}
