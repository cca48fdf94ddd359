//! The night over a village, and those who sit in front, for the look from a seat.

use svg::node::element::{Circle, Group, Path, Rectangle, Use};

use super::eye::Eye;
use super::{WIDTH, rounded};

/// Returns a number from 0 to 1 that looks random.
fn scattered(number: i32) -> f64 {
    let wave = (f64::from(number) * 12.9898).sin() * 43758.5453;
    wave - wave.floor()
}

/// Returns sky, hills, houses and those who stand before them.
pub fn night(eye: &Eye) -> Group {
    let foot = eye.foot();
    let (high, metre) = foot.map_or((2.0, 1.0), |foot| (foot.y.max(2.0), foot.scale));
    let mut group = Group::new().set("id", "night");
    let sky = Rectangle::new().set("width", WIDTH).set("height", rounded(high, 2)).set("fill", "url(#sky)");
    group = group.add(sky);
    for star in 0..90 {
        let dot = Circle::new()
            .set("cx", rounded(WIDTH * scattered(star), 1))
            .set("r", rounded(0.3 + 0.5 * scattered(star + 300), 2));
        group = group.add(
            dot.set("cy", rounded(0.7 * high * scattered(star + 100), 1)).set("fill", "#dce4ff").set("opacity", 0.35),
        );
    }
    let mut hills = format!("M0 {}", rounded(high, 1));
    for step in 0..=40 {
        let at = f64::from(step) / 40.0;
        let wave = 0.5 + 0.25 * (5.1 * at + 1.0).sin() + 0.18 * (11.0 * at + 2.0).sin() + 0.07 * (29.0 * at).sin();
        hills += &format!("L{} {}", rounded(at * WIDTH, 1), rounded(high * (0.78 - 0.3 * wave), 1));
    }
    group = group.add(Path::new().set("d", hills + &format!("L{WIDTH} {}Z", rounded(high, 1))).set("fill", "#06070f"));
    let (mut x, mut number) = (-2.0 * metre, 0);
    while x < WIDTH {
        let wide = 4.0 + 3.6 * scattered(number + 40);
        group = group.add(house(wide, number).set(
            "transform",
            format!("translate({} {})scale({})", rounded(x, 1), rounded(high, 1), rounded(metre, 3)),
        ));
        x += wide * metre;
        number += 1;
    }
    let mut people = Group::new().set("id", "watchers").set("fill", "#24110c");
    for person in 0..(WIDTH / (0.42 * metre)).min(600.0) as i32 {
        let x = 0.42 * metre * (f64::from(person) + 0.5 * scattered(person + 11));
        let size = metre * (0.85 + 0.2 * scattered(person + 12));
        people =
            people.add(used("watcher").set(
                "transform",
                format!("translate({} {})scale({})", rounded(x, 1), rounded(high, 1), rounded(size, 3)),
            ));
    }
    group.add(people)
}

/// Returns a copy of a shape among the definitions of the picture.
pub(super) fn used(name: &str) -> Use {
    Use::new().set("href", format!("#{name}"))
}

/// Returns a house of a width in metres, whose gable rises in steps; `number` varies it.
fn house(wide: f64, number: i32) -> Group {
    let (top, tread) = (2.9 + 1.5 * scattered(number + 60), wide / 7.0);
    let mut wall = String::from("M0 0");
    for step in 0..7_i32 {
        let up = top + 0.5 * f64::from(3 - (3 - step).abs());
        let left = f64::from(step) * tread;
        wall += &format!("L{} -{}L{} -{}", rounded(left, 2), rounded(up, 2), rounded(left + tread, 2), rounded(up, 2));
    }
    let wall = Path::new().set("d", wall + &format!("L{} 0Z", rounded(wide, 2))).set("fill", "url(#wall)");
    let wall = wall.set("stroke", "#040406").set("stroke-width", 0.12);
    let mut group = Group::new().add(wall);
    if scattered(number + 9) < 0.65 {
        let pane = Rectangle::new().set("x", rounded(0.35 * wide, 2)).set("y", rounded(0.5 - top, 2)).set("width", 0.8);
        group = group
            .add(pane.set("height", 0.7).set("fill", "#c97a2c").set("stroke", "#2a1408").set("stroke-width", 0.06));
    }
    let door =
        Rectangle::new().set("x", rounded(0.5 * wide - 0.55, 2)).set("y", -1.75).set("width", 1.1).set("height", 1.75);
    group = group.add(door.set("fill", "#0a0406"));
    for side in [-1.15, 1.15] {
        let at = format!("translate({} -1.65)", rounded(0.5 * wide + side, 2));
        group = group.add(used("halo-red").set("transform", at.clone() + "translate(0 -.3)scale(2)"));
        group = group.add(used("red").set("transform", at));
    }
    group
}

/// Returns those who sit in front.
pub fn front_row(height: f64) -> Path {
    let size = 0.115 * height;
    let mut row = String::new();
    for seat in -1..=(WIDTH / (0.92 * size)) as i32 + 1 {
        let x = 0.92 * size * (f64::from(seat) + 0.4 * scattered(seat + 500));
        let y = height - size * (0.5 + 0.24 * scattered(seat + 600));
        let at = |right: f64, down: f64| format!("{} {}", rounded(x + right * size, 1), rounded(y + down * size, 1));
        let below = |right: f64| format!("{} {}", rounded(x + right * size, 1), rounded(height + 2.0, 1));
        row += &format!("M{}C{} {} {}", below(-0.48), at(-0.46, 0.24), at(-0.16, 0.24), at(-0.1, 0.14));
        row += &format!("C{} {} {}", at(-0.24, -0.02), at(-0.18, -0.24), at(0.0, -0.22));
        row += &format!("C{} {} {}", at(0.18, -0.24), at(0.24, -0.02), at(0.1, 0.14));
        row += &format!("C{} {} {}Z", at(0.16, 0.24), at(0.46, 0.24), below(0.48));
    }
    Path::new()
        .set("id", "front-row")
        .set("d", row)
        .set("fill", "#030203")
        .set("stroke", "#ff9646")
        .set("stroke-opacity", 0.6)
}
