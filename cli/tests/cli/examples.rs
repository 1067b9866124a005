//! The examples of the README and of all pages of the guide: each runs as written and prints the lines below it, or is listed here with the reason why it
//! is not run.

use super::documents::guide;
use super::recordings::record_drive;
use super::*;

/// The first lines of examples that are not run, with reasons.
const NOT_RUN: &[(&str, &str)] = &[
    // These install, build or serve.
    ("cargo install --locked --path cli", "installs"),
    ("pip install ./python", "installs; scripts/python tries it"),
    ("scripts/c --install ~/.local", "installs; scripts/c tries it"),
    ("cargo add --path path/to/mrfgs", "changes another crate"),
    ("scripts/web --serve", "takes Node.js"),
    ("scripts/web", "takes Node.js"),
    ("scripts/web --serve 8000", "takes Node.js"),
    ("scripts/web --test", "needs Node.js and browsers"),
    ("scripts/test", "runs this"),
    ("cargo run --release --example render-scenes -- film passing 320 240 48 8", "compiles"),
    ("scripts/recordings --example drive.mcap", "installs Python packages"),
    ("export PKG_CONFIG_PATH=~/.local/lib/pkgconfig LD_LIBRARY_PATH=~/.local/lib", "scripts/c tries it"),
    ("cc video.c $(pkg-config --cflags --libs mrfgs)", "scripts/c tries it"),
    (
        "matched = mrfgs.match(left, right, 63, prior=points)                    # shape (n, 3) or (n, 4)",
        "Python; its tests try it",
    ),
    ("matcher = mrfgs.Matcher(device=\"cpu\", threads=1)", "Python; its tests try it"),
    (
        "blocks = mrfgs.Blocks(\"left.tif\", \"right.tif\", 75, memory=\"1GiB\", device=\"cpu\", threads=2)",
        "Python; its tests and scripts/engines try it",
    ),
    (
        "for (left, right), found in zip(pairs, mrfgs.match_many(pairs, 63, matcher=matcher)):           # pairs of paths or arrays",
        "Python; its tests and scripts/engines try it",
    ),
    (
        "python python/examples/satellite.py left.tif right.tif surface.tif --folder job --resolution 0.5 --workers 4",
        "Python with rasterio; scripts/geo tries it",
    ),
    ("pip install ./python rasterio", "installs; scripts/geo tries it"),
    (
        "mrfgs batch KITTI2015/training maps --format png --also depth",
        "needs KITTI; a test makes such folders",
    ),
    (
        "mrfgs evaluate map maps --truth KITTI2015/training/disp_occ_0",
        "needs KITTI; a test makes such folders",
    ),
    ("apiVersion: batch/v1", "Kubernetes; scripts/geo checks it"),
    // These need other programs.
    (
        "ffmpeg -i stereo.mkv -pix_fmt yuv444p -f yuv4mpegpipe - | mrfgs sequence - - --method fast --max-disparity 63 | ffplay -",
        "takes ffmpeg",
    ),
    (
        "ffmpeg -i /dev/video0 -pix_fmt yuv444p -f yuv4mpegpipe - | mrfgs sequence - - --method fast --max-disparity 63 | ffplay -",
        "needs ffmpeg and a camera",
    ),
    (
        "ffmpeg -i stereo.mkv -f rawvideo -pix_fmt gray16le - | mrfgs sequence - maps --raw-frames 1280x480,gray16le --max-disparity 63",
        "takes ffmpeg",
    ),
    ("mrfgs sequence left right - --max-disparity 63 | ffmpeg -i - disparity.gif", "needs ffmpeg"),
    ("mrfgs sequence left.mp4 right.mp4 disparity.mp4 --method fast", "needs ffmpeg"),
    (
        "parallel mrfgs match left.tif right.tif map.tif --max-disparity 75 --blocks job --threads 2 ::: $(seq 4)",
        "needs GNU parallel",
    ),
    (
        "sbatch --array=1-8 --wrap 'mrfgs match left.tif right.tif map.tif --max-disparity 75 --blocks job'",
        "needs Slurm; scripts/slurm tries it",
    ),
    ("parallel mrfgs batch pairs.csv maps --threads 2 --shard {}/8 ::: $(seq 8)", "needs GNU parallel"),
    (
        "sbatch --array=1-8 --wrap 'mrfgs batch pairs.csv maps --shard $SLURM_ARRAY_TASK_ID/8'",
        "needs Slurm; scripts/slurm tries it",
    ),
    (
        "parallel_stereo --alignment-method local_epipolar --stereo-algorithm \"mrfgs --threads 2 --memory 2GiB\" left.tif right.tif ...",
        "takes the Ames Stereo Pipeline",
    ),
    // These need other machines, or do not end.
    (
        "mrfgs ros --method fast --also points --remap left/image_raw:=/cam0/image_raw --remap right/image_raw:=/cam1/image_raw",
        "needs cameras; scripts/node tries it",
    ),
    ("mrfgs ros --method fast --max-disparity 63", "needs cameras; scripts/node tries it"),
    ("mrfgs ros --method fast --also depth,points", "needs cameras; scripts/node tries it"),
    (
        "mrfgs ros --method fast --also depth,points --remap left/image_raw:=/camera/infra1/image_rect_raw --remap right/image_raw:=/camera/infra2/image_rect_raw",
        "needs cameras; scripts/node tries it",
    ),
    ("mrfgs sequence drive.mcap ws://localhost:8765 --also depth,points", "waits for a viewer"),
    (
        "mrfgs match left.png right.png map.pfm --rectify --calib stereo.yml --prior scan.pcd --prior-pose lidar.txt",
        "takes a lidar; tests of priors have the same flags",
    ),
    (
        "mrfgs sequence left right maps --rectify --calib stereo.yml --prior scans --prior-pose lidar.txt",
        "takes a lidar; tests of priors have the same flags",
    ),
    (
        "mrfgs sequence left right maps --calib calib.txt --prior last --prior-pose poses.txt",
        "takes frames of a moving rig; tests of priors have the same flags",
    ),
    (
        "mrfgs match left.png right.png map.pfm --rectify --calib cameras.txt --calib images.txt --prior points3D.txt --prior-pose images.txt",
        "takes a reconstruction of COLMAP",
    ),
    ("mrfgs devices", "depends on the machine"),
    ("mrfgs match left.png right.png d.pfm --device gpu", "needs a GPU"),
    ("mrfgs match left.png right.png d.pfm --device 0", "needs a device"),
    ("mrfgs bench --device cpu --method default --repeats 3", "measures"),
    ("mrfgs bench --large --method default", "takes long"),
    ("mrfgs bench path/to/Teddy --device cpu --device gpu --repeats 20 --json bench.json", "needs a GPU"),
    // Other languages.
    ("use mrfgs::{Matcher, Pair};", "Rust"),
    ("use mrfgs::{Matcher, Method, Pair};", "Rust"),
    ("use mrfgs::image::raster::Raster;", "Rust"),
    ("use mrfgs::Method;", "Rust; documentation and tests of `mrfgs::on_device` have the same calls"),
    ("import mrfgs", "Python; scripts/python tries the package"),
    ("from mcap_ros2.reader import read_ros2_messages", "Python; scripts/recordings reads such files"),
    (
        "left, right = (cv2.imread(f\"testdata/raw/{view}.png\")[..., ::-1] for view in (\"left\", \"right\"))",
        "Python with OpenCV",
    ),
    ("matcher = mrfgs.Matcher()", "Python with OpenCV"),
    (
        "truth = mrfgs.read_disparity(\"testdata/mixed/disp0GT.pfm\")      # float32 in pixels; +inf where unknown",
        "Python",
    ),
    ("mrfgs_image left = {left_pixels, left_stride, width, height, MRFGS_FORMAT_RGB8}, right = ...;", "C"),
    ("#include <mrfgs.h>", "C"),
    (
        "mrfgs_prior_point points[] = {{120, 80, 31.5, 0}, ...}; /* x, y, disparity, standard deviation; 0: the usual one */",
        "C",
    ),
    ("const char *path = \"stereo.yml\";                        /* ROS has two */", "C"),
    ("import { createMatcher } from '@mrfgs/wasm';", "JavaScript"),
];

