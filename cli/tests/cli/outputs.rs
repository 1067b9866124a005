//! Outputs of `mrfgs match` and `mrfgs evaluate` besides maps and figures: depth, JSON, pictures, submissions.

use mrfgs::maps::{flag, has_disparity};
use mrfgs::options::Method;

use super::*;

/// Focal length and baseline of the scenes of 240 x 180 pixels and 32 labels, and the centre of their images.
pub(super) const FOCAL_LENGTH: f64 = 180.0;
pub(super) const BASELINE: f64 = 0.95 * 31.0 / 180.0;
pub(super) const MIDDLE: [f64; 2] = [119.5, 89.5];

/// Matches a scene in `folder` and returns the messages.
pub(super) fn matched(folder: &Path, name: &str, more: &str) -> String {
    run(folder, &format!("match @{name}/im0.png @{name}/im1.png {more} --device cpu")).succeeded().stderr
}

/// The largest relative error of `depths` against baseline * f / (d + doffs); infinite if they differ in which pixels are known.
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
fn depth_follows_from_the_cameras() {
    let folder = Folder::new();
    let said = matched(&folder, "repetitive", "d.pfm --also depth --set fill=none");
    let told = said.lines().find(|line| line.contains("depths ")).unwrap();
    assert!(told.contains("unit: m, from ") && told.ends_with("calib.txt"), "{told}");
    let (disparities, depths) = (read_pfm(folder.join("d.pfm")), read_pfm(folder.join("d.depth.pfm")));
    assert!(depth_error(&depths, &disparities, 0.0) < 1e-6);
    assert!(depth_error(&depths, &disparities, 0.1) > 1e-3, "the comparison detects a tenth of a pixel");
    assert!(depths.data().contains(&f32::INFINITY), "no depth without a disparity");

    // The back wall is parallel to the image plane, at depth 2.8.
    let truth = read_pfm(scene("repetitive/disp0GT.pfm"));
    let wall = (BASELINE * FOCAL_LENGTH / 2.8) as f32;
    let known =
        depths.data().iter().zip(truth.data()).filter(|(z, t)| z.is_finite() && t.total_cmp(&wall).is_eq());
    let known: Vec<f64> = known.map(|(z, _)| f64::from(*z)).collect();
    assert!(known.len() > 1000, "{} pixels", known.len());
    assert!((median(known.clone()) - 2.8).abs() < 0.02, "{}", median(known));
}

/// Each measured pixel has an error, which falls with its confidence; its depth error follows from the cameras.
#[test]
fn errors_follow_from_confidence_and_cameras() {
    let folder = Folder::new();
    let named = |name: &str, end: &str| read_pfm(folder.join(format!("{name}.{end}")));
    let also = "--also depth,sigma,depth-sigma,confidence,validity";
    matched(&folder, "slanted", &format!("d.pfm {also}"));
    let [map, depths, sigmas, of_depths] =
        ["pfm", "depth.pfm", "sigma.pfm", "depth-sigma.pfm"].map(|end| named("d", end));
    let [confidence, validity] =
        ["confidence", "validity"].map(|word| read::grey8(&folder.join(format!("d.{word}.png"))).unwrap());
    let mut by_confidence = BTreeMap::new();
    let mut filled = 0;
    for at in (0..180).flat_map(|y| (0..240).map(move |x| (x, y))) {
        let (sigma, of_depth) = (sigmas[at], of_depths[at]);
        if validity[at] & flag::INVALID != 0 {
            assert!(sigma.is_infinite() && of_depth.is_infinite());
            filled += 1;
            continue;
        }
        assert!(by_confidence.entry(confidence[at]).or_insert(sigma).total_cmp(&sigma).is_eq());
        let expected = depths[at] * sigma / map[at];
        assert!((of_depth / expected - 1.0).abs() < 1e-5, "{of_depth} and {expected}");
    }
    assert!(filled > 1000 && by_confidence.len() > 40, "{filled}, {}", by_confidence.len());
    let sigmas: Vec<f32> = by_confidence.into_values().collect();
    assert!(sigmas.is_sorted_by(|a, b| a >= b) && sigmas[0] > 4.0 * sigmas[sigmas.len() - 1], "{sigmas:?}");

    // `fast` has another scale of confidence. TIFF output stays TIFF, and limits apply.
    matched(&folder, "slanted", "fast.tif --method fast --also sigma --min-confidence 20 --quiet");
    let known = |map: &Plane<f32>| map.data().iter().filter(|v| v.is_finite()).count();
    let (map, sigmas) = (read_tiff(folder.join("fast.tif")), read_tiff(folder.join("fast.sigma.tif")));
    assert_eq!(known(&map), known(&sigmas));
    assert!(known(&sigmas) > 5000 && sigmas.data().iter().all(|v| !v.is_finite() || *v < 0.4));
    matched(&folder, "slanted", &format!("near.pfm {also} --clip-depth 2 --quiet"));
    assert!(known(&named("near", "sigma.pfm")) == known(&named("near", "depth-sigma.pfm")));
    assert!(known(&named("near", "sigma.pfm")) + 500 < 240 * 180 - filled);

    let of_map = run(&folder, "depth d.pfm --calib @slanted/calib.txt --also sigma");
    of_map.failed(2, "--also sigma: can only be computed by a match, not from MAP");
    fs::copy(scene("slanted/im0.png"), folder.join("l.png")).unwrap();
    fs::copy(scene("slanted/im1.png"), folder.join("r.png")).unwrap();
    run(&folder, "match l.png r.png no.pfm --max-disparity 31 --also depth-sigma")
        .failed(2, "--also depth-sigma: needs camera values");
}

