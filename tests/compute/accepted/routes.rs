//! Random scenes whose certificates are hard: tight routes, and routes of pieces with a length.

use std::fmt::Write;

use fastrand::Rng;

use crate::oracle::scenes;

/// Returns a number between two, of three decimals: junctions then come to lie at simple coordinates.
fn decimals(random: &mut Rng, low: f64, high: f64) -> f64 {
    ((low + (high - low) * random.f64()) * 1000.0).round() / 1000.0
}

/// Returns the share of a turn of an arc: often a simple one.
fn turns(random: &mut Rng) -> f64 {
    const SIMPLE: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
    match random.u8(..4) {
        0 => decimals(random, 0.02, 1.0),
        1 => random.choice(SIMPLE).unwrap_or(1.0) + decimals(random, -0.005, 0.005),
        _ => random.choice(SIMPLE).unwrap_or(1.0),
    }
    .min(1.0)
}

/// Returns a short team on a route of bends that are hardly wider than its links, or narrower.
pub fn tight_route(random: &mut Rng) -> String {
    let (head, body) = (decimals(random, 0.6, 3.0), decimals(random, 0.6, 3.0));
    let (benches, width) = (random.choice([1, 1, 2, 3, 3, 4, 6]).unwrap_or(1), decimals(random, 0.03, 0.4));
    let link = head - 0.2;
    let mut text = format!(
        "[team]\nbenches = {benches}\nhead_length = {head}\nbody_length = {body}\nwidth = {width}\nhole_inset = 0.1\n\
         [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = ["
    );
    let mut side = ["left", "right"];
    for piece in 0..1 + random.usize(..5) {
        if random.u8(..3) == 0 {
            let _ = write!(text, "{{ kind = \"line\", length = {} }}, ", decimals(random, 0.05, 4.0));
            continue;
        }
        let radius = match random.u8(..4) {
            // About the least bend that the head's link passes.
            0 => 0.5 * link * (1.0 + 10f64.powi(-random.i32(1..7)) * (2.0 * random.f64() - 1.0)),
            1 => decimals(random, 0.1, 0.5) * link + 0.001,
            _ => decimals(random, 0.2, 1.2) * link + 0.001,
        };
        // An S-bend is the rule, a longer bend to one side the exception.
        if piece > 0 && random.u8(..3) > 0 {
            side.reverse();
        }
        let _ = write!(
            text,
            "{{ kind = \"arc\", radius = {radius}, side = \"{}\", turns = {} }}, ",
            side[0],
            turns(random)
        );
    }
    text.push_str("]\n");
    text
}

/// Returns a short team on a route of bends and spirals whose lengths are given: their ends have no simple coordinates.
fn route_of_lengths(random: &mut Rng) -> String {
    let (head, body) = (decimals(random, 0.6, 3.0), decimals(random, 0.6, 3.0));
    let (benches, width) = (random.choice([1, 2, 3, 4, 6]).unwrap_or(1), decimals(random, 0.03, 0.4));
    let mut text = format!(
        "[team]\nbenches = {benches}\nhead_length = {head}\nbody_length = {body}\nwidth = {width}\nhole_inset = 0.1\n\
         [motion]\nhead_speed = 1.0\n[path]\nkind = \"pieces\"\npieces = ["
    );
    for _ in 0..1 + random.usize(..4) {
        let side = random.choice(["left", "right"]).unwrap_or("left");
        let radius = (0.3 + 2.0 * random.f64()) * head.max(body);
        match random.u8(..4) {
            0 => {
                let _ = write!(text, "{{ kind = \"line\", length = {} }}, ", decimals(random, 0.05, 4.0));
            }
            1 => {
                let length = decimals(random, 0.1, 6.0) * radius;
                let _ = write!(text, "{{ kind = \"arc\", radius = {radius}, side = \"{side}\", length = {length} }}, ");
            }
            inward => {
                let (pitch, radius) = ((0.1 + random.f64()) * radius, radius + 8.0 * random.f64());
                let to_centre = std::f64::consts::PI * radius * radius / pitch;
                let (direction, length) = match inward {
                    2 => ("in", to_centre * decimals(random, 0.01, 0.9)),
                    _ => ("out", decimals(random, 0.1, 20.0) * radius),
                };
                let _ = write!(
                    text,
                    "{{ kind = \"spiral\", pitch = {pitch}, radius = {radius}, direction = \"{direction}\", \
                     side = \"{side}\", length = {length} }}, "
                );
            }
        }
    }
    text.push_str("]\n");
    text
}

/// Returns a scene of one of all families.
pub fn scene(index: usize, random: &mut Rng) -> String {
    let last = scenes::FAMILIES.len() - 1;
    match index % 8 {
        0 => scenes::random_scene(random.usize(..last), &mut scenes::Random(random.u64(..))),
        // Routes with spirals.
        4 => scenes::random_scene(last, &mut scenes::Random(random.u64(..))),
        6 => route_of_lengths(random),
        _ => tight_route(random),
    }
}
