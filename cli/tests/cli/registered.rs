//! Depths in the view of a third camera.

use super::*;

const MATCH: &str = "match @raw/left.png @raw/right.png";
const RECTIFY: &str = "--rectify --calib @raw/cameras.yml --device cpu --quiet";

/// The third camera of `testdata/raw` in the formats of other programs, with the numbers of its file.
fn forms() -> [(&'static str, String); 4] {
    let text = fs::read_to_string(scene("raw/third.yml")).unwrap();
    let numbers = |name: &str| -> Vec<f64> {
        let after = text.split(&format!("{name}: !!opencv-matrix")).nth(1).unwrap();
        let data = after.split('[').nth(1).unwrap().split(']').next().unwrap();
        data.split(',').map(|v| v.trim().parse().unwrap()).collect()
    };
    let (k, d, r, t) = (numbers("K"), numbers("D"), numbers("R"), numbers("T"));
    let pose = |scale: f64| -> Vec<Vec<f64>> {
        let row = |i: usize| vec![r[3 * i], r[3 * i + 1], r[3 * i + 2], scale * t[i]];
        (0..3).map(row).chain([vec![0.0, 0.0, 0.0, 1.0]]).collect()
    };
    // The first camera after the left one stands for the right camera.
    let kalibr = format!(
        "cam0: {{camera_model: pinhole}}\ncam1:\n  T_cn_cnm1: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n\
         cam2:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: {:?}\n  intrinsics: {:?}\n  \
         resolution: [400, 240]\n  T_cn_cnm1: {:?}\n",
        &d[..4],
        [k[0], k[4], k[2], k[5]],
        pose(1.0)
    );
    let centimetres = t.iter().map(|v| 100.0 * v).collect::<Vec<_>>();
    let extrinsics = |to: i8, turn: &[&[f64]], moved: &[f64]| {
        let translation = serde_json::json!({"x": moved[0], "y": moved[1], "z": moved[2]});
        serde_json::json!({"toCameraSocket": to, "rotationMatrix": turn, "translation": translation})
    };
    let camera = |extrinsics: Value| {
        serde_json::json!({
            "cameraType": 0, "width": 400, "height": 240, "intrinsicMatrix": [&k[..3], &k[3..6], &k[6..]], "distortionCoeff": d,
            "extrinsics": extrinsics
        })
    };
    let oak = serde_json::json!({
        "cameraData": [
            [0, camera(extrinsics(-1, &[], &[0.0; 3]))],
            [1, camera(extrinsics(0, &[&r[..3], &r[3..6], &r[6..]], &centimetres))],
            [2, camera(extrinsics(-1, &[], &[0.0; 3]))],
        ],
        "stereoRectificationData": {"leftCameraSocket": 1, "rightCameraSocket": 2}
    });
    let one = format!(
        "camera_matrix: {k:?}\ndistortion_coefficients: {d:?}\nimage_width: 400\nimage_height: 240\nunit: mm\nT: {:?}\n",
        pose(1000.0)
    );
    [("third.yml", text), ("chain.yaml", kalibr), ("oak.json", oak.to_string()), ("one.yaml", one)]
}

#[test]
fn depths_are_registered_with_files_of_several_formats() {
    let folder = Folder::new();
    let mut first: Option<Plane<f32>> = None;
    for (name, text) in forms() {
        fs::write(folder.join(name), text).unwrap();
        let line =
            format!("{MATCH} d.pfm {RECTIFY} --also depth-registered,depth-registered-mm --into {name}");
        run(&folder, &line).succeeded();
        let depths = read_pfm(folder.join("d.depth-registered.pfm"));
        assert_eq!(depths.size(), (400, 240), "{name}");
        let known = depths.data().iter().filter(|depth| depth.is_finite()).count();
        assert!((40_000..60_000).contains(&known), "{name}: {known}");
        let whole = image::open(folder.join("d.depth-registered-mm.png")).unwrap().into_luma16();
        for (whole, depth) in whole.pixels().zip(depths.data()) {
            let expected = if depth.is_finite() { (1000.0 * f64::from(*depth)).round() } else { 0.0 };
            assert_eq!(whole[0], expected as u16, "{name}");
        }
        let first = first.get_or_insert_with(|| depths.clone());
        // Other units round the pose.
        for (a, b) in depths.data().iter().zip(first.data()) {
            let same = (!a.is_finite() && !b.is_finite()) || (a - b).abs() < 1e-5 * b;
            assert!(same, "{name}: {a} and {b}");
        }
    }
}

#[test]
fn an_existing_map_gives_the_same_depths() {
    let folder = Folder::new();
    let also = "--also depth-registered --into @raw/third.yml";
    let matched =
        run(&folder, &format!("match @mixed/im0.png @mixed/im1.png d.pfm {also} --device cpu")).succeeded();
    matched.says("depths of --into 1. & unit: m");
    let depths = fs::read(folder.join("d.depth-registered.pfm")).unwrap();
    run(&folder, &format!("depth d.pfm e.pfm --calib @mixed/calib.txt {also} --quiet")).succeeded();
    assert!(fs::read(folder.join("e.depth-registered.pfm")).unwrap() == depths);
    // Uncertain and distant pixels are dropped there, too.
    run(&folder, &format!("depth d.pfm f.pfm --calib @mixed/calib.txt {also} --quiet --clip-depth 2"))
        .succeeded();
    let near = read_pfm(folder.join("f.depth-registered.pfm"));
    assert!(near.data().iter().filter(|depth| depth.is_finite()).all(|depth| *depth < 2.2));
}

#[test]
fn a_batch_and_a_sequence_take_a_third_camera() {
    let folder = Folder::new();
    fs::create_dir(folder.join("pairs")).unwrap();
    copy("slanted", &folder.join("pairs/a"));
    let into = |focal: f64| {
        let text = format!(
            "K: [{focal}, 0, 60, 0, {focal}, 40, 0, 0, 1]\nD: [0, 0, 0, 0]\nR: [0, 0, 0]\nT: [0, 0, 0]\nsize: [120, 80]\n"
        );
        fs::write(folder.join("t.yml"), text).unwrap();
    };
    let line = "batch pairs out --also depth-registered --into t.yml --device cpu --method fast";
    into(100.0);
    run(&folder, line).succeeded();
    let first = fs::read(folder.join("out/a.depth-registered.pfm")).unwrap();
    run(&folder, line).succeeded().says("1 skipped");
    // Another camera invalidates the maps.
    into(1000.0);
    run(&folder, line).succeeded();
    assert!(fs::read(folder.join("out/a.depth-registered.pfm")).unwrap() != first);
    for view in ["0", "1"] {
        fs::create_dir(folder.join(view)).unwrap();
        fs::copy(scene(&format!("slanted/im{view}.png")), folder.join(view).join("1.png")).unwrap();
    }
    into(100.0);
    let line = "sequence 0 1 maps --calib @slanted/calib.txt --also depth-registered --into t.yml --device cpu --method fast";
    run(&folder, line).succeeded();
    assert_eq!(read_pfm(folder.join("maps/1.depth-registered.pfm")).size(), (120, 80));
}

#[test]
fn invalid_cameras_are_refused() {
    let folder = Folder::new();
    let good = "K: [100, 0, 60, 0, 100, 40, 0, 0, 1]\nD: [0, 0, 0, 0]\nR: [0, 0, 0]\nT: [0, 0, 0]\nsize: [120, 80]\n";
    let line = format!("{MATCH} d.pfm {RECTIFY} --also depth-registered --into t.yml");
    for (entry, other, words) in [
        ("K: [100, 0, 60, 0, 100, 40, 0, 0, 1]", "", "t.yml & K is missing & one camera"),
        ("K: [100", "K: [-1", "t.yml & K: expected a camera matrix"),
        ("D: [0, 0, 0, 0]", "", "t.yml & D is missing & 0 0 0 0 for none"),
        ("D: [0, 0, 0, 0]", "D: [0, 0, 0]", "t.yml & D: "),
        ("R: [0, 0, 0]", "", "t.yml & R is missing & to this one"),
        ("R: [0, 0, 0]", "R: [1, 1, 0, 0, 1, 0, 0, 0, 1]", "t.yml & R: expected a rotation"),
        ("T: [0, 0, 0]", "", "t.yml & T is missing & frame of this one"),
        ("T: [0, 0, 0]", "T: [0, 0]", "t.yml & T: expected 3 numbers"),
        ("size: [120, 80]", "", "t.yml & image_size is missing"),
        ("size: [120, 80]", "size: [0, 80]", "t.yml & size: expected width and height"),
        ("size: [120, 80]", "size: [1000000, 1000000]", "t.yml & too large"),
        ("size: [120, 80]", "size: [120, 80]\nunit: feet", "t.yml & unit: expected mm, cm, m or unknown"),
        ("K: [100", "cam0: {a: 1}\nK: [100", "t.yml & cam1 is missing & Kalibr's"),
    ] {
        assert!(good.contains(entry));
        fs::write(folder.join("t.yml"), good.replace(entry, other)).unwrap();
        run(&folder, &line).failed(1, words);
    }
    fs::write(folder.join("t.yml"), good).unwrap();
    let flagged = |also: &str| format!("{MATCH} d.pfm {RECTIFY} {also}");
    run(&folder, &flagged("--also depth --into t.yml")).failed(2, "--into & add one of them");
    run(&folder, &flagged("--also depth-registered")).failed(2, "--also depth-registered & add --into FILE");
    run(&folder, &flagged("--also depth-registered --into none.yml")).failed(1, "none.yml");
    let line = format!("{MATCH} t.yml.pfm {RECTIFY} --also depth-registered --into t.yml.pfm");
    fs::write(folder.join("t.yml.pfm"), good).unwrap();
    run(&folder, &line).failed(2, "t.yml.pfm & the file of --into");
    assert_eq!(listing(&folder).len(), 2);
}
