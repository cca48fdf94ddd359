//! Obstacles: the searches against sampling, and scenes solved by hand.

use super::*;
use crate::event::unreported;
use crate::ground::Obstacle;
use crate::model::shape::Shape;

fn ground(shapes: Vec<(Shape, f64)>) -> Ground {
    let obstacle = |(shape, keep_out)| Obstacle { name: String::new(), shape, keep_out };
    Ground::new(shapes.into_iter().map(obstacle).collect())
}

/// Returns the first touches and the least clearances up to `to` or the motion's end, and that place.
fn touches(path: &Path, team: &Team, ground: &Ground, to: f64) -> (Vec<Option<Touch>>, Vec<ObstacleClearance>, f64) {
    let mut unreported = unreported;
    let (path, singular) = followed(path, team);
    let searches = ConservativeAdvancement::new(&path, team, &singular.head_turns, &singular.body_turns)
        .with_tail_turns(&singular.tail_turns);
    let to = to.min(singular.end.map_or(singular.searched_until, |end| end.travelled));
    let mut budget = Budget::new(20_000_000, &mut unreported);
    let (touches, until) = searches.first_touches(ground, 0.0, to, &mut budget).unwrap();
    assert!(until >= to, "touches up to {until} of {to}");
    let (least, until) = searches.obstacle_clearances(ground, 0.0, to, &mut budget).unwrap();
    assert!(until >= to, "clearances up to {until} of {to}");
    (touches, least.into_iter().map(Option::unwrap).collect(), to)
}

/// Returns the least clearance of an obstacle at one place of the head, and its bench, by testing all benches.
fn nearest(path: &Path, team: &Team, obstacle: &Obstacle, travelled: f64) -> Option<(f64, u32)> {
    let mut unreported = unreported;
    let mut at = Configuration::new(path, travelled);
    at.solve_to(team.benches, path, team, &mut Budget::new(u64::MAX, &mut unreported)).ok()?;
    at.boards.iter().map(|board| obstacle.clearance(board)).zip(0..).min_by(|one, other| one.0.total_cmp(&other.0))
}

fn check_ground(path: &Path, team: &Team, ground: &Ground) -> Result<(), TestCaseError> {
    let (touches, least, end) = touches(path, team, ground, path.length());
    let path = &followed(path, team).0;
    for ((obstacle, touch), least) in ground.obstacles().iter().zip(touches).zip(least) {
        let at = |travelled: f64| nearest(path, team, obstacle, travelled);
        if let Some(touch) = touch {
            let there = at(touch.travelled).unwrap();
            prop_assert!(there.0 <= 1e-11 && (there.0 >= -1e-11 || touch.travelled == 0.0), "{touch:?} {there:?}");
            // Another bench is as near at most by rounding.
            let (value, bench) = there;
            prop_assert!(bench == touch.bench || value.abs() < 1e-11, "{touch:?} {bench}");
        }
        prop_assert_eq!(touch.is_some(), least.value <= 0.0, "{:?} {:?}", touch, least);
        let there = at(least.travelled).unwrap().0;
        prop_assert!((there - least.value).abs() < 1e-11, "{least:?} {there}");
        for k in 0..3 * SAMPLES {
            let travelled = end * k as f64 / (3 * SAMPLES) as f64;
            let Some((sampled, _)) = at(travelled) else { break };
            prop_assert!(sampled >= least.value - 1e-11, "{least:?}, but {sampled} at {travelled}");
            let before = touch.is_none_or(|touch| travelled < touch.travelled);
            prop_assert!(!before || sampled > 0.0, "{touch:?}, but {sampled} at {travelled}");
        }
    }
    Ok(())
}

