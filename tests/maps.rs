//! Whole matches: their maps equal those of the naive twins, run in the documented order of the stages. Also
//! properties that hold for every method.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::compare::compare_maps;
use common::devices::backends;
use common::random::{self, Random, texture};
use common::twin::{self, Finest};
use mrfgs::Matcher;
use mrfgs::image::{Image, Pair, Plane, Rect};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::{Backend, Map, NO_LABEL, Stage, Volume};
use mrfgs::low_level::engine::Solution;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::low_level::stage::{LevelPriors, NO_ANCHOR};
use mrfgs::maps::{Maps, RightMap, flag};
use mrfgs::options::{DisparityRange, Fill, LeftRightCheck, MatchingCost, Median, Method, Order, Potential};
use pollster::block_on;
use std::ops::ControlFlow;

/// The maps that the naive twins compute from the results of a match in `finest`.
fn finished(finest: &mut Finest, plan: &Plan, pair: &Pair) -> Maps {
    finest.disparity = finest.raw.clone();
    twin_maps(finest, plan, pair);
    let bytes = |plane: &Plane<i32>| plane.map(|&v| u8::try_from(v).unwrap());
    Maps {
        disparity: finest.disparity.clone(),
        raw: finest.raw.clone(),
        confidence: bytes(&finest.confidence),
        validity: bytes(&finest.validity),
        right: None,
    }
}

/// The raw disparities of the right view, mirrored, as the twins compute them.
fn right_raw(finest: &Finest, plan: &Plan, pair: &Pair) -> Finest {
    let mut right = finest.clone();
    twin::swap_views::swap_views(&mut right);
    twin::sub_pixel::sub_pixel(plan, &twin::cost::cost(plan, &mirrored(pair)), &mut right);
    right
}

/// The map of the right view that the twins compute from its mirrored disparities.
fn right_map(right: &mut Finest, plan: &Plan, pair: &Pair) -> RightMap {
    let maps = finished(right, plan, &mirrored(pair));
    let validity = maps.validity.map(|validity| validity & !flag::LOW_CONFIDENCE);
    RightMap { disparity: maps.disparity.mirrored(), validity: validity.mirrored() }
}

/// Runs the twins of all stages after the estimate, in the documented order.
fn twin_maps(maps: &mut Finest, plan: &Plan, pair: &Pair) {
    twin_filled(maps, plan, pair);
    let last = if plan.method.refinement.plane { twin::plane::plane } else { twin::median::median };
    last(plan, pair, maps);
    twin::support::support(plan, maps);
    twin::far_plane::far_plane(plan, pair, maps);
}

/// Runs the twins of the stages up to those that smooth.
fn twin_filled(maps: &mut Finest, plan: &Plan, pair: &Pair) {
    twin::left_right_check::left_right_check(plan, pair, maps);
    if plan.method.refinement.speckle_size > 0 {
        twin::speckle_filter::speckle_filter(plan, maps);
    }
    twin::confidence::confidence(plan, maps);
    if plan.method.refinement.fill != Fill::None {
        twin::fill::fill(plan, maps);
    }
    if plan.method.refinement.fill == Fill::Votes {
        twin::vote_fill::vote_fill(plan, pair, maps);
        twin::fill_plane::fill_plane(plan, pair, maps);
    }
}

/// The prior that the twins find for the look after one whose labels and raw disparities are in `finest`.
fn guessed(finest: &Finest, plan: &Plan, pair: &Pair) -> LevelPriors {
    let mut maps = Finest { disparity: finest.raw.clone(), ..finest.clone() };
    twin_filled(&mut maps, plan, pair);
    twin::support::support(plan, &mut maps);
    twin::far_plane::far_plane(plan, pair, &mut maps);
    let mut levels = vec![twin::guess::take(plan, &maps.disparity, &maps.validity, None)];
    for z in 1..plan.levels.len() {
        let pooled = twin::guess::pool(plan, z, &levels[z - 1]);
        levels.push(pooled);
    }
    let (width, height) = plan.size();
    LevelPriors { levels, anchors: Plane::filled(width, height, NO_ANCHOR) }
}

