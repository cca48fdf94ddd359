//! The OSC messages (Open Sound Control 1.0), one function for each address. In: the messages of a publisher. Out: OSC
//! messages whose arguments always have the same types. Pure.
//!
//! `docs/sending.md` lists the addresses. Handles and benches count from 1, because users set up desks by hand. The
//! number of no bench is -1. The number of no time or no clearance is [`NEVER`], which is above every threshold of a
//! desk.

use rosc::encoder::encode;
use rosc::{OscBundle, OscMessage, OscPacket, OscTime, OscType};

use bench_dragon_messages::sentence::obstacle_in;
use bench_dragon_messages::state::EventKind;
use bench_dragon_messages::state::{FrameState, Level, PlaybackState};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, NO_BENCH, Stage};

/// The number for no time or no distance.
pub const NEVER: f32 = 1e6;
/// The most messages in a bundle: this number of the largest fits a datagram that the network does not fragment.
const MOST_MESSAGES: usize = 8;

/// The messages of one publisher.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Addresses {
    /// The beginning of each address: a slash and the publisher's name.
    prefix: String,
}

impl Addresses {
    /// Creates addresses that begin with the publisher's name. Characters that no address may have become underscores.
    pub fn new(name: &str) -> Self {
        let allowed = |c: char| c.is_ascii_graphic() && !"#*,?[]{}".contains(c);
        let prefix = name.trim_matches('/').chars().map(|c| if allowed(c) { c } else { '_' }).collect::<String>();
        Self { prefix: format!("/{prefix}") }
    }

    /// Returns the beginning of each address.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    fn message(&self, address: &str, args: Vec<OscType>) -> OscMessage {
        OscMessage { addr: format!("{}/{address}", self.prefix), args }
    }

    /// `/alert ,sisffffiii`: the level and its number, the event, simulated seconds until the event, and the clearance.
    /// Then follow the place and the benches of the event, and the latest cue. Benches count within their dragon.
    pub fn alert(&self, alert: &CollisionAlert, stage: Option<&Stage>, cue: u32) -> OscMessage {
        let bench = |number: u32| bench(stage.and_then(|stage| stage.owner(number)).map_or(number, |(_, own)| own));
        let level = alert.alert_level().map_or("unknown", Level::name);
        let event = alert.event_kind().map_or("none", EventKind::name);
        self.message(
            "alert",
            vec![
                text(level),
                OscType::Int(alert.level as i32),
                text(event),
                or_never(alert.time_to_event),
                or_never(alert.clearance),
                or_zero(alert.event_x),
                or_zero(alert.event_y),
                bench(alert.event_bench_a),
                bench(alert.event_bench_b),
                OscType::Int(cue as i32),
            ],
        )
    }

    /// `/obstacle ,s`: the name of the obstacle that an alert is about; empty if it is about boards alone.
    pub fn obstacle(&self, stage: &Stage, alert: &CollisionAlert) -> OscMessage {
        self.message("obstacle", vec![text(obstacle_in(stage, alert).unwrap_or_default())])
    }

    /// `/dragons ,ss`: for each of the two benches of an alert's event, the name of its dragon. The name is empty for
    /// no bench and for an obstacle.
    pub fn dragons(&self, stage: &Stage, alert: &CollisionAlert) -> OscMessage {
        let name = |number: u32| stage.owner(number).map_or("", |(dragon, _)| dragon.name.as_str());
        self.message("dragons", [alert.event_bench_a, alert.event_bench_b].map(|number| text(name(number))).to_vec())
    }

    /// `/countdown ,fs`: seconds of wall time until the next event, and its name.
    pub fn countdown(&self, coming: Option<(f64, &'static str)>) -> OscMessage {
        let (seconds, event) = coming.unwrap_or((f64::NAN, "none"));
        self.message("countdown", vec![or_never(seconds), text(event)])
    }

    /// `/state ,sisi`: the state and its number, the playback state and its number.
    pub fn state(&self, state: State) -> OscMessage {
        let (state, playback) = match state {
            State::Of { state, playback } => ((state.name(), state as i32), (playback.name(), playback as i32)),
            State::Stopped => (("stopped", -1), ("stopped", -1)),
        };
        let [state, playback] = [state, playback].map(|(name, number)| [text(name), OscType::Int(number)]);
        self.message("state", [state, playback].concat())
    }

    /// `/cue ,isf`: its number, its name, the simulated seconds of the frame that reached it.
    pub fn cue(&self, cue: &Cue) -> OscMessage {
        let args = vec![OscType::Int(cue.number as i32), text(cue.name.as_str()), float(cue.sim_time)];
        self.message("cue", args)
    }

    /// `/head ,fffff`: x, y, heading, and the velocity in metres per second of wall time; of one of several dragons
    /// `/gold/head`. The `dragon` is empty for a single one.
    pub fn head(&self, dragon: &str, header: &FrameHeader, head: &HandlePose) -> OscMessage {
        let [vx, vy] = [head.vx, head.vy].map(|speed| or_zero(speed * header.time_scale));
        let address = if dragon.is_empty() { "head".to_owned() } else { format!("{dragon}/head") };
        self.message(&address, vec![float(head.x), float(head.y), float(head.heading), vx, vy])
    }

    /// `/sim_time ,f`: simulated seconds.
    pub fn sim_time(&self, header: &FrameHeader) -> OscMessage {
        self.message("sim_time", vec![float(header.sim_time)])
    }
}

/// The content of `/state`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Frames come.
    Of {
        /// The state of the dragon.
        state: FrameState,
        /// The playback state.
        playback: PlaybackState,
    },
    /// Frames have stopped.
    Stopped,
}

