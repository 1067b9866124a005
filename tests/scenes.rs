//! The rendered scenes: `testdata/` holds the output of the renderer, and its ground truth is correct.

#[path = "../testdata/scenes.rs"]
mod scenes;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mrfgs::image::Plane;
use scenes::Scene;

static SCENES: LazyLock<Vec<Scene>> =
    LazyLock::new(|| scenes::ALL.iter().map(scenes::Recipe::render).collect());

/// Scenes of a defective rig.
const AT_FAULT: [&str; 3] = ["rows", "focus", "grain"];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

/// The bytes of a little-endian, one-channel PFM file with these values.
fn pfm(plane: &Plane<f32>) -> Vec<u8> {
    let mut bytes = format!("Pf\n{} {}\n-1.0\n", plane.width(), plane.height()).into_bytes();
    for y in (0..plane.height()).rev() {
        bytes.extend(plane.row(y).iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// Between frames of the sequence only the passing objects move; the rest changes by noise alone.
#[test]
fn passing_objects_move() {
    let [first, next] = [0, 1].map(|step| scenes::passing(step, 120, 90, 24));
    let moves = |x: usize, y: usize| (first.truth[(x, y)] - next.truth[(x, y)]).abs() > 1e-6;
    let moving = (0..90).flat_map(|y| (0..120).map(move |x| (x, y))).filter(|(x, y)| moves(*x, *y)).count();
    assert!((100..2000).contains(&moving), "{moving} pixels move");
    let mut still = Vec::new();
    for (y, x) in (1..89).flat_map(|y| (1..119).map(move |x| (y, x))) {
        if !(y - 1..=y + 1).any(|y| (x - 1..=x + 1).any(|x| moves(x, y))) {
            let [a, b] = [&first, &next].map(|scene| i32::from(scene.left[(x, y)][1]));
            still.push((a - b).abs());
        }
    }
    let changed = still.iter().filter(|off| **off > 0).count();
    assert!(2 * changed > still.len(), "noise changes most pixels");
    // Moving shadows change some pixels.
    let small = still.iter().filter(|off| **off <= 6).count();
    assert!(small as f64 > 0.97 * still.len() as f64, "{small} of {}", still.len());
}

#[test]
fn the_files_are_a_fresh_rendering() {
    let mut names: Vec<_> = SCENES.iter().map(|scene| scene.name.to_owned()).collect();
    names.sort();
    let mut folders: Vec<_> = fs::read_dir(folder("")).unwrap().map(Result::unwrap).collect();
    folders.retain(|entry| entry.file_type().unwrap().is_dir());
    let mut folders: Vec<_> = folders.iter().map(|entry| entry.file_name().into_string().unwrap()).collect();
    // tests/rectification.rs covers the raw pair, and the folder of the caster holds code.
    folders.retain(|name| !["raw", "caster"].contains(&name.as_str()));
    folders.sort();
    assert_eq!(names, folders, "every folder is a scene's, and every scene has one");
    for scene in SCENES.iter() {
        let (name, folder) = (scene.name, folder(scene.name));
        let (width, height) = scene.left.size();
        for (file, view) in [("im0.png", &scene.left), ("im1.png", &scene.right)] {
            let image = image::open(folder.join(file)).unwrap();
            assert_eq!(image.color(), image::ColorType::Rgb8, "{name}/{file}");
            assert_eq!((image.width() as usize, image.height() as usize), (width, height), "{name}/{file}");
            assert!(image.as_bytes() == view.data().as_flattened(), "{name}/{file}: render the scenes again");
        }
        let mask = image::open(folder.join("mask0nocc.png")).unwrap();
        assert_eq!(mask.color(), image::ColorType::L8, "{name}");
        assert!(mask.as_bytes() == scene.mask.data(), "{name}/mask0nocc.png: render the scenes again");
        let truth = fs::read(folder.join("disp0GT.pfm")).unwrap();
        assert!(truth == pfm(&scene.truth), "{name}/disp0GT.pfm: render the scenes again");
        let calib = fs::read_to_string(folder.join("calib.txt")).unwrap();
        assert_eq!(calib, scene.calibration(), "{name}: render the scenes again");
        if name == "poster" {
            let lidar = fs::read_to_string(folder.join("lidar.csv")).unwrap();
            assert_eq!(lidar, scene.lidar(), "{name}: render the scenes again");
        }
    }
}

/// Whether the truth is finite and inside the labels, and the mask has only its two values.
fn assert_in_range(scene: &Scene) {
    let last = (scene.labels - 1) as f32;
    for truth in [&scene.truth, &scene.truth_right] {
        assert!(truth.data().iter().all(|d| (0.0..=last).contains(d)), "{}: truth out of range", scene.name);
    }
    assert!(scene.mask.data().iter().all(|m| matches!(m, 255 | 128)), "{}", scene.name);
}

#[test]
fn the_truth_is_inside_the_labels() {
    for scene in SCENES.iter() {
        assert_in_range(scene);
        let hidden = share(scene.mask.data().iter().map(|&m| m == 128));
        assert!((0.05..0.25).contains(&hidden), "{}: {hidden} hidden", scene.name);
        let (low, high) =
            scene.truth.data().iter().fold((f32::MAX, 0.0_f32), |(l, h), &d| (l.min(d), h.max(d)));
        assert!(
            high - low > 0.4 * scene.labels as f32,
            "{}: {low} ..= {high} uses too few labels",
            scene.name
        );
    }
}

#[test]
fn scenes_render_at_any_size() {
    for recipe in scenes::ALL {
        for (width, height, labels) in [(1, 1, 2), (61, 47, 9), (7, 90, 64), (90, 30, 60), (24, 18, 36)] {
            let scene = scenes::render(recipe.name, width, height, labels);
            assert_eq!(scene.left.size(), (width, height));
            assert_in_range(&scene);
        }
        let flat = scenes::render(recipe.name, 31, 23, 1);
        assert!(flat.truth.data().iter().all(|&d| d == 0.0) && flat.mask.data().iter().all(|&m| m == 255));
    }
}

fn share(marks: impl Iterator<Item = bool>) -> f64 {
    let (marked, all) = marks.fold((0, 0), |(marked, all), mark| (marked + usize::from(mark), all + 1));
    f64::from(marked as u32) / f64::from(all)
}

/// The level that the right sensor records where the left view at (x, y) has `level`, if the right view sees
/// the point at `at`.
fn as_right(scene: &Scene, level: u8, [x, at]: [f64; 2], y: usize) -> f32 {
    let (size, y) = (scene.left.size(), y as f64);
    let light = scene.sensors[0].light(f64::from(level), size, x, y);
    scene.sensors[1].level(light, size, at, y) as f32
}

/// Mean absolute colour difference in grey levels between the visible pixels and the right view `d` further
/// left, with `expose` (level, columns of both views, row) applied to the left view first.
fn difference(
    scene: &Scene,
    d: impl Fn(usize, usize) -> f32,
    expose: impl Fn(u8, [f64; 2], usize) -> f32,
) -> f32 {
    let (width, height) = scene.left.size();
    let (mut sum, mut count) = (0.0, 0);
    for y in 0..height {
        for x in (0..width).filter(|&x| scene.mask[(x, y)] == 255) {
            let at = (x as f32 - d(x, y)).clamp(0.0, (width - 1) as f32);
            let (x0, part) = (at as usize, at.fract());
            let [near, far] = [x0, (x0 + 1).min(width - 1)].map(|x| scene.right[(x, y)]);
            for c in 0..3 {
                let right = f32::from(near[c]) * (1.0 - part) + f32::from(far[c]) * part;
                sum += f64::from((expose(scene.left[(x, y)][c], [x as f64, f64::from(at)], y) - right).abs());
            }
            count += 3;
        }
    }
    (sum / f64::from(count)) as f32
}

#[test]
fn visible_points_look_alike_in_both_views() {
    for scene in SCENES.iter().filter(|scene| !AT_FAULT.contains(&scene.name)) {
        let exposure = |level, columns, y| as_right(scene, level, columns, y);
        let (width, height) = scene.left.size();
        let truth = difference(scene, |x, y| scene.truth[(x, y)], exposure);
        // The controls: one and a half labels off, mirrored, and with the opposite sign.
        let off = [-1.5, 1.5].map(|by| difference(scene, |x, y| scene.truth[(x, y)] + by, exposure));
        let mirrored = difference(scene, |x, y| scene.truth[(width - 1 - x, height - 1 - y)], exposure);
        let negated = difference(scene, |x, y| -scene.truth[(x, y)], exposure);
        println!("{}: {truth:.2}, off {off:.2?}, mirrored {mirrored:.2}, negated {negated:.2}", scene.name);
        // Noise alone gives 1.4; the rest is linear interpolation, which is coarse at the edges of stripes
        // and squares.
        assert!(truth < 4.0, "{}: {truth}", scene.name);
        assert!(off.iter().all(|&off| off > 1.5 * truth), "{}: {truth} and off {off:?}", scene.name);
        assert!(mirrored > 3.0 * truth && negated > 3.0 * truth, "{}: {truth}, {mirrored}", scene.name);
    }
}

#[test]
fn only_the_exposure_scene_differs_in_exposure() {
    for scene in SCENES.iter() {
        let means = [&scene.left, &scene.right].map(|view| {
            let bytes = view.data().as_flattened();
            bytes.iter().map(|&b| f64::from(b)).sum::<f64>() / bytes.len() as f64
        });
        assert_eq!((means[0] - means[1]).abs() > 8.0, scene.name == "exposure", "{}: {means:?}", scene.name);
    }
}

#[test]
fn different_sensors_leave_their_mark() {
    for scene in SCENES.iter() {
        let truth = |x: usize, y: usize| scene.truth[(x, y)];
        let as_seen = difference(scene, truth, |level, _, _| f32::from(level));
        let undone = difference(scene, truth, |level, columns, y| as_right(scene, level, columns, y));
        println!("{}: {as_seen:.2} as seen, {undone:.2} with the sensors' difference undone", scene.name);
        let [left, right] = scene.sensors;
        let same = (left.gain, left.offset, left.fall_off, left.brightest)
            == (right.gain, right.offset, right.fall_off, right.brightest);
        assert_eq!(same, !["exposure", "light"].contains(&scene.name), "{}", scene.name);
        if same {
            assert!((as_seen - undone).abs() < 1e-3, "{}: {as_seen} and {undone}", scene.name);
        } else {
            assert!(as_seen > 2.0 * undone, "{}: {as_seen} and {undone}", scene.name);
        }
    }
}

/// Defective rigs see the scene `mixed`: the right view of `rows` is 0.6 rows lower, that of `focus` is
/// blurred, and both views of `grain` are noisy.
#[test]
fn defective_rigs_have_their_defects() {
    let of = |name: &str| SCENES.iter().find(|scene| scene.name == name).unwrap();
    let sound = scenes::render("mixed", 240, 180, 32);
    let green = |view: &Plane<[u8; 3]>, x: usize, y: usize| f64::from(view[(x, y)][1]);
    let places = || (8..172).flat_map(|y| (8..232).map(move |x| (x, y)));
    let mean = |f: &dyn Fn(usize, usize) -> f64| places().map(|(x, y)| f(x, y)).sum::<f64>() / 164.0 / 224.0;
    for name in AT_FAULT {
        assert!(of(name).truth == sound.truth && of(name).mask == sound.mask, "{name}");
        assert_eq!(of(name).left == sound.left, name != "grain", "{name}");
    }
    let off = |by: f64| {
        let between = |x, y| (1.0 - by) * green(&sound.right, x, y) + by * green(&sound.right, x, y - 1);
        mean(&|x, y| (green(&of("rows").right, x, y) - between(x, y)).abs())
    };
    let [none, right, whole] = [0.0, 0.6, 1.0].map(off);
    println!("rows: {none:.2}, {right:.2} and {whole:.2} levels off");
    assert!(right < 0.7 * none.min(whole), "{none}, {right}, {whole}");
    let detail = |view| {
        mean(&|x, y| (green(view, x, y) - f64::midpoint(green(view, x - 1, y), green(view, x + 1, y))).abs())
    };
    let [blurred, sharp] = [&of("focus").right, &of("focus").left].map(detail);
    println!("focus: detail of {blurred:.2} beside {sharp:.2} levels");
    assert!(blurred < 0.6 * sharp, "{blurred} beside {sharp}");
    for (noisy, clean) in [(&of("grain").left, &sound.left), (&of("grain").right, &sound.right)] {
        let variance = mean(&|x, y| (green(noisy, x, y) - green(clean, x, y)).powi(2));
        assert!((10.0..13.0).contains(&variance.sqrt()), "noise of {:.1} levels", variance.sqrt());
    }
}

/// The scene `light` tests vignetting: points of the wall differ by several levels near the sides, and hardly
/// in between.
#[test]
fn vignetting_differs_by_several_levels() {
    let scene = SCENES.iter().find(|scene| scene.name == "light").unwrap();
    let (width, height) = scene.left.size();
    let at = |x: usize, y: usize| {
        let level = scene.left[(x, y)][1];
        let d = f64::from(scene.truth[(x, y)]);
        as_right(scene, level, [x as f64, x as f64 - d], y) - f32::from(level)
    };
    let [left, middle, right] = [20, width / 2, width - 5].map(|x| at(x, height / 4));
    println!("{left:.1}, {middle:.1}, {right:.1} levels from left to right");
    assert!((4.0..10.0).contains(&left) && middle.abs() < 3.0 && (-10.0..-4.0).contains(&right));
}

#[test]
fn the_mask_follows_from_the_truth_of_both_views() {
    for scene in SCENES.iter() {
        // A pixel counts as visible in the right view if one of the two pixels next to x - d has its
        // disparity there.
        // This rule tests pixel centres only, so it fails along some silhouettes where the mask is right.
        let seen = |x: usize, y: usize| {
            let d = scene.truth[(x, y)];
            let at = x as f32 - d;
            let near = |x: f32| (scene.truth_right[(x as usize, y)] - d).abs() < 0.5;
            at >= 0.0 && (near(at.floor()) || near(at.ceil()))
        };
        let (width, height) = scene.mask.size();
        let agree = |mask: &dyn Fn(usize, usize) -> u8| {
            share((0..width * height).map(|i| {
                let (x, y) = (i % width, i / width);
                seen(x, y) == (mask(x, y) == 255)
            }))
        };
        let right = agree(&|x, y| scene.mask[(x, y)]);
        let mirrored = agree(&|x, y| scene.mask[(width - 1 - x, y)]);
        let all_visible = agree(&|_, _| 255);
        println!("{}: {right:.4}, mirrored {mirrored:.4}, all visible {all_visible:.4}", scene.name);
        assert!(right > 0.98, "{}: the mask agrees with the truth at {right} of the pixels", scene.name);
        assert!(mirrored < 0.95 && all_visible < 0.95, "{}: {mirrored}, {all_visible}", scene.name);
    }
}
