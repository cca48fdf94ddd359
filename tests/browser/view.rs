//! The stage picture as its users meet it: browsers, programs that read its WebSocket, and clients without rights.
//!
//! The browser is Debian's Chromium; its tests are in `tests/python/stage_picture.py`, `stage_motion.py`,
//! `stage_show.py`, `stage_places.py` and `stage_reach.py`. No test asserts a speed.

use crate::{harness, run_scenario};

use std::net::TcpStream;

use bench_dragon::client::clock::monotonic_ns;
use harness::{Process, can_run, program, python, python_modules, text, unique, wait};
use nix::sys::signal::Signal;
use serde_json::Value;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{ClientRequestBuilder, Message, WebSocket};

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// Returns a server on a free port, and its address without the scheme and the last slash.
fn server(name: &str) -> (Process, String) {
    let mut server = Process::start(program(name).args(["view", "--json", "--port", "0"]));
    let ready: Value = serde_json::from_str(&server.first_line()).unwrap();
    assert_eq!(ready["type"], "ready");
    let url = ready["url"].as_str().unwrap();
    let address = url.strip_prefix("http://").and_then(|url| url.strip_suffix('/')).unwrap();
    (server, address.to_owned())
}

fn publisher(name: &str, arguments: &[&str]) -> Process {
    Process::start(program(name).args(["run", "--quiet", "--json", "--duration", "120"]).args(arguments))
}

fn request(address: &str, headers: &[(&str, &str)]) -> Result<Socket, tungstenite::Error> {
    let start = ClientRequestBuilder::new(format!("ws://{address}/frames").parse().unwrap());
    let request = headers.iter().fold(start, |request, (name, value)| request.with_header(*name, *value));
    let (socket, _) = tungstenite::connect(request)?;
    if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
        stream.set_read_timeout(Some(harness::patience())).unwrap();
    }
    Ok(socket)
}

fn connect(address: &str) -> Socket {
    request(address, &[]).unwrap()
}

/// Returns the next frame.
fn frame(socket: &mut Socket) -> Vec<u8> {
    loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            return bytes.to_vec();
        }
    }
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_bits(u64_at(bytes, at))
}

fn f32_at(bytes: &[u8], at: usize) -> f64 {
    f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()).into()
}

/// Returns `[x, y, speed]` of every handle of the paper's scene after 300 s, computed elsewhere with 50 digits.
fn truth_at_300() -> Vec<[f64; 3]> {
    let rows = include_str!("../truth/paper_scene_exact.csv").lines().filter(|line| line.starts_with("300.0,"));
    let numbers = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>();
    rows.map(|line| numbers(line)[3..6].try_into().unwrap()).collect()
}

