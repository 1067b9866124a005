//! What follows the beliefs against its naive twins, the order of it all, and what must hold of whole matches.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::compare::compare_maps;
use common::devices::backends;
use common::random::{self, Random};
use common::twin;
use mrfgs::backend::{Estimate, NO_LABEL, Peak};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::options::{Choice, Cost, DisparityRange, Execution, Fill, Median, Method, Potential, Schedule};
use mrfgs::plan::Plan;
use mrfgs::refine::{self, MedianWeights, flag};
use mrfgs::solver::{self, Solution};
use mrfgs::{graph, match_pair};
use std::ops::ControlFlow;

const SIZES: &[(usize, usize)] = &[(1, 1), (1, 9), (13, 1), (2, 2), (17, 11), (24, 31)];

/// Runs `check` on every size with many seeds.
fn on_all(rounds: u64, check: impl Fn(&mut Random, usize, usize) -> Result<(), String>) {
    for &(width, height) in SIZES {
        for seed in 0..rounds {
            if let Err(e) = check(&mut Random::new(seed), width, height) {
                panic!("{width} x {height}, seed {seed}: {e}");
            }
        }
    }
}

#[test]
fn visibility() {
    on_all(20, |random, width, height| {
        for (min, labels) in [(-20, 40), (0, 4), (5, 3), (-1, 3)] {
            let estimate = random::estimate(random, width, height, labels);
            let (actual, expected) =
                (refine::visibility(&estimate, min), twin::visibility::visibility(&estimate, min));
            compare_maps("flags", &actual, &expected)?;
        }
        Ok(())
    });
}

#[test]
fn region_filter() {
    on_all(40, |random, width, height| {
        let disparity = random::disparity(random, width, height);
        let flags = random::flags(random, width, height, false);
        for size in [0, 1, 2, 3, 5, 20, 10_000] {
            let (mut actual, mut expected) = (flags.clone(), flags.clone());
            refine::region_filter(&disparity, &mut actual, size);
            twin::region::region_filter(&disparity, &mut expected, size);
            compare_maps("flags", &actual, &expected)?;
        }
        Ok(())
    });
}

#[test]
fn fill() {
    on_all(60, |random, width, height| {
        let disparity = random::disparity(random, width, height);
        let mut flags = random::flags(random, width, height, false);
        if random.one_in(3) {
            // Whole rows without a valid pixel.
            for y in 0..height {
                if random.one_in(2) {
                    for x in 0..width {
                        flags[(x, y)] = if random.one_in(3) { flag::MASKED } else { flag::OCCLUDED };
                    }
                }
            }
        }
        let (mut actual, mut expected) = ((disparity.clone(), flags.clone()), (disparity, flags));
        refine::fill(&mut actual.0, &mut actual.1);
        twin::fill::fill(&mut expected.0, &mut expected.1);
        compare_maps("disparity", &actual.0, &expected.0)?;
        compare_maps("flags", &actual.1, &expected.1)
    });
}

#[test]
fn confidence() {
    on_all(20, |random, width, height| {
        let estimate = random::estimate(random, width, height, 9);
        let flags = random::flags(random, width, height, false);
        for floor in [0, 1, 16, 17, 255] {
            let (mut actual, mut expected) = (flags.clone(), flags.clone());
            let (a, e) = (
                refine::confidence(&estimate.peaks, &mut actual, floor),
                twin::confidence::confidence(&estimate.peaks, &mut expected, floor),
            );
            compare_maps("confidence", &a, &e)?;
            compare_maps("flags", &actual, &expected)?;
        }
        Ok(())
    });
}

#[test]
fn median() {
    on_all(20, |random, width, height| {
        let disparity = random::disparity(random, width, height);
        let flags = random::flags(random, width, height, true);
        let guide = random::image(random, width, height);
        let (space, range) = (random.log_within(0.1, 100.0), random.log_within(0.001, 10.0));
        let window = random.pick(&[3, 5, 15, 31]);
        let weights = MedianWeights::new(window, space, range);
        let touches: [fn(u8) -> bool; 2] = [|_| true, |f| f & flag::FILLED != 0];
        for touch in touches {
            let actual = refine::weighted_median(&disparity, &flags, &guide, &weights, touch);
            let expected =
                twin::median::weighted_median(&disparity, &flags, &guide, (window, space, range), touch);
            compare_maps("disparity", &actual, &expected)?;
        }
        Ok(())
    });
}