/// The first difference between the maps of two matches.
fn compare_all(actual: &Maps, expected: &Maps) -> Result<(), String> {
    compare_maps("raw", &actual.raw, &expected.raw)?;
    compare_maps("validity", &actual.validity, &expected.validity)?;
    compare_maps("confidence", &actual.confidence, &expected.confidence)?;
    compare_maps("disparity", &actual.disparity, &expected.disparity)?;
    match (&actual.right, &expected.right) {
        (Some(actual), Some(expected)) => {
            compare_maps("right validity", &actual.validity, &expected.validity)?;
            compare_maps("right disparity", &actual.disparity, &expected.disparity)
        }
        (actual, expected) if actual.is_some() != expected.is_some() => Err("one right map".into()),
        _ => Ok(()),
    }
}

/// The maps of every backend.
fn solve(pair: &Pair, plan: &Plan) -> Vec<(String, Solution)> {
    backends()
        .into_iter()
        .map(|(name, mut backend)| {
            let solution =
                common::solve(backend.as_mut(), plan, pair, &mut |_| ControlFlow::Continue(())).unwrap();
            (name, solution)
        })
        .collect()
}

fn matched(pair: &Pair, plan: &Plan, threads: usize) -> Maps {
    let matcher = Matcher::builder().method(plan.method.clone()).device("cpu").threads(threads);
    matcher.build().unwrap().run(pair, plan.range).unwrap().maps
}

#[test]
fn the_stages_run_in_order() {
    let (mut rights, mut looked_again) = (0, 0);
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let size = random.pick(&[(1, 1), (1, 12), (15, 1), (23, 14), (30, 22)]);
        let labels = random.pick(&[1, 2, 9, 17]);
        let neighbours = random.pick(&[0, 2, 8]);
        let min = random.pick(&[-20, -3, 0, 5]);
        let mut method = random::method(&mut random, neighbours);
        method.schedule.looks = random.pick(&[1, 2, 3]);
        let plan = random::plan(size, min, labels, &method);
        let pair = random::pair(&mut random, size.0, size.1);
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            let mut iterations = estimated(backend, &pair, &plan);
            let mut finest = Finest::zero(size);
            for look in 0..plan.looks() {
                let guess = (look > 0).then(|| guessed(&finest, &plan, &pair));
                if let Some(guess) = &guess {
                    looked_again += 1;
                    iterations += estimated_again(backend, &pair, &plan, guess.clone());
                }
                finest.label = block_on(backend.map(Map::Label)).unwrap();
                finest.best = block_on(backend.map(Map::Best)).unwrap();
                finest.runner_up = block_on(backend.map(Map::RunnerUp)).unwrap();
                if let Some(guess) = &guess {
                    let belief = backend.probe().read(Volume::Belief(0)).unwrap();
                    twin::lead::lead(&plan, &belief, &guess.levels[0], &mut finest);
                }
                finest.right_label = match plan.method.refinement.left_right_check {
                    LeftRightCheck::SecondMatch => second_match(&pair, &plan),
                    _ => block_on(backend.map(Map::RightLabel)).unwrap(),
                };
                finest.raw = block_on(backend.map(Map::Raw)).unwrap();
            }
            let mut expected = finished(&mut finest, &plan, &pair);
            if plan.method.refinement.right_map {
                let mut right = right_raw(&finest, &plan, &pair);
                expected.right = Some(right_map(&mut right, &plan, &pair));
                rights += 1;
            }
            for (solver, actual) in solve(&pair, &plan) {
                if let Err(e) = compare_all(&actual.maps, &expected) {
                    panic!("{solver} against twins after {name}, seed {seed}: {e}\n{:?}", plan.method);
                }
                assert_eq!(actual.iterations, iterations);
            }
        }
    }
    assert!(rights > 10, "{rights} maps of the right view");
    assert!(looked_again > 30, "{looked_again} second looks");
}

