//! A subscriber's ends of a publisher's services: the thin layer over iceoryx2. In: a name. Out: the contents of the
//! queues.
//!
//! This layer keeps no counts: the [`feed`](super::feed) above it decides when to open, to read and to disconnect. A
//! service can have more than one publisher, and `selected` has the one whose messages are read.

mod selected;
mod slices;

use std::cell::RefCell;
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
use crate::layouts;
use crate::shared_memory::MOST_PUBLISHERS;
use crate::shared_memory::{CLOCK, OpenError, check_room_to_subscribe, node, reserve_pages, service_name, stale_files};
use crate::shows::servers;
use bench_dragon_messages::{
    ChaseStatus, CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, SceneHeader, Stage, StageSegment,
};
use selected::{OfRun, Origin, Selected, publishers};
pub use slices::{SceneSample, StageSample};

type Receiver<Payload, Header> = Port<ipc::Service, Payload, Header>;
type PoseSample = Sample<ipc::Service, [HandlePose], FrameHeader>;

/// The time before another connection to stale publishers.
const STALE_INTERVAL: Duration = Duration::from_secs(5);

/// A publisher's services, as far as they exist.
pub struct Connection {
    poses: Receiver<[HandlePose], FrameHeader>,
    poses_service: PortFactory<ipc::Service, [HandlePose], FrameHeader>,
    alerts: Option<Receiver<CollisionAlert, ()>>,
    cues: Option<Receiver<Cue, ()>>,
    /// False once the stage is known to have no cues: its show has no service of cues.
    expects_cues: bool,
    status: Option<Receiver<LoopStatus, ()>>,
    status_service: Option<PortFactory<ipc::Service, LoopStatus, ()>>,
    stage: Option<Receiver<[StageSegment], Stage>>,
    scene: Option<Receiver<[u8], SceneHeader>>,
    chase: Option<Receiver<ChaseStatus, ()>>,
    tick: Option<Listener<ipc::Service>>,
    selection: Selection,
}

/// The publisher whose messages are handed over, where a service has more than one.
enum Selection {
    /// No frame has come.
    Undecided {
        /// The latest status of each publisher.
        statuses: Vec<(Origin, LoopStatus)>,
    },
    /// Frames come.
    Following {
        selected: Selected,
        /// True until [`Connection::follows_another`] is called.
        is_new: bool,
        /// True if another publisher has sent frames since the latest frame of the selected publisher.
        passes_over: bool,
        /// The frame that selected the publisher, until it is handed over: the stage goes before.
        first: Option<PoseSample>,
        /// The statuses received before that frame.
        statuses: Vec<(Origin, LoopStatus)>,
    },
}

/// A subscriber's node, with which it opens services.
pub struct Subscription {
    node: Node<ipc::Service>,
    name: String,
    wake: Wake,
    /// Publishers that do not send, the ends of tunnels to other machines, and the moment at which this was found. Open
    /// services would keep the tunnel open.
    stale_publishers: RefCell<(Instant, Vec<Origin>)>,
}

/// The way in which a subscriber notices a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wake {
    /// The publisher wakes the subscriber, which costs the publisher some microseconds for every frame.
    OnFrame,
    /// The subscriber polls, which costs the publisher nothing.
    Never,
}

impl Subscription {
    /// Creates a subscription to the services of `name`, which need not exist yet.
    ///
    /// # Errors
    /// [`OpenError`] for a name that iceoryx2 refuses, or if this process may not use the shared memory.
    pub fn new(name: &str, wake: Wake) -> Result<Self, OpenError> {
        service_name(name, "poses")?;
        check_room_to_subscribe()?;
        stale_files::spawn_reaper();
        let stale_publishers = RefCell::new((Instant::now(), Vec::new()));
        Ok(Self { node: node()?, name: name.to_owned(), wake, stale_publishers })
    }

