//! No room imports upward: the order of the rooms is the table of ARCHITECTURE.md.

use std::path::{Path, PathBuf};

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .flat_map(|path| {
            if path.is_dir() {
                sources(&path)
            } else {
                Vec::from_iter((path.extension().is_some_and(|ext| ext == "rs")).then_some(path))
            }
        })
        .collect()
}

#[test]
fn no_room_imports_upward() {
    let architecture = include_str!("../ARCHITECTURE.md");
    let rows = architecture.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    let rooms: Vec<&str> = rows.map(|(room, _)| room).collect();
    assert!(rooms.len() >= 12, "{rooms:?}");
    let rank = |room: &str| rooms.iter().position(|other| *other == room);
    let mut imports = 0;
    for file in sources(Path::new("src")) {
        let within = file.strip_prefix("src").unwrap().with_extension("");
        let room = within.iter().next().unwrap().to_str().unwrap().to_owned();
        let Some(own) = rank(&room) else {
            assert!(["lib", "main"].contains(&room.as_str()), "{} is in no room of ARCHITECTURE.md", file.display());
            continue;
        };
        for line in std::fs::read_to_string(&file).unwrap().lines() {
            // Comments may point anywhere.
            let code = line.split("//").next().unwrap_or_default();
            for start in ["crate::", "bench_dragon::"] {
                for used in code.split(start).skip(1) {
                    let used: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                    if let Some(other) = rank(&used) {
                        imports += 1;
                        assert!(other <= own, "{}: {room} uses {used}: {line}", file.display());
                    }
                }
            }
        }
    }
    assert!(imports > 100, "{imports} imports seen");
}

/// The checker of certificates shares nothing with the search that writes them, nor with anything else.
#[test]
fn the_checker_stands_alone() {
    let mut files = sources(Path::new("src/proof"));
    files.push("src/proof.rs".into());
    assert!(files.len() > 10, "{files:?}");
    for file in files {
        for line in std::fs::read_to_string(&file).unwrap().lines() {
            for start in ["crate::", "bench_dragon::", "super::super::super::super"] {
                let other = line.split(start).skip(1).find(|used| !used.starts_with("proof::"));
                assert!(other.is_none(), "{}: {line}", file.display());
            }
        }
    }
}