impl State {
    /// Returns the state of a frame; `None` for a frame of a later layout.
    pub fn of(header: &FrameHeader) -> Option<Self> {
        Some(Self::Of { state: header.frame_state()?, playback: header.playback_state()? })
    }
}

/// Returns the wall time until the next event, in seconds, with its name; `None` if no event is ahead, and while time
/// stands still.
pub fn next_event(stage: &Stage, header: &FrameHeader) -> Option<(f64, &'static str)> {
    let plays = header.playback_state() == Some(PlaybackState::Playing) && header.time_scale > 0.0;
    let ahead = |time: f64| time > header.sim_time && time <= stage.freeze_time;
    let next = stage.events.iter().find(|event| plays && ahead(event.time))?;
    let name = FrameState::ALL.get(next.state as usize)?.name();
    Some(((next.time - header.sim_time) / header.time_scale, name))
}

/// The content of a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// Messages of one moment together.
    Bundles,
    /// A single message, for receivers that read no bundles.
    Messages,
}

/// Returns messages in their order as datagrams. Bundles are to be executed at once, since a desk has another clock.
pub fn datagrams(messages: Vec<OscMessage>, packing: Packing) -> Vec<Vec<u8>> {
    let immediately = OscTime { seconds: 0, fractional: 1 };
    let packets = messages.into_iter().map(OscPacket::Message);
    // Only an invalid address could be refused, and neither `Addresses` nor a map has one.
    let encoded = |packet: &OscPacket| encode(packet).ok();
    match packing {
        Packing::Messages => packets.filter_map(|packet| encoded(&packet)).collect(),
        Packing::Bundles => {
            let bundle = |content: &[OscPacket]| {
                encoded(&OscPacket::Bundle(OscBundle { timetag: immediately, content: content.to_vec() }))
            };
            Vec::from_iter(packets).chunks(MOST_MESSAGES).filter_map(bundle).collect()
        }
    }
}

fn text(text: &str) -> OscType {
    OscType::String(text.to_owned())
}

fn float(value: f64) -> OscType {
    OscType::Float(value as f32)
}

fn or_never(value: f64) -> OscType {
    if value.is_nan() { OscType::Float(NEVER) } else { float(value) }
}

fn or_zero(value: f64) -> OscType {
    if value.is_nan() { OscType::Float(0.0) } else { float(value) }
}

/// Returns the number counted from 1.
fn bench(number: u32) -> OscType {
    OscType::Int(if number == NO_BENCH { -1 } else { number as i32 + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::{List, SceneName, StageEvent};

    #[test]
    fn an_alert_about_nothing_fires_no_threshold_and_names_no_bench() {
        let message = Addresses::new("bench_dragon").alert(&CollisionAlert::default(), None, 0);
        assert_eq!(message.addr, "/bench_dragon/alert");
        let (never, none) = (OscType::Float(1e6), OscType::Int(-1));
        let expected = [text("clear"), OscType::Int(0), text("none"), never.clone(), never];
        assert_eq!(message.args[..5], expected);
        assert_eq!(message.args[7..], [none.clone(), none, OscType::Int(0)]);
    }

    #[test]
    fn a_name_becomes_an_address() {
        for (name, prefix) in
            [("bench_dragon", "/bench_dragon"), ("a/b c", "/a/b_c"), ("/x{1}*", "/x_1__"), ("龙", "/_")]
        {
            assert_eq!(Addresses::new(name).prefix(), prefix);
        }
    }

    #[test]
    fn the_countdown_is_to_what_the_show_comes_to() {
        let event = |time, state: FrameState| StageEvent { time, state: state as u32, ..StageEvent::default() };
        let states = [(10.0, FrameState::Contact), (20.0, FrameState::Stall), (30.0, FrameState::Lock)];
        let events = List::of(states.map(|(time, state)| event(time, state)));
        let stage = Stage { freeze_time: 20.0, events, ..Stage::default() };
        let at = |sim_time, time_scale, playback: PlaybackState| {
            let header = FrameHeader { sim_time, time_scale, playback: playback as u32, ..FrameHeader::default() };
            next_event(&stage, &header)
        };
        let playing = PlaybackState::Playing;
        assert_eq!(at(5.0, 2.0, playing), Some((2.5, "contact")));
        assert_eq!(at(10.0, 1.0, playing), Some((10.0, "stall")));
        assert_eq!(at(20.0, 1.0, playing), None, "it freezes before the lock");
        assert_eq!(at(5.0, 0.0, PlaybackState::Paused), None);
        assert_eq!(at(5.0, 1.0, PlaybackState::Ended), None);
    }

    #[test]
    fn bundles_fit_a_datagram_and_keep_the_order() {
        let addresses = Addresses::new(&"n".repeat(60));
        let cue = |number| Cue { number, name: SceneName::new(&"x".repeat(64)), ..Cue::default() };
        let messages = || (0..20).map(|number| addresses.cue(&cue(number))).collect();
        assert_eq!(datagrams(messages(), Packing::Messages).len(), 20);
        let datagrams = datagrams(messages(), Packing::Bundles);
        assert_eq!(datagrams.len(), 3);
        let mut numbers = Vec::new();
        for datagram in &datagrams {
            assert!(datagram.len() <= 1472, "{} bytes", datagram.len());
            let (_, packet) = rosc::decoder::decode_udp(datagram).unwrap();
            let OscPacket::Bundle(bundle) = packet else { panic!("a bundle") };
            for packet in bundle.content {
                let OscPacket::Message(message) = packet else { panic!("messages") };
                numbers.push(message.args[0].clone().int().unwrap());
            }
        }
        assert_eq!(numbers, Vec::from_iter(0..20));
    }
}
