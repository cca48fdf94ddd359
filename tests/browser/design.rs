//! The page of `design` in a real browser: `tests/python/design_page.py`, and `design_files.py` beside files and
//! commands. No test asserts a speed.

use crate::run_scenario;

fn in_a_browser(scenario: &str) {
    played("design_page.py", scenario);
}

fn played(script: &str, scenario: &str) {
    let folder = tempfile::tempdir().unwrap();
    run_scenario(script, scenario, &[folder.path().to_str().unwrap()]);
}

#[test]
fn village_by_pointer() {
    in_a_browser("village_by_pointer");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn village_by_keyboard() {
    in_a_browser("village_by_keyboard");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn every_handle() {
    in_a_browser("every_handle");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn server_restarted() {
    in_a_browser("server_restarted");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn two_sessions() {
    in_a_browser("two_sessions");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn texts_of_all_kinds() {
    in_a_browser("texts_of_all_kinds");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn gestures() {
    in_a_browser("gestures");
}

#[test]
fn saving() {
    played("design_files.py", "saving");
}

#[test]
fn numbers_that_fit() {
    played("design_files.py", "numbers_that_fit");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn token() {
    played("design_files.py", "token");
}

#[test]
fn hand_outs() {
    played("design_files.py", "hand_outs");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn small_screens() {
    in_a_browser("small_screens");
}
