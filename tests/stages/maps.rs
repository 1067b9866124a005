//! The stages that follow the beliefs.

use super::common::compare::compare_finest;
use super::common::devices::backends;
use super::common::random::{self, Random, texture};
use super::common::twin::{self, Finest};
use mrfgs::backend::Stage;
use mrfgs::graph;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::maps::flag;
use mrfgs::options::{Median, Method};
use mrfgs::plan::Plan;
use mrfgs::weights::MedianWeights;

const SIZES: &[(usize, usize)] = &[(1, 1), (1, 9), (13, 1), (2, 2), (17, 11), (24, 31), (150, 4)];

/// A stage by its definition.
type Twin = fn(&Plan, &Pair, &mut Finest);

/// A plan with one level and no neighbours for a method drawn anew.
fn small_plan(random: &mut Random, size: (usize, usize), change: impl Fn(&mut Method)) -> Plan {
    let mut method = random::method(random, 0);
    method.graph.levels = 1;
    change(&mut method);
    let labels = random.pick(&[1, 2, 3, 9, 40]);
    random::plan(size, random.pick(&[-20, -1, 0, 5]), labels, &method)
}

/// Runs `stage` on the maps that `input` makes, of every size with many seeds, and compares all maps with the twin's.
fn on_all(
    stage: Stage,
    rounds: u64,
    change: impl Fn(&mut Random, &mut Method),
    input: impl Fn(&mut Random, &Plan) -> Finest,
    twin: Twin,
) {
    let mut backends = backends();
    for &size in SIZES {
        for seed in 0..rounds {
            let mut random = Random::new(seed);
            let mut draw = Random::new(seed + 1000);
            let draw = std::cell::RefCell::new(&mut draw);
            let plan = small_plan(&mut random, size, |method| change(&mut draw.borrow_mut(), method));
            let pair = random::pair(&mut random, size.0, size.1);
            let maps = input(&mut random, &plan);
            let mut expected = maps.clone();
            twin(&plan, &pair, &mut expected);
            for (name, backend) in &mut backends {
                let backend = backend.as_mut();
                backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
                maps.write(backend);
                backend.run(stage).unwrap();
                if let Err(e) = compare_finest(backend, &expected) {
                    panic!("{name}, {size:?}, seed {seed}: {e}\n{:?}", plan.method);
                }
            }
        }
    }
}

#[test]
fn left_right_check() {
    let input = |random: &mut Random, plan: &Plan| random::finest(random, plan, false);
    on_all(Stage::LeftRightCheck, 20, |_, _| (), input, twin::left_right_check::left_right_check);
}

#[test]
fn speckle_filter() {
    let sizes = [0, 1, 2, 3, 5, 20, 10_000];
    let change =
        |random: &mut Random, method: &mut Method| method.refinement.speckle_size = random.pick(&sizes);
    let input = |random: &mut Random, plan: &Plan| {
        let mut maps = random::finest(random, plan, false);
        // As the left-right check leaves it.
        for validity in maps.validity.data_mut() {
            *validity &= i32::from(flag::OUTSIDE | flag::OCCLUDED | flag::MASKED);
        }
        maps
    };
    on_all(Stage::SpeckleFilter, 40, change, input, |plan, _, maps| {
        twin::speckle_filter::speckle_filter(plan, maps);
    });
}

/// Which pixels belong to a region.
type Shape<'a> = &'a dyn Fn(usize, usize) -> bool;

/// Regions of every shape that defeats a shortcut: a spiral, a comb, rows that meet at their ends alone.
#[test]
fn regions_that_wind() {
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
            maps.label = Plane::from_fn(width, height, |x, _| (x as i32 / 50).min(labels - 1));
            let mut expected = maps.clone();
            twin::speckle_filter::speckle_filter(&plan, &mut expected);
            for (name, mut backend) in backends() {
                backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
                maps.write(backend.as_mut());
                backend.run(Stage::SpeckleFilter).unwrap();
                if let Err(e) = compare_finest(backend.as_mut(), &expected) {
                    panic!("{name}, {shape}, {speckle_size}: {e}");
                }
            }
        }
    }
}

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
    on_all(Stage::Fill, 60, |_, _| (), input, |_, _, maps| twin::fill::fill(maps));
}

