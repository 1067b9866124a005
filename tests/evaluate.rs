//! `mrfgs evaluate` through the built program: older layouts, the paper's tables, the report.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests too")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::{GrayImage, Luma};
use mrfgs::image::{Plane, read, write};
use mrfgs::options;
use serde_json::Value;
use tempfile::TempDir;

/// Runs the program in `folder` on the CPU path: exit status, standard output, standard error.
fn run(folder: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_mrfgs"))
        .current_dir(folder)
        .args(args)
        // Without it the Vulkan loader complains on standard error.
        .env("XDG_RUNTIME_DIR", std::env::temp_dir())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Evaluates; the standard output.
fn evaluated(folder: &Path, args: &[&str]) -> String {
    let all = [&["evaluate"], args].concat();
    let (code, stdout, stderr) = run(folder, &all);
    assert_eq!(code, Some(0), "{args:?}: {stderr}");
    stdout
}

/// Evaluates and fails: one line with all these words, and the folder stays as it was.
fn refused(folder: &Path, args: &[&str], code: i32, words: &[&str]) {
    let before = listing(folder);
    let all = [&["evaluate"], args].concat();
    let (found, stdout, stderr) = run(folder, &all);
    assert_eq!((found, &*stdout), (Some(code), ""), "{args:?}: {stderr}");
    assert_eq!(stderr.lines().count(), 1, "{args:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{args:?}: no `{word}` in: {stderr}");
    }
    assert_eq!(listing(folder), before, "{args:?}");
}

/// The paths of all files in a folder and below it, with their sizes.
fn listing(folder: &Path) -> Vec<(PathBuf, u64)> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(listing(&path));
        }
        all.push((path.clone(), fs::metadata(&path).unwrap().len()));
    }
    all.sort();
    all
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

/// Copies a rendered scene, 2014's layout, to a folder of another name.
fn copy(name: &str, to: &Path) {
    fs::create_dir(to).unwrap();
    for file in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt", "mask0nocc.png"] {
        fs::copy(scene(name).join(file), to.join(file)).unwrap();
    }
}

/// The truth of `slanted` as 8 bits hold it, unknown in the top left corner: in levels, and in pixels as they read.
fn quantised(scale: f32) -> (GrayImage, Plane<f32>) {
    let truth = read::read_disparity(&scene("slanted").join("disp0GT.pfm")).unwrap();
    let levels = Plane::from_fn(truth.width(), truth.height(), |x, y| {
        if x < 40 && y < 30 { 0 } else { (truth[(x, y)] * scale).round() as u8 }
    });
    let pixels = levels.map(|&v| if v == 0 { f32::INFINITY } else { v as f32 / scale });
    let (w, h) = (levels.width() as u32, levels.height() as u32);
    (GrayImage::from_fn(w, h, |x, y| Luma([levels[(x as usize, y as usize)]])), pixels)
}

