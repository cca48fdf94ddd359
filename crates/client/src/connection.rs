//! A subscriber's ends of a publisher's services: the thin layer over iceoryx2. In: a name. Out: what is in the queues.
//!
//! It keeps no counts: when to open, read and let go is up to the [`feed`](super::feed), which calls it. In `followed`, whose
//! messages are read where a service has more than one publisher.

mod followed;

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as Open;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::clock::monotonic_clock_name;
use crate::shared_memory::MOST_PUBLISHERS;
use crate::shared_memory::{CLOCK, OpenError, check_room_to_subscribe, node, reserve_pages, service_name, stale_files};
use bench_dragon_messages::{
    CollisionAlert, ControlRequest, ControlResponse, Cue, FrameHeader, HandlePose, LoopStatus, Stage,
};
use followed::{Followed, OfRun, Origin, publishers};

type Receiver<Payload, Header> = Port<ipc::Service, Payload, Header>;
type PoseSample = Sample<ipc::Service, [HandlePose], FrameHeader>;

/// How long publishers that have sent nothing are left alone before they are tried again.
const BYSTANDER_INTERVAL: Duration = Duration::from_secs(5);

/// A publisher's services, as far as they exist.
pub struct Connection {
    poses: Receiver<[HandlePose], FrameHeader>,
    poses_service: PortFactory<ipc::Service, [HandlePose], FrameHeader>,
    alerts: Option<Receiver<CollisionAlert, ()>>,
    cues: Option<Receiver<Cue, ()>>,
    /// Whether the show has cues: where it has none there is no such service to look for.
    expects_cues: bool,
    status: Option<Receiver<LoopStatus, ()>>,
    status_service: Option<PortFactory<ipc::Service, LoopStatus, ()>>,
    stage: Option<Receiver<Stage, ()>>,
    tick: Option<Listener<ipc::Service>>,
    followed: Cell<Option<Followed>>,
    /// Whether another publisher is followed since that was last asked.
    follows_another: Cell<bool>,
    /// Whether another publisher has sent frames since the latest of the one that is followed.
    passes_over: Cell<bool>,
    /// The frame that decided whom to follow, until it is handed over: what explains it goes before.
    first: RefCell<Option<PoseSample>>,
    /// The latest status of each publisher that came before it was known whom to follow.
    held_statuses: RefCell<Vec<(Origin, LoopStatus)>>,
}

/// A subscriber's node, with which it opens services.
pub struct Subscription {
    node: Node<ipc::Service>,
    name: String,
    wake: Wake,
    /// Publishers that do not send, and since when that is known: the ends of tunnels to other machines. To hold on to their
    /// services would keep the tunnel open.
    bystanders: RefCell<(Instant, Vec<Origin>)>,
}

/// How a subscriber learns that a frame has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wake {
    /// The publisher wakes it, which costs the publisher some microseconds for every frame.
    OnFrame,
    /// It polls as often as it likes, which costs the publisher nothing.
    Never,
}

impl Subscription {
    /// A subscription to the services of `name`, none of which need exist yet.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 cannot take, or where this process may not use the shared memory.
    pub fn new(name: &str, wake: Wake) -> Result<Self, OpenError> {
        service_name(name, "poses")?;
        check_room_to_subscribe()?;
        stale_files::spawn_reaper();
        let bystanders = RefCell::new((Instant::now(), Vec::new()));
        Ok(Self { node: node()?, name: name.to_owned(), wake, bystanders })
    }

