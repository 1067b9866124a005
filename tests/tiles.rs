//! Tiled matching: how an image is split, and the effect on its maps.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use common::random::Random;
use mrfgs::error::BudgetError;
use mrfgs::image::{Pair, Plane, calib::Calibration};
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::engine::Solution;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::{OVERLAP, Tiles};
use mrfgs::low_level::program::together::streamed;
use mrfgs::maps::{Maps, has_disparity};
use mrfgs::options::{DisparityRange, LeftRightCheck, MatchSize, Method, PRESETS};
use mrfgs::{Error, Matcher, Progress};
use std::ops::{ControlFlow, Range};
use std::path::Path;

fn quiet(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The plan of `method` with `memory` MiB.
fn plan((width, height): (usize, usize), range: DisparityRange, method: &Method, memory: u32) -> Plan {
    let mut method = method.clone();
    method.tiles.memory = memory;
    Plan::new(width, height, range, &method).unwrap()
}

/// Checks the invariants of `tiles`, which overlap by `overlap` pixels.
fn check(tiles: &Tiles, overlap: usize) -> Result<(), String> {
    let whole = tiles.whole();
    let ((width, height), range) = (whole.size(), whole.range);
    let memory = u64::from(whole.method.tiles.memory) << 20;
    let ensure = |holds: bool, what: &str| if holds { Ok(()) } else { Err(what.to_owned()) };
    ensure(tiles.bytes() <= memory, "within the memory")?;
    let bytes = |plan: &Plan| streamed(plan).bytes();
    let grid = 1 << (whole.levels.len() - 1);
    let mut covered = Plane::filled(width, height, 0u8);
    for tile in tiles.list() {
        let (core, crop) = (&tile.core, &tile.crop);
        ensure(core.x.end <= width && core.y.end <= height, "cores inside the image")?;
        for y in core.y.clone() {
            covered.row_mut(y)[core.x.clone()].iter_mut().for_each(|n| *n += 1);
        }
        ensure(crop.x.end <= width && crop.y.end <= height, "crops inside the image")?;
        ensure(crop.x.start % grid == 0 && crop.y.start % grid == 0, "crops on the pyramid's grid")?;
        // Within the image, a crop holds its core and this much on either side.
        let holds = |crop: &Range<usize>, core: &Range<usize>, before: i64, after: i64, length: usize| {
            let (first, last) = (core.start as i64 - before, core.end as i64 + after);
            crop.start as i64 <= first.max(0) && crop.end as i64 >= last.min(length as i64)
        };
        let overlap = overlap as i64;
        let (left, right) = (i64::from(range.max.max(0)), i64::from(-range.min.min(0)));
        ensure(holds(&crop.y, &core.y, overlap, overlap, height), "the overlap above and below")?;
        ensure(holds(&crop.x, &core.x, overlap + left, overlap + right, width), "overlap and matches")?;
        ensure(bytes(&tile.plan) <= memory, "each tile within the memory")?;
        // At half size, a crop of the pair is twice as large as the crop that is matched.
        let scale = if whole.full.is_some() { 2 } else { 1 };
        let of_pair = whole.of_pair();
        let in_one_piece = tiles.count() == 1;
        let (w, h) = if in_one_piece { of_pair.size } else { (scale * crop.size().0, scale * crop.size().1) };
        let mut expected = Plan {
            core: core.x.start - crop.x.start..core.x.end - crop.x.start,
            ..Plan::new(w, h, of_pair.range, &whole.method).unwrap()
        };
        if tiles.count() > 1 {
            let pairs = whole.pair_bytes() + whole.conditioning_bytes();
            let beside = (pairs + whole.mosaic_bytes()).div_ceil(1 << 20);
            expected.memory -= beside as u32;
            ensure(bytes(&tile.plan) <= u64::from(expected.memory + 1) << 20, "what is left of it")?;
        }
        // Without overlap a crop may be too small for all levels.
        ensure(overlap == 0 || tile.plan == expected, "the plan of the crop")?;
    }
    ensure(covered.data().iter().all(|&n| n == 1), "every pixel in one core")?;
    let one = bytes(whole) <= memory;
    ensure(one == (tiles.count() == 1), "in one piece if and only if that fits")
}

#[test]
fn cores_partition_the_image_and_crops_hold_what_they_need() {
    let mut random = Random::new(1);
    let (mut cut, mut refused, mut wide) = (0, 0, 0);
    for seed in 0..3000 {
        let mut side = || random.log_within(1.0, 3000.0) as usize;
        let size = (side(), side());
        let (most, lowest) =
            (random.pick(&[3.0, 100.0, 4000.0]), random.pick(&[-4000.0, -100.0, 0.0, 100.0]));
        let labels = random.log_within(1.0, most) as i32;
        let min = (lowest * f64::from(random.within(0, 100)) / 100.0) as i32;
        let range = DisparityRange::new(min, min + labels - 1).unwrap();
        let mut method = random.pick(PRESETS).method();
        method.graph.levels = random.pick(&[1, 2, 3, 6, 6, 6, 9, 16]);
        method.tiles.memory = random.log_within(1.0, 4096.0) as u32;
        let plan = Plan::new(size.0, size.1, range, &method).unwrap();
        let overlap = random.pick(&[0, OVERLAP, OVERLAP, 100]);
        match Tiles::with_overlap(&plan, overlap) {
            Ok(tiles) => {
                cut += usize::from(tiles.count() > 1);
                wide += usize::from(tiles.count() > 1 && range.max > size.0 as i32);
                if let Err(what) = check(&tiles, overlap) {
                    panic!("seed {seed}, {size:?}, {range:?}, overlap {overlap}: {what}\n{method:?}");
                }
            }
            Err(error) => {
                refused += 1;
                // The memory in the error is the least that is enough.
                let Error::Budget(BudgetError::NoTileFits { needed, .. }) = error else { panic!("{error}") };
                let needed = u32::try_from(needed).unwrap();
                assert!(needed > method.tiles.memory, "{error}");
                for (memory, enough) in [(needed, true), (needed - 1, false)] {
                    let plan = self::plan(size, range, &method, memory);
                    assert_eq!(Tiles::with_overlap(&plan, overlap).is_ok(), enough, "{memory} MiB: {error}");
                }
            }
        }
    }
    assert!(
        cut > 150 && refused > 100 && wide > 10,
        "{cut} cut, {refused} refused, {wide} with a wide range"
    );
}

/// Controls: the check detects crops without overlap.
#[test]
fn wrong_tiles_are_noticed() {
    let range = DisparityRange::new(-20, 63).unwrap();
    let plan = plan((900, 700), range, &Method::default(), 128);
    let tiles = Tiles::new(&plan).unwrap();
    assert!(tiles.count() >= 6, "{}", tiles.count());
    check(&tiles, OVERLAP).unwrap();
    assert_eq!(check(&tiles, OVERLAP + 40).unwrap_err(), "the overlap above and below");
    let bare = Tiles::with_overlap(&plan, 0).unwrap();
    assert_eq!(check(&bare, OVERLAP).unwrap_err(), "the overlap above and below");
}

/// Maps of tiles depend on where an image is cut, so that a change of the memory that a plan counts must move no cut.
#[test]
fn images_are_cut_where_they_always_were() {
    // Size, preset, largest disparity, memory in MiB; number of tiles, and the size of the one that takes the most memory.
    let cuts = [
        ((450, 375), "default", 63, 60, 9, (256, 192)),
        ((450, 375), "default", 255, 150, 20, (416, 96)),
        ((450, 375), "fast", 63, 24, 20, (128, 96)),
        ((450, 375), "paper", 63, 60, 10, (320, 128)),
        ((450, 375), "paper", 63, 150, 2, (450, 224)),
        ((450, 375), "paper", 255, 150, 30, (384, 96)),
        ((450, 375), "paper", 255, 400, 2, (450, 224)),
        ((1280, 720), "default", 63, 150, 30, (320, 224)),
        ((1280, 720), "default", 255, 400, 12, (640, 256)),
        ((1280, 720), "fast", 255, 150, 35, (256, 128)),
        ((1280, 720), "paper", 63, 150, 21, (512, 160)),
        ((1280, 720), "paper", 63, 400, 4, (704, 416)),
        ((1280, 720), "paper", 255, 400, 28, (576, 160)),
        ((1280, 720), "paper", 255, 1024, 6, (1280, 192)),
        ((3000, 2000), "default", 63, 1024, 6, (1568, 736)),
        ((3000, 2000), "default", 255, 1024, 27, (1216, 288)),
        ((3000, 2000), "fast", 255, 1024, 3, (1500, 360)),
        ((3000, 2000), "paper", 63, 400, 273, (352, 160)),
        ((3000, 2000), "paper", 63, 1024, 12, (1088, 576)),
        ((3000, 2000), "paper", 255, 1024, 80, (864, 192)),
    ];
    let mut moved = Vec::new();
    for (size, preset, max, memory, count, largest) in cuts {
        let method = Method::preset(preset).unwrap();
        let tiles = Tiles::new(&plan(size, DisparityRange::new(0, max).unwrap(), &method, memory)).unwrap();
        let found = (size, preset, max, memory, tiles.count(), tiles.largest().size());
        if found != (size, preset, max, memory, count, largest) {
            moved.push(found);
        }
    }
    assert!(moved.is_empty(), "{moved:?}");
}

#[test]
fn the_shape_with_the_fewest_cropped_pixels_is_taken() {
    // With few labels, tiles are as square as the image allows; with many, they are full rows.
    for (max, rows) in [(0, false), (1500, true)] {
        let plan = plan((2000, 2000), DisparityRange::new(max - 15, max).unwrap(), &Method::default(), 400);
        let tiles = Tiles::new(&plan).unwrap();
        let full = tiles.list().iter().all(|tile| tile.crop.x == (0..2000));
        assert!(tiles.count() > 1 && full == rows, "{max}: {:?}", tiles.list()[0].crop);
    }
}

fn load(folder: &Path) -> (Pair, DisparityRange) {
    let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
    let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
    (Pair::open(&left, &right).unwrap(), DisparityRange::new(0, ndisp as i32 - 1).unwrap())
}

fn in_tiles(backend: &mut dyn Backend, tiles: &Tiles, pair: &Pair) -> Solution {
    common::solve_tiles(backend, tiles, pair, &mut quiet).unwrap()
}

/// The percentage of pixels that have a disparity in only one of the maps, or disparities more than 1 px
/// apart.
fn difference(a: &Maps, b: &Maps) -> f64 {
    let pixels = a.disparity.data().iter().zip(b.disparity.data());
    let flags = a.validity.data().iter().zip(b.validity.data());
    let differ = pixels.zip(flags).filter(|((a, b), (fa, fb))| {
        has_disparity(**fa) != has_disparity(**fb) || has_disparity(**fa) && a.abs_diff(**b) > 256
    });
    100.0 * differ.count() as f64 / a.disparity.data().len() as f64
}

#[test]
fn every_backend_gives_the_same_maps() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, range) = load(Path::new("testdata/thin"));
    // `double_size.rs` and `half_size.rs` test tiles at the other sizes.
    for preset in PRESETS.iter().filter(|preset| preset.method().schedule.match_size == MatchSize::Full) {
        let (preset, method) = (preset.name, preset.method());
        let whole = plan(pair.size(), range, &method, 4096);
        let plan = plan(pair.size(), range, &method, (streamed(&whole).bytes() >> 20) as u32 * 3 / 4);
        let tiles = Tiles::new(&plan).unwrap();
        assert!(tiles.count() > 1, "{preset}");
        let memory = u64::from(plan.method.tiles.memory) << 20;
        let expected = in_tiles(&mut Cpu::default(), &tiles, &pair);
        // The default preset runs twice, the second time in the buffers of the first.
        for _ in 0..if preset == "default" { 2 } else { 1 } {
            let actual = in_tiles(&mut gpu, &tiles, &pair);
            assert!(actual.maps == expected.maps && actual.iterations == expected.iterations, "{preset}");
            let held = plan.pair_bytes() + plan.mosaic_bytes() + actual.traffic.bytes_held;
            assert!(held <= memory, "{preset}: {held} of {memory} bytes");
        }
        // Control: without an overlap the maps differ.
        let bare = Tiles::with_overlap(&plan, 0).unwrap();
        assert!(in_tiles(&mut Cpu::default(), &bare, &pair).maps != expected.maps, "{preset}");
    }
}

