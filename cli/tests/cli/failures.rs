//! What goes wrong: one line that says so, and nothing left behind.

use std::fs;
use std::path::Path;

use super::{NO_DRIVER, has_gpu, listing, run, run_with, workshop};

/// Arguments, separated by spaces; exit status; what the message must say: the thing and the remedy.
type Failure = (&'static str, i32, &'static [&'static str]);

/// `M` stands for a `match` that would succeed, up to its output.
const FAILURES: &[Failure] = &[
    // The command line itself.
    ("", 2, &["subcommand", "match, batch, evaluate", "--help"]),
    ("frobnicate", 2, &["frobnicate", "--help"]),
    ("match left.png", 2, &["<RIGHT> <OUTPUT>", "mrfgs match --help"]),
    ("completions", 2, &["<SHELL>", "mrfgs completions --help"]),
    ("completions tcsh", 2, &["tcsh", "bash", "zsh"]),
    ("man none/man1", 1, &["none/man1", "no folder", "create that first"]),
    ("man left.png", 1, &["left.png"]),
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
    (
        "match flipped.png right.png out.pfm --max-disparity 9",
        1,
        &["flipped.png", "CRC error", "while decoding IDAT chunk"],
    ),
    ("M out.pfm --no-data none", 2, &["--no-data", "none"]),
    ("match left.png empty.png out.pfm --max-disparity 9", 1, &["empty.png", "empty", "get it again"]),
    ("match text.png right.png out.pfm --max-disparity 9", 1, &["text.png", "not an image", "give PNG"]),
    ("match a.gif right.png out.pfm --max-disparity 9", 1, &["a.gif", "is a gif file", "give PNG"]),
    ("match left.png a.jpg out.pfm --max-disparity 9", 1, &["a.jpg", "no end", "get the file again"]),
    ("match left.png a.pgm out.pfm --max-disparity 9", 1, &["a.pgm", "truncated", "get the file again"]),
    ("match left.png a.pfm out.pfm --max-disparity 9", 1, &["a.pfm", "the scale", "no number other than 0"]),
    ("match left.png a.tif out.pfm --max-disparity 9", 1, &["a.tif", "get the file again"]),
    (
        "match left.png palette.tif out.pfm --max-disparity 9",
        1,
        &["palette.tif", "the TIFF palette is missing", "convert it to PNG"],
    ),
    ("match left.png unknown.pfm out.pfm --max-disparity 9", 1, &["unknown.pfm is 1 x 1", "one size"]),
    (
        "match unknown.pfm dot.png out.pfm --max-disparity 0",
        1,
        &["unknown.pfm holds float values", "one format"],
    ),
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
    ("M out.pfm --raw out.pfm", 2, &["--raw", "out.pfm is OUTPUT already", "another name"]),
    ("M out.pfm --raw ./folder/../out.pfm", 2, &["--raw", "OUTPUT", "another name"]),
    ("M a.png --preview a.png", 2, &["--preview", "a.png is OUTPUT already", "another name"]),
    (
        "M out.pfm --confidence c.png --validity c.png",
        2,
        &["--validity", "c.png is --confidence", "another name"],
    ),
    ("M left.png", 2, &["OUTPUT", "left.png is LEFT already", "another name"]),
    ("M out.pfm --preview folder/../right.png", 2, &["--preview", "is RIGHT already", "another name"]),
    ("M narrow.png --mask left.png --preview left.png", 2, &["--preview", "LEFT", "another name"]),
    ("M out.pfm --json none/a.json", 1, &["none/a.json", "create it"]),
    ("M out.pfm --json folder", 1, &["folder", "is a folder"]),
    ("M out.pfm --json right.png", 2, &["--json", "right.png is RIGHT", "another name"]),
    ("M - --json -", 2, &["--json", "- is OUTPUT already", "another name"]),
    ("M out.pfm --raw -", 1, &["-:", ".pfm"]),
    ("M out.pfm --side-by-side", 2, &["--preview", "--help"]),
    ("M out.pfm --colours grey", 2, &["--preview", "--help"]),
    ("M out.pfm --preview p.png --colours jet", 2, &["--colours", "'jet'", "turbo, viridis, grey"]),
    ("M taken.pfm/out.pfm --intermediates taken.pfm", 2, &["OUTPUT", "folder of --intermediates"]),
    // Cameras.
    ("M out.pfm --depth z.pfm", 2, &["--depth", "no calib.txt beside left.png", "--calib"]),
    ("M out.pfm --point-cloud c.ply", 2, &["--point-cloud", "no calib.txt beside left.png", "--calib"]),
    (
        "match silent/left.png right.png out.pfm --max-disparity 9 --depth z.pfm",
        1,
        &["silent/calib.txt", "does not say cam0 and doffs and baseline", "cam0=[f 0 cx; 0 f cy; 0 0 1]"],
    ),
    (
        "M out.pfm --calib half/calib.txt --point-cloud c.ply",
        1,
        &["half/calib.txt", "say doffs and baseline"],
    ),
    ("M out.pfm --calib zero/calib.txt --depth z.tif", 1, &["zero/calib.txt", "baseline=0 is not above 0"]),
    (
        "M out.pfm --calib larger/calib.txt --depth z.tif",
        1,
        &["larger/calib.txt is for images of 120 x 80", "left.png is 60 x 40"],
    ),
    ("M out.pfm --calib none.txt", 1, &["none.txt", "no such file", "check the name"]),
    ("M out.pfm --calib damaged/calib.txt", 1, &["damaged/calib.txt", "line 1", "ndisp"]),
    ("M out.pfm --calib camera/calib.txt --depth z.png", 1, &["z.png", ".pfm or .tif (float)"]),
    ("M out.pfm --calib camera/calib.txt --depth none/z.pfm", 1, &["none/z.pfm", "create it"]),
    ("M out.pfm --calib camera/calib.txt --depth ./out.pfm", 2, &["--depth", "OUTPUT", "another name"]),
    ("M out.pfm --calib camera/calib.txt --point-cloud c.pcd", 1, &["c.pcd", "ends in .ply"]),
    ("M out.pfm --calib camera/calib.txt --point-cloud none/c.ply", 1, &["none/c.ply", "create it"]),
    (
        "M out.pfm --calib camera/calib.txt --json camera/calib.txt",
        2,
        &["--json", "the calibration file", "another name"],
    ),
    // The range.
    ("match flat.png flat.png out.pfm", 1, &["too few matches", "--max-disparity"]),
    ("match flat.png flat.png out.pfm --max-disparity auto", 1, &["--max-disparity", "too few matches"]),
    ("M out.pfm --memory 2", 2, &["--memory <SIZE>", "'2'", "2GiB", "--help"]),
    ("M out.pfm --memory 1.5GiB", 2, &["--memory <SIZE>", "'1.5GiB'", "whole number"]),
    ("M out.pfm --memory 0MiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --memory 17TiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --memory 99999999999999999999TiB", 2, &["--memory <SIZE>", "from 1MiB to 16TiB"]),
    ("M out.pfm --set memory=0", 2, &["--set memory", "0 is outside 1 to 16777216"]),
    (
        "match left.png right.png out.pfm --max-disparity 900 --memory 1MiB",
        2,
        &["--memory", "1 MiB", "60 x 40", "at least", "smaller"],
    ),
    ("M out.pfm --intermediates folder/full", 1, &["folder/full", "not empty"]),
    ("M out.pfm --intermediates left.png", 1, &["left.png", "is a file"]),
    ("M out.pfm --intermediates none/steps", 1, &["none/steps", "no folder none", "create it"]),
    ("M out.pfm --intermediates out.pfm", 2, &["--intermediates", "out.pfm is OUTPUT", "another name"]),
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
    ("match left.png right.png out.pfm --max-disparity 2000000", 2, &["--max-disparity", "1048576 of 0"]),
    ("match left.png right.png out.pfm --max-disparity 50000", 2, &["--max-disparity", "narrow the range"]),
    ("match left.png right.png out.pfm --max-disparity -1", 2, &["--max-disparity", "-1", "--min-disparity"]),
    ("M out.pfm --min-disparity 10", 2, &["--max-disparity", "below the minimum disparity 10", "raise it"]),
    ("M out.pfm --min-disparity -2000000", 2, &["--min-disparity", "1048576 of 0"]),
    ("M out.pfm --min-disparity few", 2, &["few", "--min-disparity", "whole number"]),
    (
        "match left.png right.png out.pfm --min-disparity 60 --max-disparity 70",
        2,
        &["--max-disparity", "60 to 70", "60 pixels wide"],
    ),
    // The method.
    ("M out.pfm --preset best", 2, &["--preset", "`best`", "default, paper"]),
    ("M out.pfm --set colour=red", 2, &["--set colour", "no such key", "mrfgs presets"]),
    ("M out.pfm --set levels", 2, &["--set", "levels=4"]),
    ("M out.pfm --set =4", 2, &["--set", "levels=4"]),
    ("M out.pfm --set levels=many", 2, &["--set levels", "1 to 16", "\"many\""]),
    ("M out.pfm --set levels=17", 2, &["--set levels", "17 is outside 1 to 16"]),
    ("M out.pfm --set matching=ncc", 2, &["--set matching", "sad | census | ad-census", "ncc"]),
    ("M out.pfm --set schedule=2", 2, &["--set schedule", "is a group", "order, iterations"]),
    ("M out.pfm --set graph.sad-window=7", 2, &["--set graph.sad-window", "it is `cost.sad-window`"]),
    ("M out.pfm --set temperature=nan", 2, &["--set temperature", "outside"]),
    ("M out.pfm --set sad-window=4", 2, &["--set sad-window", "odd", "3 or 5"]),
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
    ("M out.pfm --backend cpu --device 0", 2, &["--device", "--backend cpu"]),
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
    ("evaluate misfit --preset best", 2, &["--preset", "default, paper"]),
    ("evaluate misfit --json none/a.json", 1, &["none/a.json", "create it"]),
    ("evaluate misfit --json folder", 1, &["folder", "is a folder"]),
    ("evaluate misfit --json misfit/calib.txt", 2, &["--json", "misfit/calib.txt", "another name"]),
    ("evaluate misfit --submission subs", 2, &["--submission <DIR> <METHOD>", "2 values"]),
    ("evaluate misfit --submission subs a.b", 2, &["--submission", "a.b is no METHOD", "letters, digits"]),
    ("evaluate misfit --submission subs X_s", 2, &["--submission", "X_s", "sparse", "another METHOD"]),
    ("evaluate misfit --submission none/subs X", 1, &["none/subs", "create it"]),
    ("evaluate misfit --submission folder/full X", 1, &["folder/full", "not empty"]),
    ("evaluate misfit ./misfit --submission subs X", 2, &["two pairs are called misfit", "rename"]),
    ("evaluate misfit --submission subs X --tables", 2, &["--submission", "--tables"]),
    ("evaluate misfit --submission subs X --report subs", 2, &["--submission", "folder of --report"]),
    (
        "evaluate misfit --submission taken.png X --json taken.png/a.json",
        2,
        &["--json", "folder of --submission"],
    ),
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
    // Batches.
    ("batch", 2, &["<LIST> <OUTDIR>", "mrfgs batch --help"]),
    ("batch none.csv out", 1, &["none.csv", "no such file", "check the name"]),
    ("batch left.png out", 1, &["left.png", "UTF-8", "CSV"]),
    ("batch empty.png out", 1, &["empty.png", "lists no pair", "CSV"]),
    ("batch folder/full out", 1, &["folder/full", "lists no pair"]),
    ("batch pairs.csv none/out", 1, &["none/out", "there is no folder none", "create it"]),
    ("batch pairs.csv left.png", 1, &["left.png", "is a file", "folder"]),
    ("batch pairs.csv .", 1, &["./left.png", "is an input", "another folder"]),
    ("batch . zero", 1, &["zero", "the folder of the pairs", "give another"]),
    ("batch pairs.csv out --shard 0/3", 2, &["--shard", "'0/3'", "K/N", "--help"]),
    ("batch pairs.csv out --shard 4/3", 2, &["--shard", "K from 1 to N"]),
    ("batch pairs.csv out --shard 2", 2, &["--shard", "2/8"]),
    ("batch pairs.csv out --format jpg", 2, &["--format", "pfm, tif, png"]),
    ("batch pairs.csv out --preset best", 2, &["--preset", "default, paper"]),
    ("batch pairs.csv out --set levels=17", 2, &["--set levels", "17 is outside 1 to 16"]),
    ("batch pairs.csv out --backend cpu --device 0", 2, &["--device", "--backend cpu"]),
    ("batch pairs.csv out --quiet --timings", 2, &["--quiet", "--timings"]),
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
    ("bench misfit --backend cpu --device 0", 2, &["--device", "--backend cpu"]),
    ("bench misfit --backend both --threads 0", 2, &["--threads", "1..=1024"]),
    ("bench misfit --preset best", 2, &["--preset", "default, paper"]),
    ("bench misfit --set levels=17", 2, &["--set levels", "17 is outside 1 to 16"]),
    ("bench misfit --config key.toml", 1, &["key.toml", "line 2", "mrfgs presets"]),
    ("bench misfit --json none/a.json", 1, &["none/a.json", "create it"]),
    ("bench misfit --json folder", 1, &["folder", "is a folder"]),
    ("bench misfit --json misfit/im1.png", 2, &["--json", "misfit/im1.png", "another name"]),
    ("presets best", 2, &["`best`", "default, paper"]),
];

#[test]
fn every_failure_is_one_line_and_leaves_nothing() {
    let folder = workshop();
    let before = listing(folder.path());
    let mut other = Vec::new();
    for (line, code, words) in FAILURES {
        let words_of_line = line.replacen("M ", "match left.png right.png --max-disparity 9 ", 1);
        let args: Vec<&str> = words_of_line.split_whitespace().collect();
        let told = run(folder.path(), &args);
        if told.code != Some(*code) {
            other.push((*line, told));
            continue;
        }
        told.failed(*code, words, line);
        assert!(
            !told.stderr.contains("{ ") && !told.stderr.contains("Some("),
            "Rust's own words: {}",
            told.stderr
        );
        assert!(listing(folder.path()) == before, "{line}: the folder has changed");
    }
    assert!(other.is_empty(), "another exit status: {other:#?}");
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
    for full in ["--raw", "--validity", "--preview", "--depth", "--point-cloud", "--json"] {
        let args = ["match", "left.png", "right.png", "out.pfm", "--confidence", "c.png", full, "/dev/full"];
        let args =
            [&args[..], &["--calib", "camera/calib.txt", "--intermediates", "steps", "--quiet"]].concat();
        run(folder.path(), &args).failed(1, &["/dev/full", "No space left"], full);
        assert!(listing(folder.path()) == before, "{full}");
    }
    assert!(Path::new("/dev/full").exists());
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
fn an_unknown_device_is_named() {
    let folder = workshop();
    let before = listing(folder.path());
    for device in ["no-such-device", "999"] {
        if has_gpu() {
            let args = ["bench", "misfit", "--device", device, "--json", "a.json"];
            run(folder.path(), &args).failed(2, &["--device", device, "mrfgs devices"], device);
        }
        let args = ["match", "left.png", "right.png", "out.pfm", "--max-disparity", "9", "--device", device];
        run(folder.path(), &args).failed(2, &["--device", device, "mrfgs devices"], device);
    }
    assert!(listing(folder.path()) == before);
}
