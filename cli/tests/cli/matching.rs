//! `mrfgs match` and `mrfgs inspect`: outputs and messages.

use std::io::{BufRead, BufReader, Read};

use mrfgs::maps::flag;

use super::*;

#[test]
fn match_writes_every_output_in_every_format() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let line = "match @slanted/im0.png @slanted/im1.png --mask mask.png";
    let mask = image::GrayImage::from_fn(240, 180, |x, y| image::Luma([u8::from(x > 200 && y < 9) * 9]));
    mask.save(at("mask.png")).unwrap();

    let first = "a.pfm --also raw,confidence --also validity,preview --threads 2 --device cpu";
    let told = run(&folder, &format!("{line} {first}")).succeeded();
    assert_eq!(told.stdout, "");
    assert_eq!(told.stderr.lines().count(), 1, "{}", told.stderr);
    told.says("mrfgs: 240 x 180, 32 disparities,  &  s on the CPU path, 2 threads\n");

    let map = read::read_disparity(&at("a.pfm")).unwrap();
    let raw = read::read_disparity(&at("a.raw.pfm")).unwrap();
    let validity = read::grey8(&at("a.validity.png")).unwrap();
    let confidence = read::grey8(&at("a.confidence.png")).unwrap();
    assert_eq!([map.size(), raw.size(), validity.size(), confidence.size()], [(240, 180); 4]);
    let preview = image::open(at("a.preview.png")).unwrap();
    assert_eq!((preview.width(), preview.color()), (240, image::ColorType::Rgb8));
    assert!(preview.height() > 180, "the colour bar is below the map");
    let (mut measured, mut filled) = (0, 0);
    for y in 0..180 {
        for x in 0..240 {
            let masked = x > 200 && y < 9;
            let flags = validity[(x, y)];
            assert_eq!(masked, flags & flag::MASKED != 0, "{x}, {y}");
            assert_eq!(masked, !map[(x, y)].is_finite(), "only masked pixels stay unfilled");
            assert_eq!(masked, !raw[(x, y)].is_finite());
            assert!(masked || (0.0..=31.0).contains(&map[(x, y)]), "{}", map[(x, y)]);
            assert!((flags & (flag::INVALID | flag::LOW_CONFIDENCE)).count_ones() <= 1, "{flags}");
            assert!(flags & flag::INVALID == 0 || confidence[(x, y)] == 0);
            measured += usize::from(flags == 0);
            filled += usize::from(flags & flag::FILLED != 0);
        }
    }
    assert!(measured > 20_000 && filled > 500, "{measured} measured, {filled} filled");
    assert!(confidence.data().iter().any(|&c| c > 80));
    assert!(map != raw, "post-processing changes the map");

    // The same map in the other formats; the number of threads does not matter.
    for (output, raw_output, step) in [
        ("b.png", "b.raw.png", 256.0),
        ("c.tiff", "c.raw.tiff", f32::INFINITY),
        ("C.PFM", "C.raw.PFM", f32::INFINITY),
    ] {
        let more = "--also raw --threads 1 --quiet --max-disparity 31";
        let quiet = run(&folder, &format!("{line} {output} {more}")).succeeded();
        assert_eq!((quiet.stdout, quiet.stderr), (String::new(), String::new()));
        for (name, expected) in [(output, &map), (raw_output, &raw)] {
            let same = read::read_disparity(&at(name)).unwrap();
            for (a, b) in same.data().iter().zip(expected.data()) {
                // In 16-bit PNG a disparity of 0 is stored as 1/256.
                let none = (a * step - 1.0).abs() < 1e-6 && *b == 0.0;
                assert!(a.total_cmp(b).is_eq() || none, "{name}: {a} and {b}");
            }
        }
    }
    let tiff = read_tiff(at("c.tiff"));
    assert!(tiff[(239, 0)].is_nan() && tiff[(0, 0)].is_finite(), "invalid is NaN in TIFF");
    // The last row of a PFM file is the top row.
    let pfm = fs::read(at("a.pfm")).unwrap();
    assert!(pfm.ends_with(&f32::INFINITY.to_le_bytes()), "invalid is +inf in PFM");
    let png = image::open(at("b.png")).unwrap().into_luma16();
    assert!(png.get_pixel(239, 0).0 == [0] && png.get_pixel(0, 0).0 != [0], "invalid is 0 in PNG");

    // Without the fill, invalid pixels stay invalid.
    run(&folder, &format!("{line} d.pfm --set fill=row --set fill=none --also validity")).succeeded();
    let map = read::read_disparity(&at("d.pfm")).unwrap();
    let validity = read::grey8(&at("d.validity.png")).unwrap();
    assert!(map.data().iter().zip(validity.data()).all(|(d, f)| d.is_finite() == (f & flag::INVALID == 0)));
    assert!(map.data().iter().filter(|d| !d.is_finite()).count() > 1000);

    let names: Vec<_> = listing(&folder).into_keys().collect();
    assert_eq!(names.len(), 14, "no other files: {names:?}");
}