/// With a second match and no speckle filter, the right map equals the map of the mirrored pair, bit for bit.
#[test]
fn the_right_map_is_the_map_of_the_mirrored_pair() {
    let mut method = Method::default();
    method.refinement.left_right_check = LeftRightCheck::SecondMatch;
    // The speckle filter discards ties, and votes need confidence, which is unknown for the right view.
    (method.refinement.right_map, method.refinement.speckle_size) = (true, 0);
    method.refinement.fill = Fill::Row;
    // The mirrored pair is matched in one look.
    method.schedule.looks = 1;
    method.front = random::as_it_is();
    let mut random = Random::new(12);
    let plan = random::plan((41, 30), -3, 17, &method);
    for _ in 0..4 {
        let pair = random::pair(&mut random, 41, 30);
        for ((name, a), (_, b)) in solve(&pair, &plan).into_iter().zip(solve(&mirrored(&pair), &plan)) {
            let right = a.maps.right.unwrap();
            assert!(right.disparity == b.maps.disparity.mirrored(), "{name}");
            // Control: the left view has a different map.
            assert!(right.disparity != a.maps.disparity, "{name}");
        }
    }
}

/// Tiled matching matches each crop, keeps its core, and runs the remaining stages on all cores together.
#[test]
fn tiles_are_matched_alone_and_finished_together() {
    let (mut tiled, mut twice, mut other) = (0, 0, 0);
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let (width, height) = random.pick(&[(100, 80), (60, 130), (131, 61)]);
        let mut method = random::method(&mut random, [0, 2, 8][seed as usize % 3]);
        (method.graph.levels, method.tiles.memory) = (method.graph.levels.min(3), 1);
        method.schedule.looks = 1;
        let plan =
            random::plan((width, height), random.pick(&[-12, -3, 0]), random.pick(&[2, 9, 17]), &method);
        let Ok(tiles) = Tiles::with_overlap(&plan, random.pick(&[0, 2, 5])) else { continue };
        if tiles.count() == 1 {
            continue;
        }
        let pair = random::pair(&mut random, width, height);
        let mut finest = Finest::zero((width, height));
        finest.right_label = Plane::filled(width, height, NO_LABEL.into());
        finest.right_best = Plane::filled(width, height, 65_535);
        // The mirrored disparities of the right view.
        let mut rights = Plane::filled(width, height, 0);
        let mut iterations = 0;
        for tile in tiles.list() {
            let (core, crop) = (&tile.core, &tile.crop);
            let part = |pair: &Pair| {
                let cut = |image: &Image| Image {
                    pixels: Plane::from_fn(crop.x.len(), crop.y.len(), |x, y| {
                        image.pixels[(crop.x.start + x, crop.y.start + y)]
                    }),
                    masked: Plane::from_fn(crop.x.len(), crop.y.len(), |x, y| {
                        image.masked[(crop.x.start + x, crop.y.start + y)]
                    }),
                };
                Pair::new(cut(pair.left()), cut(pair.right())).unwrap()
            };
            let mut cpu = Cpu::default();
            if method.refinement.left_right_check == LeftRightCheck::SecondMatch {
                estimated(&mut cpu, &part(&mirrored(&pair)), &tile.plan);
                let [labels, raw] = [Map::Label, Map::Raw].map(|map| block_on(cpu.map(map)).unwrap());
                for (x, y) in places(core) {
                    let at = (x - crop.x.start, y - crop.y.start);
                    finest.right_label[(width - 1 - x, y)] = labels[at];
                    rights[(x, y)] = raw[at];
                }
            }
            iterations = iterations.max(estimated(&mut cpu, &part(&pair), &tile.plan));
            let maps = [Map::Label, Map::Best, Map::RunnerUp, Map::Raw, Map::RightLabel, Map::RightBest]
                .map(|map| block_on(cpu.map(map)).unwrap());
            for (x, y) in places(core) {
                let at = (x - crop.x.start, y - crop.y.start);
                (finest.label[(x, y)], finest.best[(x, y)]) = (maps[0][at], maps[1][at]);
                (finest.runner_up[(x, y)], finest.raw[(x, y)]) = (maps[2][at], maps[3][at]);
            }
            if method.refinement.left_right_check != LeftRightCheck::SecondMatch {
                let mut here = Finest::zero((crop.x.len(), crop.y.len()));
                [here.label, here.best, here.runner_up, here.raw, here.right_label, here.right_best] =
                    maps.clone();
                let raw = right_raw(&here, &tile.plan, &part(&pair)).raw;
                for (x, y) in places(&Rect { x: crop.x.clone(), y: core.y.clone() }) {
                    let at = (x - crop.x.start, y - crop.y.start);
                    let (label, best) = (&mut finest.right_label[(x, y)], &mut finest.right_best[(x, y)]);
                    if maps[5][at] < *best || maps[5][at] == *best && maps[4][at] < *label {
                        (*label, *best) = (maps[4][at], maps[5][at]);
                        rights[(width - 1 - x, y)] = raw[(crop.x.len() - 1 - at.0, at.1)];
                    }
                }
            }
        }
        let mut expected = finished(&mut finest, &plan, &pair);
        if method.refinement.right_map {
            let mut right = finest.clone();
            twin::swap_views::swap_views(&mut right);
            right.raw = rights;
            expected.right = Some(right_map(&mut right, &plan, &pair));
        }
        for (name, mut backend) in backends() {
            let observer = &mut |_| ControlFlow::Continue(());
            let actual = common::solve_tiles(backend.as_mut(), &tiles, &pair, observer).unwrap();
            if let Err(e) = compare_all(&actual.maps, &expected) {
                panic!("{name}, seed {seed}: {e}\n{:?}", plan.method);
            }
            assert_eq!(actual.iterations, iterations, "{name}, seed {seed}");
        }
        tiled += 1;
        twice += usize::from(method.refinement.left_right_check == LeftRightCheck::SecondMatch);
        // Control: matching in one piece gives different maps.
        other += usize::from(matched_whole(&pair, &plan) != expected);
    }
    assert!(
        tiled > 15 && twice > 2 && other > 10,
        "{tiled} tiled, {twice} matched twice, {other} unlike one piece"
    );
}

