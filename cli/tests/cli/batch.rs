//! `mrfgs batch`: the maps equal those of single matches, and every pair is matched exactly once however runs are interrupted.

use std::collections::HashSet;
use std::fmt::Write;
use std::time::SystemTime;

use super::*;

const SCENES: [&str; 4] = ["slanted", "steep", "thin", "wall"];

/// A folder with a list of `count` pairs, cut from the scenes at different places.
fn pairs(count: usize, (width, height): (u32, u32)) -> Folder {
    let folder = Folder::new();
    let mut list = String::from("name,left,right,max_disparity\n# all are cut from scenes\n");
    fs::create_dir(folder.join("images")).unwrap();
    let views =
        SCENES.map(|name| ["im0.png", "im1.png"].map(|file| image::open(scene(name).join(file)).unwrap()));
    for i in 0..count {
        let (x, y) = (i as u32 * 3 % (240 - width), i as u32 * 5 % (180 - height));
        for (view, side) in views[i % SCENES.len()].iter().zip(["left", "right"]) {
            let file = folder.join(format!("images/{i}-{side}.png"));
            view.crop_imm(x, y, width, height).save(file).unwrap();
        }
        writeln!(list, "pair-{i},images/{i}-left.png,images/{i}-right.png,31").unwrap();
    }
    fs::write(folder.join("list.csv"), list).unwrap();
    folder
}

fn batch(folder: &Path, args: &str) -> Run {
    run(folder, &format!("batch {args} --device cpu"))
}

/// The last line of a run, without the number of warnings, as some cut views hardly overlap.
fn summary(told: &Run) -> &str {
    let line = told.stderr.lines().last().unwrap_or_default();
    line.split_once(", 1 with warnings").map_or(line, |(summary, _)| summary)
}

fn record(folder: &Path, name: &str) -> Value {
    json(folder.join(format!("{name}.json")))
}

/// The files of a folder with their modification times.
fn times(folder: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let time = |path: PathBuf| (path.clone(), fs::metadata(path).unwrap().modified().unwrap());
    listing(folder).into_keys().map(time).collect()
}

fn names(folder: &Path, ending: &str) -> Vec<String> {
    let names =
        fs::read_dir(folder).into_iter().flatten().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.filter_map(|name| name.strip_suffix(ending).map(str::to_owned)).collect();
    names.sort();
    names
}

/// The maps of a folder by name.
fn maps(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    names(folder, ".pfm")
        .into_iter()
        .map(|n| (n.clone(), fs::read(folder.join(n + ".pfm")).unwrap()))
        .collect()
}

fn begun(folder: &Path) -> Child {
    started(folder, "batch list.csv out --device cpu --threads 1")
}

/// Waits until the folder has this many records.
fn wait_for(folder: &Path, records: usize) {
    wait_until("at so many records", || names(folder, ".json").len() >= records);
}

