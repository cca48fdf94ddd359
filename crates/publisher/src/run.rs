//! Start and stop of a publisher: the threads of the loop and of its statistics, and the transports' ends on both.
//!
//! In: a [`FrameSource`], the open transports, their command queues, a clock. Out: a [`Published`]. Except for warnings
//! through the crate `log`, nothing is printed here: the caller prints in its [`Hooks`].

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use bench_dragon_client::clock::Clock;

use crate::live::control::{CommandQueues, command_queue};
use crate::live::realtime::{CpuError, Scheduling};
use crate::live::statistics::{self, Inbox, Sample, Summary};
use crate::live::{
    Announcement, FrameSource, LoopCounts, LoopOptions, PublishError, Publisher, StatusPublisher, TransportCounters,
    run_loop,
};
use crate::transports::{Transport, TransportConfig, TransportError, iceoryx2};

/// The time between two calls of [`Publisher::maintain`] before the first frame, in nanoseconds.
const LEAD_INTERVAL_NS: u64 = 10_000_000;

/// The longest wait for [`Publishing::awaited`].
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// The reason why a publisher could not run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A transport could not be opened.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The loop cannot run on the requested CPU.
    #[error(transparent)]
    Cpu(#[from] CpuError),
    /// A thread panicked. The panic has been printed.
    #[error("the {0} thread ended early")]
    Thread(&'static str),
}

/// Opens the transport that every show has, with its service of commands. Returns it with the loop's end of the command
/// queue.
///
/// # Errors
/// [`TransportError`]
pub fn open_transports(config: &TransportConfig) -> Result<(Vec<Box<dyn Transport>>, CommandQueues), TransportError> {
    let (port, commands) = command_queue();
    Ok((vec![iceoryx2::open(config, commands)?], CommandQueues::new(vec![port])))
}

/// The settings of a publisher's run.
pub struct Publishing<'a> {
    /// The scheduling that is requested from the operating system.
    pub scheduling: Scheduling,
    /// The run's number.
    pub run_id: u64,
    /// The rate, in frames per second.
    pub rate: f64,
    /// The wall time after which the loop ends, in seconds.
    pub duration: Option<f64>,
    /// The scene's name in the status.
    pub scene: &'a str,
    /// The time that waiting subscribers have to connect before the first frame, in nanoseconds.
    pub lead_ns: u64,
    /// A flag that is set when the process of ROS 2 is connected. The first frame waits for the flag, 5 s at most.
    pub awaited: Option<&'a AtomicBool>,
}

/// The transports of a run.
pub type OpenTransports = [Box<dyn Transport>];

/// The actions of the caller.
pub struct Hooks<'a> {
    /// Called after the wait for subscribers, when the loop's ends of all transports are open.
    pub opened: Box<dyn FnOnce(&OpenTransports) + 'a>,
    /// Called with each alert and cue, on the statistics thread.
    pub announce: Box<dyn FnMut(&Announcement) + Send + 'a>,
    /// Called with each sample, on the statistics thread.
    pub sample: Box<dyn FnMut(&Sample) + Send + 'a>,
    /// Called on the statistics thread 10 to 50 times a second, depending on the rate, as long as the loop does not
    /// hang.
    pub alive: Box<dyn FnMut() + Send + 'a>,
    /// Called once the loop has ended, before the transports shut down.
    pub ended: Box<dyn FnOnce(LoopCounts) + 'a>,
}

/// The result of a run.
pub struct Published {
    /// The counts of the loop.
    pub counts: LoopCounts,
    /// Lateness and step cost.
    pub summary: Summary,
    /// The counters of each transport with a queue, by the transport's name.
    pub transport_counters: BTreeMap<String, TransportCounters>,
    /// The transport's failure that ended the loop.
    pub error: Option<PublishError>,
}

/// The hooks of the statistics thread, those of [`Hooks`].
struct StatisticsHooks<'a> {
    announce: Box<dyn FnMut(&Announcement) + Send + 'a>,
    sample: Box<dyn FnMut(&Sample) + Send + 'a>,
    alive: Box<dyn FnMut() + Send + 'a>,
}

/// The loop's publishers, the transports for the other threads, and the open handle of /dev/cpu_dma_latency.
type LoopEnds = (Vec<Box<dyn Publisher>>, Vec<Box<dyn Transport>>, Option<File>);

