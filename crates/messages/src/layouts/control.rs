//! The layouts of cues, and of commands and their answers.

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::SceneName;

/// A cue that the show has reached. Payload of `<name>/cues`.
///
/// Each cue is sent once, with the frame at or after its time; a seek over cues sends none.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::{Cue, SceneName};
///
/// let cue = Cue { number: 1, pauses: 1, name: SceneName::new("the coil closes"), ..Cue::default() };
/// assert_eq!((cue.name.as_str(), cue.pauses == 1), ("the coil closes", true));
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/Cue/1")]
#[repr(C)]
pub struct Cue {
    /// The run, as in [`FrameHeader::run_id`](super::FrameHeader::run_id).
    pub run_id: u64,
    /// The tick of the frame this cue goes with.
    pub tick: u64,
    /// CLOCK_REALTIME in nanoseconds of that frame.
    pub stamp_ns: u64,
    /// Simulated seconds of that frame.
    pub sim_time: f64,
    /// Simulated seconds of the cue itself.
    pub cue_time: f64,
    /// Its number, from 1 in the order of the cues' times.
    pub number: u32,
    /// 1 if the show waits there until the command `go`, else 0.
    pub pauses: u32,
    /// Its name.
    pub name: SceneName,
}

/// A command to a running show. Request of `<name>/control`.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::control::Command;
/// use bench_dragon_messages::ControlRequest;
///
/// let (command, value) = Command::Seek(400.0).number_and_value();
/// let request = ControlRequest { id: 1, value, command, reserved: 0 };
/// assert_eq!((request.command, request.value), (4, 400.0));
/// assert_eq!(Command::of_number(request.command, request.value), Ok(Command::Seek(400.0)));
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/ControlRequest/1")]
#[repr(C)]
pub struct ControlRequest {
    /// A number that the client chooses; the response repeats it.
    pub id: u64,
    /// The value of a command that has one: simulated seconds per second, simulated seconds, or periods. With the
    /// command state, 1 requests a response whose `time_scale` is the rate of the show when it plays, even while it is
    /// paused.
    pub value: f64,
    /// 0 state, 1 pause, 2 resume, 3 rate, 4 seek, 5 step, 6 restart, 7 hold, 8 release, 9 go.
    pub command: u32,
    /// Always 0.
    pub reserved: u32,
}

/// The result of a command. Response of `<name>/control`.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::control::Code;
/// use bench_dragon_messages::state::PlaybackState;
/// use bench_dragon_messages::ControlResponse;
///
/// let response = ControlResponse { id: 1, sim_time: 400.0, playback: 1, ..ControlResponse::default() };
/// assert_eq!(response.result(), Some(Code::Done));
/// assert_eq!(response.playback_state(), Some(PlaybackState::Paused));
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ZeroCopySend)]
#[type_name("bench_dragon/ControlResponse/1")]
#[repr(C)]
pub struct ControlResponse {
    /// The id of the request.
    pub id: u64,
    /// The period at whose beginning the command was executed.
    pub tick: u64,
    /// Simulated seconds of that period.
    pub sim_time: f64,
    /// Simulated seconds per second, as in force; 0 while paused or held, unless the request is for another rate.
    pub time_scale: f64,
    /// 0 done, 1 already so, 2 refused in this state, 3 value out of range, 4 not understood, 5 too many waiting.
    pub code: u32,
    /// The playback state, as in [`FrameHeader::playback`](super::FrameHeader::playback).
    pub playback: u32,
    /// The latest cue passed, from 1; 0 before the first cue.
    pub cue: u32,
    /// Always 0.
    pub reserved: u32,
}
