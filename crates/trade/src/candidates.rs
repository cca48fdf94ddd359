//! The solvers to measure: the selections for several requested accuracies, on all instruction sets; the safe solver;
//! the paper's solver.

use std::time::Instant;

use super::{Candidate, ContactErrors, Subject, WARM_UP_FRAMES};
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::solve::newton::Newton;
use bench_dragon_motion::solve::paper::{Paper, PaperRules};
use bench_dragon_motion::solve::selection;
use bench_dragon_motion::solve::table::{FollowerTable, Instructions};

/// The requested accuracies, in metres. The last selects the most exact table.
const REQUESTED_ACCURACIES: [f64; 5] = [1e-4, 1e-6, 1e-7, 1e-9, 1e-18];

/// Returns all candidates for a dragon, the most exact table on the fastest instructions first. Some are missing if
/// `progress`, whose share stays 0, stops their making.
pub(super) fn candidates(subject: &Subject, contact: Option<ContactErrors>, progress: Progress<'_>) -> Vec<Candidate> {
    let (path, team, head_speed) = (subject.motion.path(), *subject.motion.team(), subject.motion.head_speed());
    let exact_contact = contact.map(|errors| errors.exact);
    let mut candidates = Vec::new();
    for accuracy in REQUESTED_ACCURACIES.into_iter().rev() {
        // A large team may only have memory for the tables of lower accuracies.
        let selection = selection::cheapest(path, team, head_speed, subject.velocities, accuracy, progress);
        let Some(selection) = selection else { continue };
        let (table, make_s) = (selection.table.for_frames(), selection.made_in.as_secs_f64());
        let requested = if accuracy < REQUESTED_ACCURACIES[REQUESTED_ACCURACIES.len() - 2] {
            "best".to_owned()
        } else {
            format!("{accuracy:e} m")
        };
        candidates.extend(Instructions::available().into_iter().filter_map(|instructions| {
            let solver: FollowerTable = table.clone().with_instructions(instructions)?;
            Some(Candidate {
                name: format!("follower_table {requested} ({}, {})", instructions.name(), solver.format()),
                warm_up_frames: WARM_UP_FRAMES,
                // All candidates follow one motion: the contact is the same.
                contact_time_error: exact_contact,
                accuracy: Some(accuracy),
                memory_bytes: solver.memory_bytes(),
                bytes_per_handle: Some(solver.bytes_per_handle()),
                make_s,
                solver: Box::new(solver),
            })
        }));
    }
    let began = Instant::now();
    let newton = Newton::new(path.clone(), team, head_speed, subject.velocities);
    candidates.push(Candidate {
        name: "newton".to_owned(),
        warm_up_frames: WARM_UP_FRAMES,
        contact_time_error: exact_contact,
        accuracy: None,
        memory_bytes: size_of::<Newton>(),
        bytes_per_handle: None,
        make_s: began.elapsed().as_secs_f64(),
        solver: Box::new(newton),
    });
    candidates.extend(paper_candidates(subject, contact));
    candidates
}

/// Returns the paper's solver with its own numbers and with others, on a spiral.
fn paper_candidates(subject: &Subject, contact: Option<ContactErrors>) -> Vec<Candidate> {
    let (path, team, head_speed) = (subject.motion.path(), *subject.motion.team(), subject.motion.head_speed());
    let Some((spiral, start)) = path.as_spiral() else { return Vec::new() };
    // Euler steps of one show. The finest steps would take minutes if there are too many.
    let steps_to_end = |time_step: f64| path.length() / head_speed / time_step;
    let standard = PaperRules::default();
    let mut rules: Vec<(String, PaperRules)> = [1e-2, 1e-3, 1e-4, 1e-5]
        .into_iter()
        .filter(|time_step| steps_to_end(*time_step) < 1e8)
        .map(|time_step| (format!("paper (time step {time_step:e} s)"), PaperRules { time_step, ..standard }))
        .collect();
    let coarse = PaperRules { time_step: 1e-3, ..standard };
    for bisection_tolerance in [1e-4, 1e-8] {
        let name = format!("paper (time step 1e-3 s, tolerance {bisection_tolerance:e})");
        rules.push((name, PaperRules { bisection_tolerance, ..coarse }));
    }
    for difference_interval in [0.02, 2.0] {
        let name = format!("paper (time step 1e-3 s, differences over {difference_interval} s)");
        rules.push((name, PaperRules { difference_interval, ..coarse }));
    }
    let candidate = |(name, rules)| {
        let began = Instant::now();
        let solver = Paper::new(*spiral, start.high, team, head_speed, subject.velocities, rules);
        let memory_bytes = size_of::<Paper>() + 3 * 8 * team.handles();
        Candidate {
            name,
            warm_up_frames: 0,
            solver: Box::new(solver),
            contact_time_error: contact.map(|errors| errors.paper),
            accuracy: None,
            memory_bytes,
            bytes_per_handle: None,
            make_s: began.elapsed().as_secs_f64(),
        }
    };
    rules.into_iter().map(candidate).collect()
}
