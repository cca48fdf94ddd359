//! Certificates, checked again by a second program in another language: `tests/python/second_judge.py`, with the ball
//! arithmetic of Arb. It finds the handles itself and checks the claims, not the proof. `BENCH_DRAGON_LONG=1`: 500 scenes.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use fastrand::Rng;
use serde_json::{Value, json};

use crate::harness::{Process, aloud, can_run, json_lines, long, python, python_modules, text};

/// Random times and steps of each certificate.
const PLACES: &str = "5";

/// Returns the text of a scene: a spiral, a route or a turnaround in turn.
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
    format!(
        "name = \"scene {number}\"\n[team]\nbenches = {benches}\nhead_length = {head}\nbody_length = {body}\nwidth = \
         {width}\nhole_inset = {inset}\n[path]\n{path}\n[motion]\nhead_speed = {}\non_contact = \"continue\"\n",
        between(0.2, 3.0)
    )
}

/// Writes the certificate of a scene, and the claim about its least clearance. Returns its file, or `None` for a scene
/// that the program refuses.
fn certified(folder: &Path, name: &str, scene: &str, proves_clearance: bool) -> Option<PathBuf> {
    let (input, file) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}.jsonl")));
    std::fs::write(&input, scene).unwrap();
    let run = |arguments: &[&str]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
        Process::start(program.arg("--scene").arg(&input).arg("--quiet").args(arguments)).output_within(300)
    };
    let output = run(&["events", "--certify", file.to_str().unwrap()]);
    if output.status.code() == Some(2) {
        return None;
    }
    assert!(output.status.success(), "{name}: {}", text(&output.stderr));
    if proves_clearance {
        let output = run(&["check", "--prove", "--json"]);
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        std::fs::write(clearance_file(&file), output.stdout).unwrap();
    }
    Some(file)
}

fn clearance_file(certificate: &Path) -> PathBuf {
    format!("{}.clearance", certificate.display()).into()
}

/// Returns the judge's verdicts, in the order of the files.
fn verdicts(files: &[PathBuf]) -> Vec<Value> {
    let mut judge = python();
    judge.args(["tests/python/second_judge.py", "--places", PLACES]).args(files);
    let output = Process::start(&mut judge).output_within(if long() { 3600 } else { 600 });
    assert!(output.status.success(), "{}", text(&output.stderr));
    let verdicts = json_lines(&output);
    assert_eq!(verdicts.len(), files.len());
    verdicts
}

/// Returns the changes that make a certificate false, each with its name: of its results, its scene, and its steps.
fn changes(lines: &[Value]) -> Vec<(String, Vec<Value>)> {
    let mut changed = Vec::new();
    let mut change = |name: String, number: usize, edit: &dyn Fn(&mut Value)| {
        let mut other = lines.to_vec();
        edit(&mut other[number]);
        changed.push((name, other));
    };
    for (number, line) in lines.iter().enumerate().filter(|(_, line)| line["status"] == "proved") {
        let event = line["event"].as_str().unwrap();
        for by in [1e-6, -1e-6] {
            change(format!("{event} moved by {by} s"), number, &|line| {
                for time in ["time_lo", "time_hi"] {
                    line[time] = json!(line[time].as_f64().unwrap() + by);
                }
            });
        }
        for bench in ["bench_a", "bench_b"].into_iter().filter(|bench| line[bench].is_u64()) {
            change(format!("{bench} of the {event}"), number, &|line| {
                line[bench] = json!(line[bench].as_u64().unwrap() + 1)
            });
        }
        if event == "contact" {
            change("a contact that is none".to_owned(), number, &|line| {
                *line = json!({ "type": "result", "event": "contact", "status": "none" });
            });
        }
    }
    let scene = |from: &'static str, to: &'static str| {
        move |line: &mut Value| {
            let text = line["scene"].as_str().unwrap();
            assert_eq!(text.matches(from).count(), 1);
            line["scene"] = json!(text.replace(from, to));
        }
    };
    change("wider boards".to_owned(), 0, &scene("width = 0.30", "width = 0.31"));
    change("a longer head".to_owned(), 0, &scene("head_length = 3.41", "head_length = 3.42"));
    change("an unknown line".to_owned(), lines.len() / 2, &|line| *line = json!({ "type": "clearance" }));
    let mut moved = lines.to_vec();
    for line in moved.iter_mut().filter(|line| line["type"] == "step") {
        for end in [0, 1] {
            let coordinate = &mut line["spans"][0][end][1];
            *coordinate = json!(coordinate.as_f64().unwrap() + 0.01);
        }
    }
    changed.push(("spans of handle 1 elsewhere".to_owned(), moved));
    changed
}

