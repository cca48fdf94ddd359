//! Runs of the loop on a simulated clock with a log in memory, and logs that were changed.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use super::super::arithmetic::Arithmetic;
use super::super::lines::{HashChain, Line, ShowLine};
use super::super::verify::{Verdict, VerifyError, verify};
use super::super::writer::LogWriter;
use super::super::{LogPublisher, LogReader, queue_of};
use crate::live::control::{CommandQueues, CommandSender, command_queue};
use crate::live::show_source::ShowSource;
use crate::live::{FrameSource, LoopCounts, LoopOptions, Outgoing, Period, PublishError, Publisher, Reports, run_loop};
use bench_dragon_messages::control::Command;
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::convert::Stamps;
use bench_dragon_show::scene::SceneText;
use bench_dragon_show::{Outcome, Playback, Show};
use bench_dragon_testing::simulated::{SimulatedClock, Wake};

pub const RATE: f64 = 50.0;

/// A small team. The safe solver needs no table, and a show without alerts no search, so that an unoptimised build is
/// quick.
pub fn scene_text(extra: &str, alerts_wanted: bool) -> SceneText {
    let text = include_str!("../../../../../config/paper.toml");
    let text = text.replace("benches = 223", "benches = 12").replace("start_turn = 16", "start_turn = 5");
    let text: String =
        text.lines().filter(|line| !line.starts_with("accuracy")).map(|line| format!("{line}\n")).collect();
    let text = text.replace("[motion]\n", &format!("[motion]\n{extra}\n"));
    let (before, alerts) = text.split_once("[alerts]").unwrap();
    let (_, after) = alerts.split_once("[publish]").unwrap();
    let text = if alerts_wanted { text.clone() } else { format!("{before}[publish]{after}") };
    SceneText { text, file: "small.toml".to_owned(), stem: "small".to_owned() }
}

pub const NEWTON: &str = "solver = \"newton\"";

/// A show with commands: each frame sends the next command and takes the answers.
pub struct Conducted {
    show: ShowSource,
    sender: CommandSender,
    commands: std::vec::IntoIter<Command>,
    answers: Rc<RefCell<Vec<Outcome>>>,
}

impl Conducted {
    fn exchange(&mut self) {
        while let Some(answer) = self.sender.answer() {
            self.answers.borrow_mut().push(answer.outcome);
        }
        if self.sender.waiting() < 2
            && let Some(command) = self.commands.next()
        {
            self.sender.send(command).unwrap();
        }
    }
}

impl FrameSource for Conducted {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        self.exchange();
        self.show.frame(tick, stamps)
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        self.show.command(tick, command)
    }

    fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        self.show.finished_step(tick)
    }
}

pub type File = Rc<RefCell<Vec<u8>>>;

/// A file in memory.
pub struct SharedFile(pub File);

impl std::io::Write for SharedFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The log's publisher. The loop does the work of the log's thread after each frame, except while `held_up` is true.
pub struct Inline {
    publisher: LogPublisher,
    reader: LogReader,
    writer: LogWriter<SharedFile>,
    held_up: fn(u64) -> bool,
    ended: Rc<Cell<Option<LoopCounts>>>,
}

