//! Certificates of every question, checked again by a second program in another language:
//! `tests/python/second_judge.py`, with the ball arithmetic of Arb. The second program finds the handles itself and
//! checks the claims, not the proof. `BENCH_DRAGON_LONG=1`: 500 scenes.

mod several;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use fastrand::Rng;
use serde_json::{Value, json};

use super::scene_text;
use crate::harness::{Process, all, aloud, can_run, cases, json_lines, python, python_modules, text};

/// Random times and steps of each certificate.
const PLACES: &str = "5";

/// Metres from the centre that `plan pitch` is to reach.
const RADIUS: &str = "2.0";

/// Returns the text of a scene: a spiral, a route or a turnaround in turn. Every second route has obstacles.
fn scene(number: u64) -> String {
    let mut random = Rng::with_seed(number);
    let mut between = |least: f64, greatest: f64| least + (greatest - least) * random.f64();
    let body = between(0.7, 2.5);
    let (head, inset) = (body * between(0.8, 1.8), body * between(0.06, 0.2));
    let (width, benches) = (body * between(0.05, 0.25), between(3.0, 25.0) as u32);
    let link = body - 2.0 * inset;
    let path = match number % 3 {
        0 => {
            let pitch = width * between(1.02, 3.0);
            format!("kind = \"spiral\"\npitch = {pitch}\nstart_turn = {}", between(3.0, 9.0) + link / pitch)
        }
        1 => {
            let mut pieces = String::new();
            for _ in 0..between(3.0, 8.0) as u32 {
                let length = link * between(0.2, 5.0);
                pieces += &format!("\n[[path.pieces]]\nkind = \"line\"\nlength = {length}");
                let (radius, turns) = (link * between(0.45, 2.5), between(0.05, 0.8));
                let side = if between(0.0, 1.0) < 0.5 { "left" } else { "right" };
                pieces += &if number % 2 == 1 && between(0.0, 1.0) < 0.5 {
                    // At most half of the way to the centre.
                    let (direction, pitch) = if between(0.0, 1.0) < 0.5 { ("in", radius) } else { ("out", link) };
                    format!(
                        "\n[[path.pieces]]\nkind = \"spiral\"\nradius = {radius}\nside = \"{side}\"\npitch = {}\n\
                         direction = \"{direction}\"\nturns = {turns}",
                        between(0.2, 0.6) * pitch
                    )
                } else {
                    format!("\n[[path.pieces]]\nkind = \"arc\"\nradius = {radius}\nside = \"{side}\"\nturns = {turns}")
                };
            }
            format!(
                "kind = \"pieces\"\nstart = [{}, 1.0]\nheading_turns = {}{pieces}",
                between(-9.0, 9.0),
                between(0.0, 1.0)
            )
        }
        _ => {
            let pitch = width * between(2.0, 8.0);
            let (radius, ratio, lead_in) = (link * between(0.8, 3.0), between(0.5, 3.0), link * between(2.0, 9.0));
            format!(
                "kind = \"turnaround\"\npitch = {pitch}\nturn_radius = {radius}\narc_ratio = {ratio}\nlead_in = {lead_in}"
            )
        }
    };
    let stage = if number % 6 == 1 { stage(link, &mut between) } else { String::new() };
    let speed = between(0.2, 3.0);
    let ends = match number % 4 {
        1 => format!("head_width = {}\n", width * between(0.5, 3.0)),
        2 => format!(
            "tail_width = {}\ntail_length = {}\n",
            width * between(0.5, 3.0),
            2.0 * inset + link * between(0.5, 2.0)
        ),
        _ => String::new(),
    };
    format!(
        "name = \"scene {number}\"\n[team]\n{ends}benches = {benches}\nhead_length = {head}\nbody_length = {body}\nwidth = \
         {width}\nhole_inset = {inset}\n[path]\n{path}\n[motion]\nhead_speed = {}\non_contact = \"continue\"\n{stage}",
        speed
    )
}

