//! The forms of public programs and data sets, with our own numbers: a focal length of 500 and a baseline of 0.12 m.

use super::*;

/// The expected outcome of a form.
enum Fate {
    /// It is read, with this baseline in its unit.
    Read(f64),
    /// It is refused with an error that has these words.
    Told(&'static str),
}

use Fate::{Read, Told};

const K: &str = "500, 0, 320, 0, 500, 240, 0, 0, 1";
const P1: &str = "500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0";
const P2: &str = "500, 0, 320, -60, 0, 500, 240, 0, 0, 0, 1, 0";
const I: &str = "1, 0, 0, 0, 1, 0, 0, 0, 1";
const RIGHT: &str =
    "[1.0, 0.0, 0.0, -0.12], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]";
const PLACE: &str = "[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]";

fn flat(text: &str) -> String {
    text.replace(['[', ']'], "")
}

/// A matrix of OpenCV in YAML.
pub(super) fn matrix(name: &str, rows: usize, data: &str) -> String {
    let columns = data.split(',').count() / rows;
    format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
}

/// A calibration in YAML, with these names of K and D of each camera, R and T.
pub(super) fn opencv(names: [&str; 6]) -> String {
    let [k1, d1, k2, d2, r, t] = names;
    [
        "%YAML:1.0\n---\nimageSize: [ 640, 480 ]\n".to_owned(),
        matrix(k1, 3, K),
        matrix(d1, 1, "-0.1, 0.01, 0, 0, 0"),
        matrix(k2, 3, K),
        matrix(d2, 1, "0, 0, 0, 0, 0"),
        matrix(r, 3, I),
        matrix(t, 3, "-0.12, 0, 0"),
    ]
    .concat()
}

pub(super) const NAMES: [&str; 6] = ["K1", "D1", "K2", "D2", "R", "T"];

fn xml(names: [&str; 6]) -> String {
    let element = |name: &str, rows: usize, data: &str| {
        let columns = data.split(',').count() / rows;
        format!(
            "<{name} type_id=\"opencv-matrix\"><rows>{rows}</rows><cols>{columns}</cols><dt>d</dt><data>{}</data></{name}>\n",
            data.replace(',', " ")
        )
    };
    let [k1, d1, k2, d2, r, t] = names;
    let all = [
        element(k1, 3, K),
        element(d1, 1, "0, 0, 0, 0, 0"),
        element(k2, 3, K),
        element(d2, 1, "0, 0, 0, 0, 0"),
        element(r, 3, I),
        element(t, 3, "-0.12, 0, 0"),
    ];
    format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{}</opencv_storage>\n", all.concat())
}

fn json(names: [&str; 6]) -> String {
    let [k1, d1, k2, d2, r, t] = names;
    format!(
        "{{\"{k1}\": [{K}], \"{d1}\": [[0, 0, 0, 0, 0]], \"{k2}\": [{K}], \"{d2}\": [[0, 0, 0, 0, 0]], \"{r}\": [{I}], \"{t}\": [[-0.12], [0], [0]]}}"
    )
}

pub(super) fn lens(name: &str) -> String {
    let of_ros = if name == "camera_info" { "camera_name: some\ndistortion_model: plumb_bob\n" } else { "" };
    format!(
        "image_width: 640\nimage_height: 480\n{of_ros}camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{K}]\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
    )
}

pub(super) fn ros(p: &str) -> String {
    lens("camera_info")
        + &format!(
            "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [{I}]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [{p}]\n"
        )
}

fn echoed(p: &str) -> String {
    format!(
        "header: \n  seq: 7\n  stamp: \n    secs: 1\n  frame_id: \"left\"\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: [0.0, 0.0, 0.0, 0.0, 0.0]\nK: [{K}]\nR: [{I}]\nP: [{p}]\nbinning_x: 0\nbinning_y: 0\nroi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: False\n---\n"
    )
}

pub(super) fn ost(side: &str, tx: &str) -> String {
    format!(
        "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo{side}]\n\ncamera matrix\n500.0 0.0 320.0\n0.0 500.0 240.0\n0.0 0.0 1.0\n\ndistortion\n0.0 0.0 0.0 0.0 0.0\n\nrectification\n1.0 0.0 0.0\n0.0 1.0 0.0\n0.0 0.0 1.0\n\nprojection\n500.0 0.0 320.0 {tx}\n0.0 500.0 240.0 0.0\n0.0 0.0 1.0 0.0\n\n"
    )
}

/// A chain of cameras, with the given pose entries.
pub(super) fn kalibr(model: &str, poses: [&str; 2]) -> String {
    let camera = |i: usize| {
        format!(
            "cam{i}:\n  cam_overlaps: [{}]\n  camera_model: pinhole\n  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]\n  distortion_model: {model}\n  intrinsics: [500.0, 500.0, 320.0, 240.0]\n  resolution: [640, 480]\n  rostopic: /cam{i}/image_raw\n{}",
            1 - i,
            poses[i]
        )
    };
    camera(0) + &camera(1)
}

pub(super) fn entry(name: &str, rows: &str) -> String {
    let rows = rows.split("], ").map(|row| format!("  - {}]\n", row.trim_end_matches(']')));
    format!("  {name}:\n{}", rows.collect::<Vec<_>>().concat())
}

fn euroc(rows: &str, kind: &str) -> String {
    format!(
        "sensor_type: camera\ncomment: cam\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\nrate_hz: 20\nresolution: [640, 480]\ncamera_model: pinhole\nintrinsics: [500, 500, 320, 240]\ndistortion_model: {kind}\ndistortion_coefficients: [0.01, 0, 0, 0]\n",
        flat(rows)
    )
}

/// The inverse pose, from the right camera to the body.
fn back() -> String {
    RIGHT.replace("-0.12", "0.12")
}

fn kitti(names: [&str; 2], second: &str) -> String {
    let row = |name: &str, p: &str| format!("{name}: {}\n", p.replace(',', ""));
    row(names[0], P1) + &row(names[1], second)
}

pub(super) fn driving_stereo() -> String {
    let camera = |n: usize, t: &str, tx: &str| {
        format!(
            "S_{n}: 640 480\nK_{n}: {}\nD_{n}: 0 0 0 0 0\nR_{n}: {}\nT_{n}: {t}\nS_rect_{n}: 640 480\nR_rect_{n}: {}\nP_rect_{n}: 500 0 320 {tx} 0 500 240 0 0 0 1 0\n",
            K.replace(',', ""),
            I.replace(',', ""),
            I.replace(',', "")
        )
    };
    // The offset is that of images of twice the size.
    format!("calib_time: 09-Jan-2018\n{}{}", camera(101, "0 0 0", "0"), camera(103, "-0.12 0 0", "-120"))
}

pub(super) const MIDDLEBURY: &str = "cam0=[500 0 320; 0 500 240; 0 0 1]\ncam1=[500 0 330; 0 500 240; 0 0 1]\ndoffs=10\nbaseline=120\nwidth=640\nheight=480\nndisp=64\n";

fn basalt() -> String {
    let lens = "{\"camera_type\": \"ds\", \"intrinsics\": {\"fx\": 500, \"fy\": 500, \"cx\": 320, \"cy\": 240, \"xi\": 0.1, \"alpha\": 0.5}}";
    let pose =
        |x: f64| format!("{{\"px\": {x}, \"py\": 0, \"pz\": 0, \"qx\": 0, \"qy\": 0, \"qz\": 0, \"qw\": 1}}");
    format!(
        "{{\"value0\": {{\"T_imu_cam\": [{}, {}], \"intrinsics\": [{lens}, {lens}], \"resolution\": [[640, 480], [640, 480]]}}}}",
        pose(0.0),
        pose(0.12)
    )
}

fn orb_slam(kind: &str, more: &str) -> String {
    let camera = |n: usize| {
        format!(
            "Camera{n}.fx: 500.0\nCamera{n}.fy: 500.0\nCamera{n}.cx: 320.0\nCamera{n}.cy: 240.0\nCamera{n}.k1: 0.01\nCamera{n}.k2: 0.0\nCamera{n}.k3: 0.0\nCamera{n}.k4: 0.0\n"
        )
    };
    format!(
        "%YAML:1.0\n\nFile.version: \"1.0\"\nCamera.type: \"{kind}\"\n{}{}Camera.width: 640\nCamera.height: 480\n{more}",
        camera(1),
        camera(2)
    )
}

fn vins() -> Vec<(&'static str, String)> {
    let camera = || {
        "%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: camera\nimage_width: 640\nimage_height: 480\ndistortion_parameters:\n   k1: 0.0\n   k2: 0.0\n   p1: 0.0\n   p2: 0.0\nprojection_parameters:\n   fx: 500.0\n   fy: 500.0\n   cx: 320.0\n   cy: 240.0\n".to_owned()
    };
    let rig = "%YAML:1.0\n\nnum_of_cam: 2\n".to_owned()
        + &matrix("body_T_cam0", 4, &flat(PLACE))
        + &matrix("body_T_cam1", 4, &flat(&back()));
    vec![("vins.yaml", rig), ("cam0.yaml", camera()), ("cam1.yaml", camera())]
}

fn depthai() -> String {
    let camera = |socket: i8, to: i8, x: f64| {
        format!(
            "[{socket}, {{\"cameraType\": 0, \"distortionCoeff\": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], \"extrinsics\": {{\"rotationMatrix\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"toCameraSocket\": {to}, \"translation\": {{\"x\": {x}, \"y\": 0, \"z\": 0}}}}, \"height\": 480, \"width\": 640, \"intrinsicMatrix\": [[500, 0, 320], [0, 500, 240], [0, 0, 1]]}}]"
        )
    };
    format!(
        "{{\"boardName\": \"some\", \"cameraData\": [{}, {}], \"stereoRectificationData\": {{\"leftCameraSocket\": 1, \"rightCameraSocket\": 2}}}}",
        camera(1, 2, -12.0),
        camera(2, -1, 0.0)
    )
}

/// Sections of the lenses for one size, followed by `more`.
pub(super) fn zed(size: &str, coefficients: &str, more: &str) -> String {
    let lens =
        |side: &str| format!("[{side}_CAM_{size}]\nfx = 500\nfy = 500\ncx = 320\ncy = 240\n{coefficients}\n");
    format!(
        "{}{}{more}[STEREO]\nBaseline = 120\nTY = 0\nTZ = 0\nCV_{size} = 0\nRX_{size} = 0\nRZ_{size} = 0\n",
        lens("LEFT"),
        lens("RIGHT")
    )
}

fn disto(coefficients: &str) -> String {
    format!("[LEFT_DISTO]\n{coefficients}[RIGHT_DISTO]\n{coefficients}\n")
}

fn colmap(model: &str) -> Vec<(&'static str, String)> {
    vec![
        ("cameras.txt", format!("# Camera list with one line of data per camera:\n1 {model}\n")),
        (
            "images.txt",
            "# Image list\n1 1 0 0 0 0 0 0 1 left.png\n\n2 1 0 0 0 -0.12 0 0 1 right.png\n\n".to_owned(),
        ),
    ]
}

pub(super) fn mrcal(model: &str, coefficients: &str, x: f64) -> String {
    format!(
        "# generated with mrcal\n{{\n    'lensmodel':  '{model}',\n\n    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n    'intrinsics': [ 500., 500., 320., 240., {coefficients}],\n\n    # extrinsics are rt_fromref\n    'extrinsics': [ 0., 0, 0, {x}, 0, 0., ],\n\n    'imagersize': [ 640, 480,],\n    'optimization_inputs': b'KLUv/{{#}}:',\n}}\n"
    )
}

fn okvis(kind: &str, coefficients: &str) -> String {
    let camera = |rows: &str| {
        format!(
            "     - {{T_SC:\n        [{}],\n        image_dimension: [640, 480],\n        distortion_coefficients: [{coefficients}],\n        distortion_type: {kind},\n        focal_length: [500.0, 500.0],\n        principal_point: [320.0, 240.0]}}\n",
            flat(rows)
        )
    };
    format!("%YAML:1.0\ncameras:\n{}{}camera_params:\n    camera_rate: 20\n", camera(PLACE), camera(&back()))
}

fn maplab(pose: &str, rows: &str) -> String {
    let camera = |rows: &str| {
        format!(
            "- camera:\n    distortion:\n      parameters:\n        cols: 1\n        rows: 4\n        data: [0.01, 0, 0, 0]\n      type: equidistant\n    image_height: 480\n    image_width: 640\n    intrinsics:\n      cols: 1\n      rows: 4\n      data: [500, 500, 320, 240]\n    label: cam\n    line-delay-nanoseconds: 0\n    type: pinhole\n  {pose}:\n    cols: 4\n    rows: 4\n    data: [{}]\n",
            flat(rows)
        )
    };
    format!("cameras:\n{}{}label: rig\n", camera(PLACE), camera(rows))
}

/// An archive of NumPy: arrays with their names and shapes, uncompressed.
pub(super) fn npz(arrays: &[(&str, &str, Vec<f64>)]) -> Vec<u8> {
    let (mut bytes, mut table) = (Vec::new(), Vec::new());
    for (name, shape, numbers) in arrays {
        let header =
            format!("{:117}\n", format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"));
        let data: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        let data = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data]
            .concat();
        let name = format!("{name}.npy");
        let (size, length) = ((data.len() as u32).to_le_bytes(), (name.len() as u16).to_le_bytes());
        // Version, flags, method, time, date, checksum, both sizes, lengths of the name and the extra field.
        let common = [&[20, 0, 0, 0, 0, 0, 0, 0, 33, 0, 0, 0, 0, 0][..], &size, &size, &length].concat();
        let at = (bytes.len() as u32).to_le_bytes();
        bytes.extend([b"PK\x03\x04", &common[..], &[4, 0], name.as_bytes(), &[0; 4], &data].concat());
        table.extend([b"PK\x01\x02\x14\x00", &common[..], &[0; 12], &at, name.as_bytes()].concat());
    }
    let (count, at) = ((arrays.len() as u16).to_le_bytes(), (bytes.len() as u32).to_le_bytes());
    let size = (table.len() as u32).to_le_bytes();
    [&bytes[..], &table, b"PK\x05\x06\0\0\0\0", &count, &count, &size, &at, &[0; 2]].concat()
}

fn arrays(names: [&'static str; 6]) -> Vec<(&'static str, &'static str, Vec<f64>)> {
    let numbers = |text: &str| text.split(", ").map(|v| v.parse().unwrap()).collect::<Vec<f64>>();
    let [k1, d1, k2, d2, r, t] = names;
    vec![
        (k1, "(3, 3)", numbers(K)),
        (d1, "(1, 5)", vec![0.0; 5]),
        (k2, "(3, 3)", numbers(K)),
        (d2, "(1, 5)", vec![0.0; 5]),
        (r, "(3, 3)", numbers(I)),
        (t, "(3, 1)", vec![-0.12, 0.0, 0.0]),
        ("map1x", "(30, 40)", vec![0.5; 1200]),
        ("ret", "()", vec![0.25]),
    ]
}

pub(super) const METASHAPE: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<calibration>\n  <projection>frame</projection>\n  <width>640</width>\n  <height>480</height>\n  <f>500</f>\n  <cx>1.5</cx>\n  <cy>-2.5</cy>\n  <k1>-0.1</k1>\n</calibration>\n";

fn text(name: &'static str, text: impl Into<String>) -> Vec<(&'static str, Vec<u8>)> {
    vec![(name, text.into().into_bytes())]
}

fn texts(files: Vec<(&'static str, String)>) -> Vec<(&'static str, Vec<u8>)> {
    files.into_iter().map(|(name, text)| (name, text.into_bytes())).collect()
}

/// A form, its files, and the expected outcome.
type Row = (&'static str, Vec<(&'static str, Vec<u8>)>, Fate);

/// OpenCV's forms, and others with its names.
fn of_opencv() -> Vec<Row> {
    let intrinsics = || opencv(["M1", "D1", "M2", "D2", "R", "T"]).split("R: ").next().unwrap().to_owned();
    let extrinsics = || {
        "%YAML:1.0\n---\n".to_owned()
            + &matrix("R", 3, I)
            + &matrix("T", 3, "-0.12, 0, 0")
            + &matrix("R1", 3, I)
            + &matrix("R2", 3, I)
            + &matrix("P1", 3, P1)
            + &matrix("P2", 3, P2)
    };
    let pose = || "%YAML:1.0\n---\n".to_owned() + &matrix("R", 3, I) + &matrix("T", 3, "-0.12, 0, 0");
    vec![
        ("OpenCV's YAML", text("a.yml", opencv(NAMES)), Read(0.12)),
        ("OpenCV's XML", text("a.xml", xml(NAMES)), Read(0.12)),
        ("OpenCV's JSON", text("a.json", json(NAMES)), Read(0.12)),
        (
            "stereo_calib in two files",
            texts(vec![("intrinsics.yml", intrinsics()), ("extrinsics.yml", extrinsics())]),
            Read(0.12),
        ),
        (
            "stereo_calib without extrinsics.yml",
            texts(vec![("intrinsics.yml", intrinsics())]),
            Told("R is missing & rotation from the left camera"),
        ),
        ("stereo_calib without intrinsics.yml", texts(vec![("extrinsics.yml", extrinsics())]), Read(0.12)),
        (
            "cameraMatrix1",
            text("a.yml", opencv(["cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"])),
            Read(0.12),
        ),
        (
            "camera_matrix_left",
            text(
                "a.json",
                json([
                    "camera_matrix_left",
                    "dist_coeffs_left",
                    "camera_matrix_right",
                    "dist_coeffs_right",
                    "R",
                    "T",
                ]),
            ),
            Read(0.12),
        ),
        ("Booster's mtxL", text("calib.xml", xml(["mtxL", "distL", "mtxR", "distR", "R", "T"])), Read(0.12)),
        (
            "np.savez with mtxL",
            vec![("a.npz", npz(&arrays(["mtxL", "distL", "mtxR", "distR", "R", "T"])))],
            Read(0.12),
        ),
        ("np.savez with K1", vec![("a.npz", npz(&arrays(NAMES)))], Read(0.12)),
        (
            "np.savez with left_camera_matrix",
            vec![(
                "a.npz",
                npz(&arrays([
                    "left_camera_matrix",
                    "left_dist",
                    "right_camera_matrix",
                    "right_dist",
                    "Rot",
                    "Trns",
                ])),
            )],
            Read(0.12),
        ),
        (
            "np.save",
            vec![("K1.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', }".to_vec())],
            Told("one array of numpy & np.savez"),
        ),
        ("pickle", vec![("a.pkl", b"\x80\x04\x95\x10\0\0\0".to_vec())], Told("pickle of Python & np.savez")),
        (
            "a lens for each camera and a pose",
            texts(vec![("left.yml", lens("")), ("right.yml", lens("")), ("pose.yml", pose())]),
            Read(0.12),
        ),
        (
            "camera_info of two mono calibrations and a pose",
            texts(vec![("l.yaml", ros(P1)), ("r.yaml", ros(P1)), ("pose.yml", pose())]),
            Read(0.12),
        ),
        (
            "the pose in the file of the right lens",
            texts(vec![
                ("left.yml", lens("")),
                ("right.yml", lens("") + &pose().replace("%YAML:1.0\n---\n", "")),
            ]),
            Read(0.12),
        ),
        (
            "a lens for each camera",
            texts(vec![("left.yml", lens("")), ("right.yml", lens(""))]),
            Told("no file says how the cameras stand & R and T"),
        ),
        (
            "one lens",
            texts(vec![("left.yml", lens(""))]),
            Told("is of one camera & the other one too & R and T"),
        ),
        ("a pose alone", texts(vec![("pose.yml", pose())]), Told("says how the cameras stand & lenses")),
        (
            "a list of images",
            text(
                "stereo_calib.xml",
                "<?xml version=\"1.0\"?>\n<opencv_storage>\n<imagelist>\n\"left01.jpg\"\n\"right01.jpg\"\n</imagelist>\n</opencv_storage>\n",
            ),
            Told("OpenCV's list of images & calibration has written"),
        ),
        (
            "MATLAB's struct as JSON",
            text(
                "a.json",
                "{\"CameraParameters1\": {\"IntrinsicMatrix\": [[500, 0, 0], [0, 500, 0], [320, 240, 1]]}, \"TranslationOfCamera2\": [-120, 0, 0]}",
            ),
            Told("stereoParameters of MATLAB & stereoParametersToOpenCV"),
        ),
        (
            "MATLAB's MAT-file",
            text("Calib_Results_stereo.mat", "MATLAB 5.0 MAT-file, Platform: GLNXA64"),
            Told("MAT-file of MATLAB & stereoParametersToOpenCV"),
        ),
        (
            "the MATLAB toolbox",
            text(
                "Calib_Results.m",
                "% Intrinsic and Extrinsic Camera Parameters\n%-- Focal length:\nfc = [ 500.1 ; 500.2 ];\ncc = [ 320 ; 240 ];\n",
            ),
            Told("MATLAB toolbox for one camera & as OpenCV has them"),
        ),
    ]
}

/// Forms of robots.
fn of_robots() -> Vec<Row> {
    let stated = entry("T_cn_cnm1", RIGHT);
    let in_body = [entry("T_cam_imu", PLACE), entry("T_cam_imu", RIGHT)];
    let of_body = [entry("T_imu_cam", PLACE), entry("T_imu_cam", &back())];
    vec![
        ("camera_info", texts(vec![("left.yaml", ros(P1)), ("right.yaml", ros(P2))]), Read(0.12)),
        ("rostopic echo", texts(vec![("l", echoed(P1)), ("r", echoed(P2))]), Read(0.12)),
        ("ost.txt", text("ost.txt", ost("/left", "0.0") + &ost("/right", "-60.0")), Read(0.12)),
        (
            "ost.txt of each camera",
            texts(vec![("left.txt", ost("/left", "0.0")), ("right.txt", ost("/right", "-60.0"))]),
            Read(0.12),
        ),
        (
            "ost.txt of one camera",
            text("ost.txt", ost("", "0.0")),
            Told("is of one camera & the other one too"),
        ),
        ("Kalibr", text("camchain.yaml", kalibr("radtan", ["", &stated])), Read(0.12)),
        (
            "Kalibr with an inertial sensor",
            text("imucam.yaml", kalibr("equidistant", [&in_body[0], &(in_body[1].clone() + &stated)])),
            Read(0.12),
        ),
        (
            "Kalibr with T_cam_imu alone",
            text("chain.yaml", kalibr("radtan", [&in_body[0], &in_body[1]])),
            Read(0.12),
        ),
        (
            "OpenVINS with T_imu_cam",
            text("chain.yaml", "%YAML:1.0\n\n".to_owned() + &kalibr("radtan", [&of_body[0], &of_body[1]])),
            Read(0.12),
        ),
        (
            "Kalibr without a pose",
            text("chain.yaml", kalibr("radtan", ["", ""])),
            Told("cam1.T_cn_cnm1 is missing & T_cam_imu in both"),
        ),
        (
            "EuRoC",
            texts(vec![
                ("cam0.yaml", euroc(PLACE, "radial-tangential")),
                ("cam1.yaml", euroc(&back(), "radial-tangential")),
            ]),
            Read(0.12),
        ),
        (
            "Kimera",
            texts(vec![
                ("LeftCameraParams.yaml", "%YAML:1.0\n".to_owned() + &euroc(PLACE, "equidistant")),
                ("RightCameraParams.yaml", "%YAML:1.0\n".to_owned() + &euroc(&back(), "equidistant")),
            ]),
            Read(0.12),
        ),
        ("Basalt", text("calibration.json", basalt()), Read(0.12)),
        (
            "ORB-SLAM3",
            text("a.yaml", orb_slam("KannalaBrandt8", &matrix("Stereo.T_c1_c2", 4, &flat(&back())))),
            Read(0.12),
        ),
        ("ORB-SLAM3, rectified", text("a.yaml", orb_slam("Rectified", "Stereo.b: 0.12\n")), Read(0.12)),
        (
            "ORB-SLAM2",
            text(
                "a.yaml",
                "%YAML:1.0\n\nCamera.fx: 500.0\nCamera.fy: 500.0\nCamera.cx: 320.0\nCamera.cy: 240.0\nCamera.width: 640\nCamera.height: 480\nCamera.bf: 60.0\n",
            ),
            Read(0.12),
        ),
        ("VINS-Fusion", texts(vins()), Read(0.12)),
        (
            "VINS-Fusion without its rig",
            texts(vins().into_iter().skip(1).collect()),
            Told("how the cameras stand & body_T_cam0"),
        ),
        ("OKVIS", text("okvis.yaml", okvis("radialtangential", "0.01, 0, 0, 0")), Read(0.12)),
        (
            "OKVIS with 8 coefficients",
            text("okvis.yaml", okvis("radialtangential8", "0.01, 0, 0, 0, 0, 0.02, 0, 0")),
            Read(0.12),
        ),
        ("maplab", text("ncamera.yaml", maplab("T_B_C", &back())), Read(0.12)),
        ("SVO", text("svo.yaml", maplab("T_C_B", RIGHT)), Read(0.12)),
        (
            "DSO",
            text("camera.txt", "Pinhole 500 500 320 240 0\n640 480\ncrop\n640 480\n"),
            Told("the camera of DSO & as OpenCV has them"),
        ),
        (
            "URDF",
            text("nova.urdf", "<?xml version=\"1.0\"?>\n<robot name=\"rig\"><link name=\"left\"/></robot>\n"),
            Told("a model of a robot & calibration program"),
        ),
    ]
}

/// Forms of commercial cameras.
fn of_makers() -> Vec<Row> {
    let five = "k1 = -0.17\nk2 = 0.03\np1 = 0.0001\np2 = 0\nk3 = 0\n";
    let eight = "k1 = 1.5\nk2 = 2\np1 = 0.0001\np2 = 0\nk3 = 0.1\nk4 = 1.8\nk5 = 2\nk6 = 0.3\n";
    vec![
        ("ZED", text("SN1.conf", zed("HD", five, "")), Read(120.0)),
        ("ZED X", text("SN1.conf", zed("FHD1200", "", &disto(eight))), Read(120.0)),
        ("ZED X One 4K", text("SN1.conf", zed("4k", "", &disto(eight))), Read(120.0)),
        ("ZED X One, QHD+", text("SN1.conf", zed("QHDPLUS", "", &disto(five))), Read(120.0)),
        (
            "ZED with fisheyes",
            text("SN1.conf", zed("SVGA", "", &disto("k1 = 0.01\nk2 = 0\nk3 = 0\nk4 = 0.002\n"))),
            Read(120.0),
        ),
        (
            "one ZED X One",
            text(
                "SN1_mono.conf",
                "[CAM_FHD1200]\nfx = 500\nfy = 500\ncx = 320\ncy = 240\n\n[DISTO]\nk1 = 0\n",
            ),
            Told("no lenses of a pair & LEFT_CAM_ & both cameras"),
        ),
        ("OAK", text("oak.json", depthai()), Read(12.0)),
        (
            "RealSense",
            text(
                "d455.json",
                "{\"baseline\": -120.0, \"rectified.0.fx\": 500.0, \"rectified.0.fy\": 500.0, \"rectified.0.ppx\": 320.0, \"rectified.0.ppy\": 240.0, \"rectified.0.width\": 640, \"rectified.0.height\": 480}",
            ),
            Read(120.0),
        ),
        (
            "rs-enumerate-devices",
            text(
                "a.txt",
                "Intrinsic of \"Infrared 1\" / 640x480 / {Y8}\n  Width: 640\n  Height: 480\n  PPX: 320\n",
            ),
            Told("rs-enumerate-devices & RealSense viewer"),
        ),
        (
            "Azure Kinect",
            text("a.json", "{\"CalibrationInformation\": {\"Cameras\": []}}"),
            Told("Azure Kinect's & no pair"),
        ),
    ]
}

/// Forms of data sets.
fn of_sets() -> Vec<Row> {
    vec![
        (
            "Middlebury 2014",
            text("calib.txt", format!("{MIDDLEBURY}isint=0\nvmin=5\nvmax=60\ndyavg=0.1\ndymax=0.2\n")),
            Read(120.0),
        ),
        ("Middlebury 2021", text("calib.txt", format!("{MIDDLEBURY}vmin=5\nvmax=60\n")), Read(120.0)),
        ("ETH3D", text("calib.txt", MIDDLEBURY.replace('\n', "\r\n")), Read(120.0)),
        (
            "KITTI's odometry",
            text("calib.txt", kitti(["P2", "P3"], P2) + "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n"),
            Read(0.12),
        ),
        ("KITTI 2012", text("000000.txt", kitti(["P0", "P1"], P2)), Read(0.12)),
        (
            "KITTI 2015",
            text("000000.txt", format!("calib_time: 25-May-2012\n{}", kitti(["P_rect_02", "P_rect_03"], P2))),
            Read(0.12),
        ),
        ("DrivingStereo", text("2018-10-11.txt", driving_stereo()), Read(0.12)),
        (
            "Cityscapes",
            text(
                "camera.json",
                "{\"extrinsic\": {\"baseline\": 0.12, \"pitch\": 0.03, \"roll\": 0.0, \"x\": 1.7}, \"intrinsic\": {\"fx\": 500.0, \"fy\": 500.0, \"u0\": 320.0, \"v0\": 240.0}}",
            ),
            Read(0.12),
        ),
        (
            "Argoverse",
            text(
                "vehicle_calibration_info.json",
                "{\"camera_data_\": [{\"key\": \"image_raw_stereo_front_left\", \"value\": {\"focal_length_x_px_\": 500.0}}]}",
            ),
            Told("Argoverse's & as OpenCV has them"),
        ),
        (
            "nuScenes",
            text(
                "calibrated_sensor.json",
                "[{\"token\": \"a\", \"sensor_token\": \"b\", \"camera_intrinsic\": [[500, 0, 320], [0, 500, 240], [0, 0, 1]]}]",
            ),
            Told("nuScenes's & as OpenCV has them"),
        ),
        (
            "Scene Flow",
            text(
                "camera_data.txt",
                "Frame 1\nL 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\nR 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n",
            ),
            Told("Scene Flow's & focal length and the baseline"),
        ),
        (
            "Virtual KITTI",
            text("intrinsic.txt", "frame cameraID K[0,0] K[1,1] K[0,2] K[1,2]\n0 0 500 500 320 240\n"),
            Told("Virtual KITTI's & baseline"),
        ),
        (
            "Oxford RobotCar",
            text("stereo_narrow_left.txt", "500.0 500.0 320.0 240.0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"),
            Told("numbers without names & as OpenCV has them"),
        ),
        ("MPI Sintel", vec![("frame_0001.cam", b"PIEH\0\0\0\0".to_vec())], Told("MPI Sintel")),
    ]
}

/// Forms of photogrammetry.
fn of_photogrammetry() -> Vec<Row> {
    vec![
        ("COLMAP", texts(colmap("OPENCV 640 480 500 500 320.5 240.5 0 0 0 0")), Read(0.12)),
        (
            "COLMAP with a fisheye",
            texts(colmap("OPENCV_FISHEYE 640 480 500 500 320.5 240.5 0.01 0 0 0")),
            Read(0.12),
        ),
        (
            "COLMAP without its images",
            texts(colmap("PINHOLE 640 480 500 500 320.5 240.5").into_iter().take(1).collect()),
            Told("images.txt is missing"),
        ),
        (
            "mrcal",
            texts(vec![
                ("l.cameramodel", mrcal("LENSMODEL_OPENCV4", "0, 0, 0, 0", 0.0)),
                ("r.cameramodel", mrcal("LENSMODEL_OPENCV8", "0.1, 0, 0, 0, 0, 0, 0, 0", -0.12)),
            ]),
            Read(0.12),
        ),
        (
            "one camera of mrcal",
            texts(vec![("l.cameramodel", mrcal("LENSMODEL_PINHOLE", "", 0.0))]),
            Told("is of one camera & the other one too"),
        ),
        (
            "mrcal's splines",
            texts(vec![
                ("l.cameramodel", mrcal("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30", "", 0.0)),
                ("r.cameramodel", mrcal("LENSMODEL_PINHOLE", "", -0.12)),
            ]),
            Told("lensmodel: expected & mrcal-convert-lensmodel"),
        ),
        ("Metashape's lens", text("meta.xml", METASHAPE), Told("Metashape's & COLMAP")),
        (
            "Metashape's cameras",
            text(
                "cameras.xml",
                "<?xml version=\"1.0\"?>\n<document version=\"2.0.0\">\n<chunk label=\"Chunk 1\"><sensors/></chunk>\n</document>\n",
            ),
            Told("Metashape's & COLMAP"),
        ),
        (
            "MicMac",
            text(
                "AutoCal.xml",
                "<?xml version=\"1.0\" ?>\n<ExportAPERO>\n<CalibrationInternConique><F>500</F></CalibrationInternConique>\n</ExportAPERO>\n",
            ),
            Told("MicMac's & as OpenCV has them"),
        ),
        (
            "Pix4D",
            text(
                "calibrated_camera_parameters.txt",
                "fileName imageWidth imageHeight \ncamera matrix K [3x3]\nradial distortion [3x1]\n\nleft.jpg 640 480\n500 0 320\n",
            ),
            Told("Pix4D's & as OpenCV has them"),
        ),
        (
            "Pix4D's lens",
            text("internal.cam", "#Focal Length (mm) assuming a sensor width of 17.5\nFOCAL 8.6\n"),
            Told("Pix4D's"),
        ),
        ("Bundler", text("bundle.out", "# Bundle file v0.3\n2 100\n500 0 0\n"), Told("Bundler's & COLMAP")),
        (
            "VisualSFM",
            text("a.nvm", "NVM_V3 \n\n2\nleft.jpg 500 1 0 0 0 0 0 0 0 0\n"),
            Told("VisualSFM's & COLMAP"),
        ),
        (
            "OpenMVG",
            text("sfm_data.json", "{\"sfm_data_version\": \"0.3\", \"root_path\": \"\", \"views\": []}"),
            Told("OpenMVG's & COLMAP"),
        ),
        (
            "Meshroom",
            text(
                "cameras.sfm",
                "{\"version\": [\"1\", \"2\"], \"views\": [], \"intrinsics\": [], \"poses\": []}",
            ),
            Told("Meshroom's & COLMAP"),
        ),
        (
            "OpenSfM",
            text("reconstruction.json", "[{\"cameras\": {}, \"shots\": {}}]"),
            Told("OpenSfM's & COLMAP"),
        ),
        (
            "transforms.json",
            text(
                "transforms.json",
                "{\"camera_angle_x\": 0.7, \"frames\": [{\"file_path\": \"a\", \"transform_matrix\": []}]}",
            ),
            Told("radiance field & COLMAP"),
        ),
        (
            "ContextCapture",
            text(
                "blocks.xml",
                "<?xml version=\"1.0\"?>\n<BlocksExchange version=\"3.2\"><Block/></BlocksExchange>\n",
            ),
            Told("ContextCapture's & COLMAP"),
        ),
    ]
}

/// The focal length of the left camera and the baseline, from each source in the calibration.
fn said(calibration: &StereoCalibration) -> Vec<(f64, f64)> {
    let length = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let pose = calibration.pose.zip(calibration.lenses);
    let by_pose = pose.map(|(pose, [left, _])| (left.focal_length()[0], length(&pose.translation)));
    let by_views =
        calibration.views.map(|views| (views.cameras[0].focal_length[0], length(&views.translation)));
    by_pose.into_iter().chain(by_views).collect()
}

#[test]
fn public_forms_are_read_or_recognized() {
    let all = [of_opencv(), of_robots(), of_makers(), of_sets(), of_photogrammetry()].concat_rows();
    let (mut read_ones, mut named) = (0, 0);
    for (name, files, fate) in &all {
        match (read(files), fate) {
            (Ok(found), Read(baseline)) => {
                let said = said(&found);
                let right =
                    |(f, b): &(f64, f64)| (f - 500.0).abs() < 1e-9 && (b - baseline).abs() < 1e-9 * baseline;
                assert!(!said.is_empty() && said.iter().all(right), "{name}: {said:?}");
                let views = found.of_rectified_images(Some((640, 480)));
                assert!(
                    found.lenses.is_some() || matches!(views, Ok(Some(_))),
                    "{name}: neither raw nor rectified"
                );
                read_ones += 1;
            }
            (Err(told), Told(words)) => {
                assert!(files.iter().any(|(file, _)| says(&told, file, words)), "{name}: {told}");
                named += 1;
            }
            (Ok(_), Told(words)) => panic!("{name} is read, and not told: {words}"),
            (Err(told), Read(_)) => panic!("{name}: {told}"),
        }
    }
    println!("{read_ones} forms are read, {named} named");
    assert!(read_ones >= 40 && read_ones + named >= 60, "{read_ones} and {named}");
}

/// Concatenates tables, whose rows cannot be copied.
trait ConcatRows {
    fn concat_rows(self) -> Vec<Row>;
}

impl<const N: usize> ConcatRows for [Vec<Row>; N] {
    fn concat_rows(self) -> Vec<Row> {
        self.into_iter().flatten().collect()
    }
}

/// Distortion in ZED's sections of a size, and in those for all sizes.
#[test]
fn zed_lenses_may_be_common_to_all_sizes() {
    use mrfgs::calibration::lens::Distortion;
    let lens = |text: String| read(&[("SN1.conf", text)]).unwrap().lenses.unwrap()[1].distortion();
    let five = "k1 = -0.2\nk2 = 0.03\np1 = 0.001\np2 = 0\nk3 = 0\n";
    let inline = lens(zed("SVGA", five, ""));
    assert_eq!(lens(zed("SVGA", "", &disto(five))), inline);
    // If both are present, the section of all sizes has the newer model.
    assert_eq!(lens(zed("SVGA", "k1 = 7\n", &disto(five))), inline);
    assert_ne!(lens(zed("SVGA", "", "")), inline);
    let fisheye = lens(zed(
        "SVGA",
        "",
        &disto("k1 = 0.1\nk2 = 0.2\nk3 = 0.3\nk4 = 0.4\nk5 = 0\nk6 = 0\np1 = 0\np2 = 0\n"),
    ));
    assert_eq!(fisheye, Distortion::Equidistant([0.1, 0.2, 0.3, 0.4]));
    // OpenCV's T has the signs of TY and TZ, and the opposite of the baseline's.
    let moved = zed("SVGA", five, "").replace("TY = 0", "TY = 1.5").replace("TZ = 0", "TZ = -2.5");
    let pose = read(&[("SN1.conf", moved)]).unwrap().pose.unwrap();
    assert!(pose.translation.iter().zip([-120.0, 1.5, -2.5]).all(|(a, b)| (a - b).abs() < 1e-12), "{pose:?}");
    let other = zed("HUGE", five, "");
    let told = read(&[("SN1.conf", other)]).unwrap_err();
    assert!(says(&told, "SN1.conf", "no lenses of a pair & 4K, QHDPLUS, 2K"), "{told}");
}

#[test]
fn a_contradictory_chain_is_refused() {
    let chain = |stated: &str| {
        let poses = [entry("T_cam_imu", PLACE), entry("T_cam_imu", RIGHT) + &entry("T_cn_cnm1", stated)];
        read(&[("chain.yaml", kalibr("radtan", [&poses[0], &poses[1]]))])
            .map(|found| found.pose.unwrap().translation[0])
    };
    assert_eq!(chain(RIGHT), Ok(-0.12));
    // A difference within rounding.
    assert_eq!(chain(&RIGHT.replace("-0.12", "-0.1203")), Ok(-0.1203));
    for (from, to, words) in [
        ("-0.12", "-0.2", "0.00 degrees and 0.0800 m"),
        ("-0.12", "0.12", "0.00 degrees and 0.2400 m"),
        (
            "[1.0, 0.0, 0.0, -0.12], [0.0, 1.0, 0.0",
            "[0.99995, -0.01, 0.0, -0.12], [0.01, 0.99995, 0.0",
            "0.57 degrees and",
        ),
    ] {
        let told = chain(&RIGHT.replace(from, to)).unwrap_err();
        assert!(
            says(
                &told,
                "chain.yaml",
                &format!("cam1.T_cn_cnm1: contradicts T_cam_imu of both cameras by {words}")
            ),
            "{told}"
        );
    }
}
