//! Calibrations as written by many programs: all forms of the same cameras give the same rectified pair.

use super::calibrations::alike;
use super::forms::{Files, Rig, fisheyes, radial, unified};
use super::*;

/// The form, the text and its replacement, and words of the error.
const WRONG: &[(&str, &str, &str, &str)] = &[
    ("EuRoC", "T_BS", "T_BX", "does not belong to the other files"),
    (
        "EuRoC",
        "radial-tangential",
        "cubic",
        "distortion_model: expected radtan & `cubic` & (read as EuRoC's)",
    ),
    (
        "EuRoC",
        "[240, 180]",
        "[240, 181]",
        "the calibration is for images of 240 x 180, 240 x 181, but these are 240 x 180 & --calib-crop",
    ),
    ("ORB-SLAM3", "\"PinHole\"", "\"Cylinder\"", "Camera.type: expected PinHole & `Cylinder` & ORB-SLAM's"),
    ("ORB-SLAM3", "Stereo.T_c1_c2", "Stereo.T", "Stereo.T_c1_c2 is missing & ORB-SLAM's"),
    ("ORB-SLAM3", "Camera2.fx", "Camera2.f", "Camera2.fx is missing"),
    (
        "VINS-Fusion",
        "PINHOLE",
        "SCARAMUZZA",
        "model_type: expected PINHOLE, MEI or KANNALA_BRANDT & camodocal's",
    ),
    ("VINS-Fusion", "body_T_cam1", "body_T_cam2", "body_T_cam1 is missing"),
    (
        "VINS-Fusion",
        "body_T_cam0",
        "body_T_cam9",
        "is one of three files & none of how the cameras stand & body_T_cam0",
    ),
    ("camodocal", "q_w", "q_v", "is one of three files & camodocal's transform"),
    ("camodocal", "t_y", "t_w", "extrinsics.yaml & transform.t_y is missing"),
    ("camodocal", "q_w: ", "q_w: 7", "transform: expected a rotation as a quaternion of length 1"),
    (
        "Basalt",
        "pinhole-radtan8",
        "pinhole-x",
        "value0.intrinsics[0].camera_type: expected pinhole & Basalt's",
    ),
    ("Basalt", "\"qw\"", "\"qv\"", "T_imu_cam[0].qw is missing"),
    ("Basalt", "\"T_imu_cam\": [", "\"T_imu_cam\": [3, ", "value0.T_imu_cam[0]: expected a group of entries"),
    (
        "DepthAI",
        "\"cameraType\":0",
        "\"cameraType\":7",
        "cameraType: expected 0 (perspective) or 1 (fisheye)",
    ),
    ("DepthAI", "\"leftCameraSocket\":1", "\"leftCameraSocket\":5", "has no camera at socket 5 & DepthAI's"),
    ("DepthAI", "\"toCameraSocket\":2", "\"toCameraSocket\":-1", "no extrinsics lead & calibrate again"),
    ("COLMAP", "240 180", "240", "expected CAMERA_ID, MODEL, WIDTH, HEIGHT & COLMAP's"),
    ("COLMAP", "3 OPENCV", "9 OPENCV", "is of camera 3, which cameras.txt lacks"),
    (
        "ROS with binning",
        "x_offset: 20",
        "x_offset: 200",
        "roi: is not in the sensor of 600 x 400 pixels & ROS's",
    ),
    ("OpenCV in base64", "MWQg", "MXEg", "K1: expected 9 numbers & a damaged matrix"),
    ("OpenCV in JSON", "\"D2\"", "\"D1\"", "is no JSON: `D1` is there twice"),
    ("Kalibr", "pinhole", "ds", "cam0.intrinsics: expected 6 numbers: xi, alpha, fu, fv, pu, pv & 4 numbers"),
    (
        "Kalibr",
        "radtan",
        "fov",
        "cam0.distortion_coeffs: expected 1 coefficient, the field of view & 4 numbers",
    ),
];

fn rectified(folder: &Path, files: &Files, name: &str) -> Run {
    let calib = files.iter().map(|(file, _)| format!(" --calib {file}")).collect::<Vec<_>>().concat();
    for (file, text) in files {
        fs::write(folder.join(file), text).unwrap();
    }
    run(folder, &format!("rectify @raw/left.png @raw/right.png {name}{calib}"))
}

