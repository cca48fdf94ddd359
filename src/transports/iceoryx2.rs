//! iceoryx2: frames, alerts, status and stage in shared memory, for any number of processes on this machine.
//!
//! [`SharedMemoryPublisher`] lives on the loop's thread, [`StatusSender`] on the statistics thread; both are made there,
//! since iceoryx2's ports stay on the thread that made them. The services are `<name>/poses`, `/alerts`, `/status`,
//! `/stage` and the event service `<name>/tick`.

pub mod stale_files;

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use ::iceoryx2::config::Config;
use ::iceoryx2::port::notifier::Notifier;
use ::iceoryx2::port::publisher::Publisher as Port;
use ::iceoryx2::port::publisher::PublisherCreateError;
use ::iceoryx2::port::update_connections::UpdateConnections;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::builder::event::{EventOpenError, EventOpenOrCreateError};
use ::iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use ::iceoryx2::service::port_factory::{event, publish_subscribe};

use crate::live::clock::monotonic_ns;
use crate::live::{PublishError, Publisher, StatusPublisher};
use crate::show::Frame;
use crate::wire::convert::{collision_alert, handle_pose};
use crate::wire::{CollisionAlert, FrameHeader, HandlePose, LoopStatus, Stage};

/// Nodes that may have a service open at once beyond one a subscriber: the publisher's, and those that died and have
/// not been cleaned up after yet.
const SPARE_NODES: usize = 32;
/// Alerts and statuses that a subscriber may fall behind.
const SMALL_QUEUE: usize = 16;
/// The shared memory that the queues of frames may take by default.
const QUEUE_BYTES: usize = 64_000_000;
/// Where Linux keeps shared memory.
const SHARED_MEMORY: &str = "/dev/shm";
/// How long a incomplete service may stop a publisher; [`stale_files`] needs less to remove it.
const PATIENCE: Duration = Duration::from_secs(6);
/// What a subscriber needs of it for its own bookkeeping, and more.
const SUBSCRIBER_BYTES: u64 = 500_000;

/// Why the shared memory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// iceoryx2 has no services of such a name.
    #[error("--name is \"{name}\", expected a name for services of iceoryx2: not empty, at most {most} bytes")]
    Name {
        /// The name given.
        name: String,
        /// The most bytes a name may have.
        most: usize,
    },
    /// Somebody publishes under this name already.
    #[error(
        "another publisher is running under the name \"{0}\": stop it, or choose another name for this one with --name"
    )]
    AlreadyPublished(String),
    /// The queues would not fit.
    #[error(
        "the queues of {queue} frames for {subscribers} subscribers need {needed} bytes of shared memory and \
         {SHARED_MEMORY} has {free} left: lower publish.queue or publish.subscribers in the scene, or make \
         {SHARED_MEMORY} larger"
    )]
    NoRoom {
        /// Frames in a queue.
        queue: usize,
        /// Subscribers that may come.
        subscribers: usize,
        /// Bytes needed.
        needed: u64,
        /// Bytes left.
        free: u64,
    },
    /// A service stays incomplete.
    #[error(
        "the service \"{0}\" is incomplete and nobody completes it: stop every program that uses it, or choose another \
         name with --name"
    )]
    Incomplete(String),
    /// There is no room even for bookkeeping.
    #[error("{SHARED_MEMORY} has {free} bytes left, which is too little: remove what fills it, or make it larger")]
    Full {
        /// Bytes left.
        free: u64,
    },
    /// The services on this machine belong to another user.
    #[error(
        "{folder} belongs to another user, who keeps all others out: run as that user, or build every program that is to \
         take part with the feature any_user"
    )]
    AnotherUsers {
        /// The folder that cannot be entered.
        folder: String,
    },
    /// A service of this name exists with other properties.
    #[error(
        "the service \"{0}\" exists with another layout of its messages, or with other limits: a program of another \
         version of bench-dragon has it open; stop that or take the same version for both, or choose another name with \
         --name"
    )]
    Incompatible(String),
    /// The service admits no more subscribers.
    #[error(
        "\"{service}\" has {most} subscribers, which is as many as its publisher admits (publish.subscribers in its \
         scene): end one first, or raise that and start the publisher again"
    )]
    TooManySubscribers {
        /// The service.
        service: String,
        /// Subscribers admitted.
        most: usize,
    },
    /// Anything else.
    #[error("iceoryx2 could not open \"{service}\": {reason}")]
    Failed {
        /// The service.
        service: String,
        /// What iceoryx2 says.
        reason: String,
    },
}

