//! The facts about a scene that the page of `view` shows and that no publisher sends: whether it loops, and its clearance
//! over the whole show. In: the text of a scene. Out: facts for `outputs`. Computed once for each scene.

use std::time::{Duration, Instant};

use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::TimedClearance;
use bench_dragon::outputs::view::{ClearanceCurve, LeastOfShow, SceneFacts};
use bench_dragon::show::scene::{AtEnd, Scene};

/// Points of the curve at equal distances.
const POINTS: u32 = 600;
/// Points on each side of the least clearance, each at half the distance of the one before.
const POINTS_AT_LEAST: u32 = 12;
/// The time after which no curve is shown: a page does not wait for a team of a million benches.
const PATIENCE: Duration = Duration::from_secs(60);

/// Returns the facts about the scene with this text; `None` for a text that is no scene.
pub fn scene_facts(text: &str) -> Option<SceneFacts> {
    let scene = Scene::parse(text, "the scene of the show", "show").ok()?;
    let loop_stand = (scene.at_end == AtEnd::Loop).then_some(scene.end_hold);
    Some(SceneFacts { loop_stand, clearance: clearance(&scene) })
}

/// Returns the clearance over the show. `None` for fewer than three benches, where a search gave up, or where it takes too
/// long.
fn clearance(scene: &Scene) -> Option<ClearanceCurve> {
    let timeline = scene.motion.timeline(&mut |_| ());
    let freeze = timeline.freeze(scene.stops_at_contact());
    let TimedClearance { least, time, searched_until } =
        scene.motion.least_clearance(&timeline, freeze, &mut |_| ())?;
    if searched_until.is_some() {
        return None;
    }
    let least = LeastOfShow { time, clearance: least.value, bench_a: least.bench_a, bench_b: least.bench_b };
    let mut choice = scene.motion.solver(Velocities::Omitted);
    let mut monitor = scene.motion.clearance_monitor(&choice);
    let mut chain = Chain::new(scene.team().handles());
    let mut points = vec![[least.time, least.clearance]];
    let began = Instant::now();
    for time in times(freeze.time, least.time) {
        if began.elapsed() > PATIENCE {
            return None;
        }
        choice.solver.solve(time, &mut chain).ok()?;
        let nearest = monitor.least_clearance(&chain, scene.motion.travelled_at(time))?;
        points.push([time, nearest.value]);
    }
    points.sort_by(|one, other| one[0].total_cmp(&other[0]));
    Some(ClearanceCurve { points, least })
}

/// Returns the times of the points: even ones up to the end of the show, and closer ones around the least clearance.
fn times(end: f64, least: f64) -> impl Iterator<Item = f64> {
    let step = end / f64::from(POINTS);
    let even = (0..=POINTS).map(move |k| f64::from(k) * step).map(move |time| time.min(end));
    let close = (0..POINTS_AT_LEAST).map(move |k| step / f64::from(1 << k));
    let around = close.flat_map(move |away| [least - away, least + away]);
    even.chain(around.filter(move |time| (0.0..=end).contains(time)))
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
    fn a_scene_that_loops_stands_as_long_as_it_says() {
        let text = bench_dragon::show::scene::SceneText::paper().text;
        let looped = text.replace("at_end = \"hold\"", "at_end = \"loop\"\nend_hold = 7.5");
        assert_eq!(scene_facts(&looped).unwrap().loop_stand, Some(7.5));
        assert_eq!(scene_facts("pitch = 1"), None);
    }
}
