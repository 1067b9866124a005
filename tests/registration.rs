//! Depths registered to a third camera, compared with the ray-cast depths of its view.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../testdata/raw.rs"]
mod raw;
#[path = "../testdata/scenes.rs"]
mod scenes;

use std::path::Path;

use mrfgs::Matcher;
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::{of_texts, third};
use mrfgs::depth::Rig;
use mrfgs::image::calib::Calibration;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Options, Rectification};
use raw::{CAMERAS, Camera, Lens, Matrix, SIZE, THIRD, THIRD_PLACE, THIRD_SIZE};
use scenes::Scene;

fn thirds() -> [(&'static str, Camera); 3] {
    let fisheye = Camera { focal: 170.0, lens: Lens::Equidistant([0.02, 0.004, -0.001, 0.0]), ..THIRD };
    // This camera magnifies each pixel of the pair five times.
    let tele = Camera { focal: 900.0, lens: Lens::RadialTangential([0.0; 5]), ..THIRD };
    [("pinhole", THIRD), ("fisheye", fisheye), ("tele", tele)]
}

fn read(camera: &Camera, pose: (Matrix, [f64; 3])) -> ThirdCamera {
    third::of_text(Path::new("third.yml"), &raw::third(camera, THIRD_SIZE, pose)).unwrap()
}

/// How a registered map compares with the true depths of the third camera.
#[derive(Debug)]
struct Shares {
    /// The share of pixels with a depth, among those whose point the left view sees.
    covered: f64,
    /// The share of those depths that are within 1 % of the truth.
    right: f64,
    /// The share of pixels with a depth, among those whose point the left view does not see.
    invented: f64,
}

/// Compares `map` with the true depths. The left view sees a point unless a nearer surface hides it.
fn shares(map: &Plane<f32>, scene: &Scene, camera: &Camera) -> Shares {
    let truth = scenes::world(scene.name).depths(THIRD_SIZE, raw::third_eye(scene), |x, y| camera.ray(x, y));
    let baseline = raw::baseline(scene);
    let (width, height) = scene.truth.size();
    let (mut seen, mut covered, mut right, mut hidden, mut invented) = (0, 0, 0, 0, 0);
    for (x, y) in (0..THIRD_SIZE.1).flat_map(|y| (0..THIRD_SIZE.0).map(move |x| (x, y))) {
        let depth = f64::from(truth[(x, y)]);
        let point: [f64; 3] = {
            let ray = camera.ray(x as f64, y as f64);
            std::array::from_fn(|i| ray[i] * depth + THIRD_PLACE[i])
        };
        let [u, v] = raw::pixel((width, height), point).map(f64::round);
        let inside = point[2] > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
        // How much nearer the surface in the left view is than the point, in px of disparity.
        let near = |u: f64, v: f64| {
            f64::from(scene.truth[(u as usize, v as usize)]) - baseline * height as f64 / point[2]
        };
        let found = map[(x, y)];
        if inside && near(u, v).abs() < 0.5 {
            seen += 1;
            covered += usize::from(found.is_finite());
            right += usize::from((f64::from(found) / depth - 1.0).abs() < 0.01);
        } else if !inside || near(u, v) > 1.5 {
            hidden += 1;
            invented += usize::from(found.is_finite());
        }
    }
    assert!(seen > 10_000 && hidden > 500, "{seen} {hidden}");
    let share = |part: usize, of: usize| part as f64 / of as f64;
    Shares { covered: share(covered, seen), right: share(right, covered), invented: share(invented, hidden) }
}

fn rig(scene: &Scene) -> Rig {
    Rig::new(&Calibration::of_text(Path::new("calib.txt"), &scene.calibration()).unwrap()).unwrap()
}

#[test]
fn a_third_camera_sees_what_the_left_one_does() {
    for name in ["slanted", "thin", "steep"] {
        let scene = scenes::render(name, 320, 240, 48);
        let rig = rig(&scene);
        for (of, camera) in thirds() {
            let (rotation, translation) = raw::third_pose(&camera, &raw::rotation([0.0; 3]));
            let shares =
                |map: &Plane<f32>, by| shares(&rig.registered(map, &read(&camera, by)), &scene, &camera);
            let found = shares(&scene.truth, (rotation, translation));
            println!("{name}, {of}: {found:.3?}");
            assert!(
                found.covered > 0.995 && found.right > 0.985 && found.invented < 0.1,
                "{name}, {of}: {found:?}"
            );

            // Controls: a camera on the other side sees other depths, and holes in a map leave holes.
            let other = shares(&scene.truth, (rotation, translation.map(|v| -v)));
            assert!(other.right < 0.9, "{name}, {of}: {other:?}");
            let even = |x, y| if (x + y) % 2 == 0 { scene.truth[(x, y)] } else { f32::INFINITY };
            let half = shares(&Plane::from_fn(320, 240, even), (rotation, translation));
            assert!(half.covered < 0.7, "{name}, {of}: {half:?}");
        }
    }
}

/// The median relative error of the depths of `map`.
fn median_error(map: &Plane<f32>, scene: &Scene, camera: &Camera) -> f64 {
    let truth = scenes::world(scene.name).depths(THIRD_SIZE, raw::third_eye(scene), |x, y| camera.ray(x, y));
    let both = map.data().iter().zip(truth.data()).filter(|(found, _)| found.is_finite());
    let mut errors: Vec<f64> = both.map(|(found, depth)| f64::from(found / depth - 1.0).abs()).collect();
    assert!(errors.len() > 20_000, "{}", errors.len());
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

#[test]
fn depths_of_a_raw_pair_follow_its_rectification() {
    let scene = raw::scene();
    let baseline = raw::baseline(&scene);
    let text = raw::calibration(&CAMERAS, SIZE, baseline);
    let calibration = of_texts(&[(Path::new("cameras.yml"), text)]).unwrap();
    let by = Rectification::new(&calibration, SIZE, &Options::default()).unwrap();
    let [left, right] = [(&CAMERAS[0], &scene.left), (&CAMERAS[1], &scene.right)]
        .map(|(camera, view)| Image::from_rgb8(&camera.photograph(SIZE, view)));
    let pair = by.apply(&Pair::new(left, right).unwrap()).unwrap();
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let map = matcher.run(&pair, DisparityRange::new(0, 40).unwrap()).unwrap().disparity();
    let rectified = Rig::new(&by.calibration().unwrap()).unwrap();
    let rig = rectified.rectified_by(&by.rotations()[0]);
    for (of, camera) in thirds() {
        let third = read(&camera, raw::third_pose(&camera, &CAMERAS[0].turn));
        let error = |rig: &Rig| median_error(&rig.registered(&map, &third), &scene, &camera);
        let found = error(&rig);
        println!("{of}: {found:.4}");
        assert!(found < 0.006, "{of}: {found}");
        // The frame of the points makes no difference.
        assert_eq!(
            rig.registered(&map, &third),
            rig.in_original_frame(&by.rotations()[0]).registered(&map, &third)
        );
        // Control: without the rotation of the rectification the depths are worse.
        let crooked = error(&rectified);
        assert!(crooked > 2.0 * found, "{of}: {crooked} and {found}");
    }
}

#[test]
fn the_files_of_the_third_camera_are_a_fresh_rendering() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata/raw");
    let (scene, pose) = (raw::scene(), raw::third_pose(&THIRD, &CAMERAS[0].turn));
    assert_eq!(
        std::fs::read_to_string(folder.join("third.yml")).unwrap(),
        raw::third(&THIRD, THIRD_SIZE, pose)
    );
    let eye = raw::third_eye(&scene);
    let seen =
        scenes::world(scene.name).photograph(THIRD_SIZE, eye, 1.0 / THIRD.focal, |x, y| THIRD.ray(x, y));
    let held = image::open(folder.join("third.png")).unwrap().into_rgb8();
    assert!(held.as_raw() == seen.data().as_flattened());
}
