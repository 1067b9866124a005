//! Uncalibrated pairs: a rendered scene seen by two rotated cameras is rectified by sparse matches of the pair alone.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../testdata/raw.rs"]
mod raw;
#[path = "../testdata/scenes.rs"]
mod scenes;

use mrfgs::error::{RangeError, RectificationError};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Correspondence, Doubt, Options, Rectification};
use mrfgs::{Error, Matcher, check};
use raw::{Camera, Lens, Matrix, SCALE, SIZE};
use scenes::Scene;

/// A focal length at which rotated cameras still see nothing but the scene.
const FOCAL: f64 = 240.0;

/// A phone camera that looks along the axis of the scene, apart from a rotation `turn`.
fn phone(turn: Matrix, (width, height): (usize, usize)) -> Camera {
    let centre = [(width - 1) as f64 / 2.0, (height - 1) as f64 / 2.0];
    Camera { focal: FOCAL, centre, lens: Lens::RadialTangential([0.0; 5]), turn }
}

/// A rotation by degrees about x (down), y (to the right) and z (clockwise).
fn degrees(about: [f64; 3]) -> Matrix {
    raw::rotation(about.map(|angle| angle.to_radians() / 2.0))
}

fn scene(name: &str) -> Scene {
    scenes::render(name, SCALE * SIZE.0, SCALE * SIZE.1, 31 * SCALE as u32 + 1)
}

fn photographs(cameras: &[Camera; 2], size: (usize, usize), views: [&Plane<[u8; 3]>; 2]) -> Pair {
    let [left, right] = [0, 1].map(|i| Image::from_rgb8(&cameras[i].photograph(size, views[i])));
    Pair::new(left, right).unwrap()
}

/// The position in the right image of the scene point that the left image shows at a pixel.
fn seen_by_right([left, right]: &[Camera; 2], scene: &Scene, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let ray = [(x - left.centre[0]) / left.focal, (y - left.centre[1]) / left.focal, 1.0];
    let ray = raw::turned(&raw::inverse(&left.turn), ray);
    let (width, height) = scene.truth.size();
    let [u, v] = raw::pixel((width, height), ray).map(|v| (v + 0.5).floor());
    if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
        return None;
    }
    let baseline = raw::baseline(scene);
    let depth = baseline * height as f64 / f64::from(scene.truth[(u as usize, v as usize)]);
    let [px, py, pz] = ray.map(|v| v / ray[2] * depth);
    Some(right.project(raw::turned(&right.turn, [px - baseline, py, pz])))
}

/// The pixel of the rectified right view that shows a pixel of the right image, found by Newton's method.
fn rectified_right(by: &Rectification, pixel: [f64; 2]) -> [f64; 2] {
    let mut at = pixel;
    for _ in 0..8 {
        let [[a, b], [u, v], [c, d]] =
            [[0.0, 0.0], [1e-3, 0.0], [0.0, 1e-3]].map(|d| by.right(at[0] + d[0], at[1] + d[1]).unwrap());
        let [xx, xy, yx, yy] = [u - a, c - a, v - b, d - b].map(|v| v / 1e-3);
        let (dx, dy) = (pixel[0] - a, pixel[1] - b);
        let determinant = xx * yy - xy * yx;
        at[0] += (yy * dx - xy * dy) / determinant;
        at[1] += (xx * dy - yx * dx) / determinant;
    }
    at
}

/// The errors of a pair, over the pixels with a known truth inside both images.
struct Errors {
    /// The 99th percentile of the vertical offset of the truth, in pixels.
    rows: f64,
    /// The mean error of the disparities, in pixels.
    error: f64,
}

/// Matches the pair. `truth` gives the position in the right view of each pixel of the left view.
fn measured(pair: &Pair, truth: impl Fn(usize, usize) -> Option<[f64; 2]>) -> Errors {
    let range = check::range(pair).unwrap_or(DisparityRange::new(0, 60).unwrap());
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let map = matcher.run(pair, range).unwrap().disparity();
    let (width, height) = pair.size();
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let Some([u, v]) = truth(x, y).filter(|_| !pair.left().masked[(x, y)]) else { continue };
        let [column, row] = [u, v].map(|v| (v + 0.5).floor());
        let inside = column >= 0.0 && row >= 0.0 && column < width as f64 && row < height as f64;
        if inside && !pair.right().masked[(column as usize, row as usize)] {
            errors.push((f64::from(map[(x, y)]) - (x as f64 - u)).abs());
            rows.push((v - y as f64).abs());
        }
    }
    assert!(errors.len() > width * height / 2, "{} of {width} x {height}", errors.len());
    rows.sort_unstable_by(f64::total_cmp);
    Errors { rows: rows[rows.len() * 99 / 100], error: errors.iter().sum::<f64>() / errors.len() as f64 }
}

