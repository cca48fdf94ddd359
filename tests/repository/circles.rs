//! No files of a crate import each other in a circle, and no crate needs one above it for its tests.
//!
//! A file may use what the file of its own folder defines: `lines.rs` and the files in `lines/` are one room.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use syn::{Item, UseTree};

use super::rooms::{crates, dependencies, listed, sources};

/// The names that lead from the root of a crate to a module or an item in it.
type Names = Vec<String>;

/// The beginnings of a path within a crate.
const KEYWORDS: [&str; 3] = ["crate::", "super::", "self::"];

/// A file of a crate.
#[derive(Default)]
struct Module {
    /// The names that it defines.
    items: BTreeSet<String>,
    /// The names that it imports, `*` for all names of a module, each with its origin.
    imports: Vec<(String, Names)>,
    /// The paths in its code besides imports.
    paths: Vec<Names>,
}

/// The files of a crate by the names of their modules.
struct Modules(BTreeMap<Names, (PathBuf, Module)>);

impl Modules {
    /// Reads all files below a folder.
    fn read(folder: &Path) -> Self {
        let mut modules = BTreeMap::new();
        for file in sources(folder).into_iter().filter(|file| !file.ends_with("tests.rs")) {
            let names = file.strip_prefix(folder).unwrap().with_extension("");
            let names: Names = names.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
            let is_root = matches!(names.join("/").as_str(), "lib" | "main");
            let names = if is_root { Names::new() } else { names };
            let text = std::fs::read_to_string(&file).unwrap();
            let module = module(&names, &text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
            // A program's root has its commands, the library beside it has names of other crates.
            if !is_root || file.ends_with("main.rs") || !modules.contains_key(&names) {
                modules.insert(names, (file, module));
            }
        }
        Self(modules)
    }

    /// Returns the module that defines what a path names.
    fn origin(&self, path: &[String], depth: usize) -> Option<&Names> {
        let (split, (names, (_, module))) =
            (0..=path.len()).rev().find_map(|split| Some((split, self.0.get_key_value(&path[..split])?)))?;
        let Some(name) = path.get(split).filter(|name| depth < 8 && !module.items.contains(*name)) else {
            return Some(names);
        };
        let followed = |origin: &Names, rest: &[String]| self.origin(&[origin, rest].concat(), depth + 1);
        if let Some((_, origin)) = module.imports.iter().find(|(imported, _)| imported == name) {
            return followed(origin, &path[split + 1..]);
        }
        let globs = module.imports.iter().filter(|(imported, _)| imported == "*");
        let mut from_globs = globs.filter_map(|(_, origin)| followed(origin, &path[split..]));
        Some(from_globs.find(|origin| self.0[*origin].1.items.contains(name)).unwrap_or(names))
    }

    /// Returns the modules that a module imports from, without those in whose folder it stands.
    fn imported(&self, names: &Names) -> BTreeSet<&Names> {
        let module = &self.0[names].1;
        let paths = module.imports.iter().map(|(_, origin)| origin).chain(&module.paths);
        paths.filter_map(|path| self.origin(path, 0)).filter(|origin| !names.starts_with(origin)).collect()
    }

    /// Returns the files of each circle.
    fn circles(&self) -> BTreeSet<BTreeSet<&Path>> {
        let imported: HashMap<&Names, _> = self.0.keys().map(|names| (names, self.imported(names))).collect();
        let reached = |from: &Names| {
            let (mut seen, mut next) = (BTreeSet::new(), Vec::from_iter(imported[from].iter().copied()));
            while let Some(names) = next.pop() {
                if seen.insert(names) {
                    next.extend(imported[names].iter().copied());
                }
            }
            seen
        };
        let reached: HashMap<&Names, _> = self.0.keys().map(|names| (names, reached(names))).collect();
        let circle = |names: &Names| {
            let of_circle = reached[names].iter().filter(|other| reached[*other].contains(names));
            of_circle.map(|other| self.0[*other].0.as_path()).collect::<BTreeSet<_>>()
        };
        self.0.keys().map(circle).filter(|files| !files.is_empty()).collect()
    }
}

/// Reads a file without its unit tests.
fn module(names: &Names, text: &str) -> syn::Result<Module> {
    let mut module = Module::default();
    add(names, syn::parse_file(text)?.items, &mut module);
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap().lines();
    let text = code.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let end = |c: char| !(c.is_alphanumeric() || matches!(c, '_' | ':'));
    for path in text.split(end).filter(|path| KEYWORDS.iter().any(|keyword| path.starts_with(keyword))) {
        let path: Names = path.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
        module.paths.extend(absolute(names, &path));
    }
    Ok(module)
}

/// Adds what items define and import.
fn add(names: &Names, items: Vec<Item>, module: &mut Module) {
    for item in items {
        let name = match item {
            Item::Const(item) => item.ident,
            Item::Enum(item) => item.ident,
            Item::Fn(item) => item.sig.ident,
            Item::Static(item) => item.ident,
            Item::Struct(item) => item.ident,
            Item::Trait(item) => item.ident,
            Item::Type(item) => item.ident,
            Item::Union(item) => item.ident,
            Item::Macro(item) if item.ident.is_some() => item.ident.unwrap(),
            Item::Mod(item) if item.content.is_some() => item.ident,
            Item::Use(item) => {
                add_import(names, &mut Names::new(), item.tree, module);
                continue;
            }
            _ => continue,
        };
        module.items.insert(name.to_string());
    }
}

fn add_import(names: &Names, before: &mut Names, tree: UseTree, module: &mut Module) {
    let (name, origin) = match tree {
        UseTree::Path(path) => {
            before.push(path.ident.to_string());
            add_import(names, before, *path.tree, module);
            before.pop();
            return;
        }
        UseTree::Group(group) => {
            group.items.into_iter().for_each(|tree| add_import(names, before, tree, module));
            return;
        }
        UseTree::Name(name) if name.ident == "self" => (before.last().cloned().unwrap_or_default(), before.clone()),
        UseTree::Name(name) => (name.ident.to_string(), [before.as_slice(), &[name.ident.to_string()]].concat()),
        UseTree::Rename(name) => (name.rename.to_string(), [before.as_slice(), &[name.ident.to_string()]].concat()),
        UseTree::Glob(_) => ("*".to_owned(), before.clone()),
    };
    module.imports.extend(absolute(names, &origin).map(|origin| (name, origin)));
}

/// Returns a path from the root of its crate; `None` for a path into another crate.
fn absolute(names: &Names, path: &[String]) -> Option<Names> {
    let (mut base, mut rest) = match path.first()?.as_str() {
        "crate" => (Names::new(), &path[1..]),
        "self" => (names.clone(), &path[1..]),
        "super" => (names.clone(), path),
        // A child, as in `pub use child::Item`.
        _ => (names.clone(), path),
    };
    while rest.first().is_some_and(|name| name == "super") {
        base.pop()?;
        rest = &rest[1..];
    }
    Some([base, rest.to_vec()].concat())
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut folders: Vec<_> = crates().into_iter().map(|name| PathBuf::from(format!("crates/{name}/src"))).collect();
    folders.push(PathBuf::from("src"));
    let mut arrows = 0;
    for folder in folders {
        let modules = Modules::read(&folder);
        arrows += modules.0.keys().map(|names| modules.imported(names).len()).sum::<usize>();
        assert_eq!(modules.circles(), BTreeSet::new());
    }
    assert!(arrows > 500, "{arrows} imports were found");
}

/// Cargo permits a circle through `[dev-dependencies]`, and compiles the crate twice then.
#[test]
fn no_crate_needs_one_above_it_for_its_tests() {
    let mut arrows = 0;
    for name in crates() {
        let (mut needed, mut next) = (BTreeSet::new(), Vec::from_iter(listed(&name, "dev-dependencies")));
        arrows += next.len();
        while let Some(below) = next.pop() {
            next.extend(dependencies(&below).into_iter().filter(|further| !needed.contains(further)));
            needed.insert(below);
        }
        assert!(!needed.contains(&name), "the tests of {name} need a crate that depends on it: {needed:?}");
    }
    assert!(arrows > 5, "{arrows} dev-dependencies were found");
}