#[test]
fn ranges_may_be_negative() {
    let folder = workshop();
    // With swapped views every disparity has the opposite sign.
    run(&folder, "match right.png left.png out.tif --min-disparity -31 --max-disparity -1").succeeded();
    let map = read::read_disparity(&folder.join("out.tif")).unwrap();
    assert_eq!(map.size(), (60, 40));
    assert!(map.data().iter().all(|d| (-31.0..=-1.0).contains(d)));
}

#[test]
fn a_missing_range_is_estimated() {
    let folder = Folder::new();
    for (from, to) in [("im0.png", "left.png"), ("im1.png", "right.png"), ("disp0GT.pfm", "truth.pfm")] {
        fs::copy(scene("mixed").join(from), folder.join(to)).unwrap();
    }
    let truth = read::read_disparity(&folder.join("truth.pfm")).unwrap();
    let finite = || truth.data().iter().copied().filter(|d| d.is_finite());
    let (least, most) = (finite().fold(f32::MAX, f32::min), finite().fold(f32::MIN, f32::max));
    for extra in ["", "--max-disparity auto"] {
        let said = run(&folder, &format!("match left.png right.png out.pfm {extra}")).succeeded().stderr;
        let line = said.lines().find(|l| l.contains("estimated from the images")).expect("said on stderr");
        let numbers: Vec<f32> =
            line.split_whitespace().filter_map(|w| w.trim_end_matches(',').parse().ok()).collect();
        assert!(numbers[0] <= least && numbers[1] >= most, "{line} and the truth is {least} to {most}");
        assert!(numbers[1] - numbers[0] < 1.5 * (most - least), "{line} and the truth is {least} to {most}");
    }
    // The user's limit takes precedence.
    let line = "match left.png right.png out.pfm --max-disparity auto --min-disparity 2";
    run(&folder, line).succeeded().says("disparities 2 to ");
}

/// Two distant surfaces have sparse matches; a near one is too noisy for these, but not for the match.
#[test]
fn an_estimated_range_is_widened_if_the_scene_exceeds_it() {
    let folder = Folder::new();
    let noise = |x: u32, y: u32, seed: u32| {
        let v = (x.wrapping_mul(7919) + y.wrapping_mul(104_729) + seed.wrapping_mul(15_485_863))
            .wrapping_mul(0x9e37_79b9);
        ((v ^ (v >> 15)).wrapping_mul(0x85eb_ca6b) >> 20) & 0xff
    };
    for (view, name) in [(0, "left.png"), (1, "right.png")] {
        let image = image::GrayImage::from_fn(320, 240, |x, y| {
            let disparity = if y < 80 { 5 } else { 30 };
            let near = y >= 150;
            let x = x + view * if near { 48 } else { disparity };
            let texture = noise(x, y, 1);
            let level = if near { texture.midpoint(noise(x, y, 2 + view)) } else { texture };
            image::Luma([level as u8])
        });
        image.save(folder.join(name)).unwrap();
    }
    let line = "match left.png right.png out.pfm --method fast --json out.json";
    let found = run(&folder, line).succeeded();
    found.says("disparities 0 to 40, estimated from the images");
    found.says("disparities 0 to 60 in a second match, because the scene goes beyond the estimate");
    found.says("61 disparities");
    assert!(fs::read_to_string(folder.join("out.json")).unwrap().contains("\"labels\": 61"));
    let map = read::read_disparity(&folder.join("out.pfm")).unwrap();
    assert!((47.0..49.0).contains(&map[(200, 200)]), "{}", map[(200, 200)]);
    // All frames use the range of the first one.
    for name in ["left", "right"] {
        fs::create_dir(folder.join(name)).unwrap();
        fs::copy(folder.join(format!("{name}.png")), folder.join(name).join("1.png")).unwrap();
    }
    let sequence = run(&folder, "sequence left right maps --method fast").succeeded();
    sequence.says("disparities 0 to 60 in a second match, because the scene of the first frame goes beyond");
    assert_eq!(fs::read(folder.join("maps/1.pfm")).unwrap(), fs::read(folder.join("out.pfm")).unwrap());
    // A user's own range is kept.
    run(&folder, "match left.png right.png out.pfm --method fast --max-disparity 40")
        .succeeded()
        .says("41 disparities");
}

