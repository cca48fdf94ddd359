//! Cost of a step of the loop, by the size of the team. The measured parts are the solver, the clearance, the way into
//! shared memory, and the whole step. Beside them, as many bytes are copied into the same memory. The parts are
//! measured in turn, frame by frame, in one run, with one subscriber that takes every frame. The figures are medians.
//!
//! Then the step of the paper's team again, beside the same step with one and with two empty command queues.
//!
//! Then whole steps by rate and size of the team, with and without alerts, with two subscribers: the clearance costs more
//! in some steps than in others.
//!
//! And the step of the paper's team at 10 kHz, without and with a log (`run --log`), and the log's work after the step.
//!
//! `cargo bench --bench step`, or with some numbers of benches: `cargo bench --bench step -- 223 100000`, or the
//! command queues alone: `cargo bench --bench step -- queues`, or the rates: `cargo bench --bench step -- rates`, or the
//! log: `cargo bench --bench step -- log`

use std::hint::black_box;
use std::time::{Duration, Instant};

use bench_dragon::client::connection::{Connection, Subscription, Wake};
use bench_dragon::client::shared_memory::{node, service_name};
use bench_dragon::messages::{FrameHeader, HandlePose};
use bench_dragon::motion::event::unreported;
use bench_dragon::publisher::live::control::{CommandQueues, CommandSender, command_queue};
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::publisher::live::{Outgoing, Publisher};
use bench_dragon::publisher::log;
use bench_dragon::publisher::log::arithmetic::Arithmetic;
use bench_dragon::publisher::log::lines::ShowLine;
use bench_dragon::publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
use bench_dragon::show::convert::{Stamps, frame_header, handle_pose, stage};
use bench_dragon::show::scene::{Scene, SceneText};
use bench_dragon::show::{Playback, Show};

const SIZES: [usize; 4] = [223, 5_000, 100_000, 1_000_000];
/// Start of the show, simulated seconds; the show plays at 60 Hz from there.
const START: f64 = 200.0;
/// Frames of a part before the turn of the next part. There are few, so that all parts see the same machine. But there
/// are enough that a part finds its own memory in the caches as the loop would.
const BATCH: usize = 4;
/// Rounds before the first counted round: every page has been written by then.
const WARM_UP: usize = 1;
/// Rounds that end before the scene's contact.
const MOST_ROUNDS: usize = 3_000;
/// Wall time of the measurement of one size.
const TIME: Duration = Duration::from_secs(5);
/// Frames in the queue of the subscriber.
const QUEUE: usize = 2;
/// Polls of the command queues for one figure: one poll takes less than a clock resolves.
const POLLS: usize = 1_000;
/// Copies that are held at once, so that copying uses memory as little cached as publishing does.
const COPIES: usize = QUEUE + 2;

fn main() {
    if std::env::args().any(|argument| argument == "queues") {
        return measure_queues();
    }
    if std::env::args().any(|argument| argument == "rates") {
        return measure_rates();
    }
    if std::env::args().any(|argument| argument == "log") {
        return measure_log();
    }
    let given: Vec<usize> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    println!(
        "| benches | bytes | solver | clearance | publish | step | step without alerts | memcpy | (step without alerts - \
         solver) / memcpy | rate | rate without alerts |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for benches in if given.is_empty() { SIZES.to_vec() } else { given } {
        measure(benches);
    }
    measure_queues();
    measure_rates();
    measure_log();
}

/// Returns the paper's scene with another number of benches.
fn scene(benches: usize) -> Scene {
    let text = include_str!("../config/paper.toml").replace("benches = 223 ", &format!("benches = {benches} "));
    Scene::parse(&text, "paper.toml", "paper").expect("the paper's scene, with more benches")
}

/// Microseconds of each part, by frame.
#[derive(Default)]
struct Times {
    solver: Vec<f64>,
    clearance: Vec<f64>,
    publish: Vec<f64>,
    step: Vec<f64>,
    /// Without alerts.
    bare_step: Vec<f64>,
    memcpy: Vec<f64>,
}

