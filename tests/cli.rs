//! The command line, through the built program: what it writes, and how it fails.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests too")]

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use mrfgs::backend::gpu;
use mrfgs::image::read;
use mrfgs::maps::flag;
use mrfgs::options::{self, Method};
use serde_json::Value;
use tempfile::TempDir;

/// What a run of the program leaves.
#[derive(Debug)]
struct Run {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

/// Runs the program in `folder`.
fn run(folder: &Path, args: &[&str]) -> Run {
    run_with(folder, args, &[])
}

fn run_with(folder: &Path, args: &[&str], environment: &[(&str, &str)]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_mrfgs"))
        .current_dir(folder)
        .args(args)
        // Without it the Vulkan loader complains on standard error.
        .env("XDG_RUNTIME_DIR", std::env::temp_dir())
        .envs(environment.iter().copied())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Run { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

impl Run {
    fn succeeded(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// Exactly one line on standard error, with all these words, and nothing on standard output.
    fn failed(&self, code: i32, words: &[&str], what: &str) {
        assert_eq!(self.code, Some(code), "{what}: {self:?}");
        assert_eq!(self.stdout, "", "{what}");
        assert!(self.stderr.starts_with("mrfgs: ") && self.stderr.ends_with('\n'), "{what}: {self:?}");
        assert_eq!(self.stderr.lines().count(), 1, "{what}: {}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{what}: {}", self.stderr);
        for word in words {
            assert!(self.stderr.contains(word), "{what}: no `{word}` in: {}", self.stderr);
        }
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap()
    }
}

/// Everything in a folder and below it: the content of files, `None` for folders.
fn listing(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(listing(&path));
            all.insert(path, None);
        } else {
            let content = fs::read(&path).unwrap();
            all.insert(path, Some(content));
        }
    }
    all
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name)
}

/// The path of a file of a scene, as an argument.
fn scene_file(name: &str, file: &str) -> String {
    scene(name).join(file).to_str().unwrap().to_owned()
}

/// A folder with a pair of 60 x 40 pixels without calib.txt, and with much that is wrong.
fn workshop() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (from, to) in [("im0.png", "left.png"), ("im1.png", "right.png")] {
        let image = image::open(scene("slanted").join(from)).unwrap();
        image.crop_imm(100, 80, 60, 40).save(at(to)).unwrap();
    }
    let left = fs::read(at("left.png")).unwrap();
    image::open(at("left.png")).unwrap().crop_imm(0, 0, 30, 40).save(at("narrow.png")).unwrap();
    fs::write(at("cut.png"), &left[..left.len() / 2]).unwrap();
    fs::write(at("empty.png"), "").unwrap();
    fs::write(at("text.png"), "a picture is worth a thousand words").unwrap();
    fs::create_dir_all(at("folder/full")).unwrap();
    fs::write(at("folder/full/of"), "something").unwrap();
    image::GrayImage::from_pixel(60, 40, image::Luma([90])).save(at("flat.png")).unwrap();
    fs::create_dir(at("taken.pfm")).unwrap();
    fs::create_dir(at("taken.png")).unwrap();
    fs::write(at("syntax.toml"), "levels = 3\ncost sad\n").unwrap();
    fs::write(at("key.toml"), "# a comment\nlevel = 3\n").unwrap();
    fs::write(at("value.toml"), "levels = 3\n\ntemperature = -1\n").unwrap();
    for (name, calib) in [("damaged", "ndisp=many\n"), ("silent", "width=60\n"), ("huge", "ndisp=100000\n")] {
        fs::create_dir(at(name)).unwrap();
        fs::copy(at("left.png"), at(name).join("left.png")).unwrap();
        fs::write(at(name).join("calib.txt"), calib).unwrap();
    }
    // Folders to evaluate, each with one thing wrong.
    for file in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt"] {
        let to = at(&format!("without-{file}"));
        fs::create_dir(&to).unwrap();
        for other in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt"].into_iter().filter(|f| *f != file) {
            fs::copy(scene("slanted").join(other), to.join(other)).unwrap();
        }
    }
    fs::create_dir(at("misfit")).unwrap();
    for (from, to) in [("left.png", "im0.png"), ("right.png", "im1.png")] {
        fs::copy(at(from), at("misfit").join(to)).unwrap();
    }
    for file in ["disp0GT.pfm", "calib.txt"] {
        fs::copy(scene("slanted").join(file), at("misfit").join(file)).unwrap();
    }
    fs::create_dir(at("broken")).unwrap();
    for (from, to) in [("left.png", "im0.png"), ("text.png", "im1.png"), ("misfit/calib.txt", "calib.txt")] {
        fs::copy(at(from), at("broken").join(to)).unwrap();
    }
    fs::write(at("unknown.pfm"), b"Pf\n1 1\n-1.0\n\0\0\x80\x7f").unwrap();
    folder
}