/// If the pair was rectified with a wrong calibration, the warning does not suggest to rectify it.
#[test]
fn misaligned_rows_after_rectification_are_reported() {
    let folder = Folder::new();
    let raw = |name: &str| scene("raw").join(name).display().to_string();
    let right = image::open(raw("right.png")).unwrap();
    let (width, height) = (right.width(), right.height());
    let mut lower = right.clone();
    image::imageops::replace(&mut lower, &right.crop_imm(0, 0, width, height - 3), 0, 3);
    lower.save(folder.join("lower.png")).unwrap();
    let line = |right: &str| {
        let (left, calib) = (raw("left.png"), raw("cameras.yml"));
        format!("match {left} {right} out.pfm --rectify --calib {calib} --max-disparity 40 --method fast")
    };
    let told = run(&folder, &line("lower.png")).succeeded();
    told.says("warning: after rectification matches lie & px above or below their row: the calibration");
    assert!(!told.stderr.contains("add --rectify"), "{}", told.stderr);
    let good = run(&folder, &line(&raw("right.png"))).succeeded();
    assert!(!good.stderr.contains("warning"), "{}", good.stderr);
}

#[test]
fn a_pair_that_is_not_rectified_is_named() {
    let folder = Folder::new();
    for (shift, warns) in [(0, false), (1, true), (2, true)] {
        for (from, to, top) in [("im0.png", "left.png", 0), ("im1.png", "right.png", shift)] {
            let image = image::open(scene("mixed").join(from)).unwrap();
            image.crop_imm(0, top, 320, 230).save(folder.join(to)).unwrap();
        }
        let told = run(&folder, "match left.png right.png out.pfm --max-disparity 47").succeeded();
        let words = ["not rectified", "add --rectify (and --calib FILE if you have a calibration)"];
        for word in words {
            assert_eq!(told.stderr.contains(word), warns, "{told:?}");
        }
    }
}

/// The estimated range then has negative disparities, so it is not checked against the warning.
#[test]
fn swapped_views_are_reported_for_any_range() {
    let folder = Folder::new();
    copy("mixed", &folder.join("mixed"));
    let views = "mixed/im1.png,mixed/im0.png";
    let list = format!("name,left,right,max_disparity\nauto,{views},auto\ngiven,{views},47\n");
    fs::write(folder.join("list.csv"), list).unwrap();
    for (range, warns) in [("auto", true), ("47", true), ("0 --min-disparity -47", false)] {
        let line = "match mixed/im1.png mixed/im0.png out.pfm --device cpu --max-disparity";
        let told = run(&folder, &format!("{line} {range}")).succeeded();
        assert_eq!(told.stderr.contains("warning: the views seem to be swapped"), warns, "{told:?}");
    }
    run(&folder, "batch list.csv maps --device cpu").succeeded();
    for name in ["auto", "given"] {
        let record = fs::read_to_string(folder.join(format!("maps/{name}.json"))).unwrap();
        assert!(record.contains("the views seem to be swapped"), "{name}: {record}");
    }
}

