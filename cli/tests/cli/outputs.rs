//! What `mrfgs match` and `mrfgs evaluate` write besides maps and figures: depth, JSON, pictures, submissions.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use mrfgs::image::{Plane, pfm, read};
use mrfgs::maps::{flag, has_disparity};
use mrfgs::options::Method;
use serde_json::Value;

use super::{Folder, has_gpu, listing, program, run, scene, scene_file, started, workshop};

/// Focal length and baseline of the scenes of 240 x 180 pixels and 32 labels, and the middle of their images.
pub(super) const FOCAL_LENGTH: f64 = 180.0;
pub(super) const BASELINE: f64 = 0.95 * 31.0 / 180.0;
pub(super) const MIDDLE: [f64; 2] = [119.5, 89.5];

/// Matches a scene in `folder`; what it says on standard error.
pub(super) fn matched(folder: &Path, name: &str, more: &[&str]) -> String {
    let (left, right) = (scene_file(name, "im0.png"), scene_file(name, "im1.png"));
    let told = run(folder, &[&["match", &left, &right], more, &["--device cpu"]].concat()).succeeded();
    told.stderr
}

pub(super) fn map(path: impl AsRef<Path>) -> Plane<f32> {
    let pfm::Pfm::Grey(map) = pfm::read(path.as_ref()).unwrap() else { panic!("one channel") };
    map
}