/// The exit status of examples that show a failure.
const FAILURES: [(&str, i32); 4] = [
    ("mrfgs match testdata/mixed/im0.png testdata/mixed/im2.png disparity.pfm", 1),
    ("mrfgs match testdata/mixed/im0.png testdata/mixed/im1.png d.pfm --memory 1MiB", 2),
    ("mrfgs batch pairs.csv maps --also confidence", 1),
    ("mrfgs batch pairs.csv maps --also confidence --status", 1),
];

/// Examples that print only times.
const MEASURES: [&str; 1] = ["mrfgs inspect testdata/mixed/im0.png testdata/mixed/im1.png"];

/// A command, or a block in another language than the shell's.
#[derive(Debug)]
struct Example {
    language: String,
    /// A command in one line without its comment, or all lines of the block.
    code: String,
    /// The output shown below it.
    printed: String,
}

impl Example {
    fn first_line(&self) -> &str {
        self.code.lines().next().unwrap_or_default()
    }
}

/// The examples of each block of a document.
fn blocks(text: &str) -> Vec<Vec<Example>> {
    let mut all: Vec<Vec<Example>> = Vec::new();
    for fenced in text.split("\n```").skip(1).step_by(2) {
        let (language, body) = fenced.split_once('\n').unwrap_or_default();
        let example = |code: &str| {
            let code = code.split("   ").next().unwrap_or(code).replace("cargo run --release -- ", "mrfgs ");
            Example { language: language.to_owned(), code: code.trim().to_owned(), printed: String::new() }
        };
        let mut block: Vec<Example> = Vec::new();
        match language {
            "console" => {
                for line in body.lines() {
                    match (line.strip_prefix("$ "), block.last_mut()) {
                        (Some(code), _) => block.push(example(code)),
                        (None, Some(last)) => last.printed += &[line, "\n"].concat(),
                        (None, None) => panic!("output without a command: {line}"),
                    }
                }
            }
            "sh" => {
                let mut code = String::new();
                for line in body.lines() {
                    code = [&*code, line].map(str::trim).join(" ").trim().into();
                    if let Some(begun) = code.strip_suffix('\\') {
                        code = begun.trim_end().to_owned();
                    } else if !code.ends_with('|') {
                        block.push(example(&std::mem::take(&mut code)));
                    }
                }
                assert_eq!(code, "", "the line goes on");
            }
            // The output of the previous example.
            "text" => {
                let before =
                    all.last_mut().and_then(|block| block.last_mut()).expect("output follows an example");
                before.printed = body.to_owned() + "\n";
                continue;
            }
            _ => block.push(Example { code: body.to_owned(), ..example("") }),
        }
        all.push(block);
    }
    all
}

