//! Sequences of pairs through one matcher: the same maps as one by one, in order, with the device always
//! busy.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices::open as device;
use common::random::{self, Random};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Execution, Method};
use mrfgs::{Conditioning, Error, Matched, Matcher, Result};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Mutex, mpsc::Receiver};
use std::time::Duration;

/// Pairs of several sizes and ranges; some repeat, and one needs tiles under [`method`].
fn pairs() -> Vec<(Pair, DisparityRange)> {
    let mut random = Random::new(5);
    [(40, 24, 15), (40, 24, 15), (33, 50, 21), (300, 260, 40), (40, 24, 15), (33, 50, 21)]
        .map(|(width, height, most)| {
            (random::pair(&mut random, width, height), DisparityRange::new(-2, most).unwrap())
        })
        .into()
}

fn method() -> Method {
    let mut method = Method::default();
    method.set("memory", "24").unwrap();
    // The pairs show different scenes.
    method.set("measure-every", "1").unwrap();
    method
}

fn on_cpu() -> Matcher {
    Matcher::builder().device("cpu").build().unwrap()
}

fn one_by_one() -> Vec<Maps> {
    let mut matcher = on_cpu();
    let mut run = |(pair, range): (Pair, DisparityRange)| {
        let matched = matcher.job(&pair, range).method(&method()).run().unwrap();
        (matched.maps, matched.tiles.count())
    };
    let (maps, tiles): (Vec<_>, Vec<_>) = pairs().into_iter().map(&mut run).unzip();
    assert_eq!(tiles.iter().filter(|&&count| count > 1).count(), 1, "{tiles:?}");
    // Control: all maps differ, so exchanged pairs would be detected.
    assert!((1..maps.len()).all(|i| maps[..i].iter().all(|other| *other != maps[i])));
    maps
}

