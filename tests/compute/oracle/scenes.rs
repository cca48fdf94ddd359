//! Random scenes as TOML text, by families, and this checker's own reading of such a text.

use std::fmt::Write;

use toml::{Table, Value};

use super::chain::Team;
use super::geometry::{Path, RouteSegment, Vector};

/// The kinds of random scenes; the last is tried in addition to the others.
pub const FAMILIES: [&str; 7] =
    ["spiral", "turnaround", "route", "tight bends", "U-turn", "S-bend", "spirals in a route"];

/// Returns the team and the path of a scene; its head speed is 1 m/s.
pub fn read(text: &str) -> (Team, Path) {
    let scene: Table = text.parse().unwrap();
    let float = |table: &Value, field: &str| {
        table.get(field).map(|value| value.as_float().unwrap_or_else(|| value.as_integer().unwrap() as f64))
    };
    let team = |field: &str| float(&scene["team"], field).unwrap();
    let (benches, head_length, body_length) = (team("benches") as usize, team("head_length"), team("body_length"));
    let or = |field: &str, other: f64| float(&scene["team"], field).unwrap_or(other);
    let team = Team {
        benches,
        head_length,
        body_length,
        tail_length: or("tail_length", body_length),
        head_width: or("head_width", team("width")),
        width: team("width"),
        tail_width: or("tail_width", team("width")),
        hole_inset: team("hole_inset"),
    };
    let table = &scene["path"];
    let number = |field: &str| float(table, field);
    let path = match table["kind"].as_str().unwrap() {
        "spiral" => Path::spiral(number("pitch").unwrap(), number("start_turn").unwrap()),
        "turnaround" => {
            let stretched: f64 = (0..team.benches).map(|bench| team.link(bench)).sum();
            let [pitch, radius, ratio, lead_in] =
                ["pitch", "turn_radius", "arc_ratio", "lead_in"].map(|field| number(field).unwrap());
            Path::turnaround(pitch, radius, ratio, lead_in, number("lead_out").unwrap_or(stretched))
        }
        _ => {
            let segments: Vec<RouteSegment> = table["pieces"]
                .as_array()
                .unwrap()
                .iter()
                .map(|segment| {
                    let number = |field: &str| float(segment, field).unwrap();
                    match segment["kind"].as_str().unwrap() {
                        "line" => RouteSegment::Line { length: number("length") },
                        "spiral" => RouteSegment::Spiral {
                            pitch: number("pitch"),
                            radius: number("radius"),
                            turns: number("turns"),
                            outward: segment["direction"].as_str() == Some("out"),
                            left: segment["side"].as_str() == Some("left"),
                        },
                        _ => {
                            let left = segment["side"].as_str() == Some("left");
                            RouteSegment::Arc { radius: number("radius"), turns: number("turns"), left }
                        }
                    }
                })
                .collect();
            let start = table.get("start").map_or(Vector::zeros(), |start| {
                Vector::new(start[0].as_float().unwrap(), start[1].as_float().unwrap())
            });
            Path::route(start, number("heading_turns").unwrap_or(0.0), &segments)
        }
    };
    (team, path)
}

/// Random numbers: splitmix64.
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a number for which every order of magnitude is equally likely.
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }
}

fn team_text(random: &mut Random, benches: f64, head_link: f64, body_link: f64) -> String {
    let width = random.between(0.05, 0.6);
    let inset = random.between(0.0, 0.4);
    // Ends of boards that reach over half a link overlap at once with the next board but one, so they are rare.
    let most = if random.chance(0.9) { 0.45 * head_link.min(body_link) } else { 0.4 };
    let inset = inset.min(most).max(0.001);
    let [head, body] = [head_link, body_link].map(|link| link + 2.0 * inset);
    let least = if random.chance(0.1) { 1.0 } else { 4.0 };
    let benches = random.between(least, benches + 1.0).floor();
    format!(
        "[team]\nbenches = {benches}\nhead_length = {head:?}\nbody_length = {body:?}\nwidth = {width:?}\n\
         hole_inset = {inset:?}\n[motion]\nhead_speed = 1.0\n[alerts]\n"
    )
}