#[test]
fn a_batch_is_its_single_matches() {
    let folder = pairs(3, (96, 64));
    let told = batch(&folder, "list.csv out --also confidence,validity,raw").succeeded();
    assert_eq!((told.stdout.as_str(), told.stderr.as_str()), ("", "mrfgs: 3 done, 0 skipped, 0 failed\n"));
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    for i in 0..3 {
        let [left, right] = ["left", "right"].map(|side| format!("images/{i}-{side}.png"));
        let single = |max| {
            let line = format!("match {left} {right} a.pfm --max-disparity {max} --device cpu");
            run(&folder, &format!("{line} --also validity,confidence,raw")).succeeded();
        };
        single(31);
        for end in [".pfm", ".raw.pfm", ".confidence.png", ".validity.png"] {
            assert!(at(&format!("a{end}")) == at(&format!("out/pair-{i}{end}")), "{end} of {i}");
        }
        single(15);
        assert!(at("a.pfm") != at(&format!("out/pair-{i}.pfm")), "another range gives another map");
    }
    let record = record(&folder.join("out"), "pair-1");
    assert_eq!(record["status"], "done");
    assert_eq!((&record["labels"], &record["width"]), (&32.into(), &96.into()));
    assert_eq!(record["files"]["output"], "pair-1.pfm");
    assert!(record["density"].as_f64().unwrap() > 90.0 && record["seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(listing(&folder.join("out")).len(), 15, "no other files");

    for format in ["png", "tif"] {
        let name = format!("a.{format}");
        batch(&folder, &format!("list.csv {format} --format {format} --quiet")).succeeded();
        let pair = "images/0-left.png images/0-right.png";
        run(&folder, &format!("match {pair} {name} --max-disparity 31 --device cpu")).succeeded();
        assert!(at(&name) == at(&format!("{format}/pair-0.{format}")));
    }
}

#[test]
fn a_list_may_tell_what_is_known_of_each_scene() {
    let folder = Folder::new();
    for file in ["im0.png", "im1.png", "lidar.csv", "disp0GT.pfm"] {
        fs::copy(scene("poster").join(file), folder.join(file)).unwrap();
    }
    // A surface that is not there, before a scene with texture.
    for (from, to) in [("im0.png", "l.png"), ("im1.png", "r.png")] {
        fs::copy(scene("slanted").join(from), folder.join(to)).unwrap();
    }
    let places = (0..180).step_by(9).flat_map(|y| (0..240).step_by(9).map(move |x| (x, y)));
    let lines: Vec<_> = places.map(|(x, y)| format!("{x},{y},1\n")).collect();
    fs::write(folder.join("wrong.csv"), lines.concat()).unwrap();
    let write = |rows: &str| {
        let header = "name,left,right,max_disparity,prior,prior_sigma,prior_kind";
        fs::write(folder.join("list.csv"), format!("{header}\n{rows}")).unwrap();
    };
    write(
        "none,im0.png,im1.png,31,,,\npoints,im0.png,im1.png,31,lidar.csv,,\n\
         surface,im0.png,im1.png,31,disp0GT.pfm,2,surface\n",
    );
    let told = batch(&folder, "list.csv out").succeeded();
    assert_eq!(summary(&told), "mrfgs: 3 done, 0 skipped, 0 failed");
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    let flags = [
        ("none", ""),
        ("points", "--prior lidar.csv"),
        ("surface", "--prior disp0GT.pfm --prior-sigma 2 --prior-kind surface"),
    ];
    for (name, flags) in flags {
        run(&folder, &format!("match im0.png im1.png a.pfm --max-disparity 31 --device cpu {flags}"))
            .succeeded();
        assert!(at("a.pfm") == at(&format!("out/{name}.pfm")), "{name}");
    }
    assert_eq!(maps(&folder.join("out")).into_values().collect::<HashSet<_>>().len(), 3, "priors count");
    let recorded = record(&folder.join("out"), "points");
    assert_eq!(recorded["files"]["prior"], "lidar.csv");
    assert_eq!(record(&folder.join("out"), "none")["files"].get("prior"), None);

    // Another sigma, kind or file is another request; the same one is skipped.
    let again = |rows: &str| {
        write(rows);
        summary(&batch(&folder, "list.csv out").succeeded()).to_owned()
    };
    let [done, skipped] = ["mrfgs: 1 done, 0 skipped, 0 failed", "mrfgs: 0 done, 1 skipped, 0 failed"];
    assert_eq!(again("points,im0.png,im1.png,31,lidar.csv,,\n"), skipped);
    assert_eq!(again("points,im0.png,im1.png,31,lidar.csv,0.5,\n"), done);
    assert_eq!(again("points,im0.png,im1.png,31,lidar.csv,0.5,points\n"), done);
    let fewer = String::from_utf8(at("lidar.csv")).unwrap().lines().take(200).collect::<Vec<_>>().join("\n");
    fs::write(folder.join("lidar.csv"), fewer).unwrap();
    assert_eq!(again("points,im0.png,im1.png,31,lidar.csv,0.5,points\n"), done);

    // A prior that the images contradict gives a warning. A prior that cannot be read fails only its own pair.
    write("wrong,l.png,r.png,31,wrong.csv,,\ngone,im0.png,im1.png,31,gone.csv,,\n");
    let told = batch(&folder, "list.csv out");
    assert!(told.stderr.contains("wrong: warning: the images contradict the prior"), "{}", told.stderr);
    assert!(told.stderr.contains("gone: cannot read gone.csv"), "{}", told.stderr);
    assert!(told.stderr.contains("1 done, 0 skipped, 1 failed: gone"), "{}", told.stderr);
    write("a,im0.png,im1.png,31,list.csv,,\n");
    let told = batch(&folder, "list.csv out").stderr;
    assert!(told.contains("a: prior: list.csv: line 2: not x,y,disparity"), "{told}");
    for (row, words) in [
        ("a,im0.png,im1.png,31,,2,\n", "line 2 & prior_sigma: there is no prior"),
        ("a,im0.png,im1.png,31,lidar.csv,-1,\n", "line 2 & prior_sigma & above 0"),
        ("a,im0.png,im1.png,31,lidar.csv,1,cloud\n", "line 2 & prior_kind: must be points or surface"),
    ] {
        write(row);
        batch(&folder, "list.csv out").failed(1, &format!("list.csv & {words}"));
    }
}

/// Outputs that need cameras, with the calib.txt beside the left image or in the folder of the pair.
#[test]
fn a_batch_writes_depth_and_points() {
    let folder = Folder::new();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    fs::create_dir(folder.join("data")).unwrap();
    copy("wall", &folder.join("data/wall"));
    let row = "wall,data/wall/im0.png,data/wall/im1.png,31\n";
    fs::write(folder.join("list.csv"), format!("name,left,right,max_disparity\n{row}")).unwrap();
    let also = "--also points,depth,preview,side-by-side --colours viridis";
    let args = "match data/wall/im0.png data/wall/im1.png one.tif --device cpu";
    run(&folder, &format!("{args} {also}")).succeeded();
    for list in ["list.csv", "data"] {
        let out = format!("out-{}", list.trim_end_matches(".csv"));
        batch(&folder, &format!("{list} {out} --format tif {also}")).succeeded();
        for end in [".tif", ".depth.tif", ".points.ply", ".preview.png", ".side-by-side.png"] {
            assert!(at(&format!("one{end}")) == at(&format!("{out}/wall{end}")), "{end} of {list}");
        }
        let inputs = record(&folder.join(&out), "wall")["request"]["inputs"].to_string();
        assert!(inputs.contains("calib.txt"), "a new calibration is another request: {inputs}");
    }
    // Points in another format replace the old ones.
    run(&folder, &format!("{args} --also points.las")).succeeded();
    batch(&folder, "data out-data --format tif --also points.las").succeeded();
    assert!(at("one.points.las") == at("out-data/wall.points.las"));
    assert!(!folder.join("out-data/wall.points.ply").exists());
    fs::remove_file(folder.join("data/wall/calib.txt")).unwrap();
    let told = batch(&folder, &format!("list.csv none {also}"));
    told.says("wall: --also depth: needs camera values, but there is no calib.txt");
    assert_eq!(told.code, Some(1));
}

/// Calibrations for all pairs or for single ones in the list; raw pairs are rectified as by `match`.
#[test]
fn a_batch_takes_calibrations() {
    let folder = Folder::new();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    fs::create_dir(folder.join("raw")).unwrap();
    for file in ["left.png", "right.png", "cameras.yml"] {
        fs::copy(scene("raw").join(file), folder.join("raw").join(file)).unwrap();
    }
    let also = "--also depth,points-original --alpha 0.5";
    let pair = "raw/left.png raw/right.png";
    let given = "--rectify --calib raw/cameras.yml --max-disparity 40 --device cpu --json one.json";
    run(&folder, &format!("match {pair} one.pfm {given} {also}")).succeeded();
    let list = |row: &str| {
        let header = "name,left,right,max_disparity,calibration\n";
        fs::write(folder.join("list.csv"), format!("{header}{row}\n")).unwrap();
    };
    let flags = format!("--rectify {also}");
    for (row, calib, out) in [
        ("raw,raw/left.png,raw/right.png,40,", "--calib raw/cameras.yml", "flag"),
        ("raw,raw/left.png,raw/right.png,40,raw/cameras.yml", "", "column"),
        // The calibration in the list takes precedence.
        ("raw,raw/left.png,raw/right.png,40,raw/cameras.yml", "--calib none.yml", "both"),
    ] {
        list(row);
        batch(&folder, &format!("list.csv {out} {flags} {calib}")).succeeded().says("1 done");
        for end in ["pfm", "depth.pfm", "points-original.ply"] {
            assert!(at(&format!("one.{end}")) == at(&format!("{out}/raw.{end}")), "{end} of {out}");
        }
        let record = record(&folder.join(out), "raw");
        assert_eq!(
            (&record["rectified"], &record["files"]["calibration"]),
            (&true.into(), &"raw/cameras.yml".into())
        );
        assert!(record["request"]["inputs"].to_string().contains("cameras.yml"));
        batch(&folder, &format!("list.csv {out} {flags} {calib}")).succeeded().says("1 skipped");
    }
    // Another rectification is another request.
    batch(&folder, "list.csv column --rectify --also depth").succeeded().says("1 done");
    assert!(at("one.pfm") != at("column/raw.pfm"));
    // Unrectified cameras give no depth of rectified images, and neither does a pair without a calibration.
    let told = batch(&folder, "list.csv raw-pair --also depth");
    told.says("raw: cannot read raw/cameras.yml: describes images that are not rectified");
    assert_eq!(told.code, Some(1));
    list("raw,raw/left.png,raw/right.png,40,");
    let told = batch(&folder, "list.csv none --rectify --also depth");
    told.says(
        "raw: --also depth: without a calibration there is no scale & in the column calibration & --calib",
    );
    assert_eq!(told.code, Some(1));
    batch(&folder, "list.csv none --alpha 1").failed(2, "--alpha & --rectify");
}

#[test]
fn a_batch_rectifies_pairs_without_a_calibration() {
    let folder = Folder::new();
    for side in ["left", "right"] {
        fs::create_dir_all(folder.join("photos").join(side)).unwrap();
        fs::copy(scene(&format!("raw/{side}.png")), folder.join(format!("photos/{side}/1.png"))).unwrap();
    }
    batch(&folder, "photos out --rectify --also preview").succeeded();
    let line =
        "match @raw/left.png @raw/right.png 1.pfm --rectify --device cpu --also preview --json one.json";
    run(&folder, line).succeeded();
    for file in ["1.pfm", "1.preview.png"] {
        assert!(
            fs::read(folder.join(file)).unwrap() == fs::read(folder.join("out").join(file)).unwrap(),
            "{file}"
        );
    }
    let (found, one) = (record(&folder.join("out"), "1"), json(folder.join("one.json")));
    assert_eq!((&found["trust"], &found["rectified"]), (&one["trust"], &true.into()));
    assert!(found["files"]["calibration"].is_null() && found["trust"]["matches"].as_u64().unwrap() > 50);
    batch(&folder, "photos out --rectify --also preview").succeeded().says("1 skipped");
    batch(&folder, "photos raw").says("1 failed");
}

#[test]
fn complete_pairs_are_skipped_until_their_request_changes() {
    let folder = pairs(3, (64, 48));
    let out = folder.join("out");
    let again = |args: &str, said: &str| {
        let told = batch(&folder, &format!("list.csv out {args}")).succeeded();
        assert_eq!(summary(&told), format!("mrfgs: {said}"));
    };
    again("", "3 done, 0 skipped, 0 failed");
    let before = (listing(&out), times(&out));
    again("", "0 done, 3 skipped, 0 failed");
    assert!((listing(&out), times(&out)) == before, "finished files are not touched");

    // Each of these changes invalidates the pairs that it concerns.
    fs::remove_file(out.join("pair-0.json")).unwrap();
    again("", "1 done, 2 skipped, 0 failed");
    fs::remove_file(out.join("pair-1.pfm")).unwrap();
    again("", "1 done, 2 skipped, 0 failed");
    // A truncated map, as after a power failure on some file systems.
    let whole = fs::read(out.join("pair-1.pfm")).unwrap();
    for cut in [&[][..], &whole[..whole.len() - 1]] {
        fs::write(out.join("pair-1.pfm"), cut).unwrap();
        again("", "1 done, 2 skipped, 0 failed");
        assert!(fs::read(out.join("pair-1.pfm")).unwrap() == whole);
    }
    fs::copy(folder.join("images/1-left.png"), folder.join("images/2-left.png")).unwrap();
    again("", "1 done, 2 skipped, 0 failed");
    let list = fs::read_to_string(folder.join("list.csv")).unwrap();
    fs::write(folder.join("list.csv"), list.replacen(",31\n", ",30\n", 1)).unwrap();
    again("", "1 done, 2 skipped, 0 failed");
    again("--also validity", "3 done, 0 skipped, 0 failed");
    again("--set temperature=0.3", "3 done, 0 skipped, 0 failed");
    assert!(names(&out, ".validity.png").is_empty(), "maps of an earlier request go with its record");
    again("--set temperature=0.3", "0 done, 3 skipped, 0 failed");
    // A record of another version.
    let text = fs::read_to_string(out.join("pair-2.json")).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version));
    fs::write(out.join("pair-2.json"), text.replace(&version, "\"version\": \"0.0.1\"")).unwrap();
    again("--set temperature=0.3", "1 done, 2 skipped, 0 failed");
}

