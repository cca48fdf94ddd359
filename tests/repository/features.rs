//! The features of dependencies: the crates that a subscriber in Rust builds, and tests with the features of the
//! product.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

/// Returns the crates that the library needs with these features.
fn crates(features: &[&str]) -> BTreeSet<String> {
    let mut tree = Command::new(env!("CARGO"));
    tree.args(["tree", "--offline", "--package", "bench-dragon", "--edges", "normal,build", "--prefix", "none"]);
    tree.args(["--format", "{p}"]).args(features);
    let output = tree.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    lines.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

#[test]
fn a_library_without_the_command_line_needs_none_of_its_crates() {
    let heavy = ["axum", "tokio", "plotters", "svg", "clap", "indicatif", "env_logger", "ros2-client", "rustdds"];
    let all = crates(&[]);
    assert!(heavy.iter().all(|name| all.contains(*name)), "{all:?}");
    let library = crates(&["--no-default-features"]);
    let found: Vec<_> = heavy.iter().filter(|name| library.contains(**name)).collect();
    assert!(found.is_empty(), "{found:?}");
    assert!(library.contains("iceoryx2") && library.len() <= 75, "{} crates: {library:?}", library.len());
}

/// The lines of `examples/README.md` make a package that needs those crates and no others. `tests/run` compiles them.
#[test]
fn a_subscriber_with_the_printed_manifest_needs_the_crates_of_that_library() {
    let page = include_str!("../../examples/README.md");
    let (_, printed) = page.split_once("```toml\n").unwrap();
    let (dependencies, _) = printed.split_once("```").unwrap();
    let root = env!("CARGO_MANIFEST_DIR");
    assert!(dependencies.contains("\"../bench-dragon\""), "{dependencies}");
    let dependencies = dependencies.replace("../bench-dragon", root);
    let folder = tempfile::tempdir().unwrap();
    let package = "[package]\nname = \"subscriber\"\nedition = \"2024\"\n[workspace]\n";
    // A user's build has the crate of the registry, which this workspace replaces and may not have got.
    let bindgen = format!("[patch.crates-io]\nbindgen = {{ path = \"{root}/crates/bindgen\" }}\n");
    fs::write(folder.path().join("Cargo.toml"), format!("{package}{dependencies}{bindgen}")).unwrap();
    fs::create_dir(folder.path().join("src")).unwrap();
    fs::copy(format!("{root}/examples/subscriber.rs"), folder.path().join("src/main.rs")).unwrap();
    fs::copy(format!("{root}/Cargo.lock"), folder.path().join("Cargo.lock")).unwrap();
    let mut tree = Command::new(env!("CARGO"));
    tree.args(["tree", "--offline", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"]);
    let output = tree.current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let tree = String::from_utf8(output.stdout).unwrap();
    let needed: BTreeSet<_> = tree.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let library = crates(&["--no-default-features"]);
    let library: BTreeSet<_> = library.iter().map(String::as_str).chain(["subscriber"]).collect();
    assert_eq!(needed, library);
}

/// Returns the packages for this machine with the features that a build enables, a line each.
fn features(edges: &str, selection: &[&str]) -> BTreeSet<String> {
    let mut tree = Command::new(env!("CARGO"));
    tree.args(["tree", "--offline", "--edges", edges, "--prefix", "none", "--format", "{p} {f}"]).args(selection);
    let output = tree.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    // A repeated package has a mark.
    lines.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

/// Cargo unites the features that all parts of a build enable. If tests enabled more, they would test another library
/// than users run, and every dependency would be built twice.
#[test]
fn tests_build_dependencies_with_the_features_of_the_product() {
    let product = features("normal,build", &["--package", "bench-dragon"]);
    let tests = features("normal,build,dev", &["--workspace"]);
    assert!(product.len() > 200, "{} packages", product.len());
    let differ: Vec<_> = product.difference(&tests).collect();
    assert!(differ.is_empty(), "tests/run builds these with other features: {differ:#?}");
}
