//! `scripts/results`: its tables agree with `mrfgs evaluate`, and are in the documents.

#![cfg(unix)]

use std::collections::BTreeSet;
use std::os::unix::fs::PermissionsExt;

use mrfgs::image::{Plane, read};

use super::evaluate::evaluated;
use super::*;

const DOCUMENTS: [&str; 3] = ["README.md", "docs/results.md", "docs/paper.md"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A folder with copies of the script and its documents, and a small pair called Teddy, cropped from a scene.
fn workshop() -> Folder {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    for inner in ["scripts", "docs", "Teddy"] {
        fs::create_dir(at(inner)).unwrap();
    }
    for file in ["scripts/results"].iter().chain(&DOCUMENTS) {
        fs::copy(root().join(file), at(file)).unwrap();
    }
    let (x, y, width, height) = (60, 40, 120, 90);
    for file in ["im0.png", "im1.png"] {
        let view = image::open(scene("thin").join(file)).unwrap();
        view.crop_imm(x, y, width, height).save(at("Teddy").join(file)).unwrap();
    }
    let truth = read::read_disparity(&scene("thin/disp0GT.pfm")).unwrap();
    let part =
        Plane::from_fn(width as usize, height as usize, |i, j| truth[(i + x as usize, j + y as usize)]);
    part.save(at("Teddy/disp0GT.pfm")).unwrap();
    fs::write(at("Teddy/calib.txt"), "ndisp=32\n").unwrap();
    folder
}

/// Runs the copied script with this program. Returns whether it succeeded, and its output followed by its errors.
fn results(folder: &Path, program: &Path, args: &str) -> (bool, String) {
    let ran = Command::new("python3")
        .arg("scripts/results")
        .args(args.split(' '))
        .current_dir(folder)
        .env("MRFGS", program)
        .output()
        .expect("these tests need Python 3");
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let (out, complaint) = (text(ran.stdout), text(ran.stderr));
    (ran.status.success(), if ran.status.success() { out } else { out + &complaint })
}

fn printed(folder: &Path, args: &str) -> String {
    let (succeeded, text) = results(folder, Path::new(env!("CARGO_BIN_EXE_mrfgs")), args);
    assert!(succeeded, "{args}: {text}");
    text
}

/// The cells of the row that starts with `name`.
fn row<'a>(table: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!("| {name} |");
    let line = table.lines().find(|line| line.starts_with(&start));
    let line = line.unwrap_or_else(|| panic!("no row {name} in:\n{table}"));
    line.trim_matches('|').split('|').map(str::trim).collect()
}

/// The figures of `mrfgs evaluate` for the pair, with these decimals: of the raw or the final map, by keys.
fn figures(folder: &Path, flags: &str, map: &str, keys: &[(&str, usize)]) -> Vec<String> {
    let found = evaluated(folder, &format!("Teddy --json - {flags}")).json();
    let all = &found["mean"][map]["all"];
    keys.iter().map(|&(key, decimals)| format!("{:.decimals$}", all[key].as_f64().unwrap())).collect()
}

#[test]
fn every_table_is_in_a_document() {
    let folder = workshop();
    let listed = printed(&folder, "--list");
    let listed: BTreeSet<_> = listed.lines().map(|line| line.split(' ').next().unwrap()).collect();
    let texts = DOCUMENTS.map(|file| fs::read_to_string(root().join(file)).unwrap());
    let marked: BTreeSet<_> = texts
        .iter()
        .flat_map(|text| text.split("<!-- scripts/results ").skip(1))
        .map(|rest| rest.split_once(" -->\n\n|").or(rest.split_once(" -->\n\nMilli")).expect("a table").0)
        .collect();
    assert_eq!(listed, marked);
}