#[test]
fn a_second_judge_agrees_and_refuses_what_was_changed() {
    if !can_run(python_modules(&["flint"])) {
        return;
    }
    let few = std::env::var_os("BENCH_DRAGON_CASES").is_some_and(|cases| cases == "few");
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // `long` is proved for minutes, and `ros2` is the paper's scene.
    let config: &[&str] =
        if few { &["school"] } else { &["school", "paper", "wide", "procession", "turnaround", "tight"] };
    let all = match () {
        () if few => 5,
        () if long() => 500,
        () => 50,
    };
    let wanted = all - config.len();
    let read = |name: &&str| (name.to_string(), std::fs::read_to_string(format!("config/{name}.toml")).unwrap());
    let scenes: Vec<_> = config.iter().map(read).collect();
    let random = (0..).map(|number| (format!("random{number}"), scene(number)));
    let left = Mutex::new(scenes.into_iter().chain(random).enumerate());
    let files = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while files.lock().unwrap().len() < config.len() + wanted {
                    let (number, (name, scene)) = left.lock().unwrap().next().unwrap();
                    let file = certified(folder, &name, &scene, name.starts_with("random"));
                    files.lock().unwrap().extend(file.map(|file| (number, file)));
                }
            });
        }
    });
    // The same ones, whichever thread was first.
    let mut files = files.into_inner().unwrap();
    files.sort();
    files.truncate(config.len() + wanted);
    let mut files: Vec<PathBuf> = files.into_iter().map(|(_, file)| file).collect();
    // What the judge must refuse: a certificate with a contact, a stall and a lock, changed.
    let text = std::fs::read_to_string(folder.join("school.jsonl")).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let changed = changes(&lines);
    let agreed = files.len();
    for (number, (_, lines)) in changed.iter().enumerate() {
        let file = folder.join(format!("changed{number}.jsonl"));
        std::fs::write(&file, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
        files.push(file);
    }
    // A least clearance that is too great or too small, and one of other benches.
    let claims =
        files[..agreed].iter().filter_map(|file| Some((file, std::fs::read_to_string(clearance_file(file)).ok()?)));
    let claims = claims.map(|(file, claim)| (file.clone(), serde_json::from_str::<Value>(&claim).unwrap()));
    let (file, claim) = claims.clone().find(|(_, claim)| claim["least_clearance_lo"].as_f64() > Some(1e-3)).unwrap();
    let mut claimed = Vec::new();
    for by in [1e-6, -1e-6] {
        let mut other = claim.clone();
        for end in ["least_clearance_lo", "least_clearance_hi"] {
            other[end] = json!(other[end].as_f64().unwrap() + by);
        }
        let copy = folder.join(format!("clearance{by}.jsonl"));
        std::fs::copy(&file, &copy).unwrap();
        std::fs::write(clearance_file(&copy), other.to_string()).unwrap();
        claimed.push(format!("a least clearance moved by {by} m"));
        files.push(copy);
    }
    let verdicts = verdicts(&files);
    let (right, wrong) = verdicts.split_at(agreed);
    for verdict in right {
        assert!(verdict["refused"].is_null() && verdict["undecided"].is_null(), "{verdict}");
    }
    let names = changed.iter().map(|(name, _)| name).chain(&claimed);
    for (name, verdict) in names.zip(wrong) {
        assert!(verdict["refused"].is_string(), "the judge accepts {name}: {verdict}");
    }
    let count = |key: &str| right.iter().map(|verdict| verdict["counts"][key].as_u64().unwrap()).sum::<u64>();
    let [events, places, spans, pairs, clearances, undecided] =
        ["events", "places", "spans", "pairs", "clearances", "undecided"].map(count);
    aloud(&format!(
        "{agreed} certificates: {events} events, {places} places with {pairs} pairs of boards, {spans} spans and {clearances} \
         least clearances are right; {undecided} places undecided; {} changes refused",
        wrong.len()
    ));
    let certificates = agreed as u64;
    assert!(
        events >= certificates && places >= 5 * certificates && clearances >= certificates / 2,
        "{events} {places}"
    );
    assert!(spans > 10 * certificates && pairs > 10 * certificates && undecided * 100 <= places, "{spans} {pairs}");
}