#[cfg(unix)]
#[test]
fn a_killed_batch_resumes() {
    let folder = pairs(20, (120, 90));
    batch(&folder, "list.csv whole --quiet").succeeded();
    let whole = maps(&folder.join("whole"));
    assert_eq!(whole.len(), 20);
    let out = folder.join("out");
    let mut killed = 0;
    for records in [1, 5, 9, 14] {
        let mut child = begun(&folder);
        wait_for(&out, records);
        child.kill().unwrap();
        killed += usize::from(!child.wait_with_output().unwrap().status.success());
        // Complete pairs have complete files.
        for name in names(&out, ".json") {
            assert_eq!(record(&out, &name)["status"], "done");
            assert!(fs::read(out.join(format!("{name}.pfm"))).unwrap() == whole[&name], "{name}");
        }
    }
    assert_eq!(killed, 4, "all runs were killed early");
    // Remains of a run killed in the middle of a pair.
    fs::create_dir_all(out.join(".pair-19.tmp")).unwrap();
    fs::write(out.join(".pair-19.tmp/pair-19.pfm"), "half").unwrap();
    let (complete, before) = (names(&out, ".json"), times(&out));
    assert!((14..20).contains(&complete.len()), "{complete:?}");
    let told = batch(&folder, "list.csv out").succeeded();
    let (done, skipped) = (20 - complete.len(), complete.len());
    assert_eq!(summary(&told), format!("mrfgs: {done} done, {skipped} skipped, 0 failed"));
    assert!(maps(&out) == whole);
    let after = times(&out);
    for name in complete {
        for file in [format!("{name}.json"), format!("{name}.pfm")].map(|file| out.join(file)) {
            assert_eq!(after[&file], before[&file], "{name} was not run again");
        }
    }
    assert_eq!(after.len(), 40, "no other files: {:?}", after.keys());
}