    /// Connects to the publisher, or `None` while there is none.
    ///
    /// # Errors
    /// [`OpenError`] where its services exist and cannot be used.
    pub fn connect(&self) -> Result<Option<Connection>, OpenError> {
        let name = service_name(&self.name, "poses")?;
        let opened =
            self.node.service_builder(&name).publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>().open();
        let poses_service = match opened {
            Ok(service) => service,
            // Not there yet, or just coming or going.
            Err(Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction) => return Ok(None),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => {
                return Err(OpenError::Incompatible(name.to_string()));
            }
            Err(error) => {
                return Err(OpenError::Failed { service: name.to_string(), reason: format!("{error:?}") });
            }
        };
        // Other subscribers keep a service when its publisher has gone. One more would keep it from being made anew.
        if self.only_bystanders(&publishers(&poses_service)) {
            self.service::<CollisionAlert>("alerts")?;
            self.service::<Cue>("cues")?;
            self.service::<LoopStatus>("status")?;
            self.service::<Stage>("stage")?;
            return Ok(None);
        }
        check_room_to_subscribe()?;
        use iceoryx2::port::subscriber::SubscriberCreateError;
        let poses = poses_service.subscriber_builder().create().map_err(|error| match error {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => OpenError::TooManySubscribers {
                service: name.to_string(),
                most: poses_service.static_config().max_subscribers(),
            },
            other => OpenError::Failed { service: name.to_string(), reason: format!("{other:?}") },
        })?;
        let connection = Connection {
            poses,
            poses_service,
            alerts: self.receiver("alerts")?,
            cues: self.receiver("cues")?,
            expects_cues: false,
            status: self.receiver("status")?,
            status_service: self.service("status")?,
            stage: self.receiver("stage")?,
            tick: self.listener(),
            followed: Cell::new(None),
            follows_another: Cell::new(false),
            passes_over: Cell::new(false),
            first: RefCell::new(None),
            held_statuses: RefCell::new(Vec::new()),
        };
        reserve_pages()?;
        Ok(Some(connection))
    }

    /// Lets go of a connection from which nothing more comes. Publishers that remain are not connected to again for a while,
    /// unless a show is here: then one of them may be the next show's, which is about to send.
    pub fn leave(&self, connection: Connection) {
        let remaining = publishers(&connection.poses_service);
        // In this order: a show serves commands before it has a publisher.
        let bystanders = if self.show_is_here() { Vec::new() } else { remaining };
        self.bystanders.replace((Instant::now(), bystanders));
    }

    /// Whether there is nobody to connect to.
    fn only_bystanders(&self, publishers: &[Origin]) -> bool {
        let (since, bystanders) = &*self.bystanders.borrow();
        publishers.is_empty()
            || since.elapsed() < BYSTANDER_INTERVAL && publishers.iter().all(|it| bystanders.contains(it))
    }

    /// Whether a show of this name runs in this shared memory: only a show serves commands.
    pub fn show_is_here(&self) -> bool {
        !self.shows_here().is_empty()
    }

    /// The nodes with which shows of this name serve commands.
    fn shows_here(&self) -> Vec<UniqueNodeId> {
        let mut nodes = Vec::new();
        let Ok(name) = service_name(&self.name, "control") else { return nodes };
        let opened = self.node.service_builder(&name).request_response::<ControlRequest, ControlResponse>().open();
        if let Ok(service) = opened {
            service.dynamic_config().list_servers(|server| {
                nodes.push(server.node_id);
                CallbackProgression::Continue
            });
        }
        nodes
    }

    /// Whether frames are passed over that a show here may send, in favour of those of another process: the end of a tunnel
    /// that was followed while no show was here.
    pub fn passes_over_the_show(&self, connection: &Connection) -> bool {
        let Some(followed) = connection.followed.get().filter(|_| connection.passes_over.get()) else { return false };
        let process = |node: &UniqueNodeId| node.pid::<ipc::Service>().ok();
        let shows = self.shows_here();
        !shows.is_empty() && shows.iter().all(|show| process(show) != process(&followed.origin.node))
    }

    /// Opens what was not there when the connection was made: a publisher makes its services one after another, and
    /// one without alerts never makes that one.
    ///
    /// # Errors
    /// [`OpenError::Full`] where a service is there now and the memory for it is not, [`OpenError::Incompatible`] where
    /// its messages have another layout.
    pub fn open_missing_services(&self, connection: &mut Connection) -> Result<(), OpenError> {
        let missing = connection.missing();
        if connection.alerts.is_none() {
            connection.alerts = self.receiver("alerts")?;
        }
        if connection.cues.is_none() && connection.expects_cues {
            connection.cues = self.receiver("cues")?;
        }
        if connection.status.is_none() {
            connection.status = self.receiver("status")?;
            connection.status_service = self.service("status")?;
        }
        if connection.stage.is_none() {
            connection.stage = self.receiver("stage")?;
        }
        connection.tick = connection.tick.take().or_else(|| self.listener());
        if connection.missing() < missing { reserve_pages() } else { Ok(()) }
    }

