//! A scene as text: it is refused with a sentence, or it is played and every frame is as promised.

use bench_dragon::messages::sentence::{Figures, alert_sentence};
use bench_dragon::motion::Method;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::curve::Side;
use bench_dragon::motion::solve::Velocities;
use bench_dragon::show::convert::{Stamps, collision_alert, frame_header, stage};
use bench_dragon::show::scene::Scene;
use bench_dragon::show::{Frame, Playback, Show};
use fastrand::Rng;

use super::Target;
use super::bytes::{changed, one, renumbered};

pub const TARGET: Target = Target { name: "scene", run, seeds, mutate, cases: 5000 };

/// Most benches of a played team, and most links along a path: larger scenes take long.
const MOST_BENCHES: usize = 30;
const MOST_LINKS: f64 = 400.0;
/// Most steps of the paper's rules.
const MOST_PAPER_STEPS: f64 = 1e5;
/// Frames of a show.
const FRAMES: u64 = 40;

fn run(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    match Scene::parse(text, "fuzz.toml", "fuzz") {
        Err(error) => {
            let sentence = error.to_string();
            assert!(sentence.starts_with("fuzz.toml"), "{sentence}");
            assert!(!sentence.contains(char::is_control), "{sentence:?}");
            // Lines are counted from 1.
            let line = sentence.strip_prefix("fuzz.toml, line ").and_then(|rest| rest.split(':').next());
            let line: Option<usize> = line.map(|line| line.parse().expect("the number of a line"));
            assert!(line.is_none_or(|line| (1..=text.lines().count() + 1).contains(&line)), "{sentence}");
            check_named_line(text, &sentence, line);
            false
        }
        Ok(scene) => {
            check_ranges(text);
            if is_small(&scene) {
                play(&scene);
            }
            true
        }
    }
}

/// Asserts that a sentence about a field's number names a line with both.
fn check_named_line(text: &str, sentence: &str, line: Option<usize>) {
    let named = sentence.split_once(": ").and_then(|(_, rest)| rest.split_once(" is "));
    let Some((field, rest)) = named.filter(|_| sentence.contains(", expected a number from")) else { return };
    let line = line.expect("a number has its line");
    let on_it = text.split('\n').nth(line - 1).unwrap_or_default();
    let list = field.strip_prefix("a corner of ").and_then(|list| list.split(" of ").next());
    let field = list.unwrap_or(field).rsplit('.').next().unwrap_or_default();
    let number = rest.split(", expected").next().and_then(|number| number.parse::<f64>().ok());
    assert!(number.is_some() && on_it.contains(field), "{sentence} of {on_it:?}");
}

/// Numbers of a scene and their accepted values, by docs/design.md and the README: a table, a field, from, to.
const RANGES: [(&str, &str, f64, f64); 17] = [
    ("team", "benches", 1.0, 1e6),
    ("team", "head_length", 1e-3, 1e4),
    ("team", "body_length", 1e-3, 1e4),
    ("team", "width", 1e-3, 1e4),
    ("team", "hole_inset", 1e-3, 1e4),
    ("path", "pitch", 1e-3, 1e4),
    ("path", "start_turn", 0.0, 1e7),
    ("path", "turn_radius", 1e-3, 1e4),
    ("motion", "head_speed", 1e-9, 1e6),
    ("motion", "accuracy", 1e-18, 1e3),
    ("motion", "end_hold", 0.0, 1e6),
    ("alerts", "approach_time", 0.0, 1e9),
    ("alerts", "approach_clearance", 0.0, 1e9),
    ("publish", "rate", 0.1, 20_000.0),
    ("publish.ros2", "rate", 0.1, 20_000.0),
    ("publish", "every", 1.0, 1e6),
    ("publish", "queue", 1.0, 1e6),
];

/// Asserts that a scene which was not refused is within the ranges.
fn check_ranges(text: &str) {
    // A whole number beyond i64 is no number here; it was read as a number that no range holds.
    let Ok(scene) = text.parse::<toml::Table>() else { return };
    let number = |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|number| number as f64));
    for (table, field, least, greatest) in RANGES {
        let mut names = table.split('.');
        let of = names.next().and_then(|name| scene.get(name));
        let of = names.fold(of, |of, name| of.and_then(|of| of.get(name)));
        let number = of.and_then(|table| table.get(field)).and_then(number);
        assert!(number.is_none_or(|number| number >= least && number <= greatest), "{table}.{field} is {number:?}");
    }
    let pieces = scene["path"].get("pieces").and_then(|pieces| pieces.as_array());
    for length in pieces.into_iter().flatten().filter_map(|piece| number(piece.get("length")?)) {
        assert!((1e-3..=1e9).contains(&length), "a piece of {length} m");
    }
}

/// Returns true if a scene is played within a moment.
pub fn is_small(scene: &Scene) -> bool {
    is_within(scene, MOST_BENCHES, MOST_LINKS)
}

