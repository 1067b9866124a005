//! Blocks: pairs that do not fit in the memory of their method.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::random::Random;
use mrfgs::error::BudgetError;
use mrfgs::image::{Image, Pair, Plane, Rect};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Method, PRESETS};
use mrfgs::region::{Blocks, Region};
use mrfgs::{Conditioning, Error, Matcher, Prior, Progress};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

/// Pixels around a block that are matched with it.
const MARGIN: usize = 128;

/// Whether a match of `region`'s window fits in the memory of `method`.
fn fits(region: &Region, range: DisparityRange, method: &Method) -> bool {
    let (width, height) = region.window().size();
    Tiles::new(&Plan::new(width, height, range, method).unwrap().with_prior(true)).is_ok()
}

#[test]
fn blocks_partition_the_view_and_windows_hold_what_they_need() {
    let mut random = Random::new(61);
    let (mut cut, mut refused) = (0, 0);
    for seed in 0..200 {
        let size = (random.log_within(1.0, 30_000.0) as usize, random.log_within(1.0, 30_000.0) as usize);
        let (labels, min) = (random.log_within(1.0, 600.0) as i32, random.within(0, 400) as i32 - 200);
        let range = DisparityRange::new(min, min + labels - 1).unwrap();
        let mut method = random.pick(PRESETS).method();
        method.tiles.memory = random.log_within(2.0, 8192.0) as u32;
        method.refinement.right_map = random.pick(&[false, true]);
        let case = format!("seed {seed}, {size:?}, {range:?}, {} MiB", method.tiles.memory);
        let blocks = match Blocks::new(size, range, &method) {
            Ok(blocks) => blocks,
            Err(Error::Budget(BudgetError::NoTileFits { needed, width, height, .. })) => {
                refused += 1;
                assert_eq!((width, height), size, "{case}");
                // With as much as the error asks for, there are blocks, or tiles of the whole pair.
                method.tiles.memory = u32::try_from(needed).unwrap();
                let whole = Plan::new(size.0, size.1, range, &method).unwrap();
                let fits = Blocks::new(size, range, &method).is_ok() || Tiles::new(&whole).is_ok();
                assert!(fits, "{case}, {needed} MiB");
                continue;
            }
            Err(e) => panic!("{case}: {e}"),
        };
        assert_eq!(blocks.size(), size);
        // They pay where tiles do not fit.
        let whole = Plan::new(size.0, size.1, range, &method).unwrap();
        assert!(Tiles::new(&whole).is_ok() || Blocks::pay(size, range, &method).unwrap(), "{case}");
        cut += usize::from(blocks.list().len() > 1);
        let step = 1 << (Plan::new(size.0, size.1, range, &method).unwrap().levels.len() - 1);
        let (mut pixels, mut sizes) = (0, BTreeSet::new());
        let mut last: Option<&Rect> = None;
        for block in blocks.list() {
            let (part, window) = (block.part(), block.window());
            if sizes.insert(window.size()) {
                assert!(fits(block, range, &method), "{case}");
            }
            // Those at a border need no margin there, and may be wider by that.
            assert!(
                window.size().0 <= 4096 + 2 * (MARGIN + 800) && window.size().1 <= 4096 + 4 * MARGIN,
                "{case}: {part:?}"
            );
            pixels += part.size().0 * part.size().1;
            // Side by side, then the next row of blocks: with the number of pixels, a partition.
            if let Some(last) = last {
                let beside = part.y == last.y && part.x.start == last.x.end;
                let below = last.x.end == size.0 && part.x.start == 0 && part.y.start == last.y.end;
                assert!(beside || below, "{case}: {last:?}, {part:?}");
            }
            last = Some(part);
            let mut reach = [range.max.max(0), (-range.min).max(0)].map(|reach| reach as usize);
            if method.refinement.right_map {
                reach = [reach[0].max(reach[1]); 2];
            }
            assert!(window.x.start <= part.x.start.saturating_sub(MARGIN + reach[0]), "{case}");
            assert!(window.x.end >= (part.x.end + MARGIN + reach[1]).min(size.0), "{case}");
            assert!(window.y.start <= part.y.start.saturating_sub(MARGIN), "{case}");
            assert!(window.y.end >= (part.y.end + MARGIN).min(size.1), "{case}");
            assert!(window.x.start.is_multiple_of(step) && window.y.start.is_multiple_of(step), "{case}");
        }
        assert_eq!((pixels, last.unwrap().y.end), (size.0 * size.1, size.1), "{case}");
        for sample in blocks.samples() {
            assert!(!sample.x.is_empty() && sample.x.end <= size.0 && sample.y.end <= size.1, "{case}");
            assert!(sample.y.len() <= 1025 || blocks.samples().len() == 1, "{case}");
        }
    }
    assert!(cut > 30 && refused > 15, "{cut} {refused}");
}

