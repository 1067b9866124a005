//! Temporal filtering of video: still surfaces stay still, compared with the truth of rendered sequences.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../testdata/scenes.rs"]
mod scenes;

use mrfgs::image::{Image, Pair, Plane};
use mrfgs::maps::Maps;
use mrfgs::steady::Steady;
use mrfgs::{Matcher, Method};
use scenes::Scene;

const SIZE: (usize, usize) = (240, 180);
const LABELS: u32 = 32;
const FRAMES: u32 = 12;

/// A scene with its truth, the pair of its views, and the maps of matching it alone.
type Frame = (Scene, Pair, Maps);

fn frames(sequence: fn(u32, usize, usize, u32) -> Scene, method: &Method) -> Vec<Frame> {
    let mut matcher = Matcher::builder().method(method.clone()).device("cpu").build().unwrap();
    let matched = (0..FRAMES).map(|step| {
        let scene = sequence(step, SIZE.0, SIZE.1, LABELS);
        let pair = Pair::new(Image::from_rgb8(&scene.left), Image::from_rgb8(&scene.right)).unwrap();
        let maps = matcher.run(&pair, 0..=LABELS as i32 - 1).unwrap().maps;
        (scene, pair, maps)
    });
    matched.collect()
}

/// The maps without the filter, and with a filter that is given `view` of each frame.
fn both<'a>(frames: &'a [Frame], view: impl Fn(&'a Frame) -> &'a Image) -> [Vec<Plane<f32>>; 2] {
    let alone = frames.iter().map(|(_, _, maps)| maps.final_map()).collect();
    let mut steady = Steady::new();
    let filtered = frames.iter().map(|frame| {
        let mut maps = frame.2.clone();
        steady.follow(view(frame), &mut maps);
        maps.final_map()
    });
    [alone, filtered.collect()]
}

fn own(frame: &Frame) -> &Image {
    frame.1.left()
}

/// The pixels within `radius` of a change of the truth between two frames.
fn moves(frames: &[Frame], step: usize, radius: usize) -> Plane<bool> {
    let [before, now] = [step - 1, step].map(|step| &frames[step].0.truth);
    let moved = Plane::from_fn(SIZE.0, SIZE.1, |x, y| (before[(x, y)] - now[(x, y)]).abs() > 1e-6);
    let near = |at: usize, count: usize| at.saturating_sub(radius)..(at + radius + 1).min(count);
    let across = Plane::from_fn(SIZE.0, SIZE.1, |x, y| near(x, SIZE.0).any(|x| moved[(x, y)]));
    Plane::from_fn(SIZE.0, SIZE.1, |x, y| near(y, SIZE.1).any(|y| across[(x, y)]))
}

/// The mean of `value` over the pixels in `counts`, of all frames but the first.
fn mean(value: impl Fn(usize, usize, usize) -> f64, counts: impl Fn(usize) -> Plane<bool>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for step in 1..FRAMES as usize {
        let counts = counts(step);
        for (y, x) in
            (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (y, x))).filter(|(y, x)| counts[(*x, *y)])
        {
            sum += value(step, x, y);
            count += 1.0;
        }
    }
    sum / count
}

fn everywhere(_: usize) -> Plane<bool> {
    Plane::filled(SIZE.0, SIZE.1, true)
}

/// The mean change between frames where nothing moves.
fn flicker(frames: &[Frame], maps: &[Plane<f32>]) -> f64 {
    let change = |step: usize, x, y| f64::from((maps[step][(x, y)] - maps[step - 1][(x, y)]).abs());
    mean(change, |step| moves(frames, step, 12).map(|moves| !moves))
}

/// The mean error, and the share of pixels more than 1 px off.
fn errors(frames: &[Frame], maps: &[Plane<f32>], counts: impl Fn(usize) -> Plane<bool>) -> [f64; 2] {
    let off = |step: usize, x, y| f64::from((maps[step][(x, y)] - frames[step].0.truth[(x, y)]).abs());
    [mean(off, &counts), mean(|step, x, y| f64::from(u8::from(off(step, x, y) > 1.0)), &counts)]
}

#[test]
fn still_surfaces_hold_still_and_moving_things_leave_no_trail() {
    for (name, method) in [("default", Method::default()), ("fast", Method::fast())] {
        let frames = frames(scenes::passing, &method);
        let [alone, steady] = both(&frames, own);
        let [before, now] = [&alone, &steady].map(|maps| flicker(&frames, maps));
        assert!(now < 0.5 * before, "{name}: {before:.4} to {now:.4} px");
        let [error_before, error] = [&alone, &steady].map(|maps| errors(&frames, maps, everywhere));
        assert!(error[0] < error_before[0], "{name}: {error_before:.4?} to {error:.4?}");
        let near = |step| moves(&frames, step, 6);
        let [trail_before, trail] = [&alone, &steady].map(|maps| errors(&frames, maps, near));
        assert!(trail[1] < 1.02 * trail_before[1], "{name}: {trail_before:.4?} to {trail:.4?}");
        println!(
            "{name}: flicker {before:.4} to {now:.4} px, error {error_before:.4?} to {error:.4?}, near what moves {trail_before:.4?} to \
             {trail:.4?}"
        );
        // Control: a filter that is always given the first frame sees no motion, and leaves trails.
        let [_, blind] = both(&frames, |_| own(&frames[0]));
        let trail_of_blind = errors(&frames, &blind, near);
        assert!(trail_of_blind[0] > 1.3 * trail_before[0], "{name}: {trail_of_blind:.4?}");
    }
}

#[test]
fn a_moving_camera_costs_no_accuracy() {
    let frames = frames(scenes::moving, &Method::default());
    let [alone, steady] = both(&frames, own);
    let [before, now] = [&alone, &steady].map(|maps| errors(&frames, maps, everywhere));
    println!("error {before:.4?} to {now:.4?}");
    assert!(now[0] < 1.01 * before[0] && now[1] < 1.01 * before[1], "{before:.4?} to {now:.4?}");
    // Control: a filter that sees no motion.
    let [_, blind] = both(&frames, |_| own(&frames[0]));
    let blind = errors(&frames, &blind, everywhere);
    assert!(blind[0] > 1.3 * before[0], "{blind:.4?}");
}
