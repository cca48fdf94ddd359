//! The needs of a test on this machine, and the number of cases that are requested. In: the environment that `tests/run`
//! sets. Out: a test that runs, or a line that says why it does not.

use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{python, text};

fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| value == "1")
}

/// Returns true if tests that take minutes are requested.
pub fn long() -> bool {
    is_set("BENCH_DRAGON_LONG")
}

/// Returns true if all random cases are requested, as by `tests/run --all`.
pub fn all() -> bool {
    is_set("BENCH_DRAGON_ALL") || long()
}

/// Returns the first value, the second if [`all`] cases are requested, the last for [`long`] tests.
pub fn cases<T>(few: T, of_all: T, of_long: T) -> T {
    match () {
        () if long() => of_long,
        () if all() => of_all,
        () => few,
    }
}

/// Prints a line that is visible even if the test passes: libtest captures `println!` and `eprintln!` only.
pub fn aloud(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}

/// Reports that the current test, or a part of it, does not run. If every test must run (`BENCH_DRAGON_REQUIRE_ALL=1`,
/// which `tests/run` sets), that is a failure.
pub fn not_run(why: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    aloud(&format!("NOT RUN: {test}: {why}"));
    assert!(!is_set("BENCH_DRAGON_REQUIRE_ALL"), "{test} did not run: {why}");
}

/// Returns true if a test's requirement is met; otherwise reports the reason.
#[must_use]
pub fn can_run(requirement: Result<(), String>) -> bool {
    requirement.inspect_err(|why| not_run(why)).is_ok()
}

/// Requires modules of the tests' Python (`BENCH_DRAGON_PYTHON`, or `python3`).
pub fn python_modules(modules: &[&str]) -> Result<(), String> {
    let code = "import importlib.util, sys; print(*[m for m in sys.argv[1:] if not importlib.util.find_spec(m)])";
    let found = python().args(["-c", code]).args(modules).output();
    let output = found.map_err(|error| format!("no Python ({error})"))?;
    let missing = text(&output.stdout);
    if output.status.success() && missing.trim().is_empty() {
        Ok(())
    } else {
        Err(format!("Python has no {}; tests/run installs it", missing.trim()))
    }
}

/// Installs a package of npm in a folder of its own; returns the folder, and the package's folder in it.
pub fn npm(package: &str) -> Result<(tempfile::TempDir, PathBuf), String> {
    let folder = tempfile::tempdir().unwrap();
    let mut npm = Command::new("npm");
    npm.args(["install", "--no-audit", "--no-fund", package]).current_dir(folder.path());
    let output = npm.output().map_err(|error| format!("no npm ({error})"))?;
    if !output.status.success() {
        return Err(text(&output.stderr));
    }
    // A name may begin with @, as its version does.
    let name = package.rsplit_once('@').map_or(package, |(name, _)| name);
    let installed = folder.path().join("node_modules").join(name);
    Ok((folder, installed))
}

/// Requires the browser that `tests/python/stage_picture.py` starts.
pub fn chromium() -> Result<(), String> {
    let program = Path::new("/usr/bin/chromium");
    if program.exists() { Ok(()) } else { Err(format!("no {}; tests/run installs it", program.display())) }
}

/// Returns true if the user is root.
pub fn is_root() -> bool {
    std::fs::metadata("/proc/self").unwrap().uid() == 0
}

/// Requires the rights of root.
pub fn root(what_for: &str) -> Result<(), String> {
    if is_root() { Ok(()) } else { Err(format!("only root can {what_for}")) }
}
