//! Properties of every match, for all images, ranges and methods: no panic, the same bits on every backend,
//! and maps that satisfy their documented invariants.
//!
//! Every run draws new cases. A failing case is shrunk and printed with its seeds. There is no file of
//! regressions: each one becomes a test of its own. `PROPTEST_CASES` sets the number of cases.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use common::random::{self, Random};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::maps::{FRACTION, Maps, flag, has_disparity};
use mrfgs::options::{DisparityRange, Illumination, Method, ZoneExtent};
use mrfgs::{Error, Matcher};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::cell::RefCell;
use std::ops::ControlFlow;

/// The contents of the images.
#[derive(Clone, Copy, Debug)]
enum Content {
    /// Noise, few values or a single value, related or not, with masks over nothing, a part or everything.
    Random,
    /// Identical views.
    Identical,
    /// Views of one colour.
    Plain,
    /// A left view with all pixels masked.
    Masked,
}

/// All parameters of a match, small for simple cases.
#[derive(Clone, Debug)]
struct Case {
    size: (usize, usize),
    min: i32,
    labels: i32,
    content: Content,
    seed: u64,
    neighbours: usize,
    /// Illumination correction, and zones that limit the labels.
    front: bool,
    /// Tiles in 1 MiB of memory, without overlap; with overlap, no tile would be smaller than these images.
    tiled: bool,
}

fn cases() -> impl Strategy<Value = Case> {
    let content = prop_oneof![
        5 => Just(Content::Random),
        1 => Just(Content::Identical),
        1 => Just(Content::Plain),
        1 => Just(Content::Masked),
    ];
    let sizes = (1..=40_usize, 1..=40_usize);
    let method = (any::<u64>(), 1..=8_usize, any::<bool>(), any::<bool>());
    (sizes, -45..=45_i32, 1..=40_i32, content, method).prop_map(
        |(size, min, labels, content, (seed, neighbours, front, tiled))| Case {
            size,
            min,
            // More labels than fit into the memory of tiled matches.
            labels: if tiled { labels + 60 } else { labels },
            content,
            seed,
            neighbours,
            front,
            tiled,
        },
    )
}

impl Case {
    fn range(&self) -> DisparityRange {
        DisparityRange::new(self.min, self.min + self.labels - 1).unwrap()
    }

    fn method(&self) -> Method {
        let mut random = Random::new(self.seed);
        let mut method = random::method(&mut random, self.neighbours);
        method.tiles.memory = if self.tiled { 1 } else { method.tiles.memory };
        if self.front {
            method.front.illumination =
                random.pick(&[Illumination::Homomorphic, Illumination::HomomorphicFirst]);
            method.front.zone_extent = random.pick(&[ZoneExtent::Region, ZoneExtent::Cluster]);
            method.front.clusters = random.within(1, 6);
            method.front.zone_sigmas = f64::from(random.within(1, 3));
        }
        method.schedule.tolerance = random.pick(&[0.0, 0.5]);
        method.validated().unwrap()
    }

    fn pair(&self) -> Pair {
        let (width, height) = self.size;
        let pair = random::pair(&mut Random::new(!self.seed), width, height);
        let plain = || Image::from_rgb8(&Plane::filled(width, height, [70, 80, 90]));
        match self.content {
            Content::Random => pair,
            Content::Identical => Pair::new(pair.left().clone(), pair.left().clone()).unwrap(),
            Content::Plain => Pair::new(plain(), plain()).unwrap(),
            Content::Masked => {
                let masked = Plane::filled(width, height, true);
                let left = Image { pixels: pair.left().pixels.clone(), masked };
                Pair::new(left, pair.right().clone()).unwrap()
            }
        }
    }
}

/// The tiles of a match, or an error where no tile fits.
fn tiles(case: &Case) -> mrfgs::Result<Tiles> {
    let (width, height) = case.size;
    let plan = Plan::new(width, height, case.range(), &case.method())?;
    if case.tiled { Tiles::with_overlap(&plan, 0) } else { Tiles::new(&plan) }
}

/// The maps of a match on a backend.
fn maps_on(backend: &mut dyn Backend, case: &Case, tiles: &Tiles) -> mrfgs::Result<Maps> {
    let go_on = &mut |_| ControlFlow::Continue(());
    let solution = match tiles.count() {
        1 => common::solve(backend, tiles.whole(), &case.pair(), go_on)?,
        _ => common::solve_tiles(backend, tiles, &case.pair(), go_on)?,
    };
    Ok(solution.maps)
}

/// The first violation of a documented invariant of the maps.
fn broken(maps: &Maps, pair: &Pair, range: DisparityRange) -> Option<String> {
    let sizes = [maps.disparity.size(), maps.raw.size(), maps.confidence.size(), maps.validity.size()];
    if sizes != [pair.size(); 4] {
        return Some(format!("sizes {sizes:?} of a pair of {:?}", pair.size()));
    }
    // At the ends of the range there is no sub-pixel offset.
    let within = |disparity: i32| (range.min * FRACTION..=range.max * FRACTION).contains(&disparity);
    let (width, height) = pair.size();
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).find_map(|at| {
        let (validity, confidence) = (maps.validity[at], maps.confidence[at]);
        let (disparity, raw) = (maps.disparity[at], maps.raw[at]);
        let masked = pair.left().masked[at];
        let promises = [
            ("two reasons", (validity & (flag::INVALID | flag::LOW_CONFIDENCE)).count_ones() <= 1),
            ("outvoted, and not filled", validity & flag::OUTVOTED == 0 || validity & flag::FILLED != 0),
            ("the mask", (validity & flag::MASKED != 0) == masked),
            ("masked, and filled", !masked || validity & flag::FILLED == 0),
            ("filled without need", validity & flag::FILLED == 0 || validity & flag::INVALID != 0),
            ("confidence in what is invalid", validity & flag::INVALID == 0 || confidence == 0),
            ("a raw disparity out of range", masked || within(raw)),
            ("a disparity out of range", !has_disparity(validity) || within(disparity)),
        ];
        let (what, _) = promises.into_iter().find(|(_, kept)| !kept)?;
        Some(format!(
            "{what} at {at:?}: {disparity}, raw {raw}, validity {validity}, confidence {confidence}"
        ))
    })
}

