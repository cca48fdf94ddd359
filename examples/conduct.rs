//! Controls a running publisher: pauses the show, moves it to another time, and resumes it.
//!
//! `cargo run --release -- run` in one terminal, `cargo run --release --example conduct [NAME]` in another.

use std::time::Duration;

use bench_dragon::client::control::Controller;
use bench_dragon::messages::control::{Code, Command};
use bench_dragon::messages::state::PlaybackState;
use iceoryx2::prelude::{LogLevel, set_log_level};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    set_log_level(LogLevel::Error);
    let name = std::env::args().nth(1).unwrap_or_else(|| "bench_dragon".to_owned());
    let mut controller = Controller::new(&name)?;
    for command in [Command::Pause, Command::Seek(300.0), Command::Resume] {
        let answer = controller.send(command, Duration::from_secs(10))?;
        println!(
            "{command:?}: {}, {} at {} x, t = {:.3} s, tick {}",
            answer.result().map_or("unknown", Code::name),
            answer.playback_state().map_or("unknown", PlaybackState::name),
            answer.time_scale,
            answer.sim_time,
            answer.tick
        );
    }
    Ok(())
}
