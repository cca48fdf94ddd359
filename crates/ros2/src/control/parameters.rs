//! The parameter services of the node, which has no parameters: every node of ROS 2 has these services, and `ros2 param
//! list` waits for all six.
//!
//! In: the bytes of a request. Out: a [`ParameterCall`], and its [`ParameterResponse`].

use rustdds::RepresentationIdentifier;
use rustdds::serialization::deserialize_from_cdr_with_rep_id;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A call of a parameter service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterCall {
    /// ListParameters.
    List,
    /// GetParameters, GetParameterTypes or DescribeParameters.
    Get,
    /// SetParameters: the number of parameters.
    Set(usize),
    /// SetParametersAtomically.
    SetAtomically,
}

/// The response of a node without parameters.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum ParameterResponse {
    /// ListParameters: empty lists.
    List {
        /// The names of the parameters.
        names: Vec<String>,
        /// The prefixes of the names.
        prefixes: Vec<String>,
    },
    /// GetParameters, GetParameterTypes and DescribeParameters: an empty list, which has no type on the wire.
    Values(Vec<u8>),
    /// SetParameters: a refusal for each parameter.
    Results(Vec<SetResult>),
    /// SetParametersAtomically: a refusal.
    Result(SetResult),
}

/// rcl_interfaces/SetParametersResult.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SetResult {
    /// Always false.
    pub successful: bool,
    /// The reason for the refusal.
    pub reason: String,
}

impl ParameterCall {
    /// Returns the response.
    pub fn response(self) -> ParameterResponse {
        let reason = "this node has no parameters: its settings are those of its command line and its scene";
        let refused = SetResult { successful: false, reason: reason.to_owned() };
        match self {
            Self::List => ParameterResponse::List { names: Vec::new(), prefixes: Vec::new() },
            Self::Get => ParameterResponse::Values(Vec::new()),
            Self::Set(count) => ParameterResponse::Results(vec![refused; count]),
            Self::SetAtomically => ParameterResponse::Result(refused),
        }
    }
}

/// Returns the message of these bytes, if it ends where they end, with or without padding.
pub fn whole<Message: DeserializeOwned>(bytes: &[u8]) -> Option<Message> {
    let (message, used) = deserialize_from_cdr_with_rep_id(bytes, RepresentationIdentifier::CDR_LE).ok()?;
    (bytes.len().checked_sub(used)? < 4).then_some(message)
}
