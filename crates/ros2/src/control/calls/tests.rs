//! Cases that the service tests over the wire cannot cause: commands of other clients between those of a call.

use super::*;

fn outcome(code: Code, playback: PlaybackState, sim_time: f64) -> Outcome {
    Outcome { code, tick: 9, sim_time, time_scale: 0.0, playing_rate: 2.0, playback, cue: 0 }
}

fn result_of(next: Next) -> u8 {
    match next {
        Next::Answer(Response::Result(CallResult { result, error_message })) => {
            assert_eq!(error_message.is_empty(), result == result::OK);
            result
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stop_that_another_client_resumes_meanwhile_fails() {
    let mut adapter = ServiceAdapter::default();
    let stop = Call::SetState(state::STOPPED);
    assert_eq!(adapter.begin(stop), Next::Execute(Command::Pause));
    let paused = outcome(Code::Done, PlaybackState::Paused, 70.0);
    assert_eq!(adapter.proceed(stop, Command::Pause, &paused), Next::Execute(Command::Restart));
    let resumed = outcome(Code::Done, PlaybackState::Playing, 50.0);
    assert_eq!(result_of(adapter.proceed(stop, Command::Restart, &resumed)), result::STATE_TRANSITION_ERROR);
    // The show is held meanwhile: it cannot be stopped from this state.
    let held = outcome(Code::Refused, PlaybackState::Held, 70.0);
    assert_eq!(result_of(adapter.proceed(stop, Command::Restart, &held)), result::INCORRECT_TRANSITION);
}

#[test]
fn stopped_is_where_a_reset_has_left_a_paused_show_and_nowhere_else() {
    let mut adapter = ServiceAdapter::default();
    let state_at = |adapter: &mut ServiceAdapter, playback, time| match adapter.proceed(
        Call::GetState,
        Command::State,
        &outcome(Code::Done, playback, time),
    ) {
        Next::Answer(Response::State(state, _)) => state,
        other => panic!("{other:?}"),
    };
    assert_eq!(state_at(&mut adapter, PlaybackState::Paused, 50.0), state::PAUSED);
    adapter.proceed(Call::Reset(0), Command::Restart, &outcome(Code::Done, PlaybackState::Paused, 50.0));
    assert_eq!(state_at(&mut adapter, PlaybackState::Paused, 50.0), state::STOPPED);
    // Another client has moved the show, plays it or holds it, or the show is at its end.
    assert_eq!(state_at(&mut adapter, PlaybackState::Paused, 60.0), state::PAUSED);
    assert_eq!(state_at(&mut adapter, PlaybackState::Playing, 50.0), state::PLAYING);
    assert_eq!(state_at(&mut adapter, PlaybackState::Held, 50.0), state::PAUSED);
    assert_eq!(state_at(&mut adapter, PlaybackState::Ended, 50.0), state::PLAYING);
    adapter.proceed(Call::Reset(0), Command::Restart, &outcome(Code::Done, PlaybackState::Playing, 50.0));
    assert_eq!(state_at(&mut adapter, PlaybackState::Paused, 50.0), state::PAUSED);
}

#[test]
fn a_step_that_is_broken_off_is_distinguished_from_one_that_a_playing_show_refuses() {
    let mut adapter = ServiceAdapter::default();
    let mut answer = |playback| {
        let next = adapter.proceed(Call::Step(5), Command::Step(5), &outcome(Code::Refused, playback, 50.0));
        match next {
            Next::Answer(Response::Result(result)) => (result.result, result.error_message),
            other => panic!("{other:?}"),
        }
    };
    let [playing, paused, held] = [PlaybackState::Playing, PlaybackState::Paused, PlaybackState::Held].map(&mut answer);
    assert_eq!([playing.0, paused.0, held.0], [4, 4, 3]);
    assert!(playing.1.contains("not paused") && paused.1.contains("broke") && held.1.contains("held"));
}

#[test]
fn a_refusal_is_told_wherever_the_response_has_room() {
    for (call, room) in [
        (Call::GetState, true),
        (Call::SetState(1), true),
        (Call::SetRate(1.0), true),
        (Call::Go, true),
        (Call::GetRate, false),
        (Call::Pause, false),
    ] {
        assert_eq!(refusal(call, "crowded").is_some(), room, "{call:?}");
    }
}
