//! The layers that ARCHITECTURE.md states: no file imports from a higher layer, and imports form no cycle,
//! direct or indirect.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The path of a module: `["backend", "cpu"]`.
type Module = Vec<String>;

/// The files of a crate, by module, without comments, strings and unit tests.
struct Crate {
    files: BTreeMap<Module, String>,
    /// Re-exports of modules: the name that users see, and where it comes from.
    exports: BTreeMap<(Module, String), Vec<String>>,
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            all.push(path);
        }
    }
    all
}

/// The code of a file up to its unit tests, without comments and strings.
fn code_of(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    let mut code = String::new();
    for line in lines {
        // Every second piece is inside quotation marks.
        code.extend(line.split('"').step_by(2));
        code.push('\n');
    }
    code
}

impl Crate {
    fn new(sources: impl IntoIterator<Item = (Module, String)>) -> Self {
        let files: BTreeMap<_, _> =
            sources.into_iter().map(|(module, text)| (module, code_of(&text))).collect();
        let mut exports = BTreeMap::new();
        for (module, code) in &files {
            // An exported macro belongs to the root, wherever it is defined.
            for macro_rules in code.split("#[macro_export]\nmacro_rules! ").skip(1) {
                let path = ["crate".to_owned()].into_iter().chain(module.iter().cloned());
                let name = macro_rules.split_whitespace().next().unwrap().to_owned();
                exports.insert((Vec::new(), name.clone()), path.chain([name]).collect());
            }
            for (start, _) in code.match_indices("use ") {
                if is_passed_on(code, start) {
                    for path in paths(&code[start + 4..]) {
                        let name = path.last().unwrap().clone();
                        exports.insert((module.clone(), name), path);
                    }
                }
            }
        }
        Self { files, exports }
    }

    fn read(folder: &Path) -> Self {
        Self::new(rust_files(folder).into_iter().map(|path| {
            let relative = path.strip_prefix(folder).unwrap().with_extension("");
            let mut module: Module =
                relative.iter().map(|part| part.to_str().unwrap().trim_start_matches("r#").into()).collect();
            if ["mod", "lib", "main"].contains(&module.last().unwrap().as_str()) {
                let last = module.pop().unwrap();
                module.extend((last == "main").then(|| "main".to_owned()));
            }
            (module, std::fs::read_to_string(path).unwrap())
        }))
    }

    /// The file that `path`, as written in `module`, leads to; `None` where it leads out of the crate.
    fn file_of(&self, module: &Module, path: &[String]) -> Option<Module> {
        let mut at = module.clone();
        let mut rest = path;
        match path[0].as_str() {
            "crate" => at.clear(),
            "super" => {
                at.pop();
            }
            "self" => {}
            first => {
                at.push(first.to_owned());
                if !self.files.contains_key(&at) {
                    return None;
                }
            }
        }
        rest = &rest[1..];
        while let Some(next) = rest.first() {
            let mut inner = at.clone();
            inner.push(next.clone());
            if next == "super" {
                at.pop();
            } else if self.files.contains_key(&inner) {
                at = inner;
            } else if let Some(export) = self.exports.get(&(at.clone(), next.clone())) {
                return self.file_of(&at, export).or(Some(at));
            } else {
                break;
            }
            rest = &rest[1..];
        }
        Some(at)
    }

    /// The files that each file imports from.
    fn imports(&self) -> BTreeMap<Module, BTreeSet<Module>> {
        let mut imports = BTreeMap::new();
        for (module, code) in &self.files {
            let mut all = BTreeSet::new();
            for start in ["crate::", "super::"] {
                for (at, _) in code.match_indices(start) {
                    let before = code[..at].chars().next_back();
                    let in_use = code[..at].ends_with("use ");
                    if in_use || before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                        continue;
                    }
                    for path in paths(&code[at..]) {
                        all.extend(self.file_of(module, &path).filter(|to| to != module));
                    }
                }
            }
            for (at, _) in code.match_indices("use ") {
                for path in paths(&code[at + 4..]) {
                    // A mere re-export is not an import.
                    let name = path.last().unwrap();
                    let uses =
                        code.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| word == name);
                    if is_passed_on(code, at) && uses.count() < 2 {
                        continue;
                    }
                    all.extend(self.file_of(module, &path).filter(|to| to != module));
                }
            }
            imports.insert(module.clone(), all);
        }
        imports
    }
}

/// Whether the `use` at `start` only re-exports names, and imports none for its own module.
fn is_passed_on(code: &str, start: usize) -> bool {
    let before = code[..start].trim_end_matches(' ');
    before.ends_with("pub") || before.ends_with(')')
}

