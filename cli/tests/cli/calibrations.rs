//! Calibrations in common formats: each gives the same pair and the same depths, and faults in a file are reported in one line.

use mrfgs::rectification::{Options, Rectification};

use super::*;

/// The calibration of `testdata/raw` in OpenCV's YAML.
pub(super) fn opencv() -> String {
    fs::read_to_string(scene("raw/cameras.yml")).unwrap()
}

/// The numbers of one of its entries.
pub(super) fn numbers(name: &str) -> Vec<String> {
    let text = opencv();
    let entry = text.split(&format!("\n{name}: ")).nth(1).unwrap();
    let data = entry.split("data: [ ").nth(1).unwrap().split(" ]").next().unwrap();
    data.split(", ").map(str::to_owned).collect()
}

/// The same calibration in OpenCV's XML.
fn xml() -> String {
    let mut text =
        "<?xml version=\"1.0\"?>\n<opencv_storage>\n<imageSize>\n  240 180</imageSize>\n<unit>m</unit>\n"
            .to_owned();
    for (name, rows) in [("K1", 3), ("D1", 1), ("K2", 3), ("D2", 1), ("R", 3), ("T", 3)] {
        let numbers = numbers(name);
        let (columns, numbers) = (numbers.len() / rows, numbers.join(" "));
        let head =
            format!("<{name} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{columns}</cols>");
        text += &[&head, "\n  <dt>d</dt>\n  <data>\n    ", &numbers, "</data></", name, ">\n"].concat();
    }
    text + "</opencv_storage>\n"
}

/// The same calibration in Kalibr's format.
fn kalibr() -> String {
    let camera = |n: usize| {
        let (k, d) = (numbers(&format!("K{n}")), numbers(&format!("D{n}")));
        format!(
            "cam{}:\n  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: radtan\n  intrinsics: [{}, {}, {}, {}]\n  resolution: [240, 180]\n  rostopic: /cam{}/image_raw\n",
            n - 1,
            d[..4].join(", "),
            k[0],
            k[4],
            k[2],
            k[5],
            n - 1
        )
    };
    let (r, t) = (numbers("R"), numbers("T"));
    let row = |y: usize| format!("  - [{}, {}]\n", r[3 * y..3 * y + 3].join(", "), t[y]);
    let pose = format!("  T_cn_cnm1:\n{}{}{}  - [0.0, 0.0, 0.0, 1.0]\n", row(0), row(1), row(2));
    camera(1) + &camera(2) + &pose
}

/// One of ROS's two files, for images that are already rectified.
fn ros(tx: &str) -> String {
    format!(
        "image_width: 240\nimage_height: 180\ncamera_name: some\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [215.5, 0, 118.5, 0, 215.5, 89.5, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [215.5, 0, 118.5, {tx}, 0, 215.5, 89.5, 0, 0, 0, 1, 0]\n"
    )
}

/// Flags that select these calibration files.
fn calib(files: &str) -> String {
    format!(" --calib {}", files.replace(' ', " --calib "))
}

pub(super) fn rectify(folder: &Path, calibrations: &str) -> Run {
    run(folder, &format!("rectify @raw/left.png @raw/right.png out{}", calib(calibrations)))
}