    /// Connects to the publisher. Returns `None` while no publisher runs.
    ///
    /// # Errors
    /// [`OpenError`] if its services exist and cannot be used.
    pub fn connect(&self) -> Result<Option<Connection>, OpenError> {
        let name = service_name(&self.name, "poses")?;
        let opened =
            self.node.service_builder(&name).publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>().open();
        let poses_service = match opened {
            Ok(service) => service,
            // The service does not exist yet, or is being created or removed.
            Err(Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction) => return Ok(None),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => {
                let own = [layouts::name::<HandlePose>(), layouts::name::<FrameHeader>()];
                return Err(layouts::another(&name, MessagingPattern::PublishSubscribe, &own));
            }
            Err(error) => {
                return Err(OpenError::Failed { service: name.to_string(), reason: format!("{error:?}") });
            }
        };
        // Other subscribers keep a service whose publisher has gone. One more would prevent the next publisher from
        // creating it again.
        if self.only_stale_publishers(&publishers(&poses_service)) {
            self.service::<CollisionAlert>("alerts")?;
            self.service::<Cue>("cues")?;
            self.service::<LoopStatus>("status")?;
            self.slices::<StageSegment, Stage>("stage")?;
            self.slices::<u8, SceneHeader>("scene")?;
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
            expects_cues: true,
            status: self.receiver("status")?,
            status_service: self.service("status")?,
            stage: self.slice_receiver("stage")?,
            scene: self.slice_receiver("scene")?,
            chase: self.receiver("chase")?,
            tick: self.listener(),
            selection: Selection::Undecided { statuses: Vec::new() },
        };
        reserve_pages()?;
        Ok(Some(connection))
    }

    /// Closes a connection whose publisher has gone. The remaining publishers count as stale for a while, unless a show
    /// runs here, because one of them may then belong to the next show, which is about to send.
    pub fn leave(&self, connection: Connection) {
        let remaining = publishers(&connection.poses_service);
        // In this order: a show serves commands before it has a publisher.
        let stale_publishers = if self.show_is_here() { Vec::new() } else { remaining };
        self.stale_publishers.replace((Instant::now(), stale_publishers));
    }

    /// Returns true if there is no publisher, or stale publishers only.
    fn only_stale_publishers(&self, publishers: &[Origin]) -> bool {
        let (since, stale_publishers) = &*self.stale_publishers.borrow();
        publishers.is_empty()
            || since.elapsed() < STALE_INTERVAL && publishers.iter().all(|it| stale_publishers.contains(it))
    }

    /// Returns true if a show of this name runs in this shared memory: only a show serves commands.
    pub fn show_is_here(&self) -> bool {
        !servers(&self.node, &self.name).is_empty()
    }

    /// Returns true if another process than this machine's show is selected, and frames that the show may have sent are
    /// passed over. The other process is the end of a tunnel, selected while no show ran here.
    pub fn passes_over_the_show(&self, connection: &Connection) -> bool {
        let Selection::Following { selected, passes_over: true, .. } = &connection.selection else { return false };
        let process = |node: &UniqueNodeId| node.pid::<ipc::Service>().ok();
        let shows = servers(&self.node, &self.name);
        !shows.is_empty() && shows.iter().all(|show| process(show) != process(&selected.origin.node))
    }

