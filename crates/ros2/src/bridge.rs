//! A subscriber that publishes running shows on ROS 2, and on request offers services that control them.
//!
//! In: the events of the feed of each name. Out: for each run of a show its node, topics and services, from its first
//! frame until the show has ended. The scene, which the show sends along, has the topics, their quality of service and
//! the limits of the diagnostics.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ros2_client::Context;
use serde::Serialize;

use bench_dragon_client::feed::FeedEvent;
use bench_dragon_client::polling::Handler;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, StageMessage};
use bench_dragon_ros2_messages::settings::{Ros2Settings, StampClock};
use bench_dragon_show::scene::Scene;

use crate::commands::ShowCommands;
use crate::control::{ControlThread, Endpoints};
use crate::environment::{Network, check_name, warnings};
use crate::matching::Matches;
use crate::node::{self, EndedTopics, Topics};
use crate::rate::RateDivider;
use crate::{Ros2Config, Ros2Error, context, topic_names};

/// The longest wait for the scene after the first frame: a publisher detects a new subscriber within a second.
const SCENE_TIMEOUT: Duration = Duration::from_secs(2);

/// The interval of the counters.
const COUNTERS_INTERVAL: Duration = Duration::from_secs(1);

/// The settings of a bridge.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// The names of the shows.
    pub names: Vec<String>,
    /// The settings in place of those of the scenes.
    pub settings: Option<Ros2Settings>,
    /// True for services that control the shows.
    pub control: bool,
    /// The clock of the stamps in place of the scenes'.
    pub stamps: Option<StampClock>,
}

/// The messages of a bridge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct BridgeCounters {
    /// Frames sent.
    pub frames: u64,
    /// Frames that were due and that the bridge missed because it was behind.
    pub skipped: u64,
    /// Messages that did not fit into a queue because a reliable subscriber was slow or dead.
    pub discarded: u64,
}

/// A change of a bridge, for the user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Notice {
    /// The bridge is connected to a publisher, and receives what it needs to open the topics.
    Connected,
    /// The topics of a show are open.
    Opened {
        /// Their names.
        topics: Vec<String>,
    },
    /// The show has ended, and its topics are closed.
    Gone,
    /// The counters of all shows, once a second.
    Counted(BridgeCounters),
}

/// Publishes the shows of some names.
pub struct Bridge<'a> {
    shows: Vec<ShowBridge>,
    network: DdsNetwork,
    stop: &'a AtomicBool,
    failure: Option<Ros2Error>,
    notify: &'a mut dyn FnMut(usize, Notice),
    /// The time of the latest counters.
    counted: Instant,
}

/// The participant of this process.
struct DdsNetwork {
    context: Context,
    matches: Matches,
    /// True for services that control the shows.
    control: bool,
    stamps: Option<StampClock>,
}

/// The state of one name.
struct ShowBridge {
    name: String,
    /// The settings in place of those of the scene.
    settings: Option<Ros2Settings>,
    connected: bool,
    stage: Option<StageMessage>,
    scene: Option<ShowScene>,
    /// The latest alert and cue of a show whose topics are not open yet.
    alert: Option<CollisionAlert>,
    cue: Option<Cue>,
    /// The time of the first frame without topics.
    waiting_since: Option<Instant>,
    open: Option<OpenShow>,
    /// The topics of the run before.
    ended: Option<EndedTopics>,
    counters: BridgeCounters,
}

/// The parts of a scene that are not in its stage.
struct ShowScene {
    run_id: u64,
    /// True if there are alerts.
    alerts: bool,
    settings: Ros2Settings,
}

/// The node of one run.
struct OpenShow {
    run_id: u64,
    // Dropped before the topics: the services may answer until then.
    control: ControlThread,
    topics: Topics,
    divider: RateDivider,
}

impl<'a> Bridge<'a> {
    /// Joins the network that the environment names. `notify` is called with each change of the show with that index
    /// among the names. A later failure sets `stop`.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub fn join(
        config: BridgeConfig,
        stop: &'a AtomicBool,
        notify: &'a mut dyn FnMut(usize, Notice),
    ) -> Result<Self, Ros2Error> {
        let BridgeConfig { names, settings, control, stamps } = config;
        names.iter().try_for_each(|name| check_name(name))?;
        let variable = |name: &str| std::env::var(name).ok();
        let network = Network::of(variable)?;
        warnings(variable).iter().for_each(|sentence| log::warn!("{sentence}"));
        let context = context(network)?;
        let matches = Matches::new(&context);
        let show = |name| ShowBridge::new(name, settings.clone());
        let shows = names.into_iter().map(show).collect();
        let network = DdsNetwork { context, matches, control, stamps };
        Ok(Self { shows, network, stop, failure: None, notify, counted: Instant::now() })
    }

    /// Closes all topics and leaves the network when subscribers have had time to get the last messages. Returns the
    /// counters of all shows.
    ///
    /// # Errors
    /// The [`Ros2Error`] that ended the bridge.
    pub fn finish(mut self) -> Result<BridgeCounters, Ros2Error> {
        self.shows.iter_mut().for_each(ShowBridge::close);
        let until = self.shows.iter().filter_map(|show| show.ended.as_ref()).map(|ended| ended.until).max();
        if let Some(until) = until {
            std::thread::sleep(until.saturating_duration_since(Instant::now()));
        }
        let counters = self.counters();
        self.failure.map_or(Ok(counters), Err)
    }

    /// Returns the counters of all shows.
    fn counters(&self) -> BridgeCounters {
        let sum = |sum: BridgeCounters, of: &ShowBridge| {
            let BridgeCounters { frames, skipped, discarded } = of.counters;
            let open = of.open.as_ref().map_or(0, |open| open.topics.discarded());
            BridgeCounters {
                frames: sum.frames + frames,
                skipped: sum.skipped + skipped,
                discarded: sum.discarded + discarded + open,
            }
        };
        self.shows.iter().fold(BridgeCounters::default(), sum)
    }
}