/// A folder with the files that examples need.
fn workshop() -> Folder {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    std::os::unix::fs::symlink(scene(""), at("testdata")).unwrap();
    for inner in ["left", "right", "cam", "frames"] {
        fs::create_dir(at(inner)).unwrap();
    }
    let mixed = ["im0.png", "im1.png"].map(|file| image::open(scene("mixed").join(file)).unwrap().to_rgb8());
    for (view, (side, letter)) in mixed.iter().zip([("left", 'L'), ("right", 'R')]) {
        for n in 0..3 {
            view.save(at(&format!("{side}/{n}.png"))).unwrap();
        }
        view.save(at(&format!("cam/0_{letter}.png"))).unwrap();
        let part = image::imageops::crop_imm(view, 100, 80, 140, 60).to_image();
        for ending in ["png", "tif"] {
            part.save(at(&format!("{side}.{ending}"))).unwrap();
        }
    }
    let mut both = image::RgbImage::new(320, 480);
    for (n, view) in mixed.iter().enumerate() {
        image::imageops::replace(&mut both, view, 0, 240 * n as i64);
    }
    both.save(at("frames/0.png")).unwrap();
    let mask = |(width, height)| {
        image::GrayImage::from_fn(width, height, |x, _| image::Luma([if x < 9 { 255 } else { 0 }]))
    };
    mask((140, 60)).save(at("clouds.png")).unwrap();
    mask((320, 240)).save(at("rover.png")).unwrap();
    let camera = "[[240, 0, 160], [0, 240, 120], [0, 0, 1]]";
    let rest = "R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT: [-0.186, 0, 0]\nimage_width: 320\nimage_height: 240\nunit: m\n";
    let none = "[0, 0, 0, 0]";
    fs::write(at("stereo.yml"), format!("K1: {camera}\nD1: {none}\nK2: {camera}\nD2: {none}\n{rest}"))
        .unwrap();
    record_drive(&at("drive.mcap"));
    folder
}

/// Renders the frames of `cargo run --example render-scenes -- film passing 320 240 48 8`.
fn render_film(folder: &Path) {
    for side in ["left", "right"] {
        fs::create_dir_all(folder.join("film").join(side)).unwrap();
    }
    for step in 0..8 {
        let scene = scenes::passing(step, 320, 240, 48);
        for (side, view) in [("left", &scene.left), ("right", &scene.right)] {
            let picture = image::RgbImage::from_raw(320, 240, view.data().as_flattened().to_vec()).unwrap();
            picture.save(folder.join(format!("film/{side}/{step:06}.png"))).unwrap();
        }
    }
}

/// A line without times, thread counts and repeated spaces, which depend on the machine; with `measures`, without any numbers.
fn plain(line: &str, measures: bool) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    let next = |i: usize| words.get(i + 1).copied().unwrap_or_default();
    let is_number = |word: &str| word.trim_end_matches([',', ':']).parse::<f64>().is_ok();
    let shown = words.iter().enumerate().map(|(i, word)| {
        let of_machine = ["s", "s:", "thread", "threads"].contains(&next(i))
            || next(i) == "per" && next(i + 1) == "second";
        match *word {
            "thread" => "threads",
            word if is_number(word) && (measures || of_machine) => "N",
            word => word,
        }
    });
    shown.collect::<Vec<_>>().join(" ")
}