#[test]
fn a_program_reads_the_documented_layout() {
    let (_server, address) = server("layout");
    let _publisher = publisher("layout", &["--start", "300", "--time-scale", "1e-6"]);
    let mut socket = connect(&address);
    let stage = loop {
        if let Message::Text(json) = socket.read().unwrap() {
            let printed: Value = serde_json::from_str(&json).unwrap();
            if printed["type"] == "stage" {
                break printed;
            }
        }
    };
    let numbers = ["pitch", "start_turn", "hole_inset", "head_length", "body_length", "width", "benches"];
    let received: Vec<_> = numbers.iter().map(|key| stage["dragons"][0][key].as_f64().unwrap()).collect();
    assert_eq!(received, [0.55, 16.0, 0.275, 3.41, 2.2, 0.3, 223.0]);
    assert_eq!(stage["dragons"][0]["path"].as_array().unwrap().len(), 1);
    assert_eq!(stage["dragons"][0]["path"][0]["kind"], "inward_spiral");
    assert_eq!(stage["dragons"][0]["path"][0]["theta_first"], 32.0 * std::f64::consts::PI);
    let bytes = frame(&mut socket);
    assert_eq!(bytes.len(), 72 + 20 * 224);
    assert_eq!(bytes[..4], [3, 0, 0, 0], "version 3, moving, playing");
    assert_eq!(bytes[4..8], 224_u32.to_le_bytes());
    assert!((f64_at(&bytes, 8) - 300.0).abs() < 1e-3);
    assert_eq!(f64_at(&bytes, 16), 1e-6);
    assert_eq!(u64_at(&bytes, 32).to_string(), stage["run_id"].as_str().unwrap());
    assert!(u64_at(&bytes, 40) <= monotonic_ns());
    let clearance = f32_at(&bytes, 56);
    assert!((0.0..0.25).contains(&clearance), "{clearance} m");
    assert_eq!(bytes[60..72], [0; 12], "the first show, no cue");
    let truth = truth_at_300();
    assert_eq!(truth.len(), 224);
    for (handle, [x, y, speed]) in truth.iter().enumerate() {
        let received = [0, 4, 8, 12, 16].map(|at| f32_at(&bytes, 72 + 20 * handle + at));
        assert!((received[0] - x).hypot(received[1] - y) < 2e-6, "handle {handle} is at {received:?}, not {x}, {y}");
        assert!(
            (received[3].hypot(received[4]) - speed).abs() < 1e-6,
            "handle {handle}: {received:?}, not {speed} m/s"
        );
        let bench = handle.min(222);
        let [front, rear] = [truth[bench], truth[bench + 1]];
        let heading = (front[1] - rear[1]).atan2(front[0] - rear[0]);
        let turned = (received[2] - heading).rem_euclid(std::f64::consts::TAU);
        assert!(
            turned.min(std::f64::consts::TAU - turned) < 2e-6,
            "handle {handle} heads {}, not {heading}",
            received[2]
        );
    }
}

#[test]
fn the_python_example_reads_the_socket() {
    if !can_run(python_modules(&["websockets"])) {
        return;
    }
    let (_server, address) = server("example");
    let _publisher = publisher("example", &["--start", "300", "--time-scale", "1e-6"]);
    // A publisher that is not optimised makes its tables for seconds.
    frame(&mut connect(&address));
    let read = |name: &str| {
        let url = format!("ws://{address}/frames?name={name}");
        let arguments = ["examples/python/stage_socket.py", "--url", &url, "--seconds", "4"];
        Process::start(python().args(arguments)).output()
    };
    let refused = read("no_publisher");
    let sentence = text(&refused.stderr);
    assert!(!refused.status.success() && sentence.lines().count() == 1, "{sentence}");
    assert!(sentence.contains("name: expected one of the publishers"), "{sentence}");
    let output = read(&unique("example"));
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let [x, y, _] = truth_at_300()[0];
    let expected = format!("t =  300.000 s  moving      head ({x:.3}, {y:.3}) m  1.000 m/s");
    assert!(printed.lines().any(|line| line == expected), "no line is {expected}: {printed}");
    assert!(printed.contains("'type': 'stage'") && printed.contains("'level': 'clear'"), "{printed}");
}

#[test]
fn a_slow_reader_gets_the_newest_frame_and_no_backlog() {
    let (_server, address) = server("slow");
    let _publisher = publisher("slow", &["--start", "100", "--rate", "500"]);
    let mut socket = connect(&address);
    for _ in 0..20 {
        frame(&mut socket);
    }
    wait(3.0);
    let woken = monotonic_ns();
    // A client reads the frames and answers the pings that follow them, as every WebSocket does.
    let late = (0..50).take_while(|_| u64_at(&frame(&mut socket), 40) < woken).count();
    assert!(late <= 4, "{late} old frames were kept for a reader that slept");
}

#[test]
fn another_browser_is_not_held_up_by_a_slow_one() {
    let (_server, address) = server("pace");
    let _publisher = publisher("pace", &["--start", "100", "--rate", "100"]);
    let mut slow = connect(&address);
    frame(&mut slow);
    let mut quick = connect(&address);
    let first = u64_at(&frame(&mut quick), 24);
    // The slow client is open and reads nothing all the time.
    let last = (0..100).map(|_| u64_at(&frame(&mut quick), 24)).last().unwrap();
    assert!(last >= first + 100, "frame {last} after 100 frames from {first}");
}

