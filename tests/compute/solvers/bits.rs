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
    ("paper", "newton", 0xb40aca31845b91e3),
    ("paper", "follower_table (AVX-512)", 0x70710b94d07541e9),
    ("paper", "follower_table (AVX2 and FMA)", 0x70710b94d07541e9),
    ("paper", "follower_table (portable)", 0x510351ee79d20005),
    ("paper", "1e-9 m (AVX-512)", 0xdc2349c7e9223e97),
    ("paper", "1e-9 m (AVX2 and FMA)", 0xdc2349c7e9223e97),
    ("paper", "1e-9 m (portable)", 0x6aa81313a8f8c036),
    ("turnaround", "newton", 0x724bcfbf23324f3b),
    ("turnaround", "follower_table (AVX-512)", 0x7478717edd3f28c4),
    ("turnaround", "follower_table (AVX2 and FMA)", 0x7478717edd3f28c4),
    ("turnaround", "follower_table (portable)", 0x8b25ce06c65f45e9),
    ("turnaround", "1e-9 m (AVX-512)", 0x70553f6bb55ae972),
    ("turnaround", "1e-9 m (AVX2 and FMA)", 0x70553f6bb55ae972),
    ("turnaround", "1e-9 m (portable)", 0x1788a9d39814a016),
    ("procession", "newton", 0xd7c900bb92e96ee7),
    ("procession", "follower_table (AVX-512)", 0xce3d84815e6f8797),
    ("procession", "follower_table (AVX2 and FMA)", 0xce3d84815e6f8797),
    ("procession", "follower_table (portable)", 0x6029dbd3606f2ecc),
    ("procession", "1e-9 m (AVX-512)", 0x0e5f54089f88d327),
    ("procession", "1e-9 m (AVX2 and FMA)", 0x0e5f54089f88d327),
    ("procession", "1e-9 m (portable)", 0x25015a7824636a3a),
];
