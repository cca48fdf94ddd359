//! The searches for events and clearances of one text, on a thread of their own.
//!
//! In: the newest scene. Out: events and clearances, each as it is found. A newer scene stops the search of an older
//! one.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::scene::DesignedScene;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::timeline::{TimedClearance, TimedObstacleClearance, Timeline};
use bench_dragon_show::curve::clearance_curve;
use bench_dragon_show::requirements::{Searched, verdicts};
use bench_dragon_show::results::{EventLine, clearance_lines, event_sentence};
use bench_dragon_show::timed_cues;

/// The time after which a search of one text ends.
const PATIENCE: Duration = Duration::from_secs(10);

/// A scene to search.
#[derive(Clone)]
pub struct Job {
    /// The number of the request that the scene comes from.
    pub id: u64,
    /// The number of the scene in its session.
    pub run: u64,
    /// The scene.
    pub scene: Arc<DesignedScene>,
}

/// The thread of the searches, and its newest job.
pub struct Searcher {
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    slot: Mutex<Slot>,
    changed: Condvar,
    /// Grows with every job: a search whose number is another one is out of date.
    newest: AtomicU64,
}

#[derive(Default)]
struct Slot {
    job: Option<(u64, Job)>,
    /// The events of the scene with this number.
    timeline: Option<(u64, Timeline)>,
    is_closed: bool,
}

impl Searcher {
    /// Starts the thread. `found` gets the answers.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(found: impl Fn(&Value) + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new().name("search".to_owned()).spawn(move || {
            while let Some((number, job)) = of_thread.next() {
                Search { shared: &of_thread, number, until: Instant::now() + PATIENCE }.run(&job, &found);
            }
        })?;
        Ok(Self { shared })
    }

    /// Searches this scene next, and stops the search of another one.
    pub fn search(&self, job: Option<Job>) {
        let number = self.shared.newest.fetch_add(1, Ordering::Relaxed) + 1;
        self.shared.lock().job = job.map(|job| (number, job));
        self.shared.changed.notify_one();
    }

    /// Returns the events of the scene of a number, if they are found.
    pub fn timeline(&self, run: u64) -> Option<Timeline> {
        let slot = self.shared.lock();
        slot.timeline.as_ref().filter(|(of, _)| *of == run).map(|(_, timeline)| timeline.clone())
    }
}

impl Drop for Searcher {
    fn drop(&mut self) {
        self.shared.newest.fetch_add(1, Ordering::Relaxed);
        self.shared.lock().is_closed = true;
        self.shared.changed.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Slot> {
        // A slot is whole after a panic, too.
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next job; `None` at the end.
    fn next(&self) -> Option<(u64, Job)> {
        let mut slot = self.lock();
        loop {
            if slot.is_closed {
                return None;
            }
            if let Some(job) = slot.job.take() {
                return Some(job);
            }
            slot = self.changed.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// The search of one scene.
struct Search<'s> {
    shared: &'s Shared,
    number: u64,
    until: Instant,
}

impl Search<'_> {
    fn is_wanted(&self) -> bool {
        self.shared.newest.load(Ordering::Relaxed) == self.number
    }

    /// Stops a search whose scene is out of date, or that takes too long.
    fn ask(&self) -> ControlFlow<()> {
        if self.is_wanted() && Instant::now() < self.until { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    /// Searches a scene while it is wanted.
    fn run(&self, job: &Job, found: &dyn Fn(&Value)) {
        let Job { id, run, scene: designed } = job;
        let scene = &designed.scene;
        let timeline = scene.ensemble.timeline(&mut |_| self.ask());
        if !self.is_wanted() {
            return;
        }
        self.shared.lock().timeline = Some((*run, timeline.clone()));
        found(&json!({"id": id, "events": events(designed, &timeline)}));
        let least = scene.ensemble.least_clearances(&timeline, timeline.end(), &mut |_| self.ask());
        let beside = scene.ensemble.obstacle_clearances(timeline.end(), &mut |_| self.ask());
        if !self.is_wanted() {
            return;
        }
        let gave_up = timeline.searched_until().is_some()
            || !least.is_complete
            || beside.len() < scene.ensemble.ground().obstacles().len()
            || beside.iter().any(|found| found.searched_until.is_some());
        let searched = Searched { timeline: &timeline, boards: least.of_show, obstacles: &beside, gave_up: "gave up" };
        let lines = clearance_lines(scene, &timeline, &least, &beside);
        let lines = lines.iter().map(|line| json!(line));
        let verdicts = verdicts(scene, &searched, None);
        let list: Vec<Value> = lines.chain(verdicts.iter().map(|verdict| json!(verdict))).collect();
        let mut facts = json!({"state": state(gave_up), "list": list, "curve": []});
        found(&json!({"id": id, "facts": facts}));
        let Some(nearest) = nearest(least.of_show, &beside).filter(|_| !gave_up) else { return };
        let curve = clearance_curve(scene, &timeline, timeline.end().time, nearest, &mut |_| self.ask());
        if let Some(curve) = curve {
            facts["curve"] = json!(curve);
            found(&json!({"id": id, "facts": facts}));
        }
    }
}

fn state(gave_up: bool) -> &'static str {
    if gave_up { "given_up" } else { "exact" }
}

/// Returns the time and the least clearance of boards and of obstacles.
fn nearest(boards: Option<TimedClearance>, obstacles: &[TimedObstacleClearance]) -> Option<[f64; 2]> {
    let boards = boards.map(|found| [found.time, found.least.value]);
    let all = boards.into_iter().chain(obstacles.iter().map(|found| [found.time, found.least.value]));
    all.min_by(|one, other| one[1].total_cmp(&other[1]))
}

/// Returns the events of a scene for its page.
fn events(designed: &DesignedScene, timeline: &Timeline) -> Value {
    let scene = &designed.scene;
    let obstacles = designed.obstacles();
    let line_of = |event: &Event| {
        let name = &scene.ensemble.obstacle_of(event)?.name;
        obstacles.iter().find(|listed| listed.title.as_ref() == Some(name)).map(|listed| listed.line)
    };
    let list = timeline.all().into_iter().map(|timed| {
        let mut line = json!(EventLine::new(scene, &timed));
        line["sentence"] = event_sentence(scene, &timed).trim_start().into();
        line["line"] = json!(line_of(&timed.event));
        line
    });
    let list: Vec<Value> = list.collect();
    let at =
        |cue: &bench_dragon_show::scene::cue::Cue| json!({"name": cue.name, "at": cue.time(&scene.ensemble, timeline)});
    let until = timeline.searched_until();
    json!({
        "state": state(until.is_some()),
        "sentence": until.map(|until| format!("the search gave up at t = {until} s: later events may be missing")),
        "list": list,
        "cues": scene.cues.iter().map(at).collect::<Vec<_>>(),
        "missing_cues": timed_cues(scene, timeline).1,
        "end": timeline.end().time,
        "show_end": timeline.show_end(scene.stops_at_contact()).time,
    })
}