#[test]
fn match_writes_every_output_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [left, right] = ["im0.png", "im1.png"].map(|file| scene_file("slanted", file));
    let mask = image::GrayImage::from_fn(240, 180, |x, y| image::Luma([u8::from(x > 200 && y < 9) * 9]));
    mask.save(at("mask.png")).unwrap();

    let common = ["--mask", "mask.png", "--threads", "2", "--backend", "cpu"];
    let first = ["match", &left, &right, "a.pfm", "--raw", "raw.tif", "--confidence", "confidence.png"];
    let first = [&first[..], &["--validity", "validity.png", "--preview", "preview.png"], &common].concat();
    let told = run(folder.path(), &first).succeeded();
    assert_eq!(told.stdout, "");
    assert_eq!(told.stderr.lines().count(), 1, "{}", told.stderr);
    for words in ["mrfgs: 240 x 180, 32 labels, ", " s on the CPU path, 2 threads\n"] {
        assert!(told.stderr.contains(words), "{}", told.stderr);
    }

    let map = read::read_disparity(&at("a.pfm")).unwrap();
    let raw = read::read_disparity(&at("raw.tif")).unwrap();
    let validity = read::grey8(&at("validity.png")).unwrap();
    let confidence = read::grey8(&at("confidence.png")).unwrap();
    assert_eq!([map.size(), raw.size(), validity.size(), confidence.size()], [(240, 180); 4]);
    let preview = image::open(at("preview.png")).unwrap();
    assert_eq!((preview.width(), preview.color()), (240, image::ColorType::Rgb8));
    assert!(preview.height() > 180, "the scale is below the map");
    let (mut measured, mut filled) = (0, 0);
    for y in 0..180 {
        for x in 0..240 {
            let masked = x > 200 && y < 9;
            let flags = validity[(x, y)];
            assert_eq!(masked, flags & flag::MASKED != 0, "{x}, {y}");
            assert_eq!(masked, !map[(x, y)].is_finite(), "all is filled but what is masked");
            assert_eq!(masked, !raw[(x, y)].is_finite());
            assert!(masked || (0.0..=31.0).contains(&map[(x, y)]), "{}", map[(x, y)]);
            assert_eq!(flags & !(flag::INVALID | flag::LOW_CONFIDENCE | flag::FILLED), 0);
            assert!(flags & flag::INVALID == 0 || confidence[(x, y)] == 0);
            measured += usize::from(flags == 0);
            filled += usize::from(flags & flag::FILLED != 0);
        }
    }
    assert!(measured > 20_000 && filled > 500, "{measured} measured, {filled} filled");
    assert!(confidence.data().iter().any(|&c| c > 100));
    assert!(map != raw, "post-processing does something");

    // The same map in the other formats; the number of threads changes nothing.
    for (output, raw, step) in [("b.png", "raw.png", 256.0), ("c.tiff", "raw.PFM", f32::INFINITY)] {
        let args = ["match", &left, &right, output, "--raw", raw, "--mask", "mask.png", "--threads", "1"];
        let quiet = run(folder.path(), &[&args[..], &["--quiet", "--max-disparity", "31"]].concat());
        let quiet = quiet.succeeded();
        assert_eq!((quiet.stdout, quiet.stderr), (String::new(), String::new()));
        for (name, expected) in [(output, &map), (raw, &read::read_disparity(&at("raw.tif")).unwrap())] {
            let same = read::read_disparity(&at(name)).unwrap();
            for (a, b) in same.data().iter().zip(expected.data()) {
                // In 16-bit PNG a disparity of 0 is 1/256.
                assert!(
                    a.total_cmp(b).is_eq() || (a * step - 1.0).abs() < 1e-6 && *b == 0.0,
                    "{name}: {a} and {b}"
                );
            }
        }
    }
    let tiff = fs::read(at("c.tiff")).unwrap();
    let mut decoder = tiff::decoder::Decoder::new(std::io::Cursor::new(tiff)).unwrap();
    let tiff::decoder::DecodingResult::F32(values) = decoder.read_image().unwrap() else { panic!("float") };
    assert!(values[239].is_nan() && values[0].is_finite(), "invalid is NaN in TIFF");
    let pfm = fs::read(at("a.pfm")).unwrap();
    assert!(
        pfm.ends_with(&f32::INFINITY.to_le_bytes()),
        "invalid is +inf in PFM, whose last row is the top one"
    );
    let png = image::open(at("b.png")).unwrap().into_luma16();
    assert!(png.get_pixel(239, 0).0 == [0] && png.get_pixel(0, 0).0 != [0], "invalid is 0 in PNG");

    // Without the fill, what is invalid stays so.
    let args = ["match", &left, &right, "d.pfm", "--no-fill", "--set", "fill=row", "--mask", "mask.png"];
    run(folder.path(), &[&args[..], &["--validity", "v.png"]].concat()).succeeded();
    let map = read::read_disparity(&at("d.pfm")).unwrap();
    let validity = read::grey8(&at("v.png")).unwrap();
    assert!(map.data().iter().zip(validity.data()).all(|(d, f)| d.is_finite() == (f & flag::INVALID == 0)));
    assert!(map.data().iter().filter(|d| !d.is_finite()).count() > 1000);

    let names: Vec<_> = listing(folder.path()).into_keys().collect();
    assert_eq!(names.len(), 12, "nothing else is left: {names:?}");
}

#[test]
fn ranges_may_be_negative() {
    let folder = workshop();
    // With the views swapped, every disparity has the other sign.
    let args =
        ["match", "right.png", "left.png", "out.tif", "--min-disparity", "-31", "--max-disparity", "-1"];
    run(folder.path(), &args).succeeded();
    let map = read::read_disparity(&folder.path().join("out.tif")).unwrap();
    assert_eq!(map.size(), (60, 40));
    assert!(map.data().iter().all(|d| (-31.0..=-1.0).contains(d)));
}

#[test]
fn a_range_is_found_where_none_is_given() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to) in [("im0.png", "left.png"), ("im1.png", "right.png"), ("disp0GT.pfm", "truth.pfm")] {
        fs::copy(scene("mixed").join(from), folder.path().join(to)).unwrap();
    }
    let truth = read::read_disparity(&folder.path().join("truth.pfm")).unwrap();
    let finite = || truth.data().iter().copied().filter(|d| d.is_finite());
    let (least, most) = (finite().fold(f32::MAX, f32::min), finite().fold(f32::MIN, f32::max));
    for extra in [&[][..], &["--max-disparity", "auto"][..]] {
        let args = [&["match", "left.png", "right.png", "out.pfm"], extra].concat();
        let said = run(folder.path(), &args).succeeded().stderr;
        let line = said.lines().find(|l| l.contains("by sparse matches")).expect("said on stderr");
        let numbers: Vec<f32> =
            line.split_whitespace().filter_map(|w| w.trim_end_matches(',').parse().ok()).collect();
        assert!(numbers[0] <= least && numbers[1] >= most, "{line} and the truth is {least} to {most}");
        assert!(numbers[1] - numbers[0] < 1.5 * (most - least), "{line} and the truth is {least} to {most}");
    }
    // What the user says counts.
    let args =
        ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "auto", "--min-disparity", "2"];
    assert!(run(folder.path(), &args).succeeded().stderr.contains("disparities 2 to "));
}

