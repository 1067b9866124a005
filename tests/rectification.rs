//! Rectification of synthetic rigs: raw pairs of a rendered scene through known lenses are rectified and matched.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../testdata/raw.rs"]
mod raw;
#[path = "../testdata/scenes.rs"]
mod scenes;

use std::path::Path;

use mrfgs::calibration::of_texts;
use mrfgs::depth::Rig;
use mrfgs::image::{Image, Pair, Plane, Rect, calib};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Doubt, Options, Rectification};
use mrfgs::{Error, Matcher};
use raw::{CAMERAS, Camera, Lens, Matrix, SIZE};

/// Quarter turns: with the first the left eye is above the right one, with the second below it.
const QUARTERS: [Matrix; 2] = [
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
];

fn rectification(cameras: &[Camera; 2], size: (usize, usize), baseline: f64) -> Rectification {
    let text = raw::calibration(cameras, size, baseline);
    let calibration = of_texts(&[(Path::new("cameras.yml"), text)]).unwrap();
    Rectification::new(&calibration, size, &Options::default()).unwrap()
}

fn photographs(cameras: &[Camera; 2], size: (usize, usize), scene: &scenes::Scene) -> Pair {
    let [left, right] = [(&cameras[0], &scene.left), (&cameras[1], &scene.right)]
        .map(|(camera, view)| Image::from_rgb8(&camera.photograph(size, view)));
    Pair::new(left, right).unwrap()
}

