//! A bare iceoryx2 publisher and subscriber, without this project's code, of a payload as large as the paper's frames.
//! This measures the cost of the transport itself. `python3 benches/latency.py` compares the live publisher with it.
//!
//! `bare publish NAME SECONDS` sends 1,000 samples a second; `bare subscribe NAME SECONDS` receives them for SECONDS
//! and prints the latency from sending to receiving as a line of JSON.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use iceoryx2::prelude::*;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

/// A handle: 40 bytes.
type Handle = [f64; 5];
/// A header of 80 bytes; the first number is the sending time.
type Header = [u64; 10];
/// Handles in a sample, as in the paper's frames.
const HANDLES: usize = 224;
const PERIOD_NS: u64 = 1_000_000;
/// The greatest latency distinguished: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;
/// Samples by which the subscriber may fall behind, as in the live publisher.
const QUEUE: usize = 64;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args().collect();
    let [_, role, name, seconds] = &arguments[..] else { return Err("bare publish|subscribe NAME SECONDS".into()) };
    set_log_level(LogLevel::Error);
    let end = Instant::now() + Duration::from_secs_f64(seconds.parse()?);
    let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>()?;
    match role.as_str() {
        "publish" => publish(&node, name, end),
        "subscribe" => subscribe(&node, name, end),
        _ => Err("the role is publish or subscribe".into()),
    }
}

fn publish(node: &Node<ipc::Service>, name: &str, end: Instant) -> Result<(), Failure> {
    let service = node
        .service_builder(&format!("{name}/samples").as_str().try_into()?)
        .publish_subscribe::<[Handle]>()
        .user_header::<Header>()
        .subscriber_max_buffer_size(QUEUE)
        .open_or_create()?;
    let publisher = service.publisher_builder().initial_max_slice_len(HANDLES).create()?;
    let event = node.service_builder(&format!("{name}/tick").as_str().try_into()?).event().open_or_create()?;
    let notifier = event.notifier_builder().create()?;
    let mut deadline_ns = now_ns()?;
    while Instant::now() < end {
        deadline_ns += PERIOD_NS;
        let deadline = TimeSpec::new((deadline_ns / 1_000_000_000) as i64, (deadline_ns % 1_000_000_000) as i64);
        clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &deadline)?;
        let sample = publisher.loan_slice_uninit(HANDLES)?;
        let mut sample = sample.write_from_fn(|handle| [handle as f64; 5]);
        sample.user_header_mut()[0] = now_ns()?;
        sample.send()?;
        notifier.notify()?;
    }
    Ok(())
}

fn subscribe(node: &Node<ipc::Service>, name: &str, end: Instant) -> Result<(), Failure> {
    let service = node
        .service_builder(&format!("{name}/samples").as_str().try_into()?)
        .publish_subscribe::<[Handle]>()
        .user_header::<Header>()
        .open()?;
    let subscriber = service.subscriber_builder().create()?;
    let event = node.service_builder(&format!("{name}/tick").as_str().try_into()?).event().open()?;
    let listener = event.listener_builder().create()?;
    let mut latency = Histogram::<u64>::new_with_bounds(1, LONGEST_NS, 3)?;
    while Instant::now() < end {
        listener.timed_wait(|_| (), Duration::from_millis(200))?;
        while let Some(sample) = subscriber.receive()? {
            latency.saturating_record(now_ns()?.saturating_sub(sample.user_header()[0]));
        }
    }
    let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|quantile| latency.value_at_quantile(quantile));
    println!(
        "{{\"received\":{},\"p50\":{p50},\"p99\":{p99},\"p999\":{p999},\"max\":{}}}",
        latency.len(),
        latency.max()
    );
    Ok(())
}

fn now_ns() -> Result<u64, Failure> {
    let now = clock_gettime(ClockId::CLOCK_MONOTONIC)?;
    Ok(now.tv_sec() as u64 * 1_000_000_000 + now.tv_nsec() as u64)
}