/// The name of one of a publisher's services.
///
/// # Errors
/// [`OpenError::Name`] where iceoryx2 takes no such name.
pub fn service_name(name: &str, service: &str) -> Result<ServiceName, OpenError> {
    let refused = || OpenError::Name { name: name.to_owned(), most: ServiceName::max_len() - "/status".len() };
    if name.is_empty() {
        return Err(refused());
    }
    ServiceName::new(&format!("{name}/{service}")).map_err(|_| refused())
}

/// A node that leaves signals to this program.
///
/// # Errors
/// [`OpenError::AnotherUsers`] where another user's processes keep this one out, [`OpenError::Failed`] where iceoryx2
/// cannot make one for another reason.
pub fn node() -> Result<Node<ipc::Service>, OpenError> {
    stale_files::remove_unfinished_files();
    let made = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>();
    made.map_err(|error| {
        let folder = Config::global_config().global.root_path().to_string();
        match std::fs::read_dir(&folder) {
            Err(refused) if refused.kind() == ErrorKind::PermissionDenied => OpenError::AnotherUsers { folder },
            _ => OpenError::Failed { service: "a node".to_owned(), reason: format!("{error:?}") },
        }
    })
}

/// Frames a subscriber may fall behind, where the scene does not say: at most 64 MB for all subscribers together.
pub fn default_queue(handles: usize, subscribers: usize) -> usize {
    (QUEUE_BYTES / frame_bytes(handles) / subscribers).clamp(2, 64)
}

fn frame_bytes(handles: usize) -> usize {
    size_of::<FrameHeader>() + handles * size_of::<HandlePose>()
}

/// What a publisher offers.
#[derive(Debug, Clone)]
pub struct PublisherConfig {
    /// The name under which services appear.
    pub name: String,
    /// Handles in a frame.
    pub handles: usize,
    /// Frames a subscriber may fall behind.
    pub queue: usize,
    /// Subscribers that each service admits at once.
    pub subscribers: usize,
    /// Whether there is an alerts service.
    pub alerts: bool,
    /// The stage, sent once and kept for late subscribers.
    pub stage: Stage,
}

type Service<Payload, Header> = publish_subscribe::PortFactory<ipc::Service, Payload, Header>;
type Sender<Payload, Header> = Port<ipc::Service, Payload, Header>;

/// Publishes frames, alerts and the stage.
pub struct SharedMemoryPublisher {
    poses: Sender<[HandlePose], FrameHeader>,
    poses_service: Service<[HandlePose], FrameHeader>,
    alerts: Option<Sender<CollisionAlert, ()>>,
    stage: Sender<Stage, ()>,
    tick: Notifier<ipc::Service>,
    tick_service: event::PortFactory<ipc::Service>,
    // Dropped last: the ports above belong to it.
    _node: Node<ipc::Service>,
}

impl SharedMemoryPublisher {
    /// Opens the services and sends the stage. To be called on the thread that will publish.
    ///
    /// # Errors
    /// [`OpenError`]: each names what is in the way and what to do.
    pub fn open(config: &PublisherConfig) -> Result<Self, OpenError> {
        retry_while_incomplete(|| Self::open_now(config))
    }