#[test]
fn every_format_rectifies_alike() {
    let folder = Folder::new();
    let (lenses, pose) = opencv().split_once("R: ").map(|(a, b)| (a.to_owned(), format!("R: {b}"))).unwrap();
    let renamed =
        opencv().replace("K1:", "cameraMatrix1:").replace("D2:", "dist_coeffs_2:").replace("T:", "T :");
    for (name, text) in [
        ("a.yml", opencv()),
        ("b.txt", xml()),
        ("c", kalibr()),
        ("lenses", lenses),
        ("pose", pose),
        ("renamed", renamed.replace("%YAML:1.0", "%YAML 1.2")),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
    let mut first = None;
    for files in ["a.yml", "b.txt", "c", "lenses pose", "renamed"] {
        rectify(&folder, files).succeeded().says("240 x 180, 98.7 % of the left");
        let found: BTreeMap<_, _> = listing(&folder.join("out"));
        assert_eq!(found.len(), 6, "{files:?}");
        assert!(first.get_or_insert_with(|| found.clone()) == &found, "{files:?}");
        fs::remove_dir_all(folder.join("out")).unwrap();
    }
}

#[test]
fn rectifying_before_or_within_match_gives_the_same_bits() {
    let folder = Folder::new();
    rectify(&folder, "@raw/cameras.yml").succeeded();
    let end = "--max-disparity 40 --device cpu --also validity,depth-mm,points";
    let raw = "@raw/left.png @raw/right.png a.pfm --rectify --calib @raw/cameras.yml --json a.json";
    // The calibration in OpenCV's format is equivalent.
    let rectified = "out/im0.png out/im1.png";
    for pair in [raw, &format!("{rectified} b.pfm"), &format!("{rectified} c.pfm --calib out/cameras.yml")] {
        run(&folder, &format!("match {pair} {end}")).succeeded();
    }
    let read = |name: String| fs::read(folder.join(name)).unwrap();
    for end in ["pfm", "validity.png", "depth-mm.png"] {
        for other in ["b", "c"] {
            assert!(read(format!("a.{end}")) == read(format!("{other}.{end}")), "{other} {end}");
        }
    }
    assert!(read("a.points.ply".into()) == read("c.points.ply".into()), "points in the unit of the file");
    let record = json(folder.join("a.json"));
    assert_eq!(record["rectified"], true);
    assert_eq!(record["files"]["calibration"], scene("raw/cameras.yml").to_str().unwrap());
    // Depths are in metres, 16-bit ones in millimetres.
    let pixels = image::open(folder.join("a.depth-mm.png")).unwrap().into_luma16();
    let known = || pixels.pixels().map(|p| p.0[0]).filter(|mm| *mm > 0);
    let (least, most) = (known().min().unwrap(), known().max().unwrap());
    assert!((1000..2000).contains(&least) && (2500..6000).contains(&most), "{least} to {most}");
}

/// The pixel of a point in the left camera of `testdata/raw`, by the numbers of its calibration.
fn seen([x, y, z]: [f64; 3], k: &[f64], d: &[f64]) -> [f64; 2] {
    let [a, b] = [x / z, y / z];
    let r2 = a * a + b * b;
    let radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    let across = 2.0 * d[2] * a * b + d[3] * (r2 + 2.0 * a * a);
    let down = d[2] * (r2 + 2.0 * b * b) + 2.0 * d[3] * a * b;
    [k[0] * (a * radial + across) + k[2], k[4] * (b * radial + down) + k[5]]
}

#[test]
fn points_in_the_original_frame_project_to_their_pixels() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let raw = |output: &str| format!("@raw/left.png @raw/right.png {output} --calib @raw/cameras.yml");
    run(&folder, &format!("rectify {} --maps", raw("out"))).succeeded();
    let also = "--device cpu --quiet --also validity,points,points-original,points-original.pcd";
    run(&folder, &format!("match {} --rectify --max-disparity 40 {also}", raw("a.pfm"))).succeeded();
    let says = |name: &str| {
        String::from_utf8_lossy(&fs::read(at(name)).unwrap()).contains("frame of the original left camera")
    };
    assert!(says("a.points-original.ply") && says("a.points-original.pcd") && !says("a.points.ply"));

    let validity = read::grey8(&at("a.validity.png")).unwrap();
    let places = [at("out/map0x.pfm"), at("out/map0y.pfm")].map(read_pfm);
    let [k, d] =
        ["K1", "D1"].map(|name| numbers(name).iter().map(|v| v.parse().unwrap()).collect::<Vec<f64>>());
    let misses = |name: &str| -> Vec<f64> {
        let points = points::cloud(&at(name));
        let pixels = (0..180).flat_map(|y| (0..240).map(move |x| (x, y))).filter(|at| validity[*at] == 0);
        let pixels: Vec<_> = pixels.collect();
        assert_eq!(points.len(), pixels.len());
        let pairs = pixels.iter().zip(points);
        let misses = pairs.map(|(&at, (position, ..))| {
            let [u, v] = seen(position, &k, &d);
            (u - f64::from(places[0][at])).hypot(v - f64::from(places[1][at]))
        });
        misses.collect()
    };
    let most = misses("a.points-original.ply").into_iter().fold(0.0, f64::max);
    assert!(most < 1e-4, "{most} px");
    // Control: points of the rectified frame project elsewhere.
    let least = misses("a.points.ply").into_iter().fold(f64::INFINITY, f64::min);
    assert!(least > 0.5, "{least} px");
    println!("{most:.1e} px at most, {least:.2} px at least in the rectified frame");
}

#[test]
fn every_format_gives_the_same_depths() {
    let folder = Folder::new();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write("left", &ros("0"));
    write("right", &ros("-34.48"));
    write("txt", "cam0=[215.5 0 118.5; 0 215.5 89.5; 0 0 1]\ndoffs=0\nbaseline=160\n");
    let p = "!!opencv-matrix\n   rows: 3\n   cols: 4\n   dt: d\n   data: [ 215.5, 0., 118.5, ";
    let rest = ", 0., 215.5, 89.5, 0., 0., 0., 1., 0. ]\n";
    write("cv", &format!("%YAML:1.0\n---\nP1: {p}0.{rest}P2: {p}-34.48{rest}unit: m\n"));
    let depths = |files: &str| {
        let line = "match @slanted/im0.png @slanted/im1.png d.pfm --max-disparity 31 --also depth-mm";
        run(&folder, &format!("{line}{}", calib(files))).succeeded();
        fs::read(folder.join("d.depth-mm.png")).unwrap()
    };
    let first = depths("txt");
    // KITTI's grey and colour pairs, one with twice the baseline.
    let kitti = |text: &str, columns: [&str; 4]| {
        let row = |(n, tx): (usize, &str)| {
            format!("P{n}: 2.155e+02 0 1.185e+02 {tx} 0 2.155e+02 8.95e+01 0 0 0 1 0\n")
        };
        columns.into_iter().enumerate().map(row).collect::<String>() + text
    };
    write("colour", &kitti("Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n", ["0", "-68.96", "5.00", "-29.48"]));
    write("grey", &kitti("pair: grey\n", ["0", "-34.48", "5.00", "-63.96"]));
    let all = kitti("", ["0", "-34.48", "0", "0"]);
    write("two", &all[..all.find("P2").unwrap()]);
    for files in ["left right", "right left", "cv", "colour", "grey", "two"] {
        assert!(depths(files) == first, "{files}");
    }
}

