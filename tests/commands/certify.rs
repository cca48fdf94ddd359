//! Certificates of events, made by the search and checked by `proof`. Certificates of scenes with every kind of event
//! are accepted and agree with the ordinary search. A changed certificate is refused, or is still true.
//!
//! `BENCH_DRAGON_LONG=1` makes a thousand changes in place of some dozens, and adds larger scenes.

use crate::harness;

mod branches;
mod changes;
mod second_judge;
mod tampering;
mod truth;

use bench_dragon::proof::{EventKind, Proved, Refused, Status, verify};
use serde_json::Value;
use truth::{Found, certificate};

fn scene_text(name: &str) -> String {
    let config = format!("config/{name}.toml");
    std::fs::read_to_string(&config).or_else(|_| std::fs::read_to_string(format!("tests/scenes/{name}.toml"))).unwrap()
}

fn check(lines: &[Value]) -> Result<Proved, Refused> {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    verify(text.as_bytes(), &mut |_| {})
}

/// Certificates are accepted, decide what they can, and agree with the ordinary search.
#[test]
fn certificates_are_proofs() {
    let mut scenes = vec![("missed_contact", 4), ("tailoff", 4), ("pieces_46", 4), ("alertloop", 4), ("tight_158", 4)];
    if harness::long() {
        scenes.extend([("paper", 4), ("school", 4), ("wide", 4), ("procession", 4), ("tiny_2", 4), ("straight200", 4)]);
    }
    for (name, least) in scenes {
        let text = scene_text(name);
        let proved = check(&certificate(&text)).unwrap_or_else(|refused| panic!("{name}: {refused}"));
        assert_eq!(Found::new(&text).unwrap().contradiction(&proved), None, "{name}");
        let decided = proved.results.iter().filter(|outcome| outcome.status != Status::Undecided).count();
        assert!(decided >= least, "{name}: {:?}", proved.results);
        assert_eq!(proved.scene, text);
    }
}

/// A team whose head's link points backward at the start already.
#[test]
fn a_stall_at_the_start_is_proved() {
    let text = &scene_text("stalled_start");
    let proved = check(&certificate(text)).unwrap_or_else(|refused| panic!("{refused}"));
    assert_eq!(Found::new(text).unwrap().contradiction(&proved), None);
    let stall = proved.results.iter().find(|outcome| outcome.event == EventKind::Stall).unwrap();
    assert_eq!((stall.status, stall.time_lo), (Status::Proved, Some(0.0)), "{stall:?}");
    assert!(stall.time_hi.is_some_and(|time| time < 1e-9), "{stall:?}");
}

/// Heads and tails of their own size: an inward spiral, and a route past an obstacle on which the tail's link stalls.
/// The certificate of one size is none of another, where it claims an event of that board.
#[test]
fn heads_and_tails_of_their_own_size_are_proved_and_forged_sizes_refused() {
    let spiral = "[team]\nbenches = 24\nhead_width = 0.8\ntail_width = 0.2\ntail_length = 3.0\n[path]\nkind = \"spiral\"\n\
                  pitch = 0.74\nstart_turn = 5\n[motion]\nhead_speed = 1.0\non_contact = \"continue\"\n";
    let route = "[team]\nbenches = 5\ntail_width = 1.2\ntail_length = 4.0\n[path]\nkind = \"pieces\"\n\
                 [[path.pieces]]\nkind = \"line\"\nlength = 3.0\n[[path.pieces]]\nkind = \"arc\"\nradius = 1.75\nside = \
                 \"left\"\nturns = 0.5\n[[path.pieces]]\nkind = \"line\"\nlength = 25.0\n[motion]\nhead_speed = 1.0\n\
                 on_contact = \"continue\"\n[stage]\n[[stage.obstacles]]\nname = \"post\"\ncircle = { center = [-2.0, -0.9], \
                 radius = 0.4 }\n";
    let forgeries: [&[[&str; 2]]; 2] = [
        &[
            ["head_width = 0.8", "head_width = 0.81"],
            ["head_width = 0.8", "head_width = 0.7"],
            ["head_width = 0.8\n", ""],
            ["tail_length = 3.0", "tail_length = 3.1"],
            ["tail_length = 3.0\n", ""],
        ],
        &[
            ["tail_width = 1.2", "tail_width = 1.3"],
            ["tail_width = 1.2", "tail_width = 1.1"],
            ["tail_width = 1.2\n", ""],
            ["tail_length = 4.0", "tail_length = 3.9"],
        ],
    ];
    for (text, forgeries) in [spiral, route].into_iter().zip(forgeries) {
        let lines = certificate(text);
        let proved = check(&lines).unwrap_or_else(|refused| panic!("{text}: {refused}"));
        println!("{:?}", proved.results);
        assert_eq!(Found::new(text).unwrap().contradiction(&proved), None, "{text}");
        assert!(proved.results.iter().all(|outcome| outcome.status != Status::Undecided), "{:?}", proved.results);
        for [own, forged] in forgeries {
            let mut forgery = lines.clone();
            forgery[0]["scene"] = text.replace(own, forged).into();
            assert!(check(&forgery).is_err(), "{forged} in place of {own}");
        }
    }
}

