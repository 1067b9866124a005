//! The command line of the built program: outputs and failures.

#![allow(clippy::unwrap_used, reason = "test helpers")]

mod batch;
mod bench;
mod blocks;
mod calibrations;
mod contradictions;
mod demo;
mod documents;
mod evaluate;
#[cfg(unix)]
mod examples;
mod failures;
#[path = "../../../tests/common/files.rs"]
mod files;
#[cfg(unix)]
mod films;
mod formats;
mod forms;
mod geotiff;
mod hostile;
#[cfg(unix)]
mod live;
mod matching;
mod outputs;
mod plugin;
mod points;
mod priors;
mod recordings;
mod registered;
#[path = "../../../testdata/render-cloud.rs"]
#[allow(dead_code, reason = "an example has a main function")]
mod render_cloud;
mod report;
mod results;
mod robust;
#[path = "../../../testdata/scenes.rs"]
mod scenes;
mod sequences;
mod steady;
mod turned;
mod unrectified;
mod view;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use mrfgs::image::pfm::{self, Pfm};
use mrfgs::image::{Plane, read};
use mrfgs::low_level::backend::gpu;
use mrfgs::maps::REASONS;
use mrfgs::options::{self, Takes};
use serde_json::Value;
use tempfile::TempDir;

/// A temporary folder, removed after its test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
}

impl Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

/// The result of a run of the program.
#[derive(Debug)]
struct Run {
    /// The command line.
    line: String,
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

/// The words of a command line; `@wall/im0.png` becomes the path of that file in the scenes.
fn words(line: &str) -> impl Iterator<Item = OsString> {
    line.split_whitespace().map(|word| match word.strip_prefix('@') {
        Some(file) => scene(file).into(),
        None => word.into(),
    })
}

/// The program, to be run in `folder`.
fn program(folder: &Path, line: &str) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_mrfgs"));
    program.current_dir(folder).args(words(line));
    // As on a machine without a display, where the Vulkan loader would print to standard error.
    program.env_remove("XDG_RUNTIME_DIR").env_remove("RUST_BACKTRACE");
    program
}

/// Starts the program in `folder` with pipes for its streams.
fn started(folder: &Path, line: &str) -> Child {
    let mut program = program(folder, line);
    if cfg!(target_os = "linux") {
        // The test runner may ignore signals; restore the defaults.
        let mut listening = Command::new("env");
        listening.arg("--default-signal").arg(program.get_program()).args(program.get_args());
        listening.current_dir(folder).env_remove("XDG_RUNTIME_DIR").env_remove("RUST_BACKTRACE");
        program = listening;
    }
    program.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Runs the program in `folder`.
fn run(folder: &Path, line: &str) -> Run {
    run_with(folder, line, &[])
}

fn run_with(folder: &Path, line: &str, environment: &[(&str, &str)]) -> Run {
    Run::of(line, program(folder, line).envs(environment.iter().copied()).output().unwrap())
}

/// Runs the program after a shell command.
fn shell(folder: &Path, before: &str, line: &str) -> Run {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("{before} && exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_mrfgs")]);
    Run::of(line, shell.current_dir(folder).args(words(line)).env_remove("RUST_BACKTRACE").output().unwrap())
}

impl Run {
    fn of(line: &str, output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        let (stdout, stderr) = (text(output.stdout), text(output.stderr));
        Self { line: line.to_owned(), code: output.status.code(), stdout, stderr }
    }