/// The file to change, the text and its replacement, and words of the error besides the file name.
type Row = (&'static str, &'static str, &'static str, &'static str);

const WRONG: &[Row] = &[
    ("cv", "K1:", "X1:", "K1 is missing: expected the matrix [f 0 cx; 0 f cy; 0 0 1]"),
    ("cv", "D2:", "X2:", "D2 is missing & 0 0 0 0 for none"),
    ("cv", "R:", "X:", "R is missing & 3 x 3 or a rotation vector"),
    ("cv", "T:", "X:", "T is missing & 3 numbers"),
    ("cv", "214.0, 0.0, 121.4", "214.0, 0.0", "K1: expected 9 numbers & a damaged matrix"),
    ("cv", "214.0, 0.0, 121.4", "214.0, 0.5, 121.4", "K1: expected a camera matrix & no skew"),
    ("cv", "214.0, 0.0, 121.4", "-214.0, 0.0, 121.4", "K1: expected a camera matrix & f above 0"),
    ("cv", "214.0, 0.0, 121.4", "1e999, 0.0, 121.4", "K1: expected 9 numbers"),
    ("cv", "-0.0005, 0.0 ]", "-0.0005, 0.0, 1.0 ]", "D1: expected the coefficients & a damaged matrix"),
    (
        "cv",
        "5\n   dt: d\n   data: [ -0.16,",
        "6\n   dt: d\n   data: [ 0, -0.16,",
        "D1: expected 4, 5, 8, 12 or 14 & 6 numbers",
    ),
    (
        "cv",
        "5\n   dt: d\n   data: [ -0.16,",
        "13\n   dt: d\n   data: [ 1, 2, 3, 4, 5, 6, 7, 8, 9,",
        "D1: expected 4, 5, 8, 12 or 14 & 13 numbers",
    ),
    ("cv", "[ 0.998908116030631", "[ 0.798908116030631", "R: expected a rotation"),
    ("cv", "[ -0.16356857928250576,", "[ .Nan,", "T: expected 3 numbers"),
    ("cv", "[ -0.16356857928250576,", "[ 0.001, 0.001,", "T: expected 3 numbers"),
    (
        "cv",
        "[ -0.16356857928250576, 0.0029582522634575997,",
        "[ 0.0001, 0.0,",
        "one camera in front of the other",
    ),
    ("cv", "[ 240, 180 ]", "[ 240 ]", "imageSize: expected width and height & found 1 number"),
    ("cv", "[ 240, 180 ]", "[ 240, 180.5 ]", "imageSize: expected width and height"),
    ("cv", "[ 240, 180 ]", "[ 320, 200 ]", "is for images of 320 x 200 & 240 x 180 & --calib-crop"),
    ("cv", "unit: m", "unit: feet", "unit: expected mm, cm, m or unknown, found `feet`"),
    ("cv", "unit: m", "fisheye: perhaps", "fisheye: expected 0 or 1 & `perhaps`"),
    ("cv", "unit: m", "fisheye: 1", "D1: expected the 4 coefficients of a fisheye & 5 numbers"),
    ("cv", "unit: m", "K1: 5", "`K1` is there twice"),
    ("cv", "unit: m", "unit: [ m", "is no YAML"),
    ("cv", "unit: m", "a: &a [ 1 ]\nb: *a", "line & found a reference"),
    ("cv", "unit: m", "P1: 1", "P1: expected 12 numbers, a matrix of 3 x 4, found `1`"),
    ("xml", "</D1>", "</D2>", "is no XML"),
    ("xml", "<D1 ", "<K1 ", "is no XML"),
    ("xml", "<unit>m</unit>", "<K1>3</K1>", "`K1` is there twice"),
    ("xml", "<opencv_storage>", "<!DOCTYPE a [<!ENTITY b \"c\">]><opencv_storage>", "is no XML"),
    ("xml", "<rows>3</rows>", "<rows>4</rows>", "K1: expected 9 numbers & a damaged matrix"),
    ("chain", "cam1:", "cam2:", "cam1 is missing"),
    ("chain", "pinhole", "mirror", "cam0.camera_model: expected a lens model & `mirror`"),
    ("chain", "pinhole", "omni", "cam0.intrinsics: expected 5 numbers: xi, fu & 4 numbers"),
    (
        "chain",
        "radtan",
        "cubic",
        "cam0.distortion_model: expected radtan, equidistant, fov or none, found `cubic`",
    ),
    ("chain", "T_cn_cnm1", "T_other", "cam1.T_cn_cnm1 is missing & 4 x 4"),
    ("chain", "[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 2.0]", "cam1.T_cn_cnm1: expected a rotation"),
    ("chain", "[240, 180]", "[320, 200]", "is for images of 320 x 200, 240 x 180, but these are 240 x 180"),
    ("chain", "intrinsics: [214.0, ", "intrinsics: [", "cam0.intrinsics: expected 4 numbers & 3 numbers"),
    ("chain", "intrinsics: [214.0, ", "intrinsics: [0, ", "cam0.intrinsics: expected 4 numbers & above 0"),
    ("ros", "plumb_bob", "thin_prism", "distortion_model: expected plumb_bob & `thin_prism`"),
    ("ros", "projection_matrix", "projection", "projection_matrix is missing"),
    (
        "ros",
        "image_width: 240",
        "image_width: 200",
        "is for images of 240 x 180, 200 x 180, but these are 240 x 180",
    ),
    ("ros", "-34.48", "0", "projection_matrix: expected focal length times baseline"),
    ("ros", "215.5, 0, 118.5, -34", "100.5, 0, 118.5, -34", "projection_matrix: expected the focal length"),
    ("ros", "data: [1, 0, 0, 0, 1", "data: [1, 0, 0, 0, -1", "rectification_matrix: expected a rotation"),
    ("ros", "camera_matrix:", "camera:", "does not belong to the other file"),
];