/// A route with a turn, whose lock is proved; the sizes of its benches are the defaults.
const TURN: &str = "[team]\nbenches = 12\n[path]\nkind = \"pieces\"\n[[path.pieces]]\nkind = \"spiral\"\npitch = 1.7\n\
                    radius = 9\nside = \"left\"\ndirection = \"in\"\nto_radius = 2.6\n[[path.pieces]]\nkind = \"turn\"\n\
                    arc_ratio = 1.5\n[[path.pieces]]\nkind = \"spiral\"\nto_radius = 9\n[motion]\nhead_speed = 1.0\n\
                    on_contact = \"continue\"\n";

/// Returns a stage with a shape of each kind, placed near the path, and a boundary around it.
fn stage(link: f64, between: &mut impl FnMut(f64, f64) -> f64) -> String {
    let mut point = |far: f64| format!("[{}, {}]", link * between(-far, far), link * between(-far, far));
    let [lamp, one, other, third, from, to] = [5.0; 6].map(&mut point);
    let far = 20.0 * link;
    format!(
        "[placement]\norigin = [1.0, 2.0]\nrotation_turns = 0.3\nmirror = true\n[stage]\nboundary = {{ polygon = \
         [[-{far}, -{far}], [{far}, -{far}], [{far}, {far}], [-{far}, {far}]] }}\n[[stage.obstacles]]\nname = \"lamp\"\n\
         circle = {{ center = {lamp}, radius = {} }}\n[[stage.obstacles]]\nname = \"house\"\npolygon = [{one}, {other}, \
         {third}]\n[[stage.obstacles]]\nname = \"rope\"\nline = [{from}, {to}]\nkeep_out = {}\n",
        0.2 * link,
        0.1 * link
    )
}

/// The questions of certificates. Not every scene has an answer to each.
const QUESTIONS: [(&str, &[&str]); 4] = [
    ("events", &["events"]),
    ("clearance", &["check", "--prove"]),
    ("speed", &["plan", "speed", "--max-handle-speed", "2"]),
    ("pitch", &["plan", "pitch", "--reach-radius"]),
];

/// Writes the certificates of a scene for some questions. Returns their files; none for a scene that the program
/// refuses.
fn certified(folder: &Path, name: &str, scene: &str, questions: &[&str]) -> Vec<PathBuf> {
    let input = folder.join(format!("{name}.toml"));
    std::fs::write(&input, scene).unwrap();
    let mut files = Vec::new();
    for (question, arguments) in QUESTIONS.into_iter().filter(|(question, _)| questions.contains(question)) {
        let file = folder.join(format!("{name}.{question}"));
        let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
        program.arg("--scene").arg(&input).arg("--quiet").args(arguments);
        if question == "pitch" {
            program.arg(RADIUS);
        }
        let output = Process::start(program.arg("--certify").arg(&file)).output();
        if output.status.success() && file.exists() {
            files.push(file);
            continue;
        }
        // A show that runs into a lock has no greatest speed. A scene with obstacles has only events. The search of a
        // proof may give up.
        let said = text(&output.stderr);
        let is_unanswered =
            ["lock", "obstacles", "no certificate is written", "reaches"].iter().any(|it| said.contains(it));
        assert!(
            output.status.success() || output.status.code() == Some(2) || is_unanswered,
            "{name}, {question}: {said}"
        );
        if question == "events" {
            return Vec::new();
        }
    }
    files
}

/// Returns the judge's verdicts, in the order of the files.
fn verdicts(files: &[PathBuf]) -> Vec<Value> {
    let mut judge = python();
    judge.args(["tests/python/second_judge.py", "--places", PLACES]).args(files);
    let output = Process::start(&mut judge).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let verdicts = json_lines(&output);
    assert_eq!(verdicts.len(), files.len());
    verdicts
}

/// A name and a changed certificate.
type Changed = (String, Vec<Value>);

/// Returns a certificate with some of its lines changed.
fn with(lines: &[Value], edit: impl Fn(usize, &mut Value)) -> Vec<Value> {
    let mut other = lines.to_vec();
    other.iter_mut().enumerate().for_each(|(number, line)| edit(number, line));
    other
}

/// Returns a certificate with one number of its result `of` a kind, or of the lines of a kind, changed.
fn moved(lines: &[Value], kind: &str, field: &str, by: f64) -> Vec<Value> {
    with(lines, |_, line| {
        if line["type"] == kind || line["of"] == kind {
            line[field] = json!(line[field].as_f64().unwrap() + by);
        }
    })
}