#[test]
fn runs_at_the_same_time_share_the_pairs() {
    // Enough pairs that no run finishes before the others start.
    let folder = pairs(30, (160, 120));
    batch(&folder, "list.csv single").succeeded();
    let whole = maps(&folder.join("single"));
    let out = folder.join("out");
    let runs = [(); 3].map(|()| begun(&folder));
    let done = runs.map(|run| {
        let output = run.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{said}");
        let numbers: Vec<usize> = said.split(' ').filter_map(|word| word.parse().ok()).collect();
        let [done, skipped, 0] = numbers[..] else { panic!("{said}") };
        assert_eq!(done + skipped, 30, "{said}");
        done
    });
    assert_eq!(done.iter().sum::<usize>(), 30, "every pair once: {done:?}");
    assert!(done.iter().filter(|&&done| done > 0).count() > 1, "{done:?}");
    assert!(maps(&out) == whole);
    assert_eq!(listing(&out).len(), 60, "no other files");
}

#[cfg(unix)]
#[test]
fn an_interrupted_batch_cleans_up() {
    let folder = pairs(12, (160, 120));
    let out = folder.join("out");
    let signals: &[(&str, usize)] = if cfg!(target_os = "linux") {
        &[("-INT", 1), ("-TERM", 3), ("-HUP", 5), ("-XCPU", 7)]
    } else {
        &[("-INT", 1), ("-TERM", 4)]
    };
    for &(signal, records) in signals {
        let child = begun(&folder);
        wait_for(&out, records);
        send(signal, &child);
        if records > 4 {
            // A closed terminal signals twice, from the system and the shell; a time limit signals every second.
            send(signal, &child);
        }
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{said}");
        let complete = names(&out, ".json").len();
        assert_eq!(said, format!("mrfgs: stopped after {complete} of 12; run it again to resume\n"));
        assert_eq!(listing(&out).len(), 2 * complete, "no incomplete files");
    }
    // SIGHUP is ignored, as under `nohup`.
    let mut child = Command::new("sh");
    child.args(["-c", "trap '' HUP && exec \"$0\" batch list.csv out --device cpu --threads 1"]);
    child.arg(env!("CARGO_BIN_EXE_mrfgs")).current_dir(&*folder).stderr(Stdio::null());
    let mut child = child.spawn().unwrap();
    wait_for(&out, 10);
    send("-HUP", &child);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(listing(&out).len(), 24);
}