#[test]
fn no_data_values_are_ignored() {
    let folder = Folder::new();
    // A border of 255 on the left; no other pixel has that value.
    for (from, to) in [("im0.png", "left.png"), ("im1.png", "right.png")] {
        let mut image = image::open(scene("mixed").join(from)).unwrap().to_luma8();
        for (x, _, pixel) in image.enumerate_pixels_mut() {
            pixel.0[0] = if x < 9 { 255 } else { pixel.0[0].min(254) };
        }
        image.save(folder.join(to)).unwrap();
    }
    let map = |more: &str| {
        let line = "match left.png right.png out.tif --max-disparity 47 --device cpu --quiet";
        run(&folder, &format!("{line} {more}")).succeeded();
        read::read_disparity(&folder.join("out.tif")).unwrap()
    };
    let border =
        |map: &Plane<f32>| (0..240).flat_map(|y| (0..9).map(move |x| (x, y))).all(|at| map[at].is_infinite());
    let ignored = map("--no-data 255");
    assert!(border(&ignored) && ignored[(20, 20)].is_finite());
    assert!(!border(&map("")) && !border(&map("--no-data -1")));
}

#[test]
fn a_range_that_clips_the_scene_is_reported() {
    let folder = Folder::new();
    let said = |more: &str| {
        let line = "match @mixed/im0.png @mixed/im1.png out.pfm --device cpu";
        run(&folder, &format!("{line} {more}")).succeeded().stderr
    };
    assert!(!said("--max-disparity 47").contains("warning: "));
    for (range, remedy) in [
        ("--max-disparity 25", "raise --max-disparity\n"),
        ("--max-disparity 47 --min-disparity 19", "lower --min-disparity\n"),
    ] {
        let told = said(range);
        assert!(told.ends_with(remedy) && told.contains("warning: "), "{told}");
    }
    assert_eq!(said("--max-disparity 25 --quiet"), "");
}

#[test]
fn inspect_shows_every_step() {
    let folder = workshop();
    let line = "inspect left.png right.png steps --max-disparity 20 --set levels=3 --set final-iterations=3";
    for (preset, more) in
        [("default", &[][..]), ("paper", &["corrected-left", "zones", "matches", "label-range-width"][..])]
    {
        run(&folder, &format!("{line} --method {preset}")).succeeded();
        let steps = folder.join("steps");
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
        // Each level's map is also there in pixels of the level.
        for z in 0..3 {
            let map = read::read_disparity(&steps.join(format!("map-level-{z}.pfm"))).unwrap();
            let (size, levels) = (size(&format!("map-level-{z}")), map.data());
            assert_eq!(map.size().0 as u32, size.0);
            assert!(levels.iter().all(|d| d.fract() == 0.0 && (0.0..=(20 >> z) as f32 + 1.0).contains(d)));
            assert!(levels.iter().any(|d| d.total_cmp(&levels[0]).is_ne()), "level {z}");
        }
        for name in more {
            assert!(size(name).0 >= 60, "{name}");
        }
        assert_eq!(steps.join("zones.png").exists(), preset == "paper");
        let changes = fs::read_to_string(steps.join("change-per-iteration.csv")).unwrap();
        assert!(changes.lines().count() > 3 && changes.starts_with("iteration,rms_change_px"), "{changes}");
        assert!(listing(&folder).keys().all(|p| !p.to_str().unwrap().contains(".mrfgs-")));
        fs::remove_dir_all(steps).unwrap();
    }
}

#[cfg(unix)]
#[test]
fn a_stopped_run_leaves_nothing_behind() {
    // `inspect` once its folder exists, `evaluate` once it has reported the first pair.
    for (signal, line) in [
        ("-INT", "inspect @mixed/im0.png @mixed/im1.png steps --json told.json"),
        ("-TERM", "evaluate @slanted @mixed --report report"),
    ] {
        let folder = Folder::new();
        let more = "--method paper --set tolerance=0 --device cpu --threads 1";
        let mut child = started(&folder, &format!("{line} {more}"));
        let mut told = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        if line.starts_with("evaluate") {
            told.read_line(&mut said).unwrap();
            assert!(said.contains("slanted"), "{said}");
        } else {
            wait_until("begun", || fs::read_dir(&*folder).unwrap().next().is_some());
        }
        send(signal, &child);
        told.read_to_string(&mut said).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{line}: {said}");
        assert_eq!(said.lines().last(), Some("mrfgs: stopped; no output was left behind"), "{line}");
        assert_eq!(output.stdout, b"", "{line}");
        assert!(listing(&folder).is_empty(), "{line}: {:?}", listing(&folder).keys());
    }
}

