//! The counted code: the parts of a step of the loop, and steps of a certificate. The test in `main.rs` starts [`run`]
//! under callgrind and reads its output.

use std::f64::consts::TAU;
use std::hint::black_box;

use bench_dragon::certify::{CertificateLine, certify};
use bench_dragon::client::connection::{Connection, Subscription, Wake};
use bench_dragon::messages::control::Command;
use bench_dragon::motion::Method;
use bench_dragon::motion::clearance::{ClearanceMonitor, Pairs, Precision};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::ground::{Ground, Obstacle};
use bench_dragon::motion::model::Point;
use bench_dragon::motion::model::shape::Shape;
use bench_dragon::motion::solve::selection;
use bench_dragon::motion::solve::table::{FollowerTable, Instructions};
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::proof;
use bench_dragon::publisher::live::Publisher;
use bench_dragon::publisher::live::control::{CommandQueues, CommandSender, command_queue};
use bench_dragon::publisher::live::show_source::{FrameMessages, ShowSource};
use bench_dragon::publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
use bench_dragon::show::alerts::LevelTracker;
use bench_dragon::show::convert::{Stamps, stage};
use bench_dragon::show::scene::{Scene, SceneText};
use bench_dragon::show::{Frame, Playback, Show};

/// Text before the name of the instruction set that reads tables.
pub const WITH: &str = "instructions: ";
/// Text before the name of a part and the number of its calls.
pub const PART: &str = "counted: ";
/// Calls of a part of a step.
const CALLS: u64 = 60;
/// Time of the first call, simulated seconds; the calls continue at 60 Hz.
const START: f64 = 200.0;
/// Rate of the steps and of the clearance, in Hz: at a lower rate a frame has a larger share in preparing windows.
const RATE: f64 = 1_000.0;
/// The same time on the route, which is shorter.
const ON_ROUTE: f64 = 100.0;
/// Steps of the certificate.
const STEPS: u64 = 20;
const STAMPS: Stamps = Stamps { run_id: 1, sequence: 1, stamp_ns: 0, deadline_ns: 0 };

/// Callgrind counts only this function and its callees, by the name of this function.
#[inline(never)]
fn counted(call: &mut dyn FnMut(u64), number: u64) {
    call(number);
    // Prevents the compiler from making this a jump to `call`.
    black_box(number);
}

/// Callgrind writes its counts and starts again from zero when this function ends.
#[inline(never)]
fn part_is_over(name: &str, calls: u64) {
    println!("{PART}{calls} {name}");
}

/// Counts `call`, with `prepare` before each call, which is not counted. The first call is not counted either, since it
/// may do more.
fn part<T>(name: &str, on: &mut T, mut prepare: impl FnMut(&mut T, u64), mut call: impl FnMut(&mut T, u64)) {
    for number in 0..=CALLS {
        prepare(on, number);
        match number {
            0 => call(on, 0),
            _ => counted(&mut |number| call(on, number), number),
        }
    }
    part_is_over(name, CALLS);
}

/// Counts all parts. Making tables takes longest under callgrind, so there are as few tables as possible.
pub fn run() {
    let paper = Scene::paper();
    let motion = paper.ensemble.only().unwrap();
    println!("{WITH}{}", motion.instructions().name());
    let Method::Accuracy(accuracy) = motion.method() else { panic!("the paper's scene names a solver") };
    let (path, team) = (motion.path(), *motion.team());
    let table = selection::cheapest(path, team, 1.0, Velocities::Computed, accuracy, &mut unreported).unwrap().table;
    let mut portable = table.for_frames().with_instructions(Instructions::Portable).unwrap();
    frame("frame", &mut table.for_frames(), START, team.handles());
    frame("frame, portable", &mut portable, START, team.handles());
    let route = Scene::load("config/procession.toml".as_ref()).unwrap();
    let mut solver = route.ensemble.only().unwrap().solver(Velocities::Computed).solver;
    frame("frame on a route, 60 benches", solver.as_mut(), ON_ROUTE, route.ensemble.handles());
    let square = [(-14.0, -14.0), (14.0, -14.0), (14.0, 14.0), (-14.0, 14.0)].map(|(x, y)| Point::new(x, y));
    let wall = [(-9.0, 10.0), (0.0, 12.0), (9.0, 10.0)].map(|(x, y)| Point::new(x, y));
    let shapes = [
        Shape::circle(Point::new(0.3, 0.2), 0.5),
        Shape::line(wall.to_vec()),
        Shape::polygon([(-9.0, -14.0), (0.0, -12.0), (9.0, -14.0)].map(|(x, y)| Point::new(x, y)).to_vec()),
        Shape::boundary(square.to_vec()),
    ];
    let obstacles = shapes.map(|shape| Obstacle { name: String::new(), shape, keep_out: 0.2 });
    let star = Obstacle { name: String::new(), shape: Shape::polygon(star()), keep_out: 0.2 };
    for (name, obstacles) in [
        ("clearance", Vec::new()),
        ("clearance, with four obstacles", obstacles.into()),
        ("clearance, with a star of 16 corners in overlap", vec![star]),
    ] {
        let precision = Precision { handle_error: table.accuracy(), seconds_per_link: team.shortest_link() };
        let monitor = ClearanceMonitor::new(&[team], Pairs::Own, Ground::new(obstacles), precision);
        clearance(name, monitor, table.for_frames(), team.handles());
    }
    // A search for the contact would take long.
    let timeline = paper.ensemble.timeline_without_contact(&mut unreported);
    step(&paper, &timeline);
    certificate();
}

fn frame(name: &str, solver: &mut dyn Solver, start: f64, handles: usize) {
    let mut chain = Chain::new(handles);
    part(
        name,
        &mut chain,
        |_, _| (),
        |chain, number| solver.solve(start + number as f64 / 60.0, black_box(chain)).unwrap(),
    );
}