#[test]
fn confidence() {
    let floors = [0, 1, 16, 17, 255];
    let change =
        |random: &mut Random, method: &mut Method| method.refinement.confidence_floor = random.pick(&floors);
    let input = |random: &mut Random, plan: &Plan| random::finest(random, plan, false);
    on_all(Stage::Confidence, 40, change, input, |plan, _, maps| twin::confidence::confidence(plan, maps));
}

#[test]
fn median() {
    let change = |random: &mut Random, method: &mut Method| {
        method.refinement.median = random.pick(&[Median::Off, Median::Filled, Median::All, Median::All]);
        method.refinement.median_sigma_space = random.log_within(0.1, 100.0);
        method.refinement.median_sigma_range = random.log_within(0.001, 10.0);
        method.refinement.median_window = random.pick(&[3, 5, 15, 31]);
    };
    let input = |random: &mut Random, plan: &Plan| {
        let mut maps = random::finest(random, plan, true);
        if random.one_in(4) {
            // As far apart as disparities get.
            for d in maps.disparity.data_mut() {
                *d = random.within(0, 1 << 29) as i32 - (1 << 28);
            }
        }
        maps
    };
    on_all(Stage::Median, 30, change, input, twin::median::median);
    on_all(Stage::FillMedian, 30, change, input, twin::median::fill_median);
}

#[test]
fn median_weights() {
    let mut random = Random::new(4);
    for _ in 0..300 {
        let (space, range) = (random.log_within(0.1, 100.0), random.log_within(0.001, 10.0));
        let weights = MedianWeights::new(31, space, range);
        let words = weights.words();
        for dy in 0..16 {
            for dx in 0..16 {
                let taken = twin::median::space(dx, dy, space);
                assert_eq!(i64::from(words[(16 * dy + dx) as usize]), taken, "({dx}, {dy}); sigma {space}");
                let row = weights.space_row(dy as usize);
                assert!(row[(15 + dx) as usize] == row[(15 - dx) as usize]);
                assert_eq!(i64::from(row[(15 + dx) as usize]), taken);
            }
        }
        for _ in 0..200 {
            let spread = random.pick(&[300, 5000, 65_535]);
            let [a, b] = [0; 2].map(|_: i32| [0; 4].map(|_: i32| random.within(0, spread) as u16));
            let guide = |channel: u16| (u32::from(channel) * weights.scale()) >> 16;
            let apart: u32 = (0..3).map(|c| guide(a[c]).abs_diff(guide(b[c]))).sum();
            let taken = twin::median::colour(a, b, range);
            assert_eq!(i64::from(apart << weights.doublings()), taken, "{a:?}, {b:?}; sigma {range}");
            // As the definition has it: all of the weight at 1270 sigmas in 8-bit levels.
            let levels: f64 = (0..3).map(|c| f64::from(a[c].abs_diff(b[c])) / 256.0).sum();
            let exact = 127.0 * levels / (1270.0 * range);
            let step = f64::from(1 << weights.doublings());
            let in_range = range > 0.001 && range < 20.0;
            let error = 3.0 * step + exact * 0.5 / f64::from(weights.scale());
            assert!(!in_range || (taken as f64 - exact).abs() <= error, "{taken} against {exact}");
        }
    }
}