/// An obstacle to one pair's files in the output folder only fails that pair.
#[test]
fn a_record_that_cannot_be_written_fails_only_its_pair() {
    let folder = pairs(4, (64, 48));
    let out = folder.join("out");
    fs::create_dir_all(out.join("pair-0.json/full")).unwrap();
    fs::write(out.join(".pair-1.tmp"), "no folder").unwrap();
    fs::create_dir(out.join("pair-2.pfm")).unwrap();
    let told = batch(&folder, "list.csv out --quiet");
    assert_eq!(told.code, Some(1), "{told:?}");
    told.says("pair-0: cannot write out/pair-0.json: is a folder & pair-1: cannot write out/.pair-1.tmp");
    told.says("pair-2: cannot write out/pair-2.pfm: is a folder & 1 done, 0 skipped, 3 failed");
    assert_eq!(told.stderr.lines().count(), 4, "{told:?}");
    assert_eq!(record(&out, "pair-2")["status"], "failed");
    assert_eq!(record(&out, "pair-3")["status"], "done");
    fs::remove_dir_all(out.join("pair-0.json")).unwrap();
    fs::remove_file(out.join(".pair-1.tmp")).unwrap();
    fs::remove_dir(out.join("pair-2.pfm")).unwrap();
    batch(&folder, "list.csv out").succeeded().says("3 done, 1 skipped, 0 failed");
}

/// A resumed run leaves the same files as a complete one.
#[test]
fn a_flag_that_changes_an_output_recomputes_it() {
    let folder = pairs(1, (64, 48));
    for (flags, anew) in [
        ("--also preview", true),
        ("--also preview --colours grey", true),
        ("--also preview --colours viridis --min-confidence 40", true),
        ("--also preview --colours viridis --no-data 200", true),
        ("--also preview --colours viridis --no-data 90", true),
        ("--also preview --colours viridis --no-data 90 --orient", true),
        ("--also preview --colours viridis --no-data 90 --orient --threads 1", false),
        ("--also preview --colours viridis --no-data 90 --orient --quiet", false),
        ("--also preview --colours viridis --no-data 90 --orient --max-pixels 5000", false),
        ("--also preview --colours viridis --no-data 90 --orient --shard 1/1", false),
    ] {
        let told = batch(&folder, &format!("list.csv out {flags}")).succeeded();
        let says = if anew { "1 done, 0 skipped" } else { "0 done, 1 skipped" };
        assert!(flags.contains("quiet") || told.stderr.contains(says), "{flags}: {told:?}");
        let _ = fs::remove_dir_all(folder.join("fresh"));
        batch(&folder, &format!("list.csv fresh {flags}")).succeeded();
        for name in ["pair-0.pfm", "pair-0.preview.png"] {
            let [resumed, fresh] = ["out", "fresh"].map(|out| fs::read(folder.join(out).join(name)).unwrap());
            assert!(resumed == fresh, "{name} by {flags}");
        }
    }
}

