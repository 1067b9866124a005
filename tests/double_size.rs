//! Matching at twice the size as well: the merged maps equal a naive twin's on both backends, and have the documented properties.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::devices;
use mrfgs::image::{Image, Pair, Plane, grey, read};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::{Maps, flag, has_disparity};
use mrfgs::options::{DisparityRange, Fill, LeftRightCheck, MatchSize};
use mrfgs::{Error, Matcher, Method};
use std::path::{Path, PathBuf};

const RANGE: DisparityRange = DisparityRange { min: 0, max: 31 };

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

/// A part of a rendered scene whose width and height are odd.
fn scene(name: &str) -> Pair {
    let pair = Pair::open(folder(name).join("im0.png"), folder(name).join("im1.png")).unwrap();
    pair.crop(&mrfgs::image::Rect { x: 20..187, y: 30..121 })
}

fn matched(pair: &Pair, range: DisparityRange, method: &Method) -> Maps {
    Matcher::builder().device("cpu").build().unwrap().job(pair, range).method(method).run().unwrap().maps
}

/// `accurate`, with the map of the right view.
fn accurate() -> Method {
    let mut method = Method::accurate();
    method.refinement.right_map = true;
    method
}

/// The methods for the pair at its own size and at twice its size.
fn both(method: &Method) -> [Method; 2] {
    let mut own = method.clone();
    own.schedule.match_size = MatchSize::Full;
    let mut double = own.clone();
    for key in ["level-rows", "equal-sharpness", "denoise"] {
        double.set(key, "false").unwrap();
    }
    double.set("median-window", "31").unwrap();
    double.set("median-sigma-space", "11.5").unwrap();
    [own, double]
}

/// A view of 8-bit levels at twice its size.
fn doubled(image: &Image) -> Image {
    let (width, height) = image.pixels.size();
    // Interpolates values of one channel along a line to twice as many positions.
    let line = |values: &[i32]| -> Vec<i32> {
        let at = |i: i32| values[i.clamp(0, values.len() as i32 - 1) as usize];
        let sum = |taps: [i32; 4]| {
            let sum: i32 = taps.iter().zip([-1728, 14_400, 4288, -576]).map(|(v, weight)| v * weight).sum();
            ((sum + 8192) >> 14).clamp(0, 65_535)
        };
        let places = 0..values.len() as i32;
        places
            .flat_map(|i| {
                [sum([at(i + 1), at(i), at(i - 1), at(i - 2)]), sum([at(i - 1), at(i), at(i + 1), at(i + 2)])]
            })
            .collect()
    };
    let channels: Vec<Plane<i32>> = (0..3)
        .map(|c| {
            let columns: Vec<Vec<i32>> = (0..width)
                .map(|x| {
                    let column: Vec<i32> = (0..height).map(|y| i32::from(image.pixels[(x, y)][c])).collect();
                    line(&column)
                })
                .collect();
            let rows: Vec<i32> = (0..2 * height)
                .flat_map(|y| line(&columns.iter().map(|column| column[y]).collect::<Vec<_>>()))
                .collect();
            Plane::new(2 * width, 2 * height, rows)
        })
        .collect();
    let pixels = Plane::from_fn(2 * width, 2 * height, |x, y| {
        let level = |c: usize| ((channels[c][(x, y)] + 128).min(65_535) / 256 * 256) as u16;
        [level(0), level(1), level(2), grey(level(0), level(1), level(2))]
    });
    Image { pixels, masked: Plane::filled(2 * width, 2 * height, false) }
}

/// Merges one pixel: its disparity and validity, and whether they come from twice the size.
fn joined(own: (i32, u8), four: [(i32, u8); 4]) -> (i32, u8, bool) {
    let mut values = four.map(|(d, _)| f64::from(d) / 2.0);
    values.sort_by(f64::total_cmp);
    let m = f64::midpoint(values[1], values[2]);
    let rounded = |v: f64| (v + 0.5).floor() as i32;
    if own.1 & flag::INVALID != 0 && four.iter().all(|(_, bits)| bits & flag::INVALID == 0) {
        return (rounded(m), four.iter().fold(0, |all, (_, bits)| all | bits), true);
    }
    let known = has_disparity(own.1) && four.iter().all(|(_, bits)| has_disparity(*bits));
    if known && (f64::from(own.0) - m).abs() <= 256.0 {
        return (rounded(f64::midpoint(f64::from(own.0), m)), own.1, false);
    }
    (own.0, own.1, false)
}