/// A folder with `slanted` in the layouts of 2003 (`old`) and 2005 (`newer`), and its maps by the program.
fn workshop() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (dir, files, scale) in [
        ("old", ["im2.png", "im6.png", "disp2.png"], 4.0),
        ("newer", ["view1.png", "view5.png", "disp1.png"], 3.0),
    ] {
        fs::create_dir(at(dir)).unwrap();
        fs::copy(scene("slanted").join("im0.png"), at(dir).join(files[0])).unwrap();
        fs::copy(scene("slanted").join("im1.png"), at(dir).join(files[1])).unwrap();
        quantised(scale).0.save(at(dir).join(files[2])).unwrap();
    }
    folder
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn older_layouts_give_the_figures_of_the_same_truth_by_the_other_route() {
    let folder = workshop();
    let at = |name: &str| folder.path().join(name);
    let [old, newer] = ["old/im2.png old/im6.png", "newer/view1.png newer/view5.png"];
    for (dir, images, truth, scale) in
        [("old", old, "old/disp2.png", 4.0), ("newer", newer, "newer/disp1.png", 3.0)]
    {
        let figures = json(&evaluated(folder.path(), &[dir, "--json", "-"]));
        let pixels = quantised(scale).1;
        let largest = pixels.data().iter().filter(|d| d.is_finite()).fold(0.0, |a: f32, b| a.max(*b));
        let max = (largest.ceil() as i32).to_string();
        let images: Vec<_> = images.split(' ').collect();
        let args = ["match", images[0], images[1], "map.pfm", "--raw", "raw.pfm", "--max-disparity", &max];
        assert_eq!(run(folder.path(), &args).0, Some(0));
        write::disparity(&at("truth.pfm"), &pixels).unwrap();

        for (map, file) in [("final", "map.pfm"), ("raw", "raw.pfm")] {
            let by_pfm = ["--disparity", file, "--truth", "truth.pfm", "--json", "-"];
            let scale = scale.to_string();
            let by_png = ["--disparity", file, "--truth", truth, "--truth-scale", &scale, "--json", "-"];
            let expected = json(&evaluated(folder.path(), &by_pfm));
            assert_eq!(json(&evaluated(folder.path(), &by_png)), expected);
            let (found, expected) = (&figures["pairs"][0][map], &expected["pairs"][0]["final"]);
            assert_eq!(found["all"]["pixels"], 240 * 180 - 40 * 30, "what is unknown stays out");
            assert!(found["all"]["avg"].as_f64().unwrap() < 2.0, "{found}");
            assert_eq!(found, expected, "{dir}, {map}");
        }
        assert_eq!(figures["pairs"][0]["name"], dir);
    }

    // Twice the scale is half the disparity, and calib.txt has the last word on the range.
    let half = json(&evaluated(folder.path(), &["old", "--truth-scale", "8", "--json", "-"]));
    assert!(half["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap() > 3.0);
    fs::write(at("old/calib.txt"), "ndisp=9\n").unwrap();
    let near = json(&evaluated(folder.path(), &["old", "newer", "--json", "-"]));
    assert!(near["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap() > 3.0);
    assert!(near["pairs"][1]["final"]["all"]["avg"].as_f64().unwrap() < 2.0);
}

#[test]
fn scales_and_incomplete_folders_are_refused() {
    let folder = workshop();
    let at = |name: &str| folder.path().join(name);
    for scale in ["0", "-3", "nan", "inf", "three", "0.01", "256"] {
        refused(folder.path(), &["old", "--truth-scale", scale], 2, &["--truth-scale", "0.1 to 255"]);
    }
    copy("slanted", &at("new"));
    write::disparity(&at("map.pfm"), &Plane::filled(240, 180, 1.0)).unwrap();
    let word = ["--truth-scale", "leave it out"];
    refused(folder.path(), &["new", "--truth-scale", "3"], 1, &word);
    let args = ["--disparity", "map.pfm", "--truth", "map.pfm", "--truth-scale", "3"];
    refused(folder.path(), &args, 1, &["map.pfm", "8-bit PNG", "leave --truth-scale out"]);
    refused(folder.path(), &[&args[..3], &["old/disp2.png"]].concat(), 1, &["disp2.png", "--truth-scale"]);
    refused(folder.path(), &[&args[..3], &["old/im2.png"], &args[4..]].concat(), 1, &["im2.png", "grey"]);

    fs::remove_file(at("newer/view5.png")).unwrap();
    refused(
        folder.path(),
        &["old", "newer"],
        1,
        &["newer/view5.png", "holds view1.png, view5.png, disp1.png"],
    );
    fs::remove_file(at("old/disp2.png")).unwrap();
    refused(folder.path(), &["old"], 1, &["old/disp2.png", "holds im2.png, im6.png, disp2.png"]);
    fs::create_dir(at("bare")).unwrap();
    let all = ["bare/im0.png", "disp0GT.pfm, calib.txt", "view1.png", "disp2.png"];
    refused(folder.path(), &["bare"], 1, &all);
}

#[test]
fn tables_stand_beside_the_papers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    copy("slanted", &at("Teddy"));
    copy("exposure", &at("Cones"));
    copy("thin", &at("thin"));
    let presets: Vec<&str> = ["fgs", "paper", "default"]
        .into_iter()
        .filter(|name| options::PRESETS.iter().any(|preset| preset.0 == *name))
        .collect();

    let text = evaluated(folder.path(), &["Teddy", "Cones", "--tables", "--json", "out.json"]);
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    for words in [
        "Table 1: raw maps, before post-processing.",
        "Table 2: final maps, after post-processing.",
        "Teddy       |  2.60  32.02  14.17|  2.09  32.43  13.90|",
        "Cones       |  2.32  33.33  15.11|  1.98  33.43  15.06|",
        "mean        |  2.11  33.29  12.33|  1.83  33.36  12.15|",
        "|   paper: MR-FGS    |",
    ] {
        assert!(text.contains(words), "no `{words}` in:\n{text}");
    }
    for preset in &presets {
        assert!(text.contains(&format!(" ours: {preset} ")) || text.contains(&format!(" ours: {preset}\n")));
    }

    let all = json(&fs::read_to_string(at("out.json")).unwrap());
    assert!(all["source"].as_str().unwrap().contains("Tables 1 and 2"));
    let methods = all["methods"].as_object().unwrap();
    assert!(methods.len() == presets.len() && presets.iter().all(|p| methods.contains_key(*p)));
    let [raw, finished] = &all["tables"].as_array().unwrap()[..] else { panic!("two tables") };
    assert_eq!((&raw["number"], &raw["map"]), (&1.into(), &"raw".into()));
    assert_eq!((&finished["number"], &finished["map"]), (&2.into(), &"final".into()));
    assert_eq!(raw["pairs"][0]["name"], "Teddy");
    assert_eq!(raw["pairs"][0]["published"]["fgs"]["avg"], 2.60);
    assert_eq!(finished["pairs"][1]["published"]["mr-fgs"]["bad2.0"], 15.06);
    let mean = finished["mean"]["published"]["fgs"]["psnr"].as_f64().unwrap();
    assert!((mean - f64::midpoint(33.25, 33.33)).abs() < 1e-9);

    // Ours are those that the preset gives by itself.
    for preset in presets {
        let alone = evaluated(folder.path(), &["Teddy", "Cones", "--preset", preset, "--json", "-"]);
        let alone = json(&alone);
        for (table, map) in [(raw, "raw"), (finished, "final")] {
            for name in ["avg", "psnr", "bad2.0"] {
                for i in 0..2 {
                    let ours = &table["pairs"][i]["ours"][preset][name];
                    assert_eq!(ours, &alone["pairs"][i][map]["all"][name], "{preset}, {map}, {name}");
                }
                assert_eq!(table["mean"]["ours"][preset][name], alone["mean"][map]["all"][name]);
            }
        }
    }

    // A pair that the paper lacks leaves its columns, and those of the mean, empty.
    let text = evaluated(folder.path(), &["Teddy", "thin", "--tables"]);
    for line in ["thin", "mean"] {
        let empty = format!("{line:12}|     -      -      -|     -      -      -|  ");
        assert!(text.contains(&empty), "no `{empty}` in:\n{text}");
    }
    let printed = json(&evaluated(folder.path(), &["thin", "--tables", "--json", "-"]));
    assert!(printed["tables"][0]["pairs"][0]["published"].is_null());

    for flags in [["--preset", "paper"], ["--set", "levels=2"], ["--config", "x"], ["--report", "r"]] {
        let args = [&["Teddy", "--tables"], &flags[..]].concat();
        refused(folder.path(), &args, 2, &["--tables", flags[0], "cannot be used"]);
    }
}

/// The values of an attribute in a page, in order.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    page.split(&start).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn a_report_is_whole_and_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    copy("slanted", &at("Teddy"));
    // What a name of a folder may hold.
    let odd = if cfg!(windows) { "a & 'b'" } else { "<b>\"a\" & 'b'" };
    copy("mixed", &at(odd));
    evaluated(folder.path(), &["Teddy", odd, "--report", "out", "--json", "out.json"]);

    let page = fs::read_to_string(at("out/index.html")).unwrap();
    assert!(page.starts_with("<!doctype html>\n") && page.ends_with("</html>\n"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("<script"));
    assert_eq!(page.matches("<section>").count(), 2);
    assert!(page.contains("<h2>Teddy</h2>") && !page.contains("<b>\"a\""));
    assert!(page.contains("&amp; &#39;b&#39;</h2>"), "{}", &page[..3000]);
    assert!(page.contains("prefers-color-scheme: dark") && page.contains("image-rendering: pixelated"));
    let figures = json(&fs::read_to_string(at("out.json")).unwrap());
    for pair in figures["pairs"].as_array().unwrap() {
        let avg = pair["final"]["all"]["avg"].as_f64().unwrap();
        assert!(page.matches(&format!("<td>{avg:.3}</td>")).count() >= 2, "{avg}");
    }

    let (files, sources) = (attributes(&page, "data-file"), attributes(&page, "src"));
    assert_eq!((files.len(), sources.len()), (14, 14));
    assert!(attributes(&page, "alt").iter().all(|alt| alt.len() > 15));
    for (file, source) in files.iter().zip(sources) {
        let bytes = BASE64.decode(source.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        assert_eq!(fs::read(at("out").join(file)).unwrap(), bytes, "{file}");
        let picture = image::load_from_memory(&bytes).unwrap();
        let (w, h) = if file.starts_with("1-Teddy-") { (240, 180) } else { (320, 240) };
        // Below the map: nothing, the scale (16 rows), or one line of classes (9 rows).
        let legend = match file.rsplit('-').next().unwrap() {
            "left.png" | "zones.png" => 0,
            "validity.png" => 9,
            _ => 16,
        };
        assert_eq!((picture.width(), picture.height()), (w, h + legend), "{file}");
    }
    assert_eq!(fs::read_dir(at("out")).unwrap().count(), 15);
    // The left view is the left view.
    let left = image::open(at("out/1-Teddy-left.png")).unwrap().into_rgb8();
    assert_eq!(left, image::open(at("Teddy/im0.png")).unwrap().into_rgb8());

    // A later report takes its place; a map that others made has fewer pictures.
    let args = ["--disparity", "Teddy/disp0GT.pfm", "--truth", "Teddy/disp0GT.pfm", "--report", "out"];
    evaluated(folder.path(), &args);
    let mut names: Vec<_> =
        fs::read_dir(at("out")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let pictures = ["disparity", "error", "truth"].map(|name| format!("1-disp0GT-{name}.png"));
    assert_eq!(names, [&pictures[..], &["index.html".into()]].concat());
    let error = image::open(at("out/1-disp0GT-error.png")).unwrap().into_rgb8();
    assert!((0..180).all(|y| error.get_pixel(100, y).0 == [250; 3]), "no error is white");

    // Nothing temporary is left.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4);
}

#[test]
fn a_report_that_cannot_be_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    copy("slanted", &at("Teddy"));
    fs::create_dir(at("misfit")).unwrap();
    fs::create_dir(at("empty")).unwrap();
    for file in ["im0.png", "im1.png", "calib.txt"] {
        fs::copy(scene("slanted").join(file), at("misfit").join(file)).unwrap();
    }
    fs::copy(scene("mixed").join("disp0GT.pfm"), at("misfit/disp0GT.pfm")).unwrap();

    // The folder itself.
    refused(folder.path(), &["Teddy", "--report", "Teddy"], 1, &["Teddy", "no part of an earlier report"]);
    refused(folder.path(), &["Teddy", "--report", "none/out"], 1, &["none/out", "create it first"]);
    refused(folder.path(), &["Teddy", "--report", "Teddy/im0.png"], 1, &["im0.png", "is a file"]);
    let args = ["Teddy", "--report", "empty", "--json", "empty/a.json"];
    refused(folder.path(), &args, 1, &["--json", "empty/a.json", "another name"]);

    // What fails later: the second pair, or the JSON.
    for out in ["out", "empty"] {
        refused(folder.path(), &["misfit", "--report", out], 1, &["disp0GT.pfm is 320 x 240"]);
    }
    if cfg!(target_os = "linux") {
        let args = ["--disparity", "Teddy/disp0GT.pfm", "--truth", "Teddy/disp0GT.pfm", "--report", "out"];
        refused(folder.path(), &[&args[..], &["--json", "/dev/full"]].concat(), 1, &["/dev/full"]);
    }

    // A report with something else in it stays, and so does a page that is none.
    let args = ["--disparity", "Teddy/disp0GT.pfm", "--truth", "Teddy/disp0GT.pfm", "--report", "empty"];
    evaluated(folder.path(), &args);
    fs::write(at("empty/notes.txt"), "precious").unwrap();
    refused(folder.path(), &args, 1, &["empty", "notes.txt", "new folder"]);
    fs::create_dir(at("site")).unwrap();
    fs::write(at("site/index.html"), "<!doctype html><title>Home</title>").unwrap();
    refused(folder.path(), &[&args[..5], &["site"]].concat(), 1, &["site", "index.html"]);
}