#[test]
fn a_bad_pair_does_not_stop_the_others() {
    let folder = pairs(4, (64, 48));
    let out = folder.join("out");
    let good = fs::read(folder.join("images/1-right.png")).unwrap();
    fs::write(folder.join("images/1-right.png"), "text").unwrap();
    fs::remove_file(folder.join("images/2-left.png")).unwrap();
    let told = batch(&folder, "list.csv out --quiet");
    assert_eq!((told.code, told.stdout.as_str()), (Some(1), ""));
    let lines: Vec<_> = told.stderr.lines().collect();
    assert_eq!(lines.len(), 3, "{lines:?}");
    assert!(lines[0].starts_with("mrfgs: pair-1: ") && lines[0].contains("images/1-right.png"), "{lines:?}");
    assert!(lines[1].starts_with("mrfgs: pair-2: ") && lines[1].contains("no such file"), "{lines:?}");
    let summary = "mrfgs: 2 done, 0 skipped, 2 failed: pair-1, pair-2; ";
    assert!(lines[2].starts_with(summary) && lines[2].contains("run it again"), "{lines:?}");
    assert_eq!(names(&out, ".pfm"), ["pair-0", "pair-3"]);
    let failed = record(&out, "pair-1");
    assert_eq!(failed["status"], "failed");
    assert!(failed["reason"].as_str().unwrap().contains("images/1-right.png"));

    fs::write(folder.join("images/1-right.png"), good).unwrap();
    let told = batch(&folder, "list.csv out");
    assert_eq!(told.code, Some(1));
    told.says("1 done, 2 skipped, 1 failed: pair-2;");
    assert_eq!(record(&out, "pair-1")["status"], "done");
    // A range that the format cannot store also fails only its pair.
    let list = fs::read_to_string(folder.join("list.csv")).unwrap();
    fs::write(folder.join("list.csv"), list.replacen(",31\n", ",300\n", 1)).unwrap();
    let told = batch(&folder, "list.csv out --format png");
    told.says("pair-0: cannot write out/pair-0.png: 16-bit PNG & 2 done, 0 skipped, 2 failed");
    assert_eq!(names(&out, ".pfm"), <[&str; 0]>::default(), "maps of an earlier request go with its record");
}

#[test]
fn shards_are_disjoint_and_complete() {
    let folder = pairs(9, (64, 48));
    batch(&folder, "list.csv whole").succeeded();
    let mut found = Vec::new();
    for shard in ["1/3", "2/3", "3/3"] {
        let apart = format!("part-{}", &shard[..1]);
        for out in [&apart, "together"] {
            batch(&folder, &format!("list.csv {out} --shard {shard} --quiet")).succeeded();
        }
        found.extend(names(&folder.join(apart), ".json"));
    }
    found.sort();
    let whole = folder.join("whole");
    assert_eq!(found, names(&whole, ".json"), "every pair is in exactly one shard");
    assert!(maps(&folder.join("together")) == maps(&whole));
    // New pairs do not move the others.
    let list = fs::read_to_string(folder.join("list.csv")).unwrap();
    let more = list.replacen("pair-0,", "new,images/0-left.png,images/0-right.png,31\npair-0,", 1);
    fs::write(folder.join("list.csv"), more).unwrap();
    for shard in ["1/3", "2/3", "3/3"] {
        batch(&folder, &format!("list.csv together --shard {shard} --quiet")).succeeded();
        let told = batch(&folder, &format!("list.csv together --shard {shard} --status")).succeeded();
        assert!(told.stdout.ends_with(" complete, 0 failed, 0 missing\n"), "{told:?}");
    }
    assert_eq!(
        batch(&folder, "list.csv together").succeeded().stderr,
        "mrfgs: 0 done, 10 skipped, 0 failed\n"
    );
}

#[test]
fn status_reports_and_runs_nothing() {
    let folder = pairs(4, (64, 48));
    let before = listing(&folder);
    let status = || batch(&folder, "list.csv out --status").succeeded().stdout;
    let all = |state: &str| ["0", "1", "2", "3"].map(|i| format!("{state:<9} pair-{i}\n")).concat();
    assert_eq!(status(), all("missing") + "0 complete, 0 failed, 4 missing\n");
    assert!(listing(&folder) == before);
    let image = folder.join("images/3-left.png");
    let good = fs::read(&image).unwrap();
    fs::write(&image, "").unwrap();
    assert_eq!(batch(&folder, "list.csv out").code, Some(1));
    fs::remove_file(folder.join("out/pair-1.json")).unwrap();
    // The exit status tells scripts about failures.
    let failed = batch(&folder, "list.csv out --status");
    assert_eq!(failed.code, Some(1));
    failed.says("1 of 4 failed");
    let (told, out) = (failed.stdout, folder.join("out"));
    let lines: Vec<_> = told.lines().collect();
    assert_eq!(lines[..3], ["complete  pair-0", "missing   pair-1", "complete  pair-2"]);
    assert!(lines[3].starts_with("failed    pair-3: cannot read images/3-left.png"), "{told}");
    assert_eq!(lines[4], "2 complete, 1 failed, 1 missing");
    assert!(!out.join("pair-1.json").exists());
    fs::write(&image, good).unwrap();
    batch(&folder, "list.csv out").succeeded();
    assert_eq!(status(), all("complete") + "4 complete, 0 failed, 0 missing\n");
    let other = batch(&folder, "list.csv out --status --also validity").succeeded().stdout;
    assert!(other.ends_with("0 complete, 0 failed, 4 missing\n"), "for another format: {other}");
}

#[test]
fn warnings_are_told_and_counted() {
    let folder = pairs(3, (120, 90));
    fs::copy(folder.join("images/1-left.png"), folder.join("images/1-right.png")).unwrap();
    let told = batch(&folder, "list.csv out").succeeded();
    told.says("pair-1: warning: the two images are the same");
    told.says("3 done, 0 skipped, 0 failed, 1 with warnings");
    assert_eq!(record(&folder.join("out"), "pair-1")["warnings"].as_array().unwrap().len(), 1);
    assert_eq!(told.stderr.lines().count(), 2, "the other pairs have none: {}", told.stderr);
    let quiet = batch(&folder, "list.csv other --quiet").succeeded();
    assert_eq!(quiet.stderr, "");
}