#[test]
fn faults_in_a_calibration_are_reported() {
    let folder = Folder::new();
    fs::write(folder.join("left"), ros("0")).unwrap();
    for (kind, from, to, words) in WRONG {
        let text = match *kind {
            "cv" => opencv(),
            "xml" => xml(),
            "chain" => kalibr(),
            _ => ros("-34.48"),
        };
        let what = format!("{kind}: {from} -> {to}");
        assert!(text.contains(from), "{what}");
        fs::write(folder.join("a-file"), text.replacen(from, to, 1)).unwrap();
        let told = rectify(&folder, if *kind == "ros" { "left a-file" } else { "a-file" });
        told.failed(1, &format!("a-file & {words}"));
        assert_eq!(listing(&folder).len(), 2, "{what}: no output");
    }
}

/// The share of pixels that differ by more than one level between two pictures.
fn differing(folder: &Folder, a: &str, b: &str) -> f64 {
    let [a, b] = [a, b].map(|name| image::open(folder.join(name)).unwrap().to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let far = a.pixels().zip(b.pixels()).filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1));
    far.count() as f64 / (a.width() * a.height()) as f64
}

#[test]
fn swapped_cameras_are_exchanged() {
    let folder = Folder::new();
    let rig = forms::Rig::new();
    let back = mrfgs::calibration::matrix::transposed(&rig.r);
    let t = mrfgs::calibration::matrix::rotated(&back, rig.t).map(|v| -v);
    let exchanged = forms::Rig { k: [rig.k[1], rig.k[0]], d: [rig.d[1], rig.d[0]], r: back, t };
    fs::write(folder.join("rig.yml"), rig.opencv("")).unwrap();
    fs::write(folder.join("exchanged.yml"), exchanged.opencv("")).unwrap();
    run(&folder, "rectify @raw/left.png @raw/right.png expected --calib rig.yml --quiet").succeeded();
    // Images in the order of the cameras' positions, and in the order of the file.
    let told = "exchanged.yml: has the right camera to the left of the left one, so the two were swapped";
    for (images, out, words) in [
        ("@raw/left.png @raw/right.png", "a", told.to_owned()),
        (
            "@raw/right.png @raw/left.png",
            "b",
            format!("{told}, and so were the images, by their matches: the maps belong to the second image"),
        ),
    ] {
        run(&folder, &format!("rectify {images} {out} --calib exchanged.yml")).succeeded().says(&words);
        for name in ["im0.png", "im1.png"] {
            let share = differing(&folder, &format!("expected/{name}"), &format!("{out}/{name}"));
            assert!(share < 0.01, "{out}/{name}: {share}");
        }
    }
    // Control: the views differ.
    assert!(differing(&folder, "expected/im0.png", "expected/im1.png") > 0.5);
}

#[test]
fn images_of_another_size_are_reported() {
    let folder = Folder::new();
    let text = opencv();
    for (name, size) in
        [("half.yml", "[ 120, 90 ]"), ("odd.yml", "[ 240, 200 ]"), ("fits.yml", "[ 240, 180 ]")]
    {
        fs::write(folder.join(name), text.replacen("[ 240, 180 ]", size, 1)).unwrap();
    }
    let images = "rectify @raw/left.png @raw/right.png";
    let words = "half.yml: is for images of 120 x 90: those of 240 x 180 count as the same, scaled; if they show another part, give \
                 it with --calib-crop";
    run(&folder, &format!("{images} half --calib half.yml")).succeeded().says(words);
    run(&folder, &format!("{images} fits --calib fits.yml")).succeeded().is_silent_on("is for images of");
    run(&folder, &format!("{images} odd --calib odd.yml"))
        .failed(1, "odd.yml & 240 x 200 & 240 x 180 & --calib-crop");
    run(&folder, &format!("{images} part --calib odd.yml --calib-crop 0,0,240,180")).succeeded();
    assert!(differing(&folder, "part/im0.png", "fits/im0.png") == 0.0, "the part begins at the first pixel");
    let outside = "--calib-crop & odd.yml & 240 x 200 & not inside";
    run(&folder, &format!("{images} out --calib odd.yml --calib-crop 0,21,240,180")).failed(2, outside);
    run(&folder, &format!("{images} out --calib-crop 0,0,240,180")).failed(2, "--calib");
    // The images of one camera are twice as large.
    let right = image::open(scene("raw/right.png")).unwrap();
    right.resize(480, 360, image::imageops::FilterType::Nearest).save(folder.join("right.png")).unwrap();
    run(&folder, "rectify @raw/left.png right.png two --calib fits.yml")
        .succeeded()
        .says("480 x 360 count as the same, scaled");
    assert!(differing(&folder, "two/im0.png", "fits/im0.png") == 0.0);
    assert!(differing(&folder, "two/mask1.png", "fits/mask1.png") < 0.05, "the right view shows as much");
    run(&folder, "rectify @raw/left.png right.png alone").failed(1, "right.png is 480 x 360 & the same size");
    // So are both views in one file.
    let jpegs = [scene("raw/left.png"), folder.join("right.png")].map(|view| {
        let mut file = std::io::Cursor::new(Vec::new());
        image::open(view).unwrap().to_rgb8().write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        file.into_inner()
    });
    for (name, jpeg) in ["l.jpg", "r.jpg"].iter().zip(&jpegs) {
        fs::write(folder.join(name), jpeg).unwrap();
    }
    fs::write(folder.join("both.mpo"), mpo(jpegs)).unwrap();
    let line = "d.pfm --rectify --calib fits.yml --max-disparity 31 --method fast --device cpu --quiet";
    for (views, out) in [("l.jpg r.jpg", "files"), ("both.mpo", "one")] {
        run(&folder, &format!("rectify {views} {out} --calib fits.yml")).succeeded();
        run(&folder, &format!("match {views} {out}-{line}")).succeeded();
    }
    alike(&folder.join("files"), &folder.join("one"), "both views in one file");
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(bytes("files-d.pfm") == bytes("one-d.pfm"));
    run(&folder, "rectify both.mpo alone")
        .failed(1, "the right view in both.mpo is 480 x 360 & the same size");
    run(&folder, "match both.mpo d.pfm --max-disparity 31")
        .failed(1, "both.mpo is 480 x 360 & the same size");
}