/// `depth` computes from a map what `match` writes beside it.
#[test]
fn depth_and_points_of_an_existing_map() {
    let folder = Folder::new();
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    let also = "--also depth,depth-mm,points,points.las,side-by-side";
    matched(&folder, "mixed", &format!("d.pfm {also},confidence --set fill=none --set confidence-floor=0"));
    fs::create_dir(folder.join("again")).unwrap();
    for file in ["d.pfm", "d.confidence.png"] {
        fs::copy(folder.join(file), folder.join("again").join(file)).unwrap();
    }
    let more = "--left @mixed/im0.png --calib @mixed/calib.txt --confidence again/d.confidence.png";
    let told = run(&folder, &format!("depth again/d.pfm {more} {also}")).succeeded();
    told.says("unit: m, from");
    for end in ["depth.pfm", "depth-mm.png", "points.ply", "points.las"] {
        assert!(bytes(&format!("d.{end}")) == bytes(&format!("again/d.{end}")), "{end}");
    }
    run(&folder, &format!("depth again/d.pfm other.tif {more} --quiet")).succeeded();
    assert!(
        read_tiff(folder.join("other.depth.tif")).data().iter().filter(|depth| depth.is_finite()).count()
            > 1000
    );
    // Limits, in `depth` and in `match`.
    run(
        &folder,
        &format!("depth again/d.pfm {more} --also depth,points --clip-depth 2 --min-confidence 60 --quiet"),
    )
    .succeeded();
    matched(
        &folder,
        "mixed",
        "near.pfm --also depth,points --clip-depth 2 --min-confidence 60 --set fill=none",
    );
    let (near, all) = (read_pfm(folder.join("near.depth.pfm")), read_pfm(folder.join("d.depth.pfm")));
    let confidence = read::grey8(&folder.join("d.confidence.png")).unwrap();
    let mut kept = 0;
    for ((near, all), confidence) in near.data().iter().zip(all.data()).zip(confidence.data()) {
        let is_kept = *all <= 2.0 && *confidence >= 60;
        assert!(if is_kept { near.total_cmp(all).is_eq() } else { near.is_infinite() }, "{all} {confidence}");
        kept += usize::from(is_kept);
    }
    assert!(
        kept > 5000 && kept < all.data().iter().filter(|depth| depth.is_finite()).count() - 5000,
        "{kept}"
    );
    assert!(bytes("near.depth.pfm") == bytes("again/d.depth.pfm"));
    assert!(bytes("near.points.ply") == bytes("again/d.points.ply"));
    assert!(bytes("near.points.ply").len() < bytes("d.points.ply").len());
    for (line, code, words) in [
        ("d.pfm", 2, "--calib & no calib.txt beside d.pfm"),
        ("d.pfm --calib @mixed/calib.txt --also points", 2, "--left & left image"),
        ("d.pfm --calib @mixed/calib.txt --also validity", 2, "--also validity & a match"),
        ("d.pfm --calib @mixed/calib.txt --min-confidence 9", 2, "--min-confidence & --confidence"),
        ("d.pfm nowhere/e.pfm --calib @mixed/calib.txt", 1, "nowhere"),
        ("d.pfm --calib @raw/cameras.yml", 1, "cameras.yml & not rectified"),
        (
            "d.pfm --calib @mixed/calib.txt --left @wall/im0.png --also points",
            1,
            "im0.png is 240 x 180 & d.pfm",
        ),
        ("none.pfm --calib @mixed/calib.txt", 1, "none.pfm"),
        ("d.points.ply --calib @mixed/calib.txt", 1, "d.points.ply"),
    ] {
        let before = listing(&folder);
        run(&folder, &format!("depth {line}")).failed(code, words);
        assert_eq!(listing(&folder), before, "{line}");
    }
    run(&folder, "match @mixed/im0.png @mixed/im1.png e.pfm --clip-depth 2")
        .failed(2, "--clip-depth & --also depth");
}

