//! `mrfgs evaluate` and its modes: figures, older layouts, breakdown.

use image::{GrayImage, Luma};
use mrfgs::evaluation::GroundTruth;
use mrfgs::image::{Plane, read};
use mrfgs::options::Method;

use super::*;

/// Runs `evaluate` successfully.
pub(super) fn evaluated(folder: &Path, line: &str) -> Run {
    run(folder, &format!("evaluate {line}")).succeeded()
}

/// Runs `evaluate` and expects a one-line error with all these words, and no change in the folder.
pub(super) fn refused(folder: &Path, line: &str, code: i32, words: &str) {
    let before = listing(folder);
    run(folder, &format!("evaluate {line}")).failed(code, words);
    assert!(listing(folder) == before, "{line}");
}

/// Every number of a report, by its path in the JSON.
fn figures(value: &Value, place: &str, all: &mut BTreeMap<String, f64>) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                figures(value, &format!("{place}/{key}"), all);
            }
        }
        Value::Number(n) => {
            all.insert(place.into(), n.as_f64().unwrap());
        }
        other => panic!("{place} is {other}"),
    }
}

#[test]
fn evaluate_gives_the_same_figures_for_a_written_map() {
    let folder = Folder::new();
    let told = evaluated(&folder, "@slanted @exposure --json out.json");
    let lines: Vec<&str> = told.stdout.lines().collect();
    assert_eq!(lines.len(), 3 + 4 + 3, "{}", told.stdout);
    for (line, start) in [(3, "slanted  raw   |"), (5, "exposure raw   |"), (8, "mean     raw   |")] {
        assert!(lines[line].starts_with(start), "{}", told.stdout);
        assert!(lines[line + 1].starts_with("         final |"), "{}", told.stdout);
    }

    let json = json(folder.join("out.json"));
    assert_eq!(json["method"], serde_json::to_value(Method::default()).unwrap());
    assert!(json["ran_on"].is_string());
    assert_eq!(json["pairs"].as_array().unwrap().len(), 2);
    assert_eq!(json["pairs"][1]["name"], "exposure");
    assert!(json["pairs"][0]["seconds"].as_f64().unwrap() > 0.0);
    let mut all = BTreeMap::new();
    for map in ["raw", "final"] {
        figures(&json["pairs"][0][map], map, &mut all);
        figures(&json["mean"][map], "mean", &mut all);
    }
    assert!(all.values().all(|v| v.is_finite() && *v >= 0.0), "{all:?}");
    assert!(all["final/all/avg"] < 1.0 && all["final/all/bad2.0"] < 10.0, "{all:?}");
    assert_eq!((all["final/all/pixels"], all["final/all/density"]), (240.0 * 180.0, 100.0));

    run(&folder, "match @slanted/im0.png @slanted/im1.png map.pfm --also raw --quiet").succeeded();
    for (map, file) in [("final", "map.pfm"), ("raw", "map.raw.pfm")] {
        let mask = "--mask @slanted/mask0nocc.png --json -";
        let told = evaluated(&folder, &format!("map {file} --truth @slanted/disp0GT.pfm {mask}"));
        assert_eq!(told.stderr, "");
        let json = told.json();
        assert!(json["method"].is_null() && json["pairs"][0]["raw"].is_null());
        let mut same = BTreeMap::new();
        figures(&json["pairs"][0]["final"], map, &mut same);
        for (place, value) in same {
            let expected = all[&place];
            assert!((value - expected).abs() <= 1e-6 * expected.abs(), "{place}: {value} and {expected}");
        }
    }
    // Without a mask the table is shorter.
    evaluated(&folder, "map map.pfm --truth @slanted/disp0GT.pfm").prints("map  final |");
}

