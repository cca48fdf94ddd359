//! Each lemma on cases made by hand: true cases hold, and cases that are false by little do not.

use fastrand::Rng;

use super::cases;
use crate::boards::{Board, covers, is_inside_ring};
use crate::capsule::{Capsule, Pair};
use crate::curve::Curve;
use crate::interval::{Interval, Vector};
use crate::link;
use crate::path::{Place, Span};
use crate::scene::Scene;
use crate::team::Size;

fn scene(path: &str) -> Scene {
    let team = "[team]\nbenches = 9\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
    Scene::read(&format!("{team}[path]\n{path}\n[motion]\nhead_speed = 1.0\n")).unwrap()
}

fn turnaround() -> Scene {
    scene("kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2.0\nlead_in = 100.0")
}

/// Returns an arc around the origin, entered from a line: coordinates are angles.
fn circle(radius: f64) -> Scene {
    scene(&format!(
        "kind = \"pieces\"\nstart = [0.0, {}]\npieces = [{{ kind = \"arc\", radius = {radius}, side = \"left\", turns = 0.9 }}]",
        -radius
    ))
}

fn at(scene: &Scene, place: Place) -> ([f64; 2], [f64; 2]) {
    let at = scene.path.at(place);
    ([at.point.x.rough(), at.point.y.rough()], [at.tangent.x.rough(), at.tangent.y.rough()])
}

/// After thousands of pieces the direction is known badly, but the side is given.
#[test]
fn an_arc_bends_to_its_side_whatever_its_direction() {
    let wide = Interval::new(-1.0).hull(&Interval::new(1.0));
    let direction = Vector { x: wide, y: wide };
    for side in [1.0, -1.0] {
        let arc = Curve::arc(Vector::new(0.0, 0.0), direction, Interval::new(side), Interval::new(2.0));
        let bend = arc.bend(&Interval::new(0.1), &Interval::new(0.2));
        assert_eq!(bend.rough(), side / 2.0);
    }
}

/// Every junction is met from both sides, and the length is that of the turnaround's table.
#[test]
fn paths_are_without_gap_or_corner() {
    let turn = 4.5 / (1.7 / std::f64::consts::TAU);
    let angle = 2.0 * f64::atan(turn);
    let scene = turnaround();
    let path = &scene.path;
    for (before, after) in [
        (Place(0, turn.next_up(), 0.0), Place(1, 1e-15, 0.0)),
        (Place(1, angle - 1e-15, 0.0), Place(2, 1e-15, 0.0)),
        (Place(2, angle - 1e-15, 0.0), Place(3, turn.next_up(), 0.0)),
    ] {
        assert!(path.has(before) && path.has(after) && path.in_order(before, after) && !path.in_order(after, before));
        let ((p, t), (q, s)) = (at(&scene, before), at(&scene, after));
        for (a, b) in p.iter().chain(&t).zip(q.iter().chain(&s)) {
            assert!((a - b).abs() < 1e-13, "{before:?} {after:?}: {a} {b}");
        }
        assert!((path.travelled(before).rough() - path.travelled(after).rough()).abs() < 1e-12);
    }
    for outside in [
        Place(0, turn.next_down(), 0.0),
        Place(3, turn.next_down(), 0.0),
        Place(1, 0.0, 0.0),
        Place(2, angle * 1.001, 0.0),
        Place(4, 1.0, 0.0),
    ] {
        assert!(!path.has(outside), "{outside:?}");
    }
    let both = path.travelled(Place(3, turn.next_up(), 0.0)).rough() - 100.0;
    assert!((both - 13.621244906821122).abs() < 1e-12, "{both}");
    assert!((path.length.rough() - both - 100.0 - 2.86 - 8.0 * 1.65).abs() < 1e-12);
}

/// The bounds of a capsule hold at random places of its span, also across junctions.
#[test]
fn capsules_hold_their_places() {
    let scene = turnaround();
    let path = &scene.path;
    let mut random = Rng::with_seed(1);
    let place = |random: &mut Rng| match random.u8(..4) {
        0 => Place(0, 16.64 + 3.0 * random.f64(), 0.0),
        1 => Place(1, 3.0 * random.f64(), 0.0),
        2 => Place(2, 3.0 * random.f64(), 0.0),
        _ => Place(3, 16.64 + 3.0 * random.f64(), 0.0),
    };
    let mut spans = 0;
    while spans < 200 {
        let mut places: Vec<_> =
            std::iter::repeat_with(|| place(&mut random)).take(5).filter(|x| path.has(*x)).collect();
        places.sort_by(|a, b| path.order(*a, *b));
        let [lo, .., hi] = places[..] else { continue };
        spans += 1;
        let capsule = Capsule::new(path, Span(lo, hi));
        let front = Capsule::new(path, Span(hi, hi));
        let pair = Pair::new(&front, &capsule);
        let (half, sag, turn) = (capsule.half.rough(), capsule.sag.rough(), capsule.turn.rough());
        let metres = path.travelled(hi).rough() - path.travelled(lo).rough();
        assert!(half >= metres / 2.0 - 1e-9 && half < metres / 2.0 * 1.2 + 1e-9, "{half} {metres}");
        for inside in &places {
            let there = path.at(*inside);
            let away = there.point.minus(&capsule.point);
            let along = away.dot(&capsule.tangent).rough().abs();
            let across = away.cross(&capsule.tangent).rough().abs();
            assert!(along <= half + sag + 1e-12 && across <= sag + 1e-12, "{inside:?} of {lo:?} {hi:?}");
            assert!(there.tangent.minus(&capsule.tangent).norm().rough() <= turn + 1e-12);
            let d = front.point.minus(&there.point);
            for (bound, value) in
                [(pair.front_product(), front.tangent.dot(&d)), (pair.rear_product(), there.tangent.dot(&d))]
            {
                assert!(!bound.is_below(&value) && !value.is_below(&bound), "{bound:?} {value:?}");
            }
        }
    }
}

