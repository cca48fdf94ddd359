//! The feed of a publisher's services, through any number of publishers: the base of every subscriber command.
//!
//! In: the services of a name, over [`connection`](super::connection). Out: a [`FeedEvent`] for each message and each
//! change. Only this file connects, opens services that appear later, distinguishes a silent publisher from a dead one
//! ([`liveness`]), and finds gaps and new runs ([`sequence`]). Programs call [`Feed::poll`] in a loop and handle the
//! events; [`polling`](super::polling) has such a loop.

pub mod liveness;
pub mod sequence;

use std::time::{Duration, Instant};

use super::connection::{Connection, Subscription, Wake};
use crate::shared_memory::OpenError;
use bench_dragon_messages::{
    ChaseStatus, CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, SceneHeader, Stage, StageSegment,
};
use liveness::{Change, Liveness};
use sequence::SequenceTracker;

/// The interval of connection attempts while there is no publisher.
const CONNECT_INTERVAL: Duration = Duration::from_millis(20);
/// The interval at which missing services are opened. Until anything has come, the interval of connection attempts is
/// used.
const OPEN_INTERVAL: Duration = Duration::from_millis(100);
/// The time for which a publisher may send nothing while no show runs here: statuses and, over a tunnel, stages come
/// once a second.
const QUIET: Duration = Duration::from_millis(1500);
/// The time for which an alert waits for the stage of its run, which names the benches: over a tunnel, stages come once
/// a second.
const STAGE_PATIENCE: Duration = Duration::from_millis(1500);

/// The frames since the last poll that are handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delivery {
    /// Every one, oldest first.
    All,
    /// The newest; the others are only received.
    Newest,
}

/// The options of a feed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FeedOptions {
    /// The way in which the reader notices a frame.
    pub wake: Wake,
    /// The frames that are handed over.
    pub frames: Delivery,
}

