//! What is known of a scene, in every form that is read.

use super::points::cloud;
use super::*;
use mrfgs::image::Rect;

const MATCH: &str = "match im0.png im1.png map.pfm --max-disparity 31 --device cpu";

/// A folder with the poster, whose plain wall needs what is known of it.
pub(super) fn poster() -> Folder {
    let folder = Folder::new();
    for file in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt"] {
        fs::copy(scene("poster").join(file), folder.join(file)).unwrap();
    }
    folder
}

/// The map of the poster with these flags, and what was said.
fn known(folder: &Folder, flags: &str) -> (Vec<u8>, String) {
    let said = run(folder, &format!("{MATCH} {flags}")).succeeded().stderr;
    (fs::read(folder.join("map.pfm")).unwrap(), said)
}

/// Percentage of the pixels that are wrong by more than 2 px.
fn wrong(folder: &Folder) -> f64 {
    let (map, truth) = (read_pfm(folder.join("map.pfm")), read_pfm(folder.join("disp0GT.pfm")));
    let right = map.data().iter().zip(truth.data()).filter(|(d, t)| (*d - *t).abs() <= 2.0).count();
    100.0 * (map.data().len() - right) as f64 / map.data().len() as f64
}

/// Every 97th point that the truth shows, in the frame of the left camera.
pub(super) fn points(folder: &Folder) -> Vec<[f64; 3]> {
    run(folder, "depth disp0GT.pfm truth.pfm --calib calib.txt --left im0.png --also points,depth,depth-mm")
        .succeeded();
    cloud(&folder.join("truth.points.ply")).into_iter().step_by(97).map(|point| point.0).collect()
}

pub(super) fn lines(points: &[[f64; 3]]) -> String {
    let lines: Vec<_> = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    lines.concat()
}

#[test]
fn a_point_cloud_is_seen_by_the_left_camera() {
    let folder = poster();
    let (plain, _) = known(&folder, "");
    let before = wrong(&folder);
    let points = points(&folder);
    fs::write(folder.join("scan.xyz"), lines(&points)).unwrap();
    let (map, said) = known(&folder, "--prior scan.xyz");
    assert!(said.contains(&format!("{} points of the prior", points.len())), "{said}");
    assert!(wrong(&folder) < 0.2 * before, "{before} %, then {} %", wrong(&folder));
    assert!(map != plain);
    run(&folder, &format!("{MATCH} --prior scan.xyz --json map.json")).succeeded();
    let record: Value = serde_json::from_slice(&fs::read(folder.join("map.json")).unwrap()).unwrap();
    assert_eq!(
        (&record["prior"]["kind"], &record["prior"]["given"]),
        (&"points".into(), &points.len().into())
    );
    assert!(record["prior"]["trust"].as_f64().unwrap() > 0.9, "{}", record["prior"]);

    // A lidar looks along x, with y to the left and z up, from 0.3 m above and 1 m behind.
    let scan: Vec<_> = points.iter().map(|[x, y, z]| [z + 1.0, -x, -y - 0.3]).collect();
    fs::write(folder.join("scan.xyz"), lines(&scan)).unwrap();
    fs::write(folder.join("lidar.txt"), "0 -1 0 0\n0 0 -1 -0.3\n1 0 0 -1\n").unwrap();
    assert!(known(&folder, "--prior scan.xyz --prior-pose lidar.txt").0 == map);
    // In centimetres.
    let scan: Vec<_> = points.iter().map(|point| point.map(|v| 100.0 * v)).collect();
    fs::write(folder.join("scan.xyz"), lines(&scan)).unwrap();
    assert!(known(&folder, "--prior scan.xyz --prior-unit cm").0 == map);
    // Control: without the unit, all points are far away.
    assert!(known(&folder, "--prior scan.xyz").0 != map);
    // Other cameras.
    let flags = "--prior truth.points.ply --focal 180 --baseline 0.1636111111111111m";
    assert!(known(&folder, flags).1.contains("43200 points of the prior"));
}

#[test]
fn a_depth_map_is_known_in_its_unit() {
    let folder = poster();
    let _ = known(&folder, "");
    let before = wrong(&folder);
    let _ = points(&folder);
    for flags in ["--prior truth.depth.pfm --prior-unit m", "--prior truth.depth-mm.png --prior-unit mm"] {
        let (_, said) = known(&folder, &format!("{flags} --prior-sigma 0.5"));
        assert!(said.contains("a prior for 43200 pixels") && !said.contains("warning"), "{said}");
        assert!(wrong(&folder) < 0.2 * before, "{flags}: {} %", wrong(&folder));
    }
    // Control: in another unit, the images contradict it.
    let (_, said) = known(&folder, "--prior truth.depth-mm.png --prior-unit cm");
    assert!(said.contains("the images contradict the prior"), "{said}");
}

