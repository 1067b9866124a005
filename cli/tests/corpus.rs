//! Replays the fuzzing corpus: every file goes through the function that its target runs.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../../fuzz/src/lib.rs"]
#[allow(unreachable_pub, reason = "the library of another crate")]
mod targets;

use std::path::{Path, PathBuf};

/// The function under test.
type Target = fn(&[u8]);

/// Every target, named after its folder.
const TARGETS: [(&str, Target); 9] = [
    ("pfm", targets::pfm),
    ("calib", targets::calib),
    ("cameras", targets::cameras),
    ("image", targets::image),
    ("list", targets::list),
    ("recording", targets::recording),
    ("config", targets::config),
    ("scan", targets::scan),
    ("pose", targets::pose),
];

/// The files of a target's corpus.
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
            // Name the input in case it fails.
            println!("{}", file.display());
            target(&std::fs::read(file).unwrap());
        }
    }
}

/// Control: an error of two lines is noticed.
#[test]
#[should_panic(expected = "second line")]
fn an_error_of_two_lines_is_noticed() {
    targets::told::<()>(Err(mrfgs::Error::Mismatch("the first\nand the second line".into())));
}

/// Replays the corpus with little memory: allocations of the size that the files claim would fail, touched or not.
#[cfg(target_os = "linux")]
mod memory {
    use std::process::{Command, Output};

    /// For the replay, the program and its threads.
    const KIB: u32 = 512 << 10;
    /// Tells the test below that it runs under the limit.
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
    fn every_file_needs_little_memory() {
        let output = limited("every_file_is_read_or_refused");
        assert!(output.status.success(), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stdout).contains("1 passed"), "{output:?}");
    }

    /// Control: a larger allocation fails.
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
