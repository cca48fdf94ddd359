//! Tests and benchmarks that a page names: their files exist and contain the requested names.

use std::path::{Path, PathBuf};

/// Looks up the names in a `cargo test` or `cargo bench` of a page.
pub fn look_up(root: &Path, command: &str) -> Result<(), String> {
    let mut words = command.split(' ').skip_while(|word| *word != "cargo").skip(2);
    let (mut text, mut names) = (String::new(), Vec::new());
    while let Some(word) = words.next() {
        match word {
            "--test" | "--bench" => {
                let name = words.next().unwrap_or_default();
                let folder = if word == "--test" { "tests" } else { "benches" };
                text += &source(root, folder, name).ok_or_else(|| format!("{command}: there is no {name}"))?;
            }
            "--package" => {
                let name = words.next().unwrap_or_default();
                let sources = root.join(name.replacen("bench-dragon-", "crates/", 1)).join("src");
                if !sources.is_dir() {
                    return Err(format!("{command}: there is no {name}"));
                }
                text += &texts(files_below(&sources)).ok_or_else(|| format!("{command}: {name} cannot be read"))?;
            }
            option if option.starts_with('-') => (),
            name => names.push(name),
        }
    }
    let is_there = |name: &&str| name.split("::").all(|part| text.contains(part));
    match names.into_iter().find(|name| !is_there(name)) {
        Some(name) => Err(format!("{command}: no test or benchmark has the name {name}")),
        None => Ok(()),
    }
}

/// Returns the text of a target with the names of its files: the file that `Cargo.toml` states, `name.rs`, or all files
/// below the folder `name`.
fn source(root: &Path, folder: &str, name: &str) -> Option<String> {
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).ok()?;
    let stated =
        manifest.split_once(&format!("name = \"{name}\"\npath = \"")).and_then(|(_, rest)| rest.split('"').next());
    let file = stated.map_or(root.join(folder).join(name).with_extension("rs"), |path| root.join(path));
    let folder = root.join(folder).join(name);
    let files = if folder.is_dir() { files_below(&folder) } else { Vec::from([file]) };
    texts(files)
}

fn texts(files: Vec<PathBuf>) -> Option<String> {
    let text = |file: PathBuf| Some(format!("{}\n{}", file.display(), std::fs::read_to_string(&file).ok()?));
    files.into_iter().map(text).collect()
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_source = |path: &PathBuf| path.is_dir() || path.extension().is_some_and(|extension| extension == "rs");
    let sources = entries.filter(is_source);
    sources.flat_map(|path| if path.is_dir() { files_below(&path) } else { Vec::from([path]) }).collect()
}