/// Scenes and real pairs in tiles: few pixels change, and more without overlap.
#[test]
fn tiling_changes_few_pixels() {
    let mut folders: Vec<_> = std::fs::read_dir("testdata").unwrap().map(|e| e.unwrap().path()).collect();
    if let Ok(folder) = std::env::var("MRFGS_MIDDLEBURY") {
        folders.extend(std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()));
    }
    folders.retain(|folder| folder.join("im0.png").is_file());
    folders.sort();
    let mut bare = Vec::new();
    for folder in folders {
        let (pair, range) = load(&folder);
        let mut cpu = Cpu::default();
        let whole = plan(pair.size(), range, &Method::default(), 4096);
        let expected = common::solve(&mut cpu, &whole, &pair, &mut quiet).unwrap();
        for (quarters, overlap) in [(3, OVERLAP), (2, OVERLAP), (2, 0)] {
            // Plain walls are estimated from their borders, however distant.
            let is_plain = ["wall", "poster", "corridor"].iter().any(|name| folder.ends_with(name));
            let most = match quarters {
                _ if is_plain => 1.5,
                3 => 0.03,
                _ => 0.07,
            };
            let memory = (streamed(&whole).bytes() * quarters / 4).div_ceil(1 << 20) as u32;
            let tiles =
                Tiles::with_overlap(&plan(pair.size(), range, &Method::default(), memory), overlap).unwrap();
            let differ = difference(&in_tiles(&mut cpu, &tiles, &pair).maps, &expected.maps);
            let name = folder.file_name().unwrap().display();
            println!("{name}, overlap {overlap}: {differ:.3} % differ in {} tiles", tiles.count());
            assert!(tiles.count() > 1);
            if overlap == 0 {
                bare.push(differ);
            } else {
                assert!(differ <= most, "{name}: {differ} %");
            }
        }
    }
    bare.sort_by(f64::total_cmp);
    assert!(bare[bare.len() / 2] > 0.03, "{bare:?}");
}

