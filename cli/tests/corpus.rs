//! Replays the corpus of the fuzz targets: every file through the function that its target runs.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../../fuzz/src/lib.rs"]
#[allow(unreachable_pub, reason = "the library of another crate")]
mod targets;

use std::path::{Path, PathBuf};

/// What a target does with an input.
type Target = fn(&[u8]);

/// Every target with its name, which is that of its folder.
const TARGETS: [(&str, Target); 7] = [
    ("pfm", targets::pfm),
    ("calib", targets::calib),
    ("cameras", targets::cameras),
    ("image", targets::image),
    ("list", targets::list),
    ("recording", targets::recording),
    ("config", targets::config),
];

/// The files of a target.
fn corpus(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    glob::glob(folder.join("*").to_str().unwrap()).unwrap().map(Result::unwrap).collect()
}

#[test]
fn every_file_is_read_or_refused() {
    for (name, target) in TARGETS {
        let files = corpus(name);
        assert!(files.len() >= 5, "{name} has {} files", files.len());
        for file in files {
            // What fails names the input.
            println!("{}", file.display());
            target(&std::fs::read(file).unwrap());
        }
    }
}

/// Control: a refusal that fills a screen is noticed.
#[test]
#[should_panic(expected = "second line")]
fn a_refusal_of_two_lines_is_noticed() {
    targets::told::<()>(Err(mrfgs::Error::Mismatch("the first\nand the second line".into())));
}

/// All of it within a fraction of what the files claim: no allocation larger than that can be had, touched or not.
#[cfg(target_os = "linux")]
mod memory {
    use std::process::{Command, Output};

    /// For the replay beside the program itself and its threads.
    const KIB: u32 = 512 << 10;
    /// Says to the test below that it runs under the limit.
    const LIMITED: &str = "MRFGS_TEST_LIMITED";

    fn limited(test: &str) -> Output {
        Command::new("sh")
            .args(["-c", &format!("ulimit -v {KIB} && exec \"$0\" \"$@\"")])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", test, "--test-threads=1"])
            .env(LIMITED, "1")
            .output()
            .unwrap()
    }

    #[test]
    fn every_file_is_content_with_little() {
        let output = limited("every_file_is_read_or_refused");
        assert!(output.status.success(), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stdout).contains("1 passed"), "{output:?}");
    }

    /// Control: more cannot be had.
    #[test]
    fn the_limit_holds() {
        if std::env::var_os(LIMITED).is_some() {
            let bytes = vec![1_u8; (KIB as usize) << 10];
            assert!(std::hint::black_box(bytes).iter().all(|byte| *byte == 1));
            return;
        }
        let output = limited("memory::the_limit_holds");
        assert!(!output.status.success(), "{output:?}");
    }
}