#[test]
fn every_form_of_the_same_cameras_gives_the_same_pair() {
    let fisheye = |text: &str| Rig::fisheye().opencv(text);
    for (kind, reference, forms) in [
        ("radial", Rig::new().opencv(""), radial()),
        ("fisheye", fisheye("fisheye: 1"), fisheyes()),
        ("unified", Rig::unified().opencv("xi1: 0.9\nxi2: 0.9"), unified()),
    ] {
        let folder = Folder::new();
        rectified(&folder, &vec![("reference", reference)], "expected").succeeded();
        for (form, files) in forms {
            let told = rectified(&folder, &files, "out").succeeded();
            assert!(!told.stderr.contains("warning"), "{form}: {}", told.stderr);
            alike(&folder.join("expected"), &folder.join("out"), &format!("{kind} of {form}"));
            fs::remove_dir_all(folder.join("out")).unwrap();
        }
    }
}

/// Models that OpenCV lacks, as Kalibr and Basalt write them.
#[test]
fn wide_lenses_are_the_same_in_every_form() {
    let rig = Rig::new();
    for (model, kalibr, basalt) in [
        ("ds", ("ds", "-0.2, 0.6, "), ("ds", vec![("xi", -0.2), ("alpha", 0.6)])),
        ("eucm", ("eucm", "0.6, 1.1, "), ("eucm", vec![("alpha", 0.6), ("beta", 1.1)])),
        ("ucm", ("eucm", "0.6, 1.0, "), ("ucm", vec![("alpha", 0.6)])),
    ] {
        let folder = Folder::new();
        let chain = vec![("chain.yaml", rig.kalibr(kalibr.0, kalibr.1, "none"))];
        rectified(&folder, &chain, "expected").succeeded().says("have a source");
        rectified(&folder, &rig.basalt(basalt.0, &basalt.1, &[]), "out").succeeded();
        alike(&folder.join("expected"), &folder.join("out"), model);
    }
    let folder = Folder::new();
    let text = Rig { d: [[0.9, 0.0, 0.0, 0.0]; 2], ..Rig::new() }.kalibr("pinhole", "", "fov");
    rectified(&folder, &vec![("chain.yaml", text.replace("[0.9, 0.0, 0.0, 0.0]", "[0.9]"))], "expected")
        .succeeded();
    let fov = Rig::new().colmap("FOV");
    let cameras: String = fov[0]
        .1
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split(' ').collect();
            if words[1] == "FOV" { words[..8].join(" ") + " 0.9\n" } else { format!("{line}\n") }
        })
        .collect();
    rectified(&folder, &vec![("cameras.txt", cameras), fov[1].clone()], "out").succeeded();
    alike(&folder.join("expected"), &folder.join("out"), "fov");
}

/// ZED's file has a lens per image size; the images of the test have yet another size.
#[test]
fn the_size_of_the_images_chooses_the_lens() {
    let folder = Folder::new();
    let files = Rig::new().zed();
    rectified(&folder, &files, "out").failed(1, "SN1234.conf & is for images of 1280 x 720 & 240 x 180");
    // They apply to raw images, whatever their size.
    run(&folder, "match @raw/left.png @raw/right.png d.pfm --calib SN1234.conf")
        .failed(1, "SN1234.conf & describes images that are not rectified; add --rectify");
    for (name, (width, height)) in [("hd", (1280, 720)), ("vga", (672, 376))] {
        let picture = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x * 7 + y * 13) as u8]));
        picture.save(folder.join("view.png")).unwrap();
        let reference = Rig::new().opencv("").replace("[ 240, 180 ]", &format!("[ {width}, {height} ]"));
        fs::write(folder.join("opencv"), reference).unwrap();
        for (calib, out) in [("opencv", "expected"), ("SN1234.conf", "out")] {
            run(&folder, &format!("rectify view.png view.png {name}.{out} --calib {calib} --alpha 0"))
                .succeeded();
        }
        alike(&folder.join(format!("{name}.expected")), &folder.join(format!("{name}.out")), name);
    }
    for (from, to, words) in [
        ("fx=214", "fx=-214", "LEFT_CAM_HD: has a focal length that is not above 0 & ZED's"),
        ("RX_VGA", "RX_V", "STEREO.RX_VGA is missing"),
        ("[STEREO]", "[LEFT_CAM_HD]", "`LEFT_CAM_HD` is there twice"),
    ] {
        let text = files[0].1.replacen(from, to, 1);
        rectified(&folder, &vec![("a-file", text)], "out").failed(1, &format!("a-file & {words}"));
    }
}