/// An MPO file of two JPEG files.
fn mpo([left, right]: [Vec<u8>; 2]) -> Vec<u8> {
    // Behind its marker, its length and its name a segment of the first image lists both: 58 bytes, counted from their fifth one.
    const SEGMENT: usize = 66;
    let entry = |kind: u32, size: usize, offset: usize| {
        [kind, size as u32, offset as u32, 0].map(u32::to_le_bytes).concat()
    };
    let first = left.len() + SEGMENT;
    let list = [
        b"II*\0".to_vec(),
        8_u32.to_le_bytes().to_vec(),
        1_u16.to_le_bytes().to_vec(),
        // The entry of the list: 32 bytes of no type, from byte 26 on; and no further directory.
        [0x02, 0xb0, 7, 0, 32, 0, 0, 0, 26, 0, 0, 0].to_vec(),
        vec![0; 4],
        entry(0x0003_0000, first, 0),
        entry(0x0002_0000, right.len(), first - 10),
    ]
    .concat();
    let length = (2 + 4 + list.len() as u16).to_be_bytes();
    let segment = [&[0xff, 0xe2], &length[..], b"MPF\0", &list].concat();
    assert_eq!(segment.len(), SEGMENT);
    [&left[..2], &segment, &left[2..], &right].concat()
}

#[test]
fn an_implausible_unit_is_reported() {
    let folder = Folder::new();
    fs::write(folder.join("left"), ros("0")).unwrap();
    let depth = |right: &str, out: &str| {
        fs::write(folder.join("right"), right).unwrap();
        let line = "match @slanted/im0.png @slanted/im1.png OUT --also depth-mm --calib left --calib right --max-disparity 23";
        run(&folder, &line.replace("OUT", out)).succeeded()
    };
    let remedy = "& give the right one in the file as an entry `unit`: mm, cm or m";
    depth(&ros("-34.48"), "d.pfm").is_silent_on("apart");
    depth(&ros("-0.03448"), "small.pfm").says(&format!("warning & 0.00016 m apart {remedy}"));
    depth(&ros("-34480"), "large.pfm").says(&format!("warning & 160 m apart {remedy}"));
    // The suggested remedy works.
    depth(&(ros("-34480") + "unit: mm\n"), "again.pfm").is_silent_on("apart");
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(bytes("d.depth-mm.png") == bytes("again.depth-mm.png"));
    // Other commands warn too.
    for line in [
        "depth d.pfm e.pfm --calib left --calib right --also depth",
        "rectify @slanted/im0.png @slanted/im1.png out --calib left --calib right",
    ] {
        fs::write(folder.join("right"), ros("-34480")).unwrap();
        run(&folder, line).succeeded().says("160 m apart");
    }
    run(&folder, "depth d.pfm f.pfm --focal 215 --baseline 160m")
        .succeeded()
        .says("--focal & 160 m apart & 120mm, 12cm or 0.12m");
    run(&folder, "depth d.pfm g.pfm --focal 4 --baseline 16cm")
        .succeeded()
        .says("4 px & 240 px wide & in pixels");
    run(&folder, "depth d.pfm h.pfm --focal 215 --baseline 16cm").succeeded().is_silent_on("warning");
}