#[test]
fn a_program_may_ask_for_fewer_frames() {
    let (_server, address) = server("fewer");
    let _publisher = publisher("fewer", &["--start", "100", "--rate", "200"]);
    let (mut socket, _) = tungstenite::connect(format!("ws://{address}/frames?rate=10")).unwrap();
    let first = u64_at(&frame(&mut socket), 48);
    let last = (0..40).map(|_| u64_at(&frame(&mut socket), 48)).last().unwrap();
    // Forty frames at ten a second are 800 periods of the publisher, less the age of the last frame: a reader that stands
    // still for a second makes it 600. Without the limit they are 40.
    assert!(last - first >= 400, "{} periods passed", last - first);
    for rate in ["0", "-1", "nan", "fast"] {
        let refused = tungstenite::connect(format!("ws://{address}/frames?rate={rate}"));
        assert_eq!(status(refused.map(|(socket, _)| socket)), Some(400), "rate {rate}");
    }
}

/// Returns the status with which a WebSocket was refused.
fn status(refused: Result<Socket, tungstenite::Error>) -> Option<u16> {
    match refused {
        Err(tungstenite::Error::Http(response)) => Some(response.status().as_u16()),
        _ => None,
    }
}

#[test]
fn foreign_origins_are_refused() {
    let (_server, address) = server("foreign");
    for origin in ["http://evil.example", "https://evil.example", "null", "http://127.0.0.1:1"] {
        assert_eq!(status(request(&address, &[("Origin", origin)])), Some(403), "{origin}");
    }
    let own = format!("http://{address}");
    assert!(request(&address, &[("Origin", &own)]).is_ok(), "its own page may watch");
    assert!(request(&address, &[]).is_ok(), "a program may watch");
}

#[test]
fn listening_beyond_this_machine_is_said_aloud() {
    let mut open = Process::start(program("aloud").args(["view", "--port", "0", "--listen", "0.0.0.0"]));
    assert!(open.first_line().contains("of every address of this machine"));
    open.signal(Signal::SIGTERM);
    let printed = text(&open.output().stderr);
    assert!(printed.contains("WARNING") && printed.contains("anyone"), "{printed}");
    let mut closed = Process::start(program("quiet").args(["view", "--port", "0"]));
    assert!(closed.first_line().contains("http://127.0.0.1:"));
    closed.signal(Signal::SIGTERM);
    assert_eq!(text(&closed.output().stderr), "");
}

#[test]
fn an_address_that_cannot_be_used_is_one_sentence() {
    let (_server, address) = server("taken");
    let port = address.rsplit(':').next().unwrap();
    let taken = Process::start(program("taken").args(["view", "--port", port])).output();
    let printed = text(&taken.stderr);
    assert_eq!(taken.status.code(), Some(1), "{printed}");
    assert!(printed.contains("--port") && printed.lines().count() == 1, "{printed}");
    // 192.0.2.0/24 is for documentation: no machine has it.
    let other = Process::start(program("other").args(["view", "--listen", "192.0.2.1"])).output();
    let printed = text(&other.stderr);
    assert_eq!(other.status.code(), Some(2), "{printed}");
    assert!(printed.contains("--listen") && printed.lines().count() == 1, "{printed}");
}

fn in_a_browser(scenario: &str) {
    run_scenario("stage_picture.py", scenario, &[]);
}

fn in_motion(scenario: &str) {
    run_scenario("stage_motion.py", scenario, &[]);
}

fn on_stage(scenario: &str) {
    run_scenario("stage_show.py", scenario, &[]);
}

fn in_place(scenario: &str) {
    run_scenario("stage_places.py", scenario, &[]);
}

fn in_reach(scenario: &str) {
    run_scenario("stage_reach.py", scenario, &[]);
}

fn on_the_way(scenario: &str) {
    run_scenario("stage_ways.py", scenario, &[]);
}

#[test]
fn the_page_works_below_the_path_of_a_proxy() {
    on_the_way("below_a_path");
}

#[test]
fn a_phone_is_offered_the_button_that_releases() {
    on_the_way("held_on_a_phone");
}

#[test]
fn a_page_without_a_publisher_says_what_to_start() {
    on_the_way("nobody_publishes");
}

