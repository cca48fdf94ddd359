//! The feed of a publisher's services, through any number of publishers: what every subscriber command stands on.
//!
//! In: the services of a name, over [`connection`](super::connection). Out: a [`FeedEvent`] for all that comes and
//! changes. Connecting, opening services that appear later, distinguishing a silent publisher from a dead one
//! ([`liveness`]), gaps and new runs ([`sequence`]) are here and nowhere else; `watch`, the stage picture and the
//! subscribers of the soak test call [`Feed::poll`] in a loop and handle the events.

pub mod liveness;
pub mod sequence;

use std::time::{Duration, Instant};

use super::connection::{Connection, Subscription, Wake};
use crate::shared_memory::OpenError;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, Stage};
use liveness::{Change, Liveness};
use sequence::SequenceTracker;

/// How often it is tried to connect while there is no publisher.
const CONNECT_INTERVAL: Duration = Duration::from_millis(20);
/// How often services are opened that were not there yet.
const OPEN_INTERVAL: Duration = Duration::from_millis(100);
/// How long a publisher may send nothing at all where no show is: statuses and, over a tunnel, stages come once a second.
const QUIET: Duration = Duration::from_millis(1500);

/// Which of the frames that have come since the last poll are handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// Every one, oldest first.
    All,
    /// The newest; the others cost no more than their receiving.
    Newest,
}

/// How a feed reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FeedOptions {
    /// Whether each frame wakes the reader.
    pub wake: Wake,
    /// Which frames are handed over.
    pub frames: Frames,
}

/// What comes from a publisher, and what becomes of it.
#[derive(Debug, Clone, Copy)]
pub enum FeedEvent<'a> {
    /// Frames come from a run that the latest frame was not of. Its first frame follows.
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
        /// Frames of the run between the one before and this that were not handed over: they were lost, or passed over
        /// by [`Frames::Newest`].
        missed: u64,
    },
    /// The stage, at the start of each run.
    Stage(&'a Stage),
    /// An alert.
    Alert(&'a CollisionAlert),
    /// A cue that the show has reached. A feed that connects later gets the latest one.
    Cue(&'a Cue),
    /// The status of the publisher's loop.
    Status(&'a LoopStatus),
    /// The publisher is alive and has stopped sending. The next frame ends that.
    Silent,
    /// The publisher has ended or died, and all that it sent has been handed over; or it is the silent end of a tunnel and
    /// a show has begun on this machine.
    Gone,
}

/// The services of one name.
///
/// # Examples
///
/// A publisher and its subscriber, here in one process:
///
/// ```
/// use std::time::Duration;
///
/// use bench_dragon_publisher::live::{Outgoing, Publisher};
/// use bench_dragon_show::scene::Scene;
/// use bench_dragon_show::{Playback, Show};
/// use bench_dragon_client::connection::Wake;
/// use bench_dragon_client::feed::{Feed, FeedEvent, FeedOptions, Frames};
/// use bench_dragon_publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
/// use bench_dragon_messages::FrameHeader;
/// use bench_dragon_show::convert::stage;
///
/// let scene = Scene::paper();
/// let mut show = Show::new(&scene, scene.motion.timeline(&mut |_| ()), Playback::of(&scene))?;
/// let config = PublisherConfig {
///     name: format!("feed_example_{}", std::process::id()),
///     handles: scene.team().handles(),
///     single_precision: None,
///     queue: 4,
///     subscribers: 1,
///     alerts: true,
///     cues: 0,
///     stage: stage(1, 0, [0; 32], &scene.motion, &show),
/// };
/// let mut publisher = SharedMemoryPublisher::open(&config)?;
///
/// let mut feed = Feed::new(&config.name, FeedOptions { wake: Wake::Never, frames: Frames::All })?;
/// let mut received = 0;
/// while received < 10 {
///     let header = FrameHeader { run_id: 1, handles: 224, ..FrameHeader::default() };
///     publisher.publish(Outgoing::new(&header, show.frame(received)))?;
///     publisher.maintain();
///     feed.poll(Duration::from_millis(1), &mut |event| {
///         if let FeedEvent::Frame { handles, .. } = event {
///             assert_eq!(handles.len(), 224);
///             received += 1;
///         }
///     })?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Feed {
    subscription: Subscription,
    frames: Frames,
    sequence: SequenceTracker,
    next_connect: Instant,
    connected: Option<Connected>,
}

/// A connection, and what is known of the publisher at its other end.
struct Connected {
    connection: Connection,
    shares_clock: bool,
    liveness: Liveness,
    last_open: Instant,
    /// Whether anything has been handed over, which begins with a frame.
    received: bool,
    /// Since when there has been no sign that any publisher sends, as long as nothing has been handed over.
    quiet_since: Instant,
    /// What tells the latest stage, alert and cue from others: they come again where there is a tunnel to other machines.
    stage: Option<(u64, u64)>,
    alert: Option<(u64, u64, u32)>,
    cue: Option<(u64, u64, u32)>,
}

impl Feed {
    /// A feed of the services of `name`, none of which need exist yet.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 cannot take, or where this process may not use the shared memory.
    pub fn new(name: &str, options: FeedOptions) -> Result<Self, OpenError> {
        Ok(Self {
            subscription: Subscription::new(name, options.wake)?,
            frames: options.frames,
            sequence: SequenceTracker::default(),
            next_connect: Instant::now(),
            connected: None,
        })
    }

    /// Waits until something comes, at most `timeout`, and hands all that has come to `handle`, but of frames at most as
    /// many as the queue holds. Does what is due besides, so it is to be called again and again, a few times a second
    /// at least; it may return sooner and with nothing.
    ///
    /// # Errors
    /// [`OpenError`] where the services exist and cannot be used. The feed has let go of them then, and the next call
    /// connects anew: what is in the way may have gone.
    pub fn poll(&mut self, timeout: Duration, handle: &mut dyn FnMut(FeedEvent<'_>)) -> Result<(), OpenError> {
        let Some(connected) = &mut self.connected else { return self.connect(timeout) };
        connected.connection.wait(timeout.min(OPEN_INTERVAL));
        connected.receive(self.frames, &mut self.sequence, handle);
        if connected.connection.follows_another() {
            connected.shares_clock = shares_clock(&self.subscription, &connected.connection);
        }
        if connected.last_open.elapsed() >= OPEN_INTERVAL {
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
                // What it sent between the reading above and its end is still in the queues, perhaps before what the next
                // publisher sends.
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
            // A show that is stopped may stay so: to ask costs more than all else that is done here.
            connected.quiet_since = Instant::now();
            if !self.subscription.show_is_here() {
                self.leave();
            }
        }
        Ok(())
    }

    /// Whether the publisher's clock is that of this process, so that latencies can be computed; `None` while there is no
    /// publisher. Where another publisher's frames come, it holds for them when the poll that brings the first has
    /// returned.
    pub fn shares_clock(&self) -> Option<bool> {
        self.connected.as_ref().map(|connected| connected.shares_clock)
    }

    /// Lets go of the services, so that the next publisher can make them anew.
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
            alert: None,
            cue: None,
        });
        Ok(())
    }
}

