//! The services, with their requests and responses as their packages define them.
//!
//! Packages: `simulation_interfaces` (the parts used here are alike from 1.0.0 to 2.1.0), `rosbag2_interfaces` and
//! `std_srvs/Trigger`. The services of `rosbag2_interfaces` (Humble to Kilted, and the later `Resume`) have the names
//! that rosbag2's player gives them. In: the bytes of a request. Out: a [`Call`]; back from a [`Response`].

use ros2_client::rcl_interfaces::{GetParametersRequest, ListParametersRequest, SetParametersRequest};
use serde::Serialize;

use super::mapping::body;
use super::parameters::{ParameterCall, ParameterResponse, whole};

/// A service: its name below the publisher's, its type, and the form of a request.
pub struct Service {
    /// The last part of the name.
    pub name: &'static str,
    /// The package of its type.
    pub package: &'static str,
    /// The type in that package.
    pub kind: &'static str,
    /// Reads a request; returns `None` for bytes that are none.
    pub read: fn(&[u8]) -> Option<Call>,
}

/// All services that conduct the show.
pub const SERVICES: [Service; 16] = {
    type Read = fn(&[u8]) -> Option<Call>;
    const fn simulation(name: &'static str, kind: &'static str, read: Read) -> Service {
        Service { name, package: "simulation_interfaces", kind, read }
    }
    const fn player(name: &'static str, kind: &'static str, read: Read) -> Service {
        Service { name, package: "rosbag2_interfaces", kind, read }
    }
    const fn trigger(name: &'static str, read: Read) -> Service {
        Service { name, package: "std_srvs", kind: "Trigger", read }
    }
    [
        simulation("get_simulator_features", "GetSimulatorFeatures", |bytes| empty(bytes, Call::GetFeatures)),
        simulation("get_simulation_state", "GetSimulationState", |bytes| empty(bytes, Call::GetState)),
        simulation("set_simulation_state", "SetSimulationState", |bytes| {
            body(bytes).map(|[state]| Call::SetState(state))
        }),
        simulation("step_simulation", "StepSimulation", |bytes| {
            body(bytes).map(|steps| Call::Step(u64::from_le_bytes(steps)))
        }),
        simulation("reset_simulation", "ResetSimulation", |bytes| body(bytes).map(|[scope]| Call::Reset(scope))),
        player("pause", "Pause", |bytes| empty(bytes, Call::Pause)),
        // Since Lyrical a request has a time, which the player ignores.
        player("resume", "Resume", |bytes| {
            empty(bytes, Call::Resume).or_else(|| body::<8>(bytes).map(|_| Call::Resume))
        }),
        player("toggle_paused", "TogglePaused", |bytes| empty(bytes, Call::TogglePaused)),
        player("is_paused", "IsPaused", |bytes| empty(bytes, Call::IsPaused)),
        player("get_rate", "GetRate", |bytes| empty(bytes, Call::GetRate)),
        player("set_rate", "SetRate", |bytes| body(bytes).map(|rate| Call::SetRate(f64::from_le_bytes(rate)))),
        player("seek", "Seek", |bytes| body(bytes).map(|time| Call::Seek(seconds(time)))),
        player("play_next", "PlayNext", |bytes| empty(bytes, Call::PlayNext)),
        trigger("hold", |bytes| empty(bytes, Call::Hold)),
        trigger("release", |bytes| empty(bytes, Call::Release)),
        trigger("go", |bytes| empty(bytes, Call::Go)),
    ]
};

/// The parameter services of a node.
pub const PARAMETER_SERVICES: [Service; 6] = {
    const fn service(name: &'static str, kind: &'static str, read: fn(&[u8]) -> Option<Call>) -> Service {
        Service { name, package: "rcl_interfaces", kind, read }
    }
    const GET: fn(&[u8]) -> Option<Call> =
        |bytes| whole::<GetParametersRequest>(bytes).map(|_| Call::Parameters(ParameterCall::Get));
    [
        service("list_parameters", "ListParameters", |bytes| {
            whole::<ListParametersRequest>(bytes).map(|_| Call::Parameters(ParameterCall::List))
        }),
        service("get_parameters", "GetParameters", GET),
        service("get_parameter_types", "GetParameterTypes", GET),
        service("describe_parameters", "DescribeParameters", GET),
        service("set_parameters", "SetParameters", |bytes| {
            let request = whole::<SetParametersRequest>(bytes)?;
            Some(Call::Parameters(ParameterCall::Set(request.parameter.len())))
        }),
        service("set_parameters_atomically", "SetParametersAtomically", |bytes| {
            whole::<SetParametersRequest>(bytes).map(|_| Call::Parameters(ParameterCall::SetAtomically))
        }),
    ]
};

