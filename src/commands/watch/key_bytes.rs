//! Keys in the bytes that a terminal sends. If the rest of a sequence does not come, its first byte was the key Escape.

/// A key that `watch` knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// A letter or a sign.
    Char(char),
    /// The left arrow.
    Left,
    /// The right arrow.
    Right,
}

/// Returns the keys of these bytes, and the number of bytes they take; the rest is the beginning of another key. With
/// `is_over` no more bytes follow: an Escape without a whole sequence is skipped, and the bytes after it are keys.
pub fn keys_of(bytes: &[u8], is_over: bool) -> (Vec<Key>, usize) {
    const ESCAPE: u8 = 0x1b;
    let (mut keys, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let sequence = match bytes[at..] {
            [ESCAPE] => None,
            // Escape, [ or O, parameters, and a letter that identifies the key.
            [ESCAPE, b'[' | b'O', ref rest @ ..] => rest.iter().position(|byte| (0x40..=0x7e).contains(byte)),
            [byte, ..] => {
                keys.extend((b' '..=b'~').contains(&byte).then_some(Key::Char(byte.into())));
                at += 1;
                continue;
            }
            [] => break,
        };
        match sequence {
            Some(end) => {
                match (end, bytes[at + 2 + end]) {
                    (0, b'C') => keys.push(Key::Right),
                    (0, b'D') => keys.push(Key::Left),
                    _ => (),
                }
                at += 3 + end;
            }
            None if is_over => at += 1,
            None => break,
        }
    }
    (keys, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_whole_whatever_comes_in_one_piece() {
        let (keys, used) = keys_of(b" \x1b[C\x1bOD]\x1b[1;5C\xc3\xa9h", false);
        assert_eq!(keys, [Key::Char(' '), Key::Right, Key::Left, Key::Char(']'), Key::Char('h')]);
        assert_eq!(used, 17);
        for (beginning, complete) in [(&b"."[..], 1), (b".\x1b", 1), (b".\x1b[", 1), (b".\x1b[1;", 1)] {
            assert_eq!(keys_of(beginning, false), (vec![Key::Char('.')], complete));
        }
    }

    #[test]
    fn a_sequence_whose_rest_does_not_come_is_keys() {
        let char = |letters: &str| letters.chars().map(Key::Char).collect::<Vec<_>>();
        for (bytes, letters) in [(&b"\x1b"[..], ""), (b".\x1b[", ".["), (b"\x1b\x1b[1;", "[1;")] {
            assert_eq!(keys_of(bytes, true), (char(letters), bytes.len()));
        }
        assert_eq!(keys_of(b"\x1b[D\x1b", true), (vec![Key::Left], 4));
    }
}
