//! Reads the shared memory and keeps the newest picture. In: the events of a [`feed`](bench_dragon_client::feed). Out:
//! a [`Picture`] in a channel.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::{Facts, Picture, Proofs, SceneHash, SceneInPlay, wire};
use bench_dragon_client::feed::{Feed, FeedEvent};
use bench_dragon_messages::{LoopStatus, Stage, StageMessage};
use bench_dragon_proof::ProvedEvent;

/// The interval of polls: some browsers draw 240 times a second, none needs more. Waking this thread at each frame
/// would cost the publisher more than the frame itself.
const POLL_INTERVAL: Duration = Duration::from_millis(4);
/// The time before the next attempt if the services cannot be used.
const RETRY_INTERVAL: Duration = Duration::from_millis(200);
/// The interval of looks for other shows while there is no publisher.
const LOOK_INTERVAL: Duration = Duration::from_secs(2);
/// The cues kept for a slow browser; a show with more cues keeps all of them.
const KEPT_CUES: usize = 16;

/// Keeps the picture up to date until `stop` is set, through any number of publishers of a name.
pub(super) fn read(
    mut feed: Feed,
    name: &str,
    proofs: &Proofs,
    facts: &Arc<Facts>,
    sender: &watch::Sender<Picture>,
    stop: &AtomicBool,
) {
    let mut reader = Reader::new(name, proofs, facts);
    let mut reason: Option<String> = None;
    let mut looked = Instant::now();
    sender.send_replace(reader.picture.clone());
    while !stop.load(Ordering::Relaxed) {
        let mut changed = false;
        let polled = feed.poll(POLL_INTERVAL, &mut |event| changed |= reader.handle(event));
        changed |= reader.look_for_proof();
        changed |= reader.look_for_facts();
        // The services may become usable while this continues: a program of another version ends, a subscriber leaves.
        let now = polled.err().map(|error| error.to_string());
        if now != reason {
            now.iter().for_each(|sentence| log::warn!("{sentence}"));
            if now.is_some() || !changed {
                reader.picture = Picture::waiting(now.as_deref());
            }
            changed = true;
        }
        if !reader.picture.waiting.is_empty() && looked.elapsed() >= LOOK_INTERVAL {
            looked = Instant::now();
            let picture = Picture::waiting(now.as_deref());
            changed |= picture.waiting != reader.picture.waiting;
            reader.picture.waiting = picture.waiting;
        }
        // Known when the publisher is found, thus no later than its stage.
        let shares_clock = feed.shares_clock();
        changed |= shares_clock != reader.picture.shares_clock;
        reader.picture.shares_clock = shares_clock;
        if changed {
            sender.send_replace(reader.picture.clone());
        }
        if now.is_some() {
            std::thread::sleep(RETRY_INTERVAL);
        }
        reason = now;
    }
}

/// The newest messages, as far as they have come.
struct Reader<'a> {
    picture: Picture,
    /// The publisher's name.
    publisher: String,
    proofs: &'a Proofs,
    facts: &'a Arc<Facts>,
    stage: Option<StageMessage>,
    /// The proofs of the scene of that stage.
    proved: Option<Arc<[ProvedEvent]>>,
    /// The scene for which the log has the warning that no certificate is for it.
    unproved: Option<SceneHash>,
    /// The latest status: only a status has the scene's name.
    status: Option<LoopStatus>,
    /// Cues that have come so far.
    cues: u64,
    /// The run and the scene whose facts are not computed yet.
    unknown: Option<(u64, SceneHash)>,
    /// The run, the hash and the text of the latest scene, until the stage of its run has come.
    scene: Option<(u64, SceneHash, String)>,
}

impl<'a> Reader<'a> {
    fn new(name: &str, proofs: &'a Proofs, facts: &'a Arc<Facts>) -> Self {
        Self {
            picture: Picture::waiting(None),
            publisher: name.to_owned(),
            proofs,
            facts,
            stage: None,
            proved: None,
            unproved: None,
            status: None,
            cues: 0,
            unknown: None,
            scene: None,
        }
    }

