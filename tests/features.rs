//! What a subscriber in Rust has to build: without the feature `cli` the library has no web server, no plots and no
//! argument parser.

use std::collections::BTreeSet;
use std::process::Command;

/// The crates that the library needs with these features.
fn crates(features: &[&str]) -> BTreeSet<String> {
    let mut tree = Command::new(env!("CARGO"));
    tree.args(["tree", "--offline", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"]).args(features);
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
    assert!(library.contains("iceoryx2") && library.len() <= 102, "{} crates: {library:?}", library.len());
}
