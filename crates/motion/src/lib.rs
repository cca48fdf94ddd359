//! The motion: a team on a path at a speed, with a method to solve it. This crate alone decides what a show computes:
//! the solver and the reason for it, the events, the live clearance, the time of a travelled distance, and the outline
//! to draw.
//!
//! In: the numbers of a scene. Only `model` distinguishes the kinds of curves.

#[cfg(test)]
mod cases;
pub mod clearance;
pub mod contact;
pub mod ensemble;
pub mod event;
mod followed;
pub mod ground;
pub mod linkage;
pub mod model;
pub mod placement;
pub mod singularities;
pub mod solve;
pub mod sweep;
pub mod timeline;

use bench_dragon_messages::state::EventKind;

use crate::model::board::Board;
use crate::model::description::PathDescription;
use crate::model::path::{Disjoint, Path};
use crate::model::segment::SegmentOutline;
use crate::model::team::Team;
use crate::solve::newton::Newton;
use crate::solve::paper::{self, Paper, PaperRules};
use crate::solve::selection::{self, Selection};
use crate::solve::table::{FollowerTable, Instructions};
use crate::solve::{Solver, Velocities};

use clearance::{ClearanceMonitor, Pairs, Precision};
use contact::{Found, LeastClearance, ObstacleClearance, Touch};
use event::{Budget, Event, Progress, unreported};
use followed::Followed;
use ground::Ground;
use placement::{Placed, Placement};
use singularities::Singularities;

/// The choice of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The cheapest solver whose measured position error meets this accuracy, in metres.
    Accuracy(f64),
    /// Exact motion, each follower bracketed.
    Newton,
    /// Exact motion, every handle interpolated in a table of the chain's places.
    FollowerTable,
    /// The paper's rules, on a spiral.
    Paper(PaperRules),
}

/// A solver and the reason for its choice.
pub struct Choice {
    /// The solver.
    pub solver: Box<dyn Solver>,
    /// Its name, its settings and the reason, for people.
    pub reason: String,
    /// The accuracy of the solver's table, in metres; 0 without a table.
    accuracy: f64,
}

impl Choice {
    /// Returns the greatest difference, metres, between the clearance of a frame and the clearance of exact motion. The
    /// difference is twice the displacement of a board's points for handles with the error that the solver promises.
    pub fn clearance_error(&self, team: &Team) -> f64 {
        let factor = |bench| Board::displacement_factor(team.link(bench), team.hole_inset, team.board_width(bench));
        2.0 * team.kinds().map(factor).into_iter().fold(0.0, f64::max) * self.accuracy
    }
}

/// A motion that is impossible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The path has a gap or a corner.
    #[error("the path has a gap: {0}")]
    Disjoint(#[from] Disjoint),
    /// The path is not the spiral of the paper's rules.
    #[error("the paper's solver follows an inward spiral to its centre and no other path")]
    PaperElsewhere,
}

/// A team on a path.
///
/// # Examples
///
/// ```
/// use bench_dragon_motion::model::description::PathDescription;
/// use bench_dragon_motion::model::team::{Ends, Team};
/// use bench_dragon_messages::state::EventKind;
/// use bench_dragon_motion::ensemble::Ensemble;
/// use bench_dragon_motion::event::unreported;
/// use bench_dragon_motion::{Method, Motion};
///
/// let team = Team { benches: 20, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };
/// let path = PathDescription::Spiral { pitch: 0.55, start_turn: 16.0 };
/// let motion = Motion::new(path, team, 1.0, Method::Newton)?;
/// let timeline = Ensemble::alone(motion).timeline(&mut unreported);
/// let contact = timeline.find(EventKind::Contact).unwrap();
/// assert!((contact.time - 412.473_837_682).abs() < 1e-9);
/// assert_eq!((contact.event.bench_a, contact.event.bench_b), (Some(0), Some(8)));
/// assert_eq!(timeline.end().event.kind, EventKind::Lock);
/// # Ok::<(), bench_dragon_motion::MotionError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    description: PathDescription,
    path: Path,
    team: Team,
    head_speed: f64,
    method: Method,
    instructions: Instructions,
    placement: Placement,
    /// In stage coordinates.
    ground: Ground,
    followed: Followed,
}

/// The events of a motion, in no order.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionEvents {
    /// The events, at places of the head. The obstacles' numbers follow the motion's own handles.
    pub events: Vec<Event>,
    /// The metres of the head's travel up to which the events are complete, if a search gave up before the end.
    pub searched_until: Option<f64>,
}

/// Units of work after which the search for a contact, or for the least clearance, gives up: about half a minute.
const CONTACT_BUDGET: u64 = 100_000_000;

const NO_TABLE: &str = "there is no table for this team and path";