impl Publisher for Inline {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        self.publisher.publish(outgoing)?;
        if !(self.held_up)(outgoing.header.tick) {
            self.reader.empty(&mut self.writer);
        }
        Ok(())
    }

    fn prepare(&mut self) {
        self.publisher.prepare();
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

impl Drop for Inline {
    fn drop(&mut self) {
        self.reader.empty(&mut self.writer);
        self.ended.get().iter().for_each(|counts| self.writer.end(counts));
    }
}

/// A transport that fails at a tick.
struct Failing(Option<u64>);

impl Publisher for Failing {
    fn publish(&mut self, outgoing: Outgoing<'_>) -> Result<(), PublishError> {
        if self.0 == Some(outgoing.header.tick) { Err(PublishError("it fails".to_owned())) } else { Ok(()) }
    }

    fn maintain(&mut self) {}

    fn subscribers(&self) -> u32 {
        0
    }
}

/// A run to be logged.
pub struct Setup {
    pub text: SceneText,
    pub playback: fn(&mut Playback),
    pub commands: Vec<Command>,
    pub wakes: Vec<Wake>,
    pub periods: u64,
    pub words: usize,
    pub held_up: fn(u64) -> bool,
    /// The tick at which another transport fails.
    pub fails_at: Option<u64>,
    pub instructions: Instructions,
}

impl Setup {
    pub fn new(periods: u64) -> Self {
        Self {
            text: scene_text(NEWTON, false),
            playback: |_| (),
            commands: Vec::new(),
            wakes: Vec::new(),
            periods,
            words: 5000,
            held_up: |_| false,
            fails_at: None,
            instructions: Instructions::available()[0],
        }
    }

    pub fn run(self) -> Run {
        let mut scene = self.text.parse().unwrap();
        scene.ensemble = scene.ensemble.with_instructions(&[self.instructions]).unwrap();
        let mut playback = Playback { rate: RATE, ..Playback::of(&scene) };
        (self.playback)(&mut playback);
        let timeline = match scene.alerts {
            Some(_) => scene.ensemble.timeline(&mut unreported),
            None => scene.ensemble.timeline_without_contact(&mut unreported),
        };
        let show = Show::new(&scene, timeline, playback).unwrap();
        let solver = show.solver_reason().to_owned();
        let line = ShowLine::new(&self.text, &playback, Arithmetic::of(&scene), &solver, 7, 8);
        let file = File::default();
        let (publisher, reader) = queue_of(self.words, 200);
        let ended = Rc::new(Cell::new(None));
        let writer = LogWriter::new(SharedFile(file.clone()), line);
        let publisher = Inline { publisher, reader, writer, held_up: self.held_up, ended: ended.clone() };
        let (port, sender) = command_queue();
        let answers = Rc::new(RefCell::new(Vec::new()));
        let show = ShowSource::new(show);
        let mut frames = Conducted { show, sender, commands: self.commands.into_iter(), answers: answers.clone() };
        let clock = SimulatedClock::new(5, self.wakes);
        let (samples, _inbox) = rtrb::RingBuffer::new(1);
        let (announcements, _lines) = rtrb::RingBuffer::new(1);
        let options = LoopOptions { run_id: 7, rate: playback.rate, periods: Some(self.periods) };
        let mut publishers: Vec<Box<dyn Publisher>> = vec![Box::new(Failing(self.fails_at)), Box::new(publisher)];
        let reports = Reports::new(samples, announcements);
        let mut queues = CommandQueues::new(vec![port]);
        let counts = run_loop(&clock, &mut frames, &mut queues, &mut publishers, options, reports, &clock.stop);
        let counts = counts.unwrap_or_else(|(counts, _)| counts);
        frames.exchange();
        ended.set(Some(counts));
        drop((publishers, frames));
        Run {
            counts,
            answers: Rc::into_inner(answers).unwrap().into_inner(),
            log: Rc::into_inner(file).unwrap().into_inner(),
        }
    }
}

pub struct Run {
    pub counts: LoopCounts,
    pub answers: Vec<Outcome>,
    pub log: Vec<u8>,
}

impl Run {
    pub fn lines(&self) -> Vec<Line> {
        let mut chain = HashChain::default();
        let text = std::str::from_utf8(&self.log).unwrap();
        text.split_inclusive('\n').map(|line| chain.read(line).unwrap()).collect()
    }
}

pub fn sealed(lines: &[Line]) -> Vec<u8> {
    let mut chain = HashChain::default();
    lines.iter().flat_map(|line| chain.line(line).into_bytes()).collect()
}

pub fn verified(log: &[u8]) -> Result<Verdict, VerifyError> {
    verify(log, "test.jsonl", &mut |_| ())
}

/// Three seconds: commands and a step in the first, skipped periods in the second.
pub fn conducted() -> Run {
    let commands = vec![Command::Seek(20.0), Command::Pause, Command::Step(3), Command::Resume, Command::State];
    let mut wakes = vec![Wake::Late(0); 400];
    wakes[60] = Wake::Late(70_000_000);
    Setup { commands, wakes, ..Setup::new(150) }.run()
}

/// Verifies a log with a changed line and new checks.
pub fn forged(run: &Run, change: impl Fn(&mut Line) -> bool) -> Result<Verdict, VerifyError> {
    let mut lines = run.lines();
    let changed = lines.iter_mut().filter_map(|line| change(line).then_some(())).count();
    assert!(changed > 0, "nothing was changed");
    verified(&sealed(&lines))
}
