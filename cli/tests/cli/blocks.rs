//! `mrfgs match` of pairs larger than the memory, in blocks: resumed, shared, and joined.

use std::time::SystemTime;

use super::*;

/// The size of the pair of [`large_pair`].
const SIZE: (u32, u32) = (1500, 1100);
/// A folder with a textured slope that does not fit in 64 MiB.
fn large_pair() -> Folder {
    let folder = Folder::new();
    let noise = |x: u32, y: u32| {
        let hash = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b);
        (hash.wrapping_mul(0xc2b2_ae35) >> 24) as u8
    };
    let texture = |x: u32, y: u32| ((2 * u16::from(noise(x / 3, y / 3)) + u16::from(noise(x, y))) / 3) as u8;
    for (name, shift) in [("left.tif", 0), ("right.tif", 1)] {
        let view = image::GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            image::Luma([texture(x + 40 + shift * (4 + 20 * y / SIZE.1), y)])
        });
        view.save(folder.join(name)).unwrap();
    }
    folder
}

/// A match of that pair in several blocks, to `output`.
fn line(output: &str, more: &str) -> String {
    format!(
        "match left.tif right.tif {output} --max-disparity 31 --method fast --memory 64MiB --device cpu {more}"
    )
}

/// The files of blocks in a folder, with their times.
fn blocks(folder: &Path) -> BTreeMap<OsString, SystemTime> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeMap::new() };
    let entries = entries
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("block-"));
    entries.map(|entry| (entry.file_name(), entry.metadata().unwrap().modified().unwrap())).collect()
}

/// The names in a folder.
fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.collect()
}

/// The bytes of all files whose names begin so, by what follows.
fn files_of(folder: &Path, stem: &str) -> BTreeMap<String, Vec<u8>> {
    let ends = names(folder).into_iter().filter_map(|name| Some((name.strip_prefix(stem)?.to_owned(), name)));
    ends.map(|(end, name)| (end, fs::read(folder.join(name)).unwrap())).collect()
}

#[test]
fn a_pair_larger_than_memory_is_matched_as_with_a_folder() {
    let folder = large_pair();
    let also = "--also raw,confidence,validity,sigma,right";
    let told = run(&folder, &line("a.pfm", &format!("{also} --json a.json"))).succeeded();
    told.says("mrfgs: 1500 x 1100, 32 disparities,  &  blocks,  &  iterations in  &  s on the CPU path");
    let record: Value = serde_json::from_slice(&fs::read(folder.join("a.json")).unwrap()).unwrap();
    let count = record["blocks"].as_u64().unwrap();
    assert!(count > 2, "{record}");
    assert_eq!((&record["width"], &record["height"]), (&1500.into(), &1100.into()));
    assert!(record["density"].as_f64().unwrap() > 99.9, "{record}");
    let left_over = names(&folder).into_iter().find(|name| name.starts_with('.') || name.contains("blocks"));
    assert_eq!(left_over, None);

    // With a folder, and with outputs that need the whole maps.
    run(&folder, &line("b.pfm", &format!("{also} --blocks job"))).succeeded();
    let kept = blocks(&folder.join("job"));
    assert_eq!(kept.len() as u64, count);
    run(&folder, &line("c.pfm", &format!("{also},preview --blocks job"))).succeeded();
    assert_eq!(blocks(&folder.join("job")), kept, "no block is matched twice");
    let of = |stem: &str| {
        let mut files = files_of(&folder, stem);
        files.retain(|end, _| end != "json" && end != "preview.png");
        files
    };
    assert_eq!(of("a.").len(), 6);
    assert!(of("a.") == of("b."));
    let floats = |files: BTreeMap<String, Vec<u8>>| {
        files.into_iter().filter(|(end, _)| end.ends_with("pfm")).collect::<Vec<_>>()
    };
    assert!(floats(of("a.")) == floats(of("c.")));
    for name in ["confidence", "validity"] {
        let [joined, whole] =
            ["a", "c"].map(|stem| read::grey8(&folder.join(format!("{stem}.{name}.png"))).unwrap());
        assert!(joined == whole, "{name}");
    }

    // The slope is found, and so it is with all the memory it takes.
    let map = read::read_disparity(&folder.join("a.pfm")).unwrap();
    let is_off = |x: usize, y: usize| (map[(x, y)] - (4 + 20 * y / SIZE.1 as usize) as f32).abs() > 1.0;
    let off = (0..map.height())
        .flat_map(|y| (100..map.width()).map(move |x| (x, y)))
        .filter(|(x, y)| is_off(*x, *y));
    assert!(off.count() < map.data().len() / 1000);
    run(&folder, &line("w.pfm", "").replace("64MiB", "4GiB")).succeeded();
    let whole = read::read_disparity(&folder.join("w.pfm")).unwrap();
    let moved = map.data().iter().zip(whole.data()).filter(|(a, b)| (**a - **b).abs() > 1.0).count();
    assert!(moved < map.data().len() / 10_000, "{moved}");

    // Printed, and in the other formats, without a map of the right view.
    run(&folder, &line("p.pfm", "--blocks plain")).succeeded();
    let mut printed = program(&folder, &line("-", "--quiet --blocks plain"));
    assert!(printed.output().unwrap().stdout == fs::read(folder.join("p.pfm")).unwrap());
    let map = read::read_disparity(&folder.join("p.pfm")).unwrap();
    for name in ["d.png", "d.tif"] {
        run(&folder, &line(name, "--blocks plain")).succeeded();
        let stored = read::read_disparity(&folder.join(name)).unwrap();
        let alike = stored.data().iter().zip(map.data()).all(|(a, b)| {
            // PNG has no 0.
            a.total_cmp(b).is_eq() || (name == "d.png" && *b == 0.0 && (a * 256.0 - 1.0).abs() < 1e-6)
        });
        assert!(alike, "{name}");
    }
}

