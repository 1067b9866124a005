//! Links in the documents lead to existing files and headings.

use std::fs;
use std::path::Path;

const DOCUMENTS: [&str; 11] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "docs/guide.md",
    "docs/paper.md",
    "docs/results.md",
    "python/README.md",
    "testdata/README.md",
];

/// The lines outside code blocks.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    text.split("\n```").step_by(2).flat_map(str::lines)
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|&c| c.is_alphanumeric() || " -_".contains(c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The broken links of a document in the folder `folder`, and the number of its links within the repository.
fn broken(text: &str, folder: &Path) -> (Vec<String>, usize) {
    let links =
        prose(text).flat_map(|line| line.split("](").skip(1)).filter_map(|rest| rest.split(')').next());
    let links: Vec<_> = links.filter(|link| !link.contains("://")).collect();
    let leads = |link: &str| {
        let (file, name) = link.split_once('#').unwrap_or((link, ""));
        let to = folder.join(file);
        let target = if file.is_empty() { Some(text.to_owned()) } else { fs::read_to_string(&to).ok() };
        let mut headings =
            target.iter().flat_map(|target| prose(target)).filter(|line| line.starts_with('#'));
        (file.is_empty() || to.exists())
            && (name.is_empty() || headings.any(|line| anchor(line.trim_start_matches('#')) == name))
    };
    (links.iter().filter(|link| !leads(link)).map(ToString::to_string).collect(), links.len())
}

#[test]
fn links_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut links = 0;
    for name in DOCUMENTS {
        let path = root.join(name);
        let (broken, count) = broken(&fs::read_to_string(&path).unwrap(), path.parent().unwrap());
        assert!(broken.is_empty(), "{name}: {broken:?}");
        links += count;
    }
    assert!(links > 40, "{links} links");
    // Control: broken links are found.
    let text = "# C and C++\n[a](#c-and-c) [b](#c)\n[c](README.md#test) [d](README.md#tests) [e](none.md)\n\
                ```\n[f](#f)\n```\n";
    assert_eq!(broken(text, &root), (["#c", "README.md#tests", "none.md"].map(String::from).into(), 5));
}