/// A pipe without a writer does not delay the first signal.
#[cfg(unix)]
#[test]
fn a_wait_for_input_is_stopped_at_once() {
    for signal in ["-INT", "-TERM"] {
        let folder = Folder::new();
        assert!(Command::new("mkfifo").arg(folder.join("left.png")).status().unwrap().success());
        let child = started(&folder, "match left.png @mixed/im1.png out.pfm --device cpu");
        std::thread::sleep(Duration::from_secs(1));
        send(signal, &child);
        assert_eq!(child.wait_with_output().unwrap().status.code(), Some(130));
        assert_eq!(fs::read_dir(&*folder).unwrap().count(), 1, "nothing but the pipe");
    }
}

#[test]
fn files_in_the_way_are_replaced_and_devices_are_not() {
    let folder = workshop();
    fs::write(folder.join("out.pfm"), "old").unwrap();
    #[cfg(unix)]
    for file in ["out.raw.pfm", "out.preview.png"] {
        std::os::unix::fs::symlink("/dev/null", folder.join(file)).unwrap();
    }
    let line = "match left.png right.png out.pfm --max-disparity 15 --quiet --also raw,preview";
    run(&folder, line).succeeded();
    assert_eq!(read::read_disparity(&folder.join("out.pfm")).unwrap().size(), (60, 40));
    #[cfg(unix)]
    for file in ["out.raw.pfm", "out.preview.png"] {
        assert!(fs::symlink_metadata(folder.join(file)).unwrap().is_symlink(), "{file}");
    }
}

#[test]
fn a_dry_run_prints_the_plan_and_leaves_nothing() {
    let folder = workshop();
    let before = listing(&folder);
    let with = |more: &str| {
        run(&folder, &format!("match left.png right.png out.pfm --max-disparity 20 --dry-run {more}"))
            .succeeded()
    };
    let plan = with("--quiet --also raw");
    assert_eq!(plan.stderr, "");
    for words in [
        "60 x 40 pixels, disparities 0 to 20 (21 labels)",
        "\n0 | 60 x 40 | 0 to 20 (21) | ",
        "\n5 | 2 x 2 | 0 to 1 (2) | ",
        "\nmessages | 8 bits",
        "3 iterations of levels 1 to 5",
        "1 iteration of level 0\n",
        "KiB",
        "\nall | ",
    ] {
        assert!(in_cells(&plan.stdout).contains(words), "no `{words}` in:\n{}", plan.stdout);
    }
    with("--set final-iterations=3").prints("3 iterations of level 0, the others in between");
    let accurate = with("--method accurate");
    let (own, double) = accurate.stdout.split_once("\nThen at twice the size:\n\n").unwrap();
    assert!(own == plan.stdout && double.starts_with("120 x 80 pixels, disparities 0 to 40 (41 labels)"));
    let paper = "30 iterations of levels 0 to 5 & or fewer, once the map changes by at most 0.1 px";
    with("--method paper").prints(&format!("16 bits & {paper}"));
    // It finds what a real run would.
    let line = "match left.png right.png none/out.pfm --max-disparity 20 --dry-run";
    run(&folder, line).failed(1, "none & create it");
    assert!(listing(&folder) == before);
}

/// A small `--memory` leads to tiles, which are reported.
#[test]
fn little_memory_makes_tiles() {
    let folder = workshop();
    let pair = "@thin/im0.png @thin/im1.png";
    let with = |more: &str| run(&folder, &format!("match {pair} out.pfm --device cpu {more}"));
    let one = with("--dry-run").succeeded();
    assert!(!one.stdout.contains("tiles") && !one.stdout.contains("whole image"), "{one:?}");
    let words = "240 x 180 pixels, disparities 0 to 31 (32 labels) & in 4 tiles of up to & whole image & all";
    with("--dry-run --memory 16MiB").succeeded().prints(words);
    with("").succeeded().says("32 disparities, 22 iterations");
    with("--memory 16MiB").succeeded().says("32 disparities, 4 tiles, 22 iterations");
    assert_eq!(read::read_disparity(&folder.join("out.pfm")).unwrap().size(), (240, 180));
    let inspect = |more: &str| run(&folder, &format!("inspect {pair} --device cpu --memory 16MiB {more}"));
    let told = inspect("").succeeded();
    told.says("32 disparities, 4 tiles, 22 iterations");
    for (stage, runs) in [("cost", 8), ("right_view", 8), ("left_right_check", 2), ("plane", 1)] {
        let row = told.stdout.lines().find(|line| line.starts_with(&format!("{stage}  "))).unwrap();
        assert_eq!(row.split_whitespace().rev().nth(3), Some(&*runs.to_string()), "{row}");
    }
    // The folder of steps needs a match without tiles.
    let before = listing(&folder);
    inspect("steps").failed(2, "DIR & in memory at once & give --memory");
    assert!(listing(&folder) == before);
}

