//! iceoryx2: frames, alerts, cues, status, stage and scene in shared memory, for any number of processes on this
//! machine.
//!
//! [`SharedMemoryPublisher`] lives on the loop's thread, [`StatusSender`] on the statistics thread. Each is made on its
//! thread, because iceoryx2's ports stay on the thread that made them. The services are `<name>/poses`, `/status`,
//! `/stage`, `/scene`, and the event service `<name>/tick`. If a scene requests them, there are also `/alerts`, `/cues`
//! and `/poses32`.
//!
//! A name belongs to one show, because the service of commands, `<name>/control`, admits one server and is opened
//! first. The library iceoryx2 detects by a lock of the operating system whether the server's process lives, so a
//! killed process does not block the name, while a stopped process keeps it. A claim without a file keeps it too where
//! another program removes the show's files. The other services admit a second publisher, for a tunnel to other machines.

mod claim;
mod control;
mod frames;
mod held_slice;
mod queues;

use std::time::{Duration, Instant};

use ::iceoryx2::port::notifier::Notifier;
use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::port::{LoanError, SendError};
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::builder::event::{EventOpenError, EventOpenOrCreateError};
use ::iceoryx2::service::port_factory::event;

use bench_dragon_client::shared_memory::sender::{SMALL_QUEUE, SPARE_NODES, Sender, Service, sender};
use bench_dragon_client::shared_memory::{
    OpenError, failed, incomplete, node, reserve_pages, service_name, stale_files,
};

use super::{Transport, TransportConfig, TransportError};
use crate::live::control::CommandSender;
use crate::live::{Outgoing, PublishError, Publisher, StatusPublisher, TransportCounters};
use bench_dragon_messages::{
    CollisionAlert, Cue, HandlePose, HandlePose32, LoopStatus, SceneHeader, Stage, StageMessage, StageSegment,
};
use bench_dragon_show::convert::{Decimation, handle_pose, handle_pose_32, handle_poses};
use bench_dragon_show::scene::SinglePrecision;

use frames::{FrameSender, FrameService};
use held_slice::HeldSlice;
use queues::{check_room, default_queue};

/// The interval at which the stage, the scene, the latest alert and the latest cue are retransmitted to a tunnel. A
/// tunnel keeps no history for machines that join later.
const REPEAT_INTERVAL: Duration = Duration::from_secs(1);
/// The time for which an incomplete service may block a publisher; [`stale_files`] removes it earlier.
const PATIENCE: Duration = Duration::from_secs(6);

/// The settings of a publisher.
#[derive(Debug, Clone)]
pub struct PublisherConfig {
    /// The name under which services appear.
    pub name: String,
    /// Handles in a frame.
    pub handles: usize,
    /// The service of poses in single precision, if requested.
    pub single_precision: Option<SinglePrecision>,
    /// Frames a subscriber may fall behind.
    pub queue: usize,
    /// Subscribers that each service admits at once.
    pub subscribers: usize,
    /// True if there is an alerts service.
    pub alerts: bool,
    /// The number of the scene's cues; with none there is no cues service.
    pub cues: usize,
    /// The text of the scene, sent once and kept for late subscribers; empty if it is not known.
    pub scene: String,
    /// The stage, sent once and kept for late subscribers.
    pub stage: StageMessage,
}

impl PublisherConfig {
    /// Returns the handles of the frames in single precision, if there are such frames.
    fn decimation(&self) -> Option<Decimation> {
        let SinglePrecision { every } = self.single_precision?;
        let dragons: Vec<usize> = self.stage.stage.dragons.iter().map(|dragon| dragon.benches as usize + 1).collect();
        let known = dragons.iter().sum::<usize>() == self.handles;
        Some(Decimation::new(if known { dragons } else { vec![self.handles] }, every))
    }
}

/// The services of a run.
struct Iceoryx2 {
    config: PublisherConfig,
    _control: control::ControlThread,
}