/// Describes the measured error of a table, for people.
fn measured(selection: &Selection, requested: f64) -> String {
    let Selection { table, accuracy, error, test_points, made_in, .. } = selection;
    let target = if !selection.meets() {
        format!("the best there is for the {requested:e} m requested")
    } else if selection.is_at_the_floor() {
        format!("for the {requested:e} m requested, which doubles cannot hold everywhere here")
    } else if *accuracy < requested {
        format!("for the {requested:e} m requested, taken as {accuracy:.1e} m, a thousandth of a link")
    } else {
        format!("for the {requested:e} m requested")
    };
    format!(
        "{error:.1e} m measured against newton at {test_points} moments, {target}; {:.0} bytes a handle, {:.2} of the \
         most exact table's, {} kB, made in {:.0} ms",
        table.bytes_per_handle(),
        table.relative_cost(),
        table.memory_bytes().div_ceil(1000),
        1e3 * made_in.as_secs_f64()
    )
}

impl Motion {
    /// Creates the motion of `team`, its head moving at `head_speed` metres per second along the path.
    ///
    /// # Errors
    /// [`MotionError`]
    pub fn new(description: PathDescription, team: Team, head_speed: f64, method: Method) -> Result<Self, MotionError> {
        let path = description.path()?;
        if matches!(method, Method::Paper(_)) && path.as_spiral().is_none() {
            return Err(MotionError::PaperElsewhere);
        }
        let instructions = Instructions::fastest(team.handles());
        let (placement, ground) = (Placement::IDENTITY, Ground::default());
        let followed = Followed::default();
        Ok(Self { description, path, team, head_speed, method, instructions, placement, ground, followed })
    }

    /// Returns the same motion at another place of the stage.
    pub fn placed(self, placement: Placement) -> Self {
        Self { placement, ..self }
    }

    /// Returns the same motion on a stage with these obstacles, which are in stage coordinates.
    pub fn on_ground(self, ground: Ground) -> Self {
        Self { ground, ..self }
    }

    /// Returns the obstacles, in stage coordinates.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// Returns the same motion in the path's own coordinates: its chains are those of [`Motion::path`].
    pub fn in_own_frame(&self) -> Self {
        let ground = self.ground.in_own_frame(&self.placement);
        Self { ground, ..self.clone().placed(Placement::IDENTITY) }
    }

    /// Returns the mapping of the path's own coordinates to the stage.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Returns the numbers of which the path is made.
    pub fn description(&self) -> &PathDescription {
        &self.description
    }

    /// Returns the benches.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Returns the speed of the head along the curve, in metres per second.
    pub fn head_speed(&self) -> f64 {
        self.head_speed
    }

    /// Returns the choice of the solver.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Returns the same motion with another method.
    ///
    /// # Errors
    /// [`MotionError::PaperElsewhere`]
    pub fn with_method(&self, method: Method) -> Result<Self, MotionError> {
        let other = Self::new(self.description.clone(), self.team, self.head_speed, method)?;
        let Self { instructions, placement, ref ground, ref followed, .. } = *self;
        Ok(Self { instructions, placement, ground: ground.clone(), followed: followed.clone(), ..other })
    }

    /// Returns the instructions that read a table: the fastest of this processor, unless others were requested.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Returns the same motion with other instructions, or `None` if this processor lacks them.
    pub fn with_instructions(self, instructions: Instructions) -> Option<Self> {
        instructions.is_available().then_some(Self { instructions, ..self })
    }

    /// Returns the greatest error of the links of this motion's frames, metres, besides 1e-12 of their length and the
    /// rounding of the handles' coordinates.
    pub fn link_tolerance(&self) -> f64 {
        // Each end of a link may have the rounding of a product and of a sum, in both coordinates.
        let placed = self.placement.origin().coords.amax();
        let rounding = 4.0 * f64::EPSILON * self.path.largest_summand(self.team.length()).max(placed);
        match self.method {
            Method::Accuracy(accuracy) => selection::link_tolerance(&self.team, accuracy) + rounding,
            _ => rounding,
        }
    }

    /// Returns the simulated seconds after which the head has travelled `travelled` metres along the path with this
    /// method.
    pub fn time_at(&self, travelled: f64) -> f64 {
        match (self.method, self.path.as_spiral()) {
            (Method::Paper(_), Some((spiral, start))) => {
                let theta = self.path.param_at(travelled).at.high;
                paper::time_of_theta(spiral, start.high, self.head_speed, theta)
            }
            _ => travelled / self.head_speed,
        }
    }

    /// Returns the outline of the path on the stage, segment by segment.
    pub fn outline(&self) -> Vec<SegmentOutline> {
        self.path.outline().into_iter().map(|segment| self.placement.outline(segment)).collect()
    }

