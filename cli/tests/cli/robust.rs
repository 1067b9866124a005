//! Runs ended from outside by too little memory, a full disk or a signal, and the state of their outputs.

use super::*;

/// Under any limit, a match either succeeds or reports too little memory in one line; no allocation aborts.
#[cfg(target_os = "linux")]
#[test]
fn no_limit_of_memory_aborts() {
    let folder = Folder::new();
    let large = |name: &str, ending: &str| {
        let image = image::open(scene("mixed").join(name)).unwrap();
        let image = image.resize_exact(640, 480, image::imageops::FilterType::Triangle);
        image.to_rgb8().save(folder.join(format!("{name}.{ending}"))).unwrap();
    };
    for ending in ["jpg", "png", "tif"] {
        large("im0.png", ending);
        large("im1.png", ending);
    }
    let mut refused = 0;
    for (ending, options) in [
        ("jpg", "--max-disparity auto --memory 256MiB"),
        ("png", "--max-disparity 15 --also preview,side-by-side,raw"),
        ("tif", "--max-disparity 7 --method fgs"),
    ] {
        let line = format!(
            "match im0.png.{ending} im1.png.{ending} out.pfm --device cpu --threads 1 --quiet {options}"
        );
        // The program itself needs about 60 MiB of address space.
        let enough = (80..1024).step_by(40).find(|limit| {
            let told = shell(&folder, &format!("ulimit -v {}", limit << 10), &line);
            let enough = told.code == Some(0);
            if enough {
                assert_eq!(told.stderr, "", "{limit}");
            } else {
                refused += 1;
                told.failed(1, "memory");
            }
            assert_eq!(folder.join("out.pfm").exists(), enough, "{ending}, {limit} MiB");
            let _ = fs::remove_file(folder.join("out.pfm"));
            enough
        });
        assert!(enough.is_some(), "{ending}: 1 GiB is not enough");
    }
    assert!(refused > 7, "control: the limits are limits: {refused}");
}

/// A file that reaches its size limit is reported by its own name.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_with_the_name_of_the_output() {
    let folder = workshop();
    let before = listing(&folder);
    // Files are limited to 4 KiB, with the signal ignored or not.
    let limits = ["trap '' XFSZ; ulimit -f 8", "ulimit -f 8"];
    for (n, (line, name)) in [
        ("match left.png right.png out.pfm --max-disparity 9", "cannot write out.pfm: File too large"),
        (
            "match left.png right.png out.png --max-disparity 9 --also depth --calib camera/calib.txt --set fill=none",
            "cannot write out.depth.pfm: File",
        ),
        ("inspect left.png right.png steps --max-disparity 9", "cannot write steps: File too large"),
        ("batch camera.csv out", "cannot write out/camera.pfm: File too large"),
    ]
    .into_iter()
    .flat_map(|case| [case, case])
    .enumerate()
    {
        fs::write(folder.join("camera.csv"), "name,left,right\ncamera,camera/left.png,right.png\n").unwrap();
        let quiet = if line.starts_with("inspect") { "" } else { " --quiet" };
        let line = format!("{line} --device cpu{quiet}");
        let told = shell(&folder, limits[n % 2], &line);
        told.failed(1, name);
        assert!(!told.stderr.contains(".tmp") && !told.stderr.contains("os error"), "{told:?}");
        fs::remove_file(folder.join("camera.csv")).unwrap();
        let _ = fs::remove_dir(folder.join("out"));
        assert!(listing(&folder) == before, "{line}");
    }
}

