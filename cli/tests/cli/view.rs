//! The page that shows a map: `--also view`, `match --show` and `mrfgs view`.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::read::GzDecoder;

use super::outputs::matched;
use super::*;

/// The text of a page.
fn page(path: impl AsRef<Path>) -> String {
    fs::read_to_string(path).unwrap()
}

/// The data in a page.
fn data(page: &str) -> Value {
    let (_, rest) = page.split_once("<script type=\"application/json\" id=\"data\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

fn decoded(text: &Value) -> Vec<u8> {
    BASE64.decode(text.as_str().unwrap()).unwrap()
}

fn unpacked(text: &Value) -> Vec<u8> {
    let mut bytes = Vec::new();
    GzDecoder::new(&*decoded(text)).read_to_end(&mut bytes).unwrap();
    bytes
}

/// The bits of the disparities in a page.
fn bits(data: &Value) -> Vec<u32> {
    let bytes = unpacked(&data["disparity"]);
    bytes.chunks_exact(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect()
}

fn bits_of(map: &Plane<f32>) -> Vec<u32> {
    map.data().iter().map(|d| d.to_bits()).collect()
}

/// The images of a scene alone, without its calib.txt.
fn images(name: &str, to: &Path) {
    for file in ["im0.png", "im1.png"] {
        fs::copy(scene(name).join(file), to.join(file)).unwrap();
    }
}

#[test]
fn a_page_holds_the_maps_bit_for_bit() {
    let folder = Folder::new();
    matched(&folder, "mixed", "d.pfm --also view,confidence,validity --set fill=none --quiet");
    let page = page(folder.join("d.view.html"));
    let data = data(&page);
    let map = read_pfm(folder.join("d.pfm"));
    assert_eq!((&data["name"], &data["step"]), (&"d".into(), &1.into()));
    assert_eq!(data["size"], serde_json::json!([320, 240]));
    assert!(bits(&data) == bits_of(&map) && map.data().contains(&f32::INFINITY));
    for word in ["confidence", "validity"] {
        let levels = read::grey8(&folder.join(format!("d.{word}.png"))).unwrap();
        assert!(unpacked(&data[word]) == levels.data(), "{word}");
    }
    let left = image::load_from_memory(&decoded(&data["left"])).unwrap().to_rgb8();
    assert!(left == image::open(scene("mixed/im0.png")).unwrap().to_rgb8());
    assert_eq!(decoded(&data["colours"]).len(), 3 * 256);
    let reasons: Vec<_> = REASONS.iter().map(|(bit, name, _)| serde_json::json!([bit, name])).collect();
    assert_eq!(data["reasons"], Value::from(reasons));

    // Nothing leads out of the page, and the browser would not follow.
    let (before, rest) = page.split_once("id=\"data\">").unwrap();
    let page = [before, rest.split_once("</script>").unwrap().1].concat();
    assert!(page.contains("content=\"default-src 'none'; style-src 'sha256-"));
    for way in ["://", "src=", "href=", "url(", "@import", "import(", "fetch("] {
        assert!(!page.contains(way), "{way}");
    }
    assert!(page.contains("createImageBitmap("), "the comparison sees the script");
}

/// Cameras are those of the calibration or the flags; without them, the page says that it guesses.
#[test]
fn cameras_are_known_or_guessed() {
    let folder = Folder::new();
    images("slanted", &folder);
    let cameras = |line: &str| {
        let all = "--also view --device cpu --quiet";
        run(&folder, &format!("match im0.png im1.png d.pfm --max-disparity 31 {line} {all}")).succeeded();
        data(&page(folder.join("d.view.html")))["cameras"].take()
    };
    let expected = |guessed: bool, focal: f64, middle: [f64; 2], baseline: f64, unit: &str| {
        serde_json::json!({
            "guessed": guessed,
            "focal_length": [focal, focal],
            "principal_point": middle,
            "doffs": 0.0,
            "baseline": baseline,
            "unit": unit,
        })
    };
    let middle = outputs::MIDDLE;
    assert_eq!(cameras(""), expected(true, 240.0, middle, 1.0, "unknown"));
    assert_eq!(cameras("--rectify")["guessed"], true);
    assert_eq!(cameras("--focal 180 --baseline 16cm"), expected(false, 180.0, middle, 16.0, "cm"));
    let part = cameras("--focal 180 --baseline 16cm --roi 40,30,120,90");
    assert_eq!(part, expected(false, 180.0, [79.5, 59.5], 16.0, "cm"));
    let by_file = format!("--calib {}", scene("slanted/calib.txt").display());
    let (focal, baseline) = (outputs::FOCAL_LENGTH, outputs::BASELINE);
    assert_eq!(cameras(&by_file), expected(false, focal, middle, baseline, "m"));
    // A calibration that has no cameras is no error, as the page does without.
    fs::write(folder.join("calib.txt"), "ndisp=32\n").unwrap();
    assert_eq!(cameras("")["guessed"], true);
    fs::copy(scene("slanted/calib.txt"), folder.join("calib.txt")).unwrap();
    assert_eq!(cameras(""), expected(false, focal, middle, baseline, "m"));
}

#[test]
fn limits_and_colours_apply() {
    let folder = Folder::new();
    let of = |more: &str| {
        matched(&folder, "slanted", &format!("d.pfm --also view,depth --quiet {more}"));
        data(&page(folder.join("d.view.html")))
    };
    let all = of("");
    assert_eq!(all["clip_depth"], Value::Null);
    let sure = of("--min-confidence 40 --clip-depth 2 --colours grey");
    assert_eq!(sure["clip_depth"], 2.0);
    assert!(bits(&sure) == bits_of(&read_pfm(folder.join("d.pfm"))));
    let gaps = |data: &Value| bits(data).iter().filter(|bits| **bits == f32::INFINITY.to_bits()).count();
    assert!(gaps(&sure) > gaps(&all) + 1000);
    assert!(decoded(&sure["colours"]).chunks(3).all(|colour| colour[0] == colour[2]));
    assert!(all["colours"] != sure["colours"]);
}

/// `mrfgs view` makes the same page from the files of a match.
#[test]
fn a_stored_map_gives_the_same_page() {
    let folder = Folder::new();
    let line = "d.pfm --also view,confidence,validity --quiet";
    matched(&folder, "mixed", line);
    let of_match = fs::read(folder.join("d.view.html")).unwrap();
    let more = "--left @mixed/im0.png --calib @mixed/calib.txt --output v.html";
    let told = run(&folder, &format!("view d.pfm {more}")).succeeded();
    assert_eq!((&*told.stdout, &*told.stderr), ("", ""));
    assert!(fs::read(folder.join("v.html")).unwrap() == of_match);
    // So does a match in blocks.
    matched(&folder, "mixed", "d.pfm --also view --blocks job --quiet");
    assert!(fs::read(folder.join("d.view.html")).unwrap() == of_match);

    // A map of 16 bits, alone.
    fs::create_dir(folder.join("alone")).unwrap();
    matched(&folder, "mixed", "alone/k.png --quiet");
    run(&folder, "view alone/k.png --output k.html").succeeded();
    let alone = data(&page(folder.join("k.html")));
    let of_match = data(&String::from_utf8(of_match).unwrap());
    assert!(bits(&alone) == bits(&of_match));
    for word in ["confidence", "validity", "left"] {
        assert_eq!(alone[word], Value::Null, "{word}");
    }
    assert_eq!(alone["cameras"]["guessed"], true);

    // A map with negative disparities (`--sign`), and a calib.txt beside the map.
    copy("mixed", &folder.join("scene"));
    matched(
        &folder,
        "mixed",
        "scene/n.tif --sign right-minus-left --min-disparity -47 --max-disparity 0 --quiet",
    );
    run(&folder, "view scene/n.tif --sign right-minus-left --output n.html").succeeded();
    let negated = data(&page(folder.join("n.html")));
    assert!(bits(&negated) == bits(&of_match));
    assert_eq!(negated["cameras"], of_match["cameras"]);
}

/// The name of a file is no part of the markup.
#[cfg(unix)]
#[test]
fn names_stay_names() {
    let folder = Folder::new();
    let name = "a<!--<script>{{DATA}}&'\"";
    let map = format!("{name}.pfm");
    fs::write(folder.join(&map), pfm::encode(&Plane::filled(4, 3, 2.0))).unwrap();
    run(&folder, &format!("view {map} --output d.html")).succeeded();
    let page = page(folder.join("d.html"));
    assert_eq!(data(&page)["name"], name);
    assert_eq!(page.matches("<!--").count(), 1, "the comment of the template");
}

/// Of a map that is too large for a browser, the page holds every second column and row.
#[test]
fn large_maps_are_thinned() {
    let folder = Folder::new();
    let map = Plane::from_fn(8194, 2049, |x, y| ((x + 3 * y) % 64) as f32);
    fs::write(folder.join("d.pfm"), pfm::encode(&map)).unwrap();
    run(&folder, "view d.pfm --output d.html").succeeded();
    let data = data(&page(folder.join("d.html")));
    assert_eq!((&data["size"], &data["step"]), (&serde_json::json!([8194, 2049]), &2.into()));
    assert!(bits(&data) == bits_of(&Plane::from_fn(4097, 1025, |x, y| map[(2 * x, 2 * y)])));
    assert_eq!(data["cameras"]["focal_length"][0], 8194.0);
}

#[test]
fn each_pair_of_a_batch_has_its_page() {
    let folder = Folder::new();
    fs::create_dir(folder.join("scenes")).unwrap();
    for name in ["slanted", "mixed"] {
        copy(name, &folder.join("scenes").join(name));
    }
    run(&folder, "batch scenes maps --also view --device cpu --quiet").succeeded();
    for name in ["slanted", "mixed"] {
        let data = data(&page(folder.join(format!("maps/{name}.view.html"))));
        assert!(data["name"] == name && data["cameras"]["guessed"] == false);
        assert!(bits(&data) == bits_of(&read_pfm(folder.join(format!("maps/{name}.pfm")))));
    }
}

/// The only file in the folders of `temporary`.
#[cfg(target_os = "linux")]
fn only_page(temporary: &Path) -> PathBuf {
    let all: Vec<_> = listing(temporary).into_iter().filter(|(_, content)| content.is_some()).collect();
    let [(path, _)] = &all[..] else { panic!("{} files", all.len()) };
    path.clone()
}

/// A program named xdg-open in `folder` that runs these lines of a shell.
#[cfg(target_os = "linux")]
fn opener(folder: &Path, lines: &str) {
    use std::os::unix::fs::PermissionsExt;
    fs::create_dir_all(folder.join("bin")).unwrap();
    let program = folder.join("bin/xdg-open");
    fs::write(&program, format!("#!/bin/sh\n{lines}\n")).unwrap();
    fs::set_permissions(program, fs::Permissions::from_mode(0o755)).unwrap();
}

/// Other systems open pages by programs that are no files on a path.
#[cfg(target_os = "linux")]
#[test]
fn the_page_opens_in_the_browser() {
    let folder = Folder::new();
    opener(&folder, "printf %s \"$1\" > \"$OPENED\"; exec /bin/sleep 60");
    let [bin, temporary, opened] = ["bin", "temporary", "opened"].map(|name| folder.join(name));
    let environment = [("PATH", &bin), ("TMPDIR", &temporary), ("OPENED", &opened)];
    let environment = environment.map(|(name, path)| (name, path.to_str().unwrap()));
    let shown = |line: &str| {
        let _ = fs::remove_dir_all(&temporary);
        let _ = fs::remove_file(&opened);
        fs::create_dir(&temporary).unwrap();
        let start = Instant::now();
        let output = program(&folder, line).envs(environment).output().unwrap();
        assert!(start.elapsed() < Duration::from_secs(30), "it waits for the browser");
        assert_eq!(output.status.code(), Some(0), "{line}");
        let place = PathBuf::from(fs::read_to_string(&opened).unwrap());
        let said = String::from_utf8(output.stderr).unwrap();
        (place, output.stdout, said)
    };
    let pair = "@slanted/im0.png @slanted/im1.png";
    let (place, stdout, said) = shown(&format!("match {pair} d.pfm --device cpu --show"));
    assert_eq!(place, only_page(&temporary));
    assert!(place.ends_with("d.view.html") && stdout.is_empty());
    assert!(
        said.lines().last().unwrap() == format!("mrfgs: opened {} in the browser", place.display()),
        "{said}"
    );
    let of_show = page(&place);
    assert!(bits(&data(&of_show)) == bits_of(&read_pfm(folder.join("d.pfm"))));

    // The file that is written anyway is the one that opens.
    let (place, _, said) = shown(&format!("match {pair} d.pfm --device cpu --show --also view --quiet"));
    assert_eq!(place, folder.join("d.view.html").canonicalize().unwrap());
    assert!(listing(&temporary).is_empty() && said.is_empty() && page(&place) == of_show);

    // Standard output holds the map, or the record, and nothing else.
    let (place, stdout, _) = shown(&format!("match {pair} - --device cpu --show --colours viridis"));
    assert!(stdout == fs::read(folder.join("d.pfm")).unwrap() && place.ends_with("map.view.html"));
    let (_, stdout, _) = shown(&format!("match {pair} d.pfm --device cpu --show --json -"));
    assert_eq!(serde_json::from_slice::<Value>(&stdout).unwrap()["width"], 240);
    let (_, stdout, _) = shown(&format!("match {pair} e.pfm --device cpu --show --blocks job"));
    assert!(stdout.is_empty() && folder.join("e.pfm").exists());

    let (place, stdout, said) = shown("view d.pfm --left @slanted/im0.png");
    assert!(place == only_page(&temporary) && stdout.is_empty());
    assert_eq!(said, format!("mrfgs: opened {} in the browser\n", place.display()));

    // A plan has no page.
    let _ = fs::remove_file(&opened);
    run_with(&folder, &format!("match {pair} d.pfm --show --dry-run"), &environment).succeeded();
    assert!(!opened.exists());
}

#[cfg(target_os = "linux")]
#[test]
fn without_a_browser_the_page_is_named() {
    let folder = Folder::new();
    matched(&folder, "slanted", "d.pfm --quiet");
    let temporary = folder.join("temporary");
    fs::create_dir(&temporary).unwrap();
    opener(&folder, "exit 3");
    for bin in ["nowhere", "bin"] {
        let bin = folder.join(bin);
        let environment = [("PATH", bin.to_str().unwrap()), ("TMPDIR", temporary.to_str().unwrap())];
        for line in
            ["view d.pfm", "match @slanted/im0.png @slanted/im1.png e.pfm --device cpu --show --quiet"]
        {
            let told = run_with(&folder, line, &environment).succeeded();
            let place = only_page(&temporary);
            assert_eq!(
                told.stderr,
                format!(
                    "mrfgs: no browser starts here; open {} in one, also on another machine: it is a single file\n",
                    place.display()
                )
            );
            fs::remove_file(place).unwrap();
        }
    }
    // The match is complete even if the page cannot be written.
    let environment = [("TMPDIR", "/proc/none")];
    let line = "match @slanted/im0.png @slanted/im1.png f.pfm --device cpu --show --quiet";
    run_with(&folder, line, &environment).succeeded().says("mrfgs: --show: ");
    assert!(folder.join("f.pfm").exists());
    run_with(&folder, "view d.pfm", &environment).failed(1, "/proc/none");
}

#[test]
fn bad_input_leaves_no_page() {
    let folder = Folder::new();
    images("slanted", &folder);
    matched(&folder, "slanted", "d.pfm --quiet");
    fs::create_dir_all(folder.join("other")).unwrap();
    fs::create_dir_all(folder.join("temporary")).unwrap();
    fs::copy(folder.join("d.pfm"), folder.join("other/d.pfm")).unwrap();
    fs::copy(scene("mixed/im0.png"), folder.join("other/d.validity.png")).unwrap();
    fs::write(folder.join("empty.pfm"), pfm::encode(&Plane::filled(4, 3, f32::INFINITY))).unwrap();
    fs::write(folder.join("bad.txt"), "cam0=[180 0 119.5; 0 180 89.5; 0 0 1]\n").unwrap();
    let square = "cam0=[9 0 49; 0 9 49; 0 0 1]\ndoffs=0\nbaseline=1\nwidth=99\nheight=99\n";
    fs::write(folder.join("square.txt"), square).unwrap();
    let before = listing(&folder);
    let temporary = folder.join("temporary");
    for (line, code, words) in [
        ("view none.pfm", 1, "none.pfm"),
        ("view im0.png --output d.html", 1, "im0.png & more than one channel"),
        ("view empty.pfm", 1, "empty.pfm: contains no disparity"),
        ("view d.pfm --left none.png", 1, "none.png"),
        (
            "view d.pfm --left @mixed/im0.png --output d.html",
            1,
            "im0.png is 320 x 240 but d.pfm is 240 x 180",
        ),
        ("view other/d.pfm --output d.html", 1, "d.validity.png"),
        ("view d.pfm --calib bad.txt", 1, "bad.txt & lacks doffs and baseline"),
        ("view d.pfm --calib square.txt", 1, "square.txt is for images of 99 x 99 but d.pfm is 240 x 180"),
        ("view d.pfm --focal 100", 2, "--baseline"),
        ("view d.pfm --output d.txt", 2, "--output: d.txt is no name of a page; give one that ends in .html"),
        ("view d.pfm --output none/d.html", 1, "none/d.html"),
        ("depth d.pfm --calib @slanted/calib.txt --also view", 2, "--also view: & mrfgs view MAP"),
        (
            "match im0.png im1.png - --max-disparity 31 --also view",
            2,
            "--also view: is written beside OUTPUT",
        ),
        (
            "match im0.png im1.png e.pfm --max-disparity 31 --also view --clip-depth 2",
            2,
            "--clip-depth: needs depths",
        ),
        ("match im0.png im9.png e.pfm --max-disparity 31 --show", 1, "im9.png"),
        (
            "sequence im0.png im1.png f.mp4 --max-disparity 31 --also view",
            2,
            "--also view: writes a file per frame",
        ),
    ] {
        let told = run_with(&folder, line, &[("TMPDIR", temporary.to_str().unwrap())]);
        told.failed(code, words);
        assert!(listing(&folder) == before, "{line}");
    }
}