    fn succeeded(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// Expects exactly one line on standard error, with all these words, and an empty standard output.
    fn failed(&self, code: i32, words: &str) {
        assert_eq!(self.code, Some(code), "{self:?}");
        assert_eq!(self.stdout, "", "{self:?}");
        assert!(self.stderr.starts_with("mrfgs: ") && self.stderr.ends_with('\n'), "{self:?}");
        assert_eq!(self.stderr.lines().count(), 1, "{self:?}");
        assert!(!self.stderr.contains("panicked"), "{self:?}");
        self.says(words);
    }

    /// Expects all these words, joined by ` & `, on standard error.
    fn says(&self, words: &str) {
        for word in words.split(" & ") {
            assert!(self.stderr.contains(word), "{}: no `{word}` in: {}", self.line, self.stderr);
        }
    }

    /// Expects that these words are not on standard error.
    fn is_silent_on(&self, words: &str) {
        assert!(!self.stderr.contains(words), "{}: `{words}` in: {}", self.line, self.stderr);
    }

    /// Expects all these words, joined by ` & `, on standard output.
    fn prints(&self, words: &str) {
        for word in words.split(" & ") {
            assert!(self.stdout.contains(word), "{}: no `{word}` in:\n{}", self.line, self.stdout);
        }
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap()
    }
}

/// Waits until a condition holds.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(120), "not {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Sends a signal such as `-INT`.
#[cfg(unix)]
fn send(signal: &str, child: &Child) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// A folder, relative to `folder`, that is not writable.
#[cfg(target_os = "linux")]
fn locked(folder: &Path) -> &'static str {
    use std::os::unix::fs::PermissionsExt;
    let locked = folder.join("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    // Root may write anywhere except where the kernel forbids it.
    if fs::write(locked.join("probe"), "").is_ok() { "/sys" } else { "locked" }
}

/// Everything in a folder, recursively: the content of files, `None` for folders.
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

/// A text with repeated spaces collapsed, so that column widths do not matter.
fn in_cells(text: &str) -> String {
    text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ") + "\n").collect()
}

/// The path of a scene, or of a file in it.
fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../testdata").join(name)
}

/// Copies a scene to a folder of another name.
fn copy(name: &str, to: &Path) {
    fs::create_dir(to).unwrap();
    for file in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt", "mask0nocc.png"] {
        fs::copy(scene(name).join(file), to.join(file)).unwrap();
    }
}

fn json(path: impl AsRef<Path>) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn read_pfm(path: impl AsRef<Path>) -> Plane<f32> {
    let Pfm::Grey(map) = pfm::read(path.as_ref()).unwrap() else { panic!("one channel") };
    map
}

/// Reads a TIFF map, whose invalid pixels are NaN.
fn read_tiff(path: impl AsRef<Path>) -> Plane<f32> {
    let mut decoder = tiff::decoder::Decoder::new(fs::File::open(path).unwrap()).unwrap();
    let (width, height) = decoder.dimensions().unwrap();
    let tiff::decoder::DecodingResult::F32(values) = decoder.read_image().unwrap() else { panic!("float") };
    Plane::new(width as usize, height as usize, values)
}