pub fn line(length: f64) -> String {
    format!("[[path.pieces]]\nkind = \"line\"\nlength = {length:?}\n")
}

pub fn arc(radius: f64, turns: f64, left: bool) -> String {
    let side = if left { "left" } else { "right" };
    format!("[[path.pieces]]\nkind = \"arc\"\nradius = {radius:?}\nside = \"{side}\"\nturns = {turns:?}\n")
}

/// Returns a spiral of a route, as wide as some links: inward it goes up to nine tenths of the way to its centre.
fn spiral(random: &mut Random, link: f64) -> String {
    let (pitch, inward) = (link * random.magnitude(0.1, 2.0), random.chance(0.6));
    let radius = link * random.magnitude(0.5, 8.0);
    let most = if inward { 0.9 * radius } else { 4.0 * link };
    let turns = random.between(0.02, 1.0) * (most / pitch).min(5.0);
    let direction = if inward { "in" } else { "out" };
    let side = if random.chance(0.5) { "left" } else { "right" };
    format!(
        "[[path.pieces]]\nkind = \"spiral\"\npitch = {pitch:?}\nradius = {radius:?}\ndirection = \"{direction}\"\n\
         side = \"{side}\"\nturns = {turns:?}\n"
    )
}

/// Returns the scene with a head and a tail of their own sizes, or some of these.
pub fn with_ends(text: &str, random: &mut Random) -> String {
    let (team, _) = read(text);
    let mut ends = String::from("[team]\n");
    let mut add = |field: &str, size: f64| writeln!(ends, "{field} = {size:?}").unwrap();
    if random.chance(0.7) {
        add("head_width", team.width * random.magnitude(0.3, 5.0));
    }
    if random.chance(0.7) {
        add("tail_width", team.width * random.magnitude(0.3, 5.0));
    }
    if random.chance(0.7) {
        add("tail_length", 2.0 * team.hole_inset + team.link(1) * random.magnitude(0.3, 3.0));
    }
    text.replace("[team]\n", &ends)
}

