//! The page's header and its picture as an audience and a crew read them, in the browser: the transport state.
//!
//! The tests are in `tests/python/stage_transport.py`. No test asserts a speed.

use crate::view::run_scenario;

#[test]
fn header_says_what_the_show_does() {
    run_scenario("tests/python/stage_transport.py", "header_says_what_the_show_does");
}
