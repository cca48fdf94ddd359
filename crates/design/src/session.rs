//! The session of a page: its text, its picture, and the searches of the text.
//!
//! In: requests as JSON, in order. Out: answers, from the thread of the session and from that of the searches. The
//! session keeps the last text that is a scene: handles and numbers change that one.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use serde_json::{Value, json};

use crate::change::changed;
use crate::frame::{Frames, stage};
use crate::handles;
use crate::plan::RunningPlan;
use crate::request::{Request, Wish};
use crate::scene::{DesignedScene, Fault};
use crate::search::{Job, Searcher};
use crate::templates::{TEMPLATES, template};
use bench_dragon_messages::{FrameHeader, HandlePose, StageMessage};
use bench_dragon_show::scene::SceneError;

/// The requests of a page that may wait. A page waits for an answer before its next change.
const MOST_WAITING: usize = 512;

/// The time after which a picture that waits for a search is tried again.
const NEXT_TRIAL: Duration = Duration::from_millis(50);

/// An answer to a page.
#[derive(Debug, Clone)]
pub enum Answer {
    /// A JSON text.
    Json(String),
    /// The stage of a scene with this name.
    Stage(Box<StageMessage>, String),
    /// A frame.
    Frame(FrameHeader, Vec<HandlePose>),
}

/// Receives the answers of a session, from any of its threads.
pub type Answers = Arc<dyn Fn(Answer) + Send + Sync>;

/// Reads the file of a design again.
pub type ReadFile = Arc<dyn Fn() -> Result<String, SceneError> + Send + Sync>;

/// The file of a design.
#[derive(Clone)]
pub struct DesignFile {
    /// Its name in sentences.
    pub shown: String,
    /// Reads it.
    pub read: ReadFile,
    /// True if it may be saved.
    pub save: bool,
}

/// The session of one page. It ends when it is dropped.
pub struct Session {
    requests: SyncSender<String>,
}

impl Session {
    /// Starts a session with the text of the file, or of the first template.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(file: Option<DesignFile>, answers: Answers) -> io::Result<Self> {
        let (requests, received) = sync_channel(MOST_WAITING);
        let found = Arc::clone(&answers);
        let searcher = Searcher::start(move |answer: &Value| found(Answer::Json(answer.to_string())))?;
        // Solvers do not leave the thread that made them.
        std::thread::Builder::new().name("design".to_owned()).spawn(move || {
            let new = Desk {
                file,
                answers,
                searcher,
                scene: None,
                frames: None,
                plan: None,
                is_refused: false,
                at: 0.0,
                run: 0,
                shown_later: None,
                drawn_later: None,
            };
            new.serve(&received);
        })?;
        Ok(Self { requests })
    }

    /// Takes a request; its answers come later. Returns `None` if too many requests are waiting.
    pub fn request(&self, json: String) -> Option<()> {
        self.requests.try_send(json).ok()
    }
}

/// The state of a session.
struct Desk {
    file: Option<DesignFile>,
    answers: Answers,
    searcher: Searcher,
    /// The last text that is a scene.
    scene: Option<Arc<DesignedScene>>,
    frames: Option<Frames>,
    plan: Option<RunningPlan>,
    /// True if the page has a text that is none.
    is_refused: bool,
    /// The simulated time of the picture.
    at: f64,
    /// Grows with every scene.
    run: u64,
    /// The request whose scene is not shown yet, and the request whose picture is not drawn yet.
    shown_later: Option<u64>,
    drawn_later: Option<u64>,
}