/// Returns the output, the error output and the exit code of the program.
fn program(arguments: &[&str]) -> (String, String, Option<i32>) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), text(output.stderr), output.status.code())
}

/// Returns a dragon of three benches on a line of 50 m, behind other pieces.
fn dragon(name: &str, origin: &str, delay: f64, pieces: &str) -> String {
    format!(
        "[[dragons]]\nname = \"{name}\"\nplacement = {{ {origin} }}\ndelay = {delay:?}\n[dragons.team]\n\
         benches = 3\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n[dragons.path]\n\
         kind = \"pieces\"\npieces = [{pieces} {{ kind = \"line\", length = 50.0 }}]\n[dragons.motion]\n\
         head_speed = 1.0\n"
    )
}

/// The events of each of several dragons and the contact of two are proved, verified, and named by their dragons.
#[test]
fn the_program_proves_the_contact_of_two_dragons() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("proof.jsonl");
    let text = dragon("gold", "origin = [-20.0, 0.0]", 0.0, "")
        + &dragon("jade", "origin = [20.0, 0.2], rotation_turns = 0.5", 4.0, "");
    let scene = folder.path().join("two.toml");
    std::fs::write(&scene, &text).unwrap();
    let (file, scene) = (file.to_str().unwrap(), scene.to_str().unwrap());
    let (lines, errors, code) = program(&["--scene", scene, "--json", "events", "--certify", file]);
    assert_eq!((errors.as_str(), code), ("", Some(0)));
    let contact: Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    // Gold is 4 s under way when jade begins; the fronts of their boards are 0.275 m ahead.
    let truth = 4.0 + (40.0 - 4.0 - 0.55) / 2.0;
    let [lo, hi] = ["time_lo", "time_hi"].map(|key| contact[key].as_f64().unwrap());
    assert!(contact["event"] == "contact" && lo <= truth && truth <= hi && hi - lo < 1e-9, "{contact}");
    let (said, _, code) = program(&["verify", file]);
    assert!(code == Some(0) && said.contains("gold and jade, contact: proved between 21.72499"), "{said}");
    assert!(said.contains("jade, path end: proved between 5"), "{said}");
    let (said, _, code) = program(&["--scene", scene, "events", "--certify", file]);
    assert!(code == Some(0) && said.contains("Of gold, contact:\n           Proved."), "{said}");
    let (_, said, code) = program(&["view", "--port", "0", "--certificate", file]);
    assert!(code == Some(2) && said.contains("certificate of several dragons"), "{said}");
    // Until the dragons touch, at 0; each alone is on a line, with two holes between benches 1 and 3.
    let (said, errors, code) = program(&["--scene", scene, "check", "--prove", "--certify", file]);
    assert_eq!((errors.as_str(), code), ("", Some(0)), "{said}");
    assert!(said.contains("The least clearance of the whole route is"), "{said}");
    // The least clearance of the whole route is the least clearance between dragons, and is printed once.
    assert!(!said.contains("The least clearance between dragons"), "{said}");
    assert!(said.contains("The least clearance of gold and jade: Proved: it is"), "{said}");
    let (lines, errors, code) = program(&["--scene", scene, "check", "--prove", "--json"]);
    assert_eq!((errors.as_str(), code), ("", Some(0)));
    let parts: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<String> = parts.iter().map(|part| part["dragons"].to_string()).collect();
    assert_eq!(names, ["[\"gold\"]", "[\"jade\"]", "[\"gold\",\"jade\"]"]);
    assert!(parts.iter().all(|part| part["least_clearance_status"] == "proved"), "{lines}");
    let (said, _, code) = program(&["verify", file]);
    assert!(code == Some(0) && said.contains("gold and jade, least clearance from the start"), "{said}");
    assert!(said.contains("no board of the one and board of the other are nearer than"), "{said}");
}