#[test]
fn a_map_may_have_another_size() {
    let folder = poster();
    let _ = known(&folder, "");
    let before = wrong(&folder);
    let truth = read_pfm(folder.join("disp0GT.pfm"));
    let half = Plane::from_fn(120, 90, |x, y| truth[(2 * x, 2 * y)] / 2.0);
    pfm::write(&folder.join("half.pfm"), &half).unwrap();
    let (_, said) = known(&folder, "--prior half.pfm");
    assert!(said.contains("a prior for 43200 pixels"), "{said}");
    assert!(wrong(&folder) < 0.3 * before, "{} %", wrong(&folder));
    // As points, one per pixel of the small map.
    let sparse =
        Plane::from_fn(120, 90, |x, y| if x % 6 + y % 6 == 0 { half[(x, y)] } else { f32::INFINITY });
    pfm::write(&folder.join("half.pfm"), &sparse).unwrap();
    let (_, said) = known(&folder, "--prior half.pfm");
    assert!(said.contains("300 points of the prior"), "{said}");
    pfm::write(&folder.join("half.pfm"), &half.crop(&Rect { x: 0..120, y: 0..80 })).unwrap();
    run(&folder, &format!("{MATCH} --prior half.pfm")).failed(2, "--prior & 120 x 80 & of the same shape");
}

#[test]
fn priors_that_do_not_fit_are_refused() {
    let folder = poster();
    fs::write(folder.join("scan.xyz"), "0 0 5\n").unwrap();
    fs::write(folder.join("behind.xyz"), "0 0 -5\n").unwrap();
    fs::write(folder.join("list.csv"), "10,10,3\n").unwrap();
    fs::write(folder.join("pose.txt"), "1 2 3\n").unwrap();
    fs::write(folder.join("cut.ply"), "ply\nformat ascii 1.0\nelement vertex 2\n").unwrap();
    for (code, flags, words) in [
        (2, "--prior behind.xyz", "--prior & behind.xyz & in front of the camera"),
        (2, "--prior scan.xyz --prior-kind surface", "--prior-kind & holds points"),
        (2, "--prior list.csv --prior-pose pose.txt", "--prior-pose & only applies to a point cloud"),
        (1, "--prior scan.xyz --prior-pose pose.txt", "pose.txt & 3 x 4"),
        (1, "--prior cut.ply", "cut.ply & damaged"),
        (1, "--prior gone.las", "gone.las"),
    ] {
        run(&folder, &format!("{MATCH} {flags}")).failed(code, words);
    }
    // No calibration.
    fs::remove_file(folder.join("calib.txt")).unwrap();
    for (flags, words) in [
        ("--prior scan.xyz", "--prior & camera values & --calib"),
        ("--prior disp0GT.pfm --prior-unit m", "--prior-unit & camera values"),
        ("--prior scan.xyz --rectify", "--prior & without a calibration"),
        (
            "--prior disp0GT.pfm --prior-unit m --focal 180 --baseline 3",
            "--prior-unit & unit of the baseline",
        ),
    ] {
        run(&folder, &format!("{MATCH} {flags}")).failed(2, words);
    }
    assert!(!folder.join("map.pfm").exists());
}

/// Points are in the frame of the camera that took the image, not in that of the rectified view.
#[test]
fn a_point_cloud_is_for_the_image_as_it_was_taken() {
    let folder = Folder::new();
    for file in ["left.png", "right.png", "cameras.yml"] {
        fs::copy(scene("raw").join(file), folder.join(file)).unwrap();
    }
    let line =
        "match left.png right.png map.pfm --rectify --calib cameras.yml --max-disparity 31 --device cpu";
    run(&folder, &format!("{line} --also points-original,points")).succeeded();
    let used = |file: &str| {
        let all = cloud(&folder.join(file));
        let some: Vec<_> = all.iter().step_by(53).map(|point| point.0).collect();
        fs::write(folder.join("scan.xyz"), lines(&some)).unwrap();
        (some.len(), run(&folder, &format!("{line} --prior scan.xyz")).succeeded().stderr)
    };
    let (count, said) = used("map.points-original.ply");
    assert!(said.contains(&format!("{count} points of the prior")) && !said.contains("contradict"), "{said}");
    // Control: those of the rectified view are elsewhere.
    let (count, said) = used("map.points.ply");
    assert!(!said.contains(&format!("{count} points of the prior")) || said.contains("contradict"), "{said}");
}