    fn open_now(config: &PublisherConfig) -> Result<Self, OpenError> {
        let name = config.name.as_str();
        service_name(name, "poses")?;
        check_room(config)?;
        let node = node()?;
        let frame_service = frames(&node, config)?;
        let poses = frame_service
            .publisher_builder()
            .initial_max_slice_len(config.handles)
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| port_error(name, "poses", error))?;
        let alerts = if config.alerts { Some(sender(&node, name, "alerts", config.subscribers)?) } else { None };
        let stage = sender(&node, name, "stage", config.subscribers)?;
        stage.send_copy(config.stage).map_err(|error| failed(name, "stage", error))?;
        let tick_service = node
            .service_builder(&service_name(name, "tick")?)
            .event()
            .max_listeners(config.subscribers)
            .max_nodes(config.subscribers + SPARE_NODES)
            .open_or_create()
            .map_err(|error| match error {
                EventOpenOrCreateError::EventOpenError(EventOpenError::HangsInCreation) => incomplete(name, "tick"),
                other => failed(name, "tick", other),
            })?;
        let tick = tick_service.notifier_builder().create().map_err(|error| failed(name, "tick", error))?;
        reserve_pages()?;
        Ok(Self { poses, poses_service: frame_service, alerts, stage, tick, tick_service, _node: node })
    }

    fn send_frame(&self, header: &FrameHeader, frame: &Frame) -> Result<(), String> {
        let sample = self.poses.loan_slice_uninit(frame.chain.handles()).map_err(|error| error.to_string())?;
        let mut sample = sample.write_from_fn(|handle| handle_pose(&frame.chain, handle));
        *sample.user_header_mut() = FrameHeader { sent_ns: monotonic_ns(), ..*header };
        sample.send().map(|_| ()).map_err(|error| error.to_string())
    }

    fn send_alerts(&self, header: &FrameHeader, frame: &Frame) -> Result<(), String> {
        let Some(port) = &self.alerts else { return Ok(()) };
        for alert in &frame.alerts {
            port.send_copy(collision_alert(header, alert)).map_err(|error| error.to_string())?;
        }
        Ok(())
    }
}

impl Publisher for SharedMemoryPublisher {
    fn publish(&mut self, header: &FrameHeader, frame: &Frame) -> Result<(), PublishError> {
        let sent = self.send_frame(header, frame).and_then(|()| self.send_alerts(header, frame));
        sent.map_err(|reason| PublishError(format!("the shared memory failed: {reason}")))?;
        // Waking costs a socket write per listener, several times what sending does: it is left out for nobody.
        if self.tick_service.dynamic_config().number_of_listeners() > 0 {
            // A listener that died or does not drain is its own loss: the frame is in its queue.
            let _ = self.tick.notify();
        }
        Ok(())
    }

    fn maintain(&mut self) {
        // A late subscriber gets the history of a service only when its publisher looks for new connections.
        if let Some(alerts) = &self.alerts {
            let _ = alerts.update_connections();
        }
        let _ = self.stage.update_connections();
        let _ = self.poses.update_connections();
    }

    fn subscribers(&self) -> u32 {
        self.poses_service.dynamic_config().number_of_subscribers() as u32
    }
}

/// Publishes the loop's status; to be made on the statistics thread.
pub struct StatusSender {
    status: Sender<LoopStatus, ()>,
    _node: Node<ipc::Service>,
}

