//! The events of the ordinary search, each proved by a line of the certificate: at its place, or just beyond it.

use std::ops::ControlFlow;

use super::super::bracket::nearest_shown;
use super::super::capsule::Spanned;
use super::super::grid::GridPoint;
use super::super::lines::{CertificateLine, Links, Status};
use super::super::lock::LockWindow;
use super::super::place::{Place, Span};
use super::{CertificateSearch, Halt, LEAST, NEAR};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::event::Event;

impl CertificateSearch<'_, '_> {
    /// Handles boards that overlap at the start.
    pub(super) fn overlap_at_start(&mut self, event: &Event) -> Result<(), Halt> {
        let (mut from, mut to) = (self.at.clone(), self.grid_point(LEAST * (1.0 + self.given.path.length())));
        self.clear = false;
        let status = if let Some((spans, point)) = self.touch(event, &mut from, &mut to) {
            let benches = benches(event);
            (self.write)(&CertificateLine::Contact { benches, from: from.head, to: to.head, spans, point })?;
            let [bench_a, bench_b] = [event.bench_a, event.bench_b].map(|bench| bench.map(|bench| bench as usize));
            Status::Proved { time_lo: 0.0, time_hi: 0.0, bench_a, bench_b, because: None }
        } else {
            let because = "the boards that overlap from the start overlap too little for doubles".to_owned();
            Status::Undecided { time_lo: 0.0, because }
        };
        self.proofs[EventKind::Contact as usize] = Some(status);
        Ok(())
    }

    /// Returns the spans of the handles from 1 on, and a point. Two boards are proved to have this point in common
    /// while the head is between two grid points. Returns `None` without a proof.
    fn touch(&self, event: &Event, from: &mut GridPoint, to: &mut GridPoint) -> Option<(Vec<Span>, [f64; 2])> {
        let benches = benches(event);
        let handles = self.chain.spans(from, to, benches[1] + 1)?;
        let point = self.chain.common_point(&handles, benches)?;
        Some((handles[1..].iter().map(|handle| handle.span).collect(), point))
    }

    pub(super) fn contact(
        &mut self,
        event: &Event,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        if !self.clear {
            return Ok(());
        }
        let earliest = self.at.head;
        self.clear = false;
        let found = self.beyond(event, |search, point| search.touch(event, &mut point.clone(), point));
        let status = if let Some((point, (spans, common))) = found {
            if let Err(halt) = self.go_to_point(&point, None, progress) {
                self.proofs[EventKind::Contact as usize] = self.undecided(earliest, &halt);
                return Err(halt);
            }
            let head = point.head;
            let line = CertificateLine::Contact { benches: benches(event), from: head, to: head, spans, point: common };
            (self.write)(&line)?;
            self.proved(event.kind, earliest, head, [event.bench_a, event.bench_b])
        } else {
            let because = "doubles cannot tell whether the boards touch that come so near".to_owned();
            Status::Undecided { time_lo: self.time(earliest).lo, because }
        };
        self.proofs[EventKind::Contact as usize] = Some(status);
        Ok(())
    }

    /// Returns the status of an event for which the search halts on its way from `earliest` to the event. The steps of
    /// that way claim nothing of the event.
    fn undecided(&self, earliest: Place, halt: &Halt) -> Option<Status> {
        let Halt::Stuck(because) = halt else { return None };
        Some(Status::Undecided { time_lo: self.time(earliest).lo, because: because.clone() })
    }

    /// Returns the number of an event's obstacle on the stage.
    fn number(&self, event: &Event) -> Option<usize> {
        (event.bench_b? as usize).checked_sub(self.given.team.benches + 1)
    }

    /// Returns the spans of the handles from 1 on, and a point of the board. This point is proved to be within the
    /// keep-out while the head is between two grid points. Returns `None` without a proof.
    fn reach(&self, event: &Event, from: &mut GridPoint, to: &mut GridPoint) -> Option<(Vec<Span>, [f64; 2])> {
        let (bench, number) = (event.bench_a? as usize, self.number(event)?);
        let handles = self.chain.spans(from, to, bench + 1)?;
        let point = self.chain.barriers.get(number)?.reached_by(&self.chain.board(&handles, bench))?;
        Some((handles[1..].iter().map(|handle| handle.span).collect(), point))
    }

    /// Handles a board that is at an obstacle from the start.
    pub(super) fn at_obstacle_at_start(&mut self, event: &Event) -> Result<(), Halt> {
        let Some(obstacle) = self.number(event) else { return Ok(()) };
        let (mut from, mut to) = (self.at.clone(), self.grid_point(LEAST * (1.0 + self.given.path.length())));
        self.free.retain(|other| *other != obstacle);
        let bench = event.bench_a.unwrap_or(0) as usize;
        let status = if let Some((spans, point)) = self.reach(event, &mut from, &mut to) {
            (self.write)(&CertificateLine::Reached { obstacle, bench, from: from.head, to: to.head, spans, point })?;
            Status::Proved { time_lo: 0.0, time_hi: 0.0, bench_a: Some(bench), bench_b: None, because: None }
        } else {
            let because = "the board is so little within the obstacle's keep-out that doubles cannot tell".to_owned();
            Status::Undecided { time_lo: 0.0, because }
        };
        self.of_obstacles[obstacle] = Some(status);
        Ok(())
    }

    pub(super) fn obstacle(
        &mut self,
        event: &Event,
        progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    ) -> Result<(), Halt> {
        let Some(obstacle) = self.number(event).filter(|number| self.free.contains(number)) else { return Ok(()) };
        let earliest = self.at.head;
        self.free.retain(|other| *other != obstacle);
        let bench = event.bench_a.unwrap_or(0) as usize;
        let found = self.beyond(event, |search, point| search.reach(event, &mut point.clone(), point));
        let status = if let Some((reached, (spans, point))) = found {
            if let Err(halt) = self.go_to_point(&reached, None, progress) {
                self.of_obstacles[obstacle] = self.undecided(earliest, &halt);
                return Err(halt);
            }
            let head = reached.head;
            (self.write)(&CertificateLine::Reached { obstacle, bench, from: head, to: head, spans, point })?;
            self.proved(event.kind, earliest, head, [event.bench_a, None])
        } else {
            let because = "doubles cannot tell whether the board meets the obstacle that it comes so near".to_owned();
            Status::Undecided { time_lo: self.time(earliest).lo, because }
        };
        self.of_obstacles[obstacle] = Some(status);
        Ok(())
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

/// Returns the two benches of a contact.
fn benches(event: &Event) -> [usize; 2] {
    [event.bench_a, event.bench_b].map(|bench| bench.unwrap_or(0) as usize)
}