#[test]
fn boards_are_where_the_truth_has_them() {
    in_a_browser("boards_are_where_the_truth_has_them");
}

#[test]
#[ignore = "tests/run --all"]
fn hands_move_the_picture() {
    in_a_browser("hands_move_the_picture");
}

#[test]
fn show_ends_in_contact() {
    in_a_browser("show_ends_in_contact");
}

#[test]
fn publishers_come_and_go() {
    in_a_browser("publishers_come_and_go");
}

#[test]
#[ignore = "tests/run --all"]
fn five_at_once() {
    in_a_browser("five_at_once");
}

#[test]
#[ignore = "tests/run --all"]
fn motion_is_smooth_at_any_rate() {
    in_motion("motion_is_smooth_at_any_rate");
}

#[test]
fn between_frames_is_where_the_solver_has_it() {
    in_motion("between_frames_is_where_the_solver_has_it");
}

#[test]
#[ignore = "tests/run --all"]
fn loops_are_not_joined() {
    in_motion("loops_are_not_joined");
}

#[test]
#[ignore = "tests/run --all"]
fn interpolation_keeps_its_rules() {
    in_motion("interpolation_keeps_its_rules");
}

#[test]
#[ignore = "tests/run --all"]
fn foreign_pages_are_refused() {
    in_a_browser("foreign_pages_are_refused");
}

#[test]
fn show_paints_nothing_but_the_picture() {
    on_stage("show_paints_nothing_but_the_picture");
}

#[test]
#[ignore = "tests/run --all"]
fn what_is_coming_is_named_and_seen() {
    on_stage("what_is_coming_is_named_and_seen");
}

#[test]
#[ignore = "tests/run --all"]
fn the_last_picture_stays() {
    on_stage("the_last_picture_stays");
}

#[test]
#[ignore = "tests/run --all"]
fn colours_mean_the_same_all_along() {
    on_stage("colours_mean_the_same_all_along");
}

#[test]
#[ignore = "tests/run --all"]
fn nothing_is_complained_about() {
    on_stage("nothing_is_complained_about");
}

#[test]
#[ignore = "tests/run --all"]
fn nothing_needed_is_cut_off() {
    in_place("nothing_needed_is_cut_off");
}

#[test]
#[ignore = "tests/run --all"]
fn kiosk_shows_no_buttons() {
    in_place("kiosk_shows_no_buttons");
}

#[test]
#[ignore = "tests/run --all"]
fn forced_colours_keep_their_meaning() {
    in_place("forced_colours_keep_their_meaning");
}

#[test]
#[ignore = "tests/run --all"]
fn frozen_before_it_was_seen() {
    in_place("frozen_before_it_was_seen");
}

#[test]
#[ignore = "tests/run --all"]
fn five_thousand_boards_are_drawn() {
    in_place("five_thousand_boards_are_drawn");
}

#[test]
#[ignore = "tests/run --all"]
fn the_picture_keeps_half_of_the_window() {
    in_reach("the_picture_keeps_half_of_the_window");
}

#[test]
#[ignore = "tests/run --all"]
fn a_head_that_moves_outward_has_room() {
    in_reach("a_head_that_moves_outward_has_room");
}

#[test]
#[ignore = "tests/run --all"]
fn paper_is_white() {
    in_reach("paper_is_white");
}

#[test]
#[ignore = "tests/run --all"]
fn everybody_is_told() {
    in_reach("everybody_is_told");
}

#[test]
#[ignore = "tests/run --all"]
fn distances_are_measured() {
    in_reach("distances_are_measured");
}

#[test]
#[ignore = "tests/run --all"]
fn the_clearance_of_the_whole_show_is_a_curve() {
    in_reach("the_clearance_of_the_whole_show_is_a_curve");
}

#[test]
#[ignore = "tests/run --all"]
fn the_chase_stands_in_the_header() {
    in_reach("the_chase_stands_in_the_header");
}

#[test]
#[ignore = "tests/run --all"]
fn a_loop_is_announced() {
    in_reach("a_loop_is_announced");
}
