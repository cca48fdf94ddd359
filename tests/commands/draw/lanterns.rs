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
    assert!(printed.contains("expected plan or lanterns"), "{printed}");
}