/// A folder with a pair of 60 x 40 pixels without calib.txt, and many faulty files.
fn workshop() -> Folder {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let copied = |from: &str, to: &str| assert!(fs::copy(at(from), at(to)).is_ok());
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
    // The second and third are where outputs beside taken.tif would be.
    for name in ["taken.pfm", "taken.raw.tif", "taken.validity.png", "taken.png", "misfit", "broken"] {
        fs::create_dir(at(name)).unwrap();
    }
    // An input with the name of an output.
    copied("right.png", "view.preview.png");
    fs::write(at("syntax.toml"), "levels = 3\nmatching sad\n").unwrap();
    fs::write(at("key.toml"), "# a comment\nlevel = 3\n").unwrap();
    fs::write(at("value.toml"), "levels = 3\n\ntemperature = -1\n").unwrap();
    for (name, calib) in [
        ("damaged", "ndisp=many\n"),
        ("silent", "width=60\n"),
        ("huge", "ndisp=100000\n"),
        ("half", "cam0=[100 0 30; 0 100 20; 0 0 1]\n"),
        ("zero", "cam0=[100 0 30; 0 100 20; 0 0 1]\ndoffs=0\nbaseline=0\n"),
        ("larger", "cam0=[100 0 30; 0 100 20; 0 0 1]\ndoffs=0\nbaseline=1\nwidth=120\nheight=90\n"),
        ("camera", "cam0=[100 0 30; 0 100 20; 0 0 1]\ndoffs=0\nbaseline=1\nwidth=60\nheight=40\nndisp=17\n"),
    ] {
        fs::create_dir(at(name)).unwrap();
        copied("left.png", &format!("{name}/left.png"));
        fs::write(at(name).join("calib.txt"), calib).unwrap();
    }
    // Folders to evaluate, each with one fault.
    for file in ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt"] {
        copy("slanted", &at(&format!("without-{file}")));
        for other in [file, "mask0nocc.png"] {
            fs::remove_file(at(&format!("without-{file}")).join(other)).unwrap();
        }
    }
    copied("left.png", "misfit/im0.png");
    copied("right.png", "misfit/im1.png");
    copied("without-im0.png/disp0GT.pfm", "misfit/disp0GT.pfm");
    copied("without-im0.png/calib.txt", "misfit/calib.txt");
    copied("left.png", "broken/im0.png");
    copied("text.png", "broken/im1.png");
    copied("misfit/calib.txt", "broken/calib.txt");
    let cameras = fs::read_to_string(scene("raw/cameras.yml")).unwrap();
    fs::write(at("no-unit.yml"), cameras.replace("unit: m\n", "")).unwrap();
    // A pair whose map would overwrite its left image.
    fs::write(at("pairs.csv"), "name,left,right\nleft,left.png,right.png\n").unwrap();
    fs::write(at("unknown.pfm"), b"Pf\n1 1\n-1.0\n\0\0\x80\x7f").unwrap();
    // Files that are almost images.
    image::GrayImage::new(1, 1).save(at("dot.png")).unwrap();
    fs::write(at("a.gif"), b"GIF89a\x01\0\x01\0\0\0\0").unwrap();
    fs::write(at("a.jpg"), &files::jpeg(&[9], None, None)[..90]).unwrap();
    fs::write(at("a.pgm"), b"P5\n60 40\n255\n1234").unwrap();
    fs::write(at("a.pfm"), b"Pf\n60 40\n0\n1234").unwrap();
    fs::write(at("a.tif"), b"II*\0\x08\0\0\0\x01\0").unwrap();
    // One bit of the pixels is flipped.
    let mut flipped = left.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    fs::write(at("flipped.png"), flipped).unwrap();
    let size = [(256, 4, 1, 1), (257, 4, 1, 1), (258, 3, 1, 8), (262, 3, 1, 3), (277, 3, 1, 1)];
    let strip = [(273, 4, 1, 8), (278, 4, 1, 1), (279, 4, 1, 1)];
    fs::write(at("palette.tif"), files::tiff(&[&size[..], &strip].concat(), &[])).unwrap();
    folder
}

/// An environment without Vulkan drivers; Metal is always available.
const NO_DRIVER: &[(&str, &str)] =
    &[("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent"), ("VK_ADD_DRIVER_FILES", "")];

/// Whether there is a driver. Panics without one if `MRFGS_REQUIRE_GPU` is set and not 0.
fn has_gpu() -> bool {
    let found = !gpu::devices().is_empty();
    let required = std::env::var("MRFGS_REQUIRE_GPU").is_ok_and(|v| v != "0" && !v.is_empty());
    assert!(found || !required, "MRFGS_REQUIRE_GPU is set and there is no driver");
    if !found {
        // Written past the capture of the test harness, as a skipped test must not look like a passed one.
        let _ = writeln!(std::io::stderr(), "SKIPPED on the GPU: there is no driver");
    }
    found
}

/// The program, its commands and their subcommands.
const COMMANDS: [&str; 18] = [
    "",
    "demo",
    "match",
    "rectify",
    "depth",
    "view",
    "sequence",
    "ros",
    "batch",
    "evaluate",
    "evaluate map",
    "evaluate submission",
    "bench",
    "inspect",
    "devices",
    "presets",
    "completions",
    "man",
];

#[test]
fn help_fits_a_terminal_of_80_columns() {
    let folder = Folder::new();
    for command in COMMANDS {
        let help = run_with(&folder, &format!("{command} --help"), &[("COLUMNS", "80")]).succeeded().stdout;
        let (_, examples) = help.split_once("Examples:\n").unwrap_or_default();
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{command}: {line}");
        }
        // Examples must fit: longer ones would be wrapped onto a second line.
        for line in examples.lines().take_while(|line| !line.is_empty()) {
            let begins = ["  mrfgs ", "  # ", "  cargo "].iter().any(|begin| line.starts_with(begin));
            assert!(begins, "{command}: {line}");
        }
    }
}

#[test]
fn devices_show_what_auto_uses() {
    let folder = Folder::new();
    let told = run(&folder, "devices").succeeded();
    assert!(told.stdout.lines().last().unwrap().contains("`auto` uses "), "{told:?}");
}