fn number_of_cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|count| count.parse().ok()).unwrap_or(256)
}

#[test]
fn every_match_satisfies_its_invariants_on_every_backend() {
    let config = Config { cases: number_of_cases(), failure_persistence: None, ..Config::default() };
    let matcher = RefCell::new(Matcher::builder().device("cpu").threads(2).build().unwrap());
    let gpu = RefCell::new(devices::gpu());
    let counts = RefCell::new([0; 3]);
    let test = |case: Case| {
        let failed = |e: Error| TestCaseError::fail(e.to_string());
        let (pair, range) = (case.pair(), case.range());
        let tiles = match tiles(&case) {
            Err(Error::Budget(_)) if case.tiled => {
                counts.borrow_mut()[2] += 1;
                return Ok(());
            }
            tiles => tiles.map_err(failed)?,
        };
        counts.borrow_mut()[usize::from(tiles.count() > 1)] += 1;
        let maps = if case.tiled {
            maps_on(&mut Cpu::default(), &case, &tiles).map_err(failed)?
        } else {
            matcher.borrow_mut().job(&pair, range).method(&case.method()).run().map_err(failed)?.maps
        };
        if let Some(what) = broken(&maps, &pair, range) {
            return Err(TestCaseError::fail(what));
        }
        if let Some(gpu) = gpu.borrow_mut().as_mut() {
            let same = maps_on(gpu, &case, &tiles).map_err(failed)? == maps;
            prop_assert!(same, "the GPU's maps differ");
        }
        Ok(())
    };
    if let Err(failure) = TestRunner::new(config).run(&cases(), test) {
        panic!("{failure}");
    }
    let [whole, tiled, refused] = counts.into_inner();
    println!("{whole} in one piece, {tiled} in tiles, {refused} too large for the memory");
    assert!(whole + tiled > refused, "most cases must be matches");
}

/// Control: every invariant can be violated, and each violation is detected.
#[test]
fn violated_invariants_are_noticed() {
    let case = Case {
        size: (9, 7),
        min: -2,
        labels: 6,
        content: Content::Random,
        seed: 5,
        neighbours: 2,
        front: false,
        tiled: false,
    };
    let (mut pair, range) = (case.pair(), case.range());
    let mut left = pair.left().clone();
    left.masked = Plane::filled(9, 7, false);
    left.masked[(8, 6)] = true;
    pair = Pair::new(left, pair.right().clone()).unwrap();
    let mut matcher = Matcher::builder().method(case.method()).device("cpu").build().unwrap();
    let maps = matcher.run(&pair, range).unwrap().maps;
    assert_eq!(broken(&maps, &pair, range), None);
    let noticed = |word: &str, change: fn(&mut Maps)| {
        let mut changed = maps.clone();
        change(&mut changed);
        let what = broken(&changed, &pair, range);
        assert!(what.as_ref().is_some_and(|what| what.contains(word)), "{word}: {what:?}");
    };
    noticed("two reasons", |maps| maps.validity[(1, 1)] = flag::TIE | flag::SPECKLE);
    noticed("two reasons", |maps| maps.validity[(1, 1)] = flag::OUTVOTED | flag::LOW_CONFIDENCE);
    noticed("outvoted, and", |maps| maps.validity[(1, 1)] = flag::OUTVOTED);
    noticed("the mask", |maps| maps.validity[(8, 6)] = 0);
    noticed("masked, and", |maps| maps.validity[(8, 6)] |= flag::FILLED);
    noticed("filled without", |maps| maps.validity[(1, 1)] = flag::FILLED);
    noticed("confidence", |maps| {
        maps.validity[(1, 1)] = flag::OCCLUDED;
        maps.confidence[(1, 1)] = 1;
    });
    noticed("a raw", |maps| maps.raw[(1, 1)] = 3 * FRACTION + 1);
    noticed("a disparity", |maps| {
        maps.validity[(1, 1)] = 0;
        maps.disparity[(1, 1)] = -2 * FRACTION - 1;
    });
    noticed("sizes", |maps| maps.confidence = Plane::filled(9, 6, 0));
}

/// Control: a different method gives different maps, so equality is meaningful.
#[test]
fn another_method_gives_other_maps() {
    let mut differ = 0;
    for seed in 0..8 {
        let case = |seed| Case {
            size: (30, 20),
            min: 0,
            labels: 12,
            content: Content::Random,
            seed,
            neighbours: 2,
            front: false,
            tiled: false,
        };
        let maps = |seed| {
            let case = case(seed);
            maps_on(&mut Cpu::default(), &case, &tiles(&case).unwrap()).unwrap()
        };
        let one = maps(seed);
        assert!(one == maps(seed));
        differ += usize::from(one != maps(seed + 100));
    }
    assert!(differ >= 6, "{differ} of 8");
}
