//! `solve`: rows, order, bits and refusals on every scene; links and places against the numbers of the scene file.

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::solve::Chain;
use bench_dragon::show::solve_at_or_just_before;

use crate::cli::events::time_of;
use crate::cli::outline::{Outline, spiral_length};
use crate::cli::scenes::{SceneFile, assert_keys, numbers, same_bits, scene, scenes};
use crate::harness::text;

const HEADER: &str = "t,handle,x,y,heading,vx,vy,speed";

/// The handles at one time, as printed: x, y, heading, vx, vy, speed.
struct SolvedTime {
    time: f64,
    handles: Vec<[f64; 6]>,
}

/// Reads the table, and fails unless it has its header and every handle of every time in order.
fn read_csv(scene: &SceneFile, csv: &str) -> Vec<SolvedTime> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some(HEADER), "{}", scene.name);
    let mut moments: Vec<SolvedTime> = Vec::new();
    for (row, line) in lines.enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        let [time, handle, ref numbers @ ..] = fields[..] else { panic!("{line}") };
        let handle: usize = handle.parse().unwrap();
        assert_eq!(handle, row % scene.handles(), "{}: {line}", scene.name);
        let number = |field: &&str| if field.is_empty() { f64::NAN } else { field.parse().unwrap() };
        let numbers: Vec<f64> = numbers.iter().map(number).collect();
        if handle == 0 {
            moments.push(SolvedTime { time: time.parse().unwrap(), handles: Vec::new() });
        }
        let moment = moments.last_mut().unwrap();
        assert!(same_bits(time.parse().unwrap(), moment.time), "{line}");
        moment.handles.push(numbers.try_into().unwrap_or_else(|_| panic!("six numbers: {line}")));
    }
    assert!(moments.iter().all(|moment| moment.handles.len() == scene.handles()), "{}", scene.name);
    moments
}

fn read_json(scene: &SceneFile, lines: &str) -> Vec<SolvedTime> {
    let moment = |line: &str| {
        let object: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_keys(&object, &["t", "handles"]);
        let handles = object["handles"].as_array().unwrap();
        assert_eq!(handles.len(), scene.handles());
        assert!(handles.iter().all(|handle| handle.as_array().unwrap().len() == 6), "{}", scene.name);
        let numbers = numbers(line);
        let (time, rest) = (numbers[0], &numbers[1..]);
        let handles = rest.chunks(6).map(|handle| handle.try_into().unwrap());
        SolvedTime { time, handles: handles.collect() }
    };
    lines.lines().map(moment).collect()
}

/// Returns the results of the library's own solver at these times.
fn solved(scene: &SceneFile, times: &[f64]) -> Vec<SolvedTime> {
    let loaded = scene.load();
    let mut solver = loaded.ensemble.only().unwrap().solver(loaded.velocities).solver;
    let mut chain = Chain::new(scene.handles());
    let mut moment = |time: &f64| {
        solve_at_or_just_before(solver.as_mut(), *time, &mut chain).unwrap();
        let Chain { x, y, heading, vx, vy, speed } = &chain;
        let handles = (0..chain.handles()).map(|i| [x[i], y[i], heading[i], vx[i], vy[i], speed[i]]);
        SolvedTime { time: *time, handles: handles.collect() }
    };
    times.iter().map(&mut moment).collect()
}

fn assert_same(scene: &SceneFile, printed: &[SolvedTime], expected: &[SolvedTime]) {
    assert_eq!(printed.len(), expected.len(), "{}", scene.name);
    for (a, b) in printed.iter().zip(expected) {
        assert!(same_bits(a.time, b.time), "{}: {} and {} s", scene.name, a.time, b.time);
        assert_eq!(a.handles.len(), b.handles.len(), "{}", scene.name);
        for (handle, (a, b)) in a.handles.iter().zip(&b.handles).enumerate() {
            assert!(a.iter().zip(b).all(|(a, b)| same_bits(*a, *b)), "{}, handle {handle}: {a:?} {b:?}", scene.name);
        }
    }
}