/// The calibration of `testdata/raw` with a precomputed rectification, and the lenses and pose it belongs to.
pub(super) fn stored() -> String {
    let by = mrfgs::calibration::of_texts(&[(Path::new("cameras"), opencv())]).unwrap();
    let by = Rectification::new(&by, (240, 180), &Options::default()).unwrap();
    let matrix = |name: &str, rows: usize, numbers: &[f64]| {
        let columns = numbers.len() / rows;
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {numbers:?}\n"
        )
    };
    let calibration = by.calibration().unwrap();
    let (camera, baseline) = (calibration.camera.unwrap(), calibration.baseline.unwrap());
    let ([f, _], [cx, cy]) = (camera.focal_length, camera.principal_point);
    let mut text = opencv() + "\n";
    for (i, rotation) in by.rotations().iter().enumerate() {
        text += &matrix(&format!("R{}", i + 1), 3, rotation.as_flattened());
        let tx = [0.0, -baseline * f][i];
        text += &matrix(&format!("P{}", i + 1), 3, &[f, 0.0, cx, tx, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    }
    let q = [1.0, 0.0, 0.0, -cx, 0.0, 1.0, 0.0, -cy, 0.0, 0.0, 0.0, f, 0.0, 0.0, 1.0 / baseline, 0.0];
    text + &matrix("Q", 4, &q)
}

/// `text` with the numbers of an entry changed.
pub(super) fn with_numbers(text: &str, name: &str, change: impl Fn(&[f64]) -> Vec<f64>) -> String {
    let entry = text.find(&format!("\n{name}: ")).unwrap();
    let start = entry + text[entry..].find("data: [").unwrap() + 7;
    let end = start + text[start..].find(']').unwrap();
    let numbers: Vec<f64> = text[start..end].split(',').map(|word| word.trim().parse().unwrap()).collect();
    let changed = format!("{:?}", change(&numbers));
    [&text[..start], changed.trim_matches(['[', ']']), &text[end..]].concat()
}

/// `text` with a rotation turned about the y axis.
pub(super) fn turned(text: &str, name: &str, degrees: f64) -> String {
    let (sin, cos) = degrees.to_radians().sin_cos();
    with_numbers(text, name, |m| {
        let row = |a: f64, b: f64| (0..3).map(move |x| a * m[x] + b * m[6 + x]);
        row(cos, sin).chain(m[3..6].iter().copied()).chain(row(-sin, cos)).collect()
    })
}

/// A calibration without an image size whose optical axis is far from the image centre.
#[test]
fn a_calibration_for_another_size_is_reported() {
    let folder = Folder::new();
    let silent = opencv().replace("imageSize: [ 240, 180 ]", "").replace("121.4,", "150.0,");
    fs::write(folder.join("a-file"), &silent).unwrap();
    let told = rectify(&folder, "a-file").succeeded();
    told.says(
        "warning: a-file: the principal point of the left camera, (150.0, 87.9), is 13 % of the width from the middle of \
         images of 240 x 180",
    );
    told.says("add imageSize: [240, 180] if this is right");
    // No warning if the size is stated or the axis is near the centre.
    for text in [silent.replace("unit: m", "imageSize: [ 240, 180 ]"), silent.replace("150.0,", "121.4,")] {
        fs::remove_dir_all(folder.join("out")).unwrap();
        fs::write(folder.join("a-file"), text).unwrap();
        let told = rectify(&folder, "a-file").succeeded();
        assert!(!told.stderr.contains("warning"), "{}", told.stderr);
    }
}

/// Projections for images of another size.
#[test]
fn a_rectification_of_another_size_is_used_or_doubted() {
    let folder = Folder::new();
    let doubled = |numbers: &[f64]| numbers.iter().take(11).map(|v| 2.0 * v).chain([0.0]).collect::<Vec<_>>();
    let doubled = |numbers: &[f64]| {
        let mut numbers = doubled(numbers);
        numbers[10] = 1.0;
        numbers
    };
    let text = with_numbers(&with_numbers(&stored(), "P1", doubled), "P2", doubled);
    fs::write(folder.join("silent"), &text).unwrap();
    fs::write(folder.join("stated"), text.replace("unit: m", "unit: m\nnewImageSize: [ 480, 360 ]")).unwrap();
    let told = rectify(&folder, "stated").succeeded();
    told.says("480 x 360, 98.");
    assert!(!told.stderr.contains("warning"), "{}", told.stderr);
    let calib = fs::read_to_string(folder.join("out/calib.txt")).unwrap();
    assert!(calib.contains("width=480\nheight=360\n"), "{calib}");
    fs::remove_dir_all(folder.join("out")).unwrap();
    let told = rectify(&folder, "silent").succeeded();
    told.says("warning: silent: shows the middle of the images at (2");
    told.says("in rectified views of 240 x 180 & newImageSize: [4");
    // A newly computed rectification has the size of the images.
    fs::remove_dir_all(folder.join("out")).unwrap();
    run(&folder, "rectify @raw/left.png @raw/right.png out --calib stated --alpha 0")
        .succeeded()
        .says("240 x 180");
}

/// Cameras that look past each other.
#[test]
fn an_empty_view_is_reported() {
    let folder = Folder::new();
    fs::write(folder.join("a-file"), turned(&opencv(), "R", 70.0)).unwrap();
    rectify(&folder, "a-file")
        .failed(1, "a-file & view of which only & % shows the image & check its rotations");
}

/// KITTI's `calib_cam_to_cam.txt` for the cameras of `testdata/raw` as colour cameras, away from camera 0.
fn kitti() -> String {
    let row = |name: &str, numbers: &[f64]| {
        let numbers = numbers.iter().map(|v| format!("{v:.15e}")).collect::<Vec<_>>();
        format!("{name}: {}\n", numbers.join(" "))
    };
    let of = |text: &str, name: &str| {
        let found = std::cell::RefCell::new(Vec::new());
        with_numbers(text, name, |numbers| {
            *found.borrow_mut() = numbers.to_vec();
            numbers.to_vec()
        });
        found.into_inner()
    };
    let text = stored();
    let [r, t] = ["R", "T"].map(|name| of(&text, name));
    // Camera 2 looks along the x axis of camera 0, half a metre away.
    let (turn, moved) = ([0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], [0.5, 0.25, -0.125]);
    let r3: Vec<f64> = (0..9).map(|i| (0..3).map(|k| r[i / 3 * 3 + k] * turn[3 * k + i % 3]).sum()).collect();
    let t3: Vec<f64> = (0..3).map(|i| t[i] + (0..3).map(|k| r[3 * i + k] * moved[k]).sum::<f64>()).collect();
    let mut out = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n".to_owned();
    for (i, (rotation, translation)) in [(turn.to_vec(), moved.to_vec()), (r3, t3)].into_iter().enumerate() {
        let (n, camera) = (i + 1, i + 2);
        let name = |stem: &str| format!("{stem}_0{camera}");
        out += &row(&name("S"), &[240.0, 180.0]);
        out += &row(&name("K"), &of(&text, &format!("K{n}")));
        out += &row(&name("D"), &of(&text, &format!("D{n}")));
        out += &row(&name("R"), &rotation);
        out += &row(&name("T"), &translation);
        out += &row(&name("S_rect"), &[240.0, 180.0]);
        out += &row(&name("R_rect"), &of(&text, &format!("R{n}")));
        // The origin is camera 0, which is not in the image plane either.
        let mut p = of(&text, &format!("P{n}"));
        let (f, cx, cy, z) = (p[0], p[2], p[6], 0.003);
        p[3] += 0.06 * f + cx * z;
        p[7] += 0.001 * f + cy * z;
        p[11] = z;
        out += &row(&name("P_rect"), &p);
    }
    out
}

/// Whether two folders contain rectified pairs that only differ by rounding of their calibrations.
pub(super) fn alike(a: &Path, b: &Path, what: &str) {
    for file in ["im0.png", "im1.png"] {
        let [a, b] = [a, b].map(|folder| image::open(folder.join(file)).unwrap().into_rgba8());
        assert_eq!(a.dimensions(), b.dimensions(), "{what}");
        let pixels = a.pixels().zip(b.pixels());
        let differ = pixels.filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1)).count();
        assert!(differ < 20, "{what}: {differ} pixels of {file}");
    }
    let numbers = |folder: &Path| -> Vec<f64> {
        let text = fs::read_to_string(folder.join("calib.txt")).unwrap();
        text.split(['=', '[', ' ', ';', ']', '\n']).filter_map(|word| word.parse().ok()).collect()
    };
    let (a, b) = (numbers(a), numbers(b));
    let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6 * (1.0 + a.abs());
    assert!(a.len() == b.len() && a.iter().zip(&b).all(close), "{what}: {a:?}, {b:?}");
}