#[test]
fn inspect_names_every_stage() {
    let folder = workshop();
    let before = listing(&folder);
    let line = "inspect left.png right.png --max-disparity 9 --device cpu";
    let table = run(&folder, line).succeeded().stdout;
    let row = |name: &str| table.lines().find(|l| l.starts_with(name)).map(str::to_owned);
    for stage in [
        "stage ",
        "graph, level 0",
        "cost ",
        "pyramid, level 5",
        "flood, level 0",
        "speckle_filter ",
        "plane ",
        "download ",
        "rest ",
        "all ",
    ] {
        assert!(row(stage).is_some(), "no `{stage}` in:\n{table}");
    }
    assert!(row("all ").unwrap().ends_with(" 100.0 %"), "{table}");
    assert!(row("flood, level 5").unwrap().split_whitespace().nth(3) == Some("20"), "{table}");
    assert!(!table.contains("dispatches"), "{table}");
    assert!(listing(&folder) == before, "no files without DIR");
}

#[cfg(not(target_os = "macos"))]
#[test]
fn without_a_driver_auto_uses_the_cpu_path() {
    let folder = workshop();
    let line = "match left.png right.png out.pfm --max-disparity 9 --device auto";
    run_with(&folder, line, NO_DRIVER).succeeded().says(" on the CPU path, ");
    let told = run_with(&folder, "devices", NO_DRIVER).succeeded();
    assert_eq!(told.stdout, "no Vulkan or Metal driver found: `auto` uses the CPU\n");
}

/// Without `--threads` the environment may limit the threads; there are never more than the work needs.
#[test]
fn threads_follow_the_environment_and_the_work() {
    let folder = Folder::new();
    let line = "match @slanted/im0.png @slanted/im1.png out.pfm --device cpu --max-disparity 31";
    let map = || fs::read(folder.join("out.pfm")).unwrap();
    let names = ["RAYON_NUM_THREADS", "OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE"];
    let run = |more: &str, one: Option<&str>| {
        let environment = names.map(|name| (name, if one == Some(name) { "1" } else { "" }));
        run_with(&folder, &format!("{line} {more}"), &environment).succeeded()
    };
    for name in names {
        run("", Some(name)).says(" on the CPU path, 1 thread\n");
    }
    let expected = map();
    // --threads overrides the environment.
    run("--threads 3", Some("OMP_NUM_THREADS")).says(" on the CPU path, 3 threads\n");
    assert!(map() == expected);
    let told = run("--threads 1024", None).stderr;
    assert!(map() == expected);
    let count = told.split("CPU path, ").nth(1).unwrap().split(' ').next().unwrap();
    let most = 4 * std::thread::available_parallelism().unwrap().get();
    assert!((3..=most).contains(&count.parse().unwrap()), "{told}");
}

/// A JPEG file of one view of a scene, or of several side by side, in this order.
fn jpeg_of(views: &[usize]) -> Vec<u8> {
    let images =
        views.iter().map(|view| image::open(scene(&format!("slanted/im{view}.png"))).unwrap().to_rgb8());
    let images: Vec<_> = images.collect();
    let (width, height) = images[0].dimensions();
    let both = image::RgbImage::from_fn(width * images.len() as u32, height, |x, y| {
        *images[(x / width) as usize].get_pixel(x % width, y)
    });
    let mut file = std::io::Cursor::new(Vec::new());
    both.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
    file.into_inner()
}