/// Returns times not in order, one of them twice, and every event of this scene by its name.
fn times(scene: &SceneFile) -> (String, Vec<f64>) {
    let timeline = scene.load().ensemble.timeline(&mut unreported);
    let mut times = vec![("1.25".to_owned(), 1.25), ("0".to_owned(), 0.0), ("1.25".to_owned(), 1.25)];
    times.extend(timeline.events().iter().map(|timed| (timed.event.kind.name().to_owned(), timed.time)));
    times.push(("1e-3".to_owned(), 1e-3));
    let (words, numbers): (Vec<_>, Vec<_>) = times.into_iter().unzip();
    (words.join(","), numbers)
}

#[test]
fn solve_prints_the_bits_of_the_solver_in_the_order_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for scene in scenes() {
        let (words, times) = times(&scene);
        let expected = solved(&scene, &times);
        let csv = scene.answer(&["solve", "--at", &words]);
        assert_same(&scene, &read_csv(&scene, &csv), &expected);
        let json = scene.answer(&["solve", "--at", &words, "--json"]);
        assert_same(&scene, &read_json(&scene, &json), &expected);
        let file = folder.path().join("table.csv");
        assert_eq!(scene.answer(&["solve", "--at", &words, "-o", file.to_str().unwrap()]), "", "{}", scene.name);
        assert!(std::fs::read_to_string(&file).unwrap() == csv, "{}: -o writes something else", scene.name);
    }
}

#[test]
fn without_velocities_their_fields_are_empty_and_null() {
    let folder = tempfile::tempdir().unwrap();
    for scene in scenes() {
        let scene = scene.with(&folder, "publish", "velocities", false);
        let csv = scene.answer(&["solve", "--at", "0,1"]);
        assert!(csv.lines().skip(1).all(|line| line.ends_with(",,,") && !line.contains("NaN")), "{}", scene.name);
        let moments = read_csv(&scene, &csv);
        assert_same(&scene, &moments, &solved(&scene, &[0.0, 1.0]));
        let lines = scene.answer(&["--json", "solve", "--at", "0,1"]);
        assert_eq!(lines.matches("null").count(), 2 * 3 * scene.handles());
        assert_same(&scene, &read_json(&scene, &lines), &moments);
    }
}

/// Returns the promised accuracy of a position, metres.
fn promise(scene: &SceneFile, [x, y, ..]: &[f64; 6], time: f64) -> f64 {
    let travelled = scene.number("motion", "head_speed") * time;
    1e-12 + 8.0 * f64::EPSILON * (x.hypot(*y) + travelled)
}

/// Links, headings and velocities agree with the numbers of the file, and every handle is on the path that these
/// describe.
#[test]
fn handles_stand_on_the_path_a_link_apart() {
    for scene in scenes() {
        let (words, _) = times(&scene);
        let outline = Outline::of(&scene);
        for SolvedTime { time, handles } in read_csv(&scene, &scene.answer(&["solve", "--at", &words])) {
            for (i, handle) in handles.iter().enumerate() {
                let [x, y, heading, vx, vy, speed] = *handle;
                let who = format!("{} at {time} s, handle {i}", scene.name);
                let off = outline.distance([x, y]);
                assert!(off <= promise(&scene, handle, time), "{who} is {off:e} m off the path");
                assert!(heading > -std::f64::consts::PI && heading <= std::f64::consts::PI, "{who} heads {heading}");
                assert!((vx.hypot(vy) - speed.abs()).abs() <= 1e-12 * speed.abs(), "{who}: {handle:?}");
                // A handle leads the bench behind it; the last handle has the direction of the last bench.
                let bench = i.min(scene.benches() - 1);
                let (front, rear) = (handles[bench], handles[bench + 1]);
                let (dx, dy) = (front[0] - rear[0], front[1] - rear[1]);
                let radius = rear[0].hypot(rear[1]);
                let slack = 1e-12 * scene.link(bench) + 4.0 * (radius.next_up() - radius);
                let length = dx.hypot(dy);
                assert!((length - scene.link(bench)).abs() <= slack, "{who}: its link is {length} m");
                let turned = (heading - dy.atan2(dx)).rem_euclid(std::f64::consts::TAU);
                assert!(
                    turned.min(std::f64::consts::TAU - turned) < 1e-10,
                    "{who} heads {heading}, not along its bench"
                );
            }
        }
    }
}