#[test]
fn the_folders_in_a_folder_are_pairs() {
    let folder = Folder::new();
    fs::create_dir(folder.join("data")).unwrap();
    for name in ["slanted", "wall"] {
        copy(name, &folder.join("data").join(name));
    }
    fs::create_dir(folder.join("data/.hidden")).unwrap();
    fs::write(folder.join("data/readme"), "").unwrap();
    batch(&folder, "data out").succeeded();
    run(&folder, "match data/wall/im0.png data/wall/im1.png wall.pfm --device cpu").succeeded();
    assert_eq!(names(&folder.join("out"), ".pfm"), ["slanted", "wall"]);
    assert!(maps(&folder.join("out"))["wall"] == maps(&folder)["wall"]);
    fs::create_dir(folder.join("data/empty")).unwrap();
    batch(&folder, "data out").says("0 done, 2 skipped, 1 failed: empty;");
    batch(&folder, "data data/out").failed(2, "data/out & the folder of the pairs & give another");
    fs::remove_dir(folder.join("data/empty")).unwrap();
    // Any valid file name is accepted.
    for name in ["two words", "straße №1 (ä) 日本"] {
        copy("wall", &folder.join("data").join(name));
    }
    assert_eq!(batch(&folder, "data out").succeeded().stderr, "mrfgs: 2 done, 2 skipped, 0 failed\n");
    let all = maps(&folder.join("out"));
    assert!(all["two words"] == all["wall"] && all["straße №1 (ä) 日本"] == all["wall"]);
    assert_eq!(batch(&folder, "data out").succeeded().stderr, "mrfgs: 0 done, 4 skipped, 0 failed\n");
    fs::create_dir(folder.join("data/a:b")).unwrap();
    batch(&folder, "data new").failed(1, "data/a:b & rename it");
    assert!(!folder.join("new").exists());
}

#[test]
fn images_in_a_folder_per_camera_are_pairs() {
    let folder = Folder::new();
    let put = |scene_name: &str, paths: [&str; 2]| {
        for (file, path) in ["im0.png", "im1.png"].into_iter().zip(paths) {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::copy(scene(scene_name).join(file), path).unwrap();
        }
    };
    put("slanted", ["photos/left/L_1.png", "photos/right/R_01.png"]);
    put("wall", ["photos/left/L_2.png", "photos/right/R_02.png"]);
    assert_eq!(batch(&folder, "photos out").succeeded().stderr, "mrfgs: 2 done, 0 skipped, 0 failed\n");
    run(&folder, "match @wall/im0.png @wall/im1.png wall.pfm --max-disparity auto --device cpu").succeeded();
    let all = maps(&folder.join("out"));
    assert_eq!(all.keys().collect::<Vec<_>>(), ["L_1", "L_2"]);
    assert!(all["L_2"] == maps(&folder)["wall"]);
    assert_eq!(batch(&folder, "photos out").succeeded().stderr, "mrfgs: 0 done, 2 skipped, 0 failed\n");
    batch(&folder, "photos deep --also depth").says("0 done, 0 skipped, 2 failed: L_1, L_2;");
    // The calibration of all pairs.
    let calib = "cam0=[100 0 120; 0 100 90; 0 0 1]\ndoffs=0\nbaseline=200\nndisp=32\n";
    fs::write(folder.join("photos/calib.txt"), calib).unwrap();
    batch(&folder, "photos deep --also depth").succeeded();
    assert_eq!(record(&folder.join("deep"), "L_1")["labels"], 32);
    put("wall", ["photos/left/L_3.png", "photos/right/R_4.png"]);
    for more in ["", "--status"] {
        batch(&folder, &format!("photos out {more}")).failed(1, "L_3.png & no partner & right & CSV");
    }
    fs::remove_file(folder.join("photos/left/L_3.png")).unwrap();
    batch(&folder, "photos out").failed(1, "R_4.png & no partner & left");
    // Names without numbers must be the same.
    put("slanted", ["named/left/cat.png", "named/right/cat.png"]);
    put("wall", ["named/left/dog.png", "named/right/eel.png"]);
    batch(&folder, "named out").failed(1, "dog.png & no partner & name in right");
    fs::rename(folder.join("named/right/eel.png"), folder.join("named/right/dog.png")).unwrap();
    batch(&folder, "named by-name").succeeded().says("2 done");
    // Folders with these names that hold a pair each.
    copy("wall", &folder.join("left"));
    copy("slanted", &folder.join("right"));
    fs::create_dir(folder.join("scenes")).unwrap();
    for side in ["left", "right"] {
        fs::rename(folder.join(side), folder.join("scenes").join(side)).unwrap();
    }
    batch(&folder, "scenes own").succeeded();
    assert_eq!(names(&folder.join("own"), ".pfm"), ["left", "right"]);
}

