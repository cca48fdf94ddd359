//! The facts about a scene that the page of `view` shows and that no publisher sends: whether the scene loops, and its
//! clearance over the whole show. In: the text of a scene. Out: facts for `outputs`, computed once for each scene.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use bench_dragon::motion::event::unreported;
use bench_dragon::motion::timeline::{TimedEvent, Timeline};
use bench_dragon::outputs::view::{ClearanceCurve, LeastOfShow, SceneFacts};
use bench_dragon::show::curve::clearance_curve;
use bench_dragon::show::scene::{AtEnd, Scene};

/// The time after which no curve is shown: a page does not wait for a team of a million benches.
const PATIENCE: Duration = Duration::from_secs(60);

/// Returns the facts about the scene with this text; `None` for a text that is no scene.
pub fn scene_facts(text: &str) -> Option<SceneFacts> {
    let scene = Scene::parse(text, "the scene of the show", "show").ok()?;
    let loop_stand = (scene.at_end == AtEnd::Loop).then_some(scene.end_hold);
    Some(SceneFacts { loop_stand, clearance: clearance(&scene) })
}

/// Returns the clearance over the show: of boards, and of boards and obstacles. `None` for fewer than three benches on
/// empty ground, where a search gave up, or where it takes too long.
fn clearance(scene: &Scene) -> Option<ClearanceCurve> {
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show_end = *timeline.show_end(scene.stops_at_contact());
    let least = least(scene, &timeline, &show_end)?;
    let patience = Instant::now() + PATIENCE;
    let mut progress = |_| if Instant::now() > patience { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let points = clearance_curve(scene, &timeline, show_end.time, [least.time, least.clearance], &mut progress)?;
    Some(ClearanceCurve { points, least })
}

/// Returns the least clearance of the show; `None` if a search gave up.
fn least(scene: &Scene, timeline: &Timeline, show_end: &TimedEvent) -> Option<LeastOfShow> {
    let mut silent = unreported;
    let boards = scene.ensemble.least_clearances(timeline, show_end, &mut silent);
    let obstacles = scene.ensemble.obstacle_clearances(show_end, &mut silent);
    let is_whole = boards.is_complete
        && obstacles.len() == scene.ensemble.ground().obstacles().len()
        && obstacles.iter().all(|found| found.searched_until.is_none());
    let of_boards = boards.of_show.map(|found| LeastOfShow {
        time: found.time,
        clearance: found.least.value,
        bench_a: found.least.bench_a,
        bench_b: found.least.bench_b,
    });
    let of_obstacles = obstacles.iter().map(|found| LeastOfShow {
        time: found.time,
        clearance: found.least.value,
        bench_a: found.least.bench,
        // Obstacles follow the handles.
        bench_b: (scene.ensemble.handles() + found.obstacle) as u32,
    });
    let all = of_boards.into_iter().chain(of_obstacles).filter(|_| is_whole);
    all.min_by(|one, other| one.clearance.total_cmp(&other.clearance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_of_the_paper_ends_at_its_contact() {
        let text = bench_dragon::show::scene::SceneText::paper().text;
        let facts = scene_facts(&text).unwrap();
        assert_eq!(facts.loop_stand, None);
        let ClearanceCurve { points, least } = facts.clearance.unwrap();
        assert!((least.time - 412.473837682115).abs() < 1e-9 && least.clearance.abs() < 1e-9, "{least:?}");
        assert_eq!((least.bench_a, least.bench_b), (0, 8));
        assert!(points.is_sorted_by(|one, other| one[0] <= other[0]), "in order of time");
        assert!(points[0][0] == 0.0 && (points[points.len() - 1][0] - least.time).abs() < 1e-9, "the whole show");
        // Boards 0.3 m wide on turns 0.55 m apart, less what straight boards take of a bend.
        assert!(points.iter().all(|&[_, metres]| (-1e-9..0.25).contains(&metres)));
        assert!(points[0][1] > 0.15, "far from a contact at the start: {:?}", points[0]);
    }

    #[test]
    fn the_curve_of_two_dragons_ends_at_their_contact() {
        let facts = scene_facts(include_str!("../../config/coil.toml")).unwrap();
        let ClearanceCurve { points, least } = facts.clearance.unwrap();
        assert!((least.time - 335.726813723).abs() < 1e-8 && least.clearance.abs() < 1e-9, "{least:?}");
        // The head of jade has the number 61.
        assert_eq!((least.bench_a, least.bench_b), (0, 61));
        assert!(points.iter().all(|&[_, metres]| (-1e-9..1.2).contains(&metres)));
    }

    #[test]
    fn the_curve_of_the_square_has_its_obstacles() {
        let facts = scene_facts(include_str!("../../config/square.toml")).unwrap();
        let ClearanceCurve { points, least } = facts.clearance.unwrap();
        // The northern spectators are the fourth obstacle; 21 handles come before.
        assert_eq!((least.bench_a, least.bench_b), (0, 24), "{least:?}");
        assert!((0.0..0.2).contains(&least.clearance), "it just fits: {least:?}");
        assert!(points.iter().all(|&[_, metres]| metres > least.clearance - 1e-12));
    }

    #[test]
    fn a_scene_that_loops_stands_as_long_as_it_says() {
        let text = bench_dragon::show::scene::SceneText::paper().text;
        let looped = text.replace("at_end = \"hold\"", "at_end = \"loop\"\nend_hold = 7.5");
        assert_eq!(scene_facts(&looped).unwrap().loop_stand, Some(7.5));
        assert_eq!(scene_facts("pitch = 1"), None);
    }
}