#[test]
fn progress_names_the_tiles_and_covers_all_of_them() {
    let (pair, range) = load(Path::new("testdata/slanted"));
    for left_right_check in [LeftRightCheck::RightView, LeftRightCheck::SecondMatch] {
        let mut method = Method::default();
        (method.refinement.left_right_check, method.schedule.iterations) = (left_right_check, 1);
        let tiles = Tiles::new(&plan(pair.size(), range, &method, 12)).unwrap();
        let mirrored = u32::from(left_right_check == LeftRightCheck::SecondMatch);
        let count = tiles.count() * (mirrored + tiles.whole().looks()) as usize;
        let mut seen = Vec::new();
        let mut observer = |progress: Progress| {
            seen.push(progress);
            ControlFlow::Continue(())
        };
        common::solve_tiles(&mut Cpu::default(), &tiles, &pair, &mut observer).unwrap();
        assert!(seen.is_sorted_by(|a, b| a.done <= b.done) && seen.iter().all(|p| p.done <= 1.0));
        let (first, last) = (seen[0], seen[seen.len() - 1]);
        assert!(first.done == 0.0 && last.done > 0.999 && last.tile.is_none(), "{last:?}");
        let mut named: Vec<_> = seen.iter().filter_map(|p| p.tile).collect();
        named.dedup();
        assert_eq!(named, (1..=count).map(|tile| (tile, count)).collect::<Vec<_>>());
        // Matching stops when the observer breaks.
        let stop = |p: Progress| if p.tile == Some((2, count)) { ControlFlow::Break(()) } else { quiet(p) };
        let stopped = common::solve_tiles(&mut Cpu::default(), &tiles, &pair, &mut { stop });
        assert!(matches!(stopped, Err(Error::Interrupted)));
    }
}

#[test]
fn the_matcher_splits_by_the_memory_of_the_method() {
    let (pair, range) = load(Path::new("testdata/thin"));
    let mut matcher = Matcher::builder().device("cpu").timings(true).build().unwrap();
    for (memory, tiled) in [(4096, false), (12, true)] {
        let mut method = Method::default();
        method.tiles.memory = memory;
        let matched = matcher.job(&pair, range).method(&method).run().unwrap();
        let tiles = Tiles::new(&plan(pair.size(), range, &method, memory)).unwrap();
        assert!(matched.tiles == tiles && (tiles.count() > 1) == tiled);
        assert_eq!(&matched.plan, tiles.whole());
        if tiled {
            assert!(matched.maps == in_tiles(&mut Cpu::default(), &tiles, &pair).maps);
        }
        // The tiles of the second look are prepared again.
        let all = tiles.count() * if tiled { 2 } else { 1 };
        for (stage, runs) in [("cost", all), ("graph", all), ("vote_fill", 2), ("plane", 1)] {
            let timing = matched.timings.iter().find(|timing| timing.stage == stage).unwrap();
            assert_eq!(timing.runs as usize, runs, "{stage}");
        }
    }
}