fn places(part: &Rect) -> impl Iterator<Item = (usize, usize)> {
    let columns = part.x.clone();
    part.y.clone().flat_map(move |y| columns.clone().map(move |x| (x, y)))
}

fn matched_whole(pair: &Pair, plan: &Plan) -> Maps {
    let observer = &mut |_| ControlFlow::Continue(());
    common::solve(&mut Cpu::default(), plan, pair, observer).unwrap().maps
}

/// Runs all stages up to [`Stage::SubPixel`]; returns the number of iterations.
fn estimated(backend: &mut dyn Backend, pair: &Pair, plan: &Plan) -> u32 {
    estimated_from(backend, Prepared::new(pair), plan)
}

/// Like [`estimated`], for a look after the first: one iteration per phase, and a prior.
fn estimated_again(backend: &mut dyn Backend, pair: &Pair, plan: &Plan, prior: LevelPriors) -> u32 {
    let mut again = plan.clone().with_prior(true);
    again.method.schedule.looks = 1;
    again.phases.iter_mut().for_each(|phase| phase.iterations = phase.iterations.min(1));
    estimated_from(backend, Prepared { prior: Some(prior), ..Prepared::new(pair) }, &again)
}

fn estimated_from(backend: &mut dyn Backend, prepared: Prepared, plan: &Plan) -> u32 {
    backend.prepare(plan, prepared).unwrap();
    backend.run(Stage::Cost).unwrap();
    for z in 0..plan.levels.len() {
        backend.run(Stage::Graph(z)).unwrap();
        if z > 0 {
            backend.run(Stage::Pyramid(z)).unwrap();
        }
    }
    let all = common::flood_on_costs(backend, plan).unwrap();
    let iterations = all - block_on(backend.idle_iterations()).unwrap();
    for stage in [Stage::WinnerTakesAll, Stage::RightView, Stage::SubPixel] {
        backend.run(stage).unwrap();
    }
    iterations
}

/// The labels of the right view from a separate match: right x is left width - 1 - x of the mirrored pair.
fn second_match(pair: &Pair, plan: &Plan) -> Plane<i32> {
    let mirrored = mirrored(pair);
    let mut method = plan.method.clone();
    (method.refinement.left_right_check, method.refinement.sub_pixel) = (LeftRightCheck::Off, false);
    method.schedule.looks = 1;
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, plan.range, &method).unwrap();
    let raw = matched(&mirrored, &plan, 1).raw;
    Plane::from_fn(width, height, |x, y| raw[(width - 1 - x, y)] / 256 - plan.range.min)
}

