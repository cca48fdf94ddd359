//! `list`, and the sentences of commands that find no publisher: both name the shows that run here, and no other.

use crate::harness;

use harness::{Place, Process, answering, json_lines, text, wait_until};
use serde_json::Value;

fn show(place: &Place, name: &str, arguments: &[&str]) -> Process {
    let program = || {
        let mut program = place.program();
        program.args(["--name", name]);
        program
    };
    let scene = "accuracy = 1e-9";
    let text = include_str!("../../config/paper.toml").replace(scene, "solver = \"newton\"");
    let file = place.folder().join(format!("{name}.toml"));
    std::fs::write(&file, text.replace("name = \"paper\"", &format!("name = \"the coil of {name}\""))).unwrap();
    let mut command = program();
    command.arg("run").arg(file).args(arguments);
    answering(Process::start(&mut command), program)
}

fn listed(place: &Place) -> Vec<Value> {
    let output = Process::start(place.program().args(["list", "--json"])).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    json_lines(&output)
}

/// Returns the standard output and the sentence of a command.
fn printed(place: &Place, arguments: &[&str]) -> (String, String) {
    let output = Process::start(place.program().args(arguments)).output();
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn the_shows_that_run_here_are_listed_with_what_they_do() {
    let place = Place::new("listed");
    assert!(listed(&place).is_empty());
    let (none, _) = printed(&place, &["list"]);
    assert_eq!(none, "No show runs on this machine: \"bench-dragon run\" starts one.\n");
    let _gold = show(&place, "gold", &["--rate", "50", "--start", "20"]);
    let jade = show(&place, "jade", &["--rate", "40", "--start", "100", "--paused"]);
    let mut watch = place.program();
    let _watching = Process::start(watch.args(["--name", "gold", "watch"]));
    wait_until("gold has one subscriber and jade none", || {
        let lines = listed(&place);
        assert_eq!(lines.iter().map(|line| line["name"].as_str().unwrap()).collect::<Vec<_>>(), ["gold", "jade"]);
        lines[0]["subscribers"] == 1 && lines[1]["subscribers"] == 0
    });
    let [gold_line, jade_line] = listed(&place).try_into().unwrap();
    for (line, scene, playback, rate) in
        [(&gold_line, "the coil of gold", "playing", 50.0), (&jade_line, "the coil of jade", "paused", 40.0)]
    {
        assert_eq!(line["type"], "show", "{line}");
        assert_eq!((&line["scene"], &line["playback"]), (&scene.into(), &playback.into()), "{line}");
        assert_eq!((&line["state"], &line["rate"]), (&"moving".into(), &rate.into()), "{line}");
    }
    assert!(gold_line["sim_time"].as_f64().unwrap() > 20.0, "{gold_line}");
    assert_eq!(jade_line["sim_time"], 100.0, "{jade_line}");
    let (table, _) = printed(&place, &["list"]);
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows.len() == 3 && rows[0].starts_with("name ") && rows[0].ends_with("subscribers"), "{table}");
    assert!(rows[2].starts_with("jade  the coil of jade  moving (paused)  100.000 s"), "{table}");
    assert!(rows[2].ends_with("40 Hz  0"), "{table}");
    // A show that has been killed is not listed, although its files may stay.
    jade.signal(nix::sys::signal::Signal::SIGKILL);
    drop(jade);
    assert_eq!(listed(&place).len(), 1);
}

#[test]
fn a_command_without_a_publisher_names_those_that_run() {
    let place = Place::new("instead");
    let (_, sentence) = printed(&place, &["--name", "amber", "control", "pause"]);
    let expected =
        "no publisher has the name \"amber\" (no show runs here: \"bench-dragon run --name amber\" starts one)";
    assert_eq!(sentence.trim_end(), format!("error: {expected}"));
    let _gold = show(&place, "gold", &["--rate", "20"]);
    let _jade = show(&place, "jade", &["--rate", "20"]);
    let (_, sentence) = printed(&place, &["--name", "amber", "control", "pause"]);
    assert!(sentence.ends_with("\"amber\" (running here: gold, jade)\n"), "{sentence}");
    let (watched, _) = printed(&place, &["--name", "amber", "watch", "--duration", "1"]);
    assert_eq!(watched, "waiting for a publisher of \"amber\"; running here: gold, jade\n");
    let (_, sentence) = printed(&place, &["--name", "amber", "record", "-o", "show.mcap", "--duration", "0.1"]);
    assert!(sentence.contains("nothing came from \"amber\" (running here: gold, jade)"), "{sentence}");
}