#[test]
fn later_flags_override_earlier_ones() {
    let folder = Folder::new();
    let keys = "levels = 3\nschedule.iterations = 2\n[cost]\nmatching = \"ad-census\"\noutside-cost = 1\n";
    fs::write(folder.join("my.toml"), keys).unwrap();
    let line = "evaluate @wall --json - --set levels=2 --set graph.levels=1 --method paper --method my.toml";
    let method = &run(&folder, line).succeeded().json()["method"];
    assert_eq!(method["graph"]["levels"], 1, "--set after --method, the last --set last");
    assert_eq!(method["schedule"]["iterations"], 2, "a file overrides the preset");
    let cost = &method["cost"];
    assert_eq!((&cost["matching"], &cost["outside-cost"]), (&"ad-census".into(), &1.0.into()));
    assert_eq!(method["messages"]["potential"], "hard", "--method comes first");
}

#[test]
fn presets_can_be_pasted_into_a_file() {
    let folder = Folder::new();
    for preset in options::PRESETS {
        let name = preset.name;
        let told = run(&folder, &format!("presets {name}")).succeeded();
        let path = folder.join("pasted.toml");
        fs::write(&path, &told.stdout).unwrap();
        for other in options::PRESETS {
            let mut method = other.method();
            method.load(&path).unwrap();
            assert_eq!(method, preset.method(), "{name} over {}", other.name);
        }
    }
    let told = run(&folder, "presets --json -").succeeded().json();
    let listed = told["presets"].as_array().unwrap();
    assert_eq!(listed.len(), options::PRESETS.len());
    for (row, preset) in listed.iter().zip(options::PRESETS) {
        let expected =
            serde_json::json!({"name": preset.name, "about": preset.about, "method": preset.method()});
        assert_eq!(*row, expected);
    }
    let listing = run(&folder, "presets --all").succeeded().stdout;
    let short = run(&folder, "presets").succeeded().stdout;
    let names =
        |text: &str, key: &options::Key| text.lines().any(|l| l.split(' ').next() == Some(&key.name()));
    for group in options::GROUPS {
        assert!(group.keys.iter().all(|key| names(&short, key) != key.for_reproduction), "{}", group.name);
        assert!(listing.lines().any(|l| l.starts_with(&format!("[{}] ", group.name))), "{}", group.name);
        for key in group.keys {
            let mut lines = listing.lines().skip_while(|l| l.split(' ').next() != Some(&key.name()));
            let line = lines.next().unwrap();
            let about: Vec<_> = lines.take_while(|l| !l.is_empty()).flat_map(str::split_whitespace).collect();
            let range = if let Takes::Words(words) = key.takes {
                words.iter().all(|word| about.contains(&format!("{}:", word.word).as_str()))
            } else {
                about.join(" ").ends_with(&format!("[{key}]"))
            };
            assert!(range, "{about:?}");
            for preset in options::PRESETS {
                let table = preset.method().table();
                let value = table[group.name][key.name()].to_string().replace('"', "");
                assert!(line.split_whitespace().any(|word| word == value), "{value} in {line}");
            }
        }
    }
    assert!(listing.lines().all(|l| l.chars().count() <= 120), "lines fit a terminal");
}

#[test]
fn help_teaches() {
    let folder = Folder::new();
    let help = |line: &str| {
        let told = run(&folder, line).succeeded();
        assert_eq!(told.stderr, "");
        // Wrapping depends on the terminal.
        told.stdout.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let text = help("match --help");
    for (bit, name, _) in REASONS {
        assert!(text.contains(&format!("{bit} {name}")) || bit == 0, "{bit} {name}");
    }
    for words in ["Examples:", "[default: 0, or", "ndisp - 1", "in pixels"] {
        assert!(text.contains(words), "{words}");
    }
    assert!(help("--help").contains("Exit status: 0"));
    assert!(help("evaluate --help").contains("mask0nocc.png"));
    assert!(help("batch --help").contains("name,left,right,max_disparity # a comment"));
    assert!(help("presets --help").contains("Examples:"));
    assert!(help("bench --help").contains("[default: default and paper,"));
}

#[test]
fn the_version_lists_wgpu_and_drivers() {
    let folder = Folder::new();
    let told = run(&folder, "--version").succeeded().stdout;
    let mut lines = told.lines();
    assert_eq!(lines.next(), Some(format!("mrfgs {}", env!("CARGO_PKG_VERSION")).as_str()));
    assert!(lines.next().is_some_and(|line| line.starts_with("wgpu ")), "{told}");
    let devices = gpu::devices();
    assert_eq!(lines.clone().count(), devices.len(), "{told}");
    for (line, device) in lines.zip(devices) {
        assert!(line.contains(&device.name) && line.contains(&device.driver), "{line}");
    }
    assert_eq!(run(&folder, "-V").succeeded().stdout, told);
}

#[cfg(target_os = "linux")]
#[test]
fn a_closed_pipe_is_no_failure_for_text() {
    let folder = Folder::new();
    let mut child = started(&folder, "presets");
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0), "{output:?}");
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = program(&folder, "presets").stdout(full).output().unwrap();
    Run::of("presets", output).failed(1, "standard output");
}

