//! The trackers of one publisher: their handles, names, positions and arrivals. In: frames. Out: trackers, which the
//! [`sender`](super::psn_sender) puts into packets.

use std::time::Instant;

use super::Arrivals;
use super::axes::Axes;
use super::psn::{Tracker, TrackerName};
use super::trackers::{Numbers, Selection};
use bench_dragon_client::clock::monotonic_ns;
use bench_dragon_client::feed::FeedEvent;
use bench_dragon_messages::{FrameHeader, HandlePose, Stage};

/// The trackers of one publisher.
pub(super) struct Source {
    numbers: Numbers,
    arrivals: Arrivals,
    /// True if the deadlines are of this machine's clock.
    pub(super) shares_clock: bool,
    /// The dragons of the show; frames wait for them.
    dragons: Option<Vec<Dragon>>,
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

/// A dragon of the show: its name, which is empty for a single one, and its handles.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Dragon {
    name: String,
    first_handle: u32,
    handles: u32,
}

/// The chosen handles of all dragons, in the order of a frame, and their trackers.
struct Team {
    dragons: Vec<Dragon>,
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
            dragons: None,
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

    /// Updates the arrivals and the dragons by an event.
    pub(super) fn arrived(&mut self, event: &FeedEvent<'_>, now: Instant) {
        self.arrivals.handle(event, now);
        match event {
            FeedEvent::Stage { stage, .. } => self.dragons = Some(dragons_of(stage)),
            FeedEvent::Gone => self.dragons = None,
            _ => (),
        }
    }

    /// See [`Arrivals::stopped_since`]; `None` without trackers.
    pub(super) fn stopped_since(&self, now: Instant) -> Option<Instant> {
        self.arrivals.stopped_since(now).filter(|_| self.is_known())
    }

    /// Returns true if the dragons of the show are known: frames wait for that.
    pub(super) fn knows_dragons(&self) -> bool {
        self.dragons.is_some()
    }

    /// Chooses the trackers of a new team in a frame of `handles` handles. Returns a sentence for each kind of handles
    /// that is left out, or `None` if the team is known.
    pub(super) fn meet(&mut self, handles: u32, selection: &Selection) -> Option<Vec<String>> {
        let mut dragons = self.dragons.clone()?;
        if let [only] = &mut dragons[..] {
            // A publisher may leave out handles.
            only.handles = handles;
        }
        if self.team.as_ref().is_some_and(|team| team.handles == handles && team.dragons == dragons) {
            return None;
        }
        let (mut sentences, mut chosen, mut names) = (Vec::new(), Vec::new(), Vec::new());
        for (place, dragon) in dragons.iter().enumerate() {
            let numbers = match &dragon.name[..] {
                "" => Some(self.numbers.clone()),
                name => self.numbers.of_dragon(place, name, dragon.first_handle),
            };
            let own = selection.of(dragon.handles);
            let trackers = numbers.as_ref().map_or(Vec::new(), |numbers| numbers.trackers(&own, dragon.handles));
            sentences.extend(self.left_out(dragon, numbers.as_ref(), selection, trackers.len(), own.len()));
            chosen.extend(own[..trackers.len()].iter().map(|handle| dragon.first_handle + handle));
            names.extend(trackers);
        }
        self.team = Some(Team { dragons, handles, chosen, names, announced: false });
        self.sent = None;
        Some(sentences)
    }

    /// Returns a sentence for each kind of a dragon's handles that is left out. One kind is handles that the dragon
    /// does not have. The other is handles without a number, known from the counts of trackers that are `sent`, and of
    /// `chosen` handles.
    fn left_out(
        &self,
        dragon: &Dragon,
        numbers: Option<&Numbers>,
        selection: &Selection,
        sent: usize,
        chosen: usize,
    ) -> Vec<String> {
        let name =
            numbers.unwrap_or(&self.numbers).of.as_deref().or(Some(&dragon.name[..]).filter(|of| !of.is_empty()));
        let of = name.map_or(String::new(), |of| format!(" of \"{of}\""));
        let mut sentences = Vec::new();
        if let Some(beyond) = selection.beyond(dragon.handles) {
            sentences.push(format!("there is no handle {beyond}{of}: the team has {}", dragon.handles));
        }
        if sent < chosen {
            let last = numbers.unwrap_or(&self.numbers).last;
            let (whose, advice) =
                if of.is_empty() { ("trackers'", "") } else { ("its", "; --id-step leaves room for more") };
            sentences
                .push(format!("only {sent} of {chosen} handles{of} are sent: {whose} numbers end at {last}{advice}"));
        }
        sentences
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

/// Returns the dragons of a show.
fn dragons_of(stage: &Stage) -> Vec<Dragon> {
    let dragon = |of: &bench_dragon_messages::StageDragon| Dragon {
        name: of.name.as_str().to_owned(),
        first_handle: of.first_handle,
        handles: of.benches + 1,
    };
    stage.dragons.iter().map(dragon).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::{List, SceneName, StageDragon};

    /// A source that knows the dragons of a show.
    fn source(numbers: Numbers, dragons: &[(&str, u32)]) -> Source {
        let mut source = Source::new(numbers);
        let mut stage = Stage::default();
        let mut first_handle = 0;
        for &(name, benches) in dragons {
            let dragon = StageDragon { first_handle, benches, name: SceneName::new(name), ..StageDragon::default() };
            first_handle += benches + 1;
            stage.dragons = List::of(stage.dragons.iter().copied().chain([dragon]));
        }
        source.arrived(&FeedEvent::Stage { stage: &stage, segments: &[] }, Instant::now());
        source
    }

    #[test]
    fn each_dragon_of_a_show_has_its_trackers() {
        let mut source = source(Numbers::from(1, 100), &[("gold", 3), ("jade", 2)]);
        let left_out = source.meet(7, &"head,2,tail,4".parse().unwrap()).unwrap();
        assert_eq!(left_out, ["there is no handle 4 of \"jade\": the team has 3"]);
        let poses = Vec::from_iter((0..7).map(|x| HandlePose { x: f64::from(x), ..HandlePose::default() }));
        source.take(&FrameHeader::default(), &poses, Axes::default(), 0);
        let seen = source.trackers.iter().zip(source.names()).map(|(it, name)| (it.id, it.position[0], &name.name[..]));
        assert_eq!(
            Vec::from_iter(seen),
            [
                (1, 0.0, "gold head"),
                (2, 1.0, "gold handle 2"),
                (4, 3.0, "gold tail"),
                (101, 4.0, "jade head"),
                (102, 5.0, "jade handle 2"),
                (103, 6.0, "jade tail")
            ]
        );
        assert_eq!(source.meet(7, &Selection::all()), None, "a known team");
        assert!(!Source::new(Numbers::from(1, 100)).knows_dragons(), "before the stage");
    }

    #[test]
    fn a_cut_is_told_when_it_changes() {
        let mut source = source(Numbers::from(1, 1000), &[("", 3)]);
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
        let mut source = Source::new(Numbers::from(1, 1000));
        let header = FrameHeader { deadline_ns: 7, ..FrameHeader::default() };
        assert_eq!(source.made_ns(&header), 7);
        source.shares_clock = false;
        let before = monotonic_ns();
        assert!(source.made_ns(&header) >= before);
    }
}
