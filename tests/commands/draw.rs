//! `draw`, as another program reads its SVG:
//!
//! - the places of boards against the handles that `solve` prints,
//! - clipping,
//! - words and marks at a time,
//! - sequences,
//! - the colours against the page's style sheet.

mod colours;
mod labels;
mod lanterns;
mod moving;
mod several;
use crate::harness;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, Output};

use bench_dragon::drawing::palette::{DARK, LIGHT, Palette};
use harness::{Process, text};
use parry2d_f64::math::{Pose, Vector};
use parry2d_f64::query::contact;
use parry2d_f64::shape::ConvexPolygon;
use roxmltree::{Document, Node};

fn program(arguments: &[&str]) -> Output {
    Process::start(Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments)).output()
}

fn answer(arguments: &[&str]) -> String {
    let output = program(arguments);
    let printed = text(&output.stderr);
    assert_eq!((output.status.code(), printed.as_str()), (Some(0), ""), "{arguments:?}");
    text(&output.stdout)
}

fn refusal(arguments: &[&str]) -> String {
    let output = program(arguments);
    let printed = text(&output.stderr);
    assert_eq!((output.status.code(), text(&output.stdout).as_str()), (Some(2), ""), "{arguments:?}: {printed}");
    printed
}

fn scene_file(name: &str) -> String {
    format!("{}/config/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Returns the corners of every board: front left, rear left, rear right, front right. The corners follow from the two
/// handles that `solve` prints and the lengths in the scene's file.
fn boards(scene: &str, time: &str) -> Vec<[[f64; 2]; 4]> {
    let file: toml::Table = std::fs::read_to_string(scene).unwrap().parse().unwrap();
    let length = |key: &str| file["team"][key].as_float().unwrap();
    let (half, inset) = (0.5 * length("width"), length("hole_inset"));
    let csv = answer(&["--scene", scene, "solve", "--at", time]);
    let handles: Vec<[f64; 2]> = csv
        .lines()
        .skip(1)
        .map(|line| {
            let row: Vec<&str> = line.split(',').collect();
            [row[2].parse().unwrap(), row[3].parse().unwrap()]
        })
        .collect();
    let board = |pair: &[[f64; 2]]| {
        let (front, rear) = (pair[0], pair[1]);
        let link = (front[0] - rear[0]).hypot(front[1] - rear[1]);
        let along = [(front[0] - rear[0]) / link, (front[1] - rear[1]) / link];
        [(front, inset, half), (rear, -inset, half), (rear, -inset, -half), (front, inset, -half)].map(
            |(handle, ahead, left)| {
                [handle[0] + ahead * along[0] - left * along[1], handle[1] + ahead * along[1] + left * along[0]]
            },
        )
    };
    handles.windows(2).map(board).collect()
}

fn with_id<'a>(svg: &'a Document, id: &str) -> Option<Node<'a, 'a>> {
    svg.descendants().find(|node| node.attribute("id") == Some(id))
}

fn number(node: &Node, attribute: &str) -> f64 {
    node.attribute(attribute).unwrap().parse().unwrap()
}

/// Returns the points of a polygon as they are written.
fn points(node: &Node) -> Vec<[f64; 2]> {
    let pairs = node.attribute("points").unwrap().split(' ');
    let pair = |pair: &str| pair.split_once(',').map(|(x, y)| [x.parse().unwrap(), y.parse().unwrap()]).unwrap();
    pairs.map(pair).collect()
}

/// Returns the boards of a picture by the number of the bench.
fn drawn(svg: &Document) -> BTreeMap<usize, Vec<[f64; 2]>> {
    let benches = with_id(svg, "benches").unwrap();
    let bench = |node: Node| Some((node.attribute("id")?.strip_prefix("bench-")?.parse().unwrap(), points(&node)));
    benches.children().filter_map(bench).collect()
}

/// Returns the frame's edges on the stage (left, bottom, right, top) in metres, from the transform and the clip path.
fn view(svg: &Document) -> [f64; 4] {
    let transform = with_id(svg, "stage").unwrap().attribute("transform").unwrap();
    let inner = transform.strip_prefix("matrix(").unwrap().trim_end_matches(')');
    let matrix: Vec<f64> = inner.split(' ').map(|number| number.parse().unwrap()).collect();
    assert_eq!((matrix[0], matrix[1], matrix[2]), (-matrix[3], 0.0, 0.0), "{transform}");
    let frame = with_id(svg, "frame").unwrap().first_element_child().unwrap();
    let [left, top, width, height] = ["x", "y", "width", "height"].map(|name| number(&frame, name));
    let metres = |x: f64, y: f64| [(x - matrix[4]) / matrix[0], (y - matrix[5]) / matrix[3]];
    let [[left, bottom], [right, top]] = [metres(left, top + height), metres(left + width, top)];
    [left, bottom, right, top]
}

fn texts(svg: &Document) -> Vec<String> {
    let words = svg.descendants().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "text")));
    words.map(|node| node.text().unwrap_or_default().trim().to_owned()).collect()
}

