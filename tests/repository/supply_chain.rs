//! The parts of the program: licences, versions and sources are those that deny.toml allows, and the package contains
//! all that the program needs. The test reads deny.toml itself, so that `cargo deny` and this test cannot differ.

use crate::harness;

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use harness::{Process, copy_program, unique};
use serde_json::Value;
use spdx::{Expression, ParseMode};
use toml::Table;

/// The first of deny.toml's targets: cargo does not have other platforms' crates on every machine.
const TARGET: &str = "x86_64-unknown-linux-gnu";

fn deny() -> Table {
    include_str!("../../deny.toml").parse().unwrap()
}

/// Returns the texts of a list in deny.toml.
fn list(section: &str, field: &str) -> BTreeSet<String> {
    let deny = deny();
    let list = deny[section][field].as_array().unwrap();
    list.iter().map(|text| text.as_str().unwrap().to_owned()).collect()
}

fn cargo(arguments: &[&str]) -> String {
    let mut cargo = Command::new(env!("CARGO"));
    let output = cargo.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_licence_is_one_that_is_allowed() {
    let allowed = list("licenses", "allow");
    assert!(list("graph", "targets").contains(TARGET));
    let text = cargo(&["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", TARGET]);
    let metadata: Value = serde_json::from_str(&text).unwrap();
    // The crates of this platform, including those of the tests: other crates are listed without having been loaded.
    let needed = metadata["resolve"]["nodes"].as_array().unwrap();
    let needed: BTreeSet<&str> = needed.iter().map(|node| node["id"].as_str().unwrap()).collect();
    let packages = metadata["packages"].as_array().unwrap();
    let mut used = BTreeSet::new();
    let mut checked = 0;
    for package in packages.iter().filter(|package| needed.contains(package["id"].as_str().unwrap())) {
        let (name, licence) = (&package["name"], package["license"].as_str());
        let licence = licence.unwrap_or_else(|| panic!("{name} names no licence"));
        // Some crates still write a slash for OR.
        let expression = Expression::parse_mode(licence, ParseMode::LAX).unwrap();
        let is_allowed = |requirement: &spdx::LicenseReq| allowed.contains(&requirement.to_string());
        assert!(expression.evaluate(is_allowed), "{name} is {licence}, expected one of {allowed:?}");
        let named = expression.requirements().map(|requirement| requirement.req.to_string());
        used.extend(named.filter(|name| allowed.contains(name)));
        checked += 1;
    }
    assert!(checked > 200, "{checked} crates");
    assert_eq!(used, allowed, "deny.toml allows a licence that no crate has");
}

#[test]
fn every_crate_comes_from_the_registry_with_its_checksum() {
    let lock: Table = include_str!("../../Cargo.lock").parse().unwrap();
    let registries = list("sources", "allow-registry");
    let packages = lock["package"].as_array().unwrap();
    let text = |package: &toml::Value, field: &str| package.get(field)?.as_str().map(str::to_owned);
    let mut checked = 0;
    // The last of these replace crates of the registry (`[patch.crates-io]`).
    let own = |name: &str| name.starts_with("bench-dragon") || ["bindgen", "netdev"].contains(&name);
    let is_own = |package: &toml::Value| text(package, "name").is_some_and(|name| own(&name));
    for package in packages.iter().filter(|package| !is_own(package)) {
        let source = text(package, "source").unwrap_or_default();
        assert!(registries.contains(source.trim_start_matches("registry+")), "{package}");
        assert!(text(package, "checksum").is_some_and(|checksum| checksum.len() == 64), "{package}");
        checked += 1;
    }
    assert!(checked > 280, "{checked} crates");
}

#[test]
fn no_crate_is_there_twice_but_those_that_are_listed() {
    let tree = ["tree", "--locked", "--offline", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"];
    let tree = cargo(&[&tree[..], &["--target", TARGET]].concat());
    let mut versions: BTreeMap<&str, BTreeSet<Vec<u64>>> = BTreeMap::new();
    for line in tree.lines() {
        let mut words = line.split_whitespace();
        let (Some(name), Some(version)) = (words.next(), words.next()) else { continue };
        let release = version.trim_start_matches('v').split(['+', '-']).next().unwrap();
        let numbers = release.split('.').map(|number| number.parse().unwrap()).collect();
        versions.entry(name).or_default().insert(numbers);
    }
    // All versions of each name except the newest.
    let mut old: BTreeSet<(String, Vec<u64>)> = BTreeSet::new();
    for (name, versions) in versions {
        old.extend(versions.iter().rev().skip(1).map(|version| (name.to_owned(), version.clone())));
    }
    let deny = deny();
    for skip in deny["bans"]["skip"].as_array().unwrap() {
        let listed = skip["crate"].as_str().unwrap();
        let (name, version) = listed.split_once('@').unwrap();
        let begins: Vec<u64> = version.split('.').map(|number| number.parse().unwrap()).collect();
        let before = old.len();
        old.retain(|(other, version)| other != name || !version.starts_with(&begins));
        assert!(old.len() < before, "deny.toml lists {listed}, which no longer exists");
    }
    assert!(old.is_empty(), "not in deny.toml: {old:?}");
}

/// The program as `cargo install` leaves it: one file, started outside the repository.
#[test]
fn the_program_needs_nothing_besides_itself() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("bench-dragon");
    copy_program(&program);
    // A compiled-in path of this repository would be opened at run time; source paths of panics are not opened.
    let name = unique("installed");
    let run = |arguments: &[&str]| {
        let mut command = Command::new(&program);
        command.args(arguments).current_dir("/").env_remove("CARGO_MANIFEST_DIR");
        let output = Process::start(&mut command).output();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(run(&["check"]).contains("223 benches"));
    assert_eq!(run(&["solve", "--at", "0"]).lines().count(), 1 + 224);
    assert!(run(&["run", "--duration", "1", "--name", &name, "--json"]).contains("frames"));
    let mut view = Command::new(&program);
    view.args(["view", "--port", "0", "--name", &name, "--json"]).current_dir("/");
    let mut view = Process::start(&mut view);
    let ready: Value = serde_json::from_str(&view.first_line()).unwrap();
    let page = harness::http_get(ready["url"].as_str().unwrap(), "*/*");
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("stage.js"), "{page}");
}