/// The paths at the start of `code`: one, or all those in its braces.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut path: Vec<String> = Vec::new();
    let mut rest = code.trim_start();
    loop {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_' && c != '#').unwrap_or(rest.len());
        if end > 0 {
            path.push(rest[..end].trim_start_matches("r#").to_owned());
            rest = &rest[end..];
        }
        let Some(next) = rest.strip_prefix("::") else { break };
        rest = next;
        if let Some(list) = rest.strip_prefix('{') {
            let mut all = Vec::new();
            for part in parts(list) {
                for inner in paths(part) {
                    let inner = inner.into_iter().filter(|name| name != "self");
                    all.push(path.iter().cloned().chain(inner).collect());
                }
            }
            return all;
        }
        if end == 0 && rest.is_empty() {
            break;
        }
    }
    if path.is_empty() { Vec::new() } else { vec![path] }
}

/// The items of a comma-separated list, up to its closing brace.
fn parts(list: &str) -> Vec<&str> {
    let (mut depth, mut start, mut all) = (0, 0, Vec::new());
    for (i, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                all.push(&list[start..i]);
                start = i + 1;
                if c == '}' {
                    return all;
                }
            }
            _ => {}
        }
    }
    all
}

/// A cycle of imports, if there is any.
fn circle(imports: &BTreeMap<Module, BTreeSet<Module>>) -> Option<Vec<Module>> {
    fn visit(
        at: &Module,
        imports: &BTreeMap<Module, BTreeSet<Module>>,
        way: &mut Vec<Module>,
        done: &mut BTreeSet<Module>,
    ) -> Option<Vec<Module>> {
        if let Some(start) = way.iter().position(|module| module == at) {
            return Some(way[start..].to_vec());
        }
        if !done.insert(at.clone()) {
            return None;
        }
        way.push(at.clone());
        let found = imports[at].iter().find_map(|to| visit(to, imports, way, done));
        way.pop();
        found
    }
    let mut done = BTreeSet::new();
    imports.keys().find_map(|module| visit(module, imports, &mut Vec::new(), &mut done))
}

/// The layers under a heading of ARCHITECTURE.md, highest first: the words before two spaces in each line of
/// its first block.
fn layers(heading: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let section = text.split(&format!("## {heading}\n")).nth(1).expect("the heading");
    let block = section.split("```").nth(1).expect("a block");
    let lines = block.lines().skip(1);
    lines.map(|line| line.split("  ").next().unwrap().split(", ").map(str::to_owned).collect()).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The first import from a higher layer, or a module that belongs to no layer.
fn upward(imports: &BTreeMap<Module, BTreeSet<Module>>, layers: &[Vec<String>]) -> Option<String> {
    let layer = |module: &Module| {
        let name = module.first()?;
        Some(layers.iter().position(|names| names.contains(name)).ok_or(format!("no layer has {name}")))
    };
    for (from, to) in imports.iter().flat_map(|(from, all)| all.iter().map(move |to| (from, to))) {
        match (layer(from), layer(to)) {
            (Some(Err(unknown)), _) | (_, Some(Err(unknown))) => return Some(unknown),
            (Some(Ok(here)), Some(Ok(there))) if there < here => {
                return Some(format!("{} imports from {}", from.join("::"), to.join("::")));
            }
            // The root of the crate is above everything.
            (Some(_), None) => return Some(format!("{} imports from the root", from.join("::"))),
            _ => {}
        }
    }
    None
}

#[test]
fn imports_lead_down() {
    for (folder, heading) in [("src", "The library"), ("cli/src", "The program")] {
        let imports = Crate::read(&root().join(folder)).imports();
        assert!(imports.len() > 20 && imports.values().map(BTreeSet::len).sum::<usize>() > 60, "{folder}");
        assert_eq!(circle(&imports), None, "{folder}: a circle");
        assert_eq!(upward(&imports, &layers(heading)), None, "{folder}");
    }
}

/// Controls: violations are found.
#[test]
fn circles_and_upward_imports_are_found() {
    let of = |files: &[(&str, &str)]| {
        let files = files
            .iter()
            .map(|(name, text)| (name.split("::").map(str::to_owned).collect(), (*text).to_owned()));
        Crate::new(files).imports()
    };
    let layers = [vec!["high".to_owned()], vec!["low".to_owned()]];
    let good = of(&[
        ("high", "use crate::low::{A, b::{C, D}};"),
        ("low", "fn a() {}"),
        ("low::b", "// crate::high"),
    ]);
    assert_eq!((circle(&good), upward(&good, &layers)), (None, None));
    assert_eq!(good[&vec!["high".to_owned()]].len(), 2);
    let up = of(&[("high", ""), ("low", "fn a() -> crate::high::A {}")]);
    assert_eq!(upward(&up, &layers).unwrap(), "low imports from high");
    let round =
        of(&[("low", "pub use b::B;"), ("low::a", "use super::b::B;"), ("low::b", "use super::a::A;")]);
    assert_eq!(circle(&round).unwrap().len(), 2);
    // A re-exported item belongs to the file that defines it.
    let passed = of(&[("low", "pub use b::B;"), ("low::b", "struct B;"), ("high", "use crate::low::B;")]);
    assert!(passed[&vec!["high".to_owned()]].contains(&vec!["low".to_owned(), "b".to_owned()]));
    assert!(upward(&of(&[("other", "use crate::low::A;"), ("low", "")]), &layers).unwrap().contains("other"));
}