    /// Whether the publisher whose frames come is there and alive, or any where none have come. Cleans up after one that was
    /// killed.
    pub fn publisher_is_alive(&self, connection: &Connection) -> bool {
        let _ = self.node.try_cleanup_dead_nodes();
        let of_frames = publishers(&connection.poses_service);
        let is_there = match connection.followed.get() {
            Some(followed) => of_frames.contains(&followed.origin),
            None => !of_frames.is_empty(),
        };
        // One that ends sends its last status after its last frame, from a node that has no frames.
        let of_status = connection.status_service.as_ref().map_or_else(Vec::new, publishers);
        is_there || of_status.iter().any(|status| of_frames.iter().all(|frames| frames.node != status.node))
    }

    /// A port of a service that may be absent: a scene can be without alerts.
    fn receiver<Message: ZeroCopySend + std::fmt::Debug>(
        &self,
        service: &str,
    ) -> Result<Option<Receiver<Message, ()>>, OpenError> {
        Ok(self.service(service)?.and_then(|service| service.subscriber_builder().create().ok()))
    }

    /// A service that may be absent. One with another layout is refused.
    fn service<Message: ZeroCopySend + std::fmt::Debug>(
        &self,
        service: &str,
    ) -> Result<Option<PortFactory<ipc::Service, Message, ()>>, OpenError> {
        let name = service_name(&self.name, service)?;
        match self.node.service_builder(&name).publish_subscribe::<Message>().open() {
            Ok(service) => Ok(Some(service)),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => Err(OpenError::Incompatible(name.to_string())),
            Err(_) => Ok(None),
        }
    }

    fn listener(&self) -> Option<Listener<ipc::Service>> {
        if self.wake == Wake::Never {
            return None;
        }
        let name = service_name(&self.name, "tick").ok()?;
        self.node.service_builder(&name).event().open().ok()?.listener_builder().create().ok()
    }
}

impl Connection {
    /// Services that are not open.
    fn missing(&self) -> usize {
        let Self { alerts, cues, status, stage, tick, .. } = self;
        let open = [alerts.is_some(), cues.is_some(), status.is_some(), stage.is_some(), tick.is_some()];
        open.into_iter().filter(|open| !open).count()
    }

    /// Waits until a frame is announced, or for `timeout` but at least 1 ms; not at all where that is zero.
    pub fn wait(&self, timeout: Duration) {
        if timeout.is_zero() {
            return;
        }
        // iceoryx2 takes less than a microsecond for "for ever".
        let timeout = timeout.max(Duration::from_millis(1));
        let waited = self.tick.as_ref().map(|tick| tick.timed_wait(|_| (), timeout));
        if !matches!(waited, Some(Ok(_))) {
            // Without the event service there is nothing to wake on.
            std::thread::sleep(timeout.min(Duration::from_millis(20)));
        }
    }

    /// Whether the service names the clock of this process, so that moments of CLOCK_MONOTONIC in its frames can be
    /// compared with those here. It tells of who made the service: a tunnel may use one that a show of this machine has
    /// left.
    pub fn names_clock(&self) -> bool {
        let clock = monotonic_clock_name();
        self.poses_service.attributes().iter().any(|it| it.key() == CLOCK && it.value() == clock.as_str())
    }

    /// Whether, since this was last asked, a frame has decided to follow a publisher, or another one than before.
    pub fn follows_another(&self) -> bool {
        self.follows_another.take()
    }

    /// Hands the frames that have come to `each`, oldest first; how many there were. They are at most as many as the queue
    /// holds: a publisher that is faster than `each` would otherwise keep the caller here.
    pub fn frames(&self, mut each: impl FnMut(&FrameHeader, &[HandlePose])) -> usize {
        let (mut count, mut received) = (0, 0);
        while received < self.poses.buffer_size()
            && let Some(sample) = self.next_frame()
        {
            received += 1;
            if self.follow(Origin::of(sample.header()), sample.user_header().run_id) {
                each(sample.user_header(), sample.payload());
                count += 1;
            }
        }
        count
    }