/// The results of `matcher` for `pairs`, and a log of the order of requests and results.
fn all(
    matcher: &mut Matcher,
    pairs: Vec<(Pair, DisparityRange)>,
    stop_after: usize,
) -> (Result<()>, Vec<Matched>, String) {
    let log = Mutex::new(String::new());
    let asked = pairs.into_iter().enumerate().map(|(i, pair)| {
        write!(log.lock().unwrap(), "ask {i}, ").unwrap();
        pair
    });
    matcher.set_method(method());
    let mut found = Vec::new();
    let result = matcher.run_all(asked, |matched| {
        write!(log.lock().unwrap(), "take {}, ", found.len()).unwrap();
        found.push(matched);
        if found.len() == stop_after { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    (result, found, log.into_inner().unwrap())
}

fn assert_same(found: Vec<Matched>, expected: &[Maps]) {
    assert_eq!(found.len(), expected.len());
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(found.maps == *expected, "pair {i} on {}", found.ran_on);
    }
}

#[test]
fn a_sequence_equals_its_single_pairs() {
    let expected = one_by_one();
    for threads in [1, 2, 5] {
        let mut matcher = Matcher::builder().device("cpu").threads(threads).build().unwrap();
        let (result, found, log) = all(&mut matcher, pairs(), usize::MAX);
        result.unwrap();
        assert!((0..6).all(|i| log.contains(&format!("ask {i}, ")) && log.contains(&format!("take {i}, "))));
        assert_same(found, &expected);
        // Unfinished work does not affect the next sequence.
        let (result, found, _) = all(&mut matcher, pairs(), 2);
        result.unwrap();
        assert_same(found, &expected[..2]);
        let (result, found, _) = all(&mut matcher, pairs(), usize::MAX);
        result.unwrap();
        assert_same(found, &expected);
    }

    let Some(gpu) = device(FaultInjection::default()) else { return };
    let mut matcher = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
    let (result, found, log) = all(&mut matcher, pairs(), usize::MAX);
    result.unwrap();
    // A device receives the next pair before it returns the maps of the last, except for the pair in tiles.
    let order = "ask 0, ask 1, take 0, ask 2, take 1, ask 3, take 2, take 3, ask 4, ask 5, take 4, take 5, ";
    assert_eq!(log, order);
    for matched in &found {
        assert!(!matched.ran_on.contains("CPU path") && matched.traffic.bytes_up > 0, "{}", matched.ran_on);
        // Three maps of four bytes per pixel; nothing of the next pair is counted.
        let (width, height) = matched.plan.size();
        let down = matched.traffic.bytes_down as usize;
        assert!(down >= 12 * width * height && (matched.tiles.count() > 1 || down < 60 * width * height));
    }
    assert_same(found, &expected);
    let (result, found, log) = all(&mut matcher, pairs(), 2);
    result.unwrap();
    assert_eq!(log, "ask 0, ask 1, take 0, ask 2, take 1, ");
    assert_same(found, &expected[..2]);
    let (result, found, _) = all(&mut matcher, pairs(), usize::MAX);
    result.unwrap();
    assert_same(found, &expected);
}

/// Five frames of `one` and `other`, in turns but for the last.
fn in_turns(one: &Pair, other: &Pair) -> Vec<(Pair, DisparityRange)> {
    let range = DisparityRange::new(0, 31).unwrap();
    [one, other, one, other, one].map(|pair| (pair.clone(), range)).into()
}

fn scene(name: &str) -> Pair {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name);
    Pair::open(folder.join("im0.png"), folder.join("im1.png")).unwrap()
}

/// Frames whose right view lies too low, and in every other one a row lower still.
fn slipping() -> Vec<(Pair, DisparityRange)> {
    let low = scene("rows");
    let right = low.right();
    let lowered = |x: usize, y: usize| right.pixels[(x, y.saturating_sub(1))];
    let pixels = Plane::from_fn(right.width(), right.height(), lowered);
    let lower = Pair::new(low.left().clone(), Image { pixels, masked: right.masked.clone() }).unwrap();
    in_turns(&low, &lower)
}

/// Frames of which one view is out of focus, by turns the left and the right one.
fn unfocused() -> Vec<(Pair, DisparityRange)> {
    let sharp = scene("slanted");
    let right = sharp.right();
    let (width, height) = sharp.size();
    let pixels = Plane::from_fn(width, height, |x, y| {
        let clamped = |v: usize, most: usize| v.saturating_sub(5).min(most - 1);
        let around =
            (y..y + 11).flat_map(|v| (x..x + 11).map(move |u| (clamped(u, width), clamped(v, height))));
        let mut sums = [0; 4];
        for at in around {
            sums.iter_mut().zip(right.pixels[at]).for_each(|(sum, v)| *sum += u32::from(v));
        }
        sums.map(|sum| (sum / 121) as u16)
    });
    let one = Pair::new(sharp.left().clone(), Image { pixels, masked: right.masked.clone() }).unwrap();
    in_turns(&one, &one.mirrored())
}

/// The corrections of a group of frames are measured on its first frame only, on every backend and number of threads.
#[test]
fn frames_are_corrected_like_the_measured_one() {
    for (preset, frames) in [("default", slipping()), ("fast", unfocused())] {
        let mut every_third = Method::preset(preset).unwrap();
        every_third.set("measure-every", "3").unwrap();
        let mut each = every_third.clone();
        each.set("measure-every", "1").unwrap();
        let mut cpu = on_cpu();
        let alone: Vec<Matched> = frames
            .iter()
            .map(|(pair, range)| cpu.job(pair, *range).method(&every_third).run().unwrap())
            .collect();
        let faults = [0, 1].map(|i| alone[i].conditioning);
        let none = Conditioning::default();
        assert!(!faults.contains(&none) && faults[0] != faults[1], "{preset}: {faults:?}");
        let expected: Vec<Matched> = frames
            .iter()
            .enumerate()
            .map(|(i, (pair, range))| {
                let known = alone[i / 3 * 3].conditioning;
                cpu.job(pair, *range).method(&every_third).conditioning(known).run().unwrap()
            })
            .collect();
        // Control: a frame by itself is corrected otherwise.
        assert!(expected[1].maps != alone[1].maps && expected[3].maps == alone[3].maps, "{preset}");
        let same = |matcher: &mut Matcher| {
            for (method, expected) in [(&every_third, &expected), (&each, &alone)] {
                matcher.set_method(method.clone());
                let mut found = Vec::new();
                let taken = matcher.run_all(frames.clone(), |matched| {
                    found.push(matched);
                    ControlFlow::Continue(())
                });
                taken.unwrap();
                assert_eq!(found.len(), expected.len());
                for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                    assert_eq!(found.conditioning, expected.conditioning, "{preset}: frame {i}");
                    assert!(found.maps == expected.maps, "{preset}: frame {i} on {}", found.ran_on);
                }
            }
        };
        for threads in [1, 2] {
            same(&mut Matcher::builder().device("cpu").threads(threads).build().unwrap());
        }
        same(&mut Matcher::builder().device("cpu").timings(true).build().unwrap());
        let Some(gpu) = device(FaultInjection::default()) else { continue };
        same(&mut Matcher::on(Ok(gpu), false, &Execution::default()).unwrap());
    }
}

/// A frame of another size or range is measured by itself.
#[test]
fn other_frames_are_measured_again() {
    let mut frames: Vec<_> = slipping().into_iter().take(2).collect();
    frames[1].1.max += 2;
    let mut matcher = on_cpu();
    let alone: Vec<_> =
        frames.iter().map(|(pair, range)| matcher.run(pair, *range).unwrap().conditioning).collect();
    let mut found = Vec::new();
    let taken = matcher.run_all(frames, |matched| {
        found.push(matched.conditioning);
        ControlFlow::Continue(())
    });
    taken.unwrap();
    assert_eq!(found, alone);
    assert_ne!(alone[0], alone[1]);
}