#[test]
fn gzipped_calibrations_are_read() {
    let folder = Folder::new();
    rectified(&folder, &vec![("a.yml", Rig::new().opencv(""))], "expected").succeeded();
    let gzip = Command::new("gzip").arg(folder.join("a.yml")).status().unwrap();
    assert!(gzip.success());
    run(&folder, "rectify @raw/left.png @raw/right.png out --calib a.yml.gz").succeeded();
    alike(&folder.join("expected"), &folder.join("out"), "gzip");
    let mut bytes = fs::read(folder.join("a.yml.gz")).unwrap();
    bytes.truncate(100);
    fs::write(folder.join("cut.gz"), bytes).unwrap();
    run(&folder, "rectify @raw/left.png @raw/right.png bad --calib cut.gz")
        .failed(1, "cut.gz & is damaged gzip, or a part of it is missing; copy it again");
}

#[test]
fn faults_in_a_form_are_reported() {
    let folder = Folder::new();
    for (form, from, to, words) in WRONG {
        let (_, mut files) = radial().into_iter().find(|(name, _)| name == form).unwrap();
        // Change the last file that contains the text, once.
        let (_, text) = files.iter_mut().rev().find(|(_, text)| text.contains(from)).unwrap();
        *text = text.replacen(from, to, 1);
        rectified(&folder, &files, "out").failed(1, words);
    }
}

/// Settings of pairs that are already rectified.
#[test]
fn settings_of_rectified_pairs_give_depths() {
    let folder = Folder::new();
    let depths = |text: &str| {
        fs::write(folder.join("a-file"), text).unwrap();
        let line =
            "match @slanted/im0.png @slanted/im1.png d.pfm --max-disparity 31 --also depth-mm --calib a-file";
        run(&folder, line).succeeded();
        fs::read(folder.join("d.depth-mm.png")).unwrap()
    };
    let first = depths("cam0=[215.5 0 118.5; 0 215.5 89.5; 0 0 1]\ndoffs=0\nbaseline=160\n");
    let numbers =
        |name: &str| format!("{name}.fx: 215.5\n{name}.fy: 215.5\n{name}.cx: 118.5\n{name}.cy: 89.5\n");
    let size = "Camera.width: 240\nCamera.height: 180\n";
    let three =
        format!("%YAML:1.0\nCamera.type: \"Rectified\"\n{}{size}Stereo.b: 0.16\n", numbers("Camera1"));
    let two = format!("%YAML:1.0\n{}{size}Camera.bf: 34.48\n", numbers("Camera"));
    assert!(depths(&three) == first && depths(&two) == first);
    // Its viewer writes numbers as strings; 2 and 3 are sizes that the camera does not have.
    let realsense = r#"{"baseline": "-160", "intrinsic_left.x.x": "0.5", "rectified.0.width": "640", "rectified.0.height": "400",
        "rectified.0.fx": "430", "rectified.0.fy": "430", "rectified.0.ppx": "320", "rectified.0.ppy": "240",
        "rectified.1.width": 240, "rectified.1.height": 180, "rectified.1.fx": 215.5, "rectified.1.fy": 215.5,
        "rectified.1.ppx": 118.5, "rectified.1.ppy": 89.5, "rectified.2.width": 0,
        "rectified.2.fx": 9, "rectified.3.width": 240, "rectified.3.height": 180, "rectified.3.fx": 0}"#;
    assert!(depths(realsense) == first);
    for (from, to, words) in [
        ("180", "181", "is for images of 640 x 400, 240 x 181, but these are 240 x 180"),
        ("-160", "0", "baseline: expected a number of millimetres other than 0 & RealSense's"),
        ("\"rectified.1.fx\": 215.5", "\"rectified.1.fx\": -1", "rectified.1.fx: expected a number above 0"),
        ("rectified.1.ppy", "rectified.1.pp", "rectified.1.ppy is missing"),
    ] {
        fs::write(folder.join("a-file"), realsense.replacen(from, to, 1)).unwrap();
        run(&folder, "match @slanted/im0.png @slanted/im1.png bad.pfm --also depth-mm --calib a-file")
            .failed(1, &format!("a-file & {words}"));
    }
}