/// Returns changes that make the results of a certificate of events false.
fn false_results(lines: &[Value]) -> Vec<Changed> {
    let mut changed = Vec::new();
    for (number, result) in lines.iter().enumerate().filter(|(_, line)| line["status"] == "proved") {
        let event = result["event"].as_str().unwrap();
        let mut change = |name: String, edit: &dyn Fn(&mut Value)| {
            changed.push((
                name,
                with(lines, |other, line| {
                    if other == number {
                        edit(line)
                    }
                }),
            ));
        };
        for by in [1e-6, -1e-6] {
            change(format!("{event} moved by {by} s"), &|line| {
                for time in ["time_lo", "time_hi"] {
                    line[time] = json!(line[time].as_f64().unwrap() + by);
                }
            });
        }
        for bench in ["bench_a", "bench_b"].into_iter().filter(|bench| result[bench].is_u64()) {
            change(format!("{bench} of the {event}"), &|line| line[bench] = json!(line[bench].as_u64().unwrap() + 1));
        }
        if event == "contact" {
            change("a contact that is none".to_owned(), &|line| {
                *line = json!({ "type": "result", "of": "event", "event": "contact", "status": "none" });
            });
        }
    }
    changed
}

/// Returns changes of the certificate of `config/school.toml`: of its results, its scene, and its steps.
fn changes(lines: &[Value]) -> Vec<Changed> {
    let mut changed = false_results(lines);
    let scene = |from: &str, to: &str| {
        with(lines, |number, line| {
            if number == 0 {
                let text = line["scene"].as_str().unwrap();
                assert_eq!(text.matches(from).count(), 1);
                line["scene"] = json!(text.replace(from, to));
            }
        })
    };
    changed.push(("wider boards".to_owned(), scene("width = 0.30", "width = 0.31")));
    changed.push(("a longer head".to_owned(), scene("head_length = 3.41", "head_length = 3.42")));
    let unknown = with(lines, |number, line| {
        if number == lines.len() / 2 {
            *line = json!({ "type": "clearance" });
        }
    });
    changed.push(("an unknown line".to_owned(), unknown));
    let elsewhere = with(lines, |_, line| {
        if line["type"] == "step" {
            for end in [0, 1] {
                let coordinate = &mut line["spans"][0][end][1];
                *coordinate = json!(coordinate.as_f64().unwrap() + 0.01);
            }
        }
    });
    changed.push(("spans of handle 1 elsewhere".to_owned(), elsewhere));
    changed
}

/// Returns changes of certificates of other questions, of the first files that can be changed so.
fn other_changes(files: &[PathBuf]) -> Vec<Changed> {
    let of = |question: &str, is_fit: &dyn Fn(&[Value]) -> bool| -> Vec<Value> {
        let mut read = files.iter().filter(|file| file.extension().unwrap() == question).map(|file| lines_of(file));
        read.find(|lines| is_fit(lines)).unwrap_or_else(|| panic!("no certificate of the {question} is fit"))
    };
    let last = |lines: &[Value]| lines.last().unwrap().clone();
    let clearance = of("clearance", &|lines| last(lines)["lo"].as_f64() > Some(1e-3));
    let speed = of("speed", &|lines| last(lines)["handle"].as_u64() > Some(0));
    let pitch = of("pitch", &|lines| last(lines)["value_lo"].is_f64() && last(lines)["value_hi"].is_f64());
    let mut changed = Vec::new();
    for (lines, kind, fields) in [
        (&clearance, "least_clearance", &[("lo", 2e-6), ("hi", -1e-6)][..]),
        (&speed, "greatest_speed", &[("value_lo", 1e-6), ("value_hi", -1e-6), ("ratio_lo", 1e-6)][..]),
        (&pitch, "least_pitch", &[("value_lo", 1e-3), ("value_hi", -1e-3), ("radius", -0.1), ("from", -1e-3)][..]),
    ] {
        for (field, by) in fields {
            changed.push((format!("{field} of the {kind}"), moved(lines, kind, field, *by)));
        }
    }
    let fastest = moved(&speed, "fast", "handle", 0.0);
    let slower = with(&fastest, |_, line| {
        if line["type"] == "fast" {
            line["at"][0] = speed[1]["from"].clone();
        }
    });
    changed.push(("a fast handle at another place".to_owned(), slower));
    if let Some(touched) = files.iter().map(|file| lines_of(file)).find(|lines| has_touch(lines)) {
        // The next bench may be there too: boards that share a handle overlap.
        changed.extend(false_results(&touched).into_iter().filter(|(name, _)| name.contains("obstacle moved")));
    }
    changed
}

