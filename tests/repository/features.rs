//! The features of dependencies: the crates that a subscriber in Rust builds, and tests with the features of the
//! product.

use std::collections::BTreeSet;
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
