//! The two incompatible mappings of service calls to DDS.
//!
//! `rmw_cyclonedds_cpp` puts 16 bytes of the client before each request and each response. `rmw_fastrtps_cpp`
//! ("enhanced" in RPC over DDS 1.0, section 7.2.4) identifies the request beside the message. A request of one mapping
//! is random numbers in the other. All requests here have fixed lengths, so the length determines the mapping, and a
//! request of the other mapping is never read. Called by the control thread.

/// Bytes that Cyclone puts before a message: its client (8 bytes) and the number of the call (8 bytes).
const CYCLONE_HEADER: usize = 16;

/// A mapping of services to DDS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mapping {
    /// The mapping of `rmw_fastrtps_cpp`, the default of ROS 2.
    Enhanced,
    /// The mapping of `rmw_cyclonedds_cpp`.
    Cyclone,
}

impl Mapping {
    /// Returns the mapping that `RMW_IMPLEMENTATION` selects, and a warning if the mapping is assumed. `variable`
    /// returns the value of a variable that is set.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> (Self, Option<String>) {
        let value = variable("RMW_IMPLEMENTATION").unwrap_or_default();
        match value.trim() {
            "" | "rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" => (Self::Enhanced, None),
            "rmw_cyclonedds_cpp" => (Self::Cyclone, None),
            other => {
                let sentence = format!(
                    "RMW_IMPLEMENTATION is \"{other}\", expected rmw_fastrtps_cpp or rmw_cyclonedds_cpp: control services \
                     are offered as rmw_fastrtps_cpp calls them"
                );
                (Self::Enhanced, Some(sentence))
            }
        }
    }

    /// Returns the RMW implementation of this mapping.
    pub fn rmw(self) -> &'static str {
        match self {
            Self::Enhanced => "rmw_fastrtps_cpp",
            Self::Cyclone => "rmw_cyclonedds_cpp",
        }
    }

    /// Splits a request into header and body. `lengths` are the legal lengths of the body.
    pub fn split<'a>(self, bytes: &'a [u8], lengths: &[usize]) -> Result<Request<'a>, Misfit> {
        let fits = |header: usize| {
            // The message may include its padding to a multiple of four bytes.
            lengths.iter().copied().find(|length| {
                let whole = header + length;
                bytes.len() == whole || bytes.len() == whole.next_multiple_of(4)
            })
        };
        let [enhanced, cyclone] = [fits(0), fits(CYCLONE_HEADER)];
        match (self, enhanced, cyclone) {
            (Self::Enhanced, Some(length), _) => Ok(Request { header: &[], body: &bytes[..length] }),
            (Self::Cyclone, _, Some(length)) => {
                let (header, body) = bytes.split_at(CYCLONE_HEADER);
                Ok(Request { header, body: &body[..length] })
            }
            (Self::Enhanced, None, Some(_)) => Err(Misfit::OtherMapping(Self::Cyclone)),
            (Self::Cyclone, Some(_), None) => Err(Misfit::OtherMapping(Self::Enhanced)),
            (_, None, None) => Err(Misfit::Length(bytes.len())),
        }
    }
}

/// A request, split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request<'a> {
    /// The bytes before the response.
    pub header: &'a [u8],
    /// The body of the request.
    pub body: &'a [u8],
}

/// The reason why a request is ignored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// Its client uses the other mapping.
    OtherMapping(Mapping),
    /// No request of this service has this number of bytes.
    Length(usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mapping_is_that_of_the_environment() {
        let of = |value: Option<&str>| Mapping::of(|_| value.map(str::to_owned));
        for fast in [None, Some(""), Some("rmw_fastrtps_cpp"), Some("rmw_fastrtps_dynamic_cpp")] {
            assert_eq!(of(fast), (Mapping::Enhanced, None));
        }
        assert_eq!(of(Some("rmw_cyclonedds_cpp")), (Mapping::Cyclone, None));
        let (mapping, warning) = of(Some("rmw_zenoh_cpp"));
        assert_eq!(mapping, Mapping::Enhanced);
        assert!(warning.is_some_and(|text| text.contains("rmw_zenoh_cpp") && text.contains("rmw_cyclonedds_cpp")));
    }

    #[test]
    fn the_length_tells_the_mapping() {
        let bytes: Vec<u8> = (0..32).collect();
        for (lengths, enhanced, cyclone) in
            [(&[1][..], &[1, 4][..], &[17, 20][..]), (&[8], &[8], &[24]), (&[1, 8], &[1, 4, 8], &[17, 20, 24])]
        {
            for length in 0..32 {
                let split = |mapping: Mapping| mapping.split(&bytes[..length], lengths);
                let (of_enhanced, of_cyclone) = (split(Mapping::Enhanced), split(Mapping::Cyclone));
                if enhanced.contains(&length) {
                    assert_eq!(of_enhanced.unwrap().header, &[] as &[u8]);
                    assert_eq!(of_enhanced.unwrap().body[0], 0);
                    assert!(lengths.contains(&of_enhanced.unwrap().body.len()));
                    assert_eq!(of_cyclone, Err(Misfit::OtherMapping(Mapping::Enhanced)));
                } else if cyclone.contains(&length) {
                    assert_eq!(of_enhanced, Err(Misfit::OtherMapping(Mapping::Cyclone)));
                    assert_eq!(of_cyclone.unwrap().header, &bytes[..16]);
                    assert_eq!(of_cyclone.unwrap().body[0], 16);
                    assert!(lengths.contains(&of_cyclone.unwrap().body.len()));
                } else {
                    assert_eq!((of_enhanced, of_cyclone), (Err(Misfit::Length(length)), Err(Misfit::Length(length))));
                }
            }
        }
    }
}