#[test]
fn folders_of_maps_are_compared_by_name() {
    let folder = Folder::new();
    for dir in ["maps", "truth", "masks"] {
        fs::create_dir(folder.join(dir)).unwrap();
    }
    for (name, pair) in [("1_10", "slanted"), ("2_10", "wall")] {
        let line = format!(
            "match @{pair}/im0.png @{pair}/im1.png maps/{name}.png --also preview,confidence --quiet"
        );
        run(&folder, &line).succeeded();
        fs::copy(scene(pair).join("disp0GT.pfm"), folder.join(format!("truth/{name}.pfm"))).unwrap();
        fs::copy(scene(pair).join("mask0nocc.png"), folder.join(format!("masks/{name}.png"))).unwrap();
    }
    let all = evaluated(&folder, "map maps --truth truth --mask masks --json -").json();
    for (n, name) in ["1_10", "2_10"].into_iter().enumerate() {
        let files = format!("map maps/{name}.png --truth truth/{name}.pfm --mask masks/{name}.png --json -");
        assert_eq!(all["pairs"][n], evaluated(&folder, &files).json()["pairs"][0]);
    }
    evaluated(&folder, "map maps --truth truth --report page").prints("mean");
    assert!(folder.join("page/index.html").is_file());
    refused(&folder, "map maps/1_10.png --truth truth", 2, "--truth & truth is a folder & two folders");
    refused(&folder, "map maps --truth none", 2, "--truth & maps is a folder but none is not & two folders");
    fs::remove_file(folder.join("maps/2_10.png")).unwrap();
    refused(&folder, "map maps --truth truth", 1, "maps & 2_10 & .png");
}

#[test]
fn a_rounded_truth_has_whole_pixels() {
    let folder = Folder::new();
    let truth = read::read_disparity(&scene("slanted/disp0GT.pfm")).unwrap();
    truth.map(|d| (d + 0.5).floor()).save(folder.join("whole.pfm")).unwrap();
    run(&folder, "match @slanted/im0.png @slanted/im1.png map.pfm --quiet").succeeded();
    let figures = |line: &str| {
        evaluated(&folder, &format!("{line} --json -")).json()["pairs"][0]["final"]["all"].clone()
    };
    let whole = figures("map map.pfm --truth whole.pfm");
    assert_eq!(figures("map map.pfm --truth @slanted/disp0GT.pfm --truth-rounded"), whole);
    let of_pair = figures("@slanted --truth-rounded");
    for key in ["avg", "bad0.5"] {
        let [one, other] = [&of_pair, &whole].map(|figures| figures[key].as_f64().unwrap());
        assert!((one - other).abs() <= 1e-6 * other, "{key}: {one} and {other}");
    }
    // Control: without the flag, the truth keeps its fractions.
    assert_ne!(figures("@slanted"), of_pair);
}

/// The ground truth of `slanted` in 8 bits, unknown in the top left corner: as stored, and as read in pixels.
fn quantised(scale: f32) -> (GrayImage, Plane<f32>) {
    let truth = read::read_disparity(&scene("slanted/disp0GT.pfm")).unwrap();
    let levels = Plane::from_fn(truth.width(), truth.height(), |x, y| {
        if x < 40 && y < 30 { 0 } else { (truth[(x, y)] * scale).round() as u8 }
    });
    let pixels = levels.map(|&v| if v == 0 { f32::INFINITY } else { v as f32 / scale });
    let (w, h) = (levels.width() as u32, levels.height() as u32);
    (GrayImage::from_fn(w, h, |x, y| Luma([levels[(x as usize, y as usize)]])), pixels)
}

/// A folder with `slanted` in the layouts of 2003 (`old`) and 2005 (`newer`), and its maps.
fn older_layouts() -> Folder {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    for (dir, files, scale) in [
        ("old", ["im2.png", "im6.png", "disp2.png"], 4.0),
        ("newer", ["view1.png", "view5.png", "disp1.png"], 3.0),
    ] {
        fs::create_dir(at(dir)).unwrap();
        fs::copy(scene("slanted/im0.png"), at(dir).join(files[0])).unwrap();
        fs::copy(scene("slanted/im1.png"), at(dir).join(files[1])).unwrap();
        quantised(scale).0.save(at(dir).join(files[2])).unwrap();
    }
    folder
}

