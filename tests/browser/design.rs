//! The page of `design` in a real browser: `tests/python/design_page.py`. No test asserts a speed.

use crate::run_scenario;

fn in_a_browser(scenario: &str) {
    let folder = tempfile::tempdir().unwrap();
    run_scenario("design_page.py", scenario, &[folder.path().to_str().unwrap()]);
}

#[test]
fn village_by_pointer() {
    in_a_browser("village_by_pointer");
}

#[test]
fn village_by_keyboard() {
    in_a_browser("village_by_keyboard");
}

#[test]
fn every_handle() {
    in_a_browser("every_handle");
}

#[test]
fn server_restarted() {
    in_a_browser("server_restarted");
}

#[test]
fn two_sessions() {
    in_a_browser("two_sessions");
}

#[test]
fn texts_of_all_kinds() {
    in_a_browser("texts_of_all_kinds");
}

#[test]
fn gestures() {
    in_a_browser("gestures");
}

#[test]
fn small_screens() {
    in_a_browser("small_screens");
}
