//! Changes of bytes and of text that the targets share.

use fastrand::Rng;

/// Numbers at limits, as people write them.
pub const NUMBERS: [&str; 34] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "0.5",
    "2",
    "3",
    "7",
    "1e-3",
    "1e-9",
    "1e-18",
    "1e-300",
    "5e-324",
    "1e3",
    "1e4",
    "1e6",
    "1e7",
    "1e9",
    "1e15",
    "1e16",
    "1e20",
    "1e300",
    "1.7976931348623157e308",
    "inf",
    "-inf",
    "nan",
    "255",
    "256",
    "65536",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "18446744073709551615",
    "0.1",
];

/// Returns one of several values.
pub fn one<'of, T>(of: &'of [T], random: &mut Rng) -> &'of T {
    &of[random.usize(..of.len())]
}

/// Changes some bytes anywhere: flips, cuts, copies, numbers at their limits.
pub fn changed(input: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..1 + random.usize(..4) {
        let at = random.usize(..=bytes.len());
        match random.u8(..8) {
            _ if bytes.is_empty() => bytes.push(random.u8(..)),
            0 | 1 => {
                let at = at.min(bytes.len() - 1);
                bytes[at] ^= 1 << random.u8(..8);
            }
            2 => {
                let at = at.min(bytes.len() - 1);
                bytes[at] = *one(&[0, 1, 0x7f, 0x80, 0xff, b'"', b'\n', b' '], random);
            }
            3 => bytes.truncate(at),
            4 => {
                let end = (at + random.usize(..64)).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                let end = (at + random.usize(..64)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                let to = random.usize(..=bytes.len());
                bytes.splice(to..to, copy);
            }
            6 => {
                let limit = *one(&[0, 1, 0x7fff_ffff, 0xffff_ffff, u64::MAX, u64::MAX - 8, 1 << 40, 1 << 63], random);
                let length = *one(&[2, 4, 8], random);
                let end = (at + length).min(bytes.len());
                bytes[at..end].copy_from_slice(&limit.to_le_bytes()[..end - at]);
            }
            _ => bytes.insert(at, random.u8(..)),
        }
    }
    bytes
}

/// Replaces a number in a text by another, or by a nearby one.
pub fn renumbered(text: &str, random: &mut Rng) -> String {
    // Places of numbers: runs of characters of numbers that begin with a digit or a minus.
    let bytes = text.as_bytes();
    let is_part = |byte: u8| byte.is_ascii_digit() || b".eE+-".contains(&byte);
    let mut places = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let begins = (bytes[at].is_ascii_digit() || bytes[at] == b'-')
            && (at == 0 || !(bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_'));
        let mut end = at + 1;
        while begins && end < bytes.len() && is_part(bytes[end]) {
            end += 1;
        }
        if begins {
            places.push((at, end));
        }
        at = end;
    }
    if places.is_empty() {
        return text.to_owned();
    }
    let (from, to) = *one(&places, random);
    let number = match (text[from..to].parse::<f64>(), random.u8(..4)) {
        (Ok(number), 0) => (number * 10f64.powf(8.0 * random.f64() - 4.0)).to_string(),
        (Ok(number), 1) => (number * (0.5 + random.f64())).to_string(),
        (Ok(number), 2) => (number + *one(&[-1.0, 1.0, 0.5, 1e-9], random)).to_string(),
        _ => (*one(&NUMBERS, random)).to_owned(),
    };
    format!("{}{number}{}", &text[..from], &text[to..])
}