#[test]
fn shards_complete_a_match_together() {
    let folder = large_pair();
    run(&folder, &line("whole.tif", "--also validity")).succeeded();
    let first = run(&folder, &line("map.tif", "--also validity --blocks job --shard 1/2")).succeeded();
    first.says(" blocks are complete in job; map.tif is written by the run that completes the last");
    assert!(!folder.join("map.tif").exists());
    let kept = blocks(&folder.join("job"));
    let plan = run(&folder, &line("map.tif", "--also validity --blocks job --dry-run")).succeeded().stdout;
    assert!(plan.contains(&format!("{} of ", kept.len())) && plan.contains(" blocks are complete"), "{plan}");
    run(&folder, &line("map.tif", "--also validity --blocks job --shard 2/2")).succeeded();
    assert!(files_of(&folder, "map.") == files_of(&folder, "whole."));
    let all = blocks(&folder.join("job"));
    assert!(all.len() > kept.len() && kept.iter().all(|(name, time)| all[name] == *time));
}

#[test]
fn runs_share_a_folder_and_go_on_after_a_kill() {
    let folder = large_pair();
    run(&folder, &line("whole.pfm", "")).succeeded();
    let mut killed = started(&folder, &line("map.pfm", "--blocks job --threads 1"));
    let patience = Instant::now();
    while blocks(&folder.join("job")).is_empty() {
        assert!(patience.elapsed() < Duration::from_secs(120), "no block");
        std::thread::sleep(Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(!folder.join("map.pfm").exists());
    let kept = blocks(&folder.join("job"));
    let runs: Vec<_> =
        (0..3).map(|_| started(&folder, &line("map.pfm", "--blocks job --threads 1"))).collect();
    for run in runs {
        Run::of("one of three", run.wait_with_output().unwrap()).succeeded();
    }
    assert!(fs::read(folder.join("map.pfm")).unwrap() == fs::read(folder.join("whole.pfm")).unwrap());
    let all = blocks(&folder.join("job"));
    assert!(all.len() > kept.len() && kept.iter().all(|(name, time)| all[name] == *time));
    let names = names(&folder.join("job"));
    assert_eq!(names.len(), all.len() + 1, "{names:?}");
}

#[test]
fn a_folder_takes_one_match() {
    let folder = large_pair();
    run(&folder, &line("map.pfm", "--blocks job")).succeeded();
    let map = fs::read(folder.join("map.pfm")).unwrap();
    let refused = |code: i32, more: &str, words: &str| {
        run(&folder, &line("other.pfm", &format!("--quiet --blocks job {more}"))).failed(code, words);
        assert!(!folder.join("other.pfm").exists());
    };
    refused(
        2,
        "--set fill=none",
        "job: the folder holds blocks of another match, whose method differs; give another folder",
    );
    refused(2, "--min-disparity -5", "whose disparities differs");
    refused(2, "--roi 1,2,3,4", "cannot be used with");
    fs::copy(folder.join("right.tif"), folder.join("keep.tif")).unwrap();
    fs::copy(folder.join("left.tif"), folder.join("right.tif")).unwrap();
    refused(2, "", "whose images differs");
    fs::rename(folder.join("keep.tif"), folder.join("right.tif")).unwrap();

    // Damage, whatever it is, is named with the remedy; the other blocks stay.
    let (name, _) = blocks(&folder.join("job")).pop_first().unwrap();
    let path = folder.join("job").join(&name);
    let whole = fs::read(&path).unwrap();
    for cut in [0, 40, whole.len() / 2] {
        fs::write(&path, &whole[..cut]).unwrap();
        refused(1, "", "remove it, and run again");
    }
    fs::remove_file(&path).unwrap();
    run(&folder, &line("again.pfm", "--blocks job")).succeeded();
    assert!(fs::read(folder.join("again.pfm")).unwrap() == map);

    fs::write(folder.join("job/match.json"), "{").unwrap();
    refused(1, "", "does not describe a match");
    fs::create_dir(folder.join("mine")).unwrap();
    fs::write(folder.join("mine/letter.txt"), "").unwrap();
    run(&folder, &line("other.pfm", "--blocks mine"))
        .failed(2, "mine: the folder holds other files; give a new one");
    run(&folder, &line("other.pfm", "--shard 1/2")).failed(2, "--blocks");

    // A pipe can be read only once, so the next run could not tell whether its image is the same.
    #[cfg(target_os = "linux")]
    run(&folder, &line("other.pfm", "--blocks new").replace("left.tif", "/dev/null"))
        .failed(1, "/dev/null: is no file");

    // A pair that cannot be matched makes no folder.
    run(&folder, &line("other.pfm", "--blocks new").replace("right.tif", "none.tif")).failed(1, "none.tif");
    run(&folder, &line("other.pfm", "--blocks new").replace("--max-disparity 31", "--max-disparity 5000"))
        .failed(2, "--memory: 64 MiB of memory is too little");
    assert!(!folder.join("new").exists());
}

/// A disk that fills up stops the run with one line, and leaves no part of a block.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_whole_blocks() {
    let folder = large_pair();
    shell(&folder, "ulimit -f 300", &line("map.pfm", "--quiet --blocks job")).failed(1, "job/block-00001: ");
    assert!(!folder.join("map.pfm").exists());
    assert!(blocks(&folder.join("job")).is_empty());
    run(&folder, &line("map.pfm", "--blocks job")).succeeded();
}

/// A dry run reads headers alone, and a region its window alone.
#[test]
fn unread_pixels_do_not_count() {
    let folder = large_pair();
    let whole = fs::read(folder.join("left.tif")).unwrap();
    run(&folder, &line("a.pfm", "--roi 300,200,150,100")).succeeded();
    // The first rows of the file are damaged; the crate `image` writes the directory last.
    let mut damaged = whole.clone();
    damaged[8..60_000].fill(0);
    fs::write(folder.join("left.tif"), &damaged).unwrap();
    run(&folder, &line("b.pfm", "--roi 300,200,150,100")).succeeded();
    assert!(fs::read(folder.join("a.pfm")).unwrap() == fs::read(folder.join("b.pfm")).unwrap());
    let plan = run(&folder, &line("c.pfm", "--dry-run")).succeeded().stdout;
    assert!(
        plan.starts_with("1500 x 1100 pixels in ") && plan.contains("blocks, the largest of which:"),
        "{plan}"
    );
    assert!(!folder.join("c.pfm").exists());
}

/// A match of ten times the memory, in an address space that does not hold it in one piece: 542 MiB beside the images.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_that_of_a_block() {
    let folder = large_pair();
    let one = line("map.pfm", "--threads 1 --quiet").replace("--method fast", "").replace("64MiB", "50MiB");
    let whole = one.replace("50MiB", "4GiB");
    let plan = run(&folder, &format!("{whole} --dry-run")).succeeded().stdout;
    assert!(plan.contains("|         540 MiB"), "{plan}");
    // The program with its stacks and the system's reserves takes 350 MB of it.
    shell(&folder, "ulimit -v 650000", &one).succeeded();
    // Control: a match in one piece does not fit.
    shell(&folder, "ulimit -v 650000", &whole).failed(1, "memory");
}