/// Lemma 1 on a circle, where the follower is an angle behind.
#[test]
fn a_link_on_a_circle() {
    let scene = circle(3.0);
    let link = Interval::new(2.0);
    let behind = 2.0 * f64::asin(1.0 / 3.0);
    let check = |u: [f64; 2], x: [f64; 2]| {
        let capsule = |ends: [f64; 2]| {
            let [lo, hi] = ends.map(|coordinate| Place(1, coordinate, 0.0));
            (Capsule::new(&scene.path, Span(lo, hi)), [lo, hi].map(|place| scene.path.at(place).point))
        };
        let ((front, front_ends), (rear, rear_ends)) = (capsule(u), capsule(x));
        link::check(&scene.path, (&front, front_ends), (&rear, rear_ends), &link, &[(front.span, None)])
    };
    let around = |lo: f64, hi: f64| [2.0 - behind + lo, 2.0 - behind + hi];
    assert!(check([2.0, 2.0], around(-1e-12, 1e-12)).unwrap().is_positive());
    assert!(check([2.0, 2.1], around(-1e-12, 0.1 + 1e-12)).unwrap().is_positive());
    assert!(check([2.0, 2.0], around(1e-12, 2e-12)).is_err());
    assert!(check([2.0, 2.0], around(-2e-12, -1e-12)).is_err());
    assert!(check([2.0, 2.1], around(-1e-12, 0.1 - 1e-12)).is_err());
    assert!(check([2.0, 2.1], around(1e-12, 0.1)).is_err());
    assert!(check([2.0, 2.1], around(-1e-12, behind + 0.01)).is_err());
    // Half a circle further on the front product is negative. A nearer place is at the distance before: the place where
    // the circle closes is no follower.
    let round = std::f64::consts::TAU - behind;
    let far = 5.62 - round;
    assert!(far > 0.0 && check([5.62, 5.62], [far - 1e-9, far + 1e-9]).is_err());
}

/// Returns the capsule of a single place.
fn single(point: [f64; 2]) -> Capsule {
    let zero = || Interval::new(0.0);
    let place = Place(0, 0.0, 0.0);
    Capsule {
        span: Span(place, place),
        point: Vector::new(point[0], point[1]),
        tangent: Vector::new(1.0, 0.0),
        half: zero(),
        curvature: zero(),
        sag: zero(),
        turn: zero(),
    }
}

/// Returns the four corners of a board with this rear handle, direction and length.
fn corners(rear: [f64; 2], angle: f64, length: f64) -> [[f64; 2]; 4] {
    let (sine, cosine) = angle.sin_cos();
    [(-0.275, -0.15), (-0.275, 0.15), (length + 0.275, 0.15), (length + 0.275, -0.15)]
        .map(|(x, y)| [rear[0] + x * cosine - y * sine, rear[1] + x * sine + y * cosine])
}

/// Returns the distance of a point from an edge.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let along = ((edge[0] * to[0] + edge[1] * to[1]) / (edge[0] * edge[0] + edge[1] * edge[1])).clamp(0.0, 1.0);
    (to[0] - along * edge[0]).hypot(to[1] - along * edge[1])
}

fn is_inside(p: [f64; 2], polygon: &[[f64; 2]; 4]) -> bool {
    (0..4).all(|i| {
        let (a, b) = (polygon[i], polygon[(i + 1) % 4]);
        // The corners go round clockwise.
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) <= 0.0
    })
}