#[test]
fn median_weights() {
    let mut random = Random::new(4);
    for _ in 0..300 {
        let (space, range) = (random.log_within(0.1, 100.0), random.log_within(0.001, 10.0));
        let weights = MedianWeights::new(31, space, range);
        for _ in 0..200 {
            let (dx, dy) = (random.within(0, 15), random.within(0, 15));
            let most = random.pick(&[100, 10_000, 3 * 4095 * 4095]);
            let distance = random.within(0, most);
            assert_eq!(
                i64::from(weights.weight(dx as usize, dy as usize, distance)),
                twin::median::weight(dx.into(), dy.into(), distance.into(), space, range),
                "({dx}, {dy}), {distance}; sigmas {space} and {range}"
            );
        }
    }
}

/// Maps without anything to go by: all masked, all given up, one pixel.
#[test]
fn nothing_valid() {
    for &(width, height) in SIZES {
        let mut random = Random::new(1);
        let guide = random::image(&mut random, width, height);
        let weights = MedianWeights::new(5, 3.0, 0.1);
        for all in [flag::MASKED, flag::OCCLUDED, flag::OUTSIDE | flag::LOW_CONFIDENCE, flag::SMALL_REGION] {
            let disparity = random::disparity(&mut random, width, height);
            let flags = Plane::filled(width, height, all);
            let mut after = (disparity.clone(), flags.clone());
            refine::region_filter(&after.0, &mut after.1, 100);
            refine::fill(&mut after.0, &mut after.1);
            after.0 = refine::weighted_median(&after.0, &after.1, &guide, &weights, |_| true);
            assert_eq!(after, (disparity, flags));
            let peaks = random::estimate(&mut random, width, height, 4).peaks;
            let confidence = refine::confidence(&peaks, &mut after.1, 255);
            assert!(confidence.data().iter().all(|&c| c == 0));
        }
    }
}

/// Negative control: every stage notices a parameter that is a little off, or a value that is.
#[test]
fn control_changes_are_found() {
    let mut random = Random::new(21);
    let (width, height) = (24, 31);
    let estimate = random::estimate(&mut random, width, height, 9);
    let (disparity, flags) = loop {
        let maps =
            (random::disparity(&mut random, width, height), random::flags(&mut random, width, height, true));
        let valid = maps.1.data().iter().filter(|&f| f & flag::INVALID == 0).count();
        if valid > 300 && valid < 600 {
            break maps;
        }
    };
    let guide = loop {
        let image = random::image(&mut random, width, height);
        if image.pixels[(0, 0)] != image.pixels[(1, 1)] {
            break image;
        }
    };

    let actual = refine::visibility(&estimate, 0);
    assert!(compare_maps("visibility", &actual, &twin::visibility::visibility(&estimate, 1)).is_err());

    let (mut actual, mut other) = (flags.clone(), flags.clone());
    refine::region_filter(&disparity, &mut actual, 3);
    twin::region::region_filter(&disparity, &mut other, 4);
    assert!(compare_maps("region", &actual, &other).is_err());

    let mut actual = (disparity.clone(), flags.clone());
    refine::fill(&mut actual.0, &mut actual.1);
    let mut other = (disparity.map(|d| -d), flags.clone());
    twin::fill::fill(&mut other.0, &mut other.1);
    // The smaller of two is not the larger.
    assert!(compare_maps("fill", &actual.0, &other.0.map(|d| -d)).is_err());

    let (mut actual, mut other) = (flags.clone(), flags.clone());
    refine::confidence(&estimate.peaks, &mut actual, 16);
    twin::confidence::confidence(&estimate.peaks, &mut other, 20);
    assert!(compare_maps("confidence", &actual, &other).is_err());

    let weights = MedianWeights::new(5, 3.0, 0.2);
    let actual = refine::weighted_median(&disparity, &flags, &guide, &weights, |_| true);
    for parameters in [(7, 3.0, 0.2), (5, 1.0, 0.2), (5, 3.0, 0.02)] {
        let other = twin::median::weighted_median(&disparity, &flags, &guide, parameters, |_| true);
        assert!(compare_maps("median", &actual, &other).is_err(), "{parameters:?}");
    }
}