/// The mirrored pair: both views mirrored and exchanged.
fn mirrored(pair: &Pair) -> Pair {
    let mirror = |image: &Image| {
        let (width, height) = image.pixels.size();
        Image {
            pixels: Plane::from_fn(width, height, |x, y| image.pixels[(width - 1 - x, y)]),
            masked: Plane::from_fn(width, height, |x, y| image.masked[(width - 1 - x, y)]),
        }
    };
    Pair::new(mirror(pair.right()), mirror(pair.left())).unwrap()
}

#[test]
fn identical_views_have_no_disparity() {
    for preset in ["default", "paper"] {
        let mut random = Random::new(9);
        let view = texture(&mut random, 47, 26);
        let pair = Pair::new(view.clone(), view).unwrap();
        for sub_pixel in [false, true] {
            let mut method = Method::preset(preset).unwrap();
            method.refinement.sub_pixel = sub_pixel;
            for (min, labels) in [(-3, 16), (0, 17), (-12, 13)] {
                let plan = random::plan((47, 26), min, labels, &method);
                for (name, solution) in solve(&pair, &plan) {
                    let most = if sub_pixel { 128 } else { 0 };
                    for map in [&solution.maps.raw, &solution.maps.disparity] {
                        let off = map.data().iter().filter(|d| d.abs() > most).count();
                        assert_eq!(off, 0, "{name}, {preset}, {min}: pixels that are not at 0");
                    }
                    let invalid = flag::INVALID;
                    assert!(
                        solution.maps.validity.data().iter().all(|f| f & invalid == 0),
                        "{name}, {preset}"
                    );
                }
            }
        }
    }
}

/// Moving the right view and the range by one pixel of the coarsest level gives every level the same costs at
/// other labels, except near borders. The affected margin is the sum of the cost window, the pyramid, in each
/// iteration two graph radii at the coarsest level and its resolution factors, the right view, and the
/// median.
#[test]
fn a_shift_of_view_and_range_changes_nothing_inside() {
    let (width, height, levels, labels) = (420, 9, 3u32, 8);
    let shift = 1 << (levels - 1);
    for (cost, potential, schedule) in [
        (MatchingCost::AdCensus, Potential::Soft, Order::CoarseFirst),
        (MatchingCost::Sad, Potential::Hard, Order::Together),
        (MatchingCost::AdCensus, Potential::Exact, Order::CoarseFirst),
    ] {
        let mut random = Random::new(31);
        let left = texture(&mut random, width, height);
        // Moved by 0 to 7 px, varying along the row, with noise: labels are neither certain nor arbitrary.
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
        (method.cost.matching, method.messages.potential, method.schedule.order) =
            (cost, potential, schedule);
        (method.graph.levels, method.schedule.iterations, method.schedule.final_iterations) = (levels, 1, 1);
        if cost == MatchingCost::Sad {
            (method.cost.outside_cost, method.messages.temperature) = (20.0, 8.0);
        }
        // The speckle filter and the fill act over any distance, so they are off.
        (method.refinement.speckle_size, method.refinement.fill, method.refinement.median_window) =
            (0, Fill::None, 5);
        let iterations = 3;
        let per_iteration = (2 * 3 + 2) * shift;
        let margin = 4 + 2 * shift + iterations * per_iteration + (labels + shift) + 2 + labels + shift;
        let near = random::plan((width, height), 0, labels, &method);
        let far = random::plan((width, height), shift as i32, labels, &method);
        let near_pair = Pair::new(left.clone(), right).unwrap();
        let far_pair = Pair::new(left, further).unwrap();
        let unshifted = solve(&near_pair, &near);
        for ((name, a), (_, b)) in unshifted.iter().zip(solve(&far_pair, &far)) {
            let (a, b) = (&a.maps, &b.maps);
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
            // Control: the margin does change, and the interior is not uniform.
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
        (method.refinement.median, method.refinement.fill) = (Median::All, Fill::Row);
        let plan = random::plan((37, 23), -3, 17, &method);
        let pair = random::pair(&mut random, 37, 23);
        let one = matched(&pair, &plan, 1);
        for threads in [2, 3] {
            assert!(matched(&pair, &plan, threads) == one, "seed {seed}, {threads} threads");
        }
    }
}

/// A copy of the image with other values where it is masked.
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
fn masked_values_have_no_influence() {
    let mut masked_pixels = 0;
    for seed in 0..40 {
        let mut random = Random::new(seed);
        let mut method = random::method(&mut random, 8);
        (method.graph.levels, method.refinement.median) = (4, Median::All);
        let plan = random::plan((29, 18), random.pick(&[-9, -3, 0]), 13, &method);
        let pair = random::pair(&mut random, 29, 18);
        let other =
            Pair::new(poisoned(&mut random, pair.left()), poisoned(&mut random, pair.right())).unwrap();
        masked_pixels += pair.left().masked.data().iter().filter(|&&m| m).count();
        for ((name, a), (_, b)) in solve(&pair, &plan).iter().zip(&solve(&other, &plan)) {
            if let Err(e) = compare_all(&a.maps, &b.maps) {
                panic!("{name}, seed {seed}: {e}\n{:?}", plan.method);
            }
            assert_eq!(a.iterations, b.iterations);
        }
    }
    assert!(masked_pixels > 1000);
}

/// Negative control: unmasked values do have influence.
#[test]
fn control_unmasked_values_have_influence() {
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
        assert!(compare_all(&a.maps, &b.maps).is_err());
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
                    let masked =
                        solution.maps.validity.data().iter().filter(|&f| f & flag::MASKED != 0).count();
                    assert_eq!(masked, if left_masked { width * height } else { 0 }, "{name}, {preset}");
                    let known = solution.maps.final_map().data().iter().any(|d| d.is_finite());
                    assert!(!(left_masked && known), "{name}, {preset}: a masked pixel has a disparity");
                    assert!(solution.maps.raw_map().data().iter().all(|d| d.is_finite() != left_masked));
                }
            }
        }
    }
}