    /// Hands the newest frame to `take` and drops those before it; `None` where none has come.
    pub fn newest_frame<Taken>(&self, take: impl FnOnce(&FrameHeader, &[HandlePose]) -> Taken) -> Option<Taken> {
        let mut newest = None;
        while let Some(sample) = self.next_frame() {
            if self.follow(Origin::of(sample.header()), sample.user_header().run_id) {
                newest = Some(sample);
            }
        }
        newest.map(|sample| take(sample.user_header(), sample.payload()))
    }

    /// The next alert, if one has come.
    pub fn alert(&self) -> Option<CollisionAlert> {
        self.next(self.alerts.as_ref())
    }

    /// Whether there is a service of cues to open.
    pub fn expect_cues(&mut self, expected: bool) {
        self.expects_cues = expected;
    }

    /// The next cue, if one has come.
    pub fn cue(&self) -> Option<Cue> {
        self.next(self.cues.as_ref())
    }

    /// The next status, if one has come.
    pub fn status(&self) -> Option<LoopStatus> {
        if !self.is_decided() {
            return None;
        }
        let held = self.held_statuses.take().into_iter().find(|(origin, status)| self.admits(*origin, status.run_id));
        held.map(|(_, status)| status).or_else(|| self.next(self.status.as_ref()))
    }

    /// Takes in the statuses that come before a frame has decided whose are handed over; whether any came. A publisher
    /// of few frames is known by them to be alive.
    pub fn hold_statuses(&self) -> bool {
        let Some(port) = self.status.as_ref().filter(|_| self.followed.get().is_none()) else { return false };
        let mut held = self.held_statuses.borrow_mut();
        let mut any = false;
        while let Ok(Some(sample)) = port.receive() {
            let origin = Origin::of(sample.header());
            held.retain(|(known, _)| *known != origin);
            if held.len() == MOST_PUBLISHERS {
                held.remove(0);
            }
            held.push((origin, *sample));
            any = true;
        }
        any
    }

    /// The next stage, if one has come.
    pub fn stage(&self) -> Option<Stage> {
        self.next(self.stage.as_ref())
    }

    /// The next message that belongs to the frames that are followed. Before a frame has come, messages stay in their
    /// queues: they could be of a publisher that sends no frames.
    fn next<Message: ZeroCopySend + std::fmt::Debug + Copy + OfRun>(
        &self,
        port: Option<&Receiver<Message, ()>>,
    ) -> Option<Message> {
        let port = port.filter(|_| self.is_decided())?;
        while let Some(sample) = port.receive().ok().flatten() {
            if self.admits(Origin::of(sample.header()), sample.run_id()) {
                return Some(*sample);
            }
        }
        None
    }

    /// The next frame of any publisher, if one has come.
    fn next_frame(&self) -> Option<PoseSample> {
        self.first.take().or_else(|| self.poses.receive().ok().flatten())
    }

    /// Whether it is known whom to follow; if not, the next frame decides, where one has come. Every publisher sends
    /// frames all the time, in pauses too.
    fn is_decided(&self) -> bool {
        if self.followed.get().is_none()
            && let Some(sample) = self.next_frame()
        {
            self.follow(Origin::of(sample.header()), sample.user_header().run_id);
            self.first.replace(Some(sample));
        }
        self.followed.get().is_some()
    }

    /// Whether a frame is handed over. The first decides whose frames are from then on, until that publisher has gone or
    /// the connection is left.
    fn follow(&self, origin: Origin, run_id: u64) -> bool {
        let latest = self.followed.get();
        let is_same = latest.is_some_and(|followed| followed.origin == origin);
        let follows = is_same || latest.is_none_or(|followed| !self.is_listed(followed.origin));
        if follows {
            self.followed.set(Some(Followed { origin, run_id }));
            self.passes_over.set(false);
            self.follows_another.set(self.follows_another.get() || !is_same);
        } else {
            self.passes_over.set(true);
        }
        follows
    }

    /// Whether a message is handed over: it comes from where the frames come from, or the next run begins with it.
    fn admits(&self, origin: Origin, run_id: u64) -> bool {
        self.followed.get().is_some_and(|followed| {
            followed.origin.node == origin.node || followed.run_id == run_id || !self.is_listed(followed.origin)
        })
    }

    fn is_listed(&self, origin: Origin) -> bool {
        publishers(&self.poses_service).contains(&origin)
    }
}