/// Returns true if a certificate proves the first touch of an obstacle after the start.
fn has_touch(lines: &[Value]) -> bool {
    let is_touch = |line: &Value| line["event"] == "obstacle" && line["time_lo"].as_f64() > Some(1e-3);
    lines.iter().any(|line| line["status"] == "proved" && is_touch(line))
}

fn lines_of(file: &Path) -> Vec<Value> {
    std::fs::read_to_string(file).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_second_judge_agrees_and_refuses_what_was_changed() {
    if !can_run(python_modules(&["flint"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // `long` is proved for minutes, and `ros2` is the paper's scene.
    let config: &[&str] =
        if all() { &["school", "paper", "wide", "procession", "turnaround", "tight", "square"] } else { &["school"] };
    let all = cases(11, 50, 500);
    let read = |name: &&str| (name.to_string(), std::fs::read_to_string(format!("config/{name}.toml")).unwrap());
    let mut scenes: Vec<_> = config.iter().map(read).collect();
    scenes.push(("turn".to_owned(), TURN.to_owned()));
    scenes.extend(["tail_locks", "lk_25", "stalled_start"].map(|name| (name.to_owned(), scene_text(name))));
    let random = (0..).map(|number| (format!("random{number}"), scene(number)));
    let left = Mutex::new(scenes.into_iter().chain(random).enumerate());
    let found = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while found.lock().unwrap().len() < all {
                    let (number, (name, scene)) = left.lock().unwrap().next().unwrap();
                    let questions: &[&str] = match () {
                        () if name == "school" => &["events", "pitch"],
                        () if !name.starts_with("random") => &["events"],
                        () if number.is_multiple_of(9) => &["events", "clearance", "speed", "pitch"],
                        () => &["events", "clearance", "speed"],
                    };
                    let files = certified(folder, &name, &scene, questions);
                    if !files.is_empty() {
                        found.lock().unwrap().push((number, files));
                    }
                }
            });
        }
    });
    // The same scenes, whichever thread was first.
    let mut found = found.into_inner().unwrap();
    found.sort();
    found.truncate(all);
    let mut files: Vec<PathBuf> = found.into_iter().flat_map(|(_, files)| files).collect();
    let agreed = files.len();
    // Changed certificates, which the judge must refuse.
    let mut changed = changes(&lines_of(&folder.join("school.events")));
    changed.extend(other_changes(&files));
    for (number, (_, lines)) in changed.iter().enumerate() {
        let file = folder.join(format!("changed{number}"));
        std::fs::write(&file, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
        files.push(file);
    }
    let verdicts = verdicts(&files);
    let (right, wrong) = verdicts.split_at(agreed);
    for verdict in right {
        assert!(verdict["refused"].is_null() && verdict["undecided"].is_null(), "{verdict}");
    }
    for ((name, _), verdict) in changed.iter().zip(wrong) {
        assert!(verdict["refused"].is_string(), "the judge accepts {name}: {verdict}");
    }
    let names = ["events", "places", "spans", "pairs", "clearances", "speeds", "pitches", "obstacles", "undecided"];
    let count = |key: &str| right.iter().map(|verdict| verdict["counts"][key].as_u64().unwrap()).sum::<u64>();
    let counts = names.map(count);
    aloud(&format!(
        "{agreed} certificates of {all} scenes are right: {names:?} {counts:?}; {} changes refused",
        wrong.len()
    ));
    let [events, places, spans, pairs, clearances, speeds, pitches, obstacles, undecided] = counts;
    let scenes = all as u64;
    assert!(events >= scenes && places >= 5 * scenes && clearances >= scenes / 2, "{counts:?}");
    assert!(spans > 10 * scenes && pairs > 10 * scenes && undecided * 100 <= places, "{counts:?}");
    assert!(speeds > 10 * scenes && pitches >= 10 && obstacles > scenes, "{counts:?}");
}