impl StatusSender {
    /// Opens `<name>/status`, which admits so many `subscribers` at once.
    ///
    /// # Errors
    /// As [`SharedMemoryPublisher::open`].
    pub fn open(name: &str, subscribers: usize) -> Result<Self, OpenError> {
        retry_while_incomplete(|| {
            let node = node()?;
            let status = sender(&node, name, "status", subscribers)?;
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

/// Refuses queues that the shared memory has no room for.
fn check_room(config: &PublisherConfig) -> Result<(), OpenError> {
    let PublisherConfig { queue, subscribers, .. } = *config;
    // Two frames that a subscriber may hold, two loans, the history, and a little for bookkeeping.
    let frames = subscribers * (queue + 2) + 4;
    let needed = (frames * frame_bytes(config.handles)) as u64 + 2_000_000;
    match free_bytes() {
        Some(free) if free < needed => Err(OpenError::NoRoom { queue, subscribers, needed, free }),
        _ => Ok(()),
    }
}

/// Refuses to subscribe where the shared memory is as good as full.
///
/// # Errors
/// [`OpenError::Full`].
pub fn check_room_to_subscribe() -> Result<(), OpenError> {
    match free_bytes() {
        Some(free) if free < SUBSCRIBER_BYTES => Err(OpenError::Full { free }),
        _ => Ok(()),
    }
}

/// What is left of the shared memory; `None` where there is no such folder: iceoryx2 itself will say what is wrong.
fn free_bytes() -> Option<u64> {
    let space = nix::sys::statvfs::statvfs(SHARED_MEMORY).ok()?;
    Some(space.blocks_available() * space.fragment_size())
}

/// Has the system set aside every page of the shared memory that this process has mapped. Without this a page is looked
/// for when it is first written, and should others have filled the memory by then, the process is killed with SIGBUS.
///
/// # Errors
/// [`OpenError::Full`] where the pages are not there.
pub fn reserve_pages() -> Result<(), OpenError> {
    let full = || OpenError::Full { free: free_bytes().unwrap_or(0) };
    // Linux has this file for every process.
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let mapped: BTreeSet<_> = maps.lines().filter_map(|line| Some(&line[line.find(SHARED_MEMORY)?..])).collect();
    // A file that is removed meanwhile needs no pages.
    for file in mapped.into_iter().filter_map(|file| OpenOptions::new().read(true).write(true).open(file).ok()) {
        let length = file.metadata().map_or(0, |of| of.len());
        if length > 0 {
            nix::fcntl::posix_fallocate(&file, 0, length as i64).map_err(|_| full())?;
        }
    }
    Ok(())
}

/// The service of frames. One left by a watcher can have shorter queues than this publisher would make: it is used as
/// it is.
fn frames(
    node: &Node<ipc::Service>,
    config: &PublisherConfig,
) -> Result<Service<[HandlePose], FrameHeader>, OpenError> {
    let full_name = service_name(&config.name, "poses")?;
    let builder = || {
        node.service_builder(&full_name)
            .publish_subscribe::<[HandlePose]>()
            .user_header::<FrameHeader>()
            .max_publishers(1)
            .enable_safe_overflow(true)
    };
    let made = builder()
        .max_subscribers(config.subscribers)
        .max_nodes(config.subscribers + SPARE_NODES)
        .subscriber_max_buffer_size(config.queue)
        .open_or_create();
    match made {
        Err(PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(
            PublishSubscribeOpenError::DoesNotSupportRequestedMinBufferSize,
        )) => {
            log::warn!(
                "a subscriber keeps \"{full_name}\" open with shorter queues than {} frames: those are used",
                config.queue
            );
            builder().open().map_err(|error| service_error(&full_name, PublishSubscribeOpenOrCreateError::from(error)))
        }
        other => other.map_err(|error| service_error(&full_name, error)),
    }
}

/// A port for messages that are sent seldom; the last one is kept for late subscribers.
fn sender<Message: ZeroCopySend + std::fmt::Debug + Copy>(
    node: &Node<ipc::Service>,
    name: &str,
    service: &str,
    subscribers: usize,
) -> Result<Sender<Message, ()>, OpenError> {
    let full_name = service_name(name, service)?;
    node.service_builder(&full_name)
        .publish_subscribe::<Message>()
        .max_publishers(1)
        .max_subscribers(subscribers)
        .max_nodes(subscribers + SPARE_NODES)
        .subscriber_max_buffer_size(SMALL_QUEUE)
        .history_size(1)
        .enable_safe_overflow(true)
        .open_or_create()
        .map_err(|error| service_error(&full_name, error))?
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|error| port_error(name, service, error))
}

fn service_error(service: &ServiceName, error: PublishSubscribeOpenOrCreateError) -> OpenError {
    use PublishSubscribeOpenError as Open;
    if matches!(error, PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(Open::HangsInCreation)) {
        return OpenError::Incomplete(service.to_string());
    }
    let incompatible = match &error {
        PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(open) => !matches!(
            open,
            Open::DoesNotExist | Open::InternalFailure | Open::Interrupt | Open::InsufficientPermissions
        ),
        PublishSubscribeOpenOrCreateError::PublishSubscribeCreateError(create) => {
            matches!(create, PublishSubscribeCreateError::AlreadyExists)
        }
        _ => false,
    };
    if incompatible {
        OpenError::Incompatible(format!("{service} ({error:?})"))
    } else {
        OpenError::Failed { service: service.to_string(), reason: format!("{error:?}") }
    }
}

fn port_error(name: &str, service: &str, error: PublisherCreateError) -> OpenError {
    match error {
        PublisherCreateError::ExceedsMaxSupportedPublishers => OpenError::AlreadyPublished(name.to_owned()),
        other => failed(name, service, other),
    }
}

fn incomplete(name: &str, service: &str) -> OpenError {
    OpenError::Incomplete(format!("{name}/{service}"))
}

/// Tries again while a service is incomplete: its maker is about to finish it, or was killed, and then its file is removed
/// after a while ([`stale_files`]).
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

fn failed(name: &str, service: &str, error: impl std::fmt::Debug) -> OpenError {
    OpenError::Failed { service: format!("{name}/{service}"), reason: format!("{error:?}") }
}
