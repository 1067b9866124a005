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