/// The merged maps, and the number of pixels that come from twice the size.
fn twin(own: &Maps, double: &Maps) -> (Maps, usize) {
    let (width, height) = own.disparity.size();
    let mut maps = own.clone();
    let mut taken = 0;
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let places = [(2 * x, 2 * y), (2 * x + 1, 2 * y), (2 * x, 2 * y + 1), (2 * x + 1, 2 * y + 1)];
        let four = places.map(|at| (double.disparity[at], double.validity[at]));
        let (disparity, validity, took) = joined((own.disparity[(x, y)], own.validity[(x, y)]), four);
        (maps.disparity[(x, y)], maps.validity[(x, y)]) = (disparity, validity);
        if took {
            taken += 1;
            maps.confidence[(x, y)] = places.map(|at| double.confidence[at]).into_iter().min().unwrap();
        }
        if let (Some(right), Some(double)) = (&mut maps.right, &double.right) {
            let four = places.map(|at| (double.disparity[at], double.validity[at]));
            let (disparity, validity, _) = joined((right.disparity[(x, y)], right.validity[(x, y)]), four);
            (right.disparity[(x, y)], right.validity[(x, y)]) = (disparity, validity);
        }
    }
    (maps, taken)
}

#[test]
fn both_sizes_are_merged() {
    let pair = scene("slanted");
    let larger = Pair::new(doubled(pair.left()), doubled(pair.right())).unwrap();
    for (fill, check) in [
        (Fill::Votes, LeftRightCheck::RightView),
        (Fill::None, LeftRightCheck::RightView),
        (Fill::Row, LeftRightCheck::SecondMatch),
    ] {
        let mut method = accurate();
        method.refinement.fill = fill;
        method.refinement.left_right_check = check;
        let [own, double] = both(&method);
        let own = matched(&pair, RANGE, &own);
        let double = matched(&larger, DisparityRange { min: 0, max: 62 }, &double);
        let found = matched(&pair, RANGE, &method);
        let (expected, taken) = twin(&own, &double);
        assert!(found == expected, "{fill:?}, {check:?}");
        // Control: each case of the definition occurs.
        let changed = own.disparity.data().iter().zip(found.disparity.data()).filter(|(a, b)| a != b).count();
        assert!(taken > 10 && changed > 1000, "{fill:?}, {check:?}: {taken} taken, {changed} changed");
        assert!(found.right != own.right && found.confidence != own.confidence, "{fill:?}, {check:?}");
        assert_eq!(found.raw, own.raw);
    }
}

#[test]
fn devices_agree() {
    let Some(gpu) = devices::open(FaultInjection::default()) else { return };
    let mut matcher = Matcher::on(Ok(gpu), false, &mrfgs::options::Execution::default()).unwrap();
    for name in ["slanted", "rows"] {
        let pair = scene(name);
        let method = accurate();
        let expected = matched(&pair, RANGE, &method);
        // In sequence, and alone below.
        let pairs = [(pair.clone(), RANGE), (pair.clone(), RANGE)];
        matcher.set_method(method.clone());
        let mut count = 0;
        matcher
            .run_all(pairs, |found| {
                assert!(found.maps == expected, "{name}: {} differs", found.ran_on);
                count += 1;
                std::ops::ControlFlow::Continue(())
            })
            .unwrap();
        assert_eq!(count, 2);
        // Control: a match at its own size alone gives another map.
        let [own, _] = both(&method);
        assert!(matcher.job(&pair, RANGE).method(&own).run().unwrap().maps != expected, "{name}");
    }
}

/// A device keeps the buffers of both sizes between matches, as far as the memory of the method allows.
#[test]
fn both_sizes_stay_on_the_device() {
    let pair = scene("slanted");
    let [own, _] = both(&accurate());
    let held = |methods: &[&Method]| {
        let gpu = devices::open(FaultInjection::default())?;
        let mut matcher = Matcher::on(Ok(gpu), false, &mrfgs::options::Execution::default()).unwrap();
        let held = |method: &&Method| {
            let found = matcher.job(&pair, RANGE).method(method).run().unwrap();
            found.traffic.bytes_held
        };
        Some(methods.iter().map(held).collect::<Vec<_>>())
    };
    let Some(alone) = held(&[&own, &own]) else { return };
    let mut all = accurate();
    let both = held(&[&all, &all]).unwrap();
    assert!(both[0] > 4 * alone[0], "{both:?}, {alone:?}");
    assert_eq!(both[0], both[1]);
    // Control: the memory of the larger size is not enough for both.
    let memory = (both[0] - alone[0] / 2) >> 20;
    all.set("memory", &memory.to_string()).unwrap();
    let larger = held(&[&all, &all]).unwrap();
    assert!(larger[1] < both[0] && larger[1] <= memory << 20, "{larger:?} of {memory} MiB, {both:?}");
}