/// Returns true if the search and the tables take no more than a few milliseconds.
pub fn is_quick(scene: &Scene) -> bool {
    is_within(scene, 8, 40.0)
}

fn is_within(scene: &Scene, benches: usize, links: f64) -> bool {
    let motion = scene.ensemble.only().unwrap();
    let team = motion.team();
    let paper_steps = match motion.method() {
        Method::Paper(rules) => motion.path().length() / motion.head_speed() / rules.time_step,
        _ => 0.0,
    };
    team.benches <= benches
        && motion.path().length() + team.length() <= links * team.shortest_link()
        && paper_steps <= MOST_PAPER_STEPS
}

fn play(scene: &Scene) {
    let timeline = match scene.alerts {
        Some(_) => scene.ensemble.timeline(&mut unreported),
        None => scene.ensemble.timeline_without_contact(&mut unreported),
    };
    let is_searched = timeline.searched_until().is_none();
    let stop = timeline.show_end(scene.stops_at_contact()).time;
    assert!(timeline.events().iter().all(|timed| timed.time.is_finite()), "{timeline:?}");
    // Once through the whole show and a little further, whatever its length.
    let playback = Playback::of(scene);
    let time_scale = (1.1 * stop * playback.rate / FRAMES as f64).clamp(1e-6, 1e6);
    // A show that begins where it ends is refused.
    let Ok(mut show) = Show::new(scene, timeline, Playback { time_scale, ..playback }) else { return };
    let stage = stage(1, 0, [0; 32], &scene.ensemble, &show);
    let stage = stage.stage;
    let dragon = stage.first_dragon();
    let lengths = [dragon.head_length, dragon.body_length, dragon.tail_length, dragon.hole_inset];
    let widths = [dragon.head_width, dragon.width, dragon.tail_width, stage.freeze_time];
    let sizes = [lengths, widths].concat();
    assert!(sizes.iter().all(|number| number.is_finite()), "{stage:?}");
    let mut last = 0.0;
    for tick in 0..FRAMES {
        let frame = show.frame(tick);
        let looped = std::mem::replace(&mut last, frame.sim_time) > frame.sim_time;
        assert!(!looped || frame.epoch > 0, "time goes back at tick {tick}");
        check(scene, frame, is_searched);
        let header = frame_header(frame, Stamps { run_id: 1, sequence: tick, stamp_ns: 0, deadline_ns: 0 });
        let figures = Figures::Shown { time_scale: frame.time_scale };
        for alert in &frame.alerts {
            let sentence = alert_sentence(&collision_alert(&header, alert), &stage, figures);
            assert!(!sentence.contains("NaN") && !sentence.contains("inf"), "{sentence}");
        }
    }
}

/// Checks the promises about a frame.
fn check(scene: &Scene, frame: &Frame, is_searched: bool) {
    let (chain, team, tick) = (&frame.chain, scene.ensemble.only().unwrap().team(), frame.tick);
    let finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
    assert!(finite(&[frame.sim_time, frame.time_scale]), "tick {tick}: {} s", frame.sim_time);
    assert!(finite(&chain.x) && finite(&chain.y) && finite(&chain.heading), "tick {tick}: {chain:?}");
    let pi = std::f64::consts::PI;
    assert!(chain.heading.iter().all(|heading| *heading > -pi - 1e-15 && *heading <= pi), "tick {tick}: {chain:?}");
    // At a lock the speed of a handle has no bound.
    let moves = scene.velocities == Velocities::Computed;
    assert!(!moves || chain.vx.iter().chain(&chain.vy).all(|speed| !speed.is_nan()), "tick {tick}: {chain:?}");
    if scene.alerts.is_some() && team.benches >= 3 {
        assert!(frame.min_clearance.is_finite(), "tick {tick}: {} m", frame.min_clearance);
    }
    if !scene.ensemble.is_exact() {
        return;
    }
    assert!(!is_searched || frame.unsolved_frames == 0, "tick {tick}: unsolved at {} s", frame.sim_time);
    assert!(!is_searched || frame.unforeseen_contacts == 0, "tick {tick}: a contact at {} s", frame.sim_time);
    let furthest = chain.x.iter().zip(&chain.y).map(|(x, y)| x.hypot(*y)).fold(0.0, f64::max);
    for bench in 0..team.benches {
        let link = (chain.x[bench] - chain.x[bench + 1]).hypot(chain.y[bench] - chain.y[bench + 1]);
        let ulp = furthest.next_up() - furthest;
        let tolerance = 1e-12 * team.link(bench) + 4.0 * ulp + scene.ensemble.link_tolerance();
        let off = (link - team.link(bench)).abs();
        assert!(off <= tolerance, "tick {tick}, bench {bench}: off by {off:e} m, expected {tolerance:e}");
    }
}