/// Returns true if any part of a convex board is in a rectangle, by Sutherland and Hodgman's clipping.
fn is_seen(board: &[[f64; 2]; 4], [left, bottom, right, top]: [f64; 4]) -> bool {
    let mut polygon: Vec<[f64; 2]> = board.to_vec();
    for (axis, sign, limit) in [(0, -1.0, -left), (0, 1.0, right), (1, -1.0, -bottom), (1, 1.0, top)] {
        let out = |point: &[f64; 2]| sign * point[axis] - limit;
        let mut kept = Vec::new();
        for k in 0..polygon.len() {
            let (p, q) = (polygon[k], polygon[(k + 1) % polygon.len()]);
            let (a, b) = (out(&p), out(&q));
            if a <= 0.0 {
                kept.push(p);
            }
            if (a < 0.0) != (b < 0.0) && a != b {
                kept.push([0, 1].map(|k| p[k] + (q[k] - p[k]) * a / (a - b)));
            }
        }
        polygon = kept;
    }
    !polygon.is_empty()
}

fn worst_corner(drawn: &[[f64; 2]], board: &[[f64; 2]; 4]) -> f64 {
    let away = |(one, other): (&[f64; 2], &[f64; 2])| (one[0] - other[0]).hypot(one[1] - other[1]);
    drawn.iter().zip(board).map(away).fold(0.0, f64::max)
}

#[test]
fn every_board_in_the_frame_is_drawn_where_solve_has_it_and_clipped_at_the_rim() {
    let mut at_the_rim = 0;
    for (scene, time, look) in [
        ("paper", "412.4", &["--radius", "4"][..]),
        ("paper", "contact", &["--view", "-2.5,1.25,3"]),
        ("paper", "300", &[]),
        ("turnaround", "130", &["--theme", "dark", "--no-axes", "--height", "540"]),
        ("procession", "60", &[]),
        ("procession", "60", &["--view", "16,5,6"]),
    ] {
        let scene = scene_file(scene);
        let svg = answer(&[&["--scene", &scene, "draw", "--at", time], look].concat());
        let svg = Document::parse(&svg).unwrap();
        let (boards, drawn, view) = (boards(&scene, time), drawn(&svg), view(&svg));
        for (bench, board) in boards.iter().enumerate() {
            let inside = |[x, y]: &[f64; 2]| view[0] <= *x && *x <= view[2] && view[1] <= *y && *y <= view[3];
            let corners = board.iter().filter(|corner| inside(corner)).count();
            if look.is_empty() {
                assert_eq!(corners, 4, "by default all is in the frame: bench {bench} at {time} of {scene}");
            }
            let seen = is_seen(board, view);
            at_the_rim += usize::from(seen && corners < 4);
            match drawn.get(&bench) {
                Some(points) => {
                    let worst = worst_corner(points, board);
                    assert!(points.len() == 4 && worst < 1e-6, "bench {bench} at {time} of {scene} is {worst} m off");
                }
                None => assert!(!seen, "bench {bench} at {time} of {scene} is missing"),
            }
        }
        assert!(drawn.len() <= boards.len());
        let clipped = svg.descendants().find(|node| node.attribute("clip-path") == Some("url(#frame)")).unwrap();
        let stage = with_id(&svg, "stage").unwrap();
        assert_eq!(stage.parent(), Some(clipped));
        for element in ["path", "benches", "handles"] {
            assert_eq!(with_id(&svg, element).unwrap().parent(), Some(stage), "{element}");
        }
    }
    assert!(at_the_rim > 40, "{at_the_rim} boards at the rim");
}

