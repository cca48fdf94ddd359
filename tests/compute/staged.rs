//! Certificates of scenes with obstacles: the checker accepts them, they agree with the ordinary search, and a
//! certificate of a changed scene is refused.
//!
//! `BENCH_DRAGON_ALL=1` makes 200 scenes in place of 40, `BENCH_DRAGON_LONG=1` 5,000.

use std::fmt::Write;

use bench_dragon::certify::{CertificateLine, certify};
use bench_dragon::messages::state::EventKind as Kind;
use bench_dragon::motion::event::unreported;
use bench_dragon::proof::{EventKind, Proved, Refused, Status, verify};
use bench_dragon::show::scene::Scene;
use fastrand::Rng;

use crate::harness;

const MOST_STEPS: u64 = 3000;

/// Returns the lines of a certificate.
fn certificate(text: &str, scene: &Scene) -> String {
    let timeline = scene.ensemble.timeline(&mut unreported);
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| line.write(&mut lines);
    certify(&scene.ensemble, &timeline, text, MOST_STEPS, &mut write, &mut unreported).unwrap();
    String::from_utf8(lines).unwrap()
}

fn check(lines: &str) -> Result<Proved, Refused> {
    verify(lines.as_bytes(), &mut |_| ())
}

/// Has a certificate checked, and compares its results for the obstacles with the ordinary search. Returns their
/// statuses.
fn statuses(text: &str) -> Vec<Status> {
    let scene = Scene::parse(text, "staged", "staged").unwrap_or_else(|error| panic!("{error}\n{text}"));
    let proved = check(&certificate(text, &scene)).unwrap_or_else(|refused| panic!("{refused}\n{text}"));
    let timeline = scene.ensemble.timeline(&mut unreported);
    let obstacles = scene.ensemble.ground().obstacles();
    let results = &proved.results[4..];
    assert_eq!(results.len(), obstacles.len());
    for (number, (result, obstacle)) in results.iter().zip(obstacles).enumerate() {
        assert_eq!((result.event, result.obstacle), (EventKind::Obstacle, Some(number)));
        let found = timeline.events().iter().find(|timed| {
            timed.event.kind == Kind::Obstacle
                && scene.ensemble.obstacle_of(&timed.event).unwrap().name == obstacle.name
        });
        match (result.status, found) {
            (Status::Proved, Some(timed)) => {
                let (lo, hi) = (result.time_lo.unwrap(), result.time_hi.unwrap());
                let slack = 1e-9 + 1e-12 * timed.time;
                assert!(lo - slack <= timed.time && timed.time <= hi + slack, "{result:?} {timed:?}\n{text}");
            }
            (Status::None, None) | (Status::Undecided, _) => {}
            (_, found) => panic!("{result:?} {found:?}\n{text}"),
        }
    }
    results.iter().map(|result| result.status).collect()
}

fn number(random: &mut Rng, low: f64, high: f64) -> f64 {
    ((low + (high - low) * random.f64()) * 1000.0).round() / 1000.0
}

/// Returns a scene of a short team on a short route, with obstacles about it.
pub fn random_scene(random: &mut Rng) -> String {
    let (benches, width) = (1 + random.usize(..5), number(random, 0.1, 0.4));
    let start = [number(random, -3.0, 3.0), number(random, -3.0, 3.0)];
    let mut text = format!(
        "[team]\nbenches = {benches}\nhead_length = 2.2\nbody_length = 1.6\nwidth = {width}\nhole_inset = 0.2\n\
         [motion]\nhead_speed = {}\n[path]\nkind = \"pieces\"\nstart = {start:?}\nheading_turns = {}\npieces = [",
        number(random, 0.5, 2.0),
        number(random, 0.0, 1.0)
    );
    for _ in 0..1 + random.usize(..4) {
        let side = ["left", "right"][random.usize(..2)];
        let (length, turns) = (number(random, 0.5, 6.0), number(random, 0.05, 0.6));
        let radius = number(random, 1.5, 5.0);
        let _ = match random.bool() {
            true => write!(text, "{{ kind = \"line\", length = {length} }}, "),
            false => write!(text, "{{ kind = \"arc\", radius = {radius}, side = \"{side}\", turns = {turns} }}, "),
        };
    }
    text.push_str("]\n");
    if random.bool() {
        let origin = [number(random, -5.0, 5.0), number(random, -5.0, 5.0)];
        let (turns, mirror) = (number(random, 0.0, 1.0), random.bool());
        let _ = write!(text, "[placement]\norigin = {origin:?}\nrotation_turns = {turns}\nmirror = {mirror}\n");
    }
    text.push_str("[stage]\n");
    if random.bool() {
        let _ = writeln!(text, "boundary = {{ polygon = [[-14, -12], [0, -8], [15, -13], [13, 14], [-12, 11]] }}");
    }
    for index in 0..1 + random.usize(..4) {
        let [x, y] = [number(random, -10.0, 10.0), number(random, -10.0, 10.0)];
        let size = number(random, 0.1, 1.5);
        let _ = writeln!(text, "[[stage.obstacles]]\nname = \"obstacle {index}\"");
        let _ = match random.u8(..3) {
            0 => writeln!(text, "circle = {{ center = [{x}, {y}], radius = {size} }}"),
            1 => writeln!(text, "line = [[{x}, {y}], [{}, {y}], [{}, {}]]", x + size, x + size, y + 2.0 * size),
            // A polygon with a corner that points inwards.
            _ => writeln!(
                text,
                "polygon = [[{x}, {y}], [{}, {y}], [{}, {}], [{}, {}], [{x}, {}]]",
                x + 2.0 * size,
                x + 2.0 * size,
                y + 2.0 * size,
                x + size,
                y + 0.5 * size,
                y + 2.0 * size
            ),
        };
        if random.bool() {
            let _ = writeln!(text, "keep_out = {}", number(random, 0.05, 1.0));
        }
    }
    text
}