#[test]
fn the_folders_of_kitti_are_pairs() {
    let folder = Folder::new();
    let projection = |camera: u32, offset: f64| {
        format!(
            "S_rect_0{camera}: 240 180\nR_rect_0{camera}: 1 0 0 0 1 0 0 0 1\nP_rect_0{camera}: 100 0 120 {offset} 0 100 90 0 0 0 1 0\n"
        )
    };
    for (n, name) in ["slanted", "wall"].into_iter().enumerate() {
        for (cameras, known) in [(["image_0", "image_1"], false), (["image_2", "image_3"], true)] {
            for (camera, file) in cameras.into_iter().zip(["im0.png", "im1.png"]) {
                let to = folder.join("training").join(camera);
                fs::create_dir_all(&to).unwrap();
                fs::copy(scene(name).join(file), to.join(format!("00000{n}_10.png"))).unwrap();
            }
            if known {
                let to = folder.join("training/calib_cam_to_cam");
                fs::create_dir_all(&to).unwrap();
                let text = projection(2, 0.0) + &projection(3, -50.0);
                fs::write(to.join(format!("00000{n}.txt")), text).unwrap();
            }
        }
    }
    batch(&folder, "training out --also depth").succeeded();
    let found = record(&folder.join("out"), "000001_10");
    assert_eq!(found["files"]["calibration"], "calib_cam_to_cam/000001.txt");
    assert_eq!(found["files"]["left"], "image_2/000001_10.png");
    // The calibration is for the colour images.
    for camera in ["image_2", "image_3"] {
        fs::remove_dir_all(folder.join("training").join(camera)).unwrap();
    }
    batch(&folder, "training grey").succeeded();
    let found = record(&folder.join("grey"), "000001_10");
    assert_eq!(found["files"]["left"], "image_0/000001_10.png");
    assert!(found["files"]["calibration"].is_null());
}

#[test]
fn a_bad_list_is_refused_before_anything_runs() {
    let folder = pairs(1, (64, 48));
    let long = format!("name,left,right\n{},l,r\n", "n".repeat(201));
    let lists = [
        ("", "contains no pairs & CSV"),
        ("name,left,right\n\n# nothing\n", "contains no pairs"),
        ("a,l,r\n", "line 1 & unknown column `a` & with a header such as name,left,right; & max_disparity"),
        ("name,left,left\n", "line 1 & the column left appears twice"),
        ("name,left,max_disparity\n", "line 1 & the column right is missing"),
        ("name,left,right\na,l,r\n\n# comment\nb,l\n", "line 5 & 2 fields but 3 columns"),
        ("name,left,right\na,l,r,31\n", "line 2 & 4 fields but 3 columns"),
        ("name,left,right\na,,r\n", "line 2 & left is missing"),
        ("name,left,right\na,l.jpg,\n", "line 2 & right is missing"),
        ("name,left,right\n,l,r\n", "line 2 & name is missing"),
        ("name,left,right\na,l,r\nA,l,r\n", "line 3 & name A is taken by line 2 & rename"),
        ("name,left,right\n../a,l,r\n", "line 2 & `../a` cannot be a file name & rename"),
        ("name,left,right\n.a,l,r\n", "line 2 & `.a` cannot be a file name"),
        ("name,left,right\n-a,l,r\n", "line 2 & `-a` cannot be a file name"),
        ("name,left,right\na\u{1b}b,l,r\n", "line 2 & cannot be a file name"),
        ("name,left,right\na.,l,r\n", "line 2 & `a.` cannot be a file name & no trailing . or space"),
        ("name,left,right\nwhat?,l,r\n", "line 2 & `what?` cannot be a file name"),
        ("name,left,right\nÄ,l,r\nä,l,r\n", "line 3 & name ä is taken by line 2"),
        ("name,left,right\na.Validity,l,r\n", "line 2 & ends in .validity & rename"),
        (&*long, "line 2 & at most 200"),
        ("name,left,right,max_disparity\na,l,r,many\n", "line 2 & max_disparity & whole number"),
        ("name,left,right,max_disparity\na,l,r,-3\n", "line 2 & max_disparity & below & min_disparity"),
        ("name,left,right,min_disparity\na,l,r,1.5\n", "line 2 & min_disparity & whole number"),
    ];
    for (text, words) in lists {
        fs::write(folder.join("bad.csv"), text).unwrap();
        let before = listing(&folder);
        for more in ["", "--status"] {
            batch(&folder, &format!("bad.csv out {more}")).failed(1, &format!("bad.csv & {words}"));
        }
        assert!(listing(&folder) == before, "{text}");
    }
    fs::write(folder.join("bad.csv"), b"name,left,right\n\xff,l,r\n").unwrap();
    batch(&folder, "bad.csv out").failed(1, "bad.csv & UTF-8");
    // Quotes, spaces, another order of columns, a byte order mark, and Windows line ends.
    let good = "\u{feff}mask,right, left ,name\r\n,\"images/0-right.png\",images/0-left.png,a\r\n";
    fs::write(folder.join("good.csv"), good).unwrap();
    assert_eq!(batch(&folder, "good.csv out").succeeded().stderr, "mrfgs: 1 done, 0 skipped, 0 failed\n");
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_without_permission_ends_a_batch_at_once() {
    let folder = pairs(2, (64, 48));
    let locked = locked(&folder);
    batch(&folder, &format!("list.csv {locked}")).failed(1, &format!("{locked} & nothing can be created"));
}