/// Head and tail of their own sizes, in a picture and in the sentence of `check`.
#[test]
fn a_wide_head_and_a_long_tail_are_drawn_in_their_size() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ends.toml");
    let ends = "[team]\nhead_width = 1.0\ntail_width = 0.6\ntail_length = 4.0\n";
    let turnaround = std::fs::read_to_string(scene_file("turnaround")).unwrap();
    std::fs::write(&file, turnaround.replace("[team]\n", ends)).unwrap();
    let scene = file.to_str().unwrap();
    let svg = answer(&["--scene", scene, "draw", "--at", "20"]);
    let document = Document::parse(&svg).unwrap();
    let drawn = drawn(&document);
    let last = *drawn.keys().next_back().unwrap();
    for (bench, length, width) in [(0, 3.41, 1.0), (1, 2.2, 0.3), (last - 1, 2.2, 0.3), (last, 4.0, 0.6)] {
        let [front_left, rear_left, rear_right, _] = drawn[&bench][..] else { panic!("four corners") };
        let side = |one: [f64; 2], other: [f64; 2]| (one[0] - other[0]).hypot(one[1] - other[1]);
        assert!((side(front_left, rear_left) - length).abs() < 1e-4, "bench {bench}");
        assert!((side(rear_left, rear_right) - width).abs() < 1e-4, "bench {bench}");
    }
    let said = answer(&["--scene", scene, "check"]);
    assert!(said.contains("Ends: the head is 1 m wide; the tail's board is 4 m long and 0.6 m wide."), "{said}");
}

#[test]
fn the_view_is_what_was_asked_for() {
    let close = |found: [f64; 4], expected: [f64; 4]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?}, expected {expected:?}");
    };
    let of = |arguments: &[&str]| view(&Document::parse(&answer(arguments)).unwrap());
    close(of(&["draw", "--radius", "4"]), [-4.0, -4.0, 4.0, 4.0]);
    close(of(&["draw", "--view", "1,-2,8", "--no-axes"]), [-3.0, -6.0, 5.0, 2.0]);
    close(
        of(&["draw", "--view", "1,-2,8", "--no-axes", "--width", "1600", "--height", "900"]),
        [-3.0, -4.25, 5.0, 0.25],
    );
    let court = ["draw", "--view", "14,7.5,28,15", "--no-axes"];
    close(of(&court), [0.0, 0.0, 28.0, 15.0]);
    let [width, height] = ["width", "height"].map(|side| {
        let svg = answer(&court);
        Document::parse(&svg).unwrap().root_element().attribute(side).unwrap().parse::<f64>().unwrap()
    });
    assert!((height / width - 15.0 / 28.0).abs() < 1e-3, "{width} x {height}");
    // The frame surrounds a team on a straight line, and not the origin, which is 150 m away.
    let [left, bottom, right, top] = of(&["--scene", &scene_file("procession"), "draw", "--at", "path_end"]);
    assert!(left > -20.0 && right < 80.0 && bottom > -10.0 && top > 115.0, "{left} {bottom} {right} {top}");
    for (width, height, expected) in [
        ("210mm", None, ("210mm", None)),
        ("1920px", Some("1080px"), ("1920", Some("1080"))),
        ("1600", Some("25.4mm"), ("1600", Some("96"))),
    ] {
        let height: Vec<&str> = height.map_or(Vec::new(), |height| vec!["--height", height]);
        let svg = answer(&[&["draw", "--no-axes", "--width", width], &height[..]].concat());
        let svg = Document::parse(&svg).unwrap();
        let root = svg.root_element();
        assert_eq!(root.attribute("width"), Some(expected.0));
        if let Some(height) = expected.1 {
            assert_eq!(root.attribute("height"), Some(height));
        }
        // The size of the picture has the shape of the drawn rectangle.
        let size = ["width", "height"]
            .map(|name| root.attribute(name).unwrap().trim_end_matches("mm").parse::<f64>().unwrap());
        let sheet: Vec<f64> = root.attribute("viewBox").unwrap().split(' ').map(|part| part.parse().unwrap()).collect();
        assert!((size[0] / size[1] - sheet[2] / sheet[3]).abs() < 1e-3, "{size:?} {sheet:?}");
    }
}