#[test]
fn a_pair_that_is_not_rectified_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "47"];
    for (shift, warns) in [(0, false), (2, true)] {
        for (from, to, top) in [("im0.png", "left.png", 0), ("im1.png", "right.png", shift)] {
            let image = image::open(scene("mixed").join(from)).unwrap();
            image.crop_imm(0, top, 320, 230).save(folder.path().join(to)).unwrap();
        }
        let said = run(folder.path(), &args).succeeded().stderr;
        assert_eq!(said.contains("not rectified"), warns, "{said}");
    }
}

#[test]
fn intermediates_show_every_step() {
    let folder = workshop();
    let args =
        "match left.png right.png out.pfm --max-disparity 20 --quiet --intermediates steps --set levels=3";
    let args: Vec<&str> = args.split_whitespace().collect();
    for (preset, more) in
        [("default", &[][..]), ("paper", &["corrected-left", "zones", "matches", "support-width"][..])]
    {
        run(folder.path(), &[&args[..], &["--preset", preset]].concat()).succeeded();
        let steps = folder.path().join("steps");
        let size = |name: &str| {
            let picture = image::open(steps.join(format!("{name}.png"))).unwrap();
            (picture.width(), picture.height())
        };
        assert_eq!(size("map-level-0").0, 60);
        for name in
            ["graph-degree-level-2", "map-level-2", "cost-level-0-disparity-10", "belief-entropy-nats"]
        {
            assert!(size(name).0 > 0);
        }
        for name in more {
            assert!(size(name).0 >= 60, "{name}");
        }
        assert_eq!(steps.join("zones.png").exists(), preset == "paper");
        let changes = fs::read_to_string(steps.join("change-per-iteration.csv")).unwrap();
        assert!(changes.lines().count() > 5 && changes.starts_with("iteration,rms_change_px"), "{changes}");
        assert!(listing(folder.path()).keys().all(|p| !p.to_str().unwrap().contains(".mrfgs-")));
        fs::remove_dir_all(steps).unwrap();
    }
}

#[test]
fn files_in_the_way_are_replaced_and_devices_are_not() {
    let folder = workshop();
    fs::write(folder.path().join("out.pfm"), "old").unwrap();
    let mut args = vec!["match", "left.png", "right.png", "out.pfm", "--max-disparity", "15", "--quiet"];
    if cfg!(unix) {
        args.extend(["--raw", "/dev/null", "--preview", "/dev/null"]);
    }
    run(folder.path(), &args).succeeded();
    assert_eq!(read::read_disparity(&folder.path().join("out.pfm")).unwrap().size(), (60, 40));
}

#[test]
fn a_dry_run_prints_the_plan_and_leaves_nothing() {
    let folder = workshop();
    let before = listing(folder.path());
    let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "20", "--dry-run"];
    let plan = run(folder.path(), &[&args[..], &["--quiet", "--raw", "raw.pfm"]].concat()).succeeded();
    assert_eq!(plan.stderr, "");
    for words in [
        "60 x 40 pixels, disparities 0 to 20 (21 labels)",
        "0             60 x 40    0 to 20 (21)",
        "5               2 x 2    0 to 1 (2)",
        "messages   8 bits",
        "3 iterations of levels 0 to 5",
        "KiB",
        "  all",
    ] {
        assert!(plan.stdout.contains(words), "no `{words}` in:\n{}", plan.stdout);
    }
    let paper = run(folder.path(), &[&args[..], &["--preset", "paper"]].concat()).succeeded();
    for words in
        ["16 bits", "30 iterations of levels 0 to 5", "or fewer, once the map changes by at most 0.1 px"]
    {
        assert!(paper.stdout.contains(words), "no `{words}` in:\n{}", paper.stdout);
    }
    // It finds what a real run would.
    let args = ["match", "left.png", "right.png", "none/out.pfm", "--max-disparity", "20", "--dry-run"];
    run(folder.path(), &args).failed(1, &["none", "create it"], "--dry-run");
    assert!(listing(folder.path()) == before);
}

/// What `--memory` lets a match take decides on tiles, which are told.
#[test]
fn little_memory_makes_tiles() {
    let folder = workshop();
    let (left, right) = (scene_file("thin", "im0.png"), scene_file("thin", "im1.png"));
    let args = ["match", &left, &right, "out.pfm", "--backend", "cpu"];
    let with = |more: &[&str]| run(folder.path(), &[&args[..], more].concat());
    let one = with(&["--dry-run"]).succeeded();
    assert!(!one.stdout.contains("tiles") && !one.stdout.contains("whole image"), "{one:?}");
    let tiled = with(&["--dry-run", "--memory", "12MiB"]).succeeded();
    for words in
        ["240 x 180 pixels, disparities 0 to 31 (32 labels)", "in 4 tiles of up to", "whole image", "  all"]
    {
        assert!(tiled.stdout.contains(words), "no `{words}` in:\n{}", tiled.stdout);
    }
    let told = with(&[]).succeeded();
    assert!(told.stderr.contains("32 labels, 18 iterations"), "{told:?}");
    let told = with(&["--memory", "12MiB", "--timings"]).succeeded();
    assert!(told.stderr.contains("32 labels, 4 tiles, 18 iterations"), "{told:?}");
    for (stage, runs) in [("cost", 4), ("right view", 4), ("visibility", 1), ("median", 1)] {
        let row = told.stderr.lines().find(|line| line.starts_with(&format!("{stage}  "))).unwrap();
        assert_eq!(row.split_whitespace().rev().nth(3), Some(&*runs.to_string()), "{row}");
    }
    assert_eq!(read::read_disparity(&folder.path().join("out.pfm")).unwrap().size(), (240, 180));
    // Steps of one piece are what the folder shows.
    let before = listing(folder.path());
    let refused = with(&["--memory", "12MiB", "--intermediates", "steps"]);
    refused.failed(1, &["--intermediates", "4 tiles", "give --memory"], "intermediates of tiles");
    assert!(listing(folder.path()) == before);
}

