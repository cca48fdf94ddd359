//! The QR code that `view` prints on a terminal, as a phone reads it: with a decoder that is independent of the program.

use crate::harness;

use std::fs::File;
use std::io::Read;
use std::process::{Command, Stdio};

use harness::{can_run, unique};
use nix::pty::openpty;

/// Returns the bits of a code, dark ones true, row by row, from lines in which a character is two bits, one upon the
/// other: the foreground is dark.
fn bits(lines: &[&str]) -> Vec<Vec<bool>> {
    let rows = |line: &&str| {
        let row = |dark: [char; 2]| line.chars().map(|it| dark.contains(&it)).collect::<Vec<_>>();
        [row(['█', '▀']), row(['█', '▄'])]
    };
    lines.iter().flat_map(rows).collect()
}

/// Returns the text of a code, each of whose bits is drawn as four by four dots with a light rim.
fn decoded(bits: &[Vec<bool>]) -> String {
    const DOTS: usize = 4;
    const RIM: usize = 4;
    let (width, height) = (bits[0].len() + 2 * RIM, bits.len() + 2 * RIM);
    let dark = |x: usize, y: usize| {
        let at = |dot: usize| (dot / DOTS).checked_sub(RIM);
        let bit = move || -> Option<bool> { Some(*bits.get(at(y)?)?.get(at(x)?)?) };
        bit().unwrap_or(false)
    };
    let mut picture = rqrr::PreparedImage::prepare_from_bitmap(DOTS * width, DOTS * height, dark);
    let grids = picture.detect_grids();
    assert_eq!(grids.len(), 1);
    grids[0].decode().unwrap().1
}

/// Returns an address of this machine for other machines.
fn address() -> Result<String, String> {
    let output = Command::new("hostname").arg("-I").output().map_err(|error| error.to_string())?;
    let addresses = harness::text(&output.stdout);
    let v4 = addresses.split_whitespace().find(|address| address.contains('.'));
    v4.map(str::to_owned).ok_or_else(|| "this machine has no address for other machines".to_owned())
}

#[test]
fn a_phone_reads_the_address_with_the_token_from_the_terminal() {
    let address = address();
    if !can_run(address.clone().map(drop)) {
        return;
    }
    let terminal = openpty(None, None).unwrap();
    let mut view = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    view.args(["--name", &unique("qr"), "view", "--control", "--port", "0", "--listen", &address.unwrap()]);
    let mut view = view.stdin(Stdio::null()).stdout(terminal.slave).stderr(Stdio::null()).spawn().unwrap();
    let (mut output, mut printed, mut chunk) = (File::from(terminal.master), Vec::new(), [0; 4096]);
    while !harness::text(&printed).contains("may conduct") {
        let count = output.read(&mut chunk).unwrap();
        printed.extend_from_slice(&chunk[..count]);
    }
    view.kill().unwrap();
    view.wait().unwrap();
    let printed = harness::text(&printed);
    let url = printed.split_whitespace().find(|word| word.starts_with("http://")).unwrap().trim_end_matches('.');
    assert!(url.contains("/#token="), "{printed}");
    let lines: Vec<&str> =
        printed.lines().filter_map(|line| line.split_once("\x1b[30;107m")).map(|(_, rest)| rest).collect();
    let lines: Vec<&str> = lines.iter().map(|line| line.split('\x1b').next().unwrap()).collect();
    assert_eq!(decoded(&bits(&lines)), url);
}
