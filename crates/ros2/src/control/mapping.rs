//! How a service call travels over DDS: two mappings that do not understand each other.
//!
//! In `rmw_cyclonedds_cpp` 16 bytes of the client's stand before each request and each response; in `rmw_fastrtps_cpp`
//! ("enhanced" in RPC over DDS 1.0, section 7.2.4) what belongs together is named beside the message. A request of one
//! mapping read in the other is random numbers. All requests here have fixed lengths, so the length tells the mapping, and
//! one of the other mapping is never read. Called by the control thread.

/// Bytes that Cyclone puts before a message: its client (8 bytes) and the number of the call (8 bytes).
const CYCLONE_HEADER: usize = 16;

/// A mapping of services to DDS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mapping {
    /// That of `rmw_fastrtps_cpp`, the default of ROS 2.
    Enhanced,
    /// That of `rmw_cyclonedds_cpp`.
    Cyclone,
}

impl Mapping {
    /// The mapping that `RMW_IMPLEMENTATION` selects, and a warning where that had to be assumed; `variable` gives the
    /// value of a variable that is set.
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

    /// The RMW implementation whose clients call so.
    pub fn rmw(self) -> &'static str {
        match self {
            Self::Enhanced => "rmw_fastrtps_cpp",
            Self::Cyclone => "rmw_cyclonedds_cpp",
        }
    }

    /// Takes a request apart. `lengths` are those that a request of this service may have, without any header.
    pub fn split<'a>(self, bytes: &'a [u8], lengths: &[usize]) -> Result<Request<'a>, Misfit> {
        let fits = |header: usize| {
            // What follows a message up to a multiple of four bytes may have been taken for a part of it.
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

/// A request, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request<'a> {
    /// What has to stand before the response.
    pub header: &'a [u8],
    /// The request itself.
    pub body: &'a [u8],
}

/// Why a request is not obeyed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// Its client speaks the other mapping.
    OtherMapping(Mapping),
    /// No request of this service has so many bytes.
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
