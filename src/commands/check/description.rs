//! The report of `check` on a scene without its motion: teams, paths, placements, solvers, alerts and outputs.

use bench_dragon::motion::Motion;
use bench_dragon::motion::ensemble::Dragon;
use bench_dragon::motion::model::segment::SegmentOutline;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::placement::Placement;
use bench_dragon::motion::solve::Velocities;
use bench_dragon::show::scene::{AtEnd, OnContact, Scene};

use super::super::signals::report;
use super::super::{CommandError, Common, Output, figure, number, table_bar};

/// Prints the description of a scene.
pub(super) fn describe(
    scene: &Scene,
    warnings: &[String],
    common: &Common,
    output: &mut Output,
) -> Result<(), CommandError> {
    let judged = if warnings.is_empty() { "is valid." } else { "can be played, but probably not as it is meant:" };
    output.line(&format!("Scene \"{}\" {judged}", scene.name))?;
    warnings.iter().try_for_each(|warning| output.line(&format!("  Warning: {warning}")))?;
    dragons(scene, output)?;
    if !scene.team_defaults.is_empty() {
        let separator = if scene.ensemble.only().is_some() { ", " } else { "; " };
        output.line(&format!("  By default, in metres: {}.", scene.team_defaults.join(separator)))?;
    }
    if !scene.ensemble.ground().is_empty() {
        output.line(&format!("  Stage: {}.", ground(scene)))?;
    }
    solvers(scene, common, output)?;
    alerts(scene, output)?;
    publishing(scene, output)
}

/// Prints each dragon; with a name, also its place in the show.
fn dragons(scene: &Scene, output: &mut Output) -> Result<(), CommandError> {
    for (k, Dragon { name, delay, motion }) in scene.ensemble.dragons().iter().enumerate() {
        let handles = scene.ensemble.handles_of(k);
        let (first, last) = (handles.start, handles.end - 1);
        if !name.is_empty() {
            output.line(&format!("  Dragon {}, {name}: handles {first} to {last}, counting from 0.", k + 1))?;
        }
        dragon(motion, scene.placement.as_ref().unwrap_or(motion.placement()), output)?;
        if *delay > 0.0 {
            output.line(&format!("  It stands at its start for {} s.", number(*delay)))?;
        }
    }
    Ok(())
}

/// Makes and prints the solver of each dragon, and prints whether velocities are computed.
fn solvers(scene: &Scene, common: &Common, output: &mut Output) -> Result<(), CommandError> {
    for dragon in scene.ensemble.dragons() {
        let bar = table_bar(common);
        let made = dragon.motion.solver_unless_stopped(scene.velocities, &mut |share| report(&bar, share));
        bar.finish_and_clear();
        let reason = made.map_or_else(|| "not known, because the command was stopped".to_owned(), |of| of.reason);
        output.line(&format!("  {}: {reason}.", dragon.titled("Solver")))?;
    }
    output.line(match scene.velocities {
        Velocities::Computed => "  Velocities: computed for every handle.",
        Velocities::Omitted => "  Velocities: not computed; vx and vy are NaN.",
    })
}

/// Prints the rules of alerts, and what the show does at a contact and at its end.
fn alerts(scene: &Scene, output: &mut Output) -> Result<(), CommandError> {
    match scene.alerts {
        Some(rules) => {
            output.line(&format!(
                "  Alerts: the clearance of every frame, contact and stall; a warning {} s or {} m ahead.",
                rules.approach_time, rules.approach_clearance
            ))?;
        }
        None => output.line(
            "  Alerts: none. `run` computes no rectangle, no clearance, no contact and no stall, and has no alerts \
             service: add an [alerts] table for those.",
        )?,
    }
    output.line(&format!(
        "  At a contact the show {}; at its end it {}.",
        match (scene.alerts, scene.on_contact) {
            (Some(_), OnContact::Stop) => "freezes",
            (Some(_), OnContact::Continue) => "continues",
            (None, _) => "continues, unnoticed",
        },
        match scene.at_end {
            AtEnd::Hold => "holds the last frame",
            AtEnd::Loop => "begins again",
        }
    ))
}