/// A message of a publisher, or a change of the publisher.
#[derive(Debug, Clone, Copy)]
pub enum FeedEvent<'a> {
    /// Another run than the run of the latest frame has begun. Its first frame follows.
    Started {
        /// The run.
        run_id: u64,
    },
    /// A frame.
    Frame {
        /// Its header.
        header: &'a FrameHeader,
        /// Its handles, head first.
        handles: &'a [HandlePose],
        /// Frames of the run between the previous frame and this one that were not handed over: lost, or skipped by
        /// [`Delivery::Newest`].
        missed: u64,
    },
    /// The stage, at the start of each run.
    Stage {
        /// The stage.
        stage: &'a Stage,
        /// The segments of its paths and outlines.
        segments: &'a [StageSegment],
    },
    /// The text of the scene, at the start of each run.
    Scene {
        /// Its header.
        header: &'a SceneHeader,
        /// The text, TOML; empty if it is not known.
        text: &'a str,
    },
    /// An alert, after the stage of its run if the stage comes within 1.5 s.
    Alert(&'a CollisionAlert),
    /// A cue that the show has reached. A feed that connects later gets the latest one.
    Cue(&'a Cue),
    /// The status of the publisher's loop.
    Status(&'a LoopStatus),
    /// The status of a chase of this run, five times a second while a chase runs.
    Chase(&'a ChaseStatus),
    /// The publisher is alive and has stopped sending. The next frame ends that.
    Silent,
    /// The publisher has ended or died, and all its messages have been handed over. Or the publisher is the silent end
    /// of a tunnel, and a show has begun on this machine.
    Gone,
}

/// The services of one name.
///
/// # Examples
///
/// Prints the place of the head until the publisher ends:
///
/// ```no_run
/// use std::time::Duration;
///
/// use bench_dragon_client::connection::Wake;
/// use bench_dragon_client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
///
/// let mut feed = Feed::new("bench_dragon", FeedOptions { wake: Wake::OnFrame, frames: Delivery::All })?;
/// let mut is_gone = false;
/// while !is_gone {
///     feed.poll(Duration::from_millis(200), &mut |event| match event {
///         FeedEvent::Frame { header, handles, .. } => {
///             println!("{} s: ({}, {}) m", header.sim_time, handles[0].x, handles[0].y);
///         }
///         FeedEvent::Gone => is_gone = true,
///         _ => (),
///     })?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Feed {
    subscription: Subscription,
    frames: Delivery,
    sequence: SequenceTracker,
    next_connect: Instant,
    connected: Option<Connected>,
}

/// A connection, and the state of the publisher at its other end.
struct Connected {
    connection: Connection,
    shares_clock: bool,
    liveness: Liveness,
    last_open: Instant,
    /// True if anything has been handed over. Nothing is handed over before a frame has come.
    received: bool,
    /// The moment since which no publisher has sent anything; used until something has been handed over.
    quiet_since: Instant,
    /// The identity of the latest stage, scene, alert and cue: a tunnel to other machines sends them again.
    stage: Option<(u64, u64)>,
    scene: Option<u64>,
    alert: Option<(u64, u64, u32)>,
    cue: Option<(u64, u64, u32)>,
    /// Alerts that wait for the stage of their run, and the moment since which they wait.
    early: Vec<CollisionAlert>,
    early_since: Instant,
}

impl Feed {
    /// Creates a feed of the services of `name`, which need not exist yet.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 refuses, or if this process may not use the shared memory.
    pub fn new(name: &str, options: FeedOptions) -> Result<Self, OpenError> {
        Ok(Self {
            subscription: Subscription::new(name, options.wake)?,
            frames: options.frames,
            sequence: SequenceTracker::default(),
            next_connect: Instant::now(),
            connected: None,
        })
    }

    /// Waits for messages, at most `timeout`, and passes all of them to `handle`, but at most as many frames as the
    /// queue holds. May return sooner and without messages. Also connects and tests the publisher, so call this
    /// function in a loop, at least a few times a second.
    ///
    /// # Errors
    /// [`OpenError`] if the services exist and cannot be used. The feed has closed them then, and the next call
    /// connects again: the obstacle may have gone.
    pub fn poll(&mut self, timeout: Duration, handle: &mut dyn FnMut(FeedEvent<'_>)) -> Result<(), OpenError> {
        let Some(connected) = &mut self.connected else { return self.connect(timeout) };
        // A publisher that starts creates its services within milliseconds and sends its first frame soon after.
        let open_interval = if connected.received { OPEN_INTERVAL } else { CONNECT_INTERVAL };
        connected.connection.wait(timeout.min(open_interval));
        connected.receive(self.frames, &mut self.sequence, handle);
        if connected.connection.follows_another() {
            connected.shares_clock = shares_clock(&self.subscription, &connected.connection);
        }
        if connected.last_open.elapsed() >= open_interval {
            connected.last_open = Instant::now();
            if let Err(error) = self.subscription.open_missing_services(&mut connected.connection) {
                self.connected = None;
                return Err(error);
            }
        }
        let is_alive = |connection: &Connection| {
            self.subscription.publisher_is_alive(connection) && !self.subscription.passes_over_the_show(connection)
        };
        match connected.liveness.test(Instant::now(), || is_alive(&connected.connection)) {
            None => (),
            Some(Change::Silent) => handle(FeedEvent::Silent),
            Some(Change::Gone) => {
                // Messages sent between the reading above and its end are still in the queues, perhaps before messages
                // of the next publisher.
                connected.receive(self.frames, &mut self.sequence, handle);
                if !is_alive(&connected.connection) {
                    if connected.received {
                        handle(FeedEvent::Gone);
                    }
                    self.leave();
                }
            }
        }
        let is_quiet = |connected: &&mut Connected| !connected.received && connected.quiet_since.elapsed() >= QUIET;
        if let Some(connected) = self.connected.as_mut().filter(is_quiet) {
            // A stopped show may stay stopped: this test costs more than the rest of the poll.
            connected.quiet_since = Instant::now();
            if !self.subscription.show_is_here() {
                self.leave();
            }
        }
        Ok(())
    }

    /// Returns true if the publisher's clock is the clock of this process, so that latencies can be computed; `None`
    /// while there is no publisher. For another publisher the value is right after the poll that brings its first
    /// frame.
    pub fn shares_clock(&self) -> Option<bool> {
        self.connected.as_ref().map(|connected| connected.shares_clock)
    }

    /// Returns true if frames have come, or if the services of the stage and the scene are open. A publisher that has
    /// sent no frame delivers both before the first.
    pub fn is_ready(&self) -> bool {
        let is_ready = |connected: &Connected| connected.received || connected.connection.describes_frames();
        self.connected.as_ref().is_some_and(is_ready)
    }

    /// Closes the services, so that the next publisher can create them again.
    fn leave(&mut self) {
        if let Some(connected) = self.connected.take() {
            self.subscription.leave(connected.connection);
        }
    }

    fn connect(&mut self, timeout: Duration) -> Result<(), OpenError> {
        let wait = self.next_connect.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(timeout));
        if wait > timeout {
            return Ok(());
        }
        let connection = self.subscription.connect()?;
        let now = Instant::now();
        self.next_connect = now + CONNECT_INTERVAL;
        self.connected = connection.map(|connection| Connected {
            shares_clock: shares_clock(&self.subscription, &connection),
            connection,
            liveness: Liveness::connected_at(now),
            last_open: now,
            received: false,
            quiet_since: now,
            stage: None,
            scene: None,
            alert: None,
            cue: None,
            early: Vec::new(),
            early_since: now,
        });
        Ok(())
    }
}

/// Returns true if the deadlines are of this machine's clock: the service names the clock, and a show runs here.
/// Services can outlive the show that created them, and a tunnel then sends another machine's frames through them.
fn shares_clock(subscription: &Subscription, connection: &Connection) -> bool {
    connection.names_clock() && subscription.show_is_here()
}

impl Connected {
    /// Hands over the messages in the queues: the stage and the scene first, since they describe the frames, and frames
    /// before their alerts and cues.
    fn receive(&mut self, frames: Delivery, sequence: &mut SequenceTracker, handle: &mut dyn FnMut(FeedEvent<'_>)) {
        let Self {
            connection,
            liveness,
            received,
            quiet_since,
            stage: latest_stage,
            scene: latest_scene,
            alert: latest_alert,
            cue: latest_cue,
            early,
            early_since,
            ..
        } = self;
        if connection.hold_statuses() {
            *quiet_since = Instant::now();
        }
        let mut handle = |event: FeedEvent<'_>| {
            *received = true;
            handle(event);
        };
        if early.is_empty() {
            *early_since = Instant::now();
        }
        // Taken out before the stage and the frames, since the publisher sends alerts after these.
        while let Some(alert) = connection.alert() {
            early.push(alert);
        }
        while let Some(sample) = connection.stage() {
            let (stage, segments) = (sample.user_header(), sample.payload());
            connection.expect_cues(stage.cues > 0);
            let of = Some((stage.run_id, stage.stamp_ns));
            if std::mem::replace(latest_stage, of) != of {
                handle(FeedEvent::Stage { stage, segments });
            }
        }
        while let Some(scene) = connection.scene() {
            let header = scene.user_header();
            let is_new = latest_scene.replace(header.run_id) != Some(header.run_id);
            if let (true, Ok(text)) = (is_new, std::str::from_utf8(scene.payload())) {
                handle(FeedEvent::Scene { header, text });
            }
        }
        let take_frame = |header: &FrameHeader, handles: &[HandlePose]| {
            let missed = sequence.advance(header.run_id, header.sequence).unwrap_or_else(|| {
                handle(FeedEvent::Started { run_id: header.run_id });
                0
            });
            handle(FeedEvent::Frame { header, handles, missed });
        };
        let any = match frames {
            Delivery::All => connection.frames(take_frame) > 0,
            Delivery::Newest => connection.newest_frame(take_frame).is_some(),
        };
        if any {
            liveness.frame_at(Instant::now());
        }
        let is_early = |alert: &CollisionAlert| {
            sequence.run() == Some(alert.run_id) && latest_stage.is_none_or(|(run_id, _)| run_id != alert.run_id)
        };
        if early_since.elapsed() >= STAGE_PATIENCE || !early.iter().any(is_early) {
            for alert in early.drain(..) {
                let of = Some((alert.run_id, alert.tick, alert.level));
                if std::mem::replace(latest_alert, of) != of {
                    handle(FeedEvent::Alert(&alert));
                }
            }
        }
        while let Some(cue) = connection.cue() {
            let of = Some((cue.run_id, cue.tick, cue.number));
            if std::mem::replace(latest_cue, of) != of {
                handle(FeedEvent::Cue(&cue));
            }
        }
        while let Some(status) = connection.status() {
            liveness.rate(status.rate);
            handle(FeedEvent::Status(&status));
        }
        while let Some(status) = connection.chase() {
            handle(FeedEvent::Chase(&status));
        }
    }
}