/// The mean error of a match in px, over the pixels of the left view with a known `truth`.
fn error(pair: &Pair, truth: impl Fn(usize, usize) -> Option<f64>) -> f64 {
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let found = matcher.run(pair, DisparityRange::new(0, 40).unwrap()).unwrap().disparity();
    let (width, height) = pair.size();
    let errors: Vec<f64> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .filter(|&(x, y)| !pair.left().masked[(x, y)])
        .filter_map(|(x, y)| truth(x, y).map(|truth| (f64::from(found[(x, y)]) - truth).abs()))
        .collect();
    assert!(errors.len() > width * height / 2, "{} of {width} x {height}", errors.len());
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// The true disparity at a pixel of the rectified left view.
fn truth(by: &Rectification, left: &Camera, scene: &scenes::Scene, x: usize, y: usize) -> Option<f64> {
    let calibration = by.calibration().unwrap();
    let (camera, baseline) = (calibration.camera.unwrap(), calibration.baseline.unwrap());
    assert_eq!(calibration.doffs, Some(0.0), "what is infinitely far has a disparity of 0");
    let [u, v] = [x as f64, y as f64];
    let [fx, fy] = camera.focal_length;
    let [cx, cy] = camera.principal_point;
    let from_scene = raw::product(&by.rotations()[0], &left.turn);
    let ray = raw::turned(&raw::inverse(&from_scene), [(u - cx) / fx, (v - cy) / fy, 1.0]);
    let [px, py] = raw::pixel(scene.truth.size(), ray).map(|v| (v + 0.5).floor());
    let inside =
        px >= 0.0 && py >= 0.0 && px < scene.truth.width() as f64 && py < scene.truth.height() as f64;
    if !inside {
        return None;
    }
    let depth = baseline * scene.truth.height() as f64 / f64::from(scene.truth[(px as usize, py as usize)]);
    let point = ray.map(|v| v / ray[2] * depth);
    Some(baseline * fx / raw::turned(&from_scene, point)[2])
}

/// Rigs, with their names and image sizes.
fn rigs() -> [(&'static str, [Camera; 2], (usize, usize)); 4] {
    let fisheye = |camera: Camera, k1: f64| Camera {
        focal: camera.focal - 6.0,
        lens: Lens::Equidistant([k1, 0.004, -0.001, 0.0]),
        ..camera
    };
    let fisheyes = [fisheye(CAMERAS[0], 0.02), fisheye(CAMERAS[1], -0.01)];
    let upright = |quarter: &Matrix| {
        CAMERAS.map(|camera| Camera {
            centre: [camera.centre[1], camera.centre[0]],
            turn: raw::product(quarter, &camera.turn),
            ..camera
        })
    };
    let high = (SIZE.1, SIZE.0);
    [
        ("pinholes", CAMERAS, SIZE),
        ("fisheyes", fisheyes, SIZE),
        ("the left one above", upright(&QUARTERS[0]), high),
        ("the left one below", upright(&QUARTERS[1]), high),
    ]
}

#[test]
fn a_rectified_pair_is_matched_as_well_as_a_perfect_one() {
    let scene = raw::scene();
    let baseline = raw::baseline(&scene);
    let perfect = scenes::render("slanted", SIZE.0, SIZE.1, 32);
    let pair = Pair::new(Image::from_rgb8(&perfect.left), Image::from_rgb8(&perfect.right)).unwrap();
    let reference = error(&pair, |x, y| Some(f64::from(perfect.truth[(x, y)])));

    for (name, cameras, size) in rigs() {
        let by = rectification(&cameras, size, baseline);
        assert_eq!(by.size(), SIZE, "{name}");
        let raw = photographs(&cameras, size, &scene);
        let rectified = by.apply(&raw).unwrap();
        let found = error(&rectified, |x, y| truth(&by, &cameras[0], &scene, x, y));
        println!("{name}: {found:.3} px, perfect pair {reference:.3} px");
        assert!(found <= reference + 0.1, "{name}: {found} against {reference}");

        // Control: unrectified, or rectified with the wrong lens, they are matched far worse.
        if name == "pinholes" {
            let crooked = error(&raw, |x, y| truth(&by, &cameras[0], &scene, x, y));
            assert!(crooked > reference + 0.5, "{crooked}");
            let mut other = cameras;
            other[1].lens = Lens::RadialTangential([0.0; 5]);
            let by = rectification(&other, size, baseline);
            let wrong = error(&by.apply(&raw).unwrap(), |x, y| truth(&by, &cameras[0], &scene, x, y));
            assert!(wrong > reference + 0.1, "{wrong}");
        }
    }
}

/// A point in the frame of the original camera projects through its lens onto the pixel it comes from.
#[test]
fn points_project_onto_their_original_pixels() {
    for (name, cameras, size) in rigs() {
        let by = rectification(&cameras, size, 0.16);
        let rectified = Rig::new(&by.calibration().unwrap()).unwrap();
        let original = rectified.in_original_frame(&by.rotations()[0]);
        let (mut most, mut least) = (0.0_f64, f64::INFINITY);
        for (x, y) in (0..SIZE.1).step_by(7).flat_map(|y| (0..SIZE.0).step_by(7).map(move |x| (x, y))) {
            let (at, d) = ([x as f64, y as f64], 5.0 + (x * 7 + y * 3) as f64 % 30.0);
            let pixel = by.left(at[0], at[1]).unwrap();
            let miss = |rig: &Rig| {
                let [u, v] = cameras[0].project(rig.point(at[0], at[1], d).unwrap());
                (u - pixel[0]).hypot(v - pixel[1])
            };
            most = most.max(miss(&original));
            least = least.min(miss(&rectified));
        }
        println!("{name}: {most:.1e} px at most, {least:.2} px at least in the rectified frame");
        assert!(most < 1e-9, "{name}: {most}");
        // Control: points in the rectified frame project elsewhere.
        assert!(least > 0.5, "{name}: {least}");
    }
}

#[test]
fn the_raw_pair_is_what_the_cameras_see() {
    let scene = raw::scene();
    let raw = photographs(&CAMERAS, SIZE, &scene);
    let folder = Path::new("testdata/raw");
    assert_eq!(Pair::open(folder.join("left.png"), folder.join("right.png")).unwrap(), raw);
    let text = std::fs::read_to_string(folder.join("cameras.yml")).unwrap();
    assert_eq!(text, raw::calibration(&CAMERAS, SIZE, raw::baseline(&scene)));
}

/// The rectified pair and its calibration have the same bits on every machine.
#[test]
fn the_bits_are_the_same_everywhere() {
    let folder = Path::new("testdata/raw");
    let raw = Pair::open(folder.join("left.png"), folder.join("right.png")).unwrap();
    let hash = |bytes: &mut dyn Iterator<Item = u8>| {
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    };
    let fisheyes =
        CAMERAS.map(|camera| Camera { lens: Lens::Equidistant([0.02, 0.004, -0.001, 0.0]), ..camera });
    let found = [CAMERAS, fisheyes].map(|cameras| {
        let by = rectification(&cameras, SIZE, 0.16);
        let pair = by.apply(&raw).unwrap();
        let pixels =
            [pair.left(), pair.right()].into_iter().flat_map(|image| image.pixels.data().as_flattened());
        let place = by.left(17.0, 150.0).unwrap();
        [
            hash(&mut pixels.flat_map(|v| v.to_le_bytes())),
            hash(&mut place.iter().flat_map(|v| v.to_le_bytes())),
        ]
    });
    let known =
        [[0x1ca3_0d39_68e1_e174, 0xdf2e_7b0a_6265_df70], [0x9a4e_1f9c_8623_73d4, 0x43e4_090a_f0ca_82e4]];
    assert_eq!(found, known, "{found:#x?}");
}

/// Keeping the source positions changes no result.
#[test]
fn places_may_be_kept() {
    let scene = raw::scene();
    let raw = photographs(&CAMERAS, SIZE, &scene);
    let fisheyes =
        CAMERAS.map(|camera| Camera { lens: Lens::Equidistant([0.02, 0.004, -0.001, 0.0]), ..camera });
    let pairs = [CAMERAS, fisheyes].map(|cameras| {
        let mut by = rectification(&cameras, SIZE, 0.16);
        let pair = by.apply(&raw).unwrap();
        by.keep_places().unwrap();
        assert!(by.apply(&raw).unwrap() == pair);
        pair
    });
    assert!(pairs[0] != pairs[1], "control: other lenses give another pair");
}

#[test]
fn a_mask_is_rectified_with_its_image() {
    let by = rectification(&CAMERAS, SIZE, 0.1);
    let noise = |x: usize, y: usize| [(x * 31 + y * 17) as u8; 3];
    let image = Image::from_rgb8(&Plane::from_fn(SIZE.0, SIZE.1, noise));
    let mut right = image.clone();
    for at in (60..80).flat_map(|y| (100..130).map(move |x| (x, y))) {
        right.masked[at] = true;
    }
    let whole = by.apply(&Pair::new(image.clone(), image.clone()).unwrap()).unwrap();
    let pair = by.apply(&Pair::new(image, right).unwrap()).unwrap();
    assert_eq!(pair.left(), whole.left());
    for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
        let [u, v] = by.right(x as f64, y as f64).unwrap();
        // Cubic interpolation reads pixels up to two away.
        let well_inside = (100.0..129.0).contains(&u) && (60.0..79.0).contains(&v);
        let well_outside = !((97.0..132.0).contains(&u) && (57.0..82.0).contains(&v));
        let masked = pair.right().masked[(x, y)];
        assert!(!well_inside || masked, "{x}, {y}");
        if well_outside {
            assert_eq!(masked, whole.right().masked[(x, y)], "{x}, {y}");
            assert_eq!(pair.right().pixels[(x, y)], whole.right().pixels[(x, y)], "{x}, {y}");
        }
        assert!(!masked || pair.right().pixels[(x, y)] == [0; 4], "a masked pixel holds zeros");
    }
}

#[test]
fn a_calibration_applies_to_images_of_another_size() {
    let calibration = of_texts(&[(Path::new("cameras.yml"), raw::calibration(&CAMERAS, SIZE, 0.1))]).unwrap();
    let (width, height) = SIZE;
    let options = Options::default();
    let own = Rectification::new(&calibration, SIZE, &options).unwrap();
    // The pixel of the left image in this direction of the rectified view.
    let seen = |by: &Rectification, ray: [f64; 2]| {
        let calib::Camera { focal_length, principal_point } = by.calibration().unwrap().camera.unwrap();
        let [x, y] = [0, 1].map(|i| focal_length[i] * ray[i] + principal_point[i]);
        by.left(x, y).unwrap()
    };
    let same = |by: &Rectification, place: &dyn Fn(f64) -> f64, down: f64| {
        for ray in [[0.0, 0.0], [0.3, -0.2], [-0.25, 0.1]] {
            let (found, [x, y]) = (seen(by, ray), seen(&own, ray));
            let expected = [place(x), place(y) - down];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
        }
    };
    let twice = Rectification::new(&calibration, (2 * width, 2 * height), &options).unwrap();
    assert!(matches!(twice.doubts(), [Doubt::OtherSize { .. }]), "{:?}", twice.doubts());
    same(&twice, &|v| 2.0 * v + 0.5, 0.0);
    let part = calibration.of_part(&Rect { x: 0..width, y: 20..height - 20 }).unwrap();
    let cut = Rectification::new(&part, (width, height - 40), &options).unwrap();
    assert_eq!(cut.doubts(), []);
    same(&cut, &|v| v, 20.0);
    // Control: without the crop, the calibration does not tell what these images show.
    assert!(Rectification::new(&calibration, (width, height - 40), &options).is_err());
    let outside = calibration.of_part(&Rect { x: 0..width, y: 20..height + 20 }).unwrap_err();
    assert!(outside.to_string().contains("not inside"), "{outside}");
    // Only the right image is twice as large.
    let mixed = Rectification::of_sizes(&calibration, [SIZE, (2 * width, 2 * height)], &options).unwrap();
    assert_eq!(mixed.size(), SIZE);
    let (x, y) = (50.0, 40.0);
    assert_eq!(mixed.left(x, y), own.left(x, y));
    let [right, expected] = [mixed.right(x, y).unwrap(), own.right(x, y).unwrap().map(|v| 2.0 * v + 0.5)];
    assert!(right.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{right:?} {expected:?}");
}

#[test]
fn rigs_that_cannot_be_rectified_are_refused() {
    let refused = |change: &dyn Fn(&mut [Camera; 2], &mut f64), options: Options, size, words: &str| {
        let (mut cameras, mut baseline) = (CAMERAS, 0.1);
        change(&mut cameras, &mut baseline);
        let text = raw::calibration(&cameras, SIZE, baseline);
        let calibration = of_texts(&[(Path::new("cameras.yml"), text)]).unwrap();
        let error = Rectification::new(&calibration, size, &options).unwrap_err();
        assert!(matches!(error, Error::Calibration(_) | Error::Mismatch(_)), "{error:?}");
        assert!(error.to_string().contains(words), "{error}");
    };
    let default = Options::default();
    refused(&|_, _| (), default, (241, 180), "is for images of 240 x 180");
    refused(&|_, _| (), Options { alpha: Some(1.5), ..default }, SIZE, "alpha from 0 to 1");
    let forward = |cameras: &mut [Camera; 2], _: &mut f64| {
        for camera in cameras {
            camera.turn = raw::product(&[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], &camera.turn);
        }
    };
    refused(&forward, default, SIZE, "in front of the other");
    let apart = |cameras: &mut [Camera; 2], _: &mut f64| cameras[1].turn = raw::rotation([0.0, 1.2, 0.0]);
    refused(&apart, default, SIZE, "more than 90 degrees apart");
    let over = |cameras: &mut [Camera; 2], _: &mut f64| cameras[1].turn = raw::rotation([0.0, 0.0, 3.1]);
    refused(&over, default, SIZE, "upside down against the other");
}
