//! The processes of a soak test that ended before their time, in words, the first one first.
//!
//! In: a fleet that has finished. Out: a sentence for each process, which the report has before its checks: the figures
//! of the other checks follow from it.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Duration;

use nix::sys::signal::Signal;

use super::fleet::Fleet;
use super::member::ProcessState;

/// Returns the sentences of a fleet that has finished.
pub fn causes(fleet: &Fleet) -> Vec<String> {
    let mut causes: Vec<(Duration, String)> = Vec::new();
    match fleet.publisher_end() {
        (None, _) => causes.push((Duration::MAX, "the publisher did not end after SIGINT".to_owned())),
        (Some(status), Some(after)) => causes.push((after, early("the publisher", Some(status), after))),
        (Some(status), None) if !status.success() => {
            causes.push((Duration::MAX, format!("the publisher, told to end, {}", end(Some(status)))));
        }
        _ => (),
    }
    for member in fleet.members() {
        let label = &member.label;
        match (member.state, member.ended_after(fleet.began())) {
            (ProcessState::EndedByItself, Some(after)) => {
                causes.push((after, early(label, member.exit, after)));
            }
            (ProcessState::Ending, _) => causes.push((Duration::MAX, format!("{label} did not end after SIGTERM"))),
            _ => (),
        }
        if member.lost() > 0 {
            causes.push((Duration::MAX, format!("{label} ended by itself {} times and was restarted", member.lost())));
        }
    }
    causes.sort();
    causes.into_iter().map(|(_, cause)| cause).collect()
}

/// Returns a process's end before the end of the test.
fn early(who: &str, status: Option<ExitStatus>, after: Duration) -> String {
    format!("{who} {} after {:.0} s", end(status), after.as_secs_f64())
}

/// Returns the way in which a process ended.
fn end(status: Option<ExitStatus>) -> String {
    let signal = status.and_then(|status| status.signal());
    match (signal, status.and_then(|status| status.code())) {
        (Some(signal), _) => {
            let name = Signal::try_from(signal).map_or_else(|_| format!("signal {signal}"), |name| name.to_string());
            format!("was killed by {name}")
        }
        (None, Some(code)) => format!("ended with exit code {code}"),
        (None, None) => "ended".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_process_names_its_signal_or_its_exit_code() {
        // wait(2): the signal in the low seven bits, the exit code in the next byte.
        let words = |raw| early("the publisher", Some(ExitStatus::from_raw(raw)), Duration::from_millis(41_400));
        assert_eq!(words(9), "the publisher was killed by SIGKILL after 41 s");
        assert_eq!(words(1 << 8), "the publisher ended with exit code 1 after 41 s");
        assert_eq!(words(64), "the publisher was killed by signal 64 after 41 s");
    }
}