impl Handler for Bridge<'_> {
    fn handle(&mut self, publisher: usize, event: FeedEvent<'_>) {
        let Self { shows, network, stop, failure, notify, counted: _ } = self;
        match shows[publisher].handle(event, network) {
            Ok(None) => (),
            Ok(Some(notice)) => notify(publisher, notice),
            Err(error) => {
                *failure = Some(error);
                stop.store(true, Ordering::Relaxed);
            }
        }
    }

    fn ready(&mut self, publisher: usize) {
        if !std::mem::replace(&mut self.shows[publisher].connected, true) {
            (self.notify)(publisher, Notice::Connected);
        }
    }

    fn polled(&mut self, now: Instant) {
        self.network.matches.update();
        for show in &mut self.shows {
            show.open.iter_mut().for_each(|open| open.topics.service());
            show.ended.take_if(|ended| ended.until <= now);
        }
        if now.duration_since(self.counted) >= COUNTERS_INTERVAL {
            self.counted = now;
            let counters = self.counters();
            (self.notify)(0, Notice::Counted(counters));
            if !is_rustdds_running() {
                self.failure = Some(Ros2Error::Ended);
                self.stop.store(true, Ordering::Relaxed);
            }
        }
    }
}

/// Returns false if RustDDS has ended its threads. It does so when a system call of theirs is interrupted
/// (`rtps/dp_event_loop.rs:308`, `discovery/discovery.rs:736`), as by a stop of the process or the sleep of the machine.
fn is_rustdds_running() -> bool {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return true };
    let names = threads.flatten().filter_map(|thread| std::fs::read_to_string(thread.path().join("comm")).ok());
    let names: Vec<String> = names.collect();
    // The system keeps the first 15 bytes of a name.
    ["RustDDS Partici", "RustDDS discove"].iter().all(|of| names.iter().any(|name| name.trim_end() == *of))
}

impl ShowBridge {
    fn new(name: String, settings: Option<Ros2Settings>) -> Self {
        Self {
            name,
            settings,
            connected: false,
            stage: None,
            scene: None,
            alert: None,
            cue: None,
            waiting_since: None,
            open: None,
            ended: None,
            counters: BridgeCounters::default(),
        }
    }

    fn handle(&mut self, event: FeedEvent<'_>, network: &DdsNetwork) -> Result<Option<Notice>, Ros2Error> {
        match event {
            FeedEvent::Stage { stage, segments } => {
                self.stage = Some(StageMessage { stage: *stage, segments: segments.to_vec() });
                return self.open_described(network);
            }
            FeedEvent::Scene { header, text } => {
                self.scene = Some(ShowScene::of(header.run_id, text));
                return self.open_described(network);
            }
            FeedEvent::Started { run_id } if self.open.as_ref().is_some_and(|open| open.run_id == run_id) => (),
            FeedEvent::Started { run_id } => {
                self.close();
                self.forget_other_runs(run_id);
            }
            FeedEvent::Frame { header, handles, missed } => return self.frame(header, handles, missed, network),
            FeedEvent::Alert(alert) => match &mut self.open {
                Some(open) => open.topics.alert(*alert),
                None => self.alert = Some(*alert),
            },
            FeedEvent::Cue(cue) => match &mut self.open {
                Some(open) => open.topics.cue(*cue),
                None => self.cue = Some(*cue),
            },
            FeedEvent::Status(status) => {
                if let Some(open) = &mut self.open {
                    open.divider.set_loop_rate(status.rate);
                    open.topics.status(status);
                }
            }
            FeedEvent::Chase(status) => self.open.iter_mut().for_each(|open| open.topics.chase(*status)),
            FeedEvent::Silent => (),
            FeedEvent::Gone => {
                self.close();
                let (ended, counters) = (self.ended.take(), self.counters);
                *self = Self { ended, counters, ..Self::new(self.name.clone(), self.settings.clone()) };
                return Ok(Some(Notice::Gone));
            }
        }
        Ok(None)
    }

