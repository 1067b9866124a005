//! Links in the documents lead to existing files and headings, the headings of the troubleshooting are messages, and sentences are short.

use std::fs;
use std::path::Path;

/// All documents but the pages of the guide.
const DOCUMENTS: [&str; 10] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "docs/paper.md",
    "docs/results.md",
    "python/README.md",
    "testdata/README.md",
];

/// The pages of the guide.
pub(super) fn guide() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide");
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> = names.map(|name| format!("docs/guide/{name}")).collect();
    pages.sort();
    assert!(pages.len() > 15, "{pages:?}");
    pages
}

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
    for name in DOCUMENTS.map(String::from).into_iter().chain(guide()) {
        let path = root.join(&name);
        let (broken, count) = broken(&fs::read_to_string(&path).unwrap(), path.parent().unwrap());
        assert!(broken.is_empty(), "{name}: {broken:?}");
        links += count;
    }
    assert!(links > 150, "{links} links");
    // Control: broken links are found.
    let text = "# C and C++\n[a](#c-and-c) [b](#c)\n[c](README.md#test) [d](README.md#tests) [e](none.md)\n\
                ```\n[f](#f)\n```\n";
    assert_eq!(broken(text, &root), (["#c", "README.md#tests", "none.md"].map(String::from).into(), 5));
}

/// The most words of a sentence in the README and in the first pages of the guide, and in its other pages.
const MOST_WORDS: [usize; 2] = [25, 35];
const FIRST_PAGES: [&str; 5] =
    ["README.md", "docs/guide/README.md", "docs/guide/phone.md", "docs/guide/rig.md", "docs/guide/robots.md"];

/// The sentences with more than `most` words, outside code, tables and headings. Code in a line counts as one word.
fn long_sentences(text: &str, most: usize) -> Vec<String> {
    // Paragraphs and items of lists.
    let mut parts = vec![String::new()];
    for line in prose(text).map(str::trim) {
        let begins = line.is_empty() || line.starts_with(['#', '|']) || line.starts_with("- ");
        if begins {
            parts.push(String::new());
        }
        if !line.starts_with(['#', '|', '<']) {
            let part = parts.last_mut().unwrap();
            *part += line;
            *part += " ";
        }
    }
    let mut long = Vec::new();
    for part in parts {
        let without_code: Vec<_> =
            part.split('`').enumerate().map(|(i, piece)| if i % 2 == 0 { piece } else { "code" }).collect();
        let mut sentence: Vec<&str> = Vec::new();
        let joined = without_code.concat();
        for word in joined.split_whitespace() {
            sentence.extend(word.contains(char::is_alphanumeric).then_some(word));
            let end = word.trim_end_matches([')', '*', '"']);
            if end.ends_with(['.', '?', '!', ':', ';']) {
                if sentence.len() > most {
                    long.push(sentence.join(" "));
                }
                sentence.clear();
            }
        }
        if sentence.len() > most {
            long.push(sentence.join(" "));
        }
    }
    long
}

#[test]
fn sentences_are_short() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in std::iter::once("README.md".to_owned()).chain(guide()) {
        let most = MOST_WORDS[usize::from(!FIRST_PAGES.contains(&&*name))];
        let long = long_sentences(&fs::read_to_string(root.join(&name)).unwrap(), most);
        assert!(long.is_empty(), "{name}: more than {most} words: {long:#?}");
    }
    // Control: a long sentence is found, and its end.
    let text = "# a b c d e\n\na b c.\na b `c d e f g` d. a b: c d\n- a b c d\n- a b c d\n  e f.\n\n```\na b c d e f\n```\n";
    assert_eq!(long_sentences(text, 4), ["a b c d e f."]);
}

/// The texts of the library and of the program, with N for what they fill in.
fn messages() -> String {
    let mut all = String::new();
    for pattern in ["../src/**/*.rs", "src/**/*.rs"] {
        for path in glob::glob(&format!("{}/{pattern}", env!("CARGO_MANIFEST_DIR"))).unwrap() {
            all += &fs::read_to_string(path.unwrap()).unwrap();
        }
    }
    // A text may go on in the next line of the source.
    let pieces: Vec<&str> = all
        .split("\\\n")
        .enumerate()
        .map(|(i, piece)| if i == 0 { piece } else { piece.trim_start() })
        .collect();
    let mut out = String::new();
    for piece in pieces.concat().split('{') {
        let (filled, rest) = piece.split_once('}').unwrap_or(("", piece));
        let is_field = filled.len() < 60 && !filled.contains(['\n', '"']);
        out += if is_field { "N" } else { filled };
        out += rest;
    }
    out
}

/// The heading of a message as [`messages`] has it: the texts that replace fields become N.
fn as_in_messages(heading: &str) -> String {
    ["the left image is", "upside down", "left"].iter().fold(heading.to_owned(), |text, filled| match *filled
    {
        "left" if text.starts_with("the left view") => text.replacen("left", "N", 1),
        "left" => text,
        filled => text.replacen(filled, "N", 1),
    })
}

#[test]
fn headings_of_the_troubleshooting_are_messages() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/troubleshooting.md");
    let text = fs::read_to_string(path).unwrap();
    let messages = messages();
    let headings: Vec<_> =
        prose(&text).filter_map(|line| line.strip_prefix("### `")?.strip_suffix('`')).collect();
    let others: Vec<_> = headings
        .iter()
        .filter(|heading| !heading.split(": ").all(|part| messages.contains(&as_in_messages(part))))
        .collect();
    assert!(others.is_empty(), "no such message: {others:#?}");
    assert!(headings.len() > 20, "{headings:?}");
    // Control: a text that is no message is found.
    assert!(!messages.contains(&as_in_messages("the left view is all one colours")));
}