/// The errors of the pair taken without rotation, which is rectified.
fn perfect(scene: &Scene) -> Errors {
    let cameras = [phone(degrees([0.0; 3]), SIZE); 2];
    let pair = photographs(&cameras, SIZE, [&scene.left, &scene.right]);
    measured(&pair, |x, y| seen_by_right(&cameras, scene, [x as f64, y as f64]))
}

fn by_matches(pair: &Pair) -> Rectification {
    Rectification::of_pair(pair, &Options::default()).unwrap()
}

/// Rotations of hand-held photographs, in degrees.
const HANDS: [(&str, [[f64; 3]; 2]); 4] = [
    ("a little", [[0.5, -0.4, 0.8], [-0.6, 0.3, -0.5]]),
    ("up and aside", [[2.0, -2.5, 1.0], [-2.0, 2.0, -1.5]]),
    ("rolled", [[1.0, 0.5, 4.0], [-1.5, -1.0, -3.0]]),
    ("all at once", [[-3.0, 3.0, -2.0], [2.5, -2.0, 3.0]]),
];

#[test]
fn a_hand_held_pair_is_rectified_by_its_matches() {
    for (name, hands) in [("slanted", &HANDS[..]), ("mixed", &HANDS[3..]), ("steep", &HANDS[2..3])] {
        let scene = scene(name);
        let reference = perfect(&scene);
        assert!(reference.rows < 1e-6, "{}", reference.rows);
        for &(hands, turns) in hands {
            let cameras = turns.map(|turn| phone(degrees(turn), SIZE));
            let pair = photographs(&cameras, SIZE, [&scene.left, &scene.right]);
            let by = by_matches(&pair);
            let found = measured(&by.apply(&pair).unwrap(), |x, y| {
                let source = by.left(x as f64, y as f64)?;
                seen_by_right(&cameras, &scene, source).map(|at| rectified_right(&by, at))
            });
            let trust = by.trust().unwrap();
            println!(
                "{name}, {hands}: rows {:.3} px, map {:.3} px, perfect pair {:.3} px; {trust}; {:?}",
                found.rows,
                found.error,
                reference.error,
                by.doubts()
            );
            assert!(found.rows <= 0.3, "{name}, {hands}: {}", found.rows);
            assert!(found.error <= reference.error + 0.3, "{name}, {hands}: {}", found.error);
            assert!(
                trust.percentile95 < 1.0 && 2 * trust.agreeing > trust.matches,
                "{name}, {hands}: {trust}"
            );
            assert!(by.calibration().is_err(), "there is no scale");

            // Control: unrectified photographs are matched far worse.
            if hands == "up and aside" {
                let crooked = measured(&pair, |x, y| seen_by_right(&cameras, &scene, [x as f64, y as f64]));
                assert!(crooked.rows > 5.0 && crooked.error > reference.error + 1.0, "{}", crooked.error);
            }
        }
    }
}

/// A roll of 20 degrees between the photographs is found by rotating one of them.
#[test]
fn photographs_may_have_a_large_roll() {
    let scene = scene("slanted");
    let cameras = [[1.0, -2.0, 9.0], [-1.0, 1.0, -11.0]].map(|turn| phone(degrees(turn), SIZE));
    let pair = photographs(&cameras, SIZE, [&scene.left, &scene.right]);
    // Unrectified they give no range, and the error names the reason.
    assert_eq!(check::range(&pair), Err(RangeError::NotRectified.into()));
    let by = by_matches(&pair);
    let range = check::range(&by.apply(&pair).unwrap()).unwrap();
    assert!(range.labels() < 60, "{range:?}");
    let mut rows = Vec::new();
    for (x, y) in (20..SIZE.1 - 20).step_by(5).flat_map(|y| (50..SIZE.0 - 20).step_by(5).map(move |x| (x, y)))
    {
        let source = by.left(x as f64, y as f64).unwrap();
        let there = seen_by_right(&cameras, &scene, source).map(|at| rectified_right(&by, at));
        rows.extend(there.map(|there| (there[1] - y as f64).abs()));
    }
    rows.sort_unstable_by(f64::total_cmp);
    let most = rows[rows.len() * 99 / 100];
    println!("rows {most:.3} px; {}", by.trust().unwrap());
    assert!(rows.len() > 500 && most <= 0.3, "{most}");
}

