//! One night: the actors start, the real loop runs, and the final counts are checked.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Instant;

use bench_dragon::publisher::live::control::{CommandQueues, CommandSender, command_queue};
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::publisher::live::statistics::{Collector, Run, queues_of};
use bench_dragon::publisher::live::{End, LoopCounts, LoopOptions, Publisher, StatusPublisher, run_loop};
use bench_dragon::show::scene::AtEnd;
use bench_dragon::show::{Playback, Show};
use bench_dragon_testing::model::{Formula, Model, ModelCue, ModelShow};

use crate::actors::{Controller, Statistics, Statuses, Stopper, Subscriber, WallClock};
use crate::collected::Collected;
use crate::levels::Levels;
use crate::oracle::{Checked, Oracle};
use crate::plan::{Plan, Stage};
use crate::port::{FULL, Receivers, SharedMemory};
use crate::random::Random;
use crate::tally::Tally;
use crate::world::{Trace, World, same};

/// All actors and models, without the loop.
struct Cast {
    world: Rc<World>,
    oracle: Rc<RefCell<Oracle>>,
    collected: Rc<RefCell<Collected>>,
    collector: Rc<RefCell<Collector<'static>>>,
    senders: Vec<Rc<RefCell<CommandSender>>>,
    subscribers: Vec<Rc<RefCell<Subscriber>>>,
}

/// Plays the night of a seed.
pub fn play(seed: u64, stages: &[Stage], trace: &Rc<Trace>) -> Tally {
    let mut random = Random::new(seed);
    let plan = Plan::draw(&mut random, stages);
    let stage = &stages[plan.stage];
    let world = Rc::new(World::new(&plan, random, Rc::clone(trace)));
    let show = Show::new(&stage.scene, stage.timeline.clone(), plan.playback).expect("a show");
    let (reports, inbox) = queues_of(plan.queues.0, plan.queues.1);
    let collected = Rc::new(RefCell::new(Collected::new(plan.queues.0, plan.queues.1, plan.begin_ns)));

    let sinks: Vec<Box<dyn StatusPublisher>> = vec![Box::new(Statuses(Rc::clone(&collected)))];
    let run_id = seed ^ 0x5eed;
    let oracle = oracle(&plan, stage, &show, run_id, &collected);
    let oracle = Rc::new(RefCell::new(oracle));
    let [announced, sampled] = [(); 2].map(|()| Rc::clone(&collected));
    let run = Run {
        run_id,
        rate: plan.rate,
        scene: "night",
        sinks,
        announce: Box::new(move |announcement| announced.borrow_mut().announcement(announcement)),
        record: Box::new(move |sample| sampled.borrow_mut().sample(sample)),
        alive: Box::new(|| ()),
    };
    let collector = Rc::new(RefCell::new(Collector::new(inbox, run, plan.begin_ns)));

    let receivers = Rc::<Receivers>::default();
    let origin = Instant::now();
    let reader = |reader: &crate::plan::Reader| {
        let of = (reader.depth, plan.rate, reader.every_ns, reader.lives);
        Rc::new(RefCell::new(Subscriber::new(&receivers, origin, of.0, of.1, of.2, of.3)))
    };
    let subscribers: Vec<_> = plan.readers.iter().map(reader).collect();
    let (ports, senders): (Vec<_>, Vec<_>) = plan
        .command_queues
        .iter()
        .map(|_| command_queue())
        .map(|(port, sender)| (port, Rc::new(RefCell::new(sender))))
        .unzip();
    let shared_memory = SharedMemory {
        world: Rc::clone(&world),
        oracle: Rc::clone(&oracle),
        receivers,
        room: plan.room,
        level: None,
        quiet_maintenance: 1000,
        maintained: None,
    };
    let mut publishers: Vec<Box<dyn Publisher>> = vec![Box::new(shared_memory)];
    let cast = Cast { world, oracle, collected, collector, senders, subscribers };
    cast.enter(&plan, stage);

    let mut frames =
        Checked { show: ShowSource::new(show), world: Rc::clone(&cast.world), oracle: Rc::clone(&cast.oracle) };
    let options = LoopOptions { run_id, rate: plan.rate, periods: plan.periods };
    let mut queues = CommandQueues::new(ports);
    let World { stop, .. } = &*cast.world;
    let result = run_loop(&*cast.world, &mut frames, &mut queues, &mut publishers, options, reports, stop);
    let counts = match result {
        Ok(counts) => counts,
        Err((counts, error)) => {
            same("the failure", (error.0.as_str(), counts.end), (FULL, End::Error));
            counts
        }
    };
    cast.settle(&plan, &counts)
}