/// The maps by the twins, from the estimate on, in the order in which the stages are described.
fn twin_refinement(estimate: &Estimate, plan: &Plan, pair: &Pair) -> Solution {
    let (method, min) = (&plan.method, plan.range.min);
    let (width, height) = pair.size();
    let whole = estimate.peaks.map(|peak| 256 * (min + i32::from(peak.label)));
    let mut raw = whole.clone();
    if method.sub_pixel {
        for (raw, &offset) in raw.data_mut().iter_mut().zip(estimate.offsets.data()) {
            *raw += i32::from(offset);
        }
    }
    let seen = twin::visibility::visibility(estimate, min);
    let mut validity = Plane::from_fn(width, height, |x, y| {
        if pair.left().masked[(x, y)] {
            flag::MASKED
        } else if method.visibility {
            seen[(x, y)]
        } else {
            0
        }
    });
    // Regions are those of whole labels.
    twin::region::region_filter(&whole, &mut validity, method.region_size as usize);
    let confidence = twin::confidence::confidence(&estimate.peaks, &mut validity, method.confidence_floor);
    let mut disparity = raw.clone();
    if method.fill == Fill::Row {
        twin::fill::fill(&mut disparity, &mut validity);
    }
    if method.median != Median::Off {
        let parameters =
            (method.median_window as usize, method.median_sigma_space, method.median_sigma_range);
        let all = method.median == Median::All;
        disparity = twin::median::weighted_median(&disparity, &validity, pair.left(), parameters, |f| {
            all || f & flag::FILLED != 0
        });
    }
    Solution { disparity, raw, confidence, validity, iterations: 0 }
}

fn compare_solutions(actual: &Solution, expected: &Solution) -> Result<(), String> {
    compare_maps("raw", &actual.raw, &expected.raw)?;
    compare_maps("validity", &actual.validity, &expected.validity)?;
    compare_maps("confidence", &actual.confidence, &expected.confidence)?;
    compare_maps("disparity", &actual.disparity, &expected.disparity)
}

/// The maps of every backend, and of the one call that users make.
fn solve(pair: &Pair, plan: &Plan) -> Vec<(String, Solution)> {
    let mut all: Vec<(String, Solution)> = backends()
        .into_iter()
        .map(|(name, mut backend)| {
            let solution =
                solver::solve(backend.as_mut(), plan, pair, &mut |_| ControlFlow::Continue(())).unwrap();
            (name, solution)
        })
        .collect();
    all.push(("match_pair".into(), matched(pair, plan, 2)));
    all
}

fn matched(pair: &Pair, plan: &Plan, threads: usize) -> Solution {
    let execution = Execution { backend: Choice::Cpu, threads: Some(threads), ..Execution::default() };
    let observer = &mut |_| ControlFlow::Continue(());
    match_pair(pair, plan.range, &plan.method, &execution, observer).unwrap().solution
}

#[test]
fn the_stages_run_in_order() {
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let size = random.pick(&[(1, 1), (1, 12), (15, 1), (23, 14), (30, 22)]);
        let labels = random.pick(&[1, 2, 9, 17]);
        let neighbours = random.pick(&[0, 2, 8]);
        let min = random.pick(&[-20, -3, 0, 5]);
        let plan = random::plan(size, min, labels, &random::method(&mut random, neighbours));
        let pair = random::pair(&mut random, size.0, size.1);
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
            backend.cost().unwrap();
            for z in 1..plan.levels.len() {
                backend.pyramid(z).unwrap();
            }
            for z in 0..plan.levels.len() {
                backend.evidence(z).unwrap();
            }
            let iterations = solver::flood(backend, &plan).unwrap();
            let expected = twin_refinement(&backend.estimate().unwrap(), &plan, &pair);
            for (solver, actual) in solve(&pair, &plan) {
                if let Err(e) = compare_solutions(&actual, &expected) {
                    panic!("{solver} against twins after {name}, seed {seed}: {e}\n{:?}", plan.method);
                }
                assert_eq!(actual.iterations, iterations);
            }
        }
    }
}

/// Noise in every pixel.
fn texture(random: &mut Random, width: usize, height: usize) -> Image {
    Image::from_rgb8(&Plane::from_fn(width, height, |_, _| [0; 3].map(|_: i32| random.within(0, 255) as u8)))
}

#[test]
fn identical_views_have_no_disparity() {
    for preset in ["default", "paper"] {
        let mut random = Random::new(9);
        let view = texture(&mut random, 47, 26);
        let pair = Pair::new(view.clone(), view).unwrap();
        for sub_pixel in [false, true] {
            let mut method = Method::preset(preset).unwrap();
            method.sub_pixel = sub_pixel;
            for (min, labels) in [(-3, 16), (0, 17), (-12, 13)] {
                let plan = random::plan((47, 26), min, labels, &method);
                for (name, solution) in solve(&pair, &plan) {
                    let most = if sub_pixel { 128 } else { 0 };
                    for map in [&solution.raw, &solution.disparity] {
                        let off = map.data().iter().filter(|d| d.abs() > most).count();
                        assert_eq!(off, 0, "{name}, {preset}, {min}: pixels that are not at 0");
                    }
                    let invalid = flag::INVALID;
                    assert!(solution.validity.data().iter().all(|f| f & invalid == 0), "{name}, {preset}");
                }
            }
        }
    }
}