/// Whether frames are of this machine's clock: the service names it, and a show is here. Services can outlive the show
/// that made them, and a tunnel then sends another machine's frames through them.
fn shares_clock(subscription: &Subscription, connection: &Connection) -> bool {
    connection.names_clock() && subscription.show_is_here()
}

impl Connected {
    /// Hands over what is in the queues: the stage first, since it explains the frames, and frames before the alerts
    /// and cues that belong to them.
    fn receive(&mut self, frames: Frames, sequence: &mut SequenceTracker, handle: &mut dyn FnMut(FeedEvent<'_>)) {
        let Self {
            connection,
            liveness,
            received,
            quiet_since,
            stage: latest_stage,
            alert: latest_alert,
            cue: latest_cue,
            ..
        } = self;
        if connection.hold_statuses() {
            *quiet_since = Instant::now();
        }
        let mut handle = |event: FeedEvent<'_>| {
            *received = true;
            handle(event);
        };
        while let Some(stage) = connection.stage() {
            connection.expect_cues(stage.cues > 0);
            let of = Some((stage.run_id, stage.stamp_ns));
            if std::mem::replace(latest_stage, of) != of {
                handle(FeedEvent::Stage(&stage));
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
            Frames::All => connection.frames(take_frame) > 0,
            Frames::Newest => connection.newest_frame(take_frame).is_some(),
        };
        if any {
            liveness.frame_at(Instant::now());
        }
        while let Some(alert) = connection.alert() {
            let of = Some((alert.run_id, alert.tick, alert.level));
            if std::mem::replace(latest_alert, of) != of {
                handle(FeedEvent::Alert(&alert));
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
    }
}