/// Returns `call` for a request without a field, which is one byte on the wire.
fn empty(bytes: &[u8], call: Call) -> Option<Call> {
    body::<1>(bytes).map(|_| call)
}

/// Converts a builtin_interfaces/Time (i32 seconds, u32 nanoseconds) to seconds.
fn seconds(bytes: [u8; 8]) -> f64 {
    let [a, b, c, d, e, f, g, h] = bytes;
    f64::from(i32::from_le_bytes([a, b, c, d])) + f64::from(u32::from_le_bytes([e, f, g, h])) * 1e-9
}

/// A call of a client.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Call {
    /// simulation_interfaces/GetSimulatorFeatures.
    GetFeatures,
    /// simulation_interfaces/GetSimulationState.
    GetState,
    /// simulation_interfaces/SetSimulationState: the state.
    SetState(u8),
    /// simulation_interfaces/StepSimulation: the number of steps.
    Step(u64),
    /// simulation_interfaces/ResetSimulation: the scope.
    Reset(u8),
    /// rosbag2_interfaces/Pause.
    Pause,
    /// rosbag2_interfaces/Resume.
    Resume,
    /// rosbag2_interfaces/TogglePaused.
    TogglePaused,
    /// rosbag2_interfaces/IsPaused.
    IsPaused,
    /// rosbag2_interfaces/GetRate.
    GetRate,
    /// rosbag2_interfaces/SetRate: simulated seconds per second.
    SetRate(f64),
    /// rosbag2_interfaces/Seek: simulated seconds.
    Seek(f64),
    /// rosbag2_interfaces/PlayNext.
    PlayNext,
    /// std_srvs/Trigger `hold`.
    Hold,
    /// std_srvs/Trigger `release`.
    Release,
    /// std_srvs/Trigger `go`.
    Go,
    /// A parameter service of the node.
    Parameters(ParameterCall),
}

/// The response to a call: its fields in order.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Response {
    /// A response without fields: one byte, 0.
    Empty(u8),
    /// Success, or for IsPaused the pause.
    Flag(bool),
    /// Simulated seconds per second.
    Rate(f64),
    /// The result of a call that changes the simulation.
    Result(CallResult),
    /// simulation_interfaces/GetSimulationState.
    State(u8, CallResult),
    /// simulation_interfaces/GetSimulatorFeatures.
    Features(Features),
    /// std_srvs/Trigger: success, and a sentence.
    Trigger(bool, String),
    /// A parameter service of the node.
    Parameters(ParameterResponse),
}

/// simulation_interfaces/Result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CallResult {
    /// One of [`result`].
    pub result: u8,
    /// A sentence, unless the result is [`result::OK`].
    pub error_message: String,
}

/// The values of simulation_interfaces/Result.
pub mod result {
    /// The simulator has no such feature.
    pub const FEATURE_UNSUPPORTED: u8 = 0;
    /// Done.
    pub const OK: u8 = 1;
    /// Not in this state.
    pub const INCORRECT_STATE: u8 = 3;
    /// Not done: the message has the reason.
    pub const OPERATION_FAILED: u8 = 4;
    /// SetSimulationState: it was in that state.
    pub const ALREADY_IN_TARGET_STATE: u8 = 101;
    /// SetSimulationState: it did not reach that state.
    pub const STATE_TRANSITION_ERROR: u8 = 102;
    /// SetSimulationState: not from the current state.
    pub const INCORRECT_TRANSITION: u8 = 103;
}

/// simulation_interfaces/SimulationState.
pub mod state {
    /// Paused at the start.
    pub const STOPPED: u8 = 0;
    /// Simulated time advances.
    pub const PLAYING: u8 = 1;
    /// Simulated time stands still.
    pub const PAUSED: u8 = 2;
    /// The simulator ends.
    pub const QUITTING: u8 = 3;
    /// There is no world.
    pub const NO_WORLD: u8 = 4;
    /// A world is being loaded.
    pub const LOADING_WORLD: u8 = 5;
}

/// The bits of ResetSimulation's scope, and the scope that means all of them.
pub mod scope {
    /// As [`ALL`].
    pub const DEFAULT: u8 = 0;
    /// Simulated time.
    pub const TIME: u8 = 1;
    /// Poses and velocities.
    pub const STATE: u8 = 2;
    /// Everything.
    pub const ALL: u8 = 255;
}

/// simulation_interfaces/SimulatorFeatures.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Features {
    /// SIMULATION_RESET (20), its scopes TIME (21) and STATE (22), SIMULATION_STATE_GETTING (24), _SETTING (25) and
    /// _PAUSE (26), STEP_SIMULATION_SINGLE (31) and _MULTIPLE (32).
    pub features: Vec<u16>,
    /// None.
    pub spawn_formats: Vec<String>,
    /// A description of this program.
    pub custom_info: String,
}