#[test]
fn frames_of_a_sequence_have_priors() {
    let folder = poster();
    for camera in ["left", "right", "scans"] {
        fs::create_dir(folder.join(camera)).unwrap();
    }
    for frame in ["a1", "a2", "a3"] {
        fs::copy(folder.join("im0.png"), folder.join(format!("left/{frame}.png"))).unwrap();
        fs::copy(folder.join("im1.png"), folder.join(format!("right/{frame}.png"))).unwrap();
    }
    let (plain, _) = known(&folder, "");
    fs::write(folder.join("scans/a2.xyz"), lines(&points(&folder))).unwrap();
    let (with, _) = known(&folder, "--prior scans/a2.xyz");
    let maps = |flags: &str| {
        let line = "sequence left right out --max-disparity 31 --device cpu";
        run(&folder, &format!("{line} {flags}")).succeeded();
        let maps = ["a1", "a2", "a3"].map(|name| fs::read(folder.join(format!("out/{name}.pfm"))).unwrap());
        fs::remove_dir_all(folder.join("out")).unwrap();
        maps
    };
    // Only the second frame has a file. A calibration must be given, as there is none beside the frames.
    assert!(maps("--prior scans --calib calib.txt") == [&plain, &with, &plain].map(Clone::clone));
    assert!(maps("--prior scans/a2.xyz --calib calib.txt") == [&with, &with, &with].map(Clone::clone));
    // Nothing is known of the first frame, and of the others what the ones before show.
    let [first, second, third] = maps("--prior last");
    assert!(first == plain && second != plain && third != plain);
    run(&folder, "sequence left right out --prior scans --max-disparity 31")
        .failed(2, "--prior & camera values");
    fs::create_dir(folder.join("none")).unwrap();
    run(&folder, "sequence left right out --prior none --max-disparity 31")
        .failed(1, "none & holds no files");
}

/// Frames of the rendered sequence of a moving rig in `left`, `right` and `truth`, dark and with noise, so that one frame alone tells
/// little; `calib.txt`; and the poses of the left camera in both forms.
fn moving(folder: &Folder, frames: u32) {
    const SIZE: (usize, usize) = (160, 120);
    // Frames of the film in a step: the views move by up to 10 pixels.
    const STRIDE: u32 = 15;
    for camera in ["left", "right", "truth"] {
        fs::create_dir(folder.join(camera)).unwrap();
    }
    let (mut kitti, mut tum) = (Vec::new(), vec!["# time tx ty tz qx qy qz qw\n".to_owned()]);
    let mut state = 1_u32;
    for step in 0..frames {
        let scene = scenes::moving(STRIDE * step, SIZE.0, SIZE.1, 24);
        let mut noisy = |level: u8| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            level / 4 + (state >> 24) as u8 / 12
        };
        for (camera, view) in [("left", &scene.left), ("right", &scene.right)] {
            let levels = view.data().as_flattened().iter().map(|level| noisy(*level)).collect();
            let picture = image::RgbImage::from_raw(SIZE.0 as u32, SIZE.1 as u32, levels).unwrap();
            picture.save(folder.join(format!("{camera}/{step}.png"))).unwrap();
        }
        fs::write(folder.join(format!("truth/{step}.pfm")), pfm::encode(&scene.truth)).unwrap();
        fs::write(folder.join("calib.txt"), scene.calibration()).unwrap();
        let [x, z] = [0.01, 0.004].map(|by| by * f64::from(STRIDE * step));
        kitti.push(format!("1 0 0 {x} 0 1 0 0 0 0 1 {z}\n"));
        tum.push(format!("{step} {x} 0 {z} 0 0 0 1\n"));
    }
    fs::write(folder.join("kitti.txt"), kitti.concat()).unwrap();
    fs::write(folder.join("tum.txt"), tum.concat()).unwrap();
}