/// A pair of `size` with a slanted floor and boxes on it, and the right view one row lower if `shifted`.
fn scene((width, height): (usize, usize), shifted: bool) -> Pair {
    let noise = |x: usize, y: usize| {
        let hash = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
        (hash.wrapping_mul(0xc2b2_ae35) >> 24) as u8
    };
    let texture =
        |x: usize, y: usize| ((2 * u16::from(noise(x / 3, y / 3)) + u16::from(noise(x, y))) / 3) as u8;
    let disparity =
        |x: usize, y: usize| if x / 150 % 3 == 1 && y / 120 % 2 == 1 { 24 } else { 4 + 12 * y / height };
    let left = Plane::from_fn(width, height, |x, y| [texture(x + 64, y); 3]);
    let right = Plane::from_fn(width, height, |x, y| {
        let y = y.saturating_sub(usize::from(shifted));
        // The nearest surface that projects here.
        let d = (0..=30).rev().find(|d| x + d < width && disparity(x + d, y) == *d).unwrap_or(0);
        [texture(x + 64 + d, y); 3]
    });
    Pair::new(Image::from_rgb8(&left), Image::from_rgb8(&right)).unwrap()
}

/// The percentage of pixels that differ by more than 1 px.
fn moved(some: &Maps, others: &Maps) -> f64 {
    let (some, others) = (some.final_map(), others.final_map());
    let pixels = some.data().iter().zip(others.data());
    let moved = pixels.filter(|(a, b)| a.is_finite() != b.is_finite() || (**a - **b).abs() > 1.0).count();
    100.0 * moved as f64 / some.data().len() as f64
}

const RANGE: DisparityRange = DisparityRange { min: 0, max: 31 };

fn cpu() -> Matcher {
    Matcher::builder().device("cpu").build().unwrap()
}

/// A pair whose maps alone exceed the memory is nearly matched as in one go, and exactly like its blocks one by one.
#[test]
fn a_pair_larger_than_memory_is_matched_in_blocks() {
    for (preset, memory) in [("default", 96), ("fast", 64)] {
        let pair = scene((1201, 803), true);
        let mut method = Method::preset(preset).unwrap();
        method.refinement.right_map = true;
        let whole = cpu().job(&pair, RANGE).method(&method).run().unwrap();
        method.tiles.memory = memory;
        let blocks = Blocks::new(pair.size(), RANGE, &method).unwrap();
        let mut shares = Vec::new();
        let listen = |progress: Progress| shares.push(progress.done);
        let found = cpu().job(&pair, RANGE).method(&method).on_progress(listen).run().unwrap();
        assert_eq!((found.blocks, whole.blocks), (blocks.list().len(), 1), "{preset}");
        assert!(found.blocks > 2, "{preset}: {}", found.blocks);
        assert!(shares.is_sorted() && *shares.last().unwrap() > 0.9, "{preset}: {shares:?}");
        // The right view is lower, and so it is for each block: measured on the whole pair, or in samples.
        let [found_offset, whole_offset] = [&found, &whole].map(|matched| matched.conditioning.offset);
        assert!(
            whole_offset > 200 && found_offset.abs_diff(whole_offset) <= 8,
            "{preset}: {found_offset} and {whole_offset}"
        );
        assert_eq!(blocks.samples().len(), if preset == "default" { 1 } else { 9 });
        let off = moved(&found.maps, &whole.maps);
        assert!(off < 0.1, "{preset}: {off} %, {} blocks", found.blocks);

        let mut joined = Maps::blank(pair.size(), true);
        for block in blocks.list() {
            let window = block.window_of(&pair);
            let job =
                |method| cpu().job(&window, RANGE).method(method).conditioning(found.conditioning).run();
            joined.paste(&block.maps_of(&job(&method).unwrap().maps), block.part());
        }
        assert!(joined == found.maps, "{preset}");
        // Control: without a margin, the blocks differ more.
        let mut bare = Maps::blank(pair.size(), true);
        for block in blocks.list() {
            let part = pair.crop(block.part());
            let job = cpu().job(&part, RANGE).method(&method).conditioning(found.conditioning).run();
            bare.paste(&job.unwrap().maps, block.part());
        }
        let off_bare = moved(&bare, &whole.maps);
        assert!(off_bare > 10.0 * off && off_bare > 0.1, "{preset}: {off_bare} % and {off} %");
    }
}