/// Arguments, separated by spaces; exit status; what the message must say: the thing and the remedy.
type Failure = (&'static str, i32, &'static [&'static str]);

/// `M` stands for a `match` that would succeed, up to its output.
const FAILURES: &[Failure] = &[
    // The command line itself.
    ("", 2, &["subcommand", "match, evaluate", "--help"]),
    ("frobnicate", 2, &["frobnicate", "--help"]),
    ("match left.png", 2, &["<RIGHT> <OUTPUT>", "mrfgs match --help"]),
    ("M out.pfm --frobnicate", 2, &["--frobnicate", "--help"]),
    ("M out.pfm --mask", 2, &["--mask", "value"]),
    ("M out.pfm surplus.pfm", 2, &["surplus.pfm", "--help"]),
    // Inputs.
    ("match none.png right.png out.pfm", 1, &["none.png", "no such file", "check the name"]),
    ("match left.png none.png out.pfm --max-disparity 9", 1, &["none.png", "no such file", "check the name"]),
    ("match folder right.png out.pfm --max-disparity 9", 1, &["folder: is a folder", "give the image file"]),
    ("match left.png folder out.pfm --max-disparity 9", 1, &["folder: is a folder", "give the image file"]),
    (
        "match left.png narrow.png out.pfm --max-disparity 9",
        1,
        &["left.png is 60 x 40", "narrow.png is 30 x 40"],
    ),
    ("match cut.png right.png out.pfm --max-disparity 9", 1, &["cut.png", "truncated", "get the file again"]),
    ("match left.png empty.png out.pfm --max-disparity 9", 1, &["empty.png", "empty", "get it again"]),
    ("match text.png right.png out.pfm --max-disparity 9", 1, &["text.png", "not an image", "give PNG"]),
    ("M out.pfm --mask narrow.png", 1, &["narrow.png is 30 x 40", "a mask has the size of the left image"]),
    ("M out.pfm --mask none.png", 1, &["none.png", "check the name"]),
    ("M out.pfm --mask text.png", 1, &["text.png", "give PNG"]),
    // Outputs.
    ("M out.jpg", 1, &["out.jpg", ".pfm (float), .tif (float) or .png"]),
    ("M out", 1, &["out:", ".pfm"]),
    ("M none/out.pfm", 1, &["none/out.pfm", "there is no folder none", "create it"]),
    ("M left.png/out.pfm", 1, &["left.png/out.pfm", "there is no folder", "create it"]),
    ("M taken.pfm", 1, &["taken.pfm", "is a folder", "name of a file"]),
    ("M out.pfm --raw taken.pfm", 1, &["taken.pfm", "is a folder"]),
    ("M out.pfm --raw raw.bmp", 1, &["raw.bmp", ".pfm"]),
    ("M out.pfm --raw none/raw.pfm", 1, &["none/raw.pfm", "create it"]),
    ("M out.pfm --confidence c.pfm", 1, &["c.pfm", "ends in .png"]),
    ("M out.pfm --validity v.tif", 1, &["v.tif", "ends in .png"]),
    ("M out.pfm --validity taken.png", 1, &["taken.png", "is a folder"]),
    ("M out.pfm --preview p.jpg", 1, &["p.jpg", "ends in .png"]),
    ("M out.pfm --preview none/p.png", 1, &["none/p.png", "create it"]),
    ("M out.png --min-disparity -1", 1, &["out.png", "-1 to 9", ".pfm or .tif"]),
    ("M out.pfm --raw raw.png --min-disparity -1", 1, &["raw.png", "-1 to 9", ".pfm or .tif"]),
    ("match left.png right.png out.png --max-disparity 256", 1, &["out.png", "0 to 256", ".pfm or .tif"]),
    ("M out.pfm --raw out.pfm", 1, &["--raw", "out.pfm is OUTPUT already", "another name"]),
    ("M out.pfm --raw ./folder/../out.pfm", 1, &["--raw", "OUTPUT", "another name"]),
    ("M a.png --preview a.png", 1, &["--preview", "a.png is OUTPUT already", "another name"]),
    (
        "M out.pfm --confidence c.png --validity c.png",
        1,
        &["--validity", "c.png is --confidence", "another name"],
    ),
    ("M left.png", 1, &["OUTPUT", "left.png is LEFT already", "another name"]),
    ("M out.pfm --preview folder/../right.png", 1, &["--preview", "is RIGHT already", "another name"]),
    ("M narrow.png --mask left.png --preview left.png", 1, &["--preview", "LEFT", "another name"]),
    // The range.
    ("match flat.png flat.png out.pfm", 1, &["--max-disparity", "too few matches"]),
    ("match flat.png flat.png out.pfm --max-disparity auto", 1, &["--max-disparity", "too few matches"]),
    ("M out.pfm --memory 2", 2, &["--memory <SIZE>", "'2'", "2GiB", "--help"]),
    ("M out.pfm --memory 1.5GiB", 2, &["--memory <SIZE>", "'1.5GiB'", "whole number"]),
    ("M out.pfm --memory 0MiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --memory 17TiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --memory 99999999999999999999TiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --set memory=0", 1, &["--set memory", "0 is outside 1 to 16777216"]),
    (
        "match left.png right.png out.pfm --max-disparity 900 --memory 1MiB",
        1,
        &["--memory", "1 MiB", "60 x 40", "at least", "smaller"],
    ),
    ("M out.pfm --intermediates folder/full", 1, &["folder/full", "not empty"]),
    ("M out.pfm --intermediates left.png", 1, &["left.png", "is a file"]),
    ("M out.pfm --intermediates none/steps", 1, &["none/steps", "no folder none", "create it"]),
    ("M out.pfm --intermediates out.pfm", 1, &["--intermediates", "out.pfm is OUTPUT", "another name"]),
    ("match damaged/left.png right.png out.pfm", 1, &["calib.txt", "line 1", "ndisp"]),
    ("match huge/left.png right.png out.pfm", 1, &["calib.txt", "ndisp=100000", "at most 16384"]),
    ("M out.pfm --max-disparity 9", 2, &["--max-disparity", "multiple times"]),
    (
        "match left.png right.png out.pfm --max-disparity many",
        2,
        &["many", "--max-disparity", "whole number"],
    ),
    ("match left.png right.png out.pfm --max-disparity 3.5", 2, &["3.5", "--max-disparity", "whole number"]),
    ("match left.png right.png out.pfm --max-disparity 99999999999", 2, &["--max-disparity", "1048576"]),
    ("match left.png right.png out.pfm --max-disparity 2000000", 1, &["--max-disparity", "out of reach"]),
    ("match left.png right.png out.pfm --max-disparity 50000", 1, &["--max-disparity", "narrow the range"]),
    ("match left.png right.png out.pfm --max-disparity -1", 1, &["--max-disparity", "-1", "--min-disparity"]),
    ("M out.pfm --min-disparity 10", 1, &["--max-disparity", "below the minimum disparity 10", "raise it"]),
    ("M out.pfm --min-disparity -2000000", 1, &["--min-disparity", "out of reach"]),
    ("M out.pfm --min-disparity few", 2, &["few", "--min-disparity", "whole number"]),
    (
        "match left.png right.png out.pfm --min-disparity 60 --max-disparity 70",
        1,
        &["--max-disparity", "60 to 70", "60 pixels wide"],
    ),
    // The method.
    ("M out.pfm --preset best", 1, &["--preset", "`best`", "default, paper"]),
    ("M out.pfm --set colour=red", 1, &["--set colour", "no such key", "mrfgs presets"]),
    ("M out.pfm --set levels", 2, &["--set", "levels=4"]),
    ("M out.pfm --set =4", 2, &["--set", "levels=4"]),
    ("M out.pfm --set levels=many", 1, &["--set levels", "1 to 16", "\"many\""]),
    ("M out.pfm --set levels=17", 1, &["--set levels", "17 is outside 1 to 16"]),
    ("M out.pfm --set cost=ncc", 1, &["--set cost", "sad | census | ad-census", "ncc"]),
    ("M out.pfm --set temperature=nan", 1, &["--set temperature", "outside"]),
    ("M out.pfm --set sad-window=4", 1, &["--set sad-window", "odd", "3 or 5"]),
    ("M out.pfm --config none.toml", 1, &["none.toml", "no such file", "check the name"]),
    ("M out.pfm --config folder", 1, &["folder"]),
    ("M out.pfm --config syntax.toml", 1, &["syntax.toml", "line 2"]),
    ("M out.pfm --config key.toml", 1, &["key.toml", "line 2", "level", "mrfgs presets"]),
    ("M out.pfm --config value.toml", 1, &["value.toml", "line 3", "temperature", "-1 is outside"]),
    ("M out.pfm --config left.png", 1, &["left.png", "TOML"]),
    // Where it runs.
    ("M out.pfm --threads 0", 2, &["--threads", "1..=1024"]),
    ("M out.pfm --threads -1", 2, &["-1"]),
    ("M out.pfm --threads 1000000", 2, &["--threads", "1..=1024"]),
    ("M out.pfm --threads two", 2, &["--threads", "two"]),
    ("M out.pfm --backend tpu", 2, &["--backend", "auto, gpu, cpu"]),
    ("M out.pfm --backend cpu --device 0", 1, &["--device", "--backend cpu"]),
    // Evaluation.
    ("evaluate", 2, &["DIR", "mrfgs evaluate --help"]),
    ("evaluate none", 1, &["none/im0.png", "disp0GT.pfm, calib.txt"]),
    ("evaluate left.png", 1, &["left.png/im0.png", "a folder to evaluate holds"]),
    ("evaluate without-im0.png", 1, &["without-im0.png/im0.png", "a folder to evaluate holds"]),
    ("evaluate without-im1.png", 1, &["without-im1.png/im1.png", "a folder to evaluate holds"]),
    ("evaluate without-disp0GT.pfm", 1, &["without-disp0GT.pfm/disp0GT.pfm", "a folder to evaluate holds"]),
    ("evaluate without-calib.txt", 1, &["without-calib.txt/calib.txt", "a folder to evaluate holds"]),
    ("evaluate misfit without-calib.txt", 1, &["without-calib.txt/calib.txt"]),
    ("evaluate misfit", 1, &["disp0GT.pfm is 240 x 180", "im0.png is 60 x 40"]),
    ("evaluate misfit --preset best", 1, &["--preset", "default, paper"]),
    ("evaluate misfit --json none/a.json", 1, &["none/a.json", "create it"]),
    ("evaluate misfit --json folder", 1, &["folder", "is a folder"]),
    ("evaluate misfit --json misfit/calib.txt", 1, &["--json", "misfit/calib.txt", "another name"]),
    ("evaluate --disparity unknown.pfm", 2, &["--truth"]),
    ("evaluate --truth unknown.pfm", 2, &["--disparity"]),
    ("evaluate misfit --disparity unknown.pfm --truth unknown.pfm", 2, &["DIR", "--disparity"]),
    ("evaluate --levels 3 --disparity unknown.pfm --truth unknown.pfm", 2, &["--levels"]),
    ("evaluate --preset paper --disparity unknown.pfm --truth unknown.pfm", 2, &["--preset", "--disparity"]),
    ("evaluate --disparity none.pfm --truth unknown.pfm", 1, &["none.pfm", "check the name"]),
    ("evaluate --disparity left.png --truth unknown.pfm", 1, &["left.png", "channel", "16-bit .png"]),
    ("evaluate --disparity unknown.pfm --truth unknown.pfm", 1, &["unknown.pfm", "no known disparity"]),
    (
        "evaluate --disparity unknown.pfm --truth misfit/disp0GT.pfm",
        1,
        &["240 x 180", "unknown.pfm is 1 x 1"],
    ),
    (
        "evaluate --disparity misfit/disp0GT.pfm --truth misfit/disp0GT.pfm --mask left.png",
        1,
        &["left.png is 60 x 40", "240 x 180"],
    ),
    // Benches.
    ("bench none", 1, &["none/im0.png", "a folder to match holds im0.png, im1.png, calib.txt; or"]),
    ("bench left.png", 1, &["left.png/im0.png", "a folder to match holds"]),
    ("bench misfit without-im1.png", 1, &["without-im1.png/im1.png", "a folder to match holds im0.png"]),
    ("bench misfit without-calib.txt", 1, &["without-calib.txt/calib.txt", "a folder to match holds"]),
    ("bench broken --backend cpu", 1, &["broken/im1.png", "not an image", "give PNG"]),
    ("bench broken --backend cpu --preset fgs --json a.json", 1, &["broken/im1.png", "not an image"]),
    ("bench misfit --repeats 0", 2, &["--repeats", "1..=1000"]),
    ("bench misfit --repeats some", 2, &["--repeats", "some"]),
    ("bench misfit --large", 2, &["--large", "DIR"]),
    ("bench misfit --backend auto", 2, &["--backend", "cpu, gpu, both"]),
    ("bench misfit --backend cpu --device 0", 1, &["--device", "--backend cpu"]),
    ("bench misfit --backend both --threads 0", 2, &["--threads", "1..=1024"]),
    ("bench misfit --preset best", 1, &["--preset", "default, paper"]),
    ("bench misfit --set levels=17", 1, &["--set levels", "17 is outside 1 to 16"]),
    ("bench misfit --config key.toml", 1, &["key.toml", "line 2", "mrfgs presets"]),
    ("bench misfit --json none/a.json", 1, &["none/a.json", "create it"]),
    ("bench misfit --json folder", 1, &["folder", "is a folder"]),
    ("bench misfit --json misfit/im1.png", 1, &["--json", "misfit/im1.png", "another name"]),
    ("presets best", 1, &["`best`", "default, paper"]),
];

#[test]
fn every_failure_is_one_line_and_leaves_nothing() {
    let folder = workshop();
    let before = listing(folder.path());
    for (line, code, words) in FAILURES {
        let words_of_line = line.replacen("M ", "match left.png right.png --max-disparity 9 ", 1);
        let args: Vec<&str> = words_of_line.split_whitespace().collect();
        run(folder.path(), &args).failed(*code, words, line);
        assert!(listing(folder.path()) == before, "{line}: the folder has changed");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let folder = workshop();
    let mut locked = folder.path().join("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(locked.join("probe"), "").is_ok() {
        // This is root, who may write anywhere but where the kernel says no.
        locked = "/sys".into();
    }
    let output = locked.join("out.pfm");
    let output = output.to_str().unwrap();
    for outputs in [[output, "raw.pfm"], ["out.pfm", output]] {
        let args =
            ["match", "left.png", "right.png", outputs[0], "--raw", outputs[1], "--max-disparity", "9"];
        run(folder.path(), &args).failed(1, &[output, "no file can be created"], "locked");
        assert!(!folder.path().join("out.pfm").exists());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_was_written_before_a_failure_is_removed() {
    let folder = workshop();
    let before = listing(folder.path());
    // The disk that is always full lets itself be opened.
    for full in ["--raw", "--validity", "--preview"] {
        let args = ["match", "left.png", "right.png", "out.pfm", "--confidence", "c.png", full, "/dev/full"];
        let args = [&args[..], &["--max-disparity", "9", "--quiet"]].concat();
        run(folder.path(), &args).failed(1, &["/dev/full", "No space left"], full);
        assert!(listing(folder.path()) == before, "{full}");
    }
    assert!(Path::new("/dev/full").exists());
}

/// A machine without any Vulkan driver; Metal is always there.
const NO_DRIVER: &[(&str, &str)] =
    &[("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent"), ("VK_ADD_DRIVER_FILES", "")];

#[cfg(not(target_os = "macos"))]
#[test]
fn without_a_driver_auto_takes_the_cpu_path() {
    let folder = workshop();
    let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "9", "--backend", "auto"];
    let told = run_with(folder.path(), &args, NO_DRIVER).succeeded();
    assert!(told.stderr.contains(" on the CPU path, "), "{}", told.stderr);
    let told = run_with(folder.path(), &["devices"], NO_DRIVER).succeeded();
    assert_eq!(told.stdout, "no Vulkan or Metal driver found: `auto` takes the CPU path\n");
}

#[cfg(not(target_os = "macos"))]
#[test]
fn without_a_driver_gpu_says_what_to_do() {
    let folder = workshop();
    let before = listing(folder.path());
    let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "9", "--backend", "gpu"];
    let told = run_with(folder.path(), &args, NO_DRIVER);
    told.failed(1, &["driver", "install", "--backend cpu"], "--backend gpu without a driver");
    let told = run_with(folder.path(), &[&args[..], &["--device", "0"]].concat(), NO_DRIVER);
    told.failed(1, &["driver", "install", "--backend cpu"], "--device 0 without a driver");
    for backend in ["gpu", "both"] {
        let args = ["bench", "misfit", "--json", "a.json", "--backend", backend];
        let told = run_with(folder.path(), &args, NO_DRIVER);
        told.failed(1, &["driver", "install", "--backend cpu"], "bench without a driver");
    }
    assert!(listing(folder.path()) == before);
}

#[test]
fn timings_name_every_stage() {
    let folder = workshop();
    let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "9", "--timings"];
    let table = run(folder.path(), &[&args[..], &["--backend", "cpu"]].concat()).succeeded().stderr;
    let row = |name: &str| table.lines().find(|l| l.starts_with(name)).map(str::to_owned);
    for stage in [
        "stage ",
        "graph ",
        "cost ",
        "pyramid, level 5",
        "flood, level 0",
        "region filter ",
        "median ",
        "download ",
        "rest ",
        "all ",
    ] {
        assert!(row(stage).is_some(), "no `{stage}` in:\n{table}");
    }
    assert!(row("all ").unwrap().ends_with(" 100.0 %"), "{table}");
    assert!(row("flood, level 5").unwrap().split_whitespace().nth(3) == Some("18"), "{table}");
    assert!(!table.contains("dispatches"), "{table}");
    let told = run(folder.path(), &[&args[..], &["--quiet"]].concat());
    told.failed(2, &["--timings", "--quiet"], "--quiet and --timings");
}

/// Whether there is a driver to run on; a panic where there is none and `MRFGS_REQUIRE_GPU` is set and not 0.
fn has_gpu() -> bool {
    let found = !gpu::devices().is_empty();
    let required = std::env::var("MRFGS_REQUIRE_GPU").is_ok_and(|v| v != "0" && !v.is_empty());
    assert!(found || !required, "MRFGS_REQUIRE_GPU is set and there is no driver");
    if !found {
        // Past the capture of the test harness: a test without its GPU must not look like one that passed.
        let _ = writeln!(std::io::stderr(), "SKIPPED on the GPU: there is no driver");
    }
    found
}

#[test]
fn a_bench_gives_every_figure_of_both_backends() {
    let folder = workshop();
    let (backends, which) = if has_gpu() { (&["cpu", "gpu"][..], "both") } else { (&["cpu"][..], "cpu") };
    let args = ["bench", "misfit", "without-disp0GT.pfm", "--repeats", "2", "--json", "out.json"];
    let more = ["--backend", which, "--threads", "2", "--set", "levels=1", "--set", "percentile=92"];
    let told = run(folder.path(), &[&args[..], &more].concat()).succeeded();
    let json = fs::read_to_string(folder.path().join("out.json")).unwrap();
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&json["threads"], &json["repeats"]), (&2.into(), &2.into()));

    let pairs = json["pairs"].as_array().unwrap();
    let expected = [("misfit", 60, 40), ("without-disp0GT.pfm", 240, 180)];
    let expected = expected.iter().flat_map(|pair| ["default", "paper"].map(|preset| (pair, preset)));
    assert_eq!(pairs.len(), 4);
    for (pair, (&(name, width, height), preset)) in pairs.iter().zip(expected) {
        let what = format!("{name}, preset {preset}");
        assert_eq!((&pair["name"], &pair["preset"]), (&name.into(), &preset.into()));
        assert_eq!((&pair["width"], &pair["height"]), (&width.into(), &height.into()), "{what}");
        assert_eq!(pair["labels"], 32, "{what}");
        assert!(
            told.stdout.contains(&format!("{what}: {width} x {height} pixels, 32 labels")),
            "{}",
            told.stdout
        );
        let method = &json["methods"][preset];
        assert_eq!(method["levels"], 1, "--set counts for every preset");
        assert_eq!(pair["backends"].as_object().unwrap().len(), backends.len());

        for &backend in backends {
            let found = &pair["backends"][backend];
            let value = |key: &str| {
                let value = found[key].as_f64().unwrap_or_else(|| panic!("{what}, {backend}: no {key}"));
                assert!(value > 0.0 && value.is_finite(), "{what}, {backend}: {key} is {value}");
                value
            };
            assert!(told.stderr.contains(&format!("{what}, {backend}: ")), "{}", told.stderr);
            assert_eq!(found["ran_on"].as_str().unwrap().starts_with("the CPU path"), backend == "cpu");
            let runs: Vec<f64> =
                found["runs_ms"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
            assert_eq!(runs.len(), 2);
            assert!(runs.contains(&value("min_ms")) && runs.contains(&value("max_ms")));
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
            assert!(close(value("median_ms"), f64::midpoint(runs[0], runs[1])));

            // One level, 5 members, and messages and beliefs of 1 or 2 bytes.
            let (iterations, cells) = (value("iterations"), f64::from(width * height * 32));
            let wide = if preset == "paper" { 2.0 } else { 1.0 };
            assert!(close(value("label_updates"), iterations * 5.0 * cells), "{what}, {backend}");
            let message_values = value("message_bytes") / (iterations * cells);
            // Where messages and beliefs come in one sweep, the five messages are not read once more.
            let swept = if backend == "cpu" { 5.0 } else { 0.0 };
            assert!(close(message_values, (17.0 - swept) * wide + 1.0), "{message_values}");
            for (key, count, time) in [
                ("message_gupdates_per_s", "label_updates", "message_ms"),
                ("match_gupdates_per_s", "label_updates", "median_ms"),
                ("message_gb_per_s", "message_bytes", "message_ms"),
            ] {
                assert!(close(value(key), value(count) / value(time) / 1e6), "{what}, {backend}: {key}");
            }
            assert!(close(value("copy_share"), 100.0 * value("message_gb_per_s") / value("copy_gb_per_s")));

            let stages = found["stages"].as_object().unwrap();
            assert!(stages.values().all(|ms| ms.as_f64().is_some_and(|ms| ms >= 0.0)), "{stages:?}");
            let messages = if backend == "cpu" { "flood, level 0" } else { "dependency, level 0" };
            for stage in ["graph", "cost", messages, "median"] {
                assert!(stages.contains_key(stage), "no {stage} in {stages:?}");
            }
            assert_eq!(stages.contains_key("zones"), preset == "paper");
            assert_eq!(found["device_bytes"].is_null(), backend == "cpu");
            if backend == "gpu" {
                assert!(value("device_bytes") >= value("plan_bytes") / 2.0, "{what}");
            }
            if cfg!(target_os = "linux") {
                assert!(value("processor_ms") > 0.0);
                assert!(value("peak_bytes") > cells, "{what}, {backend}");
            }
        }
        // The same bits take the same work.
        for key in ["iterations", "label_updates", "plan_bytes"] {
            let of = |backend: &&str| &pair["backends"][*backend][key];
            assert!(backends.iter().all(|backend| of(backend) == of(&"cpu")), "{what}: {key}");
        }
    }

    // A single case, printed.
    let args = ["bench", "misfit", "--preset", "fgs", "--backend", "cpu", "--repeats", "1", "--json", "-"];
    let pairs = &run(folder.path(), &args).succeeded().json()["pairs"];
    assert_eq!((pairs.as_array().unwrap().len(), &pairs[0]["preset"]), (1, &"fgs".into()));
    assert_eq!(pairs[0]["backends"]["gpu"], Value::Null);
}

#[test]
fn a_bench_without_folders_makes_up_its_pair() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["bench", "--preset", "default", "--backend", "cpu", "--repeats", "1", "--set", "levels=1"];
    let told = run(folder.path(), &args).succeeded();
    assert!(told.stdout.contains("small, preset default: 450 x 375 pixels, 60 labels"), "{}", told.stdout);
    assert!(listing(folder.path()).is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn a_bench_that_cannot_be_written_fails() {
    let folder = workshop();
    let before = listing(folder.path());
    let args = ["bench", "misfit", "--preset", "default", "--backend", "cpu", "--repeats", "1"];
    let told = run(folder.path(), &[&args[..], &["--json", "/dev/full"]].concat());
    assert_eq!((told.code, told.stdout.as_str()), (Some(1), ""), "{told:?}");
    assert!(told.stderr.lines().last().unwrap().contains("/dev/full"), "{told:?}");
    assert!(listing(folder.path()) == before);
}

#[test]
fn an_unknown_device_is_named() {
    let folder = workshop();
    let before = listing(folder.path());
    for device in ["no-such-device", "999"] {
        if has_gpu() {
            let args = ["bench", "misfit", "--device", device, "--json", "a.json"];
            run(folder.path(), &args).failed(1, &["--device", device, "mrfgs devices"], device);
        }
        let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "9", "--device", device];
        run(folder.path(), &args).failed(1, &["--device", device, "mrfgs devices"], device);
    }
    assert!(listing(folder.path()) == before);
}

#[test]
fn devices_say_what_auto_takes() {
    let folder = tempfile::tempdir().unwrap();
    let told = run(folder.path(), &["devices"]).succeeded();
    let last = told.stdout.lines().last().unwrap();
    assert!(last.contains("`auto` takes "), "{}", told.stdout);
}

/// Every number of a report, by its place in the JSON.
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
fn evaluate_gives_figures_and_the_same_for_a_written_map() {
    let folder = tempfile::tempdir().unwrap();
    let dirs = ["slanted", "exposure"].map(|name| scene(name).to_str().unwrap().to_owned());
    let told = run(folder.path(), &["evaluate", &dirs[0], &dirs[1], "--json", "out.json"]).succeeded();
    let lines: Vec<&str> = told.stdout.lines().collect();
    assert_eq!(lines.len(), 3 + 4 + 3, "{}", told.stdout);
    for (line, start) in
        [(3, "slanted      raw   |"), (5, "exposure     raw   |"), (8, "mean         raw   |")]
    {
        assert!(lines[line].starts_with(start), "{}", told.stdout);
        assert!(lines[line + 1].starts_with("             final |"), "{}", told.stdout);
    }

    let json: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out.json")).unwrap()).unwrap();
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

    let at = |file: &str| scene_file("slanted", file);
    let (left, right, truth, mask) = (at("im0.png"), at("im1.png"), at("disp0GT.pfm"), at("mask0nocc.png"));
    run(folder.path(), &["match", &left, &right, "map.pfm", "--raw", "raw.pfm", "--quiet"]).succeeded();
    for (map, file) in [("final", "map.pfm"), ("raw", "raw.pfm")] {
        let args = ["evaluate", "--disparity", file, "--truth", &truth, "--mask", &mask, "--json", "-"];
        let told = run(folder.path(), &args).succeeded();
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
    // Without the mask there is a table all the same.
    let args = ["evaluate", "--disparity", "map.pfm", "--truth", &truth];
    let told = run(folder.path(), &args).succeeded();
    assert!(told.stdout.contains("map          final |"), "{}", told.stdout);
}

#[test]
fn the_later_word_counts() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("my.toml"),
        "levels = 3\niterations = 2\ncost = \"ad-census\"\noutside-cost = 1\n",
    )
    .unwrap();
    let dir = scene("wall").to_str().unwrap().to_owned();
    let args = ["evaluate", &dir, "--json", "-", "--set", "levels=2", "--set", "levels=1"];
    let told = run(folder.path(), &[&args[..], &["--preset", "paper", "--config", "my.toml"]].concat());
    let method = &told.succeeded().json()["method"];
    assert_eq!(method["levels"], 1, "--set after --config, the last --set last");
    assert_eq!(method["iterations"], 2, "--config after --preset");
    assert_eq!((&method["cost"], &method["outside-cost"]), (&"ad-census".into(), &1.0.into()));
    assert_eq!(method["potential"], "hard", "--preset before all");
}