/// Creates the transport, and starts the thread that removes [`stale_files`] and the thread that serves commands. Opens
/// no other service yet: the service of commands is the claim of the name.
///
/// # Errors
/// [`TransportError::IllegalName`] for a name that iceoryx2 cannot take, [`TransportError::NameInUse`] for one that
/// another show has.
pub fn open(config: &TransportConfig, commands: CommandSender) -> Result<Box<dyn Transport>, TransportError> {
    let TransportConfig { name, handles, alerts, cues, single_precision, queue, subscribers, scene, stage } = *config;
    service_name(name, "poses")?;
    stale_files::spawn_reaper();
    let mut config = PublisherConfig {
        name: name.to_owned(),
        handles,
        single_precision,
        queue: 0,
        subscribers,
        alerts,
        cues,
        scene: scene.to_owned(),
        stage: stage.clone(),
    };
    config.queue = queue.unwrap_or_else(|| default_queue(&config));
    let control = control::ControlThread::start(name, commands)?;
    Ok(Box::new(Iceoryx2 { config, _control: control }))
}

impl Transport for Iceoryx2 {
    fn describe(&self) -> String {
        let PublisherConfig { name, single_precision, queue, subscribers, alerts, cues, .. } = &self.config;
        let single = single_precision.map_or(String::new(), |single| format!(", /poses32 ({single})"));
        let alerts = if *alerts { ", /alerts" } else { "" };
        let cues = if *cues > 0 { ", /cues" } else { "" };
        format!(
            "iceoryx2 services: {name}/poses{single}{alerts}{cues}, /status, /stage, /scene, /tick, /control (queues of {queue} \
             frames for {subscribers} subscribers)."
        )
    }

    fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError> {
        Ok(Box::new(SharedMemoryPublisher::open(&self.config)?))
    }

    fn status(&mut self) -> Result<Option<Box<dyn StatusPublisher>>, TransportError> {
        Ok(Some(Box::new(StatusSender::open(&self.config.name, self.config.subscribers)?)))
    }

    fn finish(self: Box<Self>) -> Option<(&'static str, TransportCounters)> {
        None
    }
}

/// Publishes frames, alerts, cues, the stage and the scene.
///
/// # Examples
///
/// A publisher and its subscriber, here in one process:
///
/// ```
/// use std::time::Duration;
///
/// use bench_dragon_motion::event::unreported;
/// use bench_dragon_publisher::live::{Outgoing, Publisher};
/// use bench_dragon_show::scene::Scene;
/// use bench_dragon_show::{Playback, Show};
/// use bench_dragon_client::connection::Wake;
/// use bench_dragon_client::feed::{Feed, FeedEvent, FeedOptions, Delivery};
/// use bench_dragon_publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
/// use bench_dragon_messages::FrameHeader;
/// use bench_dragon_show::convert::stage;
///
/// let scene = Scene::paper();
/// let mut show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene))?;
/// let config = PublisherConfig {
///     name: format!("feed_example_{}", std::process::id()),
///     handles: scene.ensemble.handles(),
///     single_precision: None,
///     queue: 4,
///     subscribers: 1,
///     alerts: true,
///     cues: 0,
///     scene: String::new(),
///     stage: stage(1, 0, [0; 32], &scene.ensemble, &show),
/// };
/// let mut publisher = SharedMemoryPublisher::open(&config)?;
///
/// let mut feed = Feed::new(&config.name, FeedOptions { wake: Wake::Never, frames: Delivery::All })?;
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
pub struct SharedMemoryPublisher {
    poses: FrameSender<HandlePose>,
    poses_32: Option<(FrameSender<HandlePose32>, Decimation)>,
    alerts: Option<Repeated<CollisionAlert>>,
    cues: Option<Repeated<Cue>>,
    stage: HeldSlice<StageSegment, Stage>,
    scene: HeldSlice<u8, SceneHeader>,
    tick: Notifier<ipc::Service>,
    tick_service: event::PortFactory<ipc::Service>,
    // Dropped last: the ports above belong to it.
    _node: Node<ipc::Service>,
}

