//! The events of the ordinary search, each proved by a line of the certificate: at its place, or just beyond it.

use std::ops::ControlFlow;

use super::super::bracket::nearest_shown;
use super::super::capsule::Spanned;
use super::super::grid::GridPoint;
use super::super::lines::{CertificateLine, Links, Status, Witness};
use super::super::lock::LockWindow;
use super::super::place::{Place, Span};
use super::{CertificateSearch, Halt, LEAST, NEAR};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Event;

impl CertificateSearch<'_, '_> {
    /// Handles boards that overlap at the start, or a board that is at an obstacle from the start.
    pub(super) fn touch_at_start(&mut self, event: &Event) -> Result<(), Halt> {
        let (mut from, mut to) = (self.at.clone(), self.grid_point(LEAST * (1.0 + self.given.path.length())));
        self.claim_no_longer(event);
        let status = if let Some(witness) = self.witness(event, &mut from, &mut to) {
            let [bench_a, bench_b] = [0, 1].map(|k| witness.benches.get(k).copied());
            (self.write)(&CertificateLine::Witness(witness))?;
            Status::Proved { time_lo: 0.0, time_hi: 0.0, bench_a, bench_b, because: None }
        } else {
            let because = match self.number(event) {
                None => "the boards that overlap from the start overlap too little for doubles",
                Some(_) => "the board is so little within the obstacle's keep-out that doubles cannot tell",
            };
            Status::Undecided { time_lo: 0.0, because: because.to_owned() }
        };
        *self.status(event) = Some(status);
        Ok(())
    }

    /// Returns the line that two boards have a point in common, or that a point of a board is within the keep-out of an
    /// obstacle, while the head is between two grid points. Returns `None` without a proof.
    fn witness(&self, event: &Event, from: &mut GridPoint, to: &mut GridPoint) -> Option<Witness> {
        let head = Span(from.head, to.head);
        let obstacle = self.number(event);
        let bench = event.bench_a.unwrap_or(0) as usize;
        let other = event.bench_b.filter(|_| obstacle.is_none()).map(|bench| bench as usize);
        let handles = self.chain.spans(from, to, other.unwrap_or(bench) + 1)?;
        let point = match obstacle {
            Some(number) => self.chain.barriers.get(number)?.reached_by(&self.chain.board(&handles, bench))?,
            None => self.chain.common_point(&handles, [bench, other?])?,
        };
        let benches = std::iter::once(bench).chain(other).collect();
        Some(Witness { point: Some(point), ..Witness::of_one(obstacle, benches, head, &handles) })
    }

    /// Handles boards that touch, or a board that comes to an obstacle.
    pub(super) fn touch(
        &mut self,
        event: &Event,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        let number = self.number(event);
        if !number.map_or(self.clear, |number| self.free.contains(&number)) {
            return Ok(());
        }
        let earliest = self.at.head;
        self.claim_no_longer(event);
        let found = self.beyond(event, |search, point| search.witness(event, &mut point.clone(), point));
        let status = if let Some((point, witness)) = found {
            if let Err(halt) = self.go_to_point(&point, None, progress) {
                *self.status(event) = self.undecided(earliest, &halt);
                return Err(halt);
            }
            (self.write)(&CertificateLine::Witness(witness))?;
            let bench_b = event.bench_b.filter(|_| number.is_none());
            self.proved(event.kind, earliest, point.head, [event.bench_a, bench_b])
        } else {
            let because = match number {
                None => "doubles cannot tell whether the boards touch that come so near",
                Some(_) => "doubles cannot tell whether the board meets the obstacle that it comes so near",
            };
            Status::Undecided { time_lo: self.time(earliest).lo, because: because.to_owned() }
        };
        *self.status(event) = Some(status);
        Ok(())
    }

    /// Lets the steps from here on claim nothing of a contact, or of an obstacle.
    fn claim_no_longer(&mut self, event: &Event) {
        match self.number(event) {
            Some(number) => self.free.retain(|other| *other != number),
            None => self.clear = false,
        }
    }

    /// Returns the result for an event.
    fn status(&mut self, event: &Event) -> &mut Option<Status> {
        match self.number(event) {
            Some(number) => &mut self.of_obstacles[number],
            None => &mut self.proofs[event.kind as usize],
        }
    }

