//! Frames have the same bits in every run.

use super::*;

/// Returns a hash of all bits of frames over a show.
fn hash_of_frames(subject: &Subject, solver: &mut dyn Solver) -> u64 {
    let mut chain = Chain::new(subject.motion.team().handles());
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    for frame in 0..200 {
        solver.solve(0.98 * subject.end * f64::from(frame) / 200.0, &mut chain).unwrap();
        let Chain { x, y, heading, speed, vx, vy } = &chain;
        for number in [x, y, heading, speed, vx, vy].into_iter().flatten() {
            hash = (hash ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

/// The bits of frames equal the recorded hashes: a change of any bit fails this test.
///
/// The hashes hold on every x86-64 processor with FMA, which the construction of tables uses, whatever its C library.
#[test]
fn frames_have_the_bits_they_had() {
    let golden: &[(&str, &str, u64)] = &GOLDEN;
    let fma = cfg!(all(target_arch = "x86_64", target_os = "linux")) && Instructions::available().len() > 1;
    let mut changed = Vec::new();
    for name in ["paper", "turnaround", "procession"] {
        let subject = Subject::scene(name);
        for (who, mut solver) in subject.solvers().into_iter().chain(subject.selected()) {
            let hash = hash_of_frames(&subject, solver.as_mut());
            assert_eq!(hash, hash_of_frames(&subject, solver.as_mut()), "{who} on {name}: two plays");
            println!("    (\"{name}\", \"{who}\", {hash:#018x}),");
            let known = golden.iter().find(|(scene, solver, _)| (*scene, *solver) == (name, who.as_str()));
            match known {
                Some((.., known)) if fma && hash != *known => changed.push(format!("{who} on {name}: {hash:#018x}")),
                Some(_) if fma => (),
                _ => println!("{who} on {name}: no hash to compare with on this machine"),
            }
        }
    }
    assert!(changed.is_empty(), "{changed:#?}");
}

const GOLDEN: [(&str, &str, u64); 21] = [
    ("paper", "newton", 0xcb9b56bf3f739716),
    ("paper", "follower_table (AVX-512)", 0x18ba9bc12b3674f1),
    ("paper", "follower_table (AVX2 and FMA)", 0x18ba9bc12b3674f1),
    ("paper", "follower_table (portable)", 0x75b36aef4f4e76fe),
    ("paper", "1e-9 m (AVX-512)", 0xa27e1bdbe332283d),
    ("paper", "1e-9 m (AVX2 and FMA)", 0xa27e1bdbe332283d),
    ("paper", "1e-9 m (portable)", 0xa3e22a374973bedc),
    ("turnaround", "newton", 0x3ace6c031753f4ab),
    ("turnaround", "follower_table (AVX-512)", 0x97aff49092063d0d),
    ("turnaround", "follower_table (AVX2 and FMA)", 0x97aff49092063d0d),
    ("turnaround", "follower_table (portable)", 0x865316be5ed92204),
    ("turnaround", "1e-9 m (AVX-512)", 0x34dca0c29289045e),
    ("turnaround", "1e-9 m (AVX2 and FMA)", 0x34dca0c29289045e),
    ("turnaround", "1e-9 m (portable)", 0x29d5b955963c9452),
    ("procession", "newton", 0x9e66c342cfb3bb1b),
    ("procession", "follower_table (AVX-512)", 0x2a914f95e1b9478e),
    ("procession", "follower_table (AVX2 and FMA)", 0x2a914f95e1b9478e),
    ("procession", "follower_table (portable)", 0x6cf58db092881712),
    ("procession", "1e-9 m (AVX-512)", 0xb9033427927d1f37),
    ("procession", "1e-9 m (AVX2 and FMA)", 0xb9033427927d1f37),
    ("procession", "1e-9 m (portable)", 0xfebdf69919cb9cc3),
];