    /// Makes the solver, as [`Motion::solver_unless_stopped`] does, but cannot be stopped.
    pub fn solver(&self, velocities: Velocities) -> Choice {
        let made = self.solver_unless_stopped(velocities, &mut unreported);
        // `unreported` stops nothing.
        made.unwrap_or_else(|| self.newton(velocities, "newton".to_owned()))
    }

    /// Makes the solver, with its table if it has one. Its chains are placed on the stage. Returns `None` if `progress`,
    /// whose share stays 0, stops the making.
    pub fn solver_unless_stopped(&self, velocities: Velocities, progress: Progress<'_>) -> Option<Choice> {
        let choice = self.solver_in_own_frame(velocities, progress)?;
        if self.placement.is_identity() {
            return Some(choice);
        }
        Some(Choice { solver: Box::new(Placed { solver: choice.solver, placement: self.placement }), ..choice })
    }

    fn newton(&self, velocities: Velocities, reason: String) -> Choice {
        let newton = Newton::new(self.path().clone(), self.team, self.head_speed, velocities);
        Choice { solver: Box::new(newton), reason, accuracy: 0.0 }
    }

    fn solver_in_own_frame(&self, velocities: Velocities, progress: Progress<'_>) -> Option<Choice> {
        if !self.search_branches(&mut |_| progress(0.0)) {
            return None;
        }
        let newton = |reason: String| self.newton(velocities, reason);
        let choice = match (self.method, self.path.as_spiral()) {
            (Method::Accuracy(accuracy), _) => {
                let (team, head_speed, with) = (self.team, self.head_speed, self.instructions);
                match selection::cheapest_with(self.path(), team, head_speed, velocities, accuracy, with, progress) {
                    Some(selection) => {
                        let why = measured(&selection, accuracy);
                        self.chosen_table(selection.table, &why)
                    }
                    None => newton(format!(
                        "newton: {NO_TABLE} that is as exact, and {accuracy:e} m is met by exact motion alone"
                    )),
                }
            }
            (Method::FollowerTable, _) => {
                let table = FollowerTable::new(self.path(), self.team, self.head_speed, velocities, progress);
                match table.and_then(|table| table.with_instructions(self.instructions)) {
                    Some(table) => self.chosen_table(table, "named by the scene"),
                    None => newton(format!("newton: the scene names follower_table, but {NO_TABLE}")),
                }
            }
            (Method::Paper(rules), Some((spiral, start))) => {
                let paper = Paper::new(*spiral, start.high, self.team, self.head_speed, velocities, rules);
                let reason = "paper: named by the scene; its head is too fast by sqrt(1 + 1/theta^2)".to_owned();
                Choice { solver: Box::new(paper), reason, accuracy: 0.0 }
            }
            (Method::Newton | Method::Paper(_), _) => newton("newton: named by the scene".to_owned()),
        };
        // Without a table because it was stopped, the choice is another one.
        progress(0.0).is_continue().then_some(choice)
    }

    fn chosen_table(&self, table: FollowerTable, why: &str) -> Choice {
        let valid = if table.valid_until() * self.head_speed < self.path.length() {
            format!(" up to {:.3} s, then newton", table.valid_until())
        } else {
            String::new()
        };
        let reason = format!("follower_table ({}, {}){valid}: {why}", table.instructions().name(), table.format());
        Choice { solver: Box::new(table.for_frames()), reason, accuracy: table.accuracy() }
    }

    /// Makes the monitor of the live clearance of this motion's frames, with its obstacles, in the path's own
    /// coordinates. `choice` is the solver of the same frames.
    pub fn clearance_monitor(&self, choice: &Choice) -> ClearanceMonitor {
        let ground = self.ground.in_own_frame(&self.placement);
        ClearanceMonitor::new(&[self.team], Pairs::Own, ground, self.precision(choice))
    }

    /// Returns the precision of this motion's frames.
    pub(crate) fn precision(&self, choice: &Choice) -> Precision {
        let seconds_per_link = self.team.shortest_link() / self.head_speed;
        Precision { handle_error: choice.accuracy, seconds_per_link }
    }

    /// Returns the metres that the head has travelled at a time; NaN if the method does not follow the path exactly.
    pub fn travelled_at(&self, time: f64) -> f64 {
        match self.method {
            Method::Paper(_) => f64::NAN,
            _ => self.head_speed * time,
        }
    }