    /// Returns the status of an event for which the search halts on its way from `earliest` to the event. The steps of
    /// that way claim nothing of the event.
    fn undecided(&self, earliest: Place, halt: &Halt) -> Option<Status> {
        let Halt::Stuck(because) = halt else { return None };
        Some(Status::Undecided { time_lo: self.time(earliest).lo, because: because.clone() })
    }

    /// Returns the number of an event's obstacle on the stage.
    fn number(&self, event: &Event) -> Option<usize> {
        let number = (event.bench_b? as usize).checked_sub(self.given.team.benches + 1);
        number.filter(|number| event.kind == EventKind::Obstacle && *number < self.of_obstacles.len())
    }

    pub(super) fn stall(
        &mut self,
        event: &Event,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        if !self.moving {
            return Ok(());
        }
        let earliest = self.at.head;
        let link = event.bench_a.unwrap_or(0) as usize;
        self.moving = false;
        if link > 0 {
            self.covered.links = Links::All;
        }
        let found = self.beyond(event, |search, point| {
            let handles = search.chain.spans(&mut point.clone(), point, link + 1)?;
            let stalled = handles[link].capsule.product(&handles[link + 1].capsule, false).is_negative();
            stalled.then(|| handles[1..].iter().map(|handle| handle.span).collect())
        });
        let status = if let Some((point, spans)) = found {
            if let Err(halt) = self.go_to_point(&point, None, progress) {
                self.proofs[EventKind::Stall as usize] = self.undecided(earliest, &halt);
                return Err(halt);
            }
            (self.write)(&CertificateLine::Stall { link, from: point.head, to: point.head, spans })?;
            self.proved(event.kind, earliest, point.head, [event.bench_a, None])
        } else {
            let because = "doubles cannot tell whether the link stalls that comes so near a stall".to_owned();
            Status::Undecided { time_lo: self.time(earliest).lo, because }
        };
        self.proofs[EventKind::Stall as usize] = Some(status);
        Ok(())
    }

    pub(super) fn lock(&mut self, event: &Event) -> Result<(), Halt> {
        let link = event.bench_a.unwrap_or(0) as usize;
        let rear = self.spans.get(link).copied();
        let found = rear.and_then(|rear| {
            self.beyond(event, |search, to| {
                let chain = &search.chain;
                let handles = chain.spans(&mut search.at, to, link)?;
                let last = chain.spans(&mut to.clone(), to, link)?;
                let fronts = (&handles[link], &last[link]);
                let shown = chain.lock_window(&mut search.at, link, rear, fronts)?;
                let (window, beyond) = match shown {
                    LockWindow::Nearer(window) => (Some(window), None),
                    LockWindow::Further(window) => (None, Some(window)),
                };
                let spans = |handles: &[Spanned]| handles[1..].iter().map(|handle| handle.span).collect();
                let (spans, last) = (spans(&handles), spans(&last));
                Some(CertificateLine::Lock { link, to: to.head, spans, last, window, beyond })
            })
        });
        let Some((to, line)) = found else {
            let because = format!("doubles cannot tell whether bench {} (counting from 1) locks there", link + 1);
            return Err(Halt::Stuck(because));
        };
        (self.write)(&line)?;
        self.proofs[EventKind::Lock as usize] =
            Some(self.proved(event.kind, self.at.head, to.head, [event.bench_a, None]));
        Ok(())
    }

    /// Returns the nearest grid point beyond an event that is found at which `shown` returns a result, with the result.
    fn beyond<T>(
        &mut self,
        event: &Event,
        shown: impl Fn(&mut Self, &mut GridPoint) -> Option<T>,
    ) -> Option<(GridPoint, T)> {
        let around = self.around();
        let most = around.max(NEAR * self.given.team.shortest_link());
        let found = nearest_shown(around, most, |far| {
            let mut point = self.grid_point(event.travelled + far);
            // An event beyond the path's end is none of the scene.
            let length = self.given.path.length();
            if self.chain.exact.travelled(point.head).hi > length - LEAST * (1.0 + length) {
                return None;
            }
            let result = shown(self, &mut point)?;
            Some((point, result))
        });
        found.map(|(_, found)| found)
    }
}
