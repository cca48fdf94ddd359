//! The meaning of a scene file: every default as documented, and the same scene stated in two ways.

use std::f64::consts::{PI, TAU};

use bench_dragon::messages::{SEGMENT_ARC, SEGMENT_INWARD_SPIRAL, SEGMENT_LINE, SEGMENT_OUTWARD_SPIRAL, StageMessage};
use bench_dragon::motion::Method;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::model::description::PathDescription;
use bench_dragon::motion::solve::Velocities;
use bench_dragon::show::convert::stage;
use bench_dragon::show::scene::{AtEnd, OnContact, Scene};
use bench_dragon::show::{Playback, Show};

const TEAM: &str =
    "[team]\nbenches = 20\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n[path]\n";

/// Returns a scene of this path with further tables.
fn scene(path: &str, speed: f64, further: &str) -> Scene {
    let text = format!("{TEAM}{path}\n[motion]\nhead_speed = {speed:?}\n{further}");
    Scene::parse(&text, "a/folder/dragons.toml", "dragons").unwrap()
}

const SPIRAL: &str = "kind = \"spiral\"\npitch = 0.55\nstart_turn = 16";

#[test]
fn what_is_left_out_has_its_documented_default() {
    let scene = scene(SPIRAL, 1.0, "[alerts]\n");
    assert_eq!(scene.name, "dragons", "the stem of its file");
    assert_eq!(scene.ensemble.only().unwrap().method(), Method::Accuracy(1e-9));
    assert_eq!((scene.on_contact, scene.at_end, scene.end_hold), (OnContact::Stop, AtEnd::Hold, 5.0));
    let alerts = scene.alerts.unwrap();
    assert_eq!((alerts.approach_time, alerts.approach_clearance), (10.0, 0.05));
    assert_eq!((scene.rate, scene.velocities), (60.0, Velocities::Computed));
    assert_eq!((scene.queue, scene.subscribers, scene.single_precision), (None, 8, None));
    assert!(scene.cues.is_empty() && scene.ros2.is_none());
}

#[test]
fn the_rate_over_ros2_is_60_or_the_loops_or_the_scenes_whichever_is_lowest() {
    let rate = |ros2: &str, of_loop: f64| scene(SPIRAL, 1.0, ros2).ros2.unwrap().rate_of(of_loop);
    assert_eq!(rate("[publish.ros2]\n", 1000.0), 60.0);
    assert_eq!(rate("[publish.ros2]\n", 30.0), 30.0);
    assert_eq!(rate("[publish.ros2]\nrate = 100\n", 1000.0), 100.0);
    assert_eq!(rate("[publish.ros2]\nrate = 100\n", 30.0), 30.0);
}

/// A quarter of a circle of 2 m is pi metres.
#[test]
fn an_arc_by_its_length_is_the_arc_by_its_turns() {
    let of = |how: &str| {
        let arc = "kind = \"pieces\"\n[[path.pieces]]\nkind = \"arc\"\nside = \"left\"\nradius = 2.0\n";
        let scene = scene(&format!("{arc}{how}"), 1.0, "");
        let path = scene.ensemble.only().unwrap().path();
        (path.length(), path.point(path.param_at(path.length())))
    };
    let (by_turns, by_length) = (of("turns = 0.25"), of(&format!("length = {PI:?}")));
    for (length, end) in [by_turns, by_length] {
        assert!((length - PI).abs() < 1e-14, "{length} m");
        assert!((end.x - 2.0).abs() < 1e-14 && (end.y - 2.0).abs() < 1e-14, "{end}");
    }
}

#[test]
fn a_turnaround_leads_out_by_the_length_of_its_team() {
    let turn = "kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2\nlead_in = 9";
    let scene = scene(turn, 1.0, "");
    let PathDescription::Turnaround { lead_in, lead_out, .. } = *scene.ensemble.only().unwrap().description() else {
        panic!("not a turnaround")
    };
    assert_eq!(lead_in, 9.0);
    assert!((lead_out - (2.86 + 19.0 * 1.65)).abs() < 1e-12, "{lead_out} m");
}