/// Prints the destinations of the frames.
fn publishing(scene: &Scene, output: &mut Output) -> Result<(), CommandError> {
    let single = scene.single_precision.map_or(String::new(), |single| format!("; poses32 has {single}"));
    output.line(&format!("  Publishing: {} frames per second to shared memory{single}.", number(scene.rate)))?;
    output.line(&match &scene.ros2 {
        Some(settings) => format!(
            "  ROS 2: {} at {} frames per second.",
            settings
                .offered(scene.alerts.is_some(), !scene.cues.is_empty())
                .map(|topic| topic.name())
                .collect::<Vec<_>>()
                .join(", "),
            number(settings.rate_of(scene.rate))
        ),
        None => "  ROS 2: nothing and no network socket, unless `run --ros2` requests it.".to_owned(),
    })
}

/// Prints the team, the path and the placement of a dragon.
fn dragon(motion: &Motion, placement: &Placement, output: &mut Output) -> Result<(), CommandError> {
    let team = motion.team();
    output.line(&format!(
        "  Team: {} benches, {} handles; head board {} m, the others {} m, {} m wide, holes {} m from the ends.",
        team.benches,
        team.handles(),
        team.head_length,
        team.body_length,
        team.width,
        team.hole_inset
    ))?;
    if let Some(ends) = own_ends(team) {
        output.line(&format!("  {ends}"))?;
    }
    output.line(&format!("  Path: {}; the head moves at {} m/s.", path(motion), motion.head_speed()))?;
    match placed(placement) {
        Some(sentence) => output.line(&format!("  {sentence}")),
        None => Ok(()),
    }
}

/// Returns a sentence for people on the sizes of head and tail that are not the body's; `None` if there are none.
fn own_ends(team: &Team) -> Option<String> {
    let Ends { head_width, tail_width, tail_length } = team.ends;
    let head = head_width.map(|width| format!("the head is {width} m wide"));
    let is_last_of_several = team.benches > 1;
    let tail = [(tail_length, "long"), (tail_width, "wide")].map(|(size, what)| Some(format!("{} m {what}", size?)));
    let tail: Vec<String> = tail.into_iter().flatten().filter(|_| is_last_of_several).collect();
    let tail = (!tail.is_empty()).then(|| format!("the tail's board is {}", tail.join(" and ")));
    let ends: Vec<String> = head.into_iter().chain(tail).collect();
    (!ends.is_empty()).then(|| format!("Ends: {}.", ends.join("; ")))
}

/// Returns a sentence for people on a placement, without the parts that change nothing; `None` if none does.
fn placed(placement: &Placement) -> Option<String> {
    let (origin, turns) = (placement.origin(), placement.rotation_turns());
    let mirrored = placement.is_mirrored().then(|| "mirrored".to_owned());
    let turned = (turns != 0.0).then(|| format!("turned by {} turns", number(turns)));
    let is_moved = (origin.x, origin.y) != (0.0, 0.0);
    let moved = is_moved.then(|| format!("moved by ({}, {}) m", number(origin.x), number(origin.y)));
    let parts: Vec<String> = [mirrored, turned, moved].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| format!("Placement: the path's coordinates {}.", parts.join(", then ")))
}

/// Describes the obstacles in words.
fn ground(scene: &Scene) -> String {
    let ground = scene.ensemble.ground();
    let obstacles = ground.obstacles().len() - usize::from(ground.has_boundary());
    let counted = match obstacles {
        0 => "no obstacle".to_owned(),
        1 => "1 obstacle".to_owned(),
        count => format!("{count} obstacles"),
    };
    if ground.has_boundary() { format!("{counted} and a boundary") } else { counted }
}

/// Describes the path in words.
fn path(motion: &Motion) -> String {
    let outline = motion.path().outline();
    if let [only] = outline.as_slice()
        && let Some((spiral, first, _)) = only.kind.spiral()
    {
        let (pitch, turn) = (spiral.pitch(), first / std::f64::consts::TAU);
        return format!("inward spiral, {pitch} m per turn, the head starting on turn {}", figure(turn));
    }
    let segments: Vec<String> = outline.iter().map(SegmentOutline::to_string).collect();
    format!("{:.3} m: {}", motion.path().length(), segments.join(", "))
}