/// At a U-turn as wide as the head's link a proof gives up. JSON and words name the same time before.
#[test]
fn the_time_up_to_which_two_dragons_are_proved_is_the_same_in_json_as_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("two.toml");
    let turn = "{ kind = \"line\", length = 5.0 }, { kind = \"arc\", radius = 1.43, side = \"left\", turns = 0.5 },";
    let text = dragon("gold", "origin = [-30.0, 40.0]", 0.0, "") + &dragon("jade", "origin = [0.0, 0.0]", 0.3, turn);
    std::fs::write(&scene, text).unwrap();
    let [json, words] = [&["--json"][..], &[]].map(|form| {
        let (said, errors, code) = program(&[&["--scene", scene.to_str().unwrap(), "check", "--prove"], form].concat());
        assert_eq!((errors.as_str(), code), ("", Some(0)), "{said}");
        said
    });
    let jade: Value = serde_json::from_str(json.lines().nth(1).unwrap()).unwrap();
    assert_eq!(jade["least_clearance_status"], "given_up", "{json}");
    let until = jade["proved_until"].as_f64().unwrap();
    assert!(words.contains(&format!("jade: Proved: up to t = {until} s no two boards")), "{json}{words}");
}

/// A certificate is made, checked, refused after a change of one digit, and printed for its own scene only.
#[test]
fn the_program_makes_and_checks_certificates() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("proof.jsonl");
    let (file, scene) = (file.to_str().unwrap(), "tests/scenes/missed_contact.toml");
    let (lines, errors, code) = program(&["--scene", scene, "--json", "events", "--certify", file]);
    assert_eq!((errors.as_str(), code), ("", Some(0)));
    let events: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for event in &events {
        let [time, lo, hi] = ["time", "time_lo", "time_hi"].map(|key| event[key].as_f64().unwrap());
        assert!(lo <= time && time <= hi && hi - lo < 1e-8, "{event}");
    }
    assert_eq!(events.len(), 3);
    let (said, _, code) = program(&["verify", file]);
    assert!(code == Some(0) && said.contains("contact: proved between 37.145313188"), "{said}");
    let (said, _, code) = program(&["check", "--scene", scene, "--certificate", file]);
    assert!(code == Some(0) && said.contains("lock: proved that there is none"), "{said}");
    let (_, said, code) = program(&["check", "--scene", "config/school.toml", "--certificate", file]);
    assert!(code == Some(2) && said.contains("another text"), "{said}");

    let text = std::fs::read_to_string(file).unwrap();
    std::fs::write(file, text.replace("\"time_hi\":37.1453", "\"time_hi\":37.1452")).unwrap();
    let (_, said, code) = program(&["verify", file]);
    assert!(code == Some(1) && said.contains("does not follow"), "{said}");
    std::fs::write(file, &text[..text.len() / 2]).unwrap();
    let (_, said, code) = program(&["check", "--scene", scene, "--certificate", file]);
    assert!(code == Some(2) || code == Some(1), "{said}");

    let exact = std::fs::read_to_string("config/school.toml").unwrap();
    let paper = folder.path().join("paper.toml");
    std::fs::write(&paper, exact.replace("head_speed = 1.0", "solver = \"paper\"\nhead_speed = 1.0")).unwrap();
    let (_, said, code) = program(&["--scene", paper.to_str().unwrap(), "events", "--certify", file]);
    assert!(code == Some(2) && said.contains("only exact motion can be certified"), "{said}");
    for question in [&["check", "--prove"][..], &["plan", "speed", "--max-handle-speed", "2"]] {
        let (_, said, code) = program(&[&["--scene", paper.to_str().unwrap()], question].concat());
        assert!(code == Some(2) && said.contains("only exact motion can be certified"), "{question:?} {said}");
    }
}
