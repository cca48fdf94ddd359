//! The names of benches in a picture: each line ends on its own bench's board, and on no other.

use super::*;

/// Returns the distance from a point to a board given by its corners, metres; 0 inside the board.
fn distance(point: [f64; 2], corners: &[[f64; 2]; 4]) -> f64 {
    let [a, b, c, _] = corners;
    let (along, across) = ([a[0] - b[0], a[1] - b[1]], [b[0] - c[0], b[1] - c[1]]);
    let middle = [0.5 * (a[0] + c[0]), 0.5 * (a[1] + c[1])];
    let beyond = |side: [f64; 2]| {
        let length = side[0].hypot(side[1]);
        let away = (point[0] - middle[0]) * side[0] + (point[1] - middle[1]) * side[1];
        (away.abs() / length - 0.5 * length).max(0.0)
    };
    beyond(along).hypot(beyond(across))
}

#[test]
fn lines_lead_from_names_to_their_boards() {
    let mut named = 0;
    for (scene, time, look) in [
        ("paper", "300", &[][..]),
        ("paper", "contact", &[]),
        ("paper", "contact", &["--radius", "4"]),
        ("paper", "425", &["--radius", "4"]),
        ("paper", "lock", &["--width", "400"]),
        ("turnaround", "130", &["--theme", "dark"]),
        ("tight", "stall", &[]),
    ] {
        let scene = scene_file(scene);
        let svg = answer(&[&["--scene", &scene, "draw", "--at", time], look].concat());
        let svg = Document::parse(&svg).unwrap();
        let boards = boards(&scene, time);
        let stage = with_id(&svg, "stage").unwrap().attribute("transform").unwrap();
        let matrix: Vec<f64> = stage[7..stage.len() - 1].split(' ').map(|number| number.parse().unwrap()).collect();
        let mut plates: Vec<[f64; 4]> = Vec::new();
        for label in with_id(&svg, "labels").unwrap().children().filter(Node::is_element) {
            let bench: usize = label.attribute("class").unwrap().strip_prefix("bench-").unwrap().parse().unwrap();
            let words =
                label.descendants().filter_map(|node| node.text()).map(str::trim).find(|words| !words.is_empty());
            let line = label.children().find(|node| node.has_tag_name("line")).expect("a line");
            let end = [(number(&line, "x2") - matrix[4]) / matrix[0], (number(&line, "y2") - matrix[5]) / matrix[3]];
            let away: Vec<f64> = boards.iter().map(|board| distance(end, board)).collect();
            let own = away[bench];
            let at = format!("{words:?} at {time} of {scene}");
            assert!(own < 0.01, "{at}: the line ends {own} m from the board");
            // Boards that overlap after a contact may both be there.
            let others = away.iter().enumerate().filter(|(other, away)| *other != bench && **away < 1e-9).count();
            assert!(others == 0 || time == "425" || time == "lock", "{at}: the line ends on {others} other boards");
            assert_eq!(words.unwrap().contains("tail"), bench + 1 == boards.len() && !words.unwrap().contains("bench"));
            let plate = label.children().find(|node| node.has_tag_name("rect")).unwrap();
            let [x, y, width, height] = ["x", "y", "width", "height"].map(|side| number(&plate, side));
            for [left, top, right, bottom] in &plates {
                assert!(x > *right || x + width < *left || y > *bottom || y + height < *top, "{at}: on another name");
            }
            plates.push([x, y, x + width, y + height]);
            named += 1;
        }
    }
    assert!(named >= 15, "{named} names");
}