/// Maps without anything to go by: all masked, or all given up.
#[test]
fn nothing_valid() {
    for &size in SIZES {
        let mut random = Random::new(1);
        let plan = small_plan(&mut random, size, |m| {
            (m.refinement.median, m.refinement.speckle_size) = (Median::All, 100);
        });
        let pair = random::pair(&mut random, size.0, size.1);
        for all in [flag::MASKED, flag::OCCLUDED, flag::OUTSIDE | flag::LOW_CONFIDENCE, flag::SPECKLE] {
            let mut maps = random::finest(&mut random, &plan, false);
            maps.validity = Plane::filled(size.0, size.1, all.into());
            let mut expected = maps.clone();
            expected.confidence = Plane::filled(size.0, size.1, 0);
            for (name, mut backend) in backends() {
                backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
                maps.write(backend.as_mut());
                for stage in
                    [Stage::SpeckleFilter, Stage::Fill, Stage::FillMedian, Stage::Median, Stage::Confidence]
                {
                    backend.run(stage).unwrap();
                }
                if let Err(e) = compare_finest(backend.as_mut(), &expected) {
                    panic!("{name}, {size:?}, all {all}: {e}");
                }
            }
        }
    }
}

/// A stage, whether its input has left-right check flags alone, its twin, and what makes that one differ.
type Control = (Stage, bool, Twin, fn(&mut Plan));

/// Negative control: every stage notices a parameter that is a little off, or a value that is.
#[test]
fn control_changes_are_found() {
    let mut random = Random::new(21);
    let mut method = Method::default();
    (method.graph.levels, method.graph.percentile, method.refinement.median_window) = (1, 100.0, 5);
    let plan = random::plan((24, 31), 0, 9, &method);
    // Faint enough for neighbours to have weight in the median.
    let faint = Plane::from_fn(24, 31, |_, _| [0; 3].map(|_: i32| random.within(100, 130) as u8));
    let pair = Pair::new(Image::from_rgb8(&faint), texture(&mut random, 24, 31)).unwrap();
    let maps = loop {
        let mut maps = random::finest(&mut random, &plan, true);
        maps.runner_up = maps.best.map(|best| best + best % 20);
        let valid = maps.validity.data().iter().filter(|&&f| f & i32::from(flag::INVALID) == 0).count();
        if valid > 300 && valid < 600 {
            break maps;
        }
    };
    let mut unflagged = maps.clone();
    unflagged.validity = unflagged.validity.map(|v| v & i32::from(flag::OCCLUDED));
    let region: Twin = |plan, _, maps| twin::speckle_filter::speckle_filter(plan, maps);
    let confidence: Twin = |plan, _, maps| twin::confidence::confidence(plan, maps);
    // The larger of two instead of the smaller.
    let larger: Twin = |_, _, maps| {
        maps.disparity = maps.disparity.map(|d| -d);
        twin::fill::fill(maps);
        maps.disparity = maps.disparity.map(|d| -d);
    };
    let changes: &[Control] = &[
        (Stage::LeftRightCheck, false, twin::left_right_check::left_right_check, |p| p.range.min += 1),
        (Stage::SpeckleFilter, true, region, |p| p.method.refinement.speckle_size += 1),
        (Stage::Fill, false, larger, |_| ()),
        (Stage::Confidence, false, confidence, |p| p.method.refinement.confidence_floor += 4),
        (Stage::FillMedian, false, twin::median::fill_median, |p| p.method.refinement.median_window = 7),
        (Stage::FillMedian, false, twin::median::fill_median, |p| {
            p.method.refinement.median_sigma_range = 0.02;
        }),
        (Stage::FillMedian, false, twin::median::median, |p| p.method.refinement.median = Median::Filled),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_window = 7),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_sigma_space = 1.0),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_sigma_range = 0.02),
    ];
    let mut plan = plan;
    plan.method.refinement.speckle_size = 3;
    for (name, mut backend) in backends() {
        for (stage, bare, twin, change) in changes {
            let input = if *bare { &unflagged } else { &maps };
            backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
            input.write(backend.as_mut());
            backend.run(*stage).unwrap();
            let mut other = plan.clone();
            change(&mut other);
            let mut expected = input.clone();
            twin(&other, &pair, &mut expected);
            assert!(compare_finest(backend.as_mut(), &expected).is_err(), "{name}: {stage:?}");
        }
    }
}