/// Returns scenes of each kind of path, most of them very small. The cost of a case is the search for events, and a
/// table of a solver or of the clearance.
pub fn seeds() -> Vec<Vec<u8>> {
    let team = |benches: u32| {
        format!(
            "[team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.20\nwidth = 0.30\nhole_inset = 0.275\n"
        )
    };
    let spiral = "[path]\nkind = \"spiral\"\npitch = 0.9\nstart_turn = 2.0\n";
    let turnaround =
        "[path]\nkind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2\nlead_in = 2\nlead_out = 3\n";
    let line = "[path]\nkind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 4.0\n";
    let route = "[path]\nkind = \"pieces\"\nstart = [1.0, -2.0]\nheading_turns = 0.1\n[[path.pieces]]\nkind = \"line\"\n\
                 length = 2.0\n[[path.pieces]]\nkind = \"arc\"\nradius = 3.0\nside = \"left\"\nturns = 0.3\n\
                 [[path.pieces]]\nkind = \"line\"\nlength = 3.0\n";
    let newton = "[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n";
    let looping = "at_end = \"loop\"\nend_hold = 0.1\n";
    let cues = "[[cues]]\nname = \"near\"\nbefore = \"path_end\"\nseconds = 0.5\n[[cues]]\nname = \"wait\"\nat = 1.0\n\
                then = \"pause\"\n[publish]\nrate = 50.0\nprecision = \"f32\"\nevery = 3\n";
    let settings = "[publish]\nrate = 60.0\nqueue = 64\nvelocities = false\n[publish.ros2]\nrate = 30.0\n\
                    topics = [\"handles\"]\n";
    let alerts = "on_contact = \"continue\"\n[alerts]\napproach_time = 3.0\napproach_clearance = 0.05\n";
    let paper = "[motion]\nhead_speed = 1.0\nsolver = \"paper\"\n[motion.paper]\ntime_step = 0.05\n";
    [
        team(1) + line + newton,
        team(2) + line + newton + looping,
        team(3) + line + newton + cues,
        team(2) + line + newton + settings,
        team(1) + line + newton + settings,
        team(1) + spiral + newton + cues,
        team(2) + spiral + newton + looping,
        team(4) + spiral + newton,
        team(1) + turnaround + newton,
        team(2) + turnaround + newton + looping,
        team(2) + route + newton + cues,
        team(4) + route + newton,
        team(2) + line + newton + alerts,
        team(4) + route + newton + alerts,
        team(2) + spiral + paper,
        team(2) + line + "[motion]\nhead_speed = 1.0\naccuracy = 1e-4\n",
    ]
    .map(String::into_bytes)
    .to_vec()
}

/// Possible lines of a scene.
const LINES: [&str; 25] = [
    "on_contact = \"stop\"",
    "on_contact = \"continue\"",
    "at_end = \"loop\"",
    "end_hold = 0",
    "accuracy = 1e-6",
    "solver = \"newton\"",
    "solver = \"follower_table\"",
    "solver = \"paper\"",
    "[alerts]",
    "[publish]",
    "velocities = false",
    "precision = \"f32\"",
    "every = 2",
    "[[cues]]",
    "name = \"\u{9f99}\"",
    "travelled = 3.0",
    "before = \"lock\"",
    "then = \"pause\"",
    "[[path.pieces]]",
    "kind = \"arc\"",
    "side = \"right\"",
    "[publish.ros2]",
    "stamps = \"sim\"",
    "topics = [\"handles\"]",
    "lead_in = 0",
];

pub fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let Ok(text) = std::str::from_utf8(data) else { return changed(data, random) };
    let mut text = text.to_owned();
    for _ in 0..1 + random.usize(..3) {
        match random.u8(..12) {
            0 => return changed(text.as_bytes(), random),
            1 | 2 => {
                let mut lines: Vec<&str> = text.lines().collect();
                let at = random.usize(..=lines.len());
                match random.u8(..3) {
                    0 => lines.insert(at, *one(&LINES, random)),
                    1 if at < lines.len() => drop(lines.remove(at)),
                    _ if at < lines.len() => lines.insert(random.usize(..=lines.len()), lines[at]),
                    _ => (),
                }
                text = lines.join("\n") + "\n";
            }
            3 => text += &segment(random),
            _ => text = renumbered(&text, random),
        }
    }
    text.into_bytes()
}

/// Returns one more segment of a route.
fn segment(random: &mut Rng) -> String {
    let size = 10f64.powf(3.0 * random.f64() - 1.5);
    if random.bool() {
        return format!("[[path.pieces]]\nkind = \"line\"\nlength = {size}\n");
    }
    let (side, turns) = (if random.bool() { Side::Left } else { Side::Right }, 1.2 * random.f64() + 1e-3);
    let side = if side == Side::Left { "left" } else { "right" };
    format!("[[path.pieces]]\nkind = \"arc\"\nradius = {size}\nside = \"{side}\"\nturns = {turns}\n")
}
