//! The searches for events and clearances of one text, on a thread of their own.
//!
//! In: the newest scene. Out: events and clearances, each as it is found. A newer scene stops the search of the old one.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use serde_json::{Value, json};

use crate::scene::DesignedScene;
use bench_dragon_show::results::{EventLine, clearance_lines, event_sentence};
use bench_dragon_show::timed_cues;

/// A scene to search, with the number of the request that it comes from.
#[derive(Clone)]
pub struct Job {
    /// The number of the request.
    pub id: u64,
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
    is_closed: bool,
}

impl Searcher {
    /// Starts the thread. `found` gets the answers.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(found: impl Fn(Value) + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new().name("search".to_owned()).spawn(move || {
            while let Some((number, job)) = of_thread.next() {
                search(&job, &|| of_thread.newest.load(Ordering::Relaxed) == number, &found);
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
}

impl Drop for Searcher {
    fn drop(&mut self) {
        self.shared.newest.fetch_add(1, Ordering::Relaxed);
        self.shared.lock().is_closed = true;
        self.shared.changed.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> std::sync::MutexGuard<'_, Slot> {
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

/// Searches a scene while it is wanted.
fn search(job: &Job, is_wanted: &dyn Fn() -> bool, found: &dyn Fn(Value)) {
    let Job { id, scene: designed } = job;
    let scene = &designed.scene;
    let timeline = scene.ensemble.timeline(&mut |_| ());
    if !is_wanted() {
        return;
    }
    let line_of = |event: &bench_dragon_motion::event::Event| {
        let obstacle = scene.ensemble.obstacle_of(event)?;
        let obstacles = designed.obstacles();
        let listed = obstacles.iter().find(|listed| listed.title.as_deref() == Some(&obstacle.name))?;
        Some(listed.line)
    };
    let list = timeline.all().into_iter().map(|timed| {
        let mut line = json!(EventLine::new(scene, &timed));
        line["sentence"] = event_sentence(scene, &timed).trim_start().into();
        line["line"] = json!(line_of(&timed.event));
        line
    });
    let (cues, _) = timed_cues(scene, &timeline);
    let cues = cues.iter().map(|cue| json!({"name": &*cue.name, "at": cue.time}));
    found(json!({"id": id, "events": {
        "state": if timeline.searched_until().is_some() { "given_up" } else { "exact" },
        "list": list.collect::<Vec<_>>(),
        "cues": cues.collect::<Vec<_>>(),
        "end": timeline.end().time,
        "show_end": timeline.show_end(scene.stops_at_contact()).time,
    }}));
    let least = scene.ensemble.least_clearances(&timeline, timeline.end(), &mut |_| ());
    let beside = scene.ensemble.obstacle_clearances(timeline.end(), &mut |_| ());
    if !is_wanted() {
        return;
    }
    let list = clearance_lines(scene, &timeline, &least, &beside);
    found(json!({"id": id, "facts": {"state": "exact", "list": list, "curve": []}}));
}