#[test]
fn older_layouts_give_the_same_figures_as_evaluate_map() {
    let folder = older_layouts();
    let at = |name: &str| folder.join(name);
    let [old, newer] = ["old/im2.png old/im6.png", "newer/view1.png newer/view5.png"];
    for (dir, images, truth, scale) in
        [("old", old, "old/disp2.png", 4.0), ("newer", newer, "newer/disp1.png", 3.0)]
    {
        let figures = evaluated(&folder, &format!("{dir} --json -")).json();
        let pixels = quantised(scale).1;
        let largest = pixels.data().iter().filter(|d| d.is_finite()).fold(0.0, |a: f32, b| a.max(*b));
        let max = largest.ceil() as i32;
        run(&folder, &format!("match {images} map.pfm --also raw --max-disparity {max}")).succeeded();
        pixels.save(at("truth.pfm")).unwrap();

        for (map, file) in [("final", "map.pfm"), ("raw", "map.raw.pfm")] {
            let by_pfm = format!("map {file} --truth truth.pfm --json -");
            let by_png = format!("map {file} --truth {truth} --truth-scale {scale} --json -");
            let expected = evaluated(&folder, &by_pfm).json();
            assert_eq!(evaluated(&folder, &by_png).json(), expected);
            let (found, expected) = (&figures["pairs"][0][map], &expected["pairs"][0]["final"]);
            assert_eq!(found["all"]["pixels"], 240 * 180 - 40 * 30, "unknown pixels do not count");
            assert!(found["all"]["avg"].as_f64().unwrap() < 2.0, "{found}");
            assert_eq!(found, expected, "{dir}, {map}");
        }
        assert_eq!(figures["pairs"][0]["name"], dir);
    }

    // Twice the scale halves the disparities; a calib.txt overrides the range.
    let half = evaluated(&folder, "old --truth-scale 8 --json -").json();
    assert!(half["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap() > 3.0);
    fs::write(at("old/calib.txt"), "ndisp=9\n").unwrap();
    let near = evaluated(&folder, "old newer --json -").json();
    assert!(near["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap() > 3.0);
    assert!(near["pairs"][1]["final"]["all"]["avg"].as_f64().unwrap() < 2.0);
}

#[test]
fn scales_and_incomplete_folders_are_refused() {
    let folder = older_layouts();
    let at = |name: &str| folder.join(name);
    for scale in ["0", "-3", "nan", "inf", "three", "0.01", "65536"] {
        refused(&folder, &format!("old --truth-scale {scale}"), 2, "--truth-scale & 0.1 to 65535");
    }
    copy("slanted", &at("new"));
    Plane::filled(240, 180, 1.0).save(at("map.pfm")).unwrap();
    refused(&folder, "new --truth-scale 3", 2, "--truth-scale & remove it");
    let line = "map map.pfm --truth map.pfm --truth-scale 3";
    refused(&folder, line, 1, "map.pfm & whole numbers & remove --scale");
    refused(&folder, "map map.pfm --truth old/disp2.png", 1, "disp2.png & --truth-scale");
    refused(&folder, "map map.pfm --truth old/im2.png --truth-scale 3", 1, "im2.png & more than one channel");

    fs::remove_file(at("newer/view5.png")).unwrap();
    refused(&folder, "old newer", 1, "newer/view5.png & must contain view1.png, view5.png, disp1.png");
    fs::remove_file(at("old/disp2.png")).unwrap();
    refused(&folder, "old", 1, "old/disp2.png & must contain im2.png, im6.png, disp2.png");
    fs::create_dir(at("bare")).unwrap();
    refused(&folder, "bare", 1, "bare/im0.png & disp0GT.pfm, calib.txt & view1.png & disp2.png");
}

/// The sum of a field over all entries of an object.
fn total(of: &Value, field: &str) -> f64 {
    of.as_object().unwrap().values().map(|entry| entry[field].as_f64().unwrap()).sum()
}

#[test]
fn a_breakdown_adds_up() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    copy("slanted", &at("Teddy"));
    copy("thin", &at("thin"));
    fs::remove_file(at("thin/mask0nocc.png")).unwrap();
    let text = evaluated(&folder, "Teddy thin --breakdown --json out.json").stdout;
    let figures = json(at("out.json"));

    let [teddy, thin] = &figures["pairs"].as_array().unwrap()[..] else { panic!("two pairs") };
    for (name, of) in [("Teddy", teddy), ("thin", thin), ("mean", &figures["mean"])] {
        let (breakdown, bad) = (&of["breakdown"], of["final"]["all"]["bad2.0"].as_f64().unwrap());
        assert_eq!(breakdown.as_object().unwrap().len(), 6);
        assert!((total(breakdown, "share") - 100.0).abs() < 1e-9, "{breakdown}");
        assert!((total(breakdown, "points") - bad).abs() < 1e-9, "{breakdown}");
        let confidence = &of["confidence"];
        assert!((confidence["random"].as_f64().unwrap() - bad).abs() < 1e-9);
        assert!((confidence["curve"][19].as_f64().unwrap() - bad).abs() < 1e-9);
        assert_eq!(confidence["curve"].as_array().unwrap().len(), 20);
        let [optimal, auc] = ["optimal", "auc"].map(|key| confidence[key].as_f64().unwrap());
        assert!(optimal < auc && auc < bad, "{confidence}");

        // The text shows the same figures.
        let cells = in_cells(&text);
        let found: Vec<&str> = cells.lines().filter(|line| line.starts_with(&format!("{name} | "))).collect();
        let [errors, worth] = found[..] else { panic!("two lines of {name}:\n{text}") };
        let classes = ["border", "occluded", "edge", "plain", "slanted", "other"].map(|class| {
            let [share, points] = ["share", "points"].map(|key| breakdown[class][key].as_f64().unwrap());
            format!("{share:.2} {points:.2}")
        });
        assert_eq!(errors, format!("{name} | {} | {bad:.2}", classes.join(" | ")));
        let figure = |value: &Value| value.as_f64().map_or_else(|| "-".into(), |v| format!("{v:.2}"));
        let [precision, recall] = ["precision", "recall"].map(|key| figure(&of["validity"][key]));
        let expected = format!("{name} | {auc:.2} {optimal:.2} {bad:.2} | {precision} {recall}");
        assert_eq!(worth, expected);
    }
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    // Without a mask occlusion is unknown, and no mean covers fewer pairs.
    assert_eq!(thin["breakdown"]["occluded"]["share"], 0.0);
    assert!(thin["validity"].is_null() && figures["mean"]["validity"].is_null());

    // The figures follow from the maps that the program writes.
    run(&folder, "match Teddy/im0.png Teddy/im1.png map.pfm --also confidence,validity").succeeded();
    let truth = read::read_disparity(&at("Teddy/disp0GT.pfm")).unwrap();
    let (map, grey) = (read::read_disparity(&at("map.pfm")).unwrap(), |file: &str| read::grey8(&at(file)));
    let ground = GroundTruth::new(truth.clone(), None).unwrap();
    let expected = ground.sparsify(&map, &grey("map.confidence.png").unwrap()).unwrap();
    // Reading JSON may change the last bit.
    let near = |value: &Value, expected: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() <= 1e-12 * expected, "{value} against {expected}");
    };
    near(&teddy["confidence"]["auc"], expected.auc);
    let (validity, mask) = (grey("map.validity.png").unwrap(), grey("Teddy/mask0nocc.png").unwrap());
    let of = |flagged: bool, unseen: bool| {
        let pixels = validity.data().iter().zip(mask.data());
        pixels.filter(|&(v, m)| (v & (1 | 2 | 4 | 64 | 128) != 0) == flagged && (*m != 255) == unseen).count()
            as f64
    };
    let [hits, alarms, missed] = [of(true, true), of(true, false), of(false, true)];
    near(&teddy["validity"]["precision"], 100.0 * hits / (hits + alarms));
    near(&teddy["validity"]["recall"], 100.0 * hits / (hits + missed));

    // The figures are in JSON without the flag, the tables are not printed; a finished map has neither.
    let plain = evaluated(&folder, "Teddy thin").stdout;
    assert!(text.starts_with(&plain) && text.len() > plain.len());
    assert_eq!(evaluated(&folder, "Teddy thin --json -").json()["mean"], figures["mean"]);
    let line = "map map.pfm --truth Teddy/disp0GT.pfm";
    let others = evaluated(&folder, &format!("{line} --json -")).json();
    for key in ["breakdown", "confidence", "validity"] {
        assert!(others["pairs"][0][key].is_null() && others["mean"][key].is_null());
    }
    refused(&folder, &format!("{line} --breakdown"), 2, "--breakdown & unexpected argument");
}

#[test]
fn a_map_with_the_opposite_sign_is_reported() {
    let folder = Folder::new();
    let line = "match @slanted/im0.png @slanted/im1.png d.pfm --device cpu --quiet";
    run(&folder, &format!("{line} --sign right-minus-left --max-disparity 0 --min-disparity -31"))
        .succeeded();
    let told = evaluated(&folder, "map d.pfm --truth @slanted/disp0GT.pfm");
    told.says("warning: d.pfm & disp0GT.pfm & opposite signs");
    run(&folder, &format!("{line} --max-disparity 31")).succeeded();
    let told = evaluated(&folder, "map d.pfm --truth @slanted/disp0GT.pfm");
    assert_eq!(told.stderr, "", "control");
}