fn measure(benches: usize) {
    let scene = scene(benches);
    let handles = scene.ensemble.handles();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let playback = Playback { start: START, ..Playback::of(&scene) };
    let show_of = |scene: &Scene| Show::new(scene, timeline.clone(), playback).expect("200 s is before the contact");
    let (mut show, mut bare_show) = (show_of(&scene), show_of(&Scene { alerts: None, ..scene.clone() }));
    let mut choice = scene.ensemble.only().unwrap().solver(scene.velocities);
    let mut monitor = scene.ensemble.only().unwrap().clearance_monitor(&choice);
    let name = format!("bench_{}_{benches}", std::process::id());
    let (mut publisher, mut connection) = publisher_and_subscriber(&name, &scene, &show, 1);
    let mut frame = show.frame(0).clone();

    // Copies as many bytes into samples of a service of the same kind.
    let node = node().expect("the publisher has made one too");
    let service = node
        .service_builder(&service_name(&name, "copies").expect("the publisher's name, almost"))
        .publish_subscribe::<[HandlePose]>()
        .user_header::<FrameHeader>()
        .create()
        .expect("no other process uses this name");
    let port = service.publisher_builder().initial_max_slice_len(handles).max_loaned_samples(COPIES);
    let port = port.create().expect("the memory for it is there");
    let poses: Vec<HandlePose> = (0..handles).map(|handle| handle_pose(&frame.chain, handle)).collect();
    let loan = || port.loan_slice_uninit(handles).expect("as many as are admitted").write_from_slice(&poses);
    let mut copies: [_; COPIES] = std::array::from_fn(|_| loan());

    let mut times = Times::default();
    let mut began = Instant::now();
    for round in 0.. {
        if round == WARM_UP {
            times = Times::default();
            began = Instant::now();
        }
        if round > WARM_UP && (began.elapsed() > TIME || round == MOST_ROUNDS) {
            break;
        }
        let ticks = (1 + round * BATCH) as u64..(1 + (round + 1) * BATCH) as u64;
        for (show, times) in [(&mut show, &mut times.step), (&mut bare_show, &mut times.bare_step)] {
            for tick in ticks.clone() {
                timed(times, || {
                    let frame = show.frame(tick);
                    let header = frame_header(frame, stamps(tick));
                    publisher.publish(Outgoing::new(&header, frame)).expect("no other process uses this service");
                });
                drain(&mut connection);
            }
        }
        for tick in ticks.clone() {
            let time = START + tick as f64 / 60.0;
            let chain = &mut frame.chain;
            timed(&mut times.solver, || choice.solver.solve(time, chain).expect("200 s is before the lock"));
            let header = frame_header(&frame, stamps(tick));
            timed(&mut times.publish, || {
                publisher.publish(Outgoing::new(&header, &frame)).expect("no other process uses this service")
            });
            drain(&mut connection);
        }
        for tick in ticks.clone() {
            let time = START + tick as f64 / 60.0;
            choice.solver.solve(time, &mut frame.chain).expect("200 s is before the lock");
            let solver = choice.solver.as_mut();
            timed(&mut times.clearance, || monitor.nearest(&frame.chain, time, f64::INFINITY, solver));
        }
        for copy in &mut copies {
            timed(&mut times.memcpy, || copy.payload_mut().copy_from_slice(black_box(&poses)));
        }
    }
    row(benches, handles, times);
}

/// Returns a publisher that admits `subscribers` of them, and one subscriber.
fn publisher_and_subscriber(
    name: &str,
    scene: &Scene,
    show: &Show,
    subscribers: usize,
) -> (SharedMemoryPublisher, Connection) {
    let config = PublisherConfig {
        name: name.to_owned(),
        handles: scene.ensemble.handles(),
        single_precision: None,
        queue: QUEUE,
        subscribers,
        alerts: true,
        cues: 0,
        scene: String::new(),
        stage: stage(1, 0, [0; 32], &scene.ensemble, show),
    };
    let publisher = SharedMemoryPublisher::open(&config).expect("the name holds this process's number");
    (publisher, subscriber(name))
}

fn subscriber(name: &str) -> Connection {
    let subscription = Subscription::new(name, Wake::Never).expect("the publisher has taken this name");
    subscription.connect().expect("the publisher is there").expect("the publisher is there")
}