/// A map entirely behind the cameras is refused, a mostly hidden one causes a warning; both suggest the other sign.
#[test]
fn maps_behind_the_cameras_are_reported() {
    let folder = Folder::new();
    let map = |name: &str, disparity: &dyn Fn(usize) -> f32| {
        let rows: Vec<u8> = (0..320 * 240).flat_map(|i| disparity(i).to_le_bytes()).collect();
        fs::write(folder.join(name), [b"Pf\n320 240\n-1\n".as_slice(), &rows].concat()).unwrap();
    };
    map("sound.pfm", &|i| 5.0 + (i % 9) as f32);
    map("negative.pfm", &|i| -5.0 - (i % 9) as f32);
    map("mostly.pfm", &|i| if i % 3 == 0 { 5.0 } else { -5.0 });
    map("zero.pfm", &|_| 0.0);
    map("infinite.pfm", &|_| f32::INFINITY);
    map("nan.pfm", &|_| f32::NAN);
    let depth = |line: &str| run(&folder, &format!("depth {line} --calib @mixed/calib.txt"));
    let before = listing(&folder);
    for (line, words) in [
        ("negative.pfm", "negative.pfm & 76800 of 76800 & try --sign right-minus-left"),
        ("sound.pfm --sign right-minus-left", "sound.pfm & try --sign left-minus-right"),
        ("zero.pfm", "zero.pfm & behind the cameras & calibration"),
        ("infinite.pfm", "infinite.pfm & no disparity"),
        ("nan.pfm", "nan.pfm & no disparity"),
    ] {
        depth(line).failed(1, words);
        assert_eq!(listing(&folder), before, "{line}");
    }
    depth("mostly.pfm").succeeded().says("warning: mostly.pfm: 51200 of 76800 & try --sign right-minus-left");
    let sound = depth("sound.pfm").succeeded();
    assert!(!sound.stderr.contains("warning"), "{}", sound.stderr);
    // The suggested remedy gives the result of the original map.
    depth("negative.pfm --sign right-minus-left").succeeded();
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(bytes("negative.depth.pfm") == bytes("sound.depth.pfm"));
}