fn json(path: impl AsRef<Path>) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The largest relative error of `depths` against baseline * f / (d + doffs); infinite where one of the two has a pixel that
/// the other should not have.
fn depth_error(depths: &Plane<f32>, disparities: &Plane<f32>, doffs: f64) -> f64 {
    assert_eq!(depths.size(), disparities.size());
    let pairs = depths.data().iter().zip(disparities.data());
    let errors = pairs.map(|(&z, &d)| {
        let apart = f64::from(d) + doffs;
        match (z.is_finite(), d.is_finite() && apart > 0.0) {
            (true, true) => (f64::from(z) * apart / (BASELINE * FOCAL_LENGTH) - 1.0).abs(),
            (false, false) => 0.0,
            _ => f64::INFINITY,
        }
    });
    errors.fold(0.0, f64::max)
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn depth_is_that_of_the_cameras() {
    let folder = Folder::new();
    let said = matched(&folder, "repetitive", &["d.pfm", "--also", "depth", "--set", "fill=none"]);
    let told = said.lines().find(|line| line.contains("depths ")).unwrap();
    assert!(told.contains("unit: that of the baseline in ") && told.ends_with("calib.txt"), "{told}");
    let (disparities, depths) = (map(folder.join("d.pfm")), map(folder.join("d.depth.pfm")));
    assert!(depth_error(&depths, &disparities, 0.0) < 1e-6);
    assert!(depth_error(&depths, &disparities, 0.1) > 1e-3, "the comparison sees a tenth of a pixel");
    assert!(depths.data().contains(&f32::INFINITY), "what has no disparity has no depth");

    // The wall behind is parallel to the images, at depth 2.8.
    let truth = map(scene("repetitive").join("disp0GT.pfm"));
    let wall = (BASELINE * FOCAL_LENGTH / 2.8) as f32;
    let known =
        depths.data().iter().zip(truth.data()).filter(|(z, t)| z.is_finite() && t.total_cmp(&wall).is_eq());
    let known: Vec<f64> = known.map(|(z, _)| f64::from(*z)).collect();
    assert!(known.len() > 1000, "{} pixels", known.len());
    assert!((median(known.clone()) - 2.8).abs() < 0.02, "{}", median(known));
}

/// How many percent of the pixels of `left` find their own disparity in `right`, moved by it, to a pixel.
fn agreement(left: &Plane<f32>, right: &Plane<f32>) -> usize {
    let (width, height) = left.size();
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let agree = places.filter(|&(x, y)| {
        let there = x as f32 - left[(x, y)].round();
        there >= 0.0 && (right[(there as usize, y)] - left[(x, y)]).abs() <= 1.0
    });
    100 * agree.count() / (width * height)
}

#[test]
fn the_right_map_is_that_of_the_right_view() {
    let folder = Folder::new();
    for more in [&[][..], &["--set left-right-check=off"], &["--memory 24MiB"]] {
        matched(&folder, "mixed", &[&["d.pfm", "--also", "right"], more].concat());
        let [left, right] = ["d.pfm", "d.right.pfm"].map(|file| map(folder.join(file)));
        assert_eq!(left.size(), right.size());
        assert!(agreement(&left, &right) > 85, "{more:?}: {}", agreement(&left, &right));
        // Controls: the same map does not agree with itself, nor with the right view's in a mirror.
        assert!(agreement(&left, &left) < 75, "{more:?}: {}", agreement(&left, &left));
        assert!(
            agreement(&left, &right.mirrored()) < 75,
            "{more:?}: {}",
            agreement(&left, &right.mirrored())
        );
        // In one piece and in tiles, and with the views exchanged in a mirror, there is a value everywhere.
        assert!(right.data().iter().all(|d| d.is_finite()), "{more:?}");
    }
}

#[test]
fn offset_principal_points_move_the_depth() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let calib = fs::read_to_string(scene("slanted").join("calib.txt")).unwrap();
    for doffs in [2.5, -12.0] {
        fs::write(at("other.txt"), calib.replace("doffs=0", &format!("doffs={doffs}"))).unwrap();
        let args = ["--calib other.txt --quiet --also depth"];
        matched(&folder, "slanted", &[&args[..], &["d.pfm"]].concat());
        matched(&folder, "slanted", &[&args[..], &["d.tif"]].concat());
        let (disparities, depths) = (map(at("d.pfm")), map(at("d.depth.pfm")));
        assert!(depth_error(&depths, &disparities, doffs) < 1e-6, "{doffs}");
        let beyond = depths.data().iter().filter(|z| !z.is_finite()).count();
        assert_eq!(beyond > 1000, doffs < 0.0, "{beyond} pixels are at infinity or beyond");
        assert!(disparities.data().iter().all(|d| d.is_finite()), "the map is what it was");
        let bytes = fs::read(at("d.depth.tif")).unwrap();
        let mut decoder = tiff::decoder::Decoder::new(std::io::Cursor::new(bytes)).unwrap();
        let tiff::decoder::DecodingResult::F32(values) = decoder.read_image().unwrap() else {
            panic!("float")
        };
        let same = |(a, b): (&f32, &f32)| if b.is_finite() { a.total_cmp(b).is_eq() } else { a.is_nan() };
        assert!(values.iter().zip(depths.data()).all(same), "NaN in TIFF, +inf in PFM");
    }
}

#[test]
fn a_calibration_file_elsewhere_gives_the_range() {
    let folder = workshop();
    let told = run(&folder, &["match left.png right.png out.pfm --calib camera/calib.txt"]).succeeded();
    assert!(told.stderr.contains(", 17 labels, "), "{told:?}");
    // It may hold less than depth takes, as long as nobody asks for depth.
    run(&folder, &["match left.png right.png out.pfm --max-disparity 9 --calib half/calib.txt"]).succeeded();
}

#[test]
fn the_pictures_of_the_guide_are_those_of_its_commands() {
    let folder = Folder::new();
    matched(&folder, "mixed", &["d.pfm", "--also", "preview,points"]);
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    super::render_cloud::run(&[at("d.points.ply"), at("cloud.png")]).unwrap();
    // The sines of another system may put a point into the next pixel.
    for (made, name, most) in
        [("d.preview.png", "disparity.png", 0), ("cloud.png", "cloud.png", 640 * 480 / 1000)]
    {
        let [made, shown] =
            [at(made), scene_file("mixed", name)].map(|path| image::open(path).unwrap().to_rgb8());
        assert_eq!(made.dimensions(), shown.dimensions());
        let others = made.pixels().zip(shown.pixels()).filter(|(made, shown)| made != shown).count();
        assert!(others <= most, "{name} is another picture now, in {others} pixels; replace it");
    }
}