#[test]
fn rows_agree_with_evaluate() {
    let folder = workshop();
    let parts = printed(&folder, "ablations Teddy");
    let keys = [("avg", 3), ("bad0.5", 2), ("bad2.0", 2)];
    let unchanged = row(&parts, "**`default`**");
    assert_eq!(unchanged[2..5], figures(&folder, "", "final", &keys));
    assert_eq!(unchanged[5..], ["+0.0"]);
    let changed = row(&parts, "no sub-pixel");
    assert_eq!(changed[1], "`sub-pixel=false`");
    assert_eq!(changed[2..5], figures(&folder, "--set sub-pixel=false", "final", &keys));
    assert_ne!(changed[2..5], unchanged[2..5]);

    let readings = printed(&folder, "readings Teddy");
    for (name, flags) in [("**`paper`**", ""), ("all labels", "--set zone-sigmas=0")] {
        let flags = format!("--method paper {flags}");
        let keys = [("avg", 2), ("psnr", 2), ("bad2.0", 2)];
        let expected = ["raw", "final"].map(|map| figures(&folder, &flags, map, &keys)).concat();
        assert_eq!(row(&readings, name)[2..], expected, "{name}");
    }
}

#[test]
fn the_papers_figures_are_shown_beside_ours() {
    let folder = workshop();
    let text = printed(&folder, "paper-raw paper-gains Teddy");
    let keys = [("avg", 2), ("psnr", 2), ("bad2.0", 2)];
    let [fgs, paper] = ["fgs", "paper"].map(|preset| {
        let found = figures(&folder, &format!("--method {preset}"), "raw", &keys);
        found.join(" / ")
    });
    let expected = ["Teddy", "2.60 / 32.02 / 14.17", &fgs, "2.09 / 32.43 / 13.90", &paper];
    assert_eq!(row(&text, "Teddy"), expected);
    assert!(text.contains(" of 6 figures. The paper prints it ahead in 6.\n"), "{text}");
}

#[test]
fn only_the_named_table_is_replaced() {
    let folder = workshop();
    let before = DOCUMENTS.map(|file| fs::read_to_string(folder.join(file)).unwrap());
    let text = printed(&folder, "--write accuracy Teddy");
    let table = text.strip_prefix("accuracy\n\n").unwrap().trim_end();
    for (file, before) in DOCUMENTS.iter().zip(before) {
        let after = fs::read_to_string(folder.join(file)).unwrap();
        let marks = ("<!-- scripts/results accuracy -->\n\n", "\n\n<!-- end -->");
        let Some((head, rest)) = before.split_once(marks.0) else {
            assert_eq!(after, before, "{file}");
            continue;
        };
        let (_, tail) = rest.split_once(marks.1).unwrap();
        assert_eq!(after, [head, marks.0, table, marks.1, tail].concat(), "{file}");
        assert_ne!(after, before, "{file}");
    }
}

#[test]
fn invalid_arguments_are_refused() {
    let folder = workshop();
    let program = Path::new(env!("CARGO_BIN_EXE_mrfgs"));
    for (args, words) in [
        ("accurate Teddy", "accurate: neither a table nor a folder"),
        ("accuracy", "give folders with pairs"),
        ("accuracy docs", "give folders with pairs"),
    ] {
        let (succeeded, text) = results(&folder, program, args);
        assert!(!succeeded && text.contains(words), "{args}: {text}");
    }
    // A program that ignores --set.
    let deaf = folder.join("deaf");
    let script = format!(
        "#!/bin/sh\nfor word; do shift; [ \"$word\" = --set ] && skip=1 && continue\n\
         [ \"$skip\" ] && skip= && continue\nset -- \"$@\" \"$word\"; done\nexec {} \"$@\"\n",
        program.display()
    );
    fs::write(&deaf, script).unwrap();
    fs::set_permissions(&deaf, fs::Permissions::from_mode(0o755)).unwrap();
    let (succeeded, text) = results(&folder, &deaf, "ablations Teddy");
    assert!(!succeeded && text.contains("level-rows=false: it is the same method as default"), "{text}");
    // A program that fails.
    let (succeeded, text) = results(&folder, Path::new("false"), "accuracy Teddy");
    assert!(!succeeded && text.contains("false ended with 1"), "{text}");
}
