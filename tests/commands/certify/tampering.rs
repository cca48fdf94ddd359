//! Random changes to certificates: refused, or still true.

use fastrand::Rng;

use super::changes::change;
use super::truth::{Found, certificate};
use super::{check, harness, scene_text};

/// A changed certificate is refused, or its accepted claims are true of its scene.
#[test]
fn what_is_changed_is_refused_or_true() {
    let changes = if harness::long() { 1000 } else { 60 };
    let mut random = Rng::with_seed(1);
    let (mut refused, mut accepted, mut undecided) = (0, 0, 0);
    let scenes = ["missed_contact", "tailoff", "alertloop", "pieces_46", "tight_158"];
    for name in scenes {
        let original = certificate(&scene_text(name));
        let mut done = 0;
        while done < changes / scenes.len() {
            let mut lines = original.clone();
            let Some(what) = change(&mut lines, &mut random) else { continue };
            done += 1;
            let Ok(proved) = check(&lines) else {
                refused += 1;
                continue;
            };
            accepted += 1;
            // The program refuses some scenes that the checker accepts: the checker does not limit a direction to one
            // turn, for example.
            let Some(found) = Found::new(&proved.scene) else {
                undecided += 1;
                continue;
            };
            assert_eq!(found.contradiction(&proved), None, "{name}, {what}: accepted");
        }
    }
    harness::aloud(&format!("{refused} changes refused, {accepted} accepted and true"));
    assert!(refused > changes / 2, "{refused}");
    assert!(undecided <= changes / 20, "{undecided}");
}
