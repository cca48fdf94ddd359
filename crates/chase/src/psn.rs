//! PosiStageNet 2.03 as a receiver (VYV and MA Lighting, "PosiStageNet protocol description v2.03", 2019). In:
//! datagrams. Out: positions of trackers. Pure. The sender is `psn` of the crate `outputs`.

/// The multicast group and the port of the protocol.
pub const USUAL_GROUP: (std::net::Ipv4Addr, u16) = (std::net::Ipv4Addr::new(236, 10, 10, 10), 56565);

const INFO_PACKET: u16 = 0x6756;
const DATA_PACKET: u16 = 0x6755;
const TRACKER_LIST: u16 = 0x0001;
const POSITION: u16 = 0x0000;
const STATUS: u16 = 0x0003;

/// A tracker in a packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracker {
    /// Its number.
    pub id: u16,
    /// The position in metres, in the sender's axes.
    pub position: [f32; 3],
    /// 0 if the position is not known any more; its other values are not defined by the protocol.
    pub status: f32,
}

/// The datagram is no packet of PosiStageNet, or damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the datagram is malformed")]
pub struct Malformed;

/// Returns the trackers of a packet of positions that have a position; none for a packet of names.
///
/// # Errors
/// [`Malformed`]
pub fn decode(datagram: &[u8]) -> Result<Vec<Tracker>, Malformed> {
    let (id, body) = match chunks(datagram).collect::<Result<Vec<_>, _>>()?[..] {
        [root] => root,
        _ => return Err(Malformed),
    };
    let mut trackers = Vec::new();
    match id {
        INFO_PACKET => return Ok(trackers),
        DATA_PACKET => (),
        _ => return Err(Malformed),
    }
    for chunk in chunks(body) {
        let (TRACKER_LIST, list) = chunk? else { continue };
        for chunk in chunks(list) {
            let (id, fields) = chunk?;
            trackers.extend(tracker(id, fields)?);
        }
    }
    Ok(trackers)
}

fn tracker(id: u16, fields: &[u8]) -> Result<Option<Tracker>, Malformed> {
    let (mut position, mut status) = (None, 1.0);
    for chunk in chunks(fields) {
        match chunk? {
            (POSITION, bytes) => position = Some([number(bytes, 0)?, number(bytes, 4)?, number(bytes, 8)?]),
            (STATUS, bytes) => status = number(bytes, 0)?,
            // Chunks of later versions are passed over.
            _ => (),
        }
    }
    Ok(position.map(|position| Tracker { id, position, status }))
}

fn number(bytes: &[u8], at: usize) -> Result<f32, Malformed> {
    let four = bytes.get(at..at + 4).and_then(|four| <[u8; 4]>::try_from(four).ok()).ok_or(Malformed)?;
    Some(f32::from_le_bytes(four)).filter(|number| number.is_finite()).ok_or(Malformed)
}

/// Returns the chunks of a chunk: each with its id and its content.
fn chunks(mut bytes: &[u8]) -> impl Iterator<Item = Result<(u16, &[u8]), Malformed>> {
    std::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        let chunk = bytes.split_first_chunk().and_then(|(&[a, b, c, d], rest)| {
            // The highest bit is set if the content is chunks.
            let length = usize::from(u16::from_le_bytes([c, d]) & 0x7fff);
            Some((u16::from_le_bytes([a, b]), rest.get(..length)?, rest.get(length..)?))
        });
        let Some((id, content, rest)) = chunk else {
            bytes = &[];
            return Some(Err(Malformed));
        };
        bytes = rest;
        Some(Ok((id, content)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(id: u16, content: &[u8], has_chunks: bool) -> Vec<u8> {
        let header = u32::from(id) | (content.len() as u32) << 16 | u32::from(has_chunks) << 31;
        [&header.to_le_bytes()[..], content].concat()
    }

    fn packet() -> Vec<u8> {
        let numbers = |numbers: &[f32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>();
        let unknown = chunk(0x77, &[1, 2, 3], false);
        let first = [chunk(0, &numbers(&[1.0, 2.0, 3.0]), false), unknown.clone(), chunk(3, &numbers(&[0.5]), false)];
        let second = chunk(1, &numbers(&[1.0, 2.0, 3.0]), false);
        let list = [chunk(7, &first.concat(), true), chunk(8, &second, true)].concat();
        let body = [chunk(0, &[0; 12], false), unknown, chunk(1, &list, true)].concat();
        chunk(0x6755, &body, true)
    }

    #[test]
    fn positions_and_states_are_found_and_unknown_chunks_passed_over() {
        let expected = Tracker { id: 7, position: [1.0, 2.0, 3.0], status: 0.5 };
        assert_eq!(decode(&packet()), Ok(vec![expected]), "a tracker without a position is left out");
        assert_eq!(decode(&chunk(0x6756, &[], true)), Ok(vec![]));
    }

    #[test]
    fn damaged_packets_are_refused() {
        let whole = packet();
        assert!((0..whole.len()).all(|length| decode(&whole[..length]) == Err(Malformed)));
        assert_eq!(decode(&[&whole[..], &[0]].concat()), Err(Malformed));
        let mut infinite = whole.clone();
        let at = whole.windows(4).position(|four| four == 2.0f32.to_le_bytes()).unwrap();
        infinite[at..at + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
        assert_eq!(decode(&infinite), Err(Malformed));
    }
}
