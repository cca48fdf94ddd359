//! Random commands for the tests of this crate: every command, with values in and out of range, for a show of 7 s.

use proptest::prelude::*;

use bench_dragon_messages::control::Command;

/// Returns a command. Resume, step and release come more often, since they let the show play.
pub(super) fn commands() -> impl Strategy<Value = Command> {
    prop_oneof![
        Just(Command::State),
        Just(Command::Pause),
        Just(Command::Resume),
        Just(Command::Resume),
        prop_oneof![Just(0.0), Just(f64::NAN), Just(1e6), Just(1e-6), 0.1f64..10.0].prop_map(Command::Rate),
        prop_oneof![Just(-1.0), Just(7.0), Just(f64::NAN), 0.0f64..7.5].prop_map(Command::Seek),
        (1u64..40).prop_map(Command::Step),
        (1u64..40).prop_map(Command::Step),
        Just(Command::Restart),
        Just(Command::Hold),
        Just(Command::Release),
        Just(Command::Release),
        Just(Command::Go),
    ]
}
