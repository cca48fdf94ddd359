//! The page's header and its picture as an audience and a crew read them, in the browser: the transport state, the show
//! look.
//!
//! `ignore` leaves to `tests/run --all` the tests that start a browser and judge a picture, which only a change of the
//! page's looks can break; `tests/browser/view.rs` has the same page in the short run.
//!
//! The tests are in `tests/python/stage_transport.py`, `stage_show.py`, `stage_seat.py`,
//! `stage_dragons.py` and `stage_ground.py`. No test asserts a speed.

use crate::harness::{can_run, python_modules};
use crate::run_scenario;

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn header_says_what_the_show_does() {
    run_scenario("stage_transport.py", "header_says_what_the_show_does", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn show_is_locked() {
    run_scenario("stage_show.py", "show_is_locked", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn coming_lanterns_burn_white() {
    run_scenario("stage_show.py", "coming_lanterns_burn_white", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn labels_point_at_their_boards() {
    run_scenario("stage_labels.py", "labels_point_at_their_boards", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn labels_move_with_their_boards() {
    run_scenario("stage_labels.py", "labels_move_with_their_boards", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn turns_keep_the_colours_of_boards() {
    run_scenario("stage_colours.py", "turns_keep_the_colours_of_boards", &[]);
}

#[test]
fn seat_shows_the_dragon() {
    run_scenario("stage_seat.py", "seat_shows_the_dragon", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn slow_computer_shows_stills() {
    run_scenario("stage_seat.py", "slow_computer_shows_stills", &[]);
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn cameras_are_kept() {
    run_scenario("stage_seat.py", "cameras_are_kept", &[]);
}

/// Runs a scenario of several dragons, whose distances shapely computes.
fn of_several(scenario: &str) {
    if can_run(python_modules(&["shapely"])) {
        run_scenario("stage_dragons.py", scenario, &[]);
    }
}

/// Runs a scenario of a stage with obstacles, likewise.
fn on_ground(scenario: &str) {
    if can_run(python_modules(&["shapely"])) {
        run_scenario("stage_ground.py", scenario, &[]);
    }
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn two_dragons_are_drawn_apart() {
    of_several("two_are_drawn_apart");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn one_page_of_two_dragons() {
    of_several("one_page_of_two");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn labels_of_two_dragons_point_at_their_boards() {
    of_several("labels_of_two_point_at_their_boards");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn each_dragon_has_its_light() {
    of_several("each_has_its_light");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn obstacles_are_drawn() {
    on_ground("obstacles_are_drawn");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn lines_join_what_is_nearest() {
    on_ground("lines_join_what_is_nearest");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn curve_stays_in_its_place() {
    on_ground("curve_stays_in_its_place");
}

#[test]
#[ignore = "judges the looks of a picture in a browser: tests/run --all"]
fn a_board_meets_an_obstacle() {
    on_ground("a_board_meets_an_obstacle");
}
