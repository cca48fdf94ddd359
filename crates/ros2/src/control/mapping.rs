//! The two mappings of service calls to DDS, distinguished by the bytes of a request.
//!
//! `rmw_cyclonedds_cpp` puts 16 bytes of the client before each request and each response. `rmw_fastrtps_cpp`
//! ("enhanced" in RPC over DDS 1.0, section 7.2.4) identifies the request beside the message. A request of one mapping
//! is random numbers in the other. Requests that conduct the show have fixed lengths, so no bytes are a request in
//! both. Requests for parameters must end where their lists end. The 8 bytes of Cyclone's client are random. A request
//! of Cyclone would be taken for the other kind only if these bytes were the lengths of a fitting list. So each client
//! gets its answer in its own mapping.

/// Bytes that Cyclone puts before a message: its client (8 bytes) and the number of the call (8 bytes).
pub const CYCLONE_HEADER: usize = 16;

/// Splits a request into the bytes to put before the response and the request that `read` finds in the others. Returns
/// `None` for bytes that are a request in neither mapping.
pub fn split<Request>(bytes: &[u8], read: impl Fn(&[u8]) -> Option<Request>) -> Option<(&[u8], Request)> {
    let cyclone = || {
        let (header, body) = bytes.split_at_checked(CYCLONE_HEADER)?;
        Some((header, read(body)?))
    };
    read(bytes).map(|request| (&bytes[..0], request)).or_else(cyclone)
}

/// Returns a request of `LENGTH` bytes, with or without the padding to a multiple of four bytes.
pub fn body<const LENGTH: usize>(bytes: &[u8]) -> Option<[u8; LENGTH]> {
    let fits = bytes.len() == LENGTH || bytes.len() == LENGTH.next_multiple_of(4);
    bytes.first_chunk().copied().filter(|_| fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mappings_of;

    #[test]
    fn the_length_tells_the_mapping() {
        let bytes: Vec<u8> = (0..64).collect();
        for length in 0..=bytes.len() {
            let split = split(&bytes[..length], body::<1>);
            let expected = match length {
                1 | 4 => Some((&[][..], [0])),
                17 | 20 => Some((&bytes[..16], [16])),
                _ => None,
            };
            assert_eq!(split, expected, "{length} bytes");
        }
    }

    #[test]
    fn bytes_alike_are_a_request_in_one_mapping() {
        // Bytes of fixed requests do not matter; lists of parameters are empty, or have more entries than bytes.
        for byte in [0, 1, 255] {
            let bytes = [byte; 128];
            let mut legal = [0; 2];
            for length in 0..=bytes.len() {
                for (service, of) in mappings_of(&bytes[..length]) {
                    assert_ne!(of, [true; 2], "{service}: {length} bytes {byte}");
                    legal = [0, 1].map(|mapping| legal[mapping] + usize::from(of[mapping]));
                }
            }
            assert!(legal[0] > 16 && legal[1] == legal[0], "{legal:?} requests of bytes {byte}");
        }
    }
}