    /// Drops what belongs to another run than `run_id`.
    fn forget_other_runs(&mut self, run_id: u64) {
        self.stage = self.stage.take().filter(|message| message.stage.run_id == run_id);
        self.scene = self.scene.take().filter(|scene| scene.run_id == run_id);
        self.alert = self.alert.filter(|alert| alert.run_id == run_id);
        self.cue = self.cue.filter(|cue| cue.run_id == run_id);
        self.waiting_since = None;
    }

    /// Opens the topics of a run once its stage and its scene have come, before the first frame: subscribers that are
    /// there need some time to discover the topics.
    fn open_described(&mut self, network: &DdsNetwork) -> Result<Option<Notice>, Ros2Error> {
        let run_id = self.stage.as_ref().map(|message| message.stage.run_id);
        match self.scene.take_if(|scene| Some(scene.run_id) == run_id) {
            Some(scene) => self.open(scene, network),
            None => Ok(None),
        }
    }

    /// Sends a frame if it is due. If no scene has come, a frame opens the topics without a scene after a time limit.
    fn frame(
        &mut self,
        header: &FrameHeader,
        handles: &[HandlePose],
        missed: u64,
        network: &DdsNetwork,
    ) -> Result<Option<Notice>, Ros2Error> {
        let notice = if self.open.is_none() { self.open_undescribed(header, network)? } else { None };
        if let Some(open) = self.open.as_mut().filter(|open| open.run_id == header.run_id) {
            let choice = open.divider.choose(header, missed);
            self.counters.skipped += choice.skipped;
            if choice.is_due {
                open.topics.service();
                open.topics.frame(header, handles);
                self.counters.frames += 1;
            }
        }
        Ok(notice)
    }

    fn open_undescribed(&mut self, header: &FrameHeader, network: &DdsNetwork) -> Result<Option<Notice>, Ros2Error> {
        let waited = self.waiting_since.get_or_insert_with(Instant::now).elapsed();
        if self.stage.is_none() || waited < SCENE_TIMEOUT {
            return Ok(None);
        }
        log::warn!("the show \"{}\" sends no scene: ROS 2 gets the default topics", self.name);
        self.open(ShowScene::unknown(header.run_id), network)
    }

    /// Opens the topics of a run of which the stage has come. Closes those of the run before.
    fn open(&mut self, scene: ShowScene, network: &DdsNetwork) -> Result<Option<Notice>, Ros2Error> {
        self.close();
        let Some(stage) = self.stage.clone() else { return Ok(None) };
        let ShowScene { run_id, alerts, settings } = scene;
        let DdsNetwork { context, matches, control, stamps } = network;
        let settings = self.settings.clone().unwrap_or(settings);
        let settings = Ros2Settings { stamps: stamps.unwrap_or(settings.stamps), ..settings };
        let (name, cues) = (self.name.clone(), stage.stage.cues as usize);
        let rate = settings.greatest_rate();
        let topic_names = topic_names(&name, &settings, alerts, cues);
        let handles = stage.stage.dragons.iter().map(|dragon| dragon.benches as usize + 1).sum();
        let config = Ros2Config { name, handles, settings, alerts, cues, stage };
        // The node of the run before has the same name, and subscribers would also get the latest alert of that run.
        self.ended = None;
        let mut node = node::open(context, &self.name)?;
        let endpoints = Endpoints::open(&self.name, context, &mut node, *control)?;
        let topics = Topics::open(context.clone(), node, matches.clone(), config)?;
        let commands = control.then(|| ShowCommands::start(&self.name)).transpose()?;
        let control = ControlThread::start(endpoints, matches.clone(), commands)?;
        let mut open = OpenShow { run_id, control, topics, divider: RateDivider::new(rate) };
        let (alert, cue) = (self.alert.take(), self.cue.take());
        alert.into_iter().filter(|alert| alert.run_id == run_id).for_each(|alert| open.topics.alert(alert));
        cue.into_iter().filter(|cue| cue.run_id == run_id).for_each(|cue| open.topics.cue(cue));
        self.open = Some(open);
        Ok(Some(Notice::Opened { topics: topic_names }))
    }

    /// Ends the topics and services of a run.
    fn close(&mut self) {
        let Some(OpenShow { control, topics, .. }) = self.open.take() else { return };
        self.counters.discarded += topics.discarded();
        drop(control);
        self.ended = topics.finish();
    }
}

impl ShowScene {
    /// Reads the text of the run's scene. The publisher has checked it; a publisher of a later version may know more.
    fn of(run_id: u64, text: &str) -> Self {
        if text.is_empty() {
            return Self::unknown(run_id);
        }
        match Scene::parse(text, "the scene of the show", "scene") {
            Ok(scene) => Self { run_id, alerts: scene.alerts.is_some(), settings: scene.ros2.unwrap_or_default() },
            Err(error) => {
                log::warn!("{error}: ROS 2 gets the default topics");
                Self::unknown(run_id)
            }
        }
    }

    /// Returns the defaults for a show whose scene is not known.
    fn unknown(run_id: u64) -> Self {
        Self { run_id, alerts: true, settings: Ros2Settings::default() }
    }
}