/// Measures whole steps with two subscribers, without alerts and with them, in turn.
fn measure_rates() {
    println!(
        "\n| benches | Hz | step without alerts: median | mean | with alerts: median | mean | 99 % | most |\n\
         |---|---|---|---|---|---|---|---|"
    );
    for (benches, rate) in
        [(223, 60.0), (223, 1_000.0), (5_000, 60.0), (5_000, 1_000.0), (100_000, 1.0), (100_000, 60.0)]
    {
        let scene = scene(benches);
        let timeline = scene.ensemble.timeline(&mut unreported);
        let playback = Playback { start: START, rate, ..Playback::of(&scene) };
        let show_of =
            |scene: &Scene| Show::new(scene, timeline.clone(), playback).expect("200 s is before the contact");
        let mut shows = [show_of(&Scene { alerts: None, ..scene.clone() }), show_of(&scene)];
        let name = format!("bench_{}_rates", std::process::id());
        let (mut publisher, mut first) = publisher_and_subscriber(&name, &scene, &shows[0], 2);
        let mut second = subscriber(&name);
        let mut times: [Vec<f64>; 2] = Default::default();
        let most = ((200.0 * rate) as usize).min(40_000) / BATCH;
        let began = Instant::now();
        for round in 0..most {
            for (times, show) in times.iter_mut().zip(&mut shows) {
                for tick in (round * BATCH) as u64..((round + 1) * BATCH) as u64 {
                    timed(times, || {
                        let frame = show.frame(tick);
                        let header = frame_header(frame, stamps(tick));
                        publisher.publish(Outgoing::new(&header, frame)).expect("no other process uses this service");
                    });
                    drain(&mut first);
                    drain(&mut second);
                }
            }
            if round >= WARM_UP && began.elapsed() > TIME {
                break;
            }
        }
        let [without, with] = times.map(|mut times| {
            times.drain(..WARM_UP * BATCH);
            times.sort_by(f64::total_cmp);
            let mean = times.iter().sum::<f64>() / times.len() as f64;
            [times[times.len() / 2], mean, times[times.len() * 99 / 100], times[times.len() - 1]]
        });
        let [median, mean, ..] = without;
        let [of_clearance, mean_of_clearance, high, most] = with;
        println!(
            "| {benches} | {rate} | {median:.2} us | {mean:.2} us | {of_clearance:.2} us | {mean_of_clearance:.2} us | \
             {high:.2} us | {most:.2} us |"
        );
    }
}

/// Measures steps with no command queue, one and two, in turn: the same show, so that its work costs all of them the
/// same.
fn measure_queues() {
    let scene = scene(223);
    let playback = Playback { start: START, ..Playback::of(&scene) };
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show = Show::new(&scene, timeline, playback).expect("200 s is before the contact");
    let (mut publisher, mut connection) =
        publisher_and_subscriber(&format!("bench_{}_queues", std::process::id()), &scene, &show, 1);
    let mut show = ShowSource::new(show);
    // The outer ends stay: a queue without a sender behaves differently.
    let (mut queues, outer): (Vec<CommandQueues>, Vec<Vec<CommandSender>>) = (0..3)
        .map(|count| {
            let (ports, outer): (Vec<_>, Vec<_>) = (0..count).map(|_| command_queue()).unzip();
            (CommandQueues::new(ports), outer)
        })
        .unzip();
    let mut times: [Vec<f64>; 3] = Default::default();
    let mut takes: [Vec<f64>; 3] = Default::default();
    let began = Instant::now();
    let mut tick = 0;
    for round in 0..MOST_ROUNDS / queues.len() {
        for place in 0..queues.len() {
            // The order of the three changes.
            let count = (place + round) % queues.len();
            let queues = &mut queues[count];
            for _ in 0..BATCH {
                tick += 1;
                timed(&mut times[count], || {
                    queues.take_one(&mut show, tick);
                    publisher.publish(show.outgoing(tick, stamps(tick))).expect("no other process uses this service");
                    queues.finish_step(&mut show, tick);
                });
                drain(&mut connection);
            }
            timed(&mut takes[count], || {
                for _ in 0..POLLS {
                    black_box(&mut *queues).take_one(&mut show, tick);
                    black_box(&mut *queues).finish_step(&mut show, tick);
                }
            });
        }
        if began.elapsed() > TIME {
            break;
        }
    }
    drop(outer);
    let step = times.map(median);
    let take = takes.map(median);
    println!("\n| queues | step | beside a step without | the queues alone |\n|---|---|---|---|");
    for count in 0..step.len() {
        let alone = take[count] * 1e3 / POLLS as f64;
        println!("| {count} | {:.3} us | {:.3} | {alone:.1} ns |", step[count], step[count] / step[0]);
    }
}

