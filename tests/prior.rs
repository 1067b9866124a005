//! What is known of a scene: it helps, a wrong prior does little harm, and every device gives the same maps with it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use mrfgs::evaluation::GroundTruth;
use mrfgs::image::{Pair, Plane, Rect, read};
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::maps::{Maps, flag};
use mrfgs::options::{DisparityRange, Execution, LeftRightCheck, Method};
use mrfgs::prior::{PriorKind, PriorUse};
use mrfgs::{Error, Frame, Matched, Matcher, Prior};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const RANGE: DisparityRange = DisparityRange { min: 0, max: 47 };

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

fn scene(name: &str) -> (Pair, Plane<f32>) {
    let pair = Pair::open(folder(name).join("im0.png"), folder(name).join("im1.png")).unwrap();
    (pair, read::read_disparity(&folder(name).join("disp0GT.pfm")).unwrap())
}

/// The truth at every `step`-th column and row, changed by `change`; unknown elsewhere.
fn sampled(truth: &Plane<f32>, step: usize, change: impl Fn(usize, usize, f32) -> f32) -> Plane<f32> {
    let (width, height) = truth.size();
    Plane::from_fn(width, height, |x, y| {
        if x % step == 0 && y % step == 0 { change(x, y, truth[(x, y)]) } else { f32::INFINITY }
    })
}

fn points(truth: &Plane<f32>, step: usize) -> Arc<Prior> {
    Arc::new(Prior::map(PriorKind::Points, &sampled(truth, step, |_, _, d| d), 0.25).unwrap())
}

fn cpu() -> Matcher {
    Matcher::builder().device("cpu").build().unwrap()
}

fn matched(matcher: &mut Matcher, pair: &Pair, method: &Method, prior: Option<&Arc<Prior>>) -> Matched {
    let job = matcher.job(pair, RANGE).method(method);
    let job = match prior {
        Some(prior) => job.prior(Arc::clone(prior)),
        None => job,
    };
    job.run().unwrap()
}

/// Percentage of the pixels with known truth that are wrong by more than 2 px.
fn wrong(maps: &Maps, truth: &Plane<f32>) -> f64 {
    let ground = GroundTruth::new(truth.clone(), None).unwrap();
    ground.evaluate(&maps.final_map()).unwrap().all.bad[2]
}

fn used(matched: &Matched) -> PriorUse {
    matched.prior.expect("a prior")
}

/// The poster is a plain wall, where matches say little.
#[test]
fn points_help_where_matches_say_little() {
    for (name, most) in [("poster", 0.35), ("mixed", 0.95), ("corridor", 0.5)] {
        let (pair, truth) = scene(name);
        let prior = points(&truth, 10);
        let without = matched(&mut cpu(), &pair, &Method::default(), None);
        let with = matched(&mut cpu(), &pair, &Method::default(), Some(&prior));
        let (before, after) = (wrong(&without.maps, &truth), wrong(&with.maps, &truth));
        assert!(after < most * before, "{name}: {before} %, then {after} %");
        assert_eq!(used(&with).given, prior.count(), "{name}");
        assert!(used(&with).trust > 0.9, "{name}: {}", used(&with).trust);
        // Some pixels were decided by the prior, and say so.
        assert!(with.maps.validity.data().contains(&flag::FILLED), "{name}");
        assert!(!without.maps.validity.data().contains(&flag::FILLED), "{name}");
    }
}

#[test]
fn a_coarse_surface_helps() {
    let (pair, truth) = scene("poster");
    // Off by up to 2 px, in patches.
    let off = |x: usize, y: usize| ((x / 40 * 7 + y / 40 * 3) % 5) as f32 - 2.0;
    let surface =
        Arc::new(Prior::map(PriorKind::Surface, &sampled(&truth, 1, |x, y, d| d + off(x, y)), 2.0).unwrap());
    let before = wrong(&matched(&mut cpu(), &pair, &Method::default(), None).maps, &truth);
    let after = wrong(&matched(&mut cpu(), &pair, &Method::default(), Some(&surface)).maps, &truth);
    assert!(after < 0.7 * before, "{before} %, then {after} %");
}