/// Waits for a message, with a time limit.
fn heard<T>(from: &Receiver<T>) -> T {
    from.recv_timeout(Duration::from_secs(60)).expect("what this waits for never comes")
}

/// The CPU path matches pairs in parallel: two are in progress and a third is requested before the first is taken.
#[test]
fn the_cpu_path_matches_pairs_in_parallel() {
    let expected = one_by_one();
    let mut matcher = Matcher::builder().device("cpu").threads(2).build().unwrap();
    matcher.set_method(method());
    let (ask, asked) = channel();
    let three = pairs().into_iter().take(3).inspect(|_| ask.send(()).unwrap());
    let mut found = Vec::new();
    let maps = &mut found;
    let result = matcher.run_all(three, move |matched| {
        if maps.is_empty() {
            (0..3).for_each(|_| heard(&asked));
        }
        maps.push(matched);
        ControlFlow::Continue(())
    });
    result.unwrap();
    assert_same(found, &expected[..3]);
}

/// A slow source gets the map of each frame before its next frame.
#[test]
fn a_result_does_not_wait_for_the_next_pair() {
    let expected = one_by_one();
    let mut matcher = Matcher::builder().device("cpu").threads(2).build().unwrap();
    matcher.set_method(method());
    let (take, taken) = channel();
    let one_at_a_time = pairs().into_iter().enumerate().inspect(|(i, _)| {
        if *i > 0 {
            heard(&taken);
        }
    });
    let mut found = Vec::new();
    let result = matcher.run_all(one_at_a_time.map(|(_, pair)| pair), |matched| {
        found.push(matched);
        take.send(()).unwrap();
        ControlFlow::Continue(())
    });
    result.unwrap();
    assert_same(found, &expected);
}

/// Wherever in the sequence a device is lost, the CPU path takes over, and each pair is matched once.
#[test]
fn a_device_lost_within_a_sequence_costs_no_pair() {
    let expected = one_by_one();
    let (mut by_device, mut by_cpu) = (false, false);
    for stages in [0, 30, 350, 450, 550, 700, 900, 1200] {
        let Some(gpu) = device(FaultInjection { lost_after: Some(stages), ..FaultInjection::default() })
        else {
            return;
        };
        let mut matcher = Matcher::on(Ok(gpu), true, &Execution::default()).unwrap();
        let (result, found, _) = all(&mut matcher, pairs(), usize::MAX);
        result.unwrap();
        by_device |= found.iter().any(|matched| matched.note.is_none());
        by_cpu |= found.iter().any(|matched| matched.note.is_some());
        assert_same(found, &expected);
    }
    assert!(by_device && by_cpu);
}

/// A pair that cannot be matched ends the sequence, after the pairs before it are returned.
#[test]
fn results_before_a_failure_are_handed_out() {
    let expected = one_by_one();
    let mut with_a_bad_one = pairs();
    // The memory of the method is too small for any tile.
    with_a_bad_one[2].1 = DisparityRange::new(0, 16_000).unwrap();
    let mut matchers = vec![on_cpu()];
    matchers.extend(
        device(FaultInjection::default())
            .map(|gpu| Matcher::on(Ok(gpu), false, &Execution::default()).unwrap()),
    );
    for mut matcher in matchers {
        let (result, found, _) = all(&mut matcher, with_a_bad_one.clone(), usize::MAX);
        let error = result.unwrap_err();
        assert!(matches!(error, Error::Budget(_)), "{error}");
        assert_same(found, &expected[..2]);
    }
}

/// A stopped sequence ends during the running matches.
#[test]
fn a_sequence_can_be_stopped() {
    let expected = one_by_one();
    let mut matchers = vec![on_cpu()];
    matchers.extend(
        device(FaultInjection::default())
            .map(|gpu| Matcher::on(Ok(gpu), false, &Execution::default()).unwrap()),
    );
    for mut matcher in matchers {
        matcher.set_method(method());
        let (stop, mut found) = (AtomicBool::new(false), Vec::new());
        let asked = pairs().into_iter().enumerate().map(|(i, pair)| {
            stop.fetch_or(i == 2, Ordering::Relaxed);
            pair
        });
        let result = matcher.run_all_until(asked, &stop, |matched| {
            found.push(matched);
            ControlFlow::Continue(())
        });
        assert_eq!(result, Err(Error::Interrupted), "{}", found.len());
        // The CPU path may have matched both already.
        assert!(found.len() <= 2);
        let count = found.len();
        assert_same(found, &expected[..count]);
        // Control: without a stop the sequence runs to its end, also after a stopped one.
        let (stop, mut count) = (AtomicBool::new(false), 0);
        let result = matcher.run_all_until(pairs(), &stop, |_| {
            count += 1;
            ControlFlow::Continue(())
        });
        assert_eq!((result, count), (Ok(()), expected.len()));
    }
}