impl SharedMemoryPublisher {
    /// Opens the services and sends the stage and the scene. Must be called on the thread that publishes. The caller
    /// ensures that no other show has the name: a run calls [`open`] first.
    ///
    /// # Errors
    /// [`OpenError`]: each names the cause and the remedy.
    pub fn open(config: &PublisherConfig) -> Result<Self, OpenError> {
        retry_while_incomplete(|| Self::open_now(config))
    }

    fn open_now(config: &PublisherConfig) -> Result<Self, OpenError> {
        let name = config.name.as_str();
        service_name(name, "poses")?;
        check_room(config)?;
        let node = node()?;
        let whole = FrameService { service: "poses", poses: config.handles, every: None };
        let poses = FrameSender::open(&node, config, &whole)?;
        let open_32 = |decimation: Decimation| {
            let every = Some(decimation.every());
            let described = FrameService { service: "poses32", poses: decimation.handles().len(), every };
            Ok((FrameSender::open(&node, config, &described)?, decimation))
        };
        let poses_32 = config.decimation().map(open_32).transpose()?;
        let open_alerts = || Repeated::open(&node, config, "alerts", SMALL_QUEUE);
        let alerts = config.alerts.then(open_alerts).transpose()?;
        // A large step can reach all cues in one frame. With a power of two, most changes of a scene keep the service.
        let open_cues = || Repeated::open(&node, config, "cues", config.cues.next_power_of_two().max(SMALL_QUEUE));
        let cues = (config.cues > 0).then(open_cues).transpose()?;
        let StageMessage { stage: header, segments } = &config.stage;
        let stage = HeldSlice::open(&node, config, "stage", *header, segments)?;
        let header = SceneHeader { run_id: header.run_id, hash: header.scene_hash };
        let scene = HeldSlice::open(&node, config, "scene", header, config.scene.as_bytes())?;
        let tick_service = node
            .service_builder(&service_name(name, "tick")?)
            .event()
            .max_listeners(config.subscribers)
            .max_nodes(config.subscribers + SPARE_NODES)
            .open_or_create()
            .map_err(|error| match error {
                EventOpenOrCreateError::EventOpenError(EventOpenError::HangsInCreation) => incomplete(name, "tick"),
                // A tunnel opened the service first.
                EventOpenOrCreateError::EventOpenError(
                    EventOpenError::DoesNotSupportRequestedAmountOfNodes
                    | EventOpenError::DoesNotSupportRequestedAmountOfListeners,
                ) => OpenError::OtherLimits(format!("{name}/tick")),
                other => failed(name, "tick", other),
            })?;
        let tick = tick_service.notifier_builder().create().map_err(|error| failed(name, "tick", error))?;
        reserve_pages()?;
        Ok(Self { poses, poses_32, alerts, cues, stage, scene, tick, tick_service, _node: node })
    }

    fn send_frame(&self, Outgoing { header, chain, .. }: Outgoing<'_>) -> Result<(), UnsentError> {
        self.poses.send(header, handle_poses(chain))?;
        match &self.poses_32 {
            None => Ok(()),
            Some((port, decimation)) if decimation.every() == 1 => {
                port.send(header, handle_poses(chain).map(handle_pose_32))
            }
            Some((port, decimation)) => {
                let pose = |handle: &usize| handle_pose_32(handle_pose(chain, *handle));
                port.send(header, decimation.handles().iter().map(pose))
            }
        }
    }
}

/// The reason why a message is not sent.
#[derive(Debug, thiserror::Error)]
enum UnsentError {
    /// The port has no memory for it.
    #[error(transparent)]
    Loan(#[from] LoanError),
    /// The port does not deliver it.
    #[error(transparent)]
    Send(#[from] SendError),
}

/// Sends messages if there is a service for them.
fn send_all<Message: ZeroCopySend + std::fmt::Debug + Copy + 'static>(
    service: &mut Option<Repeated<Message>>,
    messages: &[Message],
) -> Result<(), UnsentError> {
    let Some(service) = service else { return Ok(()) };
    Ok(messages.iter().try_for_each(|message| service.send(*message))?)
}

impl Publisher for SharedMemoryPublisher {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        let sent = self.send_frame(outgoing);
        let sent = sent.and_then(|()| send_all(&mut self.alerts, outgoing.alerts));
        let sent = sent.and_then(|()| send_all(&mut self.cues, outgoing.cues));
        sent.map_err(|error| PublishError(format!("the shared memory failed: {error}")))?;
        // A wake-up costs a socket write per listener, several times the cost of sending.
        if self.tick_service.dynamic_config().number_of_listeners() > 0 {
            // A dead or slow listener only loses the wake-up: the frame is in its queue.
            let _ = self.tick.notify();
        }
        Ok(())
    }