/// Returns a scene of a family.
pub fn random_scene(family: usize, random: &mut Random) -> String {
    let pieces = "[path]\nkind = \"pieces\"\n";
    // Head and body links of the paper, or of any proportions.
    let (head, body) = match random.chance(0.3) {
        true => (2.86, 1.65),
        false => (random.magnitude(0.5, 5.0), random.magnitude(0.5, 5.0)),
    };
    match FAMILIES[family] {
        "spiral" => {
            let (head, body) = (random.magnitude(0.2, 20.0), random.magnitude(0.2, 20.0));
            let pitch = random.magnitude(0.05, 50.0);
            // Near enough that the way in is at most some hundred links, and far enough that most starts are legal.
            let radius = random.between(0.5, 4.0) * head.max(body) + random.between(0.2, 2.0) * pitch;
            let team = team_text(random, 60.0, head, body);
            format!(
                "{team}[path]\nkind = \"spiral\"\npitch = {pitch:?}\nstart_turn = {:?}\n",
                (radius / pitch).min(40.0)
            )
        }
        "turnaround" => {
            let pitch = random.magnitude(0.3, 3.0);
            let (radius, ratio) = (pitch * random.between(0.8, 4.0), random.magnitude(0.25, 4.0));
            let (lead_in, lead_out) = (random.between(0.0, 40.0), random.between(1.0, 60.0));
            let mut text = team_text(random, 60.0, head, body);
            write!(
                text,
                "[path]\nkind = \"turnaround\"\npitch = {pitch:?}\nturn_radius = {radius:?}\narc_ratio = {ratio:?}\n\
                 lead_in = {lead_in:?}\n"
            )
            .unwrap();
            if random.chance(0.5) {
                writeln!(text, "lead_out = {lead_out:?}").unwrap();
            }
            text
        }
        "route" => {
            let mut text = team_text(random, 30.0, head, body);
            let (x, y) = (random.between(-5.0, 5.0), random.between(-5.0, 5.0));
            let turns = random.between(-1.0, 1.0);
            write!(text, "{pieces}start = [{x:?}, {y:?}]\nheading_turns = {turns:?}\n").unwrap();
            for _ in 0..random.between(1.0, 13.0) as usize {
                text += &match random.chance(0.4) {
                    true => line(random.magnitude(0.05, 15.0)),
                    false => arc(random.magnitude(0.3, 10.0), random.between(0.02, 1.2), random.chance(0.5)),
                };
            }
            text
        }
        "tight bends" => {
            let mut text = team_text(random, 20.0, head, body) + pieces + &line(random.between(0.5, 20.0));
            for _ in 0..random.between(1.0, 9.0) as usize {
                text += &match random.between(0.0, 1.0) {
                    share if share < 0.3 => line(random.magnitude(0.02, 5.0)),
                    share if share < 0.65 => {
                        arc(random.magnitude(0.3, 4.0), random.between(0.1, 1.1), random.chance(0.5))
                    }
                    _ => arc(random.magnitude(0.005, 0.3), random.between(0.02, 0.35), random.chance(0.5)),
                };
            }
            // A head on a small circle makes the team behind it go to and fro.
            text + &match random.chance(0.3) {
                true => arc(random.magnitude(0.01, 0.3), random.between(1.0, 4.0), random.chance(0.5)),
                false => line(random.between(1.0, 10.0)),
            }
        }
        "U-turn" => {
            let near = 0.5 * if random.chance(0.5) { head } else { body };
            let radius = match random.chance(0.4) {
                // In an arc that is hardly narrower than the link the checker's steps are as short as that little.
                true if random.chance(0.5) => near * (1.0 + random.magnitude(1e-9, 1e-3)),
                true => near * (1.0 - random.magnitude(1e-4, 1e-2)),
                false => random.magnitude(0.005, 3.0),
            };
            let team = team_text(random, 20.0, head, body);
            let lines = [random.between(1.0, 30.0), random.between(1.0, 40.0)].map(line);
            let turns = if random.chance(0.75) { 0.5 } else { random.between(0.1, 1.5) };
            format!("{team}{pieces}{}{}{}", lines[0], arc(radius, turns, random.chance(0.5)), lines[1])
        }
        "spirals in a route" => {
            let team = team_text(random, 30.0, head, body);
            let (x, y) = (random.between(-5.0, 5.0), random.between(-5.0, 5.0));
            let mut text =
                format!("{team}{pieces}start = [{x:?}, {y:?}]\nheading_turns = {:?}\n", random.between(-1.0, 1.0));
            for _ in 0..random.between(1.0, 6.0) as usize {
                text += &match random.between(0.0, 1.0) {
                    share if share < 0.25 => line(random.magnitude(0.05, 15.0)),
                    share if share < 0.5 => {
                        arc(random.magnitude(0.3, 6.0), random.between(0.02, 0.8), random.chance(0.5))
                    }
                    _ => spiral(random, head.max(body)),
                };
            }
            text + &spiral(random, head.max(body)) + &line(random.between(0.5, 10.0))
        }
        _ => {
            // Two arcs of 135 degrees: a link of 1 / (sqrt(2) - 1) radii just locks in them.
            let near = (2f64.sqrt() - 1.0) * if random.chance(0.5) { head } else { body };
            let radius = near * (1.0 + random.magnitude(1e-5, 0.2) * if random.chance(0.5) { 1.0 } else { -1.0 });
            let left = random.chance(0.5);
            let team = team_text(random, 20.0, head, body);
            let lines = [random.between(1.0, 10.0), random.between(1.0, 20.0)].map(line);
            format!("{team}{pieces}{}{}{}{}", lines[0], arc(radius, 0.375, left), arc(radius, 0.375, !left), lines[1])
        }
    }
}