#[test]
fn json_tells_what_ran_and_what_came_of_it() {
    let folder = workshop();
    let at = |name: &str| folder.join(name);
    let args = ["match left.png right.png out.pfm --calib camera/calib.txt --device cpu"];
    let args = [&args[..], &["--mask flat-mask.png --also confidence,validity"]].concat();
    let mask = image::GrayImage::from_fn(60, 40, |x, _| image::Luma([u8::from(x < 6)]));
    mask.save(at("flat-mask.png")).unwrap();
    let told = run(&folder, &[&args[..], &["--json m.json --threads 1"]].concat()).succeeded();
    assert_eq!(told.stdout, "");
    let found = json(at("m.json"));
    let text = fs::read_to_string(at("m.json")).unwrap();
    assert!(text.ends_with("}\n"));

    assert_eq!(found["version"], env!("CARGO_PKG_VERSION"));
    let files = &found["files"];
    for (key, file) in [
        ("left", "left.png"),
        ("right", "right.png"),
        ("mask", "flat-mask.png"),
        ("calibration", "camera/calib.txt"),
        ("output", "out.pfm"),
    ] {
        assert_eq!(files[key], file);
    }
    assert_eq!([&found["width"], &found["height"], &found["labels"]], [60, 40, 17]);
    assert_eq!([&found["range"]["min"], &found["range"]["max"]], [0, 16]);
    assert_eq!(found["method"], serde_json::to_value(Method::default()).unwrap());
    assert_eq!(found["ran_on"], "the CPU path, 1 thread");
    assert_eq!([&found["driver"], &found["note"]], [&Value::Null; 2]);
    assert_eq!([&found["tiles"], &found["iterations"]], [1, 16]);
    let seconds = found["seconds"].as_f64().unwrap();
    assert!(seconds > 0.0 && told.stderr.contains(&format!("in {seconds:.2} s")), "{}", told.stderr);
    assert!(found["stages"].is_null(), "the time of stages is for `inspect`");

    // Shares of all pixels, in percent.
    let (validity, confidence) =
        (read::grey8(&at("out.validity.png")).unwrap(), read::grey8(&at("out.confidence.png")).unwrap());
    let share = |of: &dyn Fn(u8) -> bool| {
        100.0 * validity.data().iter().filter(|&&v| of(v)).count() as f64 / (60.0 * 40.0)
    };
    let filled = |v: u8| v & flag::FILLED != 0;
    let measured = |v: u8| has_disparity(v) && !filled(v);
    let sure: Vec<f64> = validity
        .data()
        .iter()
        .zip(confidence.data())
        .filter(|(v, _)| measured(**v))
        .map(|(_, c)| f64::from(*c))
        .collect();
    for (key, expected) in [
        ("density", 90.0),
        ("measured", share(&measured)),
        ("filled", share(&filled)),
        ("mean_confidence", sure.iter().sum::<f64>() / sure.len() as f64),
    ] {
        assert!((found[key].as_f64().unwrap() - expected).abs() < 1e-9, "{key}: {} {expected}", found[key]);
    }
    assert!(share(&measured) > 20.0 && share(&filled) > 1.0, "neither is nothing");

    // Printed, standard output holds nothing else.
    let told = run(&folder, &[&args[..], &["--json -"]].concat()).succeeded();
    let printed = told.json();
    assert_eq!(printed["measured"], found["measured"]);
    let inspect = ["inspect left.png right.png --calib camera/calib.txt --device cpu"];
    let inspect = [&inspect[..], &["--mask flat-mask.png --json -"]].concat();
    let printed = run(&folder, &inspect).succeeded().json();
    assert_eq!((&printed["measured"], &printed["files"]["output"]), (&found["measured"], &Value::Null));
    let stages = printed["stages"].as_object().unwrap();
    assert!(stages["flood, level 0"].as_f64().unwrap() > 0.0, "{stages:?}");
    let sum: f64 = stages.values().map(|ms| ms.as_f64().unwrap()).sum();
    assert!(sum < 1000.0 * printed["seconds"].as_f64().unwrap());

    // A device has a driver.
    if has_gpu() {
        let args = ["match left.png right.png out.pfm --max-disparity 9 --device gpu"];
        let told = run(&folder, &[&args[..], &["--json -"]].concat()).succeeded();
        let (found, listed) = (told.json(), run(&folder, &["devices"]).succeeded().stdout);
        assert!(told.stderr.contains(&format!(" on {}", found["ran_on"].as_str().unwrap())), "{told:?}");
        let driver = found["driver"].as_str().unwrap();
        assert!(!driver.is_empty() && listed.contains(&format!("| {driver} ")), "{driver} in {listed}");
    }

    // A map without a pixel has no confidence.
    let all = image::GrayImage::from_pixel(60, 40, image::Luma([1]));
    all.save(at("flat-mask.png")).unwrap();
    let none = run(&folder, &[&args[..], &["--json -"]].concat()).succeeded().json();
    assert_eq!([&none["density"], &none["mean_confidence"]], [&Value::from(0.0), &Value::Null]);
}