    /// Applies an event. Returns true if the picture changed.
    fn handle(&mut self, event: FeedEvent<'_>) -> bool {
        match event {
            FeedEvent::Stage { stage, segments } => {
                self.stage = Some(StageMessage { stage: *stage, segments: segments.to_vec() });
                self.proved = self.proofs.of(&stage.scene_hash);
                self.describe();
                self.set_scene();
                self.warn_of_another_scene();
            }
            FeedEvent::Alert(alert) => {
                let unknown = Stage::default();
                self.picture.alert = wire::alert(alert, self.stage().unwrap_or(&unknown)).into();
            }
            FeedEvent::Cue(cue) => {
                self.cues += 1;
                let most = self.stage().map_or(0, |stage| stage.cues as usize).max(KEPT_CUES);
                let kept = self.picture.cues.iter().rev().take(most - 1).rev().cloned();
                self.picture.cues = kept.chain([(self.cues, wire::cue(cue).into())]).collect();
            }
            FeedEvent::Frame { header, handles, .. } => self.picture.frame = wire::frame(header, handles).into(),
            FeedEvent::Gone => {
                self.picture = Picture::waiting(None);
                (self.stage, self.proved, self.status, self.unknown) = (None, None, None, None);
                return true;
            }
            FeedEvent::Status(status) => {
                if self.status.replace(*status).is_some_and(|known| known.run_id == status.run_id) {
                    return false;
                }
                self.describe();
                return true;
            }
            FeedEvent::Scene { header, text } => {
                if !text.is_empty() {
                    self.facts.request(header.hash, text);
                    self.unknown = Some((header.run_id, header.hash));
                    self.scene = Some((header.run_id, header.hash, text.to_owned()));
                }
                return self.set_scene();
            }
            FeedEvent::Chase(status) => {
                self.picture.chase = wire::chase(status).into();
                return true;
            }
            // The page itself counts the time since the latest frame, so a silent publisher changes no picture.
            FeedEvent::Silent | FeedEvent::Started { .. } => return false,
        }
        self.picture.waiting = Default::default();
        true
    }

    fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref().map(|message| &message.stage)
    }

    /// Sets the scene of the picture once its text and its stage have come. Returns true then.
    fn set_scene(&mut self) -> bool {
        let Some(stage) = &self.stage else { return false };
        self.picture.scene.take_if(|scene| scene.run_id != stage.stage.run_id);
        let Some((_, hash, text)) = self.scene.take_if(|(run_id, ..)| *run_id == stage.stage.run_id) else {
            return false;
        };
        self.picture.scene = Some(Arc::new(SceneInPlay::new(hash, text, stage)));
        true
    }

    /// Looks for proofs of the scene that came after its stage. Returns true if they change the picture.
    fn look_for_proof(&mut self) -> bool {
        let Some(stage) = self.stage().filter(|_| self.proved.is_none()) else { return false };
        self.proved = self.proofs.of(&stage.scene_hash);
        if self.proved.is_some() {
            self.describe();
        }
        self.proved.is_some()
    }

    /// Looks for facts about the scene that have been computed. Returns true if they change the picture.
    fn look_for_facts(&mut self) -> bool {
        let Some((run, scene)) = self.unknown else { return false };
        let Some(facts) = self.facts.of(&scene) else { return false };
        self.picture.facts = wire::facts(run, &facts).into();
        self.unknown = None;
        true
    }

    /// Warns once for each scene that all certificates are for other scenes.
    fn warn_of_another_scene(&mut self) {
        let Some(stage) = self.stage().copied().filter(|stage| self.proofs.are_of_others(&stage.scene_hash)) else {
            return;
        };
        if self.unproved.replace(stage.scene_hash) != Some(stage.scene_hash) {
            log::warn!(
                "\"{}\" shows a scene whose text no certificate has (BLAKE3 {}): its page shows no proofs",
                self.publisher,
                stage.scene_hash_digits().as_deref().unwrap_or("not known")
            );
        }
    }

    /// Updates the message about the stage, with the scene's name when it is known.
    fn describe(&mut self) {
        let Some(stage) = &self.stage else { return };
        let status = self.status.as_ref().filter(|status| status.run_id == stage.stage.run_id);
        let scene = status.map(|status| status.scene.as_str());
        self.picture.stage = wire::stage(stage, &self.publisher, scene, self.proved.as_deref()).into();
    }
}