/// Lemma 2 against distances by brute force: boards apart by more than rounding are apart, overlapping ones never.
#[test]
fn boards_are_apart_or_not() {
    let scene = turnaround();
    let mut random = Rng::with_seed(2);
    let (mut apart, mut overlapping) = (0, 0);
    for _ in 0..cases(5_000, 500) {
        let length = scene.team.link(1).rough();
        let place = |random: &mut Rng| ([random.f64() * 3.0, random.f64() * 3.0], random.f64() * 7.0);
        let placed = [place(&mut random), place(&mut random)];
        let shapes = placed.map(|(rear, angle)| corners(rear, angle, length));
        let handles = placed.map(|(rear, angle)| {
            let (sine, cosine) = angle.sin_cos();
            [single([rear[0] + length * cosine, rear[1] + length * sine]), single(rear)]
        });
        let size = || Size { link: Interval::new(length), ..scene.team.size(1) };
        let [a, b] = handles.each_ref().map(|[front, rear]| Board::new(front, rear, size()));
        let edges = |shape: [[f64; 2]; 4]| (0..4).map(move |i| (shape[i], shape[(i + 1) % 4]));
        let from = |p: [[f64; 2]; 4], q: [[f64; 2]; 4]| {
            p.into_iter().flat_map(move |p| edges(q).map(move |(a, b)| distance(p, a, b))).fold(f64::INFINITY, f64::min)
        };
        let least = from(shapes[0], shapes[1]).min(from(shapes[1], shapes[0]));
        // Grid points of one board that are in the other as well.
        let grid = (0..=40).flat_map(|i| (0..=10).map(move |j| (f64::from(i) / 40.0, f64::from(j) / 10.0)));
        let [o, across, _, along] = shapes[0];
        let common = grid
            .map(|(s, v)| [0, 1].map(|k| o[k] + s * (along[k] - o[k]) + v * (across[k] - o[k])))
            .find(|p| is_inside(*p, &shapes[1]));
        let is_apart = a.is_apart_from(&b);
        assert_eq!(is_apart, b.is_apart_from(&a));
        if let Some(p) = common {
            overlapping += 1;
            assert!(!is_apart, "{placed:?}");
            // Lemma 5 agrees but for rounding at an edge.
            let is_deep = from([p; 4], shapes[0]) > 1e-9 && from([p; 4], shapes[1]) > 1e-9;
            let point = Vector::new(p[0], p[1]);
            assert!(!is_deep || covers(&a, &point) && covers(&b, &point));
        } else if is_apart {
            apart += 1;
            let corner = Vector::new(shapes[1][0][0], shapes[1][0][1]);
            assert!(!covers(&a, &corner));
        } else {
            // Between the points of the grid.
            assert!(least < 0.1, "{placed:?}");
        }
    }
    assert!(apart > 100 && overlapping > 100, "{apart} {overlapping}");
}

/// Two boards side by side, and end to end, a little apart and a little into each other.
#[test]
fn boards_that_almost_touch() {
    let scene = turnaround();
    let board = |x: f64, y: f64| [single([x + 1.65, y]), single([x, y])];
    let first = board(0.0, 0.0);
    let apart = |x: f64, y: f64| {
        let second = board(x, y);
        let second = Board::new(&second[0], &second[1], scene.team.size(1));
        Board::new(&first[0], &first[1], scene.team.size(1)).is_apart_from(&second)
    };
    for sign in [-1.0, 1.0] {
        assert!(apart(0.3, sign * (0.3 + 1e-14)) && !apart(0.3, sign * (0.3 - 1e-14)));
        assert!(apart(sign * (2.2 + 1e-14), 0.1) && !apart(sign * (2.2 - 1e-14), 0.1));
        assert!(apart(sign * (2.2 + 1e-14), 0.3 + 1e-14));
    }
}

/// Lemma 3, *Ring*: sqrt(rho^2 - l^2 / 4) - width / 2 against r and the corner.
#[test]
fn boards_inside_a_ring() {
    let team = &turnaround().team;
    let (corner, width) = (0.275f64.hypot(0.15), &Interval::new(0.3));
    for rho in [0.9, 2.0, 10.0] {
        let inner = f64::min(f64::sqrt(rho * rho - 0.825 * 0.825), rho - 0.275) - 0.15;
        let inside =
            |reach: f64| is_inside_ring(team, &Interval::new(reach), width, &Interval::new(rho), &Interval::new(0.0));
        assert!(inside(inner - corner - 1e-12) && !inside(inner - corner + 1e-12), "{rho}");
    }
    assert!(!is_inside_ring(team, &Interval::new(-10.0), width, &Interval::new(0.8), &Interval::new(0.0)));
}

/// *Nearer* is given up where it is true by too little: the stretches would have to be too short.
#[test]
fn what_is_nearer_by_almost_nothing_is_given_up() {
    // Half a circle about the origin, then half of one that leads to the origin.
    let scene = scene(
        "kind = \"pieces\"\nstart = [0.0, -1.0]\npieces = [{ kind = \"arc\", radius = 1.0, side = \"left\", turns = 0.5 }, \
         { kind = \"arc\", radius = 0.5, side = \"left\", turns = 0.5 }]",
    );
    let path = &scene.path;
    let end = Place(2, std::f64::consts::PI - 1e-12, 0.0);
    let (front, arc) = (Capsule::new(path, Span(end, end)), Span(Place(1, 0.1, 0.0), Place(1, 3.0, 0.0)));
    for (beyond, is_seen) in [(1e-2, true), (1e-12, false)] {
        let link = Interval::new(1.0 + beyond);
        assert_eq!(link::is_all_nearer(path, &front, arc, &link.square()), is_seen, "{beyond}");
    }
}
