//! The layers in ARCHITECTURE.md: no file imports from a higher layer, and no package has cyclic imports.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use proc_macro2::{Ident, TokenStream, TokenTree};
use quote::ToTokens;
use syn::ext::IdentExt;
use syn::{Item, ItemMacro, ItemMod, ItemUse, UseTree, Visibility, parse_quote};

const NONE: [&str; 0] = [];

/// The path of a module or an item: `["backend", "cpu"]`.
type Names = Vec<String>;
/// Pairs of an importing file and the file that it imports from.
type Imports = BTreeSet<(Names, Names)>;

/// A package without its unit tests.
#[derive(Default)]
struct Package {
    /// Each module, and the file that contains it.
    modules: BTreeMap<Names, Names>,
    /// Names defined by `use` and exported macros, by full path: the defining module, and the path meant.
    added: BTreeMap<Names, (Names, Names)>,
    /// The paths in the code of each module, except re-exports.
    paths: BTreeSet<(Names, Names)>,
}

impl Package {
    fn read(folder: &Path) -> Self {
        let mut package = Self::default();
        for path in glob::glob(folder.join("**/*.rs").to_str().unwrap()).unwrap().map(Result::unwrap) {
            let inside = path.strip_prefix(folder).unwrap().with_extension("");
            let mut module: Names = inside.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
            module.pop_if(|last| ["mod", "lib"].contains(&last.as_str()));
            package.add_file(&module, &std::fs::read_to_string(path).unwrap());
        }
        package
    }

    fn add_file(&mut self, module: &Names, text: &str) {
        self.add(module, module, syn::parse_file(text).unwrap().items);
    }