#[test]
fn kitti_is_read() {
    let folder = Folder::new();
    fs::write(folder.join("opencv"), stored()).unwrap();
    fs::write(folder.join("kitti"), kitti()).unwrap();
    for name in ["opencv", "kitti"] {
        run(&folder, &format!("rectify @raw/left.png @raw/right.png {name}.out --calib {name}")).succeeded();
    }
    alike(&folder.join("opencv.out"), &folder.join("kitti.out"), "kitti");
    for (from, to, words) in [
        ("P_rect_03", "P_rect_04", "P3 is missing"),
        ("S_rect_03: 2.4", "S_rect_03: 2.5", "S_rect_03: expected the size that camera 2 has"),
        ("S_03: 2.4", "S_03: 2.5", "S_03: expected the size that camera 2 has"),
        ("D_03", "D_3", "D_03 is missing"),
        ("calib_time", "pair: blue\ncalib_time", "pair: expected grey (cameras 0 and 1) or colour"),
        ("calib_time", "pair: grey\ncalib_time", "P0 is missing"),
        ("R_rect_03", "R_rect_05", "that contradicts R by"),
        ("T_03: ", "T_03: 1 ", "T_03: expected 3 numbers"),
    ] {
        fs::write(folder.join("a-file"), kitti().replace(from, to)).unwrap();
        rectify(&folder, "a-file").failed(1, &format!("a-file & {words}"));
    }
}

#[test]
fn other_files_are_not_taken_for_a_calibration() {
    let folder = Folder::new();
    let (keys, elements) = ((0..2000).map(|n| format!("k{n}: 1\n")), (0..2000).map(|n| format!("<k{n}/>")));
    let (deep, lists) = (("<b>".repeat(2000), "</b>".repeat(2000)), ("[".repeat(40), "]".repeat(40)));
    let wrong = [
        ("empty", "".into(), "is empty"),
        ("words", "some words\n".into(), "expected the entries of OpenCV"),
        ("list", "- 1\n- 2\n".into(), "expected the entries of OpenCV"),
        ("lists", "[".repeat(100_000).into_bytes(), "is no calibration of a known form"),
        ("nested", format!("---\n{}1{}", lists.0, lists.1).into_bytes(), "too many levels"),
        ("groups", format!("<a>{}", "<b>".repeat(20_000)).into_bytes(), "is no XML"),
        ("deep", format!("<a>{}{}</a>", deep.0, deep.1).into_bytes(), "too many levels"),
        ("keys", format!("---\n{}", keys.collect::<String>()).into_bytes(), "too many entries"),
        ("elements", format!("<a>{}</a>", elements.collect::<String>()).into_bytes(), "too many entries"),
        ("bytes", vec![0, 159, 146, 150, 10], "bytes that are not text"),
        ("large", vec![b' '; (1 << 20) + 1], "larger than any calibration file"),
        ("half", "cam0=[100 0 30; 0 100 20; 0 0 1]\n".into(), "K1, D1, K2 and D2"),
        ("left", ros("0").into_bytes(), "of one camera & the other one too"),
    ];
    for (name, bytes, _) in &wrong {
        fs::write(folder.join(name), bytes).unwrap();
    }
    fs::write(folder.join("opencv"), opencv()).unwrap();
    let before = listing(&folder);
    let more = [
        ("none", "none & no such file"),
        ("left left", "left & expected focal length times baseline"),
        ("left words", "words & does not belong"),
        ("opencv opencv opencv", "opencv & is not needed: opencv is a whole calibration (read as OpenCV's)"),
        ("opencv opencv opencv opencv", "opencv & one too many"),
    ];
    let wrong = wrong.map(|(name, _, words)| (name, format!("{name} & {words}")));
    for (files, words) in wrong.into_iter().chain(more.map(|(files, words)| (files, words.to_owned()))) {
        rectify(&folder, files).failed(1, &words);
        assert!(listing(&folder) == before, "{files}");
    }
}

