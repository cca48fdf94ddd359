//! A show of several dragons as it goes out: trackers by pypsn, OSC by python-osc, figures for Prometheus. The scene is
//! `config/coil.toml`; places are those of `solve`.

use crate::harness;

use std::net::UdpSocket;

use harness::{Process, can_run, http_get, program, python, python_modules, text, unique, wait};
use serde_json::{Value, json};

const COIL: [&str; 2] = ["--scene", "config/coil.toml"];
/// The time at which the shows stand, s: a contact of gold and jade is near.
const TIME: &str = "333";
/// The handles of each dragon.
const HANDLES: usize = 61;

/// Starts the show, which stands at [`TIME`].
fn show(name: &str) -> Process {
    let run = ["run", "--quiet", "--json", "--start", TIME, "--paused", "--duration", "600"];
    Process::start(program(name).args(COIL).args(run))
}

/// Returns the places of all handles from `solve`.
fn places(name: &str) -> Vec<[f64; 2]> {
    let mut solve = program(name);
    let output = Process::start(solve.args(COIL).args(["solve", "--at", TIME, "--json"])).output();
    let solved: Value = serde_json::from_str(&text(&output.stdout)).unwrap();
    let handles = solved["handles"].as_array().unwrap().iter();
    handles.map(|handle| [0, 1].map(|at| handle[at].as_f64().unwrap())).collect()
}

#[test]
fn pypsn_hears_each_dragon_under_its_numbers_and_names() {
    if !can_run(python_modules(&["pypsn"])) {
        return;
    }
    let name = "psn_dragons";
    let _show = show(name);
    let places = places(name);
    assert_eq!(places.len(), 2 * HANDLES);
    let mut peer = Process::start(python().arg("tests/python/psn_dragons.py"));
    let lines = peer.lines();
    let listening: Value = serde_json::from_str(&lines.until("port")).unwrap();
    let to = format!("127.0.0.1:{}", listening["port"]);
    let numbers = ["--first-id", "11", "--id-step", "500", "--trackers", "head,9,tail", "--axes", "x,y,up"];
    let _sender = Process::start(program(name).args(["send", "psn", "--to", &to]).args(numbers));
    let heard: Value = serde_json::from_str(&lines.until("names")).unwrap();
    let expected = [
        (11, "gold head", 0),
        (19, "gold handle 9", 8),
        (71, "gold tail", 60),
        (511, "jade head", 61),
        (519, "jade handle 9", 69),
        (571, "jade tail", 121),
    ];
    assert_eq!(heard["positions"].as_object().unwrap().len(), expected.len(), "{heard}");
    for (number, named, handle) in expected {
        assert_eq!(heard["names"][number.to_string()], named);
        let position = [0, 1].map(|at| heard["positions"][number.to_string()][at].as_f64().unwrap());
        let away = (position[0] - places[handle][0]).hypot(position[1] - places[handle][1]);
        assert!(away < 1e-5, "{named} is {away} m from handle {handle}");
    }
}

#[test]
fn python_osc_hears_heads_and_alerts_of_each_dragon() {
    if !can_run(python_modules(&["pythonosc"])) {
        return;
    }
    let name = "osc_dragons";
    let _show = show(name);
    let places = places(name);
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let mut peer = Process::start(python().args(["tests/python/osc_peer.py", "--port", &port]));
    let lines = peer.lines();
    lines.until("listening");
    let _sender = Process::start(program(name).args(["send", "osc", "--to", &format!("127.0.0.1:{port}")]));
    let heard = |address: &str| {
        let line = lines.until(&format!("/{}/{address}\"", unique(name)));
        serde_json::from_str::<Value>(&line).unwrap()["arguments"].clone()
    };
    let alert = heard("alert");
    assert_eq!(
        (&alert[0], &alert[2], &alert[7], &alert[8]),
        (&json!("approaching"), &json!("contact"), &1.into(), &1.into())
    );
    assert_eq!(heard("dragons"), json!(["gold", "jade"]));
    for (dragon, handle) in [("gold", 0), ("jade", HANDLES)] {
        let head = heard(&format!("{dragon}/head"));
        let [x, y] = [0, 1].map(|at| head[at].as_f64().unwrap());
        assert!((x - places[handle][0]).hypot(y - places[handle][1]) < 1e-5, "the head of {dragon} is at {head}");
    }
}

#[test]
fn figures_have_the_label_of_each_dragon() {
    let name = "figures_dragons";
    let _show = show(name);
    let mut metrics = Process::start(program(name).args(["metrics", "--json", "--listen", "127.0.0.1:0"]));
    let ready: Value = serde_json::from_str(&metrics.first_line()).unwrap();
    let own = unique(name);
    let lines = [
        format!("bench_dragon_benches{{name=\"{own}\",dragon=\"jade\"}} 60"),
        format!("bench_dragon_head_speed_meters_per_second{{name=\"{own}\",dragon=\"gold\"}} 0"),
        format!("bench_dragon_nearest_info{{name=\"{own}\",dragon=\"gold\",other=\"jade\"}} 1"),
        format!("bench_dragon_alert_event_info{{name=\"{own}\",event=\"contact\",dragon=\"gold\",other=\"jade\"}} 1"),
    ];
    let mut answer = String::new();
    for _ in 0..harness::patience().as_secs() * 10 {
        answer = http_get(ready["url"].as_str().unwrap(), "*/*");
        if lines.iter().all(|line| answer.lines().any(|printed| printed == line)) {
            return;
        }
        wait(0.1);
    }
    panic!("not all of {lines:#?} in {answer}");
}