    fn add(&mut self, file: &Names, module: &Names, items: Vec<Item>) {
        self.modules.insert(module.clone(), file.clone());
        for item in items {
            match item {
                Item::Mod(item) if item.attrs.contains(&parse_quote!(#[cfg(test)])) => {}
                Item::Mod(ItemMod { ident, content: Some((_, items)), .. }) => {
                    self.add(file, &below(module, &ident), items);
                }
                Item::Use(item) => self.add_use(module, &item, &item.tree, &[]),
                item => {
                    // An exported macro belongs to the root, wherever it is defined.
                    if let Item::Macro(ItemMacro { ident: Some(name), attrs, .. }) = &item
                        && attrs.contains(&parse_quote!(#[macro_export]))
                    {
                        let path = [&["crate".to_owned()], module.as_slice(), &[name.to_string()]].concat();
                        self.added.insert(vec![name.to_string()], (Names::new(), path));
                    }
                    self.add_paths(module, item.to_token_stream());
                }
            }
        }
    }

    fn add_use(&mut self, module: &Names, item: &ItemUse, tree: &UseTree, before: &[String]) {
        let (path, name) = match tree {
            UseTree::Path(path) => {
                return self.add_use(module, item, &path.tree, &below(before, &path.ident));
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.add_use(module, item, tree, before));
            }
            UseTree::Name(name) if name.ident == "self" => (before.to_vec(), before.last().cloned()),
            UseTree::Name(name) => (below(before, &name.ident), Some(name.ident.unraw().to_string())),
            UseTree::Rename(name) => (below(before, &name.ident), Some(name.rename.unraw().to_string())),
            UseTree::Glob(_) => ([before, &["*".to_owned()]].concat(), None),
        };
        if matches!(item.vis, Visibility::Inherited) {
            self.paths.insert((module.clone(), path.clone()));
        }
        self.added.extend(name.map(|name| ([module, &[name][..]].concat(), (module.clone(), path))));
    }

    /// Adds all paths in `tokens`, also those in macro arguments.
    fn add_paths(&mut self, module: &Names, tokens: TokenStream) {
        let (mut path, mut colons) = (Names::new(), 0);
        for token in tokens {
            match token {
                TokenTree::Punct(mark) if mark.as_char() == ':' => {
                    colons += 1;
                    continue;
                }
                TokenTree::Ident(name) if colons == 2 => path.push(name.unraw().to_string()),
                TokenTree::Ident(name) => {
                    let whole = std::mem::replace(&mut path, below(&[], &name));
                    self.paths.insert((module.clone(), whole));
                }
                TokenTree::Group(group) => self.add_paths(module, group.stream()),
                _ => {}
            }
            colons = 0;
        }
        self.paths.insert((module.clone(), path));
    }

    /// The module of the package that defines `path` as seen from the module `at`.
    fn definer(&self, at: &Names, path: &[String]) -> Option<Names> {
        let (mut at, mut inside) = (at.clone(), ["crate", "super", "self"].contains(&path.first()?.as_str()));
        for (i, name) in path.iter().enumerate() {
            let full = [at.as_slice(), std::slice::from_ref(name)].concat();
            match name.as_str() {
                "crate" => at.clear(),
                "super" => at.truncate(at.len().checked_sub(1)?),
                "self" => {}
                // A single name is no module, since a variable may have the same name.
                _ if path.len() > 1 && self.modules.contains_key(&full) => (at, inside) = (full, true),
                _ => {
                    let added = self.added.get(&full).filter(|(_, path)| path[0] != *name);
                    let known =
                        added.and_then(|(at, known)| self.definer(at, &[known, &path[i + 1..]].concat()));
                    return known.or(inside.then_some(at));
                }
            }
        }
        // The path of `pub(crate)` names no item.
        Some(at).filter(|_| path.len() > 1)
    }

    fn imports(&self) -> Imports {
        let file = |module: &Names| self.modules[module].clone();
        let all = self.paths.iter().filter_map(|(at, path)| Some((file(at), file(&self.definer(at, path)?))));
        all.filter(|(from, to)| from != to).collect()
    }
}

fn below(module: &[String], name: &Ident) -> Names {
    [module, &[name.unraw().to_string()]].concat()
}

/// The imports on a cycle or on a path between cycles.
fn circles(imports: &Imports) -> Vec<String> {
    let mut left = imports.clone();
    loop {
        let (from, to): (BTreeSet<_>, BTreeSet<_>) = left.iter().cloned().unzip();
        let count = left.len();
        left.retain(|arrow| to.contains(&arrow.0) && from.contains(&arrow.1));
        if left.len() == count {
            return left.iter().map(shown).collect();
        }
    }
}

/// The imports from a higher layer. The crate root is above all layers.
fn upward(imports: &Imports, layers: &[Vec<String>]) -> Vec<String> {
    let layer = |module: &Names| {
        let name = module.first()?;
        let layer = layers.iter().position(|names| names.contains(name));
        Some(layer.unwrap_or_else(|| panic!("no layer has {name}")))
    };
    imports.iter().filter(|(from, to)| layer(to) < layer(from)).map(shown).collect()
}

fn shown((from, to): &(Names, Names)) -> String {
    format!("{} -> {}", from.join("::"), to.join("::"))
}

/// The layers under a heading of ARCHITECTURE.md, highest first: the names before two spaces in each line.
fn layers(heading: &str) -> Vec<Vec<String>> {
    let section =
        include_str!("../ARCHITECTURE.md").split(&format!("## {heading}\n")).nth(1).expect("the heading");
    let lines = section.split("```").nth(1).expect("a block").lines().skip(1);
    lines.map(|line| line.split("  ").next().unwrap().split(", ").map(str::to_owned).collect()).collect()
}

#[test]
fn imports_lead_down() {
    for (folder, least, heading) in [
        ("src", 500, Some("The library")),
        ("cli/src", 150, Some("The program")),
        ("capi/src", 10, None),
        ("python/src", 20, None),
        ("ros/src", 15, None),
        ("web/src", 5, None),
    ] {
        let imports = Package::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).imports();
        assert!(imports.len() > least, "{folder}: {} imports", imports.len());
        assert_eq!(circles(&imports), NONE, "{folder}");
        assert_eq!(heading.map_or(vec![], |heading| upward(&imports, &layers(heading))), NONE, "{folder}");
    }
}

/// Controls: violations in a made-up package, with one file for each module, are detected.
#[test]
fn circles_and_upward_imports_are_found() {
    let layers = [vec!["high".to_owned()], vec!["low".to_owned()]];
    for (text, expected, ups, rounds) in [
        // All ways to name an item. A re-exported item belongs to the file that defines it.
        ("mod high { use crate::low::{A, B as C}; } mod low {}", "high -> low", 0, 0),
        ("mod high { fn f(a: &[crate::low::A]) {} } mod low {}", "high -> low", 0, 0),
        ("mod high { fn f() { say!(1, crate::low::a()) } } mod low {}", "high -> low", 0, 0),
        (
            "mod high { use crate::low; fn f() { low::b::a() } } mod low { mod b {} }",
            "high -> low, high -> low::b",
            0,
            0,
        ),
        ("mod high { use crate::low::B; } mod low { pub use b::B; mod b {} }", "high -> low::b", 0, 0),
        ("mod high { mod inner { use super::super::low::A; } } mod low {}", "high -> low", 0, 0),
        ("mod high { #[cfg(test)] mod tests { use crate::low::A; } } mod low { // crate::high\n }", "", 0, 0),
        ("mod high {} mod low { fn a() -> crate::high::A {} }", "low -> high", 1, 0),
        (
            "mod high { #[macro_export] macro_rules! a { () => {} } } mod low { crate::a!(); }",
            "low -> high",
            1,
            0,
        ),
        ("mod high {} mod low { use crate::A; }", "low -> ", 1, 0),
        (
            "mod low { pub use b::B; mod a { use super::b::B; } mod b { use super::a::A; } }",
            "low::a -> low::b, low::b -> low::a",
            0,
            2,
        ),
        (
            "mod low { pub use b::B; struct A(B); mod b { use super::*; } }",
            "low -> low::b, low::b -> low",
            0,
            2,
        ),
    ] {
        let mut package = Package::default();
        package.add_file(&Names::new(), text);
        for (module, file) in &mut package.modules {
            *file = module.iter().take_while(|name| *name != "inner").cloned().collect();
        }
        let imports = package.imports();
        assert_eq!(imports.iter().map(shown).collect::<Vec<_>>().join(", "), expected, "{text}");
        assert_eq!([upward(&imports, &layers).len(), circles(&imports).len()], [ups, rounds], "{text}");
    }
}

#[test]
#[should_panic(expected = "no layer has other")]
fn every_module_has_a_layer() {
    upward(&[(vec!["other".to_owned()], vec!["low".to_owned()])].into(), &[vec!["low".to_owned()]]);
}
