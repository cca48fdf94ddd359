//! `plan turn`: the least turn radius.

use bench_dragon::certify::plan::{LeastTurn, Planned, Spaced, TurnLimit, TurnLine, least_turn};
use bench_dragon::messages::state::EventKind;
use bench_dragon::show::scene::{Accepted, Scene};

use super::super::events::bench_name;
use super::super::signals::{are_searches_stopped, report, unstopped};
use super::super::{CommandError, Common, Output, progress_bar};
use super::stage::{on_stage, stage_sentence};
use super::{Spacing, are_too_near, given_up, warn_of_route};

/// Plans the turn.
pub fn plan_turn(common: &Common, arc_ratio: Option<f64>, spacing: &Spacing) -> Result<(), CommandError> {
    if let Some(ratio) = arc_ratio {
        Accepted::ARC_RATIO.check("--arc-ratio", ratio)?;
    }
    let (scene, motion) = common.scene_text()?.parse_only()?;
    let clearance = spacing.required(&scene)?;
    let description = motion.description();
    let Some(pitch) = description.pitch().or_else(|| description.turn().map(|turn| turn.pitch)) else {
        let sentence = "the scene's path is a route without a turn, or with several: expected path.kind \"spiral\" or \
                        \"turnaround\", or a route with one piece of kind \"turn\"";
        return Err(CommandError::BadInput(sentence.to_owned()));
    };
    warn_of_route(&scene, "the rest of the route", "boards on an S between two spirals that are long enough");
    let bar = progress_bar(1000, common).with_message("searching for the turn");
    let mut progress = |share| report(&bar, share);
    let asked = Spaced { team: motion.team(), clearance };
    let found = least_turn(asked, pitch, arc_ratio, &mut progress)?;
    let planned = Planned::Turn { arc_ratio: found.arc_ratio };
    let stage = on_stage(&motion, asked, planned, found.value_hi, &mut progress);
    bar.finish_and_clear();
    let mut output = Output::standard();
    if common.json {
        let line = TurnLine::new(&found, pitch, clearance, &stage, &motion, are_searches_stopped());
        output.json(&line)?;
    } else {
        for sentence in sentences(&scene, pitch, clearance, arc_ratio.is_none(), &found) {
            output.line(&sentence)?;
        }
        if let Some(sentence) = stage_sentence(&stage, &motion, "turn radius", found.value_hi) {
            output.line(&sentence)?;
        }
    }
    output.finish().and(unstopped())
}

fn sentences(scene: &Scene, pitch: f64, clearance: f64, is_best: bool, found: &LeastTurn) -> Vec<String> {
    let LeastTurn { value_lo, value_hi, value, length, from, arc_ratio, limit, proved, intervals, leads, .. } = *found;
    let mut sentences = Vec::new();
    if let (Some(radius), Some(length)) = (value, length) {
        sentences.push(format!(
            "With a turn radius of {radius} m and an arc ratio of {arc_ratio} the team turns round on a pitch of {pitch} m{}: \
             the S is {length:.8} m long.",
            if proved { "" } else { ", as far as the ordinary search finds" }
        ));
    }
    if let Some(limit) = limit {
        sentences.push(limit_sentence(scene, value_lo, clearance, &limit));
    }
    let too_near = are_too_near(clearance);
    sentences.push(match (value_hi, leads) {
        (Some(value_hi), Some([lead_in, lead_out])) => format!(
            "{} with every radius from {from} m to {value_lo} m a link stalls or locks, a nearer place of the path comes \
             to its length, or two boards {too_near}; with {value_hi} m nothing of this happens, from any distance \
             ({lead_in:.3} m before the S in steps, further out by Lemma 8) until the head is {lead_out:.3} m past the \
             S and the last bench has turned. Larger radii are not covered.",
            if proved { "Proved:" } else { "Not decided to 1e-8 m. What is proved:" }
        ),
        _ if intervals > 0 => format!(
            "Not decided: the search {} after {intervals} intervals of radii. What is proved: with every radius from \
             {from} m to {value_lo} m a link stalls or locks, a nearer place of the path comes to its length, or two boards \
             {too_near}.",
            given_up()
        ),
        _ => format!("Not decided: the search {}, and nothing is proved.", given_up()),
    });
    if is_best {
        sentences.push(format!(
            "The arc ratio {arc_ratio} is the best that the search found; that no other is better is not proved."
        ));
    }
    sentences.push(
        "This is the least among S-curves that begin and end at the same radius; with unequal radii shorter ones exist."
            .to_owned(),
    );
    sentences
}

fn limit_sentence(scene: &Scene, value_lo: f64, clearance: f64, limit: &TurnLimit) -> String {
    let TurnLimit { kind, bench_a, bench_b, past } = *limit;
    let bench = bench_name(scene, bench_a);
    let place = format!("{past:.6} m past the beginning of the S");
    match (kind, bench_b) {
        (EventKind::Lock, _) => {
            format!("With {value_lo} m {bench} (counting from 1) locks, its rear handle being {place}.")
        }
        (EventKind::Stall, _) => {
            format!("With {value_lo} m {bench} (counting from 1) stalls, its front handle being {place}.")
        }
        (_, other) => format!(
            "With {value_lo} m {bench} and {} (counting from 1) {}, the head being {place}.",
            bench_name(scene, other.unwrap_or(bench_a)),
            are_too_near(clearance)
        ),
    }
}
