//! The forms in which programs write calibrations: each one of the same cameras gives the same rectified pair.

#![allow(clippy::format_push_string, reason = "texts of many lines read best so")]

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use mrfgs::calibration::matrix::{Matrix, product, rotated, rotation, rotation_vector, transposed};

use super::calibrations::{alike, numbers, stored};
use super::*;

/// Name and text of each file.
type Files = Vec<(&'static str, String)>;

/// The cameras of `testdata/raw`, with lenses that a form can have.
struct Rig {
    /// fx, fy, cx, cy.
    k: [[f64; 4]; 2],
    d: [[f64; 4]; 2],
    r: Matrix,
    t: [f64; 3],
}

/// A turn and a place of the left camera in the frame of a body.
const TURN: [f64; 3] = [0.4, -1.1, 0.7];
const PLACE: [f64; 3] = [0.25, -0.5, 0.125];

impl Rig {
    fn new() -> Self {
        let of = |name: &str| numbers(name).iter().map(|v| v.parse().unwrap()).collect::<Vec<f64>>();
        let k = ["K1", "K2"].map(|name| [0, 4, 2, 5].map(|i| of(name)[i]));
        let d = ["D1", "D2"].map(|name| <[f64; 4]>::try_from(&of(name)[..4]).unwrap());
        let (r, t) = (of("R"), of("T"));
        let r = [0, 1, 2].map(|y| [0, 1, 2].map(|x| r[3 * y + x]));
        Self { k, d, r, t: [t[0], t[1], t[2]] }
    }

    fn fisheye() -> Self {
        Self { d: [[0.02, 0.004, -0.001, 0.0005], [-0.01, 0.003, 0.001, 0.0]], ..Self::new() }
    }

    /// For the unified model with an xi of 0.9, which makes images smaller by 1.9.
    fn unified() -> Self {
        let rig = Self::new();
        Self { k: rig.k.map(|[fx, fy, cx, cy]| [1.9 * fx, 1.9 * fy, cx, cy]), ..rig }
    }

    /// From each camera to the body, row by row.
    fn to_body(&self) -> [(Matrix, [f64; 3]); 2] {
        let left = (rotation(TURN), PLACE);
        // From the right camera to the left one, then on.
        let back = transposed(&self.r);
        let place = rotated(&left.0, rotated(&back, self.t).map(|v| -v));
        [left, (product(&left.0, &back), [0, 1, 2].map(|i| place[i] + PLACE[i]))]
    }

    fn opencv(&self, more: &str) -> String {
        let mut text = format!("%YAML:1.0\n---\nimageSize: [ 240, 180 ]\nunit: m\n{more}\n");
        for i in 0..2 {
            let [fx, fy, cx, cy] = self.k[i];
            text += &matrix(&format!("K{}", i + 1), 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
            text += &matrix(&format!("D{}", i + 1), 1, &self.d[i]);
        }
        text + &matrix("R", 3, self.r.as_flattened()) + &matrix("T", 3, &self.t)
    }

    fn kalibr(&self, model: &str, own: &str, distortion: &str) -> String {
        let camera = |i: usize| {
            let ([fx, fy, cx, cy], d) = (self.k[i], self.d[i]);
            let coefficients = if distortion == "none" { "[]".into() } else { format!("{d:?}") };
            format!(
                "cam{i}:\n  camera_model: {model}\n  intrinsics: [{own}{fx}, {fy}, {cx}, {cy}]\n  distortion_model: {distortion}\n  distortion_coeffs: {coefficients}\n  resolution: [240, 180]\n"
            )
        };
        let pose = rows(&(self.r, self.t)).map(|row| format!("  - {row:?}\n")).concat();
        camera(0) + &camera(1) + "  T_cn_cnm1:\n" + &pose
    }

    fn euroc(&self, distortion: &str) -> Files {
        let file = |i: usize| {
            format!(
                "# General sensor definitions.\nsensor_type: camera\ncomment: some\nT_BS:\n  cols: 4\n  rows: 4\n  data: {:?}\nrate_hz: 20\nresolution: [240, 180]\ncamera_model: pinhole\nintrinsics: {:?} #fu, fv, cu, cv\ndistortion_model: {distortion}\ndistortion_coefficients: {:?}\n",
                rows(&self.to_body()[i]).concat(),
                self.k[i],
                self.d[i]
            )
        };
        vec![("cam0.yaml", file(0)), ("cam1.yaml", file(1))]
    }

    fn orb_slam(&self, kind: &str, names: [&str; 4]) -> Files {
        let mut text = format!("%YAML:1.0\n\nFile.version: \"1.0\"\nCamera.type: \"{kind}\"\n");
        for i in 0..2 {
            let n = i + 1;
            for (name, v) in ["fx", "fy", "cx", "cy"].iter().zip(self.k[i]) {
                text += &format!("Camera{n}.{name}: {v}\n");
            }
            for (name, v) in names.iter().zip(self.d[i]) {
                text += &format!("Camera{n}.{name}: {v}\n");
            }
        }
        // From the right camera to the left one.
        let back = transposed(&self.r);
        let pose = rows(&(back, rotated(&back, self.t).map(|v| -v))).concat();
        text += "Camera.width: 240\nCamera.height: 180\nCamera.newWidth: 120\n";
        vec![("settings.yaml", text + &matrix("Stereo.T_c1_c2", 4, &pose).replace("dt: d", "dt: f"))]
    }

    fn vins(&self, model: &str, more: &str, names: [&str; 4], coefficients: [&str; 4]) -> Files {
        let mut rig = "%YAML:1.0\n\nnum_of_cam: 2\ncam0_calib: \"cam0.yaml\"\n".to_owned();
        for (i, pose) in self.to_body().iter().enumerate() {
            // There is no blank before the list.
            rig += &matrix(&format!("body_T_cam{i}"), 4, &rows(pose).concat()).replace("data: [", "data:[");
        }
        let camera = |i: usize| {
            let mut projection = "projection_parameters:\n".to_owned();
            for (name, v) in names.iter().zip(self.k[i]) {
                projection += &format!("   {name}: {v}\n");
            }
            let mut distortion = "distortion_parameters:\n".to_owned();
            if model == "KANNALA_BRANDT" {
                distortion.clear();
            }
            for (name, v) in coefficients.iter().zip(self.d[i]) {
                let line = format!("   {name}: {v}\n");
                if distortion.is_empty() { projection += &line } else { distortion += &line }
            }
            format!(
                "%YAML:1.0\n---\nmodel_type: {model}\ncamera_name: camera\nimage_width: 240\nimage_height: 180\n{more}{distortion}{projection}"
            )
        };
        vec![("vins.yaml", rig), ("cam0.yaml", camera(0)), ("cam1.yaml", camera(1))]
    }

    /// In millimetres: the unit is that of the board by which the cameras were calibrated.
    fn camodocal(&self) -> Files {
        let names = ["fx", "fy", "cx", "cy"];
        let mut files = self.vins("PINHOLE", "", names, ["k1", "k2", "p1", "p2"]);
        let ([w, x, y, z], [tx, ty, tz]) = (quaternion(&self.r), self.t.map(|v| 1000.0 * v));
        let transform = format!(
            "   q_x: {x}\n   q_y: {y}\n   q_z: {z}\n   q_w: {w}\n   t_x: {tx}\n   t_y: {ty}\n   t_z: {tz}\n"
        );
        files[0] = ("extrinsics.yaml", format!("%YAML:1.0\n---\ntransform:\n{transform}"));
        files
    }

    fn basalt(&self, model: &str, own: &[(&str, f64)], coefficients: &[&str]) -> Files {
        let poses = self.to_body().map(|(turn, [x, y, z])| {
            let [w, a, b, c] = quaternion(&turn);
            serde_json::json!({"px": x, "py": y, "pz": z, "qx": a, "qy": b, "qz": c, "qw": w})
        });
        let lenses = [0, 1].map(|i| {
            let mut numbers = serde_json::Map::new();
            let mut put = |name: &str, v: f64| numbers.insert(name.into(), v.into());
            for (name, v) in ["fx", "fy", "cx", "cy"].iter().zip(self.k[i]) {
                put(name, v);
            }
            for (name, v) in own {
                put(name, *v);
            }
            for (n, name) in coefficients.iter().enumerate() {
                put(name, self.d[i].get(n).copied().unwrap_or(0.0));
            }
            serde_json::json!({"camera_type": model, "intrinsics": numbers})
        });
        let text = serde_json::json!({"value0": {
            "T_imu_cam": poses, "intrinsics": lenses, "resolution": [[240, 180], [240, 180]], "calib_accel_bias": [0.0, 0.5]
        }});
        vec![("calibration.json", serde_json::to_string_pretty(&text).unwrap())]
    }

    fn zed(&self) -> Files {
        let lens = |side: &str, i: usize, size: &str| {
            let ([fx, fy, cx, cy], [k1, k2, p1, p2]) = (self.k[i], self.d[i]);
            format!(
                "[{side}_CAM_{size}]\nfx={fx}\nfy={fy}\ncx={cx}\ncy={cy}\nk1={k1}\nk2={k2}\np1={p1}\np2={p2}\nk3=0\n\n"
            )
        };
        let mut text = String::new();
        for size in ["HD", "VGA"] {
            text += &(lens("LEFT", 0, size) + &lens("RIGHT", 1, size));
        }
        let ([x, y, z], [tx, ty, tz]) = (rotation_vector(&self.r), self.t.map(|v| -1000.0 * v));
        text += &format!("[STEREO]\nBaseline={tx}\nTY={ty}\nTZ={tz}\n");
        for size in ["HD", "VGA"] {
            text += &format!("CV_{size}={y}\nRX_{size}={x}\nRZ_{size}={z}\n");
        }
        vec![("SN1234.conf", text)]
    }

    /// With the extrinsics in the left camera, or in the right one.
    fn depthai(&self, kind: u8, of_left: bool) -> Files {
        let back = transposed(&self.r);
        let there = (self.r, self.t.map(|v| 100.0 * v));
        let back = (back, rotated(&back, there.1).map(|v| -v));
        let nowhere = serde_json::json!({"rotationMatrix": [], "toCameraSocket": -1, "translation": {"x": 0, "y": 0, "z": 0}});
        let to = |socket: i8, (turn, [x, y, z]): (Matrix, [f64; 3])| serde_json::json!({"rotationMatrix": turn, "toCameraSocket": socket, "translation": {"x": x, "y": y, "z": z}});
        let camera = |socket: i8, extrinsics: Value| {
            let i = socket as usize - 1;
            let ([fx, fy, cx, cy], mut d) = (self.k[i], self.d[i].to_vec());
            d.resize(14, 0.0);
            serde_json::json!([socket, {
                "cameraType": kind, "distortionCoeff": d, "extrinsics": extrinsics, "height": 180, "width": 240,
                "intrinsicMatrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], "lensPosition": 0
            }])
        };
        let cameras = if of_left {
            [camera(1, to(2, there)), camera(2, nowhere)]
        } else {
            [camera(1, nowhere), camera(2, to(1, back))]
        };
        let text = serde_json::json!({
            "boardName": "some", "cameraData": cameras,
            "stereoRectificationData": {"leftCameraSocket": 1, "rightCameraSocket": 2}, "version": 6
        });
        vec![("oak.json", text.to_string())]
    }

    /// In millimetres.
    fn colmap(&self, model: &str) -> Files {
        let mut cameras = "# Camera list with one line of data per camera:\n".to_owned();
        let mut images = "# Image list with two lines of data per image:\n# Number of images: 2\n".to_owned();
        for (i, (turn, place)) in self.to_body().into_iter().enumerate() {
            let ([fx, fy, cx, cy], [a, b, c, d]) = (self.k[i], self.d[i]);
            let (cx, cy, id) = (cx + 0.5, cy + 0.5, i + 3);
            let coefficients = match model {
                "THIN_PRISM_FISHEYE" => format!("{a} {b} 0 0 {c} {d} 0 0"),
                _ => format!("{a} {b} {c} {d}"),
            };
            cameras += &format!("{id} {model} 240 180 {fx} {fy} {cx} {cy} {coefficients}\n");
            // From the world to the camera.
            let turn = transposed(&turn);
            let [x, y, z] = rotated(&turn, place).map(|v| -1000.0 * v);
            let [qw, qx, qy, qz] = quaternion(&turn);
            let points = if i == 0 { "1.5 2.5 -1 7.0 8.0 3" } else { "" };
            images += &format!("{} {qw} {qx} {qy} {qz} {x} {y} {z} {id} im{i}.png\n{points}\n", i + 1);
        }
        vec![("cameras.txt", cameras), ("images.txt", images)]
    }
}

/// w, x, y and z of a rotation.
fn quaternion(turn: &Matrix) -> [f64; 4] {
    let vector = rotation_vector(turn);
    let angle = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z] = vector.map(|v| v / angle * (angle / 2.0).sin());
    [(angle / 2.0).cos(), x, y, z]
}

/// A matrix of 4 x 4.
fn rows((turn, place): &(Matrix, [f64; 3])) -> [[f64; 4]; 4] {
    let row = |y: usize| [turn[y][0], turn[y][1], turn[y][2], place[y]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let columns = numbers.len() / rows;
    format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {numbers:?}\n")
}

/// `text` with its matrices in base64, as OpenCV has them.
fn packed(text: &str) -> String {
    let mut parts = text.split("data: [");
    let mut out = parts.next().unwrap().to_owned();
    for part in parts {
        let (numbers, rest) = part.split_once(']').unwrap();
        let mut bytes = format!("{:24}", "1d").into_bytes();
        for number in numbers.split(',') {
            bytes.extend(number.trim().parse::<f64>().unwrap().to_le_bytes());
        }
        let text = BASE64_STANDARD.encode(bytes);
        let (a, b) = text.split_at(60);
        out += &format!("data: !!binary |\n      {a}\n      {b}{rest}");
    }
    out
}

/// The same in JSON.
fn as_json(text: &str) -> String {
    let mut out = serde_json::Map::new();
    for name in ["K1", "D1", "K2", "D2", "R", "T"] {
        let entry = text.split(&format!("\n{name}: ")).nth(1).unwrap();
        let data = entry.split("data: [").nth(1).unwrap().split(']').next().unwrap();
        let data: Vec<f64> = data.split(',').map(|v| v.trim().parse().unwrap()).collect();
        let of = |name: &str| -> usize {
            entry.split(&format!("{name}: ")).nth(1).unwrap().lines().next().unwrap().parse().unwrap()
        };
        let matrix = serde_json::json!({
            "type_id": "opencv-matrix", "rows": of("rows"), "cols": of("cols"), "dt": "d", "data": data
        });
        out.insert(name.into(), matrix);
    }
    out.insert("unit".into(), "m".into());
    out.insert("imageSize".into(), serde_json::json!([240, 180]));
    serde_json::to_string_pretty(&out).unwrap()
}

/// One of ROS's files of a driver that gives every second pixel of a region, of the rectification in `stored`.
fn binned(view: usize) -> String {
    let text = stored();
    let of = |name: &str| -> Vec<f64> {
        let entry = text.split(&format!("\n{name}{}: ", view + 1)).nth(1).unwrap();
        let data = entry.split("data: [").nth(1).unwrap().split(']').next().unwrap();
        data.split(',').map(|v| v.trim().parse().unwrap()).collect()
    };
    let (mut k, mut p) = (of("K"), of("P"));
    for (m, width) in [(&mut k, 3), (&mut p, 4)] {
        m.iter_mut().take(2 * width).for_each(|v| *v *= 2.0);
        m[2] += 20.0;
        m[width + 2] += 10.0;
    }
    format!(
        "header:\n  seq: 1\nheight: 400\nwidth: 600\ndistortion_model: \"plumb_bob\"\nD: {:?}\nK: {k:?}\nR: {:?}\nP: {p:?}\nbinning_x: 2\nbinning_y: 2\nroi:\n  x_offset: 20\n  y_offset: 10\n  height: 360\n  width: 480\n  do_rectify: False\n",
        of("D"),
        of("R")
    )
}

/// The forms in which lenses have radial and tangential distortion.
fn radial() -> Vec<(&'static str, Files)> {
    let rig = Rig::new();
    let renamed = ["K1", "K2", "D1", "D2"].into_iter().zip([
        "cameraMatrixL",
        "cameraMatrixR",
        "distCoeffsL",
        "distCoeffsR",
    ]);
    let renamed =
        renamed.fold(rig.opencv(""), |text, (from, to)| text.replace(&format!("{from}:"), &format!("{to}:")));
    let old = renamed.replace("cameraMatrix", "M").replace("ML:", "M1:").replace("MR:", "M2:");
    vec![
        ("OpenCV in base64", vec![("a.yml", packed(&rig.opencv("")))]),
        ("OpenCV in JSON", vec![("a.json", as_json(&rig.opencv("")))]),
        ("OpenCV with L and R", vec![("a.yml", renamed)]),
        ("OpenCV with M1 and M2", vec![("a.yml", old)]),
        ("ROS with binning", vec![("right.yaml", binned(1)), ("left.yaml", binned(0))]),
        ("Kalibr", vec![("chain.yaml", rig.kalibr("pinhole", "", "radtan"))]),
        ("EuRoC", rig.euroc("radial-tangential")),
        ("ORB-SLAM3", rig.orb_slam("PinHole", ["k1", "k2", "p1", "p2"])),
        ("VINS-Fusion", rig.vins("PINHOLE", "", ["fx", "fy", "cx", "cy"], ["k1", "k2", "p1", "p2"])),
        ("camodocal", rig.camodocal()),
        ("Basalt", rig.basalt("pinhole-radtan8", &[], &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"])),
        ("DepthAI", rig.depthai(0, true)),
        ("DepthAI from the right", rig.depthai(0, false)),
        ("COLMAP", rig.colmap("OPENCV")),
    ]
}

/// Those of the model of Kannala and Brandt.
fn fisheyes() -> Vec<(&'static str, Files)> {
    let rig = Rig::fisheye();
    vec![
        ("OpenCV by name", vec![("a.yml", rig.opencv("distortion_model: KANNALA_BRANDT"))]),
        ("Kalibr", vec![("chain.yaml", rig.kalibr("pinhole", "", "equidistant"))]),
        ("EuRoC", rig.euroc("equidistant")),
        ("ORB-SLAM3", rig.orb_slam("KannalaBrandt8", ["k1", "k2", "k3", "k4"])),
        ("VINS-Fusion", rig.vins("KANNALA_BRANDT", "", ["mu", "mv", "u0", "v0"], ["k2", "k3", "k4", "k5"])),
        ("Basalt", rig.basalt("kb4", &[], &["k1", "k2", "k3", "k4"])),
        ("DepthAI", rig.depthai(1, true)),
        ("COLMAP", rig.colmap("OPENCV_FISHEYE")),
        ("COLMAP with a thin prism", rig.colmap("THIN_PRISM_FISHEYE")),
    ]
}

/// Those of the unified model.
fn unified() -> Vec<(&'static str, Files)> {
    let rig = Rig::unified();
    let mirror = "mirror_parameters:\n   xi: 0.9\n";
    vec![
        ("Kalibr", vec![("chain.yaml", rig.kalibr("omni", "0.9, ", "radtan"))]),
        ("VINS-Fusion", rig.vins("MEI", mirror, ["gamma1", "gamma2", "u0", "v0"], ["k1", "k2", "p1", "p2"])),
    ]
}

/// What a form of `text` changes, and what the refusal must say.
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
        "T_BS: is of a camera with images of 240 x 181 & 240 x 180 & EuRoC's",
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
    ("COLMAP", "3 OPENCV", "9 OPENCV", "is of camera 3, which cameras.txt has not"),
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

/// Models that OpenCV has not, as Kalibr and Basalt write them.
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

/// ZED's file has a lens for each size of images; those of the test have another size.
#[test]
fn the_size_of_the_images_chooses_the_lens() {
    let folder = Folder::new();
    let files = Rig::new().zed();
    rectified(&folder, &files, "out").failed(1, "SN1234.conf & is for images of 1280 x 720 & 240 x 180");
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
fn what_is_packed_by_gzip_is_read() {
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
        .failed(1, "cut.gz & is damaged gzip");
}

#[test]
fn what_is_wrong_in_a_form_is_told() {
    let folder = Folder::new();
    for (form, from, to, words) in WRONG {
        let (_, mut files) = radial().into_iter().find(|(name, _)| name == form).unwrap();
        // The last file that has it, once.
        let (_, text) = files.iter_mut().rev().find(|(_, text)| text.contains(from)).unwrap();
        *text = text.replacen(from, to, 1);
        rectified(&folder, &files, "out").failed(1, words);
    }
}

/// Settings of pairs that are rectified already.
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
    // Its viewer writes numbers as words; 2 and 3 are sizes that the camera has not.
    let realsense = r#"{"baseline": "-160", "intrinsic_left.x.x": "0.5", "rectified.0.width": "640", "rectified.0.height": "480",
        "rectified.0.fx": "430", "rectified.0.fy": "430", "rectified.0.ppx": "320", "rectified.0.ppy": "240",
        "rectified.1.width": 240, "rectified.1.height": 180, "rectified.1.fx": 215.5, "rectified.1.fy": 215.5,
        "rectified.1.ppx": 118.5, "rectified.1.ppy": 89.5, "rectified.2.width": 0,
        "rectified.2.fx": 9, "rectified.3.width": 240, "rectified.3.height": 180, "rectified.3.fx": 0}"#;
    assert!(depths(realsense) == first);
    for (from, to, words) in [
        ("180", "181", "is for images of 640 x 480, 240 x 181, and these are 240 x 180"),
        ("-160", "0", "baseline: expected a number of millimetres other than 0 & RealSense's"),
        ("\"rectified.1.fx\": 215.5", "\"rectified.1.fx\": -1", "rectified.1.fx: expected a number above 0"),
        ("rectified.1.ppy", "rectified.1.pp", "rectified.1.ppy is missing"),
    ] {
        fs::write(folder.join("a-file"), realsense.replacen(from, to, 1)).unwrap();
        run(&folder, "match @slanted/im0.png @slanted/im1.png bad.pfm --also depth-mm --calib a-file")
            .failed(1, &format!("a-file & {words}"));
    }
}

/// A focal length and a baseline are a calibration.
#[test]
fn numbers_take_the_place_of_a_calibration() {
    let folder = Folder::new();
    let text = "cam0=[215.5 0 119.5; 0 215.5 89.5; 0 0 1]\ndoffs=0\nbaseline=160\n";
    fs::write(folder.join("a.txt"), text).unwrap();
    let written = |name: &str, cameras: &str| {
        let line = format!(
            "match @slanted/im0.png @slanted/im1.png {name}.pfm --max-disparity 31 --also depth,depth-mm,points {cameras}"
        );
        run(&folder, &line).succeeded();
        ["depth.pfm", "depth-mm.png", "points.ply"]
            .map(|end| fs::read(folder.join(format!("{name}.{end}"))).unwrap())
    };
    let expected = written("file", "--calib a.txt");
    assert!(written("mm", "--focal 215.5 --baseline 160mm") == expected);
    let metres = written("m", "--focal 215.5 --baseline 0.16m");
    assert!(metres[1] == expected[1] && metres[0] != expected[0]);
    // Control.
    assert!(written("other", "--focal 216 --baseline 160mm")[1] != expected[1]);

    for (view, from) in [("left", "im0"), ("right", "im1")] {
        fs::create_dir(folder.join(view)).unwrap();
        fs::copy(scene("slanted").join(format!("{from}.png")), folder.join(view).join("0.png")).unwrap();
    }
    let line = "sequence left right maps --max-disparity 31 --focal 215.5 --baseline 16cm --also depth-mm";
    run(&folder, line).succeeded();
    assert!(fs::read(folder.join("maps/0.depth-mm.png")).unwrap() == expected[1]);

    let line = "match left/0.png right/0.png d.pfm --max-disparity 31 --focal 215.5 --baseline 160 --also depth --json -";
    let run = run(&folder, line).succeeded();
    run.says("unit: that of --baseline");
    assert!(run.json()["files"]["calibration"].is_null());
}