#[test]
fn the_colours_of_a_preview_can_be_chosen() {
    let folder = workshop();
    let picture = |name: &str, more: &[&str]| {
        let args = ["match left.png right.png out.pfm --max-disparity 15 --quiet"];
        run(&folder, &[&args[..], &["--also", name], more].concat()).succeeded();
        image::open(folder.join(format!("out.{name}.png"))).unwrap().into_rgb8()
    };
    let usual = picture("preview", &[]);
    assert_eq!(usual, picture("preview", &["--colours turbo"]));
    let [viridis, grey] = ["viridis", "grey"].map(|name| picture("preview", &["--colours", name]));
    assert!(usual != viridis && viridis != grey && usual != grey);
    let even = |p: &image::Rgb<u8>| p.0[0] == p.0[1] && p.0[1] == p.0[2];
    assert!(grey.pixels().all(even) && !viridis.pixels().all(even));

    let both = picture("side-by-side", &["--colours viridis"]);
    assert_eq!(both.dimensions(), (2 * 60, viridis.height()));
    let left = image::open(folder.join("left.png")).unwrap().into_rgb8();
    for (x, y, pixel) in both.enumerate_pixels() {
        let expected = match (x < 60, y < 40) {
            (true, true) => *left.get_pixel(x, y),
            (true, false) => image::Rgb([0; 3]),
            _ => *viridis.get_pixel(x - 60, y),
        };
        assert_eq!(*pixel, expected, "{x}, {y}");
    }
}

#[test]
fn png_holds_disparities_as_kitti_reads_them() {
    let folder = workshop();
    let mask = image::GrayImage::from_fn(60, 40, |x, y| image::Luma([u8::from(x < 5 && y > 30)]));
    mask.save(folder.join("mask.png")).unwrap();
    // A pair of the same image twice is at infinity: disparity 0, but valid.
    for (right, most) in [("right.png", 15), ("left.png", 3)] {
        for output in ["out.pfm", "out.png"] {
            let args = ["match left.png", right, output, "--mask mask.png --quiet --max-disparity"];
            run(&folder, &[&args[..], &[&most.to_string()]].concat()).succeeded();
        }
        let disparities = map(folder.join("out.pfm"));
        let png = image::open(folder.join("out.png")).unwrap();
        assert_eq!(png.color(), image::ColorType::L16);
        let png = png.into_luma16();
        for (x, y, level) in png.enumerate_pixels() {
            let (d, level) = (disparities[(x as usize, y as usize)], level.0[0]);
            assert_eq!(d.is_finite(), level > 0, "{x}, {y}: 0 is invalid and nothing else is");
            assert_eq!(level == 0, x < 5 && y > 30);
            // KITTI divides by 256.
            assert!(
                level == 0 || (f32::from(level) / 256.0 - d).abs() <= 1.0 / 256.0,
                "{x}, {y}: {level}, {d}"
            );
        }
        let nearly_none = png.pixels().filter(|level| level.0[0] == 1).count();
        assert_eq!(nearly_none > 2000, right == "left.png", "{nearly_none} are 1/256");
    }
}