/// Metres are metres and seconds are seconds at any speed of the head.
#[test]
fn cues_are_at_the_times_that_the_scene_states() {
    let cues = "[alerts]\n[[cues]]\nname = \"way\"\ntravelled = 3.0\n[[cues]]\nname = \"time\"\nat = 4.0\n\
                [[cues]]\nname = \"before\"\nbefore = \"contact\"\nseconds = 7.0\n";
    let scene = scene(SPIRAL, 2.0, cues);
    let ensemble = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).unwrap();
    let scene = Scene { ensemble, ..scene };
    let show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    let times: Vec<_> = show.cues().iter().map(|cue| (&*cue.name, cue.time)).collect();
    // The head and the ninth bench touch after 412.47 m, with 20 benches as with 223.
    let before = 0.5 * 412.473837682115 - 7.0;
    assert_eq!((times[0], times[1], times[2].0), (("way", 1.5), ("time", 4.0), "before"));
    assert!((times[2].1 - before).abs() < 1e-10, "{times:?}");
}

fn stage_of(path: &str) -> StageMessage {
    let scene = scene(path, 1.0, "");
    let ensemble = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).unwrap();
    let scene = Scene { ensemble, ..scene };
    let show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    stage(1, 2, [0; 32], &scene.ensemble, &show)
}

/// Returns the radius at which a spiral ends, from the numbers of its message alone, metres.
fn end_radius(message: &StageMessage, segment: usize) -> f64 {
    message.segments[segment].pitch / TAU * message.segments[segment].theta_last
}

/// Each segment of the message, as a display draws it, begins where the segment before ends.
#[test]
fn the_segments_of_a_stage_join() {
    let turn = "kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2\nlead_in = 9";
    let stage = stage_of(turn);
    let kinds: Vec<u32> = stage.path(stage.stage.first_dragon()).iter().map(|segment| segment.kind).collect();
    assert_eq!(kinds, [SEGMENT_INWARD_SPIRAL, SEGMENT_ARC, SEGMENT_ARC, SEGMENT_OUTWARD_SPIRAL]);
    let radius = |segment: usize| stage.segments[segment].x.hypot(stage.segments[segment].y);
    // The first spiral ends at the turn's radius, and the second begins there.
    assert!((end_radius(&stage, 0) - 4.5).abs() < 1e-9 && (radius(1) - 4.5).abs() < 1e-9);
    assert!(
        (radius(3) - 4.5).abs() < 1e-9
            && (stage.stage.first_dragon().pitch / TAU * stage.segments[3].theta_first - 4.5).abs() < 1e-9
    );
    assert!(end_radius(&stage, 3) > 5.0);
    assert!(
        (stage.stage.first_dragon().start_turn - radius(0) / 1.7).abs() < 1e-9,
        "{}",
        stage.stage.first_dragon().start_turn
    );
    assert!((stage.segments[0].theta_first - TAU * stage.stage.first_dragon().start_turn).abs() < 1e-9);

    let pieces = "kind = \"pieces\"\nstart = [1.0, 2.0]\nheading_turns = 0.1\n\
                  [[path.pieces]]\nkind = \"line\"\nlength = 3.0\n\
                  [[path.pieces]]\nkind = \"arc\"\nside = \"right\"\nradius = 2.0\nturns = 0.3\n\
                  [[path.pieces]]\nkind = \"line\"\nlength = 4.0";
    let stage = stage_of(pieces);
    let path = stage.path(stage.stage.first_dragon());
    assert!(path.iter().any(|segment| segment.kind == SEGMENT_ARC));
    for pair in path.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let (turned, along, across) = match from.kind {
            SEGMENT_LINE => (0.0, from.length, 0.0),
            _ => {
                let turned = from.curvature * from.length;
                (turned, turned.sin() / from.curvature, (1.0 - turned.cos()) / from.curvature)
            }
        };
        let (sine, cosine) = from.heading.sin_cos();
        let (x, y) = (from.x + along * cosine - across * sine, from.y + along * sine + across * cosine);
        assert!((x - to.x).hypot(y - to.y) < 1e-12, "{from:?} {to:?}");
        let corner = (from.heading + turned - to.heading).rem_euclid(TAU);
        assert!(corner.min(TAU - corner) < 1e-12, "{from:?} {to:?}");
    }
}