#[test]
fn presets_can_be_pasted_into_a_config_file() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _) in options::PRESETS {
        let told = run(folder.path(), &["presets", name]).succeeded();
        let path = folder.path().join("pasted.toml");
        fs::write(&path, &told.stdout).unwrap();
        for (other, _) in options::PRESETS {
            let mut method = Method::preset(other).unwrap();
            method.load(&path).unwrap();
            assert_eq!(method, Method::preset(name).unwrap(), "{name} over {other}");
        }
    }
    let listing = run(folder.path(), &["presets"]).succeeded().stdout;
    for (key, unit, _) in options::keys() {
        let line = listing.lines().find(|l| l.split(' ').next() == Some(&key)).unwrap();
        assert!(line.contains(unit), "{line}");
        for (name, _) in options::PRESETS {
            let value = Method::preset(name).unwrap().table()[&key].to_string().replace('"', "");
            assert!(line.split_whitespace().any(|word| word == value), "{value} in {line}");
        }
    }
    assert!(listing.lines().all(|l| l.chars().count() <= 110), "lines fit a terminal");
}

#[test]
fn help_teaches() {
    let folder = tempfile::tempdir().unwrap();
    let help = |args: &[&str]| {
        let told = run(folder.path(), args).succeeded();
        assert_eq!(told.stderr, "");
        // As it is wrapped depends on the terminal.
        told.stdout.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let text = help(&["match", "--help"]);
    for (bit, what) in [
        (flag::OUTSIDE, "match outside the right image"),
        (flag::OCCLUDED, "occluded"),
        (flag::SMALL_REGION, "in a small region"),
        (flag::LOW_CONFIDENCE, "low confidence"),
        (flag::FILLED, "filled"),
        (flag::MASKED, "masked"),
    ] {
        assert!(text.contains(&format!("{bit} {what}")), "{bit} {what}");
    }
    for words in ["Examples:", "[default: 0, or", "ndisp - 1", "in pixels"] {
        assert!(text.contains(words), "{words}");
    }
    assert!(help(&["--help"]).contains("Exit status: 0"));
    assert!(help(&["evaluate", "--help"]).contains("mask0nocc.png"));
    assert!(help(&["presets", "--help"]).contains("Examples:"));
    assert!(help(&["bench", "--help"]).contains("[default: default and paper,"));
    assert_eq!(help(&["--version"]), format!("mrfgs {}", env!("CARGO_PKG_VERSION")));
}

#[cfg(target_os = "linux")]
#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_mrfgs"))
        .arg("presets")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0), "{output:?}");
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_mrfgs")).arg("presets").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("standard output") && text.lines().count() == 1, "{text}");
}
