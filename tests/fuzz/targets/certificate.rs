//! Certificates of events as `verify` reads them: refused with a sentence, or what they claim is what the ordinary search
//! finds.

use bench_dragon::proof::verify;
use fastrand::Rng;
use serde_json::Value;

use super::Target;
use super::bytes::{changed, renumbered};
use super::changes::change;
use super::scene::is_small;
use super::truth::{certificate, is_true, scene, timeline};

pub const TARGET: Target = Target { name: "certificate", run, seeds, mutate, cases: 150 };

/// Bytes of the longest certificate that is checked: some hundred steps of a small team.
const MOST_BYTES: usize = 200_000;

fn run(data: &[u8]) {
    if data.len() > MOST_BYTES {
        return;
    }
    match verify(data, &mut |_| ()) {
        // What the file holds may stand in the sentence: the command escapes it.
        Err(refused) => assert!(!refused.to_string().is_empty(), "{refused:?}"),
        Ok(proved) => {
            assert_eq!(proved.results.len(), 4, "{:?}", proved.results);
            // What the program itself does not take as a scene, or would search for long, has no other judge.
            if !scene(&proved.scene).is_some_and(|scene| is_small(&scene)) {
                return;
            }
            let timeline = timeline(&proved.scene).expect("a scene");
            for outcome in &proved.results {
                assert!(is_true(outcome, &timeline), "accepted, but not true: {outcome:?}");
            }
        }
    }
}

/// Certificates of two small scenes: one that ends in contact on its path's last line, and one that goes in on a spiral.
fn seeds() -> Vec<Vec<u8>> {
    let team = "[team]\nbenches = 3\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
    let paths = [
        "kind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 1.0\n[[path.pieces]]\nkind = \"arc\"\n\
         radius = 2.0\nside = \"left\"\nturns = 0.25\n[[path.pieces]]\nkind = \"line\"\nlength = 2.0\n",
        "kind = \"spiral\"\npitch = 1.7\nstart_turn = 1.2\n",
    ];
    let text = |path| format!("{team}[path]\n{path}[motion]\nhead_speed = 1.0\n");
    let lines = |scene: String| certificate(&scene).iter().map(|line| format!("{line}\n")).collect::<String>();
    paths.map(|path| lines(text(path)).into_bytes()).to_vec()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let text = String::from_utf8_lossy(data);
    let parsed: Result<Vec<Value>, _> = text.lines().map(serde_json::from_str).collect();
    let Some(mut lines) = parsed.ok().filter(|lines| lines.len() > 7) else { return changed(data, random) };
    match random.u8(..8) {
        0 => return changed(data, random),
        1 => return renumbered(&text, random).into_bytes(),
        _ => (),
    }
    for _ in 0..1 + random.usize(..3) {
        // Lines that an earlier change has left without their fields are not changed by name again.
        if lines.len() > 7 && lines[0]["scene"].is_string() {
            change(&mut lines, random);
        }
    }
    lines.iter().map(|line| format!("{line}\n")).collect::<String>().into_bytes()
}