/// Counts for a head that has travelled as many metres as there are seconds.
fn clearance(name: &str, monitor: ClearanceMonitor, table: FollowerTable, handles: usize) {
    let mut on = (table, Chain::new(handles), monitor);
    let time = |number: u64| START + number as f64 / RATE;
    // The second frame is the first for which a window is made.
    for number in 0..2 {
        let (solver, chain, monitor) = &mut on;
        solver.solve(time(number) - 2.0 / RATE, chain).unwrap();
        monitor.nearest(&*chain, time(number) - 2.0 / RATE, f64::INFINITY, solver);
    }
    part(
        name,
        &mut on,
        |(solver, chain, _), number| solver.solve(time(number), chain).unwrap(),
        |(solver, chain, monitor), number| {
            black_box(monitor.nearest(&*black_box(chain), time(number), f64::INFINITY, solver));
        },
    );
}

/// Returns the corners of a star on which the head and benches of other turns stand from [`START`] on.
fn star() -> Vec<Point> {
    let corner = |k: u32| {
        let (angle, radius) = (f64::from(k) * TAU / 16.0, if k.is_multiple_of(2) { 1.5 } else { 0.7 });
        Point::new(3.6 + radius * angle.cos(), -5.4 + radius * angle.sin())
    };
    (0..16).map(corner).collect()
}

/// State of the loop, and a subscriber that receives its messages.
struct Step {
    show: ShowSource,
    messages: FrameMessages,
    timeline: Timeline,
    rules: LevelTracker,
    frame: Frame,
    publisher: SharedMemoryPublisher,
    connection: Connection,
    queues: CommandQueues,
    sender: CommandSender,
}

impl Step {
    fn new(scene: &Scene, timeline: &Timeline) -> Self {
        let playback = Playback { start: START, rate: RATE, ..Playback::of(scene) };
        let mut show = Show::new(scene, timeline.clone(), playback).unwrap();
        let name = format!("test_{}_instructions", std::process::id());
        let config = PublisherConfig {
            name: name.clone(),
            handles: scene.ensemble.handles(),
            single_precision: None,
            queue: 2,
            subscribers: 1,
            alerts: true,
            cues: 0,
            scene: String::new(),
            stage: stage(1, 0, [0; 32], &scene.ensemble, &show),
        };
        let publisher = SharedMemoryPublisher::open(&config).unwrap();
        let connection = Subscription::new(&name, Wake::Never).unwrap().connect().unwrap().unwrap();
        let rules = LevelTracker::new(scene.alerts.unwrap(), playback.rate);
        let frame = show.frame(0).clone();
        let (port, sender) = command_queue();
        Self {
            show: ShowSource::new(show),
            messages: FrameMessages::new(0, 0),
            timeline: timeline.clone(),
            rules,
            frame,
            publisher,
            connection,
            queues: CommandQueues::new(vec![port]),
            sender,
        }
    }

    fn publish(&mut self) {
        self.publisher.publish(self.messages.of(&self.frame, STAMPS)).unwrap();
    }

    /// Receives the messages since the last call, as a subscriber that keeps up does.
    fn receive(&mut self, _: u64) {
        self.frame.alerts.clear();
        let frames = self.connection.frames(|header, handles| assert_eq!(header.handles as usize, handles.len()));
        let alert = self.connection.alert();
        black_box((frames, alert));
    }

    fn poll(&mut self, number: u64) {
        self.queues.take_one(&mut self.show, number);
        self.queues.finish_step(&mut self.show, number);
    }
}

fn step(scene: &Scene, timeline: &Timeline) {
    let on = &mut Step::new(scene, timeline);
    on.frame.alerts.clear();
    part("publish to one subscriber", on, Step::receive, |on, _| on.publish());
    // A level that is forgotten is announced again.
    part("alert: rules, and publish with it", on, Step::receive, |on, number| {
        let Step { rules, timeline, frame, .. } = on;
        rules.forget();
        rules.update(number, frame.sim_time, true, timeline, None, &mut frame.alerts);
        on.publish();
    });
    part("control poll", on, |_, _| (), Step::poll);
    part(
        "control poll with a command",
        on,
        |on, number| {
            on.sender.answer();
            on.show.show.frame(number);
            on.sender.send(Command::Rate(1.0)).unwrap();
        },
        Step::poll,
    );
    part("whole step", on, Step::receive, |on, number| {
        let tick = CALLS + number;
        on.queues.take_one(&mut on.show, tick);
        on.publisher.publish(on.show.outgoing(tick, STAMPS)).unwrap();
        on.queues.finish_step(&mut on.show, tick);
    });
}

/// Counts the first steps of a proof, and their check. The first step of a longer team is most of both: it compares all
/// pairs.
fn certificate() {
    let text = SceneText::paper().text.replace("benches = 223 ", "benches = 20 ");
    let scene = Scene::parse(&text, "paper.toml", "paper").unwrap();
    let motion = scene.ensemble.only().unwrap();
    assert_eq!(motion.team().benches, 20);
    let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
    let mut lines = Vec::new();
    let mut search = |steps: u64| {
        let mut write = |line: &CertificateLine| line.write(&mut lines);
        certify(&scene.ensemble, &timeline, &text, steps, &mut write, &mut unreported).unwrap();
    };
    counted(&mut search, STEPS);
    part_is_over("certificate step, 20 benches", STEPS);
    counted(&mut |_| drop(proof::verify(&lines[..], &mut |_| ()).unwrap()), STEPS);
    part_is_over("check of a certificate of 20 steps, 20 benches", 1);
}