    /// Returns all events, contact included. `progress` is called at times with the share of the search that is done,
    /// from 0 to 1.
    pub fn events(&self, progress: Progress<'_>) -> MotionEvents {
        let found = self.singularities(&mut |share| progress(0.1 * share));
        let end = self.end(&found);
        let mut searched_until = found.searched_until;
        let mut events: Vec<Event> = found.stall.into_iter().chain([end]).collect();
        let part = if self.ground.is_empty() { 0.9 } else { 0.5 };
        let mut of_contact = |share: f64| progress(0.1 + part * share);
        let mut budget = Budget::new(CONTACT_BUDGET, &mut of_contact);
        let until = end.travelled.min(searched_until);
        match self.advancement(&found).first_contact(0.0, until, &mut budget) {
            Ok(contact) => {
                searched_until = searched_until.min(contact.searched_until);
                events.extend(contact.value);
            }
            Err(stuck) => {
                log::warn!("the search for a contact stopped at a place without a solution: {stuck}");
                searched_until = 0.0;
            }
        }
        if !self.ground.is_empty() {
            let (touches, reached) = self.touches(&found, until, &mut |share| progress(0.6 + 0.4 * share));
            searched_until = searched_until.min(reached);
            events.extend(touches);
        }
        self.placed_events(events, searched_until)
    }

    /// Returns the first touch of each obstacle up to a place of the head, and the place up to which the search came.
    fn touches(&self, found: &Singularities, until: f64, progress: Progress<'_>) -> (Vec<Event>, f64) {
        let ground = self.ground.in_own_frame(&self.placement);
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        match self.advancement(found).first_touches(&ground, 0.0, until, &mut budget) {
            Ok((touches, reached)) => {
                let reached = if reached < until { reached } else { f64::INFINITY };
                (touches.into_iter().flatten().map(|touch| self.touch_event(touch)).collect(), reached)
            }
            Err(stuck) => {
                log::warn!("the search for obstacles stopped at a place without a solution: {stuck}");
                (Vec::new(), 0.0)
            }
        }
    }

    fn touch_event(&self, Touch { obstacle, travelled, bench, place }: Touch) -> Event {
        let bench_b = Some((self.team.handles() + obstacle) as u32);
        Event { kind: EventKind::Obstacle, travelled, bench_a: Some(bench), bench_b, place: Some(place) }
    }

    /// Returns the events without contacts and obstacles, which cost a search.
    pub fn events_without_contact(&self, progress: Progress<'_>) -> MotionEvents {
        let found = self.singularities(progress);
        let end = self.end(&found);
        self.placed_events(found.stall.into_iter().chain([end]).collect(), found.searched_until)
    }

    /// Returns the least clearance of two boards that share no handle, from one place of the head to another. Returns
    /// `None` for fewer than three benches, and if a place inside the motion has no solution. `progress` is called as
    /// by [`Motion::events`].
    pub fn least_clearance(&self, (from, to): (f64, f64), progress: Progress<'_>) -> Option<Found<LeastClearance>> {
        if self.team.benches < 3 {
            return None;
        }
        let found = self.singularities(&mut |_| progress(0.0));
        let to = found.known_to(to).max(from);
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        self.advancement(&found).least_clearance(from, to, &mut budget).ok()
    }

    /// Returns the least clearance of each obstacle from the start to a place of the head. `progress` is called as by
    /// [`Motion::events`]. Returns the clearances in the order of the obstacles, and the place up to which the search
    /// came. The list is empty without obstacles, and if a place inside the motion has no solution.
    pub fn obstacle_clearances(&self, to: f64, progress: Progress<'_>) -> (Vec<Option<ObstacleClearance>>, f64) {
        if self.ground.is_empty() {
            return (Vec::new(), to);
        }
        let found = self.singularities(&mut |_| progress(0.0));
        let to = found.known_to(to);
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        let ground = self.ground.in_own_frame(&self.placement);
        self.advancement(&found).obstacle_clearances(&ground, 0.0, to, &mut budget).unwrap_or((Vec::new(), to))
    }

    /// Returns the lock or path end; if the search gave up before either, the path's end.
    fn end(&self, found: &Singularities) -> Event {
        let path_end = EventKind::PathEnd;
        let travelled = self.path.length();
        found.end.unwrap_or(Event { kind: path_end, travelled, bench_a: None, bench_b: None, place: None })
    }

    /// Returns the time of an event. The time of a lock, multiplied by the speed, is never past the lock: there a handle
    /// has no place.
    pub fn time_of(&self, event: &Event) -> f64 {
        let time = self.time_at(event.travelled);
        let is_past = event.kind == EventKind::Lock && self.travelled_at(time) > event.travelled;
        if is_past { time.next_down() } else { time }
    }

    /// Returns the events, placed on the stage, and the place of the head up to which they are complete.
    fn placed_events(&self, events: Vec<Event>, searched_until: f64) -> MotionEvents {
        let end = events.iter().fold(0.0, |end: f64, event| end.max(event.travelled));
        let placed = |event: Event| Event { place: event.place.map(|place| self.placement.point(place)), ..event };
        let events = events.into_iter().map(placed).collect();
        MotionEvents { events, searched_until: (searched_until < end).then_some(searched_until) }
    }
}