#[test]
fn outliers_are_dropped() {
    let (pair, truth) = scene("mixed");
    // Every fifth point is wrong.
    let is_wrong = |x: usize, y: usize| (x / 8 + 3 * (y / 8)).is_multiple_of(5);
    let change =
        |x: usize, y: usize, d: f32| if is_wrong(x, y) { ((x * 31 + y * 17) % 47) as f32 } else { d };
    let prior = Arc::new(Prior::map(PriorKind::Points, &sampled(&truth, 8, change), 0.25).unwrap());
    let with = matched(&mut cpu(), &pair, &Method::default(), Some(&prior));
    let share = used(&with).dropped as f64 / used(&with).given as f64;
    assert!((0.1..0.25).contains(&share), "{share} dropped");
    let before = wrong(&matched(&mut cpu(), &pair, &Method::default(), None).maps, &truth);
    assert!(wrong(&with.maps, &truth) < before);
}

#[test]
fn a_wrong_prior_does_little_harm() {
    for name in ["mixed", "slanted", "poster"] {
        let (pair, truth) = scene(name);
        let (width, height) = truth.size();
        let random = Plane::from_fn(width, height, |x, y| ((x * 7919 + y * 104_729 + x * y) % 48) as f32);
        // Smooth, and of another scene.
        let smooth = Plane::from_fn(width, height, |x, y| {
            46.0 - (x + 2 * y) as f32 * 40.0 / (width + 2 * height) as f32
        });
        let before = wrong(&matched(&mut cpu(), &pair, &Method::default(), None).maps, &truth);
        for (what, map) in [("random", random), ("smooth", smooth)] {
            for (kind, step) in [(PriorKind::Points, 8), (PriorKind::Surface, 1)] {
                let prior = Prior::map(kind, &sampled(&map, step, |_, _, d| d), 0.5).unwrap();
                let with = matched(&mut cpu(), &pair, &Method::default(), Some(&Arc::new(prior)));
                let after = wrong(&with.maps, &truth);
                assert!(
                    after < 1.05 * before + 0.1,
                    "{name}, {what}, {kind:?}: {before} %, then {after} %: {:?}",
                    used(&with)
                );
            }
        }
    }
}

#[test]
fn devices_agree_with_a_prior() {
    let Some(gpu) = devices::open(FaultInjection::default()) else { return };
    let mut gpu = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
    let (pair, truth) = scene("mixed");
    let part = Rect { x: 0..200, y: 0..150 };
    let (pair, truth) = (pair.crop(&part), truth.crop(&part));
    let prior = points(&truth, 9);
    let surface =
        Arc::new(Prior::map(PriorKind::Surface, &sampled(&truth, 1, |_, _, d| d + 1.5), 1.5).unwrap());
    let mut second = Method::default();
    second.refinement.left_right_check = LeftRightCheck::SecondMatch;
    second.refinement.right_map = true;
    let mut tiles = Method::default();
    tiles.tiles.memory = 16;
    let methods = [Method::default(), Method::fast(), Method::accurate(), second, tiles];
    for (i, method) in methods.iter().enumerate() {
        for prior in [&prior, &surface] {
            let (on_gpu, on_cpu) = (
                matched(&mut gpu, &pair, method, Some(prior)),
                matched(&mut cpu(), &pair, method, Some(prior)),
            );
            assert_eq!(on_cpu.tiles.count() > 1, i == 4);
            assert!(on_gpu.maps == on_cpu.maps, "method {i}");
            // Control: without the prior, the maps are others.
            assert!(matched(&mut cpu(), &pair, method, None).maps != on_cpu.maps, "method {i}");
        }
    }
}

#[test]
fn a_prior_that_knows_nothing_changes_nothing() {
    let (pair, truth) = scene("mixed");
    let nothing = Prior::map(PriorKind::Points, &truth.map(|_| f32::NAN), 1.0).unwrap();
    let outside = Prior::map(PriorKind::Surface, &truth.map(|_| 300.0), 1.0).unwrap();
    for method in [Method::default(), Method::fast()] {
        let expected = matched(&mut cpu(), &pair, &method, None).maps;
        for prior in [&nothing, &outside] {
            assert!(matched(&mut cpu(), &pair, &method, Some(&Arc::new(prior.clone()))).maps == expected);
        }
    }
}

#[test]
fn regions_take_their_part_of_a_prior() {
    let (pair, truth) = scene("mixed");
    let prior = points(&truth, 9);
    let part = Rect { x: 83..171, y: 41..120 };
    let mut matcher = cpu();
    let region = |matcher: &mut Matcher, prior: Option<&Arc<Prior>>| {
        let job = matcher.job(&pair, RANGE).region(part.clone());
        let job = match prior {
            Some(prior) => job.prior(Arc::clone(prior)),
            None => job,
        };
        job.run().unwrap().maps
    };
    let truth = truth.crop(&part);
    let (without, with) = (region(&mut matcher, None), region(&mut matcher, Some(&prior)));
    assert!(wrong(&with, &truth) < wrong(&without, &truth));
}