#[test]
fn standard_output_takes_the_map_and_nothing_else() {
    let folder = workshop();
    run(&folder, &["match left.png right.png out.pfm --max-disparity 9"]).succeeded();
    let before = listing(&folder);
    let output =
        started(&folder, &["match left.png right.png - --max-disparity 9"]).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout == fs::read(folder.join("out.pfm")).unwrap(), "the bytes of the file");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("60 x 40, 10 labels"), "{said}");
    assert!(listing(&folder) == before);
}

#[cfg(target_os = "linux")]
#[test]
fn a_map_that_does_not_reach_its_reader_is_a_failure() {
    let folder = workshop();
    let before = listing(&folder);
    for (closed, words) in [(true, "its reader left"), (false, "No space left")] {
        let stdout = if closed {
            Stdio::piped()
        } else {
            fs::OpenOptions::new().write(true).open("/dev/full").unwrap().into()
        };
        let line = "match left.png right.png - --max-disparity 9 --quiet --json m.json";
        let mut child = program(&folder, &[line], &[]).stdout(stdout).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("standard output") && said.contains(words), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(listing(&folder) == before, "{words}: something is left");
    }
}

#[test]
fn submissions_have_the_layout_of_the_benchmark() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let dirs = ["slanted", "thin"].map(|name| scene(name).to_str().unwrap().to_owned());
    let args = ["--device cpu --json a.json"];
    let submitted = |to: [&str; 2], more: &[&str]| {
        let pairs = ["evaluate submission", to[0], to[1], &dirs[0], &dirs[1]];
        run(&folder, &[&pairs, &args[..], more].concat()).succeeded();
    };
    // A folder that is there and empty will do.
    fs::create_dir(at("trainingQ")).unwrap();
    submitted(["trainingQ", "MR-FGS_2"], &[]);
    submitted(["sparse", "X"], &["--set fill=none"]);
    let names: Vec<_> = listing(&folder).into_keys().collect();
    let mut expected = vec![at("a.json"), at("sparse"), at("trainingQ")];
    for pair in ["slanted", "thin"] {
        expected.extend([at("trainingQ").join(pair), at("sparse").join(pair)]);
        expected
            .extend(["disp0MR-FGS_2.pfm", "timeMR-FGS_2.txt"].map(|f| at("trainingQ").join(pair).join(f)));
        expected.extend(["disp0X_s.pfm", "timeX.txt"].map(|f| at("sparse").join(pair).join(f)));
    }
    expected.sort();
    assert_eq!(names, expected);

    let figures = json(at("a.json"));
    for (i, pair) in ["slanted", "thin"].into_iter().enumerate() {
        matched(&folder, pair, &["d.pfm", "--quiet"]);
        let [dense, sparse] = [("trainingQ", "MR-FGS_2"), ("sparse", "X_s")]
            .map(|(dir, method)| fs::read(at(dir).join(pair).join(format!("disp0{method}.pfm"))).unwrap());
        assert!(dense == fs::read(at("d.pfm")).unwrap(), "{pair}: the map of a match");
        matched(&folder, pair, &["d.pfm", "--quiet", "--set", "fill=none"]);
        assert!(
            sparse == fs::read(at("d.pfm")).unwrap() && sparse != dense,
            "{pair}: the map without a fill"
        );
        assert!(map(at("d.pfm")).data().contains(&f32::INFINITY));
        let time = fs::read_to_string(at("sparse").join(pair).join("timeX.txt")).unwrap();
        let seconds = figures["pairs"][i]["seconds"].as_f64().unwrap();
        assert!(seconds > 0.0 && time == format!("{seconds:.3}\n"), "{time} and {seconds}");
    }
}
