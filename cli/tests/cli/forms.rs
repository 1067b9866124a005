//! The cameras of `testdata/raw` in the formats of many programs: the files of each form.

#![allow(clippy::format_push_string, reason = "texts of many lines read best so")]

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use mrfgs::calibration::matrix::{Matrix, product, rotated, rotation, rotation_vector, transposed};

use super::calibrations::{numbers, stored};
use super::*;

/// Name and text of each file.
pub(super) type Files = Vec<(&'static str, String)>;

/// The cameras of `testdata/raw`, with lenses that a format can express.
pub(super) struct Rig {
    /// fx, fy, cx, cy.
    pub(super) k: [[f64; 4]; 2],
    pub(super) d: [[f64; 4]; 2],
    pub(super) r: Matrix,
    pub(super) t: [f64; 3],
}

/// Pose of the left camera in the frame of a body.
const TURN: [f64; 3] = [0.4, -1.1, 0.7];
const PLACE: [f64; 3] = [0.25, -0.5, 0.125];

impl Rig {
    pub(super) fn new() -> Self {
        let of = |name: &str| numbers(name).iter().map(|v| v.parse().unwrap()).collect::<Vec<f64>>();
        let k = ["K1", "K2"].map(|name| [0, 4, 2, 5].map(|i| of(name)[i]));
        let d = ["D1", "D2"].map(|name| <[f64; 4]>::try_from(&of(name)[..4]).unwrap());
        let (r, t) = (of("R"), of("T"));
        let r = [0, 1, 2].map(|y| [0, 1, 2].map(|x| r[3 * y + x]));
        Self { k, d, r, t: [t[0], t[1], t[2]] }
    }

    pub(super) fn fisheye() -> Self {
        Self { d: [[0.02, 0.004, -0.001, 0.0005], [-0.01, 0.003, 0.001, 0.0]], ..Self::new() }
    }

    /// For the unified model with xi = 0.9, which makes images smaller by a factor of 1.9.
    pub(super) fn unified() -> Self {
        let rig = Self::new();
        Self { k: rig.k.map(|[fx, fy, cx, cy]| [1.9 * fx, 1.9 * fy, cx, cy]), ..rig }
    }

    /// Pose of each camera in the body's frame, as rows.
    fn to_body(&self) -> [(Matrix, [f64; 3]); 2] {
        let left = (rotation(TURN), PLACE);
        // From the right camera to the left one, then to the body.
        let back = transposed(&self.r);
        let place = rotated(&left.0, rotated(&back, self.t).map(|v| -v));
        [left, (product(&left.0, &back), [0, 1, 2].map(|i| place[i] + PLACE[i]))]
    }

    pub(super) fn opencv(&self, more: &str) -> String {
        let mut text = format!("%YAML:1.0\n---\nimageSize: [ 240, 180 ]\nunit: m\n{more}\n");
        for i in 0..2 {
            let [fx, fy, cx, cy] = self.k[i];
            text += &matrix(&format!("K{}", i + 1), 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
            text += &matrix(&format!("D{}", i + 1), 1, &self.d[i]);
        }
        text + &matrix("R", 3, self.r.as_flattened()) + &matrix("T", 3, &self.t)
    }

    pub(super) fn kalibr(&self, model: &str, own: &str, distortion: &str) -> String {
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
            // No space before the list.
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

    /// In millimetres, the unit of the calibration board.
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

    pub(super) fn basalt(&self, model: &str, own: &[(&str, f64)], coefficients: &[&str]) -> Files {
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

    pub(super) fn zed(&self) -> Files {
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
        let ([x, y, z], [tx, ty, tz]) = (rotation_vector(&self.r), self.t.map(|v| 1000.0 * v));
        text += &format!("[STEREO]\nBaseline={}\nTY={ty}\nTZ={tz}\n", -tx);
        for size in ["HD", "VGA"] {
            text += &format!("CV_{size}={y}\nRX_{size}={x}\nRZ_{size}={z}\n");
        }
        vec![("SN1234.conf", text)]
    }

    /// With the extrinsics in the left or in the right camera.
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
    pub(super) fn colmap(&self, model: &str) -> Files {
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

/// A 4 x 4 matrix.
fn rows((turn, place): &(Matrix, [f64; 3])) -> [[f64; 4]; 4] {
    let row = |y: usize| [turn[y][0], turn[y][1], turn[y][2], place[y]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let columns = numbers.len() / rows;
    format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {numbers:?}\n")
}

/// `text` with its matrices in base64, as OpenCV writes them.
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

/// `text` as JSON.
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

/// A ROS file of a driver that bins by two within a region, for the rectification in `stored`.
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

/// The forms with radial and tangential distortion.
pub(super) fn radial() -> Vec<(&'static str, Files)> {
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

/// The forms with the model of Kannala and Brandt.
pub(super) fn fisheyes() -> Vec<(&'static str, Files)> {
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

/// The forms with the unified model.
pub(super) fn unified() -> Vec<(&'static str, Files)> {
    let rig = Rig::unified();
    let mirror = "mirror_parameters:\n   xi: 0.9\n";
    vec![
        ("Kalibr", vec![("chain.yaml", rig.kalibr("omni", "0.9, ", "radtan"))]),
        ("VINS-Fusion", rig.vins("MEI", mirror, ["gamma1", "gamma2", "u0", "v0"], ["k1", "k2", "p1", "p2"])),
    ]
}