/// Negative control for the right view: a pixel to which nothing projects has no label, and that is not
/// agreement.
#[test]
fn no_label_is_no_agreement() {
    let mut random = Random::new(1);
    let plan = random::plan((5, 1), 0, 4, &Method::default());
    let pair = Pair::new(texture(&mut random, 5, 1), texture(&mut random, 5, 1)).unwrap();
    let mut maps = Finest::zero((5, 1));
    maps.right_label = Plane::filled(5, 1, NO_LABEL.into());
    for (name, mut backend) in backends() {
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        maps.write(backend.as_mut());
        backend.run(Stage::LeftRightCheck).unwrap();
        let validity = block_on(backend.map(Map::Validity)).unwrap();
        assert!(validity.data().iter().all(|&f| f == i32::from(flag::OCCLUDED)), "{name}");
    }
}

#[test]
fn a_plan_of_another_size_is_refused() {
    let mut random = Random::new(1);
    let pair = Pair::new(texture(&mut random, 8, 8), texture(&mut random, 8, 8)).unwrap();
    let range = DisparityRange::new(0, 3).unwrap();
    let plan = Plan::new(8, 9, range, &Method::default()).unwrap();
    for (_, mut backend) in backends() {
        let observer = &mut |_| ControlFlow::Continue(());
        assert!(common::solve(backend.as_mut(), &plan, &pair, observer).is_err());
    }
}

/// A masked pixel of the left view is no rival for what the pixels beside it match.
#[test]
fn masked_pixels_occlude_nothing() {
    let (width, height, disparity) = (160, 40, 20);
    let texture = texture(&mut Random::new(3), width + disparity, height);
    let crop = |x| texture.crop(&Rect { x: x..x + width, y: 0..height });
    let mut left = crop(0);
    left.masked = Plane::from_fn(width, height, |x, _| x < 60);
    let pair = Pair::new(left, crop(disparity)).unwrap();
    for preset in ["default", "fast", "fgs"] {
        let method = Method::preset(preset).unwrap();
        let mut matcher = Matcher::builder().method(method).device("cpu").build().unwrap();
        let found = matcher.run(&pair, DisparityRange::new(-60, 60).unwrap()).unwrap();
        let validity = &found.maps.validity;
        let seen = (0..height).flat_map(|y| (65..100).map(move |x| (x, y)));
        let occluded = seen.filter(|&at| validity[at] & flag::OCCLUDED != 0).count();
        assert!(occluded < 35 * height / 100, "{preset}: {occluded} pixels");
    }
}