/// A match whose depths or points come out empty says why, and what helps.
#[test]
fn depths_that_come_out_empty() {
    let folder = Folder::new();
    let negative = "--min-disparity -31 --max-disparity -1";
    let front = "disparities lie behind the cameras";
    for (more, words) in [
        (
            format!("{negative} --also depth,points"),
            format!("warning: & {front} & try --sign right-minus-left, or swap the two images"),
        ),
        (
            format!("{negative} --sign left-minus-right --also points"),
            format!("{front} & try --sign right-minus-left"),
        ),
        (
            "--min-disparity 0 --max-disparity 0 --also depth".into(),
            format!("{front} & doffs, baseline & range"),
        ),
        (
            "--also depth,points --min-confidence 255 --max-disparity 31".into(),
            "warning: --min-confidence leaves no depths and no points: lower it".into(),
        ),
        (
            "--also points --clip-depth 0.01 --max-disparity 31".into(),
            "warning: --clip-depth leaves nothing, since the nearest depth is & raise it".into(),
        ),
    ] {
        let line = format!("match @slanted/im0.png @slanted/im1.png d.pfm --device cpu {more}");
        let said = run(&folder, &line).succeeded();
        said.says(&words);
        assert_eq!(
            said.stderr.matches("warning: --").count() + said.stderr.matches(front).count(),
            1,
            "{more}"
        );
        let quiet = run(&folder, &format!("{line} --quiet"));
        assert_eq!(quiet.succeeded().stderr, "", "{more}");
    }
    run(&folder, "match @slanted/im0.png @slanted/im1.png d.pfm --device cpu --max-disparity 31").succeeded();
    run(&folder, "depth d.pfm --calib @slanted/calib.txt --clip-depth 0.01")
        .succeeded()
        .says("warning: d.pfm: --clip-depth leaves nothing & raise it & depths of no pixel");
    // Control: what is in front of the cameras is no matter of a warning.
    let said = matched(&folder, "slanted", "d.pfm --max-disparity 31 --also depth,points");
    assert!(!said.contains("warning"), "{said}");
}

/// A range of depths is equivalent to one of disparities.
#[test]
fn ranges_may_be_depths() {
    let folder = Folder::new();
    let disparity = |depth: f64| BASELINE * FOCAL_LENGTH / depth;
    let (nearest, farthest) = (disparity(1.3).ceil(), disparity(2.9).floor());
    assert!(farthest > 5.0 && nearest > farthest + 5.0);
    matched(
        &folder,
        "repetitive",
        &format!("by-disparity.pfm --max-disparity {nearest} --min-disparity {farthest}"),
    );
    let said = matched(&folder, "repetitive", "by-depth.pfm --min-depth 1.3 --max-depth 2.9 --json d.json");
    assert!(said.contains(&format!("{} disparities", nearest - farthest + 1.0)), "{said}");
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(bytes("by-depth.pfm") == bytes("by-disparity.pfm"));
    // The opposite sign gives the same depths.
    matched(
        &folder,
        "repetitive",
        "other.pfm --min-depth 1.3 --max-depth 2.9 --sign right-minus-left --json o.json",
    );
    let range = |name: &str| json(folder.join(name))["range"].clone();
    assert_eq!(range("d.json")["max"].as_f64(), Some(nearest));
    assert_eq!(range("o.json")["min"].as_f64(), Some(-nearest));
    // With one end only, infinity has disparity 0 and the nearest depth comes from calib.txt.
    matched(&folder, "repetitive", "one.pfm --min-depth 1.3 --json one.json");
    assert_eq!(
        (range("one.json")["min"].as_f64(), range("one.json")["max"].as_f64()),
        (Some(0.0), Some(nearest))
    );
    matched(&folder, "repetitive", "end.pfm --max-depth 2.9 --json end.json");
    assert_eq!(range("end.json")["min"].as_f64(), Some(farthest));
    assert_ne!(range("end.json")["max"].as_f64(), Some(nearest));
    for (flags, code, words) in [
        ("--min-depth 3 --max-depth 2", 2, "--max-depth: 2 is nearer than --min-depth 3"),
        ("--min-depth -1", 2, "--min-depth & above 0"),
        ("--min-depth 2 --max-disparity 9", 2, "--min-depth & --max-disparity"),
        ("--min-depth 1e-9", 2, "--max-disparity"),
    ] {
        let pair = "@repetitive/im0.png @repetitive/im1.png no.pfm --device cpu";
        run(&folder, &format!("match {pair} {flags}")).failed(code, words);
    }
    fs::copy(scene("repetitive/im0.png"), folder.join("l.png")).unwrap();
    run(&folder, "match l.png @repetitive/im1.png no.pfm --min-depth 1")
        .failed(2, "--min-depth & calibration & --calib");
}