/// Every command with a calibration refuses other files; `tests/calibrations` of the library has many more cases.
#[test]
fn every_command_refuses_files_without_a_calibration() {
    let folder = Folder::new();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    write("readme.md", b"# Stereo\n\nIt matches.\n");
    write("words.txt", b"hello world\n");
    write("key_value.txt", b"abc=1\n");
    write("typo.txt", b"ndips=48\n");
    write("twice.txt", b"ndisp=48\nndisp=64\n");
    write("K1.npy", b"\x93NUMPY\x01\0");
    fs::create_dir(folder.join("folder")).unwrap();
    let before = listing(&folder);
    let (raw, end) = ("@raw/left.png @raw/right.png", "--max-disparity 31");
    for (files, words) in [
        ("@raw/left.png", "left.png: is a PNG image, not a calibration"),
        ("readme.md", "readme.md: is no calibration of a known form"),
        ("words.txt", "words.txt: is no calibration of a known form"),
        ("key_value.txt", "key_value.txt: is no calibration of a known form"),
        ("typo.txt", "typo.txt: line 1: `ndips`: is no entry of a calib.txt; ndisp may be meant"),
        ("twice.txt", "twice.txt: line 2: ndisp: is there twice; keep one"),
        ("K1.npy", "K1.npy: is one array of numpy & np.savez"),
        ("folder", "folder: is a folder"),
        ("@raw/cameras.yml words.txt", "words.txt: is not needed & cameras.yml is a whole calibration"),
        ("words.txt @raw/cameras.yml", "words.txt: is not needed & cameras.yml is a whole calibration"),
        (
            "@raw/cameras.yml @mixed/calib.txt",
            "cameras.yml: is not needed & calib.txt is a whole calibration",
        ),
    ] {
        let calib = calib(files);
        for line in [
            format!("match {raw} d.pfm {end}{calib}"),
            format!("match {raw} d.pfm {end} --rectify{calib}"),
            format!("rectify {raw} out{calib}"),
            format!("inspect {raw} out {end}{calib}"),
        ] {
            let run = run(&folder, &line);
            run.failed(1, words);
            assert!(listing(&folder) == before, "{line}: no output");
        }
    }
    // Control: the calibration alone is accepted.
    run(&folder, &format!("rectify {raw} out{}", calib("@raw/cameras.yml"))).succeeded();
}

/// A calib.txt beside the left image is treated like one given by --calib, in any format.
#[test]
fn a_calibration_beside_the_images_may_have_any_form() {
    let folder = Folder::new();
    for view in ["im0.png", "im1.png"] {
        fs::copy(scene("slanted").join(view), folder.join(view)).unwrap();
    }
    let line = "match im0.png im1.png d.pfm --max-disparity 31 --also depth-mm";
    let depths = |text: &str| {
        fs::write(folder.join("calib.txt"), text).unwrap();
        run(&folder, line).succeeded();
        fs::read(folder.join("d.depth-mm.png")).unwrap()
    };
    let middlebury = depths("cam0=[215.5 0 118.5; 0 215.5 89.5; 0 0 1]\ndoffs=0\nbaseline=160\n");
    let row =
        |n: usize, tx: &str| format!("P{n}: 2.155e+02 0 1.185e+02 {tx} 0 2.155e+02 8.95e+01 0 0 0 1 0\n");
    assert!(depths(&(row(0, "0") + &row(1, "-34.48"))) == middlebury);
    // Control: another baseline gives other depths.
    assert!(depths(&(row(0, "0") + &row(1, "-30"))) != middlebury);
    for (text, words) in [("some words\n", "is no calibration of a known form"), ("", "is empty")] {
        fs::write(folder.join("calib.txt"), text).unwrap();
        run(&folder, line).failed(1, &format!("calib.txt & {words}"));
        run(&folder, "depth d.pfm e.pfm --also depth").failed(1, &format!("calib.txt & {words}"));
    }
}

/// A focal length and a baseline replace a calibration.
#[test]
fn numbers_replace_a_calibration() {
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
    // Control: another baseline gives other depths.
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
    run.says("unit: same as --baseline");
    assert!(run.json()["files"]["calibration"].is_null());
}
