//! Drift of the right camera since calibration: it is measured in frames and corrected.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../testdata/raw.rs"]
mod raw;
#[path = "../testdata/scenes.rs"]
mod scenes;

use std::path::Path;
use std::sync::LazyLock;

use mrfgs::calibration::of_texts;
use mrfgs::drift::{Drift, Turn};
use mrfgs::image::{Image, Pair};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Options, Rectification};
use raw::{CAMERAS, Camera};

const SIZE: (usize, usize) = (640, 480);
const RANGE: DisparityRange = DisparityRange { min: 0, max: 90 };

/// The scenes that the rig sees, in sequence.
static SCENES: LazyLock<Vec<scenes::Scene>> = LazyLock::new(|| {
    ["mixed", "slanted"].map(|name| scenes::render(name, 2 * SIZE.0, 2 * SIZE.1, 161)).into()
});

/// The cameras of `testdata/raw`, with larger images.
fn cameras() -> [Camera; 2] {
    let scale = SIZE.1 as f64 / raw::SIZE.1 as f64;
    CAMERAS.map(|camera| Camera {
        focal: scale * camera.focal,
        centre: camera.centre.map(|v| scale * (v + 0.5) - 0.5),
        ..camera
    })
}

/// The cameras after the right one has turned, in degrees: up, to the right and clockwise.
fn turned(degrees: [f64; 3]) -> [Camera; 2] {
    let [left, mut right] = cameras();
    // A quaternion holds half the angle, and rays turn the opposite way to the camera.
    right.turn = raw::product(&raw::rotation(degrees.map(|angle| -0.5 * angle.to_radians())), &right.turn);
    [left, right]
}

fn calibrated() -> Rectification {
    let text = raw::calibration(&cameras(), SIZE, raw::baseline(&SCENES[0]));
    let calibration = of_texts(&[(Path::new("cameras.yml"), text)]).unwrap();
    Rectification::new(&calibration, SIZE, &Options::default()).unwrap()
}

fn frames(cameras: &[Camera; 2]) -> Vec<Pair> {
    let frame = |scene: &scenes::Scene| {
        let [left, right] = [(&cameras[0], &scene.left), (&cameras[1], &scene.right)]
            .map(|(camera, view)| Image::from_rgb8(&camera.photograph(SIZE, view)));
        Pair::new(left, right).unwrap()
    };
    SCENES.iter().map(frame).collect()
}

/// The turn measured over such a sequence, each frame three times in a row, and whether it was corrected.
fn followed(frames: &[Pair], correct: bool) -> (Turn, bool) {
    let calibrated = calibrated();
    let mut drift = Drift::of(&calibrated).unwrap();
    let mut rectification = calibrated.clone();
    let mut corrected = false;
    for i in 0..16 {
        let frame = &frames[i / 3 % frames.len()];
        drift.follow(&rectification.apply(frame).unwrap(), RANGE).unwrap();
        if correct && let Some(better) = drift.correct(&calibrated).unwrap() {
            rectification = better;
            corrected = true;
        }
    }
    (drift.turn().unwrap(), corrected)
}

#[test]
fn a_tenth_of_a_degree_is_found_to_a_hundredth() {
    // Rows constrain yaw less than pitch and roll.
    const MOST: [f64; 3] = [0.01, 0.02, 0.01];
    let degrees = [0.1, 0.1, -0.1];
    let frames = frames(&turned(degrees));
    // In the coordinates of the rectified view.
    let truth = raw::turned(&calibrated().rotations()[1], degrees);
    for correct in [false, true] {
        let (turn, corrected) = followed(&frames, correct);
        let found = turn.degrees();
        println!("{truth:.4?}, correct {correct}: {turn:?}, {found:.4?}");
        for i in 0..3 {
            assert!((found[i] - truth[i]).abs() <= MOST[i], "{truth:?}: {found:?}");
        }
        assert!(corrected == correct && turn.counts());
    }
}

#[test]
fn an_unmoved_rig_is_not_corrected() {
    let (turn, corrected) = followed(&frames(&cameras()), true);
    println!("{turn:?}");
    assert!(!corrected && !turn.counts(), "{turn:?}");
}