/// Starts a match and kills it after a time.
#[cfg(unix)]
fn killed(folder: &Path, after: Duration, line: &str) {
    let mut child = program(folder, line).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while start.elapsed() < after && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = child.kill();
    child.wait().unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn a_killed_match_leaves_no_incomplete_file() {
    let folder = workshop();
    let before = listing(&folder);
    let line = "match left.png right.png out.pfm --max-disparity 9 --device cpu --also raw,confidence";
    run(&folder, line).succeeded();
    let outputs = ["out.pfm", "out.raw.pfm", "out.confidence.png"].map(|name| folder.join(name));
    let whole = outputs.clone().map(|path| fs::read(path).unwrap());
    for ms in [1, 5, 10, 15, 20, 25, 30, 40, 60] {
        for path in &outputs {
            let _ = fs::remove_file(path);
        }
        killed(&folder, Duration::from_millis(ms), line);
        let mut after = listing(&folder);
        for (path, whole) in outputs.iter().zip(&whole) {
            if let Some(found) = after.remove(path) {
                assert!(found.as_ref() == Some(whole), "{} after {ms} ms", path.display());
            }
        }
        assert!(after == before, "{ms} ms: {:?}", after.keys());
    }
}

#[cfg(unix)]
#[test]
fn the_next_run_removes_the_remains_of_a_killed_one() {
    let folder = workshop();
    let before = listing(&folder);
    let line = "inspect left.png right.png steps --max-disparity 9 --device cpu";
    // Remains of a killed run.
    let staging = folder.join(".steps.tmp");
    fs::create_dir_all(staging.join("new")).unwrap();
    fs::write(staging.join("new/half.png"), "half").unwrap();
    fs::write(staging.join("lock"), "").unwrap();
    run(&folder, line).succeeded();
    assert!(!staging.exists() && folder.join("steps/change-per-iteration.csv").exists());
    assert!(!folder.join("steps/half.png").exists());
    // A running one is left alone.
    fs::remove_dir_all(folder.join("steps")).unwrap();
    fs::create_dir(&staging).unwrap();
    let lock = fs::File::create(staging.join("lock")).unwrap();
    lock.lock().unwrap();
    run(&folder, line).failed(1, "steps & another run is writing it");
    drop(lock);
    fs::remove_dir_all(&staging).unwrap();
    assert!(listing(&folder) == before);
}

/// If the output is a link, its target is written, existing or not.
#[cfg(unix)]
#[test]
fn links_are_followed_everywhere() {
    use std::os::unix::fs::symlink;
    let folder = workshop();
    let at = |name: &str| folder.join(name);
    fs::create_dir(at("below")).unwrap();
    let is_link = |name: &str| fs::symlink_metadata(at(name)).unwrap().is_symlink();
    let line = "match left.png right.png out.pfm --max-disparity 9 --device cpu --quiet --also preview";
    for _ in 0..2 {
        for (link, to) in [("out.pfm", "below/map.pfm"), ("out.preview.png", "below/picture.png")] {
            let _ = symlink(to, at(link));
        }
        run(&folder, line).succeeded();
        assert!(is_link("out.pfm") && is_link("out.preview.png"));
        assert!(fs::read(at("below/map.pfm")).unwrap().starts_with(b"Pf\n"));
        assert!(fs::read(at("below/picture.png")).unwrap().starts_with(b"\x89PNG"));
    }
    // Inputs are recognised behind links.
    symlink("left.png", at("other.png")).unwrap();
    run(&folder, "match left.png right.png other.png --max-disparity 9")
        .failed(2, "other.png is already LEFT");

    fs::create_dir(at("maps")).unwrap();
    fs::write(at("list.csv"), "name,left,right,max_disparity\na,left.png,right.png,9\n").unwrap();
    for name in ["a.pfm", "a.json"] {
        symlink(Path::new("../below").join(name), at("maps").join(name)).unwrap();
    }
    for more in ["", "--set temperature=0.3"] {
        run(&folder, &format!("batch list.csv maps --device cpu --quiet {more}")).succeeded();
        assert!(is_link("maps/a.pfm") && is_link("maps/a.json"));
        assert!(fs::read(at("below/a.pfm")).unwrap().starts_with(b"Pf\n"));
        assert!(fs::read_to_string(at("below/a.json")).unwrap().contains("\"done\""));
    }
}