/// Whether `printed` matches the document's lines; a line `...` there matches any lines.
fn agrees(said: &[String], printed: &[String]) -> bool {
    match said.split_first() {
        None => printed.is_empty(),
        Some((line, rest)) if line == "..." => (0..=printed.len()).any(|from| agrees(rest, &printed[from..])),
        Some((line, rest)) => printed.first() == Some(line) && agrees(rest, &printed[1..]),
    }
}

/// Runs an example and returns what is wrong with it.
fn fault(folder: &Path, example: &Example) -> Option<String> {
    if let Some(file) = example.code.strip_prefix("cat ") {
        // A file that the reader is to write.
        fs::write(folder.join(file), &example.printed).unwrap();
        return None;
    }
    let code = if example.language == "toml" {
        fs::write(folder.join("block.toml"), &example.code).unwrap();
        "mrfgs match left.png right.png d.pfm --max-disparity 9 --dry-run --method block.toml"
    } else {
        &example.code
    };
    let programs = Path::new(env!("CARGO_BIN_EXE_mrfgs")).parent().unwrap();
    let path = std::env::join_paths(
        std::iter::once(programs.to_owned()).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    );
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("exec 2>&1\n{code}")]).current_dir(folder).env("PATH", path.unwrap());
    shell.envs(NO_DRIVER.iter().copied()).env("JOB_COMPLETION_INDEX", "0").env_remove("RUST_BACKTRACE");
    let output = shell.output().unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let status = FAILURES.iter().find(|failure| failure.0 == example.code).map_or(0, |failure| failure.1);
    if output.status.code() != Some(status) {
        return Some(format!("exit status {:?}: {}\n{printed}", output.status.code(), example.code));
    }
    let measures = MEASURES.contains(&example.code.as_str());
    let [said, found] = [&example.printed, &printed]
        .map(|text| text.lines().map(|line| plain(line, measures)).collect::<Vec<_>>());
    let is_shown = !example.printed.is_empty();
    (is_shown && !agrees(&said, &found))
        .then(|| format!("{}\nprints\n{printed}\nand not\n{}", example.code, example.printed))
}

#[test]
fn every_example_prints_what_is_shown() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (mut ran, mut named, mut faults) = (0, Vec::new(), Vec::new());
    for document in std::iter::once("README.md".to_owned()).chain(guide()) {
        let folder = workshop();
        let text = fs::read_to_string(root.join(&document)).unwrap();
        if text.contains("film/left") {
            render_film(&folder);
        }
        for block in blocks(&text) {
            if block.iter().any(|example| example.code.contains("mrfgs sequence")) {
                let _ = fs::remove_dir_all(folder.join("maps"));
            }
            let _ = fs::remove_dir_all(folder.join("rectified"));
            for example in block {
                if let Some(row) = NOT_RUN.iter().find(|row| row.0 == example.first_line()) {
                    named.push(row.0);
                } else if ["console", "sh", "toml"].contains(&&*example.language) {
                    ran += 1;
                    faults.extend(fault(&folder, &example).map(|fault| format!("{document}: {fault}")));
                } else {
                    faults.push(format!("{document}: neither run nor listed: {}", example.first_line()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
    assert!(ran > 40, "{ran} examples");
    let gone: Vec<_> = NOT_RUN.iter().filter(|row| !named.contains(&row.0)).collect();
    assert!(gone.is_empty(), "listed but gone: {gone:?}");
}

/// Control: wrong output and unlisted examples are found.
#[test]
fn stale_examples_are_found() {
    let folder = Folder::new();
    let text = "\n```console\n$ echo one 3   # a comment\none 3\n$ printf 'a\\nb\\nc\\n'\na\n...\nc\n$ echo in 7 s\nin 8 s\n$ echo 2.5\n2.6\n$ false\n```\n";
    let faults: Vec<_> = blocks(text)[0].iter().map(|example| fault(&folder, example).is_some()).collect();
    assert_eq!(faults, [false, false, false, true, true]);
    let sh = blocks("\n```sh\na --b \\\n    c\nd |\n  e   # comment\n```\n\n```text\nprinted\n```\n");
    let codes: Vec<_> = sh[0].iter().map(|example| (&*example.code, &*example.printed)).collect();
    assert_eq!(codes, [("a --b c", ""), ("d | e", "printed\n")]);
}
