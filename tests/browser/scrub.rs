//! The second thumb of the page's time line: frames of another time, bit-equal to `solve --at`, while the show continues.
//! `tests/python/scrub_page.py` tests the page in Debian's Chromium.

use crate::run_scenario;

#[test]
fn thumb_shows_another_time() {
    run_scenario("scrub_page.py", "thumb_shows_another_time", &["config/paper.toml"]);
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn address_and_keys() {
    run_scenario("scrub_page.py", "address_and_keys", &["config/paper.toml"]);
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn several_dragons() {
    run_scenario("scrub_page.py", "several_dragons", &["config/coil.toml"]);
}
