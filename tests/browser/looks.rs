//! The page's header and its picture as an audience and a crew read them, in the browser: the transport state, the show look.
//!
//! The tests are in `tests/python/stage_transport.py`, `stage_show.py` and `stage_seat.py`. No test asserts a speed.

use crate::view::run_scenario;

#[test]
fn header_says_what_the_show_does() {
    run_scenario("tests/python/stage_transport.py", "header_says_what_the_show_does");
}

#[test]
fn show_is_locked() {
    run_scenario("tests/python/stage_show.py", "show_is_locked");
}

#[test]
fn coming_lanterns_burn_white() {
    run_scenario("tests/python/stage_show.py", "coming_lanterns_burn_white");
}

#[test]
fn labels_point_at_their_boards() {
    run_scenario("tests/python/stage_labels.py", "labels_point_at_their_boards");
}

#[test]
fn labels_move_with_their_boards() {
    run_scenario("tests/python/stage_labels.py", "labels_move_with_their_boards");
}

#[test]
fn turns_keep_the_colours_of_boards() {
    run_scenario("tests/python/stage_colours.py", "turns_keep_the_colours_of_boards");
}

#[test]
fn seat_shows_the_dragon() {
    run_scenario("tests/python/stage_seat.py", "seat_shows_the_dragon");
}

#[test]
fn cameras_are_kept() {
    run_scenario("tests/python/stage_seat.py", "cameras_are_kept");
}