/// The percentage of pixels of `left` whose disparity in `right`, shifted by it, agrees to a pixel.
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
fn the_right_map_belongs_to_the_right_view() {
    let folder = Folder::new();
    for more in ["", "--set left-right-check=off", "--memory 24MiB"] {
        matched(&folder, "mixed", &format!("d.pfm --also right {more}"));
        let [left, right] = ["d.pfm", "d.right.pfm"].map(|file| read_pfm(folder.join(file)));
        assert_eq!(left.size(), right.size());
        // Controls: the left map agrees neither with itself nor with a mirrored right map.
        let [found, itself, mirror] = [&right, &left, &right.mirrored()].map(|map| agreement(&left, map));
        assert!(found > 85 && itself < 75 && mirror < 75, "{more}: {found}, {itself}, {mirror}");
        // Whole or in tiles, and with mirrored and swapped views, every pixel has a value.
        assert!(right.data().iter().all(|d| d.is_finite()), "{more}");
    }
}

#[test]
fn offset_principal_points_move_the_depth() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let calib = fs::read_to_string(scene("slanted/calib.txt")).unwrap();
    for doffs in [2.5, -12.0] {
        let right = format!("cam1=[180 0 {}", 119.5 + doffs);
        let calib = calib.replace("cam1=[180 0 119.5", &right).replace("doffs=0", &format!("doffs={doffs}"));
        fs::write(at("other.txt"), calib).unwrap();
        for output in ["d.pfm", "d.tif"] {
            matched(&folder, "slanted", &format!("{output} --calib other.txt --quiet --also depth"));
        }
        let (disparities, depths) = (read_pfm(at("d.pfm")), read_pfm(at("d.depth.pfm")));
        assert!(depth_error(&depths, &disparities, doffs) < 1e-6, "{doffs}");
        let beyond = depths.data().iter().filter(|z| !z.is_finite()).count();
        assert_eq!(beyond > 1000, doffs < 0.0, "{beyond} pixels are at infinity or beyond");
        assert!(disparities.data().iter().all(|d| d.is_finite()), "the map itself stays complete");
        let same = |(a, b): (&f32, &f32)| if b.is_finite() { a.total_cmp(b).is_eq() } else { a.is_nan() };
        assert!(
            read_tiff(at("d.depth.tif")).data().iter().zip(depths.data()).all(same),
            "NaN in TIFF, +inf in PFM"
        );
    }
}

#[test]
fn a_calibration_file_elsewhere_gives_the_range() {
    let folder = workshop();
    run(&folder, "match left.png right.png out.pfm --calib camera/calib.txt")
        .succeeded()
        .says(", 17 disparities, ");
    // Without depth outputs it may be incomplete.
    run(&folder, "match left.png right.png out.pfm --max-disparity 9 --calib half/calib.txt").succeeded();
}

#[test]
fn the_pictures_of_the_guide_are_up_to_date() {
    let folder = Folder::new();
    matched(&folder, "mixed", "d.pfm --also preview");
    // With the filled pixels, so that the surface is closed.
    run(&folder, "depth d.pfm --calib @mixed/calib.txt --left @mixed/im0.png --also points").succeeded();
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    render_cloud::run(&[at("d.points.ply"), at("cloud.png")]).unwrap();
    // Another system's trigonometric functions may move a point to the next pixel.
    for (made, name, most) in
        [("d.preview.png", "disparity.png", 0), ("cloud.png", "cloud.png", 640 * 480 / 1000)]
    {
        let [made, shown] =
            [folder.join(made), scene("mixed").join(name)].map(|path| image::open(path).unwrap().to_rgb8());
        assert_eq!(made.dimensions(), shown.dimensions());
        let others = made.pixels().zip(shown.pixels()).filter(|(made, shown)| made != shown).count();
        assert!(others <= most, "{name} has changed in {others} pixels; replace it");
    }
}