/// Faults of a pair are corrected once, before it is enlarged.
#[test]
fn the_larger_pair_is_conditioned() {
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    for (name, key) in [("rows", "level-rows"), ("focus", "equal-sharpness"), ("grain", "denoise")] {
        let pair = Pair::open(folder(name).join("im0.png"), folder(name).join("im1.png")).unwrap();
        let truth = read::read_disparity(&folder(name).join("disp0GT.pfm")).unwrap();
        let mut error = |correct: &str| {
            let mut method = Method::accurate();
            method.set(key, correct).unwrap();
            let map = matcher.job(&pair, RANGE).method(&method).run().unwrap().disparity();
            let errors = map.data().iter().zip(truth.data()).map(|(d, t)| f64::from((d - t).abs()));
            errors.sum::<f64>() / truth.data().len() as f64
        };
        let (with, without) = (error("true"), error("false"));
        println!("{name}: {with:.3} px, {without:.3} without {key}");
        assert!(with < 0.95 * without, "{name}: {with} and {without}");
    }
}

#[test]
fn masked_pixels_stay_masked() {
    let pair = scene("slanted");
    let mut left = pair.left().clone();
    for (x, y) in [(40, 40), (41, 40), (90, 11)] {
        left.masked[(x, y)] = true;
    }
    let with = |hidden: u16| {
        let mut left = left.clone();
        for (x, y) in [(40, 40), (41, 40), (90, 11)] {
            left.pixels[(x, y)] = [hidden; 4];
        }
        matched(&Pair::new(left, pair.right().clone()).unwrap(), RANGE, &accurate())
    };
    let maps = with(0);
    assert!(maps == with(65_280), "what is masked has no influence");
    assert!(maps.validity.data().iter().filter(|bits| **bits & flag::MASKED != 0).count() == 3);
    assert!(!has_disparity(maps.validity[(40, 40)]) && has_disparity(maps.validity[(42, 40)]));
}

/// Progress goes from 0 to 1 over both sizes, and a pair that is cut into tiles is enlarged too.
#[test]
fn progress_and_tiles() {
    let pair = scene("slanted");
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let mut run = |memory: u32| {
        let mut method = Method::accurate();
        method.tiles.memory = memory;
        let mut done = Vec::new();
        let mut tiles = 1;
        let job = matcher.job(&pair, RANGE).method(&method).on_progress(|p| {
            done.push(p.done);
            tiles = tiles.max(p.tile.map_or(1, |(_, count)| count));
        });
        let maps = job.run().unwrap().maps;
        assert!(done.is_sorted() && done[0] == 0.0 && *done.last().unwrap() > 0.9, "{done:?}");
        (maps, tiles)
    };
    let (whole, one) = run(4096);
    let (tiled, some) = run(20);
    assert!(one == 1 && some > 1, "{one} and {some} tiles");
    let off =
        whole.disparity.data().iter().zip(tiled.disparity.data()).filter(|(a, b)| a.abs_diff(**b) > 256);
    assert!(off.count() * 100 < whole.disparity.data().len());
}

#[test]
fn ranges_that_cannot_be_doubled_are_refused_before_anything_runs() {
    let range = DisparityRange { min: -4000, max: 5000 };
    let plan = Plan::new(20_000, 4, range, &Method::accurate()).unwrap();
    assert_eq!(Plan::new(20_000, 4, range, &Method::default()).unwrap().doubled().unwrap(), None);
    let pair = Pair::new(
        Image::from_rgb8(&Plane::filled(20_000, 4, [9; 3])),
        Image::from_rgb8(&Plane::filled(20_000, 4, [9; 3])),
    );
    let mut begun = 0;
    let observer = &mut |_| {
        begun += 1;
        std::ops::ControlFlow::Continue(())
    };
    let (mut cpu, pair) = (Cpu::default(), pair.unwrap());
    let solved = common::solve(&mut cpu, &plan, &pair, observer);
    let Err(Error::Range(error)) = solved else { panic!("it is refused") };
    assert_eq!(error.to_string(), "-4000 to 5000 are 9001 disparities, but at most 8192 can be searched");
    assert_eq!(begun, 0);
}