/// Measures steps at 10 kHz without a log and with one, in turn. The log's thread reads the data that the step has
/// written, so the next step must come as late as it does in a run.
fn measure_log() {
    let scene = scene(223);
    let playback = Playback { start: START, rate: 10_000.0, ..Playback::of(&scene) };
    let timeline = scene.ensemble.timeline(&mut unreported);
    let mut show = Show::new(&scene, timeline, playback).expect("200 s is before the contact");
    let (mut publisher, mut connection) =
        publisher_and_subscriber(&format!("bench_{}_log", std::process::id()), &scene, &show, 1);
    let file = std::env::temp_dir().join(format!("bench_dragon_step_{}.jsonl", std::process::id()));
    let line = ShowLine::new(&SceneText::paper(), &playback, Arithmetic::of(&scene), show.solver_reason(), 1, 0);
    let (mut log, outcome) = log::open(&file, line, scene.ensemble.handles()).expect("a file in the temporary folder");
    let mut logging = log.publisher().expect("no other caller has taken it");
    let (mut times, mut after): ([Vec<f64>; 2], Vec<f64>) = Default::default();
    let began = Instant::now();
    for tick in 1.. {
        while began.elapsed().as_secs_f64() < tick as f64 / playback.rate {
            std::hint::spin_loop();
        }
        if began.elapsed() > 2 * TIME {
            break;
        }
        // The same number of frames each, in blocks that are longer than the sleep of the log's thread.
        let logged = tick / 100 % 2 == 1;
        timed(&mut times[usize::from(logged)], || {
            let frame = show.frame(tick);
            let header = frame_header(frame, stamps(tick));
            publisher.publish(Outgoing::new(&header, frame)).expect("no other process uses this service");
            if logged {
                logging.publish(Outgoing::new(&header, frame)).expect("a log ends no run");
            }
        });
        if logged {
            timed(&mut after, || logging.prepare());
        }
        drain(&mut connection);
    }
    log.finish();
    let whole = outcome.failure().is_none();
    // The file has no further use.
    let _ = std::fs::remove_file(&file);
    let ([without, with], after) = (times.map(median), median(after));
    println!("\n| step at 10 kHz | with a log | difference | after the step | log whole |\n|---|---|---|---|---|");
    println!("| {without:.2} us | {with:.2} us | {:.2} us | {after:.2} us | {whole} |", with - without);
}

fn stamps(sequence: u64) -> Stamps {
    Stamps { run_id: 1, sequence, stamp_ns: 0, deadline_ns: 0 }
}

/// Receives all waiting messages, as a subscriber that keeps up does.
fn drain(connection: &mut Connection) {
    connection.frames(|header, handles| {
        black_box((header.sequence, handles[0].x));
    });
}

/// Runs a function and notes its duration.
fn timed<T>(times: &mut Vec<f64>, run: impl FnOnce() -> T) -> T {
    let began = Instant::now();
    let result = black_box(run());
    times.push(began.elapsed().as_secs_f64() * 1e6);
    result
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn row(benches: usize, handles: usize, times: Times) {
    let bytes = size_of::<FrameHeader>() + handles * size_of::<HandlePose>();
    let Times { solver, clearance, publish, step, bare_step, memcpy } = times;
    let [solver, clearance, publish, step, bare_step, memcpy] =
        [solver, clearance, publish, step, bare_step, memcpy].map(median);
    let ratio = (bare_step - solver) / memcpy;
    let [rate, bare_rate] = [step, bare_step].map(|step| 1e6 / step);
    println!(
        "| {benches} | {bytes} | {solver:.2} us | {clearance:.2} us | {publish:.2} us | {step:.2} us | {bare_step:.2} us | \
         {memcpy:.2} us | {ratio:.1} | {rate:.0} Hz | {bare_rate:.0} Hz |"
    );
}