/// Each block takes its part of a prior.
#[test]
fn a_prior_is_known_in_all_blocks() {
    let pair = scene((1201, 803), false);
    let (width, height) = pair.size();
    let mut method = Method::default();
    method.tiles.memory = 64;
    let points: Vec<_> = (0..height)
        .step_by(16)
        .flat_map(|y| (0..width).step_by(16).map(move |x| (x as f64, y as f64, 9.0, 0.25)))
        .map(|(x, y, disparity, sigma)| mrfgs::prior::PriorPoint { x, y, disparity, sigma })
        .collect();
    let given = points.len();
    let prior = Prior::points((width, height), points).unwrap();
    let found = cpu().job(&pair, RANGE).method(&method).prior(prior).run().unwrap();
    assert!(found.blocks > 1);
    // Points in a margin count for each of their blocks.
    let used = found.prior.unwrap();
    assert!(used.given >= given && used.given < 4 * given, "{used:?} of {given}");
}

#[test]
fn corrections_are_medians() {
    let of = |offset, left| Conditioning::measured(&scene((400, 300), offset), RANGE, &left).unwrap();
    let [level, low] = [false, true].map(|shifted| of(shifted, Method::default()));
    assert_eq!(level.offset, 0);
    assert!(low.offset > 200, "{low}");
    assert_eq!(Conditioning::median(&[low, level, low]), low);
    assert_eq!(Conditioning::median(&[level, level, low]), level);
    assert_eq!(Conditioning::median(&[]), Conditioning::default());
}

/// `image` at three times its size, between pixels interpolated.
fn enlarged(image: &Image) -> Image {
    let (width, height) = image.pixels.size();
    let rgb = image.to_rgb8();
    let value = |x: usize, y: usize| {
        let (left, above) = (x / 3, y / 3);
        let (right, below) = ((left + 1).min(width - 1), (above + 1).min(height - 1));
        [0, 1, 2].map(|c| {
            let along = |y: usize| {
                (3 - x % 3) * usize::from(rgb[(left, y)][c]) + x % 3 * usize::from(rgb[(right, y)][c])
            };
            (((3 - y % 3) * along(above) + y % 3 * along(below) + 4) / 9) as u8
        })
    };
    Image::from_rgb8(&Plane::from_fn(3 * width, 3 * height, value))
}

/// The seams of real pairs: of five, enlarged to three times their size, hardly a pixel moves.
#[test]
fn real_pairs_have_hardly_any_seams() {
    let Some(folder) = std::env::var_os("MRFGS_MIDDLEBURY").map(PathBuf::from) else {
        let _ = writeln!(std::io::stderr(), "SKIPPED on real pairs: MRFGS_MIDDLEBURY names no folder");
        return;
    };
    let mut method = Method::fast();
    let (mut all, mut bare) = (Vec::new(), Vec::new());
    for (name, max) in [("Teddy", 59), ("Cones", 59), ("Dolls", 73), ("Rocks1", 57), ("Motorcycle", 69)] {
        let pair = Pair::open(folder.join(name).join("im0.png"), folder.join(name).join("im1.png")).unwrap();
        let pair = Pair::new(enlarged(pair.left()), enlarged(pair.right())).unwrap();
        let range = DisparityRange::new(0, 3 * max + 2).unwrap();
        method.tiles.memory = 4096;
        let whole = cpu().job(&pair, range).method(&method).run().unwrap();
        method.tiles.memory = 128;
        let blocks = Blocks::new(pair.size(), range, &method).unwrap();
        assert!(blocks.list().len() >= 4, "{name}: {}", blocks.list().len());
        let share_of = |pair_of: &dyn Fn(&Region) -> Rect| {
            let mut joined = Maps::blank(pair.size(), false);
            for block in blocks.list() {
                let window = pair_of(block);
                let part = pair.crop(&window);
                let job = cpu().job(&part, range).method(&method).conditioning(whole.conditioning).run();
                joined.paste(&job.unwrap().maps.crop(&block.part().within(&window)), block.part());
            }
            moved(&joined, &whole.maps)
        };
        all.push(share_of(&|block| block.window().clone()));
        bare.push(share_of(&|block| block.part().clone()));
        println!(
            "{name}: {} blocks, {:.4} %, without a margin {:.2} %",
            blocks.list().len(),
            all[all.len() - 1],
            bare[bare.len() - 1]
        );
    }
    assert!(all.iter().all(|share| *share < 0.2), "{all:?}");
    assert!(bare.iter().all(|share| *share > 0.5), "{bare:?}");
}