/// Returns the benches whose boards overlap, by parry2d.
fn overlapping(boards: &[[[f64; 2]; 4]]) -> BTreeSet<usize> {
    let polygon =
        |board: &[[f64; 2]; 4]| ConvexPolygon::from_convex_hull(&board.map(|[x, y]| Vector::new(x, y))).unwrap();
    let polygons: Vec<ConvexPolygon> = boards.iter().map(polygon).collect();
    let mut found = BTreeSet::new();
    for (i, one) in polygons.iter().enumerate() {
        for (j, other) in polygons.iter().enumerate().skip(i + 2) {
            let near = (boards[i][0][0] - boards[j][0][0]).hypot(boards[i][0][1] - boards[j][0][1]) < 8.0;
            let overlap = near.then(|| contact(&Pose::IDENTITY, one, &Pose::IDENTITY, other, 0.0).unwrap()).flatten();
            if overlap.is_some_and(|overlap| overlap.dist < -1e-6) {
                found.extend([i, j]);
            }
        }
    }
    found
}

/// Returns the benches whose boards are outlined in the colour of danger.
fn outlined(svg: &Document) -> BTreeSet<usize> {
    let red = svg.descendants().filter(|node| node.attribute("stroke") == Some(LIGHT.danger));
    let rims = red.filter(|node| node.attribute("points").is_some()).map(|node| points(&node));
    let drawn = drawn(svg);
    rims.map(|rim| *drawn.iter().find(|(_, points)| **points == rim).unwrap().0).collect()
}

#[test]
fn what_touches_or_overlaps_now_is_marked_and_what_has_happened_is_told_in_the_past_tense() {
    let paper = scene_file("paper");
    for (time, marked, present, past) in [
        ("412", BTreeSet::new(), vec![], vec![]),
        ("contact", BTreeSet::from([0, 8]), vec!["touch here"], vec![]),
        // A time as people type it.
        ("412.473838", BTreeSet::from([0, 8]), vec!["touch here"], vec![]),
        ("425", overlapping(&boards(&paper, "425")), vec![], vec!["touched here"]),
        ("lock", overlapping(&boards(&paper, "lock")), vec!["locks"], vec!["touched here", "stalled"]),
    ] {
        let svg = answer(&["draw", "--at", time]);
        let svg = Document::parse(&svg).unwrap();
        let words = texts(&svg).join("\n");
        assert_eq!(outlined(&svg), marked, "at {time}");
        for word in ["touch here", "touched here", "stalls,", "stalled", "locks,", "locked"] {
            let told = present.contains(&word.trim_end_matches(',')) || past.contains(&word);
            assert_eq!(words.contains(word), told, "{word} at {time}: {words}");
        }
        let rings = with_id(&svg, "marks").unwrap();
        let coloured = |colour: &str| {
            rings
                .children()
                .filter(|group| group.descendants().any(|node| node.attribute("stroke") == Some(colour)))
                .count()
        };
        assert_eq!((coloured(LIGHT.danger), coloured(LIGHT.quiet)), (present.len(), past.len()), "marks at {time}");
        if time == "412" {
            assert!(words.contains("contact in 0.474 s"), "{words}");
        }
        if time == "425" {
            assert!(marked.len() == 2 && !marked.contains(&8), "{marked:?}");
            assert!(words.contains("overlap now, by 0.064 m") && words.contains("boards that overlap"), "{words}");
        }
    }
}

#[test]
fn the_ring_is_where_the_boards_touch() {
    let svg = answer(&["draw", "--at", "contact", "--radius", "4"]);
    let svg = Document::parse(&svg).unwrap();
    let ring = with_id(&svg, "marks").unwrap().descendants().find(|node| node.has_tag_name("circle")).unwrap();
    let stage = with_id(&svg, "stage").unwrap().attribute("transform").unwrap();
    let matrix: Vec<f64> = stage[7..stage.len() - 1].split(' ').map(|number| number.parse().unwrap()).collect();
    let place = [(number(&ring, "cx") - matrix[4]) / matrix[0], (number(&ring, "cy") - matrix[5]) / matrix[3]];
    let events = answer(&["events", "--json"]);
    let event: serde_json::Value = serde_json::from_str(events.lines().next().unwrap()).unwrap();
    for (found, key) in place.iter().zip(["x", "y"]) {
        assert!((found - event[key].as_f64().unwrap()).abs() < 1e-4, "{place:?} {event}");
    }
}