/// With one photograph above the other, both are rotated by a quarter turn.
#[test]
fn photographs_may_be_one_above_the_other() {
    let scene = scene("slanted");
    let reference = perfect(&scene);
    let size = (SIZE.1, SIZE.0);
    for quarter in [[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]] {
        let quarter = [quarter[0], quarter[1], [0.0, 0.0, 1.0]];
        let turns = [[1.0, -0.5, 1.0], [-1.5, 0.5, -0.5]];
        let cameras = turns.map(|turn| phone(raw::product(&degrees(turn), &quarter), size));
        let pair = photographs(&cameras, size, [&scene.left, &scene.right]);
        let by = by_matches(&pair);
        assert_eq!(by.size(), SIZE);
        let found = measured(&by.apply(&pair).unwrap(), |x, y| {
            let source = by.left(x as f64, y as f64)?;
            seen_by_right(&cameras, &scene, source).map(|at| rectified_right(&by, at))
        });
        println!("rows {:.3} px, map {:.3} px", found.rows, found.error);
        assert!(found.rows <= 0.3 && found.error <= reference.error + 0.3, "{} {}", found.rows, found.error);
    }
}

/// The rectification has the same bits with every number of threads and on every machine.
#[test]
fn the_bits_are_the_same_everywhere() {
    let pair = Pair::open("testdata/raw/left.png", "testdata/raw/right.png").unwrap();
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| by_matches(&pair))
    });
    assert_eq!(one, three);
    let bits = [one.left(17.0, 150.0), one.right(201.0, 33.0)].map(|at| at.unwrap().map(f64::to_bits));
    assert_eq!(
        bits,
        [[0xc00d_2064_ac52_c100, 0x4062_3fe5_d99b_d9e4], [0x406b_fc5e_9276_ced4, 0x4042_63f0_d724_cf98]],
        "{bits:#x?}"
    );
}

fn refused(pair: &Pair) -> RectificationError {
    match Rectification::of_pair(pair, &Options::default()) {
        Err(Error::Rectification(cause)) => cause,
        other => panic!("{other:?}"),
    }
}

#[test]
fn pairs_that_show_no_geometry_are_refused() {
    let (scene, other) = (scene("slanted"), scene("mixed"));
    let turns = [[2.0, -2.5, 1.0], [-2.0, 2.0, -1.5]];
    let cameras = turns.map(|turn| phone(degrees(turn), SIZE));
    let photographs = |left, right| photographs(&cameras, SIZE, [left, right]);
    let grey = Plane::filled(SIZE.0, SIZE.1, [120; 3]);
    let plain = Pair::new(Image::from_rgb8(&grey), Image::from_rgb8(&grey)).unwrap();
    let same = photographs(&scene.left, &scene.right).left().clone();
    let same = Pair::new(same.clone(), same).unwrap();

    // Control: the pair itself is not refused.
    let sound = photographs(&scene.left, &scene.right);
    by_matches(&sound);
    assert!(matches!(refused(&photographs(&scene.left, &other.right)), RectificationError::Few { .. }));
    assert!(matches!(refused(&plain), RectificationError::Few { .. }));
    assert_eq!(refused(&same), RectificationError::Flat);
    // A camera rotated on the spot, without baseline.
    assert_eq!(refused(&photographs(&scene.left, &scene.left)), RectificationError::Flat);
    assert_eq!(refused(&forward(&[&scene.left, &other.left], 0.06)), RectificationError::Forward);
    let dot = Plane::filled(1, 1, [9; 3]);
    let dot = Pair::new(Image::from_rgb8(&dot), Image::from_rgb8(&dot)).unwrap();
    assert!(matches!(refused(&dot), RectificationError::Few { .. }));
}