/// Damage that the decoder conceals is reported with the file name, by every command that reads pairs.
#[test]
fn a_damaged_jpeg_is_reported() {
    let folder = Folder::new();
    let sound = jpeg_of(&[1]);
    let middle = sound.len() / 2;
    let damaged = [&sound[..middle], &sound[middle + 40..]].concat();
    fs::write(folder.join("l.jpg"), jpeg_of(&[0])).unwrap();
    fs::write(folder.join("sound.jpg"), &sound).unwrap();
    fs::write(folder.join("r.jpg"), damaged).unwrap();
    let words =
        "warning: r.jpg: the JPEG data is damaged: & a part of the image may be wrong: get the file again";
    let line = "match l.jpg r.jpg d.pfm --max-disparity 31 --device cpu";
    run(&folder, line).succeeded().says(words);
    let said = run(&folder, &format!("{line} --quiet")).succeeded().stderr;
    assert_eq!(said, "");
    let said = run(&folder, &line.replace("r.jpg", "sound.jpg")).succeeded().stderr;
    assert!(!said.contains("damaged"), "{said}");
    let size = (240, 180);
    let matrix = |name: &str, (rows, cols): (usize, usize), data: &str| {
        format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n")
    };
    let camera = "180., 0., 119.5, 0., 180., 89.5, 0., 0., 1.";
    let calibration = [
        format!("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", size.0, size.1),
        matrix("K1", (3, 3), camera),
        matrix("D1", (1, 5), "0., 0., 0., 0., 0."),
        matrix("K2", (3, 3), camera),
        matrix("D2", (1, 5), "0., 0., 0., 0., 0."),
        matrix("R", (3, 3), "1., 0., 0., 0., 1., 0., 0., 0., 1."),
        matrix("T", (3, 1), "-0.16, 0., 0."),
    ];
    fs::write(folder.join("c.yml"), calibration.concat()).unwrap();
    run(&folder, "rectify l.jpg r.jpg rectified --calib c.yml").succeeded().says(words);
    run(&folder, &format!("{line} --rectify --calib c.yml")).succeeded().says(words);
    fs::write(folder.join("pairs.csv"), "name,left,right,max_disparity\na,l.jpg,r.jpg,31\n").unwrap();
    run(&folder, "batch pairs.csv out --device cpu").succeeded().says("r.jpg: the JPEG data is damaged");
}

