//! Sequences of pictures, and animated pictures.

use super::*;

#[test]
fn pictures_of_a_sequence_have_one_camera_and_true_times() {
    let folder = tempfile::tempdir().unwrap();
    let pattern = folder.path().join("%03d.svg");
    let pattern = pattern.to_str().unwrap();
    let arguments = ["draw", "--every", "2.5", "--from", "405", "--until", "contact", "-o", pattern, "--json"];
    let lines: Vec<serde_json::Value> =
        answer(&arguments).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    let mut cameras = BTreeSet::new();
    let paper = scene_file("paper");
    for (line, (file, time)) in lines.iter().zip([("000.svg", 405.0), ("001.svg", 407.5), ("002.svg", 410.0)]) {
        let file = folder.path().join(file);
        assert_eq!((line["time"].as_f64(), line["file"].as_str()), (Some(time), file.to_str()));
        assert!(line["svg"].is_null());
        let svg = std::fs::read_to_string(&file).unwrap();
        let svg = Document::parse(&svg).unwrap();
        let stage = with_id(&svg, "stage").unwrap().attribute("transform").unwrap();
        let speeds = texts(&svg).into_iter().find(|words| words.ends_with(" m/s")).unwrap();
        cameras.insert((svg.root_element().attribute("viewBox").unwrap().to_owned(), stage.to_owned(), speeds));
        assert!(texts(&svg).contains(&format!("paper at {time} s")), "{:?}", texts(&svg));
        let (drawn, boards) = (drawn(&svg), boards(&paper, &time.to_string()));
        assert_eq!(drawn.len(), boards.len());
        assert!(boards.iter().enumerate().all(|(bench, board)| worst_corner(&drawn[&bench], board) < 1e-6));
    }
    assert_eq!(cameras.len(), 1, "{cameras:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    let refused = refusal(&["draw", "--every", "1", "--until", "3", "-o", "picture.svg"]);
    assert!(refused.contains("%05d") && !Path::new("picture.svg").exists(), "{refused}");
    for (arguments, word) in [
        (&["draw", "--every", "0", "--until", "3", "-o", pattern][..], "--every is 0"),
        (&["draw", "--every", "1", "--from", "5", "--until", "3", "-o", pattern], "--until is before --from"),
        (&["draw", "--every", "1e-9", "--until", "3", "-o", pattern], "expected at most"),
        (&["draw", "--every", "1", "--until", "1e4", "-o", pattern], "--until 1e4: the motion ends"),
        (&["draw", "--every", "1", "--until", "3", "--animated", "--theme", "auto"], "--theme auto"),
        (&["draw", "--view", "1,2"], "--view"),
        (&["draw", "--width", "0"], "--width"),
        (&["draw", "--theme", "blue"], "--theme"),
    ] {
        let refused = refusal(arguments);
        assert!(refused.contains(word), "{arguments:?}: {refused}");
    }
}

/// Returns the values of an animation of an element's first child of a kind.
fn values<'a>(node: &Node<'a, '_>, kind: &str) -> Vec<&'a str> {
    let of_kind = |node: &Node| node.attribute("type") == Some(kind);
    let animation = node.descendants().find(of_kind).unwrap();
    animation.attribute("values").unwrap().split(';').collect()
}

#[test]
fn a_picture_that_moves_begins_and_ends_where_solve_has_the_boards() {
    let svg =
        answer(&["draw", "--animated", "--every", "0.5", "--from", "408", "--until", "contact", "--theme", "dark"]);
    let svg = Document::parse(&svg).unwrap();
    let paper = scene_file("paper");
    let mut colours = BTreeSet::new();
    for (time, last) in [("408", false), ("contact", true)] {
        for (bench, board) in boards(&paper, time).iter().enumerate() {
            let group = with_id(&svg, &format!("bench-{bench}")).unwrap();
            let (places, angles) = (values(&group, "translate"), values(&group, "rotate"));
            // There are 9 steps of half a second, and 4 s at the end.
            assert_eq!((places.len(), angles.len()), (19, 19));
            let at = |values: &[&str]| values[if last { values.len() - 1 } else { 0 }].to_owned();
            let place = at(&places);
            let (x, y) =
                place.split_once(' ').map(|(x, y)| (x.parse::<f64>().unwrap(), y.parse::<f64>().unwrap())).unwrap();
            let centre = [0, 1].map(|k| board.iter().map(|corner| corner[k]).sum::<f64>() / 4.0);
            assert!(
                (x - centre[0]).hypot(y - centre[1]) < 0.01,
                "bench {bench} at {time}: {place}, expected {centre:?}"
            );
            let heading = (board[0][1] - board[1][1]).atan2(board[0][0] - board[1][0]);
            let angle: f64 = at(&angles).parse().unwrap();
            let off = (angle.to_radians() - heading).sin().hypot((angle.to_radians() - heading).cos() - 1.0);
            assert!(off < 2e-3, "bench {bench} at {time} is turned by {angle}");
            if last {
                // A viewer without animation shows the last time.
                assert_eq!(group.attribute("transform"), Some(format!("translate({place})").as_str()));
                let fill = group.descendants().find_map(|node| node.attribute("fill").filter(|fill| *fill != "none"));
                colours.insert(fill.unwrap().to_owned());
            }
        }
    }
    // On the scale of the page the speeds of the paper's scene are within a few shades.
    assert!(colours.len() > 3, "{colours:?}");
    let turns = values(&with_id(&svg, "bench-100").unwrap(), "rotate");
    let turns: Vec<f64> = turns.iter().map(|angle| angle.parse().unwrap()).collect();
    assert!(turns.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 20.0), "no board spins round: {turns:?}");
    let words = texts(&svg);
    for expected in ["contact in", "5 s", "1 s", "CONTACT", "benches 1 and 9"] {
        assert!(words.iter().any(|words| words == expected), "{expected}: {words:?}");
    }
}
