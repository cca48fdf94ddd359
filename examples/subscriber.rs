//! A subscriber in Rust: reads the frames of a running publisher for some seconds and counts them.
//!
//! `cargo run --release -- run` in one terminal, `cargo run --release --example subscriber [NAME [SECONDS]]` in
//! another.

use std::time::{Duration, Instant};

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::messages::state::Level;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or("bench_dragon".to_owned());
    let seconds = std::env::args().nth(2).map_or(Ok(5.0), |text| text.parse())?;
    // A publisher may start later, end, and start again: the feed connects to each.
    let mut feed = Feed::new(&name, FeedOptions { wake: Wake::OnFrame, frames: Delivery::All })?;
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    let (mut first, mut last, mut received, mut lost) = (None, None, 0u64, 0u64);
    while Instant::now() < end {
        feed.poll(Duration::from_millis(200), &mut |event| match event {
            FeedEvent::Frame { header, handles, missed } => {
                let head = &handles[0];
                if received % 60 == 0 {
                    println!("t = {:8.3} s  head ({:.3}, {:.3}) m", header.sim_time, head.x, head.y);
                }
                first = first.or(Some(header.sequence));
                last = Some(header.sequence);
                received += 1;
                lost += missed;
            }
            FeedEvent::Alert(alert) => {
                let level = alert.alert_level().map_or("unknown", Level::name);
                println!("t = {:8.3} s  alert: {level}", alert.sim_time);
            }
            _ => (),
        })?;
    }
    println!("received {received} from {} to {}, missed {lost}", first.unwrap_or(0), last.unwrap_or(0));
    Ok(())
}