#[test]
fn certificates_of_the_example_scenes_with_a_stage_are_accepted() {
    let mut tried = 0;
    for entry in std::fs::read_dir("config").unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        if text.contains("\n[stage]") {
            let statuses = statuses(&text);
            println!("{}: {statuses:?}", path.display());
            assert!(!statuses.contains(&Status::Undecided), "{}", path.display());
            tried += 1;
        }
    }
    assert!(tried > 0);
}

#[test]
fn certificates_of_random_scenes_with_obstacles_are_accepted() {
    let count = harness::cases(40, 200, 5000);
    let mut counts = [0; 3];
    for index in 0..count {
        for status in statuses(&random_scene(&mut Rng::with_seed(0x57a6e + index))) {
            counts
                [[Status::Proved, Status::None, Status::Undecided].iter().position(|kind| *kind == status).unwrap()] +=
                1;
        }
    }
    println!("{count} scenes: proved, none, undecided: {counts:?}");
    let [proved, none, undecided] = counts;
    assert!(proved * 4 > count && none * 4 > count && undecided * 50 < proved + none, "{counts:?}");
}

/// A certificate proves nothing of a scene with another obstacle, and every changed claim is refused.
#[test]
fn changed_certificates_of_a_scene_with_obstacles_are_refused() {
    let text = "[team]\nbenches = 4\nhead_length = 2.2\nbody_length = 1.6\nwidth = 0.3\nhole_inset = 0.2\n\
                [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 4.0 }, \
                { kind = \"arc\", radius = 4.0, side = \"left\", turns = 0.3 }]\n[stage]\n\
                boundary = { polygon = [[-12, -4], [9, -4], [9, 9], [-12, 9]] }\n[[stage.obstacles]]\n\
                name = \"lamp\"\ncircle = { center = [6.0, 1.5], radius = 0.25 }\nkeep_out = 0.5\n\
                [[stage.obstacles]]\nname = \"wall\"\nline = [[0.0, 1.25], [3.0, 1.25]]\n";
    let scene = Scene::parse(text, "changed", "changed").unwrap();
    let lines = certificate(text, &scene);
    let proved = check(&lines).unwrap();
    let statuses: Vec<Status> = proved.results[4..].iter().map(|result| result.status).collect();
    assert_eq!(statuses, [Status::Proved, Status::None, Status::None]);
    let changes = [
        // The scene: a wider lamp, a lamp or wall elsewhere, a smaller boundary, another keep-out, another placement.
        ("radius = 0.25", "radius = 0.3"),
        ("center = [6.0, 1.5]", "center = [5.9, 1.5]"),
        ("line = [[0.0, 1.25], [3.0, 1.25]]", "line = [[0.0, 1.25], [3.0, 0.1]]"),
        ("[9, 9], [-12, 9]", "[6, 9], [-12, 9]"),
        ("keep_out = 0.5", "keep_out = 0.6"),
        ("[stage]", "[placement]\\norigin = [0.5, 0.0]\\n[stage]"),
        ("[stage]", "[placement]\\nmirror = true\\n[stage]"),
        // Claims that continue beyond the touch, a bench that is clear of it, and another obstacle.
        ("\"free\":[1,2]", "\"free\":[0,1,2]"),
        ("\"free\":[0,1,2]", "\"free\":[0,1]"),
        ("\"type\":\"witness\",\"obstacle\":0,\"benches\":[0]", "\"type\":\"witness\",\"obstacle\":1,\"benches\":[0]"),
        (
            "\"event\":\"obstacle\",\"obstacle\":1,\"status\":\"none\"",
            "\"event\":\"obstacle\",\"obstacle\":1,\"status\":\"proved\"",
        ),
        ("\"event\":\"obstacle\",\"obstacle\":2", "\"event\":\"obstacle\",\"obstacle\":1"),
    ];
    for (from, to) in changes {
        let changed = lines.replacen(from, to, 1);
        assert_ne!(changed, lines, "{from}");
        assert!(check(&changed).is_err(), "{from} -> {to}");
    }
    let (lo, hi) = (proved.results[4].time_lo.unwrap(), proved.results[4].time_hi.unwrap());
    assert!(hi - lo <= 1e-9, "{lo} {hi}");
    for changed in [lines.replacen(&format!("{lo:?}"), &format!("{:?}", lo + 1e-8), 1), {
        let hi_text = format!("\"time_hi\":{hi:?}");
        lines.replacen(&hi_text, &format!("\"time_hi\":{:?}", hi - 1e-8), 1)
    }] {
        assert_ne!(changed, lines);
        assert!(check(&changed).is_err());
    }
}