/// One file with both views, right view first, gives the map of its halves.
#[test]
fn both_views_may_be_in_one_file() {
    let folder = Folder::new();
    fs::write(folder.join("both.jps"), jpeg_of(&[1, 0])).unwrap();
    let whole = image::load_from_memory(&fs::read(folder.join("both.jps")).unwrap()).unwrap().to_rgb8();
    for (name, x) in [("right.png", 0), ("left.png", 240)] {
        image::imageops::crop_imm(&whole, x, 0, 240, 180).to_image().save(folder.join(name)).unwrap();
    }
    let flags = "--max-disparity 31 --device cpu --quiet";
    run(&folder, &format!("match left.png right.png wanted.pfm {flags}")).succeeded();
    fs::write(folder.join("pairs.csv"), "name,left,right,max_disparity\na,both.jps,,31\n").unwrap();
    run(&folder, "batch pairs.csv out --device cpu").succeeded();
    // A folder of such files is a list.
    fs::create_dir(folder.join("shots")).unwrap();
    fs::copy(folder.join("both.jps"), folder.join("shots/a.JPS")).unwrap();
    fs::write(folder.join("shots/.b.mpo"), "").unwrap();
    run(&folder, "batch shots shown --device cpu").succeeded().says("1 done, 0 skipped, 0 failed");
    assert!(folder.join("shown/a.pfm").is_file());
    // The test's decoder may round chroma differently.
    let (wanted, found) = (read_pfm(folder.join("wanted.pfm")), read_pfm(folder.join("out/a.pfm")));
    let same = |a: &Plane<f32>, b: &Plane<f32>| {
        a.data().iter().zip(b.data()).filter(|(a, b)| (*a - *b).abs() < 0.5).count() * 100 / a.data().len()
    };
    assert!(same(&wanted, &found) > 97, "{}", same(&wanted, &found));
    run(&folder, &format!("match right.png left.png swapped.pfm {flags}")).succeeded();
    assert!(same(&read_pfm(folder.join("swapped.pfm")), &found) < 50);
    // Flags may stand between the positional arguments.
    run(&folder, "match both.jps --max-disparity 31 --device cpu found.pfm --quiet").succeeded();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(at("found.pfm") == at("out/a.pfm"));
    run(&folder, "inspect both.jps --max-disparity 31 --device cpu --json -").succeeded();
    // If the file does not say which half is which, matches decide.
    fs::write(folder.join("turned.jps"), jpeg_of(&[0, 1])).unwrap();
    run(&folder, &format!("match turned.jps turned.pfm {flags}")).succeeded();
    assert!(same(&wanted, &read_pfm(folder.join("turned.pfm"))) > 97);
    run(&folder, &format!("match both.jps {flags}")).failed(2, "OUTPUT & missing");
    run(&folder, &format!("match left.png right.png {flags}")).failed(2, "OUTPUT & missing");
    for many in ["a.y4m", "a.MP4", "a.bag", "a.mcap"] {
        run(&folder, &format!("match {many} new.pfm"))
            .failed(2, &format!("LEFT & {many} holds many pairs & mrfgs sequence"));
    }
    // The command is missing.
    run(&folder, "left.png right.png map.pfm").failed(2, "a command before left.png & mrfgs match & --help");
    run(&folder, "lift.png").failed(2, "lift.png & --help");
    // An image lies on its side.
    image::open(folder.join("right.png")).unwrap().rotate90().save(folder.join("upright.png")).unwrap();
    run(&folder, "match left.png upright.png map.pfm").failed(1, "the same size & --orient & --rectify");
    // The name of the map is not taken for a view.
    run(&folder, &format!("match left.png new.pfm {flags}"))
        .failed(2, "RIGHT & missing & left.png & .mpo or .jps");
    run(&folder, "rectify both.jps").failed(2, "DIR & missing");
    run(&folder, "rectify left.png").failed(2, "RIGHT & missing & left.png holds one view");
}

/// Integers in a map are divided by their scale, in any format.
#[test]
fn maps_of_whole_numbers_take_their_scale() {
    let folder = Folder::new();
    let truth = read_pfm(scene("slanted/disp0GT.pfm"));
    let levels = |scale: f32| truth.map(|d| if d.is_finite() { (d * scale).round() as u16 } else { 0 });
    let (width, height) = truth.size();
    let save = |name: &str, scale: f32| {
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(
            width as u32,
            height as u32,
            levels(scale).into_data(),
        );
        image.unwrap().save(folder.join(name)).unwrap();
    };
    save("kitti.png", 256.0);
    save("other.png", 100.0);
    save("other.tif", 100.0);
    let error = |line: &str| {
        let line = format!("evaluate map {line} --truth @slanted/disp0GT.pfm --json -");
        run(&folder, &line).succeeded().json()["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap()
    };
    assert!(error("kitti.png") < 0.01);
    assert!(error("other.png --scale 100") < 0.01);
    assert!(error("other.tif --scale 100") < 0.01);
    assert!(error("other.png") > 1.0);
    let line = "evaluate map @slanted/disp0GT.pfm --truth other.png --truth-scale 100 --json -";
    let json = run(&folder, line).succeeded().json();
    assert!(json["pairs"][0]["final"]["all"]["avg"].as_f64().unwrap() < 0.01);
    run(&folder, "evaluate map other.tif --truth other.png").failed(1, "other.tif & whole numbers & --scale");
    run(&folder, "depth other.png a.pfm --calib @slanted/calib.txt --scale 100 --also depth --quiet")
        .succeeded();
    run(&folder, "depth kitti.png b.pfm --calib @slanted/calib.txt --also depth --quiet").succeeded();
    let [a, b] = ["a.depth.pfm", "b.depth.pfm"].map(|name| read_pfm(folder.join(name)));
    let off =
        a.data().iter().zip(b.data()).filter(|(a, b)| a.is_finite() && (*a / *b - 1.0).abs() > 0.01).count();
    assert!(off * 100 < a.data().len(), "{off}");
}
