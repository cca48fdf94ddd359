//! Random spirals and routes: the promise, and velocities as differences of places.

use super::*;

/// Returns numbers between two others, evenly by magnitude.
fn magnitude(least: f64, most: f64) -> impl Strategy<Value = f64> {
    (least.log10()..most.log10()).prop_map(|exponent| 10f64.powf(exponent))
}

fn spirals() -> impl Strategy<Value = Subject> {
    // Links relative to the pitch, and the start in links from the centre: most of the plain ranges are illegal starts.
    (
        1usize..40,
        magnitude(1e-3, 1e4),
        magnitude(0.02, 50.0),
        magnitude(0.3, 3.0),
        magnitude(1.0, 1e4),
        magnitude(1e-9, 1e6),
    )
        .prop_map(|(benches, pitch, ratio, head, far, speed)| {
            let link = (ratio * pitch).clamp(2e-3, 9e3);
            let start_turn = (1.0 + far * link * head.max(1.0) / pitch).min(1e7);
            spiral(benches, link * head, link, pitch, start_turn, speed)
        })
        .prop_filter("a show of some length", |subject| subject.end > 0.0)
}

/// Returns routes and turnarounds, with bends down to a third of a link.
fn routes() -> impl Strategy<Value = Subject> {
    let step = (0.3..8.0f64, 0.05..0.7f64, any::<bool>(), any::<bool>()).prop_map(|(size, turns, left, line)| {
        let side = if left { Side::Left } else { Side::Right };
        if line {
            RouteStep::Line { length: 2.0 * size }
        } else {
            RouteStep::Arc { side, radius: size.into(), turns: turns.into() }
        }
    });
    let spiral = (any::<bool>(), any::<bool>(), 0.3..2.0f64, 0.5..6.0f64, 0.01..0.95f64).prop_map(
        |(left, inward, pitch, radius, share)| {
            let side = if left { Side::Left } else { Side::Right };
            let direction = if inward { Direction::Inward } else { Direction::Outward };
            RouteStep::Spiral {
                side,
                direction,
                pitch,
                radius: radius.into(),
                turns: (share * radius / pitch).min(3.0).into(),
            }
        },
    );
    let step = prop_oneof![3 => step, 1 => spiral];
    let route =
        prop::collection::vec(step, 1..12).prop_map(|steps| PathDescription::Route { heading_turns: 0.17, steps });
    let turnaround = (0.4..3.0f64, 1.5..6.0f64, 0.2..5.0f64).prop_map(|(pitch, turns, arc_ratio)| {
        let turn_radius = pitch * turns;
        PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in: 30.0, lead_out: 40.0 }
    });
    (prop_oneof![3 => route, 1 => turnaround], 2usize..60, 0.2..3.0f64, 0.2..3.0f64).prop_map(
        |(description, benches, head, body)| {
            let team = Team {
                benches,
                head_length: head + 0.1,
                body_length: body + 0.1,
                width: 0.1,
                hole_inset: 0.05,
                ends: Ends::NONE,
            };
            Subject::new(description, team, 1.0)
        },
    )
}

/// Returns routes whose first segment is up to 1,000 km long, at times near its end.
fn far_routes() -> impl Strategy<Value = (Subject, f64)> {
    (magnitude(1e3, 1e6), 0.0..1.0f64, 0.0..0.8f64, 1usize..12, 0.3..3.0f64, 0.0..1.0f64).prop_map(
        |(far, heading_turns, bend, benches, link, share)| {
            let size = 5.0 * link;
            let first = if bend < 0.4 {
                RouteStep::Line { length: far }
            } else {
                RouteStep::Arc { side: Side::Left, radius: (0.5 * far).into(), turns: 0.5.into() }
            };
            let length = if bend < 0.4 { far } else { PI * 0.5 * far };
            let last = RouteStep::Arc { side: Side::Right, radius: size.into(), turns: (0.1 + bend / 2.0).into() };
            let description = PathDescription::Route { heading_turns, steps: vec![first, last] };
            let team = Team {
                benches,
                head_length: 1.5 * link + 0.1,
                body_length: link + 0.1,
                width: 0.1,
                hole_inset: 0.05,
                ends: Ends::NONE,
            };
            let subject = Subject::new(description, team, 1.0);
            let time = (length + (2.0 * share - 1.0) * (benches + 2) as f64 * link).min(subject.end);
            (subject, time)
        },
    )
}

/// Returns a subject at a time in its first 99.5 %.
fn at_some_time(subjects: impl Strategy<Value = Subject>) -> impl Strategy<Value = (Subject, f64)> {
    (subjects, 0.0..0.995f64).prop_map(|(subject, share)| {
        let time = share * subject.end;
        (subject, time)
    })
}

/// Tests random subjects: every solver at a random time, the velocities as central differences, and the share of table
/// frames.
fn random_subjects(cases: u32, subjects: impl Strategy<Value = (Subject, f64)>, least_share_of_tables: f64) {
    let cases = crate::harness::cases(cases / 4, cases, 10_000);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let (tables, compared) = (Cell::new(0), Cell::new(0u64));
    TestRunner::new(config)
        .run(&subjects, |(subject, time)| {
            let mut reference = subject.reference();
            let handles = subject.motion.team().handles();
            let (mut chain, mut safe) = (Chain::new(handles), Chain::new(handles));
            subject.newton().solve(time, &mut safe).unwrap();
            subject.assert_sound(&safe, time, "newton");
            subject.assert_true(&mut reference, &safe, time, "newton");
            if let Some(mut table) = subject.table() {
                table.solve(time, &mut chain).unwrap();
                subject.assert_sound(&chain, time, "follower_table");
                subject.assert_true(&mut reference, &chain, time, "follower_table");
                tables.set(tables.get() + 1 - table.fallbacks());
            }
            compared.set(compared.get() + handles as u64);
            Ok(())
        })
        .unwrap();
    println!("{} of {cases} frames came from a table, {} handles compared", tables.get(), compared.get());
    assert!(tables.get() as f64 > least_share_of_tables * f64::from(cases), "{} tables", tables.get());
}

#[test]
fn random_spirals_keep_the_promise() {
    random_subjects(60, at_some_time(spirals()), 0.1);
}

#[test]
fn random_routes_keep_the_promise() {
    random_subjects(300, at_some_time(routes()), 0.5);
}

#[test]
fn routes_that_go_far_keep_the_promise() {
    random_subjects(60, far_routes(), 0.2);
}
