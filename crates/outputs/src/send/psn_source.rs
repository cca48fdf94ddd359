//! The trackers of one publisher: their handles, names, positions and arrivals. In: frames. Out: trackers, which the
//! [`sender`](super::psn_sender), its only caller, puts into packets.

use std::time::Instant;

use super::Arrivals;
use super::axes::Axes;
use super::psn::{Tracker, TrackerName};
use super::trackers::{Numbers, Selection};
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::{FrameHeader, HandlePose};

/// The trackers of one publisher.
pub(super) struct Source {
    numbers: Numbers,
    arrivals: Arrivals,
    /// True if the deadlines are of this machine's clock.
    pub(super) shares_clock: bool,
    team: Option<Team>,
    /// The positions in the latest frame.
    pub(super) trackers: Vec<Tracker>,
    /// True if that frame has not been sent yet.
    pub(super) unsent: bool,
    /// True if status 0 has been sent since frames stopped.
    pub(super) stopped: bool,
    /// The number of trackers in the latest sent frame.
    sent: Option<usize>,
}

struct Team {
    handles: u32,
    chosen: Vec<u32>,
    names: Vec<TrackerName>,
    announced: bool,
}

impl Source {
    pub(super) fn new(numbers: Numbers) -> Self {
        Self {
            numbers,
            arrivals: Arrivals::default(),
            shares_clock: true,
            team: None,
            trackers: Vec::new(),
            unsent: false,
            stopped: false,
            sent: None,
        }
    }

    /// Returns the deadline of a frame, CLOCK_MONOTONIC of this machine in ns; the present moment for a frame of
    /// another machine.
    pub(super) fn made_ns(&self, header: &FrameHeader) -> u64 {
        if self.shares_clock { header.deadline_ns } else { monotonic_ns() }
    }

    /// Returns the publisher's name for sentences, if several publishers send to one desk.
    pub(super) fn of(&self) -> String {
        self.numbers.of.as_ref().map_or(String::new(), |of| format!(" of \"{of}\""))
    }

    /// Returns true if there are trackers: a frame has come at some time.
    pub(super) fn is_known(&self) -> bool {
        self.team.is_some()
    }

    /// Returns the names of the trackers for which a frame has room; none before the first frame.
    pub(super) fn names(&self) -> &[TrackerName] {
        let names: &[TrackerName] = self.team.as_ref().map_or(&[], |team| &team.names);
        &names[..self.sent.unwrap_or(names.len()).min(names.len())]
    }

    /// Updates the arrivals by an event.
    pub(super) fn arrived(&mut self, event: &FeedEvent<'_>, now: Instant) {
        self.arrivals.handle(event, now);
    }

    /// See [`Arrivals::stopped_since`]; `None` without trackers.
    pub(super) fn stopped_since(&self, now: Instant) -> Option<Instant> {
        self.arrivals.stopped_since(now).filter(|_| self.is_known())
    }

    /// Chooses the trackers of a new team. Returns a sentence for each kind of handles that is left out, or `None` if
    /// the team is known.
    pub(super) fn meet(&mut self, handles: u32, selection: &Selection) -> Option<Vec<String>> {
        if self.team.as_ref().is_some_and(|team| team.handles == handles) {
            return None;
        }
        let mut sentences = Vec::new();
        let mut chosen = selection.of(handles);
        let names = self.numbers.trackers(&chosen, handles);
        let of = self.of();
        if let Some(beyond) = selection.beyond(handles) {
            sentences.push(format!("there is no handle {beyond}{of}: the team has {handles}"));
        }
        if names.len() < chosen.len() {
            let (sent, chosen, last) = (names.len(), chosen.len(), self.numbers.last);
            let (whose, advice) =
                if of.is_empty() { ("trackers'", "") } else { ("its", "; --id-step leaves room for more") };
            sentences
                .push(format!("only {sent} of {chosen} handles{of} are sent: {whose} numbers end at {last}{advice}"));
        }
        chosen.truncate(names.len());
        self.team = Some(Team { handles, chosen, names, announced: false });
        self.sent = None;
        Some(sentences)
    }

    /// Takes the positions of a frame, made at `timestamp_us`. Returns true if it replaces a frame that was not sent.
    pub(super) fn take(&mut self, header: &FrameHeader, handles: &[HandlePose], axes: Axes, timestamp_us: u64) -> bool {
        let Some(team) = &self.team else { return false };
        let vector = |x, y| axes.vector([x, y, 0.0]).map(|part| part as f32);
        let tracker = |(handle, name): (&u32, &TrackerName)| {
            let pose = handles.get(*handle as usize)?;
            // Velocities are per second of wall time.
            let (vx, vy) = (pose.vx * header.time_scale, pose.vy * header.time_scale);
            Some(Tracker {
                id: name.id,
                position: vector(pose.x, pose.y),
                speed: (!vx.is_nan() && !vy.is_nan()).then(|| vector(vx, vy)),
                orientation: axes.rotation(pose.heading).map(|part| part as f32),
                status: 1.0,
                timestamp_us,
            })
        };
        self.trackers.clear();
        self.trackers.extend(team.chosen.iter().zip(&team.names).filter_map(tracker));
        std::mem::replace(&mut self.unsent, true)
    }

    /// Keeps the trackers at their last positions, standing still, with status 0.
    pub(super) fn stop(&mut self) {
        self.stopped = true;
        for tracker in &mut self.trackers {
            tracker.status = 0.0;
            tracker.speed = tracker.speed.map(|_| [0.0; 3]);
        }
    }

    /// Limits this frame to `room` trackers. Returns the rest of the room, and the number of trackers left out, if that
    /// has changed and is not zero.
    pub(super) fn fit(&mut self, room: usize) -> (usize, Option<usize>) {
        let sent = self.trackers.len().min(room);
        let has_changed = self.sent.replace(sent) != Some(sent);
        (room - sent, Some(self.trackers.len() - sent).filter(|left_out| has_changed && *left_out > 0))
    }

    /// Returns the number of handles and the trackers, once for each team.
    pub(super) fn announce(&mut self) -> Option<(u32, Vec<TrackerName>)> {
        let team = self.team.as_mut().filter(|team| !team.announced)?;
        team.announced = true;
        let handles = team.handles;
        Some((handles, self.names().to_vec()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_is_told_when_it_changes() {
        let mut source = Source::new(Numbers::from(1));
        source.meet(4, &Selection::all());
        source.take(&FrameHeader::default(), &[HandlePose::default(); 4], Axes::default(), 0);
        let cuts = [9, 3, 3, 2, 4, 3].map(|room| source.fit(room));
        assert_eq!(cuts, [(5, None), (0, Some(1)), (0, None), (0, Some(2)), (0, None), (0, Some(1))]);
        assert_eq!(source.names().len(), 3);
        source.meet(2, &Selection::all());
        assert_eq!(source.names().len(), 2);
    }

    #[test]
    fn a_frame_of_another_machine_counts_as_made_now() {
        let mut source = Source::new(Numbers::from(1));
        let header = FrameHeader { deadline_ns: 7, ..FrameHeader::default() };
        assert_eq!(source.made_ns(&header), 7);
        source.shares_clock = false;
        let before = monotonic_ns();
        assert!(source.made_ns(&header) >= before);
    }
}