#[test]
fn a_prior_of_another_size_is_refused() {
    let (pair, truth) = scene("mixed");
    let prior = points(&truth.crop(&Rect { x: 0..50, y: 0..40 }), 5);
    let mut matcher = cpu();
    let error = matcher.job(&pair, RANGE).prior(prior).run().unwrap_err();
    let Error::Mismatch(reason) = error else { panic!("{error}") };
    assert!(reason.contains("50 x 40"), "{reason}");
}

/// Three frames of a scene, with different noise.
fn frames(prior: Option<&Arc<Prior>>) -> Vec<Frame> {
    let (pair, _) = scene("mixed");
    let pair = pair.crop(&Rect { x: 0..160, y: 0..120 });
    let other = scene("grain").0.crop(&Rect { x: 0..160, y: 0..120 });
    let of = |pair: &Pair, prior: Option<&Arc<Prior>>| {
        Frame::new(pair.clone(), RANGE).with_prior(prior.map(Arc::clone))
    };
    vec![of(&pair, None), of(&other, prior), of(&pair, prior)]
}

fn all(matcher: &mut Matcher, frames: Vec<Frame>) -> Vec<Matched> {
    let mut found = Vec::new();
    let take = |matched| {
        found.push(matched);
        ControlFlow::Continue(())
    };
    matcher.run_all(frames, take).unwrap();
    found
}

fn following(matcher: &mut Matcher) -> Vec<Maps> {
    let mut found = Vec::new();
    let take = |matched: Matched| {
        found.push(matched.maps);
        ControlFlow::Continue(())
    };
    matcher.run_following(frames(None), &AtomicBool::new(false), take).unwrap();
    found
}

#[test]
fn frames_have_priors_of_their_own() {
    let truth = scene("mixed").1.crop(&Rect { x: 0..160, y: 0..120 });
    let prior = points(&truth, 7);
    let mut method = Method::default();
    method.set("measure-every", "1").unwrap();
    let alone: Vec<_> = frames(Some(&prior))
        .into_iter()
        .map(|frame| matched(&mut cpu(), &frame.pair, &method, frame.prior.as_ref()).maps)
        .collect();
    let gpu = devices::open(FaultInjection::default());
    let gpu = gpu.map(|gpu| Matcher::on(Ok(gpu), false, &Execution::default()).unwrap());
    for mut matcher in [Some(cpu()), gpu].into_iter().flatten() {
        matcher.set_method(method.clone());
        let found = all(&mut matcher, frames(Some(&prior)));
        assert_eq!(found.iter().map(|m| m.prior.is_some()).collect::<Vec<_>>(), [false, true, true]);
        assert!(found.iter().zip(&alone).all(|(found, alone)| found.maps == *alone));
        // Control: without the priors, the maps are others.
        let without = all(&mut matcher, frames(None));
        assert!(without[1].maps != alone[1] && without[2].maps != alone[2]);
    }
    let small = points(&truth.crop(&Rect { x: 0..50, y: 0..40 }), 5);
    let error = cpu().run_all(frames(Some(&small)), |_| ControlFlow::Continue(())).unwrap_err();
    assert!(error.to_string().contains("50 x 40"), "{error}");
}

#[test]
fn what_a_frame_shows_is_known_in_the_next() {
    let found = following(&mut cpu());
    let plain: Vec<_> = all(&mut cpu(), frames(None)).into_iter().map(|matched| matched.maps).collect();
    assert!(found[0] == plain[0] && found[1] != plain[1] && found[2] != plain[2]);
    // The noise of the second frame moves fewer pixels.
    let moved = |maps: &[Maps]| {
        let pixels = maps[0].disparity.data().iter().zip(maps[1].disparity.data());
        pixels.filter(|(a, b)| a.abs_diff(**b) > 256).count()
    };
    assert!(
        3 * moved(&found) < 2 * moved(&plain),
        "{} and {} of {}",
        moved(&found),
        moved(&plain),
        160 * 120
    );
    if let Some(gpu) = devices::open(FaultInjection::default()) {
        let mut gpu = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
        assert!(following(&mut gpu) == found);
    }
}
