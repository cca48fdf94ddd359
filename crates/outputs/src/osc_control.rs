//! OSC that conducts a show. In: datagrams. Out: commands, or one sentence about a message that is none. Pure.

use rosc::{OscMessage, OscPacket, OscType, decoder};

use bench_dragon_messages::control::Command;

/// The addresses, with their arguments, as people read them.
pub const ADDRESSES: &str = "/go, /hold, /release, /pause, /resume, /seek ,f and /rate ,f";
/// The most bytes of a datagram. A bundle within a bundle takes 20 of them, so this also limits their depth.
pub const MOST_BYTES: usize = 2048;

/// A message, with the command that it means.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    /// The address, without control characters.
    pub address: String,
    /// The command; `None` for the release of a button, which does nothing.
    pub command: Result<Option<Command>, NoCommand>,
}

/// The reason why a message is no command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoCommand {
    /// Another address.
    #[error("no command has this address, expected {ADDRESSES}")]
    Address,
    /// A number is missing, or something else stands there.
    #[error("expected one number")]
    Number,
}

/// The datagram is no OSC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the datagram is no OSC")]
pub struct Malformed;

/// Returns the messages of a datagram in their order. Bundles are executed at once, since a sender has another clock.
///
/// # Errors
/// [`Malformed`]
pub fn received(datagram: &[u8]) -> Result<Vec<Received>, Malformed> {
    let (_, packet) = decoder::decode_udp(datagram).map_err(|_| Malformed)?;
    let mut messages = Vec::new();
    flatten(packet, &mut messages);
    Ok(messages.iter().map(of).collect())
}

fn flatten(packet: OscPacket, messages: &mut Vec<OscMessage>) {
    match packet {
        OscPacket::Message(message) => messages.push(message),
        OscPacket::Bundle(bundle) => bundle.content.into_iter().for_each(|packet| flatten(packet, messages)),
    }
}

fn of(message: &OscMessage) -> Received {
    let of_button = |command| Ok((!is_released(&message.args)).then_some(command));
    let of_number = |command: fn(f64) -> Command| match &message.args[..] {
        [argument] => number(argument).map(|number| Some(command(number))).ok_or(NoCommand::Number),
        _ => Err(NoCommand::Number),
    };
    let command = match message.addr.as_str() {
        "/go" => of_button(Command::Go),
        "/hold" => of_button(Command::Hold),
        "/release" => of_button(Command::Release),
        "/pause" => of_button(Command::Pause),
        "/resume" => of_button(Command::Resume),
        "/seek" => of_number(Command::Seek),
        "/rate" => of_number(Command::Rate),
        _ => Err(NoCommand::Address),
    };
    Received { address: message.addr.escape_default().to_string(), command }
}

/// Returns true for the argument that a button sends when it is released: 0 or false.
fn is_released(arguments: &[OscType]) -> bool {
    match arguments.first() {
        Some(OscType::Bool(is_pressed)) => !is_pressed,
        Some(argument) => number(argument) == Some(0.0),
        None => false,
    }
}

fn number(argument: &OscType) -> Option<f64> {
    match *argument {
        OscType::Float(value) => Some(value.into()),
        OscType::Double(value) => Some(value),
        OscType::Int(value) => Some(value.into()),
        OscType::Long(value) => Some(value as f64),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Messages as OSC 1.0 writes them: texts padded with zeros to four bytes, numbers with the high byte first.
    fn bytes(address: &str, types: &str, arguments: &[u8]) -> Vec<u8> {
        let padded = |text: &str| {
            let mut bytes = [text.as_bytes(), &[0]].concat();
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            bytes
        };
        [padded(address), padded(types), arguments.to_vec()].concat()
    }

    fn only(datagram: &[u8]) -> Result<Option<Command>, NoCommand> {
        let mut all = received(datagram).unwrap();
        assert_eq!(all.len(), 1);
        all.remove(0).command
    }

    #[test]
    fn every_address_is_a_command() {
        for (address, command) in [
            ("/go", Command::Go),
            ("/hold", Command::Hold),
            ("/release", Command::Release),
            ("/pause", Command::Pause),
            ("/resume", Command::Resume),
        ] {
            assert_eq!(only(&bytes(address, ",", &[])), Ok(Some(command)));
            assert_eq!(only(&bytes(address, ",f", &1.0f32.to_be_bytes())), Ok(Some(command)), "a button");
            assert_eq!(only(&bytes(address, ",f", &0.0f32.to_be_bytes())), Ok(None), "its release");
            assert_eq!(only(&bytes(address, ",i", &0i32.to_be_bytes())), Ok(None));
            assert_eq!(only(&bytes(address, ",F", &[])), Ok(None));
            assert_eq!(only(&bytes(address, ",T", &[])), Ok(Some(command)));
        }
        assert_eq!(only(&bytes("/seek", ",f", &400.5f32.to_be_bytes())), Ok(Some(Command::Seek(400.5))));
        assert_eq!(only(&bytes("/seek", ",i", &400i32.to_be_bytes())), Ok(Some(Command::Seek(400.0))));
        assert_eq!(only(&bytes("/seek", ",f", &0f32.to_be_bytes())), Ok(Some(Command::Seek(0.0))));
        assert_eq!(only(&bytes("/rate", ",d", &0.25f64.to_be_bytes())), Ok(Some(Command::Rate(0.25))));
    }

    #[test]
    fn other_messages_are_named_and_bundles_are_opened() {
        assert_eq!(only(&bytes("/start", ",", &[])), Err(NoCommand::Address));
        assert_eq!(only(&bytes("/seek", ",", &[])), Err(NoCommand::Number));
        assert_eq!(only(&bytes("/seek", ",s", b"400\0")), Err(NoCommand::Number));
        let (go, seek) = (bytes("/go", ",", &[]), bytes("/seek", ",f", &7f32.to_be_bytes()));
        let mut bundle = b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec();
        for part in [&go, &seek] {
            bundle.extend((part.len() as u32).to_be_bytes());
            bundle.extend(part);
        }
        let commands = Vec::from_iter(received(&bundle).unwrap().into_iter().map(|it| it.command.unwrap().unwrap()));
        assert_eq!(commands, [Command::Go, Command::Seek(7.0)]);
        for length in 1..go.len() {
            let _ = received(&go[..length]);
        }
        assert_eq!(received(b"GET / HTTP/1.1\r\n"), Err(Malformed));
        assert_eq!(received(&[]), Err(Malformed));
    }

    #[test]
    fn the_deepest_bundle_of_a_datagram_is_opened() {
        let mut packet = bytes("/go", ",", &[]);
        while packet.len() + 20 <= MOST_BYTES {
            let mut bundle = b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec();
            bundle.extend((packet.len() as u32).to_be_bytes());
            packet = [bundle, packet].concat();
        }
        assert_eq!(only(&packet), Ok(Some(Command::Go)));
    }
}