/// When the right view moves by a whole pixel of the coarsest level, and the range with it, every level sees the same
/// costs under other names, but where a border or what lies beyond it comes in. How far a border reaches: the
/// window of the cost; the pyramid; in each iteration two radii of the graph at the coarsest level, and its
/// resolution factors; the right view; the median.
#[test]
fn a_shift_of_view_and_range_changes_nothing_inside() {
    let (width, height, levels, labels) = (420, 9, 3u32, 8);
    let shift = 1 << (levels - 1);
    for (cost, potential, schedule) in [
        (Cost::AdCensus, Potential::Soft, Schedule::CoarseFirst),
        (Cost::Sad, Potential::Hard, Schedule::Together),
        (Cost::AdCensus, Potential::Exact, Schedule::CoarseFirst),
    ] {
        let mut random = Random::new(31);
        let left = texture(&mut random, width, height);
        // Moved by 0 to 7, changing along the row, with some noise: neither certain nor hopeless.
        let moved = Plane::from_fn(width, height, |x, y| {
            let d = (x / 23 + y / 3) % labels;
            let [r, g, b, _] = left.pixels[((x + d).min(width - 1), y)];
            [r, g, b].map(|v| ((v >> 8) / 2 + random.within(0, 90) as u16) as u8)
        });
        let right = Image::from_rgb8(&moved);
        let further = Image::from_rgb8(&Plane::from_fn(width, height, |x, y| {
            if x + shift < width { moved[(x + shift, y)] } else { [200, 20, 2] }
        }));
        let mut method = Method::default();
        (method.cost, method.potential, method.schedule) = (cost, potential, schedule);
        (method.levels, method.iterations, method.final_iterations) = (levels, 1, 1);
        if cost == Cost::Sad {
            (method.outside_cost, method.temperature) = (20.0, 8.0);
        }
        // The region filter and the fill reach as far as they like.
        (method.region_size, method.fill, method.median_window) = (0, Fill::None, 5);
        let iterations = 3;
        let per_iteration = (2 * 3 + 2) * shift;
        let margin = 4 + 2 * shift + iterations * per_iteration + (labels + shift) + 2 + labels + shift;
        let near = random::plan((width, height), 0, labels, &method);
        let far = random::plan((width, height), shift as i32, labels, &method);
        let near_pair = Pair::new(left.clone(), right).unwrap();
        let far_pair = Pair::new(left, further).unwrap();
        let unshifted = solve(&near_pair, &near);
        for ((name, a), (_, b)) in unshifted.iter().zip(solve(&far_pair, &far)) {
            let (mut inside, mut elsewhere, mut distinct) = (0, 0, [false; 8]);
            for y in 0..height {
                for x in 0..width {
                    let at = (x, y);
                    let moved = shift as i32 * 256;
                    let same = b.raw[at] == a.raw[at] + moved
                        && a.validity[at] == b.validity[at]
                        && a.confidence[at] == b.confidence[at]
                        && b.disparity[at] == a.disparity[at] + moved;
                    if x >= margin && x < width - margin {
                        assert!(same, "{name}, {cost:?}: differs at x {x}, y {y}");
                        inside += 1;
                        distinct[((a.raw[at] + 128) >> 8).clamp(0, 7) as usize] = true;
                    } else if !same {
                        elsewhere += 1;
                    }
                }
            }
            assert!(inside >= 500, "{inside} pixels inside");
            // Control: borders do matter where they may, and the inside is no plain.
            assert!(
                elsewhere > 0 && distinct.iter().filter(|&&d| d).count() > 5,
                "{elsewhere}, {distinct:?}"
            );
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    for seed in 0..6 {
        let mut random = Random::new(seed);
        let mut method = random::method(&mut random, 4);
        (method.median, method.fill) = (Median::All, Fill::Row);
        let plan = random::plan((37, 23), -3, 17, &method);
        let pair = random::pair(&mut random, 37, 23);
        let one = matched(&pair, &plan, 1);
        for threads in [2, 3] {
            assert!(matched(&pair, &plan, threads) == one, "seed {seed}, {threads} threads");
        }
    }
}

/// The same image with other values where it is masked.
fn poisoned(random: &mut Random, image: &Image) -> Image {
    let mut pixels = image.pixels.clone();
    for (pixel, &masked) in pixels.data_mut().iter_mut().zip(image.masked.data()) {
        if masked {
            *pixel = [0; 4].map(|_: i32| {
                let bits = random.bits() as u16;
                random.pick(&[0, 65_535, bits])
            });
        }
    }
    Image { pixels, masked: image.masked.clone() }
}

#[test]
fn masked_values_are_never_looked_at() {
    let mut masked_pixels = 0;
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let mut method = random::method(&mut random, 8);
        (method.levels, method.median) = (4, Median::All);
        let plan = random::plan((29, 18), random.pick(&[-9, -3, 0]), 13, &method);
        let pair = random::pair(&mut random, 29, 18);
        let other =
            Pair::new(poisoned(&mut random, pair.left()), poisoned(&mut random, pair.right())).unwrap();
        masked_pixels += pair.left().masked.data().iter().filter(|&&m| m).count();
        for ((name, a), (_, b)) in solve(&pair, &plan).iter().zip(&solve(&other, &plan)) {
            if let Err(e) = compare_solutions(a, b) {
                panic!("{name}, seed {seed}: {e}\n{:?}", plan.method);
            }
            assert!(a == b);
        }
    }
    assert!(masked_pixels > 1000);
}

/// Negative control: values that are not masked do count.
#[test]
fn control_values_that_are_not_masked_are_looked_at() {
    let mut random = Random::new(2);
    let plan = random::plan((29, 18), 0, 13, &Method::default());
    let pair = Pair::new(texture(&mut random, 29, 18), texture(&mut random, 29, 18)).unwrap();
    let mut left = pair.left().clone();
    left.masked = Plane::from_fn(29, 18, |x, _| x % 4 == 1);
    let mut other = poisoned(&mut random, &left);
    left.masked = Plane::filled(29, 18, false);
    other.masked = left.masked.clone();
    let other = Pair::new(other, pair.right().clone()).unwrap();
    for ((_, a), (_, b)) in solve(&pair, &plan).iter().zip(&solve(&other, &plan)) {
        assert!(compare_solutions(a, b).is_err());
    }
}

#[test]
fn masks_and_single_pixels_pass_through() {
    for preset in ["default", "paper"] {
        let method = Method::preset(preset).unwrap();
        for &(width, height) in &[(1, 1), (1, 7), (9, 1), (12, 10)] {
            for (left_masked, right_masked) in [(true, true), (true, false), (false, true), (false, false)] {
                let mut random = Random::new(6);
                let mut left = texture(&mut random, width, height);
                let mut right = texture(&mut random, width, height);
                left.masked = Plane::filled(width, height, left_masked);
                right.masked = Plane::filled(width, height, right_masked);
                let plan = random::plan((width, height), -1, 4, &method);
                for (name, solution) in solve(&Pair::new(left, right).unwrap(), &plan) {
                    let masked = solution.validity.data().iter().filter(|&f| f & flag::MASKED != 0).count();
                    assert_eq!(masked, if left_masked { width * height } else { 0 }, "{name}, {preset}");
                    let known = solution.final_map().data().iter().any(|d| d.is_finite());
                    assert!(!(left_masked && known), "{name}, {preset}: a masked pixel has a disparity");
                    assert!(solution.raw_map().data().iter().all(|d| d.is_finite() != left_masked));
                }
            }
        }
    }
}

/// Negative control for the right view: where nothing projects, there is no label, and that is no agreement.
#[test]
fn no_label_agrees_with_none() {
    let peaks = Plane::filled(5, 1, Peak::default());
    let right = Plane::filled(5, 1, NO_LABEL);
    let flags = refine::visibility(&Estimate { peaks, offsets: Plane::filled(1, 1, 0), right }, 0);
    assert!(flags.data().iter().all(|&f| f == flag::OCCLUDED));
}

#[test]
fn a_plan_of_another_size_is_refused() {
    let mut random = Random::new(1);
    let pair = Pair::new(texture(&mut random, 8, 8), texture(&mut random, 8, 8)).unwrap();
    let range = DisparityRange::new(0, 3).unwrap();
    let plan = Plan::new(8, 9, range, &Method::default()).unwrap();
    for (_, mut backend) in backends() {
        let observer = &mut |_| ControlFlow::Continue(());
        assert!(solver::solve(backend.as_mut(), &plan, &pair, observer).is_err());
    }
}