impl Desk {
    fn serve(mut self, requests: &Receiver<String>) {
        self.answer(0, Wish::File);
        self.show();
        loop {
            let request = match self.drawn_later {
                Some(_) => requests.recv_timeout(NEXT_TRIAL),
                None => requests.recv().map_err(RecvTimeoutError::from),
            };
            match request {
                Ok(request) => self.read(&request),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            // Pictures may take longer than changes: only the newest of those that wait is drawn.
            requests.try_iter().take(MOST_WAITING).for_each(|request| self.read(&request));
            self.show();
        }
    }

    fn read(&mut self, request: &str) {
        match Request::read(request) {
            Ok((id, wish)) => self.answer(id, wish),
            Err(error) => self.refuse(0, &error.to_string().into()),
        }
    }

    fn json(&self, answer: &Value) {
        (self.answers)(Answer::Json(answer.to_string()));
    }

    fn refuse(&self, id: u64, fault: &Fault) {
        self.json(&json!({"id": id, "error": fault}));
    }

    fn answer(&mut self, id: u64, wish: Wish) {
        let text = match wish {
            Wish::Text(text) => return self.take(id, &text),
            Wish::Template(key) => match template(&key) {
                Some(template) => return self.take(id, template.text),
                None => Err(format!("there is no template \"{key}\"").into()),
            },
            Wish::File => match self.file_text() {
                Ok(text) => return self.take(id, &text),
                Err(error) => Err(error.to_string().into()),
            },
            Wish::At(time) => {
                self.at = if time.is_finite() { time.max(0.0) } else { 0.0 };
                self.drawn_later = Some(id);
                return;
            }
            Wish::Cancel => {
                self.plan = None;
                return;
            }
            Wish::Plan(kind, vary) => match self.good() {
                Ok(scene) => return self.plan(id, kind, vary, scene),
                Err(fault) => Err(fault),
            },
            wish => self.good().and_then(|scene| {
                let timeline = self.searcher.timeline(self.run);
                // All other requests change the text.
                changed(&scene, &wish, self.at, timeline.as_ref()).unwrap_or_else(|| Ok(scene.text.clone()))
            }),
        };
        match text.and_then(|text| DesignedScene::read(&text, &self.shown())) {
            Ok(scene) => self.accept(id, scene),
            Err(fault) => self.refuse(id, &fault),
        }
    }

    /// Returns the scene that a change is made to.
    fn good(&self) -> Result<Arc<DesignedScene>, Fault> {
        match &self.scene {
            Some(scene) if !self.is_refused => Ok(Arc::clone(scene)),
            _ => Err("the text is no scene, expected one before it is changed in the picture".to_owned().into()),
        }
    }

    fn shown(&self) -> String {
        self.file.as_ref().map_or("scene", |file| &file.shown).to_owned()
    }

    fn file_text(&self) -> Result<String, SceneError> {
        self.file.as_ref().map_or_else(|| Ok(TEMPLATES[0].text.to_owned()), |file| (file.read)())
    }

    /// Takes a whole text.
    fn take(&mut self, id: u64, text: &str) {
        match DesignedScene::read(text, &self.shown()) {
            Ok(scene) => self.accept(id, scene),
            Err(fault) => {
                // The last good picture stays, so it has to be there.
                self.show();
                self.is_refused = true;
                (self.frames, self.plan) = (None, None);
                self.searcher.search(None);
                // The page knows every text but the first one and that of the file.
                self.json(&json!({"id": id, "error": fault_of(&fault, text)}));
            }
        }
    }

    /// Takes a scene in place of the last one. It is shown later, unless another one replaces it before.
    fn accept(&mut self, id: u64, scene: DesignedScene) {
        if let Some(replaced) = self.shown_later.replace(id) {
            self.json(&json!({"id": replaced, "replaced": id}));
        }
        self.is_refused = false;
        self.scene = Some(Arc::new(scene));
        (self.frames, self.plan) = (None, None);
        self.run += 1;
        // The old search ends while this picture is made.
        self.searcher.search(None);
    }

    /// Shows the newest scene, if it is not shown yet: its fields, its picture, and its events as they are found. Draws
    /// the picture of another time.
    fn show(&mut self) {
        let (shown, drawn) = (self.shown_later.take(), self.drawn_later.take());
        let Some(scene) = self.scene.clone() else { return };
        if let Some(id) = shown {
            self.json(&described(id, &scene));
            let stage = Box::new(stage(&scene.scene, self.run, scene.path_end()));
            (self.answers)(Answer::Stage(stage, scene.scene.name.clone()));
        }
        if let Some(id) = shown.max(drawn) {
            self.draw(id);
        }
        if let Some(id) = shown {
            self.json(&json!({"id": id, "events": {"state": "computing"}}));
            self.searcher.search(Some(Job { id, run: self.run, scene }));
        }
    }

    /// Starts a plan, and ends another one.
    fn plan(&mut self, id: u64, kind: String, vary: Vec<String>, scene: Arc<DesignedScene>) {
        let answers = Arc::clone(&self.answers);
        let answer = move |answer: &Value| answers(Answer::Json(answer.to_string()));
        let started = RunningPlan::start(id, kind, vary, scene, answer);
        match started {
            Ok(plan) => self.plan = Some(plan),
            Err(error) => self.refuse(id, &format!("there is no thread for a plan: {error}").into()),
        }
    }

    /// Draws the scene at the time of the picture.
    fn draw(&mut self, id: u64) {
        let Some(scene) = &self.scene else { return };
        if self.frames.as_ref().is_none_or(|frames| !frames.know_all_events())
            && let Some(timeline) = self.searcher.timeline(self.run)
        {
            self.frames = Some(Frames::new(&scene.scene, self.run, Some(timeline)));
        }
        let frames = self.frames.get_or_insert_with(|| Frames::new(&scene.scene, self.run, None));
        match frames.at(self.at, id, !self.is_refused) {
            Some((header, poses)) => (self.answers)(Answer::Frame(header, poses)),
            None if frames.waits() => self.drawn_later = Some(id),
            None => {}
        }
    }
}

/// Returns a fault with the text that has it.
fn fault_of(fault: &Fault, text: &str) -> Value {
    let mut fault = json!(fault);
    fault["text"] = text.into();
    fault
}

/// Returns the first message to a page.
pub fn greeting(file: Option<&DesignFile>, needs_token: bool) -> String {
    let templates = TEMPLATES.map(|template| json!({"key": template.key, "title": template.title}));
    let hello = json!({
        "file": file.map(|file| &file.shown),
        "save": file.is_some_and(|file| file.save),
        "token": needs_token,
        "templates": templates,
    });
    json!({"id": 0, "hello": hello}).to_string()
}

/// Returns the answer that describes a scene.
fn described(id: u64, designed: &DesignedScene) -> Value {
    let ensemble = &designed.scene.ensemble;
    let names: Vec<&str> =
        ensemble.dragons().iter().map(|dragon| &*dragon.name).filter(|name| !name.is_empty()).collect();
    json!({"id": id, "scene": {
        "text": designed.text,
        "name": designed.scene.name,
        "fields": designed.listed_fields(),
        "handles": handles::handles(designed),
        "start": 0.0,
        "end": designed.path_end(),
        "cues": designed.cues(),
        "doubts": designed.scene.doubts,
        "handles_in_scene": ensemble.handles(),
        "dragons": names,
        "pieces": designed.pieces(),
        "obstacles": designed.obstacles(),
    }})
}