/// On a spiral the follower is the first point outward: the path between two handles is hardly longer than their link.
/// Any later point at that distance is most of a turn further.
#[test]
fn followers_on_a_spiral_are_the_first_points_at_their_distance() {
    let mut compared = 0;
    for scene in scenes().into_iter().filter(|scene| scene.content["path"]["kind"].as_str() == Some("spiral")) {
        let radius_per_radian = scene.number("path", "pitch") / std::f64::consts::TAU;
        let end = scene.json(&["events"]).pop().unwrap()["time"].as_f64().unwrap();
        let times = format!("0,{},{}", 0.5 * end, 0.9 * end);
        for SolvedTime { time, handles } in read_csv(&scene, &scene.answer(&["solve", "--at", &times])) {
            let lengths =
                handles.iter().map(|[x, y, ..]| spiral_length(radius_per_radian, x.hypot(*y) / radius_per_radian));
            let lengths: Vec<f64> = lengths.collect();
            for (bench, pair) in lengths.windows(2).enumerate() {
                let (apart, link) = (pair[1] - pair[0], scene.link(bench));
                assert!(
                    apart >= link * 0.999_999 && apart < 2.0 * link,
                    "{} at {time} s, {bench}: {apart} m",
                    scene.name
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 10_000, "{compared} links");
}

/// The head at places whose arc length has a closed form: junctions, and angles of a spiral.
#[test]
fn the_head_is_where_its_way_along_the_path_ends() {
    for scene in scenes() {
        let outline = Outline::of(&scene);
        let end = time_of(&scene, EventKind::Lock).or(time_of(&scene, EventKind::PathEnd)).unwrap();
        let time_of_way = |way: f64| way / scene.number("motion", "head_speed");
        let known: Vec<_> = outline.known.iter().filter(|(way, _)| time_of_way(*way) <= end).collect();
        assert!(known.len() >= 3, "{}: only {} places", scene.name, known.len());
        let words: Vec<String> = known.iter().map(|(way, _)| time_of_way(*way).to_string()).collect();
        let moments = read_csv(&scene, &scene.answer(&["solve", "--at", &words.join(",")]));
        for (moment, (way, [x, y])) in moments.iter().zip(known) {
            let head = &moment.handles[0];
            let off = (head[0] - x).hypot(head[1] - y);
            // The distance here is rounded too.
            assert!(off <= 4.0 * promise(&scene, head, moment.time), "{}: {off:e} m off after {way} m", scene.name);
            let speed = scene.number("motion", "head_speed");
            assert!((head[5] - speed).abs() <= 1e-9 * speed, "{}: {head:?}", scene.name);
        }
    }
}

/// Returns a time as sentences for people print it.
fn figure(time: f64) -> String {
    format!("{time:.9}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[test]
fn a_time_past_the_end_is_refused_with_the_event_and_its_time() {
    let folder = tempfile::tempdir().unwrap();
    for scene in scenes() {
        let end = scene.json(&["events"]).pop().unwrap();
        let (kind, time) = (end["event"].as_str().unwrap(), end["time"].as_f64().unwrap());
        let file = folder.path().join(format!("{}.csv", scene.name));
        for past in [format!("{}", time * 1.001), format!("0,{}", time + 1e6)] {
            for format in [&["solve"][..], &["solve", "--json"], &["draw"]] {
                // A picture shows one time.
                let past = if format[0] == "draw" { past.trim_start_matches("0,") } else { &past };
                let output = ["-o", file.to_str().unwrap()];
                for arguments in [[format, &["--at", past]].concat(), [format, &["--at", past], &output].concat()] {
                    let printed = scene.refusal(&arguments);
                    assert!(printed.contains(kind) && printed.contains(&figure(time)), "{}: {printed}", scene.name);
                    assert!(!file.exists(), "{arguments:?} leaves a file");
                }
            }
        }
        for kind in ["contact", "stall", "lock", "path_end"] {
            if !scene.json(&["events"]).iter().any(|event| event["event"] == kind) {
                let printed = scene.refusal(&["solve", "--at", kind]);
                assert!(printed.contains(kind), "{}: {printed}", scene.name);
            }
        }
    }
}

#[test]
fn regular_times_are_from_plus_k_every_and_until_is_inclusive() {
    for scene in scenes().iter().filter(|scene| scene.benches() < 1000) {
        for (arguments, from, every, rows) in [
            (&["--every", "0.25", "--until", "1"][..], 0.0, 0.25, 5),
            (&["--from", "0.1", "--every", "0.1", "--until", "0.3"], 0.1, 0.1, 3),
            (&["--from", "0.5", "--every", "0.3", "--until", "1"], 0.5, 0.3, 2),
            (&["--every", "7", "--until", "6.9"], 0.0, 7.0, 1),
        ] {
            let times: Vec<f64> = (0..rows).map(|k| from + f64::from(k) * every).collect();
            let csv = scene.answer(&[&["solve"], arguments].concat());
            assert_same(scene, &read_csv(scene, &csv), &solved(scene, &times));
        }
    }
}

#[test]
fn regular_times_past_the_end_stop_at_the_last_row_before_it_and_say_so() {
    for scene in scenes() {
        let end = scene.json(&["events"]).pop().unwrap();
        let (kind, time) = (end["event"].as_str().unwrap(), end["time"].as_f64().unwrap());
        let every = time / 7.5;
        let (every, until) = (every.to_string(), (2.0 * time).to_string());
        for format in [&["solve"][..], &["--json", "solve"]] {
            let output = scene.run(&[format, &["--every", &every, "--until", &until]].concat());
            let printed = text(&output.stderr);
            assert_eq!(output.status.code(), Some(0), "{}: {printed}", scene.name);
            assert!(printed.contains(kind) && printed.contains(&figure(time)), "{}: {printed}", scene.name);
            assert_eq!(printed.lines().count(), 1, "{printed}");
            let stdout = text(&output.stdout);
            let printed = if format.len() == 1 { read_csv(&scene, &stdout) } else { read_json(&scene, &stdout) };
            let every: f64 = every.parse().unwrap();
            let expected: Vec<f64> = (0..8).map(|k| f64::from(k) * every).collect();
            assert_eq!(printed.iter().map(|moment| moment.time).collect::<Vec<_>>(), expected, "{}", scene.name);
        }
    }
}

#[test]
fn every_way_to_ask_for_times_that_makes_no_sense_is_refused() {
    let scene = scene("school");
    for (arguments, named) in [
        (&["--at", "1", "--every", "1", "--until", "2"][..], "--every"),
        (&["--at", "1", "--from", "1"], "--from"),
        (&["--from", "1", "--until", "2"], "--"),
        (&["--from", "3", "--every", "1", "--until", "2"], "--until"),
        (&["--from", "-1", "--every", "1", "--until", "2"], "--from"),
        (&["--at", "1,,2"], "--at"),
    ] {
        let output = scene.run(&[&["solve"], arguments].concat());
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        assert!(output.stdout.is_empty() && printed.contains(named), "{arguments:?}: {printed}");
    }
}
