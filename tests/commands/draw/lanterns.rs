//! The lantern look of a picture: true boards, black beyond the light, neither script nor filter.

use super::*;

#[test]
fn the_lantern_look_has_the_true_boards_and_needs_no_program() {
    for (scene, time) in [("paper", "400"), ("turnaround", "130")] {
        let scene = scene_file(scene);
        let svg = answer(&["--scene", &scene, "draw", "--at", time, "--look", "lanterns"]);
        assert!(!svg.contains("<script") && !svg.contains("filter") && !svg.contains("href=\"http"));
        assert!(svg.len() < 400_000, "{} bytes", svg.len());
        let svg = Document::parse(&svg).unwrap();
        let (boards, drawn) = (boards(&scene, time), drawn(&svg));
        assert_eq!(drawn.len(), boards.len());
        for (bench, board) in boards.iter().enumerate() {
            let worst = worst_corner(&drawn[&bench], board);
            assert!(worst < 1e-6, "bench {bench} at {time} of {scene} is {worst} m off");
        }
        let count = |id: &str| with_id(&svg, id).unwrap().children().filter(Node::is_element).count();
        let lamps = 3 * (boards.len() - 1) + 4;
        assert_eq!((count("lanterns"), count("halos"), count("dancers")), (lamps, lamps, boards.len()));
        // The last ground below the light is black, and light falls through a mask alone.
        let black = svg.descendants().filter(|node| node.attribute("fill") == Some("#000000")).count();
        assert_eq!(black, 1);
        assert_eq!(svg.descendants().filter(|node| node.attribute("mask") == Some("url(#light)")).count(), 1);
        assert_eq!(texts(&svg), Vec::<String>::new());
    }
    let printed = refusal(&["draw", "--look", "neon"]);
    assert!(printed.contains("expected plan, lanterns, seat or seat=TURNS,DISTANCE,HEIGHT"), "{printed}");
}

#[test]
fn the_look_from_a_seat_has_the_benches_in_perspective_and_needs_no_program() {
    let scene = scene_file("paper");
    let svg = answer(&["--scene", &scene, "draw", "--at", "300", "--look", "seat=0.1,40,6"]);
    assert!(!svg.contains("<script") && !svg.contains("filter") && !svg.contains("href=\"http"));
    assert!(svg.len() < 600_000, "{} bytes", svg.len());
    let svg = Document::parse(&svg).unwrap();
    let boards = boards(&scene, "300");
    // The same eye by another way: the angle from the line of sight to the board's corners, in its own axes.
    let (turn, pitch) = (0.1 * std::f64::consts::TAU, 0.6 * (5.1_f64 / 40.0).atan());
    let (sine, cosine) = turn.sin_cos();
    let middle = |axis: usize| {
        let all = || boards.iter().flatten().map(move |corner| corner[axis]);
        (0.5 * (all().fold(f64::MIN, f64::max) + all().fold(f64::MAX, f64::min))).round()
    };
    let eye = [middle(0) + 40.0 * sine, middle(1) - 40.0 * cosine];
    let ahead = [-sine * pitch.cos(), cosine * pitch.cos(), -pitch.sin()];
    let up = [-sine * pitch.sin(), cosine * pitch.sin(), pitch.cos()];
    let sheet = |corner: &[f64; 2]| {
        let ray = [corner[0] - eye[0], corner[1] - eye[1], 1.18 - 6.0];
        let dot = |axis: [f64; 3]| ray.iter().zip(axis).map(|(one, other)| one * other).sum::<f64>();
        let focus = 480.0 / 27.0_f64.to_radians().tan() / dot(ahead);
        [480.0 + focus * dot([cosine, sine, 0.0]), 270.0 - focus * dot(up)]
    };
    for (bench, board) in boards.iter().enumerate() {
        let group = with_id(&svg, &format!("bench-{bench}")).unwrap();
        let top = group.descendants().find(|node| node.tag_name().name() == "polygon").unwrap();
        let drawn: Vec<f64> =
            top.attribute("points").unwrap().split([' ', ',']).map(|number| number.parse().unwrap()).collect();
        for corner in board.iter().map(sheet) {
            let away = drawn.chunks(2).map(|at| (at[0] - corner[0]).hypot(at[1] - corner[1])).fold(f64::MAX, f64::min);
            assert!(away < 0.1, "bench {bench}: no drawn corner within {away} of {corner:?}");
        }
    }
    assert!(with_id(&svg, "head").is_some() && with_id(&svg, "tail").is_some());
    assert_eq!(texts(&svg), ["Not to scale above the boards."]);
    let printed = refusal(&["draw", "--look", "seat=0,1,4"]);
    assert!(printed.contains("a distance from 2 to 5000 m"), "{printed}");
}