/// Data for `-` that nobody would receive is refused before any computing; text may be discarded.
#[cfg(target_os = "linux")]
#[test]
fn an_unusable_standard_output_is_reported() {
    let folder = workshop();
    let redirected = |line: &str, to: &str| {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec \"$0\" \"$@\" {to}"), env!("CARGO_BIN_EXE_mrfgs")]);
        Run::of(line, shell.current_dir(&*folder).args(words(line)).output().unwrap())
    };
    let before = listing(&folder);
    let map = "match left.png right.png - --max-disparity 9 --device cpu";
    let json = "match left.png right.png out.pfm --json - --max-disparity 9 --device cpu";
    let truth = "evaluate map @wall/disp0GT.pfm --truth @wall/disp0GT.pfm";
    for (line, to, code, words) in [
        (map, ">&-", 1, "standard output & is closed & redirect it"),
        (json, ">&-", 1, "standard output & is closed"),
        (&*format!("{truth} --json -"), ">&-", 1, "standard output & is closed"),
        ("sequence lef*.png righ*.png - --max-disparity 9", ">&-", 1, "standard output & is closed"),
        ("inspect left.png right.png --max-disparity 9 --json -", ">&-", 1, "standard output & is closed"),
        (map, "1<left.png", 1, "standard output & opened read-only"),
        ("presets", "1<left.png", 1, "standard output & opened read-only"),
        ("--help", "1<left.png", 1, "standard output & opened read-only"),
        ("completions bash", "1<left.png", 1, "standard output & opened read-only"),
        (&*format!("{map} --quiet"), ">/dev/full", 1, "standard output & No space left"),
        ("--help", ">/dev/full", 1, "standard output & No space left"),
        ("sequence - out --max-disparity 9", "<&-", 1, "standard input"),
    ] {
        redirected(line, to).failed(code, words);
        assert!(listing(&folder) == before, "{line} {to}");
    }
    // Discarding by name is allowed, and so is discarding text.
    redirected(map, ">/dev/null").succeeded();
    redirected(truth, ">&-").succeeded();
    redirected("match left.png right.png out.pfm --max-disparity 9 --device cpu", ">&- 2>&- <&-").succeeded();
    assert!(folder.join("out.pfm").exists());
}

#[test]
fn shells_and_readers_get_every_flag() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = run(&folder, &format!("completions {shell}")).succeeded().stdout;
        assert!(script.contains("mrfgs") && script.contains("max-disparity"), "{shell}");
    }
    run(&folder, "man pages").succeeded();
    let pages = listing(&folder.join("pages"));
    let names: Vec<_> = pages.keys().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    for command in COMMANDS {
        let name = format!("mrfgs {command}").trim_end().replace(' ', "-") + ".1";
        assert!(names.contains(&name.as_str()), "{name}: {names:?}");
    }
    assert_eq!(names.len(), COMMANDS.len());
    let page = pages.iter().find(|(path, _)| path.ends_with("mrfgs-match.1")).unwrap().1.clone().unwrap();
    let page = String::from_utf8(page).unwrap();
    assert!(page.starts_with(".ie") && page.contains(".TH mrfgs-match 1"), "{page}");
    for flag in ["max\\-disparity", "side\\-by\\-side", "memory"] {
        assert!(page.contains(flag), "no {flag} in:\n{page}");
    }
    // Existing pages are overwritten.
    run(&folder, "man pages").succeeded();
}
