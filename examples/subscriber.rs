//! A subscriber in Rust: reads the frames of a running publisher for some seconds and counts them.
//!
//! `cargo run --release -- run` in one terminal, `cargo run --release --example subscriber [NAME [SECONDS]]` in
//! another.

use std::time::{Duration, Instant};

use bench_dragon::messages::{FrameHeader, HandlePose};
use iceoryx2::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or("bench_dragon".to_owned());
    let seconds = std::env::args().nth(2).map_or(Ok(5.0), |text| text.parse())?;
    let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>()?;
    let poses = node
        .service_builder(&format!("{name}/poses").as_str().try_into()?)
        .publish_subscribe::<[HandlePose]>()
        .user_header::<FrameHeader>()
        .open()?;
    let tick = node.service_builder(&format!("{name}/tick").as_str().try_into()?).event().open()?;
    let (subscriber, listener) = (poses.subscriber_builder().create()?, tick.listener_builder().create()?);
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    let (mut first, mut last, mut received, mut ordered) = (None, None, 0u64, true);
    while Instant::now() < end {
        listener.timed_wait(|_| (), Duration::from_millis(200))?;
        while let Some(frame) = subscriber.receive()? {
            let (header, handles) = (frame.user_header(), frame.payload());
            ordered &= last.is_none_or(|last| header.sequence > last) && handles.len() == header.handles as usize;
            first = first.or(Some(header.sequence));
            last = Some(header.sequence);
            received += 1;
        }
    }
    println!("received {received} from {} to {} in order {ordered}", first.unwrap_or(0), last.unwrap_or(0));
    Ok(())
}