/// A wall with two pictures in front, from a camera that moves forward by `step` of the distance to the wall.
fn forward(views: &[&Plane<[u8; 3]>; 2], step: f64) -> Pair {
    let photograph = |step: f64| {
        Image::from_rgb8(&Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
            let at = [(x as f64 - 119.5) / FOCAL, (y as f64 - 89.5) / FOCAL];
            let shown = |depth: f64| at.map(|v| v * (depth - step));
            let near = shown(0.6);
            let is_near = (0.05..0.2).contains(&near[0].abs()) && near[1].abs() < 0.12;
            let ([u, v], view) =
                if is_near { (near.map(|v| v / 0.6), views[1]) } else { (shown(1.0), views[0]) };
            // The weighted mean of the surrounding pixels.
            let (u, v) = (360.0 + 640.0 * u, 270.0 + 640.0 * v);
            let (mut sum, mut all) = ([0.0; 3], 0.0);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let (px, py) = (u.floor() + f64::from(dx), v.floor() + f64::from(dy));
                let weight = (1.5 - (px - u).abs()).max(0.0) * (1.5 - (py - v).abs()).max(0.0);
                let colour = view[(px.clamp(0.0, 719.0) as usize, py.clamp(0.0, 539.0) as usize)];
                sum.iter_mut().zip(colour).for_each(|(sum, level)| *sum += weight * f64::from(level));
                all += weight;
            }
            sum.map(|sum| (sum / all + 0.5) as u8)
        }))
    };
    Pair::new(photograph(0.0), photograph(step)).unwrap()
}

/// The projections of points into two phones, the second one moved by `moved` and rotated.
fn correspondences(moved: [f64; 3], depth: impl Fn(usize) -> f64) -> Vec<Correspondence> {
    let cameras = [[1.0, -0.5, 1.0], [-1.5, 0.5, -0.5]].map(|turn| phone(degrees(turn), SIZE));
    let grid =
        (0..SIZE.1).step_by(12).flat_map(|y| (0..SIZE.0).step_by(12).map(move |x| (x as f64, y as f64)));
    let of = |(i, (x, y)): (usize, (f64, f64))| {
        let z = depth(i);
        let point = [(x - 119.5) / FOCAL * z, (y - 89.5) / FOCAL * z, z];
        let from_right: [f64; 3] = std::array::from_fn(|i| point[i] - moved[i]);
        [(cameras[0], point), (cameras[1], from_right)]
            .map(|(camera, point)| camera.project(raw::turned(&camera.turn, point)))
    };
    grid.enumerate().map(of).collect()
}

#[test]
fn exact_matches_give_an_exact_rectification() {
    let of = |matches: &[Correspondence]| Rectification::of_matches(matches, SIZE, &Options::default());
    let depth = |i: usize| 2.0 + (i * 7 % 11) as f64 / 4.0;
    let sound = correspondences([0.2, 0.02, -0.03], depth);
    let trust = *of(&sound).unwrap().trust().unwrap();
    println!("{trust}");
    assert!(trust.agreeing == sound.len() && trust.percentile95 < 0.05, "{trust}");
    // A third of the matches is wrong.
    let wrong: Vec<_> = sound
        .iter()
        .enumerate()
        .map(|(i, &[left, right])| [left, if i % 3 == 0 { sound[i * 5 % sound.len()][1] } else { right }])
        .collect();
    let by = of(&wrong).unwrap();
    let trust = by.trust().unwrap();
    assert!((sound.len() * 2 / 3..=sound.len() * 3 / 4).contains(&trust.agreeing), "{trust}");
    assert!(by.doubts().iter().any(|doubt| matches!(doubt, Doubt::FewAgree { .. })), "{:?}", by.doubts());

    let cause = |matches: &[Correspondence]| of(matches).unwrap_err();
    assert_eq!(cause(&correspondences([0.02, 0.0, 0.3], depth)), RectificationError::Forward.into());
    assert_eq!(cause(&correspondences([0.2, 0.0, 0.0], |_| 3.0)), RectificationError::Flat.into());
    assert_eq!(cause(&correspondences([0.0; 3], depth)), RectificationError::Flat.into());
    assert!(matches!(cause(&sound[..20]), Error::Rectification(RectificationError::Few { .. })));
    assert!(matches!(cause(&[]), Error::Rectification(RectificationError::Few { .. })));
    let shuffled: Vec<_> = (0..sound.len()).map(|i| [sound[i][0], sound[i * 89 % sound.len()][1]]).collect();
    assert!(matches!(cause(&shuffled), Error::Rectification(RectificationError::Few { .. })));
}