impl Publishing<'_> {
    /// Runs the loop on one thread and the statistics on another, until `stop` is set or the loop ends by itself.
    ///
    /// # Errors
    /// [`RunError`]
    pub fn run<C: Clock + Sync>(
        &self,
        clock: &C,
        source: &mut (dyn FrameSource + Send),
        transports: Vec<Box<dyn Transport>>,
        mut queues: CommandQueues,
        stop: &AtomicBool,
        hooks: Hooks,
    ) -> Result<Published, RunError> {
        let Hooks { opened: when_open, announce, sample, alive, ended: when_ended } = hooks;
        let hooks = StatisticsHooks { announce, sample, alive };
        let (reports, inbox) = statistics::queues();
        let done = AtomicBool::new(false);
        let (opened, opening) = mpsc::channel();
        let ended = std::thread::scope(|threads| {
            let looping = threads.spawn(|| {
                let (mut publishers, _awake) = match self.prepare_loop(transports) {
                    Ok((mut publishers, transports, awake)) => {
                        let was_enough = self.wait_for_subscribers(clock, &mut publishers, stop);
                        let _ = opened.send(Ok((transports, was_enough)));
                        (publishers, awake)
                    }
                    Err(error) => {
                        let _ = opened.send(Err(error));
                        return None;
                    }
                };
                Some(run_loop(clock, source, &mut queues, &mut publishers, self.loop_options(), reports, stop))
            });
            // The thread sends exactly once, or nothing if it panicked.
            let transports = opening.recv().unwrap_or(Err(RunError::Thread("loop's")));
            let collected = transports.and_then(|(transports, was_enough)| {
                if !was_enough {
                    let waited = LONGEST_WAIT.as_secs();
                    log::warn!("the process of ROS 2 has not connected in {waited} s: the show starts without it");
                }
                when_open(&transports);
                let collecting = threads.spawn(|| {
                    // A loop without statistics could not be watched.
                    self.collect(clock, inbox, transports, hooks, &done)
                        .inspect_err(|_| stop.store(true, Ordering::Relaxed))
                });
                let outcome = looping.join();
                done.store(true, Ordering::Release);
                let collected = collecting.join().map_err(|_| RunError::Thread("statistics"))??;
                Ok((outcome.map_err(|_| RunError::Thread("loop's"))?, collected))
            });
            match collected? {
                (Some(Ok(counts)), collected) => Ok((counts, collected, None)),
                (Some(Err((counts, error))), collected) => Ok((counts, collected, Some(error))),
                (None, _) => Err(RunError::Thread("loop's")),
            }
        });
        let (counts, (summary, transports), error) = ended?;
        when_ended(counts);
        let transport_counters = transports.into_iter().filter_map(|transport| transport.finish());
        let transport_counters = transport_counters.map(|(name, of)| (name.to_owned(), of)).collect();
        Ok(Published { counts, summary, transport_counters, error })
    }

    /// Requests the scheduling of the calling thread, the loop's, and opens its ends of the transports.
    fn prepare_loop(&self, mut transports: Vec<Box<dyn Transport>>) -> Result<LoopEnds, RunError> {
        let awake = self.scheduling.prepare_thread()?;
        let publishers = transports.iter_mut().map(|transport| transport.publisher()).collect::<Result<_, _>>()?;
        Ok((publishers, transports, awake))
    }

    /// Waits for [`lead_ns`](Self::lead_ns) and for [`awaited`](Self::awaited), or until `stop` is set. Returns false
    /// if `awaited` did not come.
    fn wait_for_subscribers(
        &self,
        clock: &impl Clock,
        publishers: &mut [Box<dyn Publisher>],
        stop: &AtomicBool,
    ) -> bool {
        let began_ns = clock.monotonic_ns();
        let is_awaited = || self.awaited.is_some_and(|connected| !connected.load(Ordering::Relaxed));
        let is_early = || {
            let waited = Duration::from_nanos(clock.monotonic_ns() - began_ns);
            waited < Duration::from_nanos(self.lead_ns) || is_awaited() && waited < LONGEST_WAIT
        };
        while is_early() && !stop.load(Ordering::Relaxed) {
            publishers.iter_mut().for_each(|publisher| publisher.maintain());
            clock.sleep_until(clock.monotonic_ns() + LEAD_INTERVAL_NS);
        }
        !is_awaited() || stop.load(Ordering::Relaxed)
    }

    fn loop_options(&self) -> LoopOptions {
        let Self { run_id, rate, duration, .. } = *self;
        LoopOptions { run_id, rate, periods: duration.map(|seconds| LoopOptions::periods_of(seconds, rate)) }
    }

    fn collect(
        &self,
        clock: &impl Clock,
        inbox: Inbox,
        mut transports: Vec<Box<dyn Transport>>,
        hooks: StatisticsHooks<'_>,
        done: &AtomicBool,
    ) -> Result<(Summary, Vec<Box<dyn Transport>>), RunError> {
        let sinks: Vec<Box<dyn StatusPublisher>> =
            transports.iter_mut().filter_map(|transport| transport.status().transpose()).collect::<Result<_, _>>()?;
        let Self { run_id, rate, scene, .. } = *self;
        let StatisticsHooks { announce, sample: record, alive } = hooks;
        let run = statistics::Run { run_id, rate, scene, sinks, announce, record, alive };
        Ok((statistics::collect(clock, inbox, run, done), transports))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use bench_dragon_client::clock::SystemClock;
    use bench_dragon_messages::LoopStatus;
    use bench_dragon_messages::control::Command;
    use bench_dragon_show::convert::Stamps;
    use bench_dragon_show::{Frame, Outcome};
    use bench_dragon_testing::simulated::SimulatedClock;

    use super::*;
    use crate::live::show_source::FrameMessages;
    use crate::live::{End, Outgoing, Period};

    /// The steps of a run, in order.
    type Log = Arc<Mutex<Vec<&'static str>>>;

    struct OneFrame(Frame, FrameMessages);

    impl FrameSource for OneFrame {
        fn frame(&mut self, _: u64, stamps: Stamps) -> Period<'_> {
            Period::Frame(self.1.of(&self.0, stamps))
        }

        fn command(&mut self, _: u64, _: Command) -> Option<Outcome> {
            None
        }

        fn finished_step(&mut self, _: u64) -> Option<Outcome> {
            None
        }
    }

    struct Ends(Log);

    impl Publisher for Ends {
        fn publish(&mut self, _: Outgoing<'_>) -> Result<(), PublishError> {
            self.0.lock().unwrap().push("frame");
            Ok(())
        }

        fn maintain(&mut self) {}

        fn subscribers(&self) -> u32 {
            0
        }
    }

    impl StatusPublisher for Ends {
        fn publish_status(&mut self, _: &LoopStatus) {}
    }

    struct FakeTransport {
        log: Log,
        has_status: bool,
    }

    impl Transport for FakeTransport {
        fn describe(&self) -> String {
            String::new()
        }

        fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError> {
            Ok(Box::new(Ends(self.log.clone())))
        }

        fn status(&mut self) -> Result<Option<Box<dyn StatusPublisher>>, TransportError> {
            if !self.has_status {
                return Err(TransportError::Failed("no status".to_owned()));
            }
            Ok(Some(Box::new(Ends(self.log.clone()))))
        }

        fn finish(self: Box<Self>) -> Option<(&'static str, TransportCounters)> {
            self.log.lock().unwrap().push("finish");
            Some(("fake", TransportCounters { frames: 3, skipped: 0, discarded: 0 }))
        }
    }

    /// At 1000 Hz, without an end, and without a wait for subscribers.
    fn publishing() -> Publishing<'static> {
        Publishing {
            scheduling: Scheduling::default(),
            run_id: 1,
            rate: 1000.0,
            duration: None,
            scene: "test",
            lead_ns: 0,
            awaited: None,
        }
    }

    /// Publishes for three periods or until a failure.
    fn run(has_status: bool, periods: Option<f64>) -> (Result<Published, RunError>, Vec<&'static str>) {
        let log = Log::default();
        let publishing = Publishing { duration: periods.map(|periods| periods / 1000.0), ..publishing() };
        let hooks = Hooks {
            opened: Box::new(|_| log.lock().unwrap().push("opened")),
            announce: Box::new(|_| ()),
            sample: Box::new(|_| ()),
            alive: Box::new(|| ()),
            ended: Box::new(|_| log.lock().unwrap().push("ended")),
        };
        let mut source = OneFrame(Frame::new(1), FrameMessages::default());
        let transport = FakeTransport { log: log.clone(), has_status };
        let stop = AtomicBool::new(false);
        let published = publishing.run(
            &SystemClock,
            &mut source,
            vec![Box::new(transport)],
            CommandQueues::default(),
            &stop,
            hooks,
        );
        (published, Arc::into_inner(log).unwrap().into_inner().unwrap())
    }

    /// Returns the milliseconds until the first frame, and whether that frame had no need to wait longer.
    fn wait(lead_ms: u64, connected: bool, stop_at_ms: u64) -> (u64, bool) {
        let connected = AtomicBool::new(connected);
        let publishing = Publishing { lead_ns: lead_ms * 1_000_000, awaited: Some(&connected), ..publishing() };
        let clock = SimulatedClock::new(0, []).stopping_at(stop_at_ms * 1_000_000);
        let was_enough = publishing.wait_for_subscribers(&clock, &mut [], &clock.stop);
        (clock.monotonic_ns() / 1_000_000, was_enough)
    }

    #[test]
    fn the_first_frame_waits_for_the_lead_and_five_seconds_at_most_for_ros_2() {
        assert_eq!(wait(100, true, 60_000), (100, true));
        assert_eq!(wait(100, false, 60_000), (5_000, false));
        // A show that is stopped while it waits has missed nothing.
        assert_eq!(wait(100, false, 300), (300, true));
    }

    #[test]
    fn transports_shut_down_after_the_loop_has_ended() {
        let (published, log) = run(true, Some(3.0));
        let published = published.unwrap();
        assert_eq!((published.counts.end, published.counts.frames + published.counts.skipped), (End::Duration, 3));
        assert_eq!(published.transport_counters["fake"].frames, 3);
        assert!(log.contains(&"opened") && log.ends_with(&["ended", "finish"]), "{log:?}");
    }

    #[test]
    fn a_transport_without_status_stops_the_loop_and_is_the_error() {
        let (published, log) = run(false, None);
        assert!(
            matches!(published, Err(RunError::Transport(TransportError::Failed(sentence))) if sentence == "no status")
        );
        assert!(!log.contains(&"ended"), "{log:?}");
    }
}