/// Spirals of a route come with their turns or their length, with their bend in the stage message, and without a
/// corner.
#[test]
fn the_spirals_of_a_route_join_and_say_where_they_lie() {
    let spiral = |direction: &str, side: &str, extent: &str| {
        format!(
            "[[path.pieces]]\nkind = \"spiral\"\npitch = 1.7\nradius = 6.0\ndirection = \"{direction}\"\nside = \"{side}\"\n\
             {extent}\n"
        )
    };
    // Metres of r = a theta between two radii.
    let metres = |from: f64, to: f64| {
        let length = |radius: f64| {
            let theta = TAU * radius / 1.7;
            1.7 / TAU / 2.0 * (theta * theta.hypot(1.0) + theta.asinh())
        };
        (length(to) - length(from)).abs()
    };
    let line = "[[path.pieces]]\nkind = \"line\"\nlength = 5.0\n";
    let extents = [(6.0 - 1.7 * 2.5, "turns = 2.5".to_owned()), (1.75, format!("length = {:?}", metres(6.0, 1.75)))];
    for (inner, extent) in extents {
        let route = format!(
            "kind = \"pieces\"\n{line}{}{line}{}{line}",
            spiral("in", "left", &extent),
            spiral("out", "right", "turns = 1.0")
        );
        let StageMessage { stage, segments } = stage_of(&route);
        let kinds: Vec<u32> = segments.iter().map(|segment| segment.kind).collect();
        let (line, spirals) = (SEGMENT_LINE, [SEGMENT_INWARD_SPIRAL, SEGMENT_OUTWARD_SPIRAL]);
        assert_eq!(kinds, [line, spirals[0], line, spirals[1], line]);
        let dragon = stage.first_dragon();
        assert!(dragon.pitch == 1.7 && dragon.start_turn.is_nan());
        let [inward, outward] = [segments[1], segments[3]];
        assert!(inward.curvature > 0.0 && outward.curvature < 0.0, "to the left, to the right");
        assert!((inward.length - metres(6.0, inner)).abs() < 1e-12 && (inward.x - 5.0).abs() < 1e-15);
        assert!((outward.length - metres(6.0, 7.7)).abs() < 1e-12);
        assert!((1.7 / TAU * inward.theta_last - inner).abs() < 1e-12);
        // The direction turns by the angle about the centre and by the change of atan(theta).
        let turned = TAU * 2.5 + inward.theta_first.atan() - inward.theta_last.atan();
        assert!((segments[2].heading - turned).sin().abs() < 1e-12, "{}", segments[2].heading);
        let theta = outward.theta_first;
        let curvature = TAU / 1.7 * (2.0 + theta * theta) / (1.0 + theta * theta).powf(1.5);
        assert!((outward.curvature + curvature).abs() < 1e-12);
    }
}

#[test]
fn a_route_has_up_to_4096_pieces() {
    let bend = "[[path.pieces]]\nkind = \"arc\"\nradius = 5.0\nturns = 0.125\nside = ";
    let path = format!("kind = \"pieces\"\n{}", format!("{bend}\"left\"\n{bend}\"right\"\n").repeat(2048));
    // One bench, which touches nothing: the search for contacts on 16 km takes long.
    let text = format!("{}{path}\n[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n", TEAM.replace("= 20", "= 1"));
    let scene = Scene::parse(&text, "test", "test").unwrap();
    let length = 4096.0 * 5.0 * TAU / 8.0;
    assert!((scene.ensemble.only().unwrap().path().length() - length).abs() < 1e-9);
    let timeline = scene.ensemble.timeline(&mut unreported);
    assert_eq!((timeline.events().len(), timeline.searched_until()), (1, None), "{timeline:?}");
    assert!((timeline.end().time - length).abs() < 1e-9);
    let show = Show::new(&scene, timeline, Playback::of(&scene)).unwrap();
    let message = stage(1, 2, [0; 32], &scene.ensemble, &show);
    assert_eq!(message.segments.len(), 4096);
    // Each pair of bends is the same step along one straight line.
    let (from, to) = (message.segments[0], message.segments[4094]);
    let step = (message.segments[2].x - from.x, message.segments[2].y - from.y);
    assert!((to.x - 2047.0 * step.0).hypot(to.y - 2047.0 * step.1) < 1e-9, "{to:?}");
}