#[test]
fn json_describes_the_match_and_its_result() {
    let folder = workshop();
    let at = |name: &str| folder.join(name);
    let common = "left.png right.png --calib camera/calib.txt --device cpu --mask flat-mask.png";
    let line = format!("match {common} out.pfm --also confidence,validity");
    let mask = image::GrayImage::from_fn(60, 40, |x, _| image::Luma([u8::from(x < 6)]));
    mask.save(at("flat-mask.png")).unwrap();
    let told = run(&folder, &format!("{line} --json m.json --threads 1")).succeeded();
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
    assert_eq!([&found["tiles"], &found["iterations"]], [1, 22]);
    let seconds = found["seconds"].as_f64().unwrap();
    assert!(seconds > 0.0 && told.stderr.contains(&format!("in {seconds:.2} s")), "{}", told.stderr);
    assert!(found["stages"].is_null(), "only `inspect` times stages");

    // Shares of all pixels, in percent.
    let (validity, confidence) =
        (read::grey8(&at("out.validity.png")).unwrap(), read::grey8(&at("out.confidence.png")).unwrap());
    let share = |of: &dyn Fn(u8) -> bool| {
        100.0 * validity.data().iter().filter(|&&v| of(v)).count() as f64 / (60.0 * 40.0)
    };
    let filled = |v: u8| v & flag::FILLED != 0;
    let measured = |v: u8| has_disparity(v) && !filled(v);
    let sure = validity.data().iter().zip(confidence.data()).filter(|(v, _)| measured(**v));
    let sure: Vec<f64> = sure.map(|(_, c)| f64::from(*c)).collect();
    for (key, expected) in [
        ("density", 90.0),
        ("measured", share(&measured)),
        ("filled", share(&filled)),
        ("mean_confidence", sure.iter().sum::<f64>() / sure.len() as f64),
    ] {
        assert!((found[key].as_f64().unwrap() - expected).abs() < 1e-9, "{key}: {} {expected}", found[key]);
    }
    assert!(share(&measured) > 20.0 && share(&filled) > 1.0, "both occur");

    // With `-`, standard output contains nothing else.
    let printed = run(&folder, &format!("{line} --json -")).succeeded().json();
    assert_eq!(printed["measured"], found["measured"]);
    let printed = run(&folder, &format!("inspect {common} --json -")).succeeded().json();
    assert_eq!((&printed["measured"], &printed["files"]["output"]), (&found["measured"], &Value::Null));
    let stages = printed["stages"].as_object().unwrap();
    assert!(stages["flood, level 0"].as_f64().unwrap() > 0.0, "{stages:?}");
    let sum: f64 = stages.values().map(|ms| ms.as_f64().unwrap()).sum();
    assert!(sum < 1000.0 * printed["seconds"].as_f64().unwrap());

    // A GPU has a driver.
    if has_gpu() {
        let line = "match left.png right.png out.pfm --max-disparity 9 --device gpu --json -";
        let told = run(&folder, line).succeeded();
        let (found, listed) = (told.json(), run(&folder, "devices").succeeded().stdout);
        told.says(&format!(" on {}", found["ran_on"].as_str().unwrap()));
        let driver = found["driver"].as_str().unwrap();
        assert!(!driver.is_empty() && listed.contains(&format!("| {driver} ")), "{driver} in {listed}");
    }

    // A fully masked map has no confidence.
    let all = image::GrayImage::from_pixel(60, 40, image::Luma([1]));
    all.save(at("flat-mask.png")).unwrap();
    let none = run(&folder, &format!("{line} --json -")).succeeded().json();
    assert_eq!([&none["density"], &none["mean_confidence"]], [&Value::from(0.0), &Value::Null]);
}