#[test]
fn the_last_frame_is_moved_by_known_poses() {
    const FRAMES: u32 = 6;
    let folder = Folder::new();
    moving(&folder, FRAMES);
    // The maps but the first, the percentage of their pixels that are wrong by more than 2 px, and how much errors change from frame to
    // frame, in px.
    let matched = |flags: &str| {
        let line = "sequence left right out --calib calib.txt --device cpu";
        let said = run(&folder, &format!("{line} {flags}")).succeeded().stderr;
        let maps: Vec<_> = (0..FRAMES).map(|i| read_pfm(folder.join(format!("out/{i}.pfm")))).collect();
        fs::remove_dir_all(folder.join("out")).unwrap();
        let errors: Vec<Vec<f32>> = (0..FRAMES as usize)
            .map(|i| {
                let truth = read_pfm(folder.join(format!("truth/{i}.pfm")));
                maps[i].data().iter().zip(truth.data()).map(|(d, t)| (d - t).clamp(-8.0, 8.0)).collect()
            })
            .collect();
        let mean = |values: &[f32]| f64::from(values.iter().sum::<f32>()) / values.len() as f64;
        let wrong: Vec<f32> =
            errors[1..].concat().iter().map(|e| if e.abs() <= 2.0 { 0.0 } else { 100.0 }).collect();
        let changes: Vec<f32> = errors
            .windows(2)
            .flat_map(|two| two[0].iter().zip(&two[1]).map(|(a, b)| (a - b).abs()))
            .collect();
        let (wrong, change) = (mean(&wrong), mean(&changes));
        println!("{flags:>40}: {wrong:.2} % wrong, changes of {change:.3} px");
        (maps, wrong, change, said)
    };
    let (_, plain, flicker, _) = matched("");
    let (_, still, jumps, _) = matched("--prior last");
    let (maps, wrong, change, said) = matched("--prior last --prior-pose kitti.txt");
    assert!(!said.contains("warning"), "{said}");
    assert!(
        wrong < 0.9 * plain && wrong < 0.8 * still,
        "{plain} %, with the last {still} %, moved {wrong} %"
    );
    assert!(change < 0.95 * flicker && change < 0.95 * jumps, "{flicker} px, {jumps} px, then {change} px");
    assert!(matched("--prior last --prior-pose tum.txt --threads 1").0 == maps);
    // In another unit.
    let millimetres = |line: &str| {
        let words = line.split(' ').enumerate();
        let scaled =
            words.map(
                |(i, v)| if i % 4 == 3 { (1000.0 * v.parse::<f64>().unwrap()).to_string() } else { v.into() },
            );
        scaled.collect::<Vec<_>>().join(" ") + "\n"
    };
    let kitti = fs::read_to_string(folder.join("kitti.txt")).unwrap();
    fs::write(folder.join("mm.txt"), kitti.lines().map(millimetres).collect::<String>()).unwrap();
    let (_, in_unit, _, _) = matched("--prior last --prior-pose mm.txt --prior-unit mm");
    assert!((in_unit - wrong).abs() < 0.1, "{in_unit} %");
    // Controls: a way to the other side makes it worse, and one far ahead is noticed.
    let control = |x: f64, z: f64| {
        let line =
            |step: u32| format!("1 0 0 {} 0 1 0 0 0 0 1 {}\n", x * f64::from(step), z * f64::from(step));
        fs::write(folder.join("other.txt"), (0..FRAMES).map(line).collect::<String>()).unwrap();
        matched("--prior last --prior-pose other.txt")
    };
    let (_, misled, _, _) = control(-0.5, 0.0);
    assert!(misled > 1.3 * wrong, "{misled} %");
    let (_, _, _, said) = control(0.0, 0.9);
    assert!(said.contains("contradict"), "{said}");
    // A way that ends early, and what else does not fit.
    fs::write(folder.join("short.txt"), kitti.lines().take(2).collect::<Vec<_>>().join("\n")).unwrap();
    let (_, _, _, said) = matched("--prior last --prior-pose short.txt");
    assert!(
        said.contains("warning: short.txt has poses of 2 frames; later ones are matched without the last"),
        "{said}"
    );
    let line = "sequence left right out --max-disparity 23 --prior last --prior-pose";
    run(&folder, &format!("{line} calib.txt --calib calib.txt")).failed(1, "calib.txt: line 1 & no pose");
    fs::remove_file(folder.join("calib.txt")).unwrap();
    run(&folder, &format!("{line} kitti.txt")).failed(2, "--prior-pose & camera values");
}

#[test]
fn flags_of_sequences_stand_under_their_headings() {
    let help = run(&Folder::new(), "sequence --help").succeeded().stdout;
    let (before, known) = help.split_once("What is known of the scene:").unwrap();
    let (known, after) = known.split_once("Method:").unwrap();
    for (flag, there) in
        [("--steady", before), ("--recalibrate", before), ("--prior-topic", known), ("--device", after)]
    {
        let line = format!("\n      {flag}");
        assert_eq!(help.matches(&line).count(), 1, "{flag}");
        assert!(there.contains(&line), "{flag}");
    }
}