#[test]
fn the_legend_lists_what_is_in_the_picture_and_stands_below_the_frame() {
    for (arguments, head, tail) in [
        (&["draw", "--at", "300"][..], true, true),
        (&["draw", "--at", "300", "--radius", "6"], true, false),
        (&["draw", "--at", "300", "--view", "-8,0,3"], false, false),
    ] {
        let svg = answer(arguments);
        let svg = Document::parse(&svg).unwrap();
        let legend = with_id(&svg, "legend").unwrap();
        let words: Vec<&str> = legend.descendants().filter_map(|node| node.text()).map(str::trim).collect();
        assert_eq!((words.contains(&"head"), words.contains(&"tail")), (head, tail), "{arguments:?}: {words:?}");
        assert!(
            words.iter().any(|words| words.ends_with(" m/s")) && !words.iter().any(|words| words.contains("touch"))
        );
        let frame = with_id(&svg, "frame").unwrap().first_element_child().unwrap();
        let bottom = number(&frame, "y") + number(&frame, "height");
        let height: f64 = svg.root_element().attribute("viewBox").unwrap().rsplit(' ').next().unwrap().parse().unwrap();
        for element in legend.descendants().filter(|node| node.attribute("y").is_some()) {
            assert!((bottom..height).contains(&number(&element, "y")), "{element:?}");
        }
    }
    let bare = answer(&["draw", "--at", "contact", "--no-axes"]);
    assert_eq!(texts(&Document::parse(&bare).unwrap()), Vec::<String>::new());
}

#[test]
fn people_read_what_it_is_and_no_number_of_sixteen_digits() {
    let folder = tempfile::tempdir().unwrap();
    // Characters that XML takes for markup or does not allow.
    let odd = std::fs::read_to_string(scene_file("school")).unwrap();
    let odd = odd.replacen("name = \"school\"", "name = 'a < b & \"c\" > d'", 1);
    let file = folder.path().join("odd.toml");
    std::fs::write(&file, &odd).unwrap();
    let file = file.to_str().unwrap().to_owned();
    // Every scene has a picture.
    let times = [("procession", "1"), ("tight", "stall"), ("wide", "lock"), ("ros2", "1"), ("long", "1")];
    for (name, time) in times {
        let svg = answer(&["--scene", &scene_file(name), "draw", "--at", time]);
        let svg = Document::parse(&svg).unwrap();
        assert!(texts(&svg)[..].iter().any(|words| words.starts_with(name)), "{:?}", texts(&svg));
        assert!(drawn(&svg).len() >= 20 && with_id(&svg, "path").unwrap().attribute("d").unwrap().len() > 20, "{name}");
    }
    for (scene, time, name) in [
        (scene_file("paper"), "contact", "paper at 412.474 s"),
        (scene_file("turnaround"), "path_end", "turnaround at 482.781 s"),
        (file, "0", "a < b & \"c\" > d at 0 s"),
    ] {
        let svg = answer(&["--scene", &scene, "draw", "--at", time]);
        let svg = Document::parse(&svg).unwrap();
        let [title, description] = ["title", "desc"].map(|tag| {
            let found = svg.root_element().children().find(|node| node.tag_name().name() == tag).unwrap();
            found.text().unwrap().trim().to_owned()
        });
        assert_eq!(title, name);
        assert!(description.contains("benches") && description.contains("Event: "), "{description}");
        assert!(texts(&svg).contains(&title), "{:?}", texts(&svg));
        for words in texts(&svg).iter().chain([&title, &description]) {
            let longest = words.split(|c: char| !c.is_ascii_digit()).map(str::len).max().unwrap();
            assert!(longest <= 6, "{words}");
        }
    }
}

#[test]
fn json_lines_hold_the_picture_where_no_file_is_named() {
    let line: serde_json::Value = serde_json::from_str(&answer(&["draw", "--at", "contact", "--json"])).unwrap();
    assert!((line["time"].as_f64().unwrap() - 412.473837682115).abs() < 1e-9 && line["file"].is_null());
    assert_eq!(line["svg"].as_str().unwrap().trim_end(), answer(&["draw", "--at", "contact"]).trim_end());
}