#[test]
fn the_colours_of_a_preview_can_be_chosen() {
    let folder = workshop();
    let picture = |name: &str, more: &str| {
        let line = "match left.png right.png out.pfm --max-disparity 15 --quiet";
        run(&folder, &format!("{line} --also {name} {more}")).succeeded();
        image::open(folder.join(format!("out.{name}.png"))).unwrap().into_rgb8()
    };
    let usual = picture("preview", "");
    assert_eq!(usual, picture("preview", "--colours turbo"));
    let [viridis, grey] = ["viridis", "grey"].map(|name| picture("preview", &format!("--colours {name}")));
    assert!(usual != viridis && viridis != grey && usual != grey);
    let even = |p: &image::Rgb<u8>| p.0[0] == p.0[1] && p.0[1] == p.0[2];
    assert!(grey.pixels().all(even) && !viridis.pixels().all(even));

    let both = picture("side-by-side", "--colours viridis");
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
    // Two identical images are at infinity: disparity 0, but valid.
    for (right, most) in [("right.png", 15), ("left.png", 3)] {
        for output in ["out.pfm", "out.png"] {
            let line = format!("match left.png {right} {output} --mask mask.png --quiet");
            run(&folder, &format!("{line} --max-disparity {most}")).succeeded();
        }
        let disparities = read_pfm(folder.join("out.pfm"));
        let png = image::open(folder.join("out.png")).unwrap();
        assert_eq!(png.color(), image::ColorType::L16);
        let png = png.into_luma16();
        for (x, y, level) in png.enumerate_pixels() {
            let (d, level) = (disparities[(x as usize, y as usize)], level.0[0]);
            assert_eq!(d.is_finite(), level > 0, "{x}, {y}: 0 is invalid and nothing else is");
            assert_eq!(level == 0, x < 5 && y > 30);
            // KITTI divides by 256.
            let off = (f32::from(level) / 256.0 - d).abs();
            assert!(level == 0 || off <= 1.0 / 256.0, "{x}, {y}: {level}, {d}");
        }
        let nearly_none = png.pixels().filter(|level| level.0[0] == 1).count();
        assert_eq!(nearly_none > 2000, right == "left.png", "{nearly_none} are 1/256");
    }
}

#[test]
fn standard_output_takes_the_map_and_nothing_else() {
    let folder = workshop();
    run(&folder, "match left.png right.png out.pfm --max-disparity 9").succeeded();
    let before = listing(&folder);
    let output = started(&folder, "match left.png right.png - --max-disparity 9").wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout == fs::read(folder.join("out.pfm")).unwrap(), "the bytes of the file");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("60 x 40, 10 disparities"), "{said}");
    assert!(listing(&folder) == before);
}

#[cfg(target_os = "linux")]
#[test]
fn a_map_cut_off_by_its_reader_is_a_failure() {
    let folder = workshop();
    let before = listing(&folder);
    for (closed, words) in [(true, "the reader closed it"), (false, "No space left")] {
        let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap().into();
        let stdout = if closed { Stdio::piped() } else { full() };
        let line = "match left.png right.png - --max-disparity 9 --quiet --json m.json";
        let mut child = program(&folder, line).stdout(stdout).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let words = format!("standard output & {words}");
        Run::of(line, child.wait_with_output().unwrap()).failed(1, &words);
        assert!(listing(&folder) == before, "{words}: files were left behind");
    }
}

#[test]
fn submissions_have_the_layout_of_the_benchmark() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    // An existing empty folder is accepted.
    fs::create_dir(at("trainingQ")).unwrap();
    for to in ["trainingQ MR-FGS_2", "--set fill=none sparse X"] {
        let line = format!("evaluate submission {to} @slanted @thin --device cpu --json a.json");
        run(&folder, &line).succeeded();
    }
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
        matched(&folder, pair, "d.pfm --quiet");
        let [dense, sparse] = [("trainingQ", "MR-FGS_2"), ("sparse", "X_s")]
            .map(|(dir, method)| fs::read(at(dir).join(pair).join(format!("disp0{method}.pfm"))).unwrap());
        assert!(dense == fs::read(at("d.pfm")).unwrap(), "{pair}: same as the map of a match");
        matched(&folder, pair, "d.pfm --quiet --set fill=none");
        assert!(
            sparse == fs::read(at("d.pfm")).unwrap() && sparse != dense,
            "{pair}: same as the map without a fill"
        );
        assert!(read_pfm(at("d.pfm")).data().contains(&f32::INFINITY));
        let time = fs::read_to_string(at("sparse").join(pair).join("timeX.txt")).unwrap();
        let seconds = figures["pairs"][i]["seconds"].as_f64().unwrap();
        assert!(seconds > 0.0 && time == format!("{seconds:.3}\n"), "{time} and {seconds}");
    }
}