    /// Opens services that did not exist when the connection was made. A publisher creates its services one after
    /// another, and a publisher without alerts never creates the service of alerts.
    ///
    /// # Errors
    /// [`OpenError::Full`] if a new service has no memory left, [`OpenError::OtherLayout`] if its messages have another
    /// layout, [`OpenError::Incompatible`] if another property differs.
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
            connection.stage = self.slice_receiver("stage")?;
        }
        if connection.scene.is_none() {
            connection.scene = self.slice_receiver("scene")?;
        }
        if connection.chase.is_none() {
            connection.chase = self.receiver("chase")?;
        }
        connection.tick = connection.tick.take().or_else(|| self.listener());
        if connection.missing() < missing { reserve_pages() } else { Ok(()) }
    }

    /// Returns true if the selected publisher is alive, or any publisher if none is selected. Cleans up after killed
    /// publishers.
    pub fn publisher_is_alive(&self, connection: &Connection) -> bool {
        let _ = self.node.try_cleanup_dead_nodes();
        let of_frames = publishers(&connection.poses_service);
        let is_there = match &connection.selection {
            Selection::Following { selected, .. } => of_frames.contains(&selected.origin),
            Selection::Undecided { .. } => !of_frames.is_empty(),
        };
        // A publisher that ends sends its last status after its last frame, from a node that has no frames.
        let of_status = connection.status_service.as_ref().map_or_else(Vec::new, publishers);
        is_there || of_status.iter().any(|status| of_frames.iter().all(|frames| frames.node != status.node))
    }

    /// Returns a port of a service that may be absent: a scene can be without alerts.
    fn receiver<Message: ZeroCopySend + std::fmt::Debug>(
        &self,
        service: &str,
    ) -> Result<Option<Receiver<Message, ()>>, OpenError> {
        Ok(self.service(service)?.and_then(|service| service.subscriber_builder().create().ok()))
    }

    /// Returns a service that may be absent. A service with another layout is refused.
    fn service<Message: ZeroCopySend + std::fmt::Debug>(
        &self,
        service: &str,
    ) -> Result<Option<PortFactory<ipc::Service, Message, ()>>, OpenError> {
        let name = service_name(&self.name, service)?;
        match self.node.service_builder(&name).publish_subscribe::<Message>().open() {
            Ok(service) => Ok(Some(service)),
            Err(Open::IncompatibleTypes | Open::VersionMismatch) => {
                let own = [layouts::name::<Message>()];
                Err(layouts::another(&name, MessagingPattern::PublishSubscribe, &own))
            }
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
    /// Returns the number of services that are not open.
    fn missing(&self) -> usize {
        let Self {
            poses: _,
            poses_service: _,
            alerts,
            cues,
            expects_cues: _,
            status,
            status_service: _,
            stage,
            scene,
            chase,
            tick,
            selection: _,
        } = self;
        let messages = [alerts.is_some(), cues.is_some(), status.is_some(), stage.is_some()];
        let open = messages.into_iter().chain([scene.is_some(), chase.is_some(), tick.is_some()]);
        open.filter(|open| !open).count()
    }

    /// Returns true if the stage and the scene of a run can be received.
    pub fn describes_frames(&self) -> bool {
        self.stage.is_some() && self.scene.is_some()
    }

    /// Waits until a frame is announced, or for `timeout` but at least 1 ms. Without the event service, waits 20 ms at
    /// most. Does not wait if `timeout` is zero.
    pub fn wait(&self, timeout: Duration) {
        if timeout.is_zero() {
            return;
        }
        // iceoryx2 waits without limit if the timeout is less than a microsecond.
        let timeout = timeout.max(Duration::from_millis(1));
        let waited = self.tick.as_ref().map(|tick| tick.timed_wait(|_| (), timeout));
        if !matches!(waited, Some(Ok(_))) {
            // Without the event service nothing wakes this thread.
            std::thread::sleep(timeout.min(Duration::from_millis(20)));
        }
    }

    /// Returns true if the service names the clock of this process, so that moments of CLOCK_MONOTONIC in its frames
    /// can be compared with moments here. The creator of the service has set the name: a tunnel may use a service that
    /// a show of this machine has left.
    pub fn names_clock(&self) -> bool {
        let clock = monotonic_clock_name();
        self.poses_service.attributes().iter().any(|it| it.key() == CLOCK && it.value() == clock.as_str())
    }

    /// Returns true if a publisher was selected, or another one than before, since the last call.
    pub fn follows_another(&mut self) -> bool {
        match &mut self.selection {
            Selection::Following { is_new, .. } => std::mem::take(is_new),
            Selection::Undecided { .. } => false,
        }
    }

    /// Passes the frames that have come to `each`, oldest first, and returns their number. The frames are at most as
    /// many as the queue holds: otherwise a publisher that is faster than `each` would keep the caller here.
    pub fn frames(&mut self, mut each: impl FnMut(&FrameHeader, &[HandlePose])) -> usize {
        let (mut count, mut received) = (0, 0);
        while received < self.poses.buffer_size()
            && let Some(sample) = self.next_frame()
        {
            received += 1;
            if self.select(Origin::of(sample.header()), sample.user_header().run_id) {
                each(sample.user_header(), sample.payload());
                count += 1;
            }
        }
        count
    }

    /// Passes the newest frame to `take` and drops the older ones. Returns `None` if no frame has come.
    pub fn newest_frame<Taken>(&mut self, take: impl FnOnce(&FrameHeader, &[HandlePose]) -> Taken) -> Option<Taken> {
        let mut newest = None;
        while let Some(sample) = self.next_frame() {
            if self.select(Origin::of(sample.header()), sample.user_header().run_id) {
                newest = Some(sample);
            }
        }
        newest.map(|sample| take(sample.user_header(), sample.payload()))
    }

    /// Returns the next alert, if one has come.
    pub fn alert(&mut self) -> Option<CollisionAlert> {
        self.decide();
        self.next(self.alerts.as_ref())
    }

    /// Sets whether there is a service of cues to open.
    pub fn expect_cues(&mut self, expected: bool) {
        self.expects_cues = expected;
    }

    /// Returns the next cue, if one has come.
    pub fn cue(&mut self) -> Option<Cue> {
        self.decide();
        self.next(self.cues.as_ref())
    }

    /// Returns the next status, if one has come.
    pub fn status(&mut self) -> Option<LoopStatus> {
        self.decide();
        let Selection::Following { statuses, .. } = &mut self.selection else { return None };
        let held = std::mem::take(statuses).into_iter().find(|(origin, status)| self.admits(*origin, status.run_id));
        held.map(|(_, status)| status).or_else(|| self.next(self.status.as_ref()))
    }

    /// Buffers statuses received before a publisher is selected. Returns true if any arrived: a publisher of few frames
    /// is known by its statuses to be alive.
    pub fn hold_statuses(&mut self) -> bool {
        let Selection::Undecided { statuses } = &mut self.selection else { return false };
        let Some(port) = &self.status else { return false };
        let mut any = false;
        while let Ok(Some(sample)) = port.receive() {
            let origin = Origin::of(sample.header());
            statuses.retain(|(known, _)| *known != origin);
            if statuses.len() == MOST_PUBLISHERS {
                statuses.remove(0);
            }
            statuses.push((origin, *sample));
            any = true;
        }
        any
    }

    /// Returns the next status of a chase of this run, if one has come.
    pub fn chase(&mut self) -> Option<ChaseStatus> {
        self.decide();
        self.next(self.chase.as_ref())
    }

    /// Returns the next message that belongs to the frames of the selected publisher. Before a publisher is selected,
    /// messages stay in their queues: their publisher may send no frames.
    fn next<Message: ZeroCopySend + std::fmt::Debug + Copy + OfRun>(
        &self,
        port: Option<&Receiver<Message, ()>>,
    ) -> Option<Message> {
        let (Selection::Following { .. }, Some(port)) = (&self.selection, port) else { return None };
        while let Some(sample) = port.receive().ok().flatten() {
            if self.admits(Origin::of(sample.header()), sample.run_id()) {
                return Some(*sample);
            }
        }
        None
    }

    /// Returns the next frame of any publisher, if one has come.
    fn next_frame(&mut self) -> Option<PoseSample> {
        let first = match &mut self.selection {
            Selection::Following { first, .. } => first.take(),
            Selection::Undecided { .. } => None,
        };
        first.or_else(|| self.poses.receive().ok().flatten())
    }

    /// Selects the publisher of the next frame, if none is selected and a frame has come. This always finds a publisher
    /// that runs, because publishers send frames all the time, also while paused.
    fn decide(&mut self) {
        if matches!(self.selection, Selection::Undecided { .. })
            && let Some(sample) = self.next_frame()
        {
            self.select(Origin::of(sample.header()), sample.user_header().run_id);
            if let Selection::Following { first, .. } = &mut self.selection {
                *first = Some(sample);
            }
        }
    }

    /// Returns true if a frame is handed over. The first frame selects its publisher, until that publisher has gone or
    /// the connection is left.
    fn select(&mut self, origin: Origin, run_id: u64) -> bool {
        match &mut self.selection {
            Selection::Undecided { statuses } => {
                self.selection = Selection::Following {
                    selected: Selected { origin, run_id },
                    is_new: true,
                    passes_over: false,
                    first: None,
                    statuses: std::mem::take(statuses),
                };
                true
            }
            Selection::Following { selected, is_new, passes_over, .. } => {
                let is_same = selected.origin == origin;
                let follows = is_same || !publishers(&self.poses_service).contains(&selected.origin);
                if follows {
                    *selected = Selected { origin, run_id };
                    *is_new |= !is_same;
                }
                *passes_over = !follows;
                follows
            }
        }
    }

    /// Returns true if a message is handed over: its node or its run is that of the selected frames, or the selected
    /// publisher has gone.
    fn admits(&self, origin: Origin, run_id: u64) -> bool {
        let Selection::Following { selected, .. } = &self.selection else { return false };
        selected.origin.node == origin.node
            || selected.run_id == run_id
            || !publishers(&self.poses_service).contains(&selected.origin)
    }
}
