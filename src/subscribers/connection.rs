//! A subscriber's ends of a publisher's services: the thin layer over iceoryx2. In: a name. Out: what is in the queues.
//!
//! It keeps no time and no counts: when to open, read and let go is up to the [`feed`](super::feed), which calls it.

use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber as Port;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as Open;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::transports::iceoryx2::{OpenError, check_room_to_subscribe, node, reserve_pages, service_name, stale_files};
use crate::wire::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, Stage};

type Receiver<Payload, Header> = Port<ipc::Service, Payload, Header>;

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
}

/// A subscriber's node, with which it opens services.
pub struct Subscription {
    node: Node<ipc::Service>,
    name: String,
    wake: Wake,
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
        Ok(Self { node: node()?, name: name.to_owned(), wake })
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
        if poses_service.dynamic_config().number_of_publishers() == 0 {
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
        };
        reserve_pages()?;
        Ok(Some(connection))
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

    /// Whether a publisher is there and alive. Cleans up after one that was killed.
    pub fn publisher_is_alive(&self, connection: &Connection) -> bool {
        let _ = self.node.try_cleanup_dead_nodes();
        // One that ends sends its last status after its last frame.
        let status = connection.status_service.as_ref();
        connection.poses_service.dynamic_config().number_of_publishers() > 0
            || status.is_some_and(|status| status.dynamic_config().number_of_publishers() > 0)
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

    /// Hands the frames that have come to `each`, oldest first; how many there were. They are at most as many as the queue
    /// holds: a publisher that is faster than `each` would otherwise keep the caller here.
    pub fn frames(&self, mut each: impl FnMut(&FrameHeader, &[HandlePose])) -> usize {
        let mut count = 0;
        while count < self.poses.buffer_size()
            && let Ok(Some(sample)) = self.poses.receive()
        {
            each(sample.user_header(), sample.payload());
            count += 1;
        }
        count
    }

    /// Hands the newest frame to `take` and drops those before it; `None` where none has come.
    pub fn newest_frame<Taken>(&self, take: impl FnOnce(&FrameHeader, &[HandlePose]) -> Taken) -> Option<Taken> {
        let mut newest = None;
        while let Ok(Some(sample)) = self.poses.receive() {
            newest = Some(sample);
        }
        newest.map(|sample| take(sample.user_header(), sample.payload()))
    }

    /// The next alert, if one has come.
    pub fn alert(&self) -> Option<CollisionAlert> {
        next(self.alerts.as_ref())
    }

    /// Whether there is a service of cues to open.
    pub fn expect_cues(&mut self, expected: bool) {
        self.expects_cues = expected;
    }

    /// The next cue, if one has come.
    pub fn cue(&self) -> Option<Cue> {
        next(self.cues.as_ref())
    }

    /// The next status, if one has come.
    pub fn status(&self) -> Option<LoopStatus> {
        next(self.status.as_ref())
    }

    /// The next stage, if one has come.
    pub fn stage(&self) -> Option<Stage> {
        next(self.stage.as_ref())
    }
}

fn next<Message: ZeroCopySend + std::fmt::Debug + Copy>(port: Option<&Receiver<Message, ()>>) -> Option<Message> {
    port?.receive().ok().flatten().map(|sample| *sample)
}
