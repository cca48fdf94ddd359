//! The hand-outs of `sheets` on paper, as Chromium prints them.
//!
//! The test is in `tests/python/sheets_paper.py`.

use crate::run_scenario;

#[test]
fn sheets_on_paper() {
    run_scenario("sheets_paper.py", "sheets_on_paper", &[]);
}