fn any_ground() -> impl Strategy<Value = Ground> {
    let radii = proptest::collection::vec(0.1..1.5f64, 3..8);
    let shape = (0..3u8, radii, -9.0..9.0f64, -9.0..9.0f64, 0.0..0.6f64).prop_map(|(kind, radii, x, y, keep_out)| {
        let count = radii.len() as f64;
        let corner = |(k, radius): (usize, &f64)| {
            let angle = TAU * k as f64 / count;
            Point::new(x + radius * angle.cos(), y + radius * angle.sin())
        };
        let corners = radii.iter().enumerate().map(corner).collect();
        let shape = match kind {
            0 => Shape::circle(Point::new(x, y), radii[0]),
            1 => Shape::polygon(corners),
            _ => Shape::line(corners),
        };
        (shape, keep_out)
    });
    let size = (5.0..12.0f64, 5.0..12.0f64, 0.0..0.5f64).prop_map(|(x, y, keep_out)| {
        let corners = [(-x, -y), (x, -y), (0.5 * x, 0.0), (x, y), (-x, y)];
        (Shape::boundary(corners.map(|(x, y)| Point::new(x, y)).to_vec()), keep_out)
    });
    (proptest::collection::vec(shape, 1..6), size).prop_map(|(mut shapes, size)| {
        shapes.push(size);
        ground(shapes)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases(40)) })]

    #[test]
    fn sampling_a_route_meets_no_obstacle_earlier(team in any_team(), path in any_route(), ground in any_ground()) {
        check_ground(&path, &team, &ground)?;
    }

    #[test]
    fn sampling_a_spiral_meets_no_obstacle_earlier(
        team in any_team(), pitch in 0.3..3.0f64, turns in 2.0..6.0f64, ground in any_ground(),
    ) {
        let fold = Path::spiral(pitch, 1.0).as_spiral().and_then(|(spiral, _)| spiral.fold(team.longest_link()));
        check_ground(&Path::spiral(pitch, turns + fold.unwrap_or(0.0) / TAU), &team, &ground)?;
    }
}

#[test]
fn a_straight_team_meets_a_wall_across_its_way_with_the_head() {
    // The head's board reaches 0.275 m past its front handle.
    let path = Path::route(0.0).line(50.0).build().unwrap();
    let wall = Shape::line(vec![Point::new(20.0, -1.0), Point::new(20.0, 1.0)]);
    let post = Shape::circle(Point::new(30.0, 1.15), 0.5);
    let behind = Shape::polygon([(-9.0, 0.1), (-8.0, 0.1), (-8.5, 3.0)].map(|(x, y)| Point::new(x, y)).to_vec());
    let team = Team { benches: 10, ..PAPER };
    let (found, least, _) = touches(&path, &team, &ground(vec![(wall, 0.25), (post, 0.0), (behind, 0.0)]), 50.0);
    let [wall, post, behind] = [0, 1, 2].map(|k| found[k]);
    let wall = wall.unwrap();
    assert!((wall.travelled - (20.0 - 0.25 - 0.275)).abs() < 1e-13 && wall.bench == 0, "{wall:?}");
    // The post is 1 m from the boards, less half a metre.
    assert!(post.is_none() && (least[1].value - 0.5).abs() < 1e-13, "{:?}", least[1]);
    let behind = behind.unwrap();
    assert!(behind.travelled == 0.0 && behind.bench > 0, "{behind:?}");
}

#[test]
fn a_clearance_that_stays_the_same_costs_few_steps() {
    // Along a wall for 1 km, then round a well for ten turns.
    let path = Path::route(0.0).line(1000.0).arc(Side::Left, 6.0, 10.0).build().unwrap();
    let wall = Shape::polygon(
        [(-100.0, -9.0), (2000.0, -9.0), (2000.0, -0.4), (-100.0, -0.4)].map(|(x, y)| Point::new(x, y)).to_vec(),
    );
    let well = Shape::circle(Point::new(1000.0, 6.0), 2.0);
    let team = Team { benches: 12, ..PAPER };
    let searches = ConservativeAdvancement::new(&path, &team, &[], &[]);
    let ground = ground(vec![(wall, 0.1), (well, 1.0)]);
    let mut unreported = unreported;
    let mut budget = Budget::new(100_000, &mut unreported);
    let (touches, until) = searches.first_touches(&ground, 0.0, path.length(), &mut budget).unwrap();
    assert!(touches == [None, None] && until == path.length(), "{touches:?} {until}");
    let (least, until) = searches.obstacle_clearances(&ground, 0.0, path.length(), &mut budget).unwrap();
    assert!(until == path.length(), "{until}");
    // At the well the corners of the head's board go beyond the circle of the handles.
    let corner = ((36.0f64 - 1.43 * 1.43).sqrt() + 0.15).hypot(1.705) - 6.0;
    assert!((least[0].unwrap().value - (0.3 - corner)).abs() < 1e-12, "{least:?}");
    // The middle of the head's link is nearest to the well: its handles are on the circle.
    let by_hand = (36.0f64 - 1.43 * 1.43).sqrt() - 0.15 - 2.0 - 1.0;
    assert!((least[1].unwrap().value - by_hand).abs() < 1e-12, "{least:?} {by_hand}");
}