fn oracle(plan: &Plan, stage: &Stage, show: &Show, run_id: u64, collected: &Rc<RefCell<Collected>>) -> Oracle {
    let Playback { rate, start, at_end, end_hold, paused, time_scale, .. } = plan.playback;
    let cues = show.cues().iter().map(|cue| ModelCue { time: cue.time, pauses: cue.pauses }).collect();
    let end_hold = (at_end == AtEnd::Loop).then(|| (end_hold * rate).round() as u64);
    let model = ModelShow { start, end: stage.show_end(&plan.playback), end_hold, cues };
    let model = Model::new(model, Formula::new(rate), time_scale, paused);
    let levels = stage.rules().map(|rules| Levels::new(rules, rate));
    Oracle::new(run_id, (rate, model), levels, stage.events(), plan.command_queues.len(), Rc::clone(collected))
}

impl Cast {
    /// Adds all actors to the world.
    fn enter(&self, plan: &Plan, stage: &Stage) {
        let Self { world, .. } = self;
        let soon = |ns: u64| plan.begin_ns + 1 + world.random.borrow_mut().below(ns);
        let statistics = Statistics {
            collector: Rc::clone(&self.collector),
            collected: Rc::clone(&self.collected),
            every_ns: plan.statistics_every_ns,
        };
        world.add(Box::new(statistics), soon(plan.statistics_every_ns));
        for (number, (pause_ns, sender)) in plan.command_queues.iter().zip(&self.senders).enumerate() {
            let controller = Controller {
                number,
                sender: Rc::clone(sender),
                oracle: Rc::clone(&self.oracle),
                pause_ns: *pause_ns,
                end: stage.show_end(&plan.playback),
                is_dead: false,
            };
            world.add(Box::new(controller), soon(*pause_ns as u64 + 1));
        }
        for subscriber in &self.subscribers {
            let every_ns = subscriber.borrow().every_ns;
            world.add(Box::new(Rc::clone(subscriber)), soon(every_ns));
        }
        let every_ns = plan.wall_clock_every_ns;
        world.add(Box::new(WallClock { every_ns }), soon(every_ns as u64 + 1));
        if let Some(stop_ns) = plan.stop_ns {
            world.add(Box::new(Stopper), stop_ns);
        }
    }

    /// Delivers the messages in flight after the end of the loop, and compares all counts.
    fn settle(self, plan: &Plan, counts: &LoopCounts) -> Tally {
        let Self { world, oracle, collected, collector, senders, subscribers } = self;
        oracle.borrow_mut().pace.ended(&world, counts, plan.periods);
        let mut last = collector.borrow_mut();
        last.take();
        let now_ns = world.now_ns();
        last.report(now_ns, true, |status| bench_dragon::messages::LoopStatus { stamp_ns: now_ns, ..status });
        collected.borrow().ended(&last.summary(), counts.frames);
        for (number, sender) in senders.iter().enumerate() {
            while let Some(answer) = sender.borrow_mut().answer() {
                oracle.borrow_mut().queue_check.taken(number, &answer);
            }
        }
        oracle.borrow().queue_check.ended();
        let mut lost = 0;
        for subscriber in &subscribers {
            subscriber.borrow_mut().outlive(&world);
            lost += subscriber.borrow().receiver.borrow().lost;
        }
        let (commands, too_many) = oracle.borrow().queue_check.totals();
        let tally = *world.tally.borrow();
        Tally {
            nights: 1,
            simulated_ns: u128::from(now_ns - plan.begin_ns),
            frames: counts.frames,
            skipped: counts.skipped,
            commands,
            too_many,
            samples_lost: collected.borrow().lost,
            frames_lost: tally.frames_lost + lost,
            subscribers: tally.subscribers + subscribers.len() as u64,
            stops: u64::from(counts.end == End::Signal),
            ..tally
        }
    }
}