    fn maintain(&mut self) {
        // A late subscriber gets the history only when the publisher updates its connections. The stage has the names
        // that belong to alerts and cues.
        self.stage.maintain();
        self.scene.maintain();
        if let Some(alerts) = &mut self.alerts {
            alerts.maintain();
        }
        if let Some(cues) = &mut self.cues {
            cues.maintain();
        }
        self.poses.update_connections();
        if let Some((port, _)) = &self.poses_32 {
            port.update_connections();
        }
    }

    fn subscribers(&self) -> u32 {
        self.poses.subscribers() + self.poses_32.as_ref().map_or(0, |(port, _)| port.subscribers())
    }
}

/// A service whose latest message holds until the next. The latest message is retransmitted while there is a tunnel.
struct Repeated<Message: ZeroCopySend + std::fmt::Debug + Copy + 'static> {
    latest: Option<Message>,
    port: Sender<Message, ()>,
    service: Service<Message, ()>,
    sent: Instant,
}

impl<Message: ZeroCopySend + std::fmt::Debug + Copy + 'static> Repeated<Message> {
    fn open(
        node: &Node<ipc::Service>,
        config: &PublisherConfig,
        service: &str,
        queue: usize,
    ) -> Result<Self, OpenError> {
        let (port, service) = sender(node, &config.name, service, config.subscribers, queue)?;
        Ok(Self { latest: None, port, service, sent: Instant::now() })
    }

    fn send(&mut self, message: Message) -> Result<(), SendError> {
        (self.latest, self.sent) = (Some(message), Instant::now());
        self.port.send_copy(message).map(|_| ())
    }

    /// Delivers the latest message to late subscribers, on this machine and on others.
    fn maintain(&mut self) {
        let _ = self.port.update_connections();
        let has_tunnel = self.service.dynamic_config().number_of_publishers() > 1;
        if let Some(latest) = self.latest.filter(|_| has_tunnel && self.sent.elapsed() >= REPEAT_INTERVAL) {
            let _ = self.send(latest);
        }
    }
}

/// Publishes the loop's status. Must be created on the statistics thread.
pub struct StatusSender {
    status: Sender<LoopStatus, ()>,
    _node: Node<ipc::Service>,
}

impl StatusSender {
    /// Opens `<name>/status` for at most `subscribers` subscribers at once.
    ///
    /// # Errors
    /// As [`SharedMemoryPublisher::open`].
    pub fn open(name: &str, subscribers: usize) -> Result<Self, OpenError> {
        retry_while_incomplete(|| {
            let node = node()?;
            let (status, _) = sender(&node, name, "status", subscribers, SMALL_QUEUE)?;
            reserve_pages()?;
            Ok(Self { status, _node: node })
        })
    }
}

impl StatusPublisher for StatusSender {
    fn publish_status(&mut self, status: &LoopStatus) {
        if let Err(error) = self.status.send_copy(*status) {
            log::warn!("the status could not be sent: {error}");
        }
    }
}

/// Retries while a service is incomplete. Its creator either completes it or was killed; then [`stale_files`] removes
/// its file.
fn retry_while_incomplete<Opened>(open: impl Fn() -> Result<Opened, OpenError>) -> Result<Opened, OpenError> {
    let began = Instant::now();
    loop {
        match open() {
            Err(OpenError::Incomplete(_)) if began.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(100))
            }
            other => return other,
        }
    }
}
