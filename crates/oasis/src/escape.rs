//! Bytes that strings of OASIS cannot hold: names have printable ASCII without spaces, texts with spaces.
//!
//! Such a byte is written as `\x` and two hexadecimal digits, and so is a backslash that would read as the beginning of
//! one. Strings without either are as they are.

use std::borrow::Cow;

/// Kind of a string: the bytes that it can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StringKind {
    /// Name of a cell: no spaces.
    Name,
    /// String of a text.
    Text,
}

const BACKSLASH: u8 = b'\\';

impl StringKind {
    fn holds(self, byte: u8) -> bool {
        matches!(byte, 0x21..=0x7E) || (byte == b' ' && self == Self::Text)
    }

    /// The byte that `x` and two digits at the start of `rest`, which follows a backslash, stand for, if they do.
    fn escape(self, rest: &[u8]) -> Option<u8> {
        let digits = |rest: &[u8]| match *rest {
            [b'x', high, low, ..] => Some(digit(high)? << 4 | digit(low)?),
            _ => None,
        };
        let byte = digits(rest)?;
        if byte != BACKSLASH {
            return (!self.holds(byte)).then_some(byte);
        }
        // An escaped backslash stands where the text behind it would read as an escape.
        let mut behind = &rest[3..];
        while digits(behind) == Some(BACKSLASH) {
            behind = &behind[3..];
        }
        digits(behind).filter(|&b| !self.holds(b)).map(|_| BACKSLASH)
    }

    /// A string of any bytes as OASIS can hold it.
    pub fn escaped(self, bytes: &[u8]) -> Cow<'_, [u8]> {
        let wrong = |k: usize| match bytes[k] {
            BACKSLASH => self.escape(&bytes[k + 1..]).is_some(),
            byte => !self.holds(byte),
        };
        if !(0..bytes.len()).any(wrong) {
            return Cow::Borrowed(bytes);
        }
        let mut out = Vec::with_capacity(bytes.len() + 3);
        for (k, &byte) in bytes.iter().enumerate() {
            if wrong(k) {
                out.extend(format!("\\x{byte:02x}").bytes());
            } else {
                out.push(byte);
            }
        }
        Cow::Owned(out)
    }

    /// The bytes that [`StringKind::escaped`] was given; a string that would end with a zero, which GDSII cannot hold,
    /// as it is.
    pub fn unescaped(self, bytes: &[u8]) -> Cow<'_, [u8]> {
        if !bytes.contains(&BACKSLASH) {
            return Cow::Borrowed(bytes);
        }
        let mut out = Vec::with_capacity(bytes.len());
        let mut k = 0;
        while k < bytes.len() {
            let escape = (bytes[k] == BACKSLASH).then(|| self.escape(&bytes[k + 1..])).flatten();
            out.push(escape.unwrap_or(bytes[k]));
            k += if escape.is_some() { 4 } else { 1 };
        }
        if out.last() == Some(&0) {
            return Cow::Borrowed(bytes);
        }
        Cow::Owned(out)
    }
}

/// Value of a hexadecimal digit, in lower case.
fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_come_back() {
        let strings: [&[u8]; 9] = [
            b"two\nlines",
            b"C:\\lens\\v2",
            b"pitch 0.35 \xb5m",
            b"\\xe4 literal",
            b"\\x5cxe4",
            b"\\x5cx5cxe4\\",
            b"\\x41",
            b"",
            b"\x00\x07SUB",
        ];
        for kind in [StringKind::Name, StringKind::Text] {
            for string in strings {
                let escaped = kind.escaped(string);
                assert!(escaped.iter().all(|&b| kind.holds(b)), "{escaped:?}");
                assert_eq!(kind.unescaped(&escaped), string, "{escaped:?}");
            }
        }
        assert_eq!(*StringKind::Text.escaped(b"two\nlines"), b"two\\x0alines"[..]);
        assert_eq!(*StringKind::Name.escaped(b"a b"), b"a\\x20b"[..]);
        for plain in [&b"C:\\lens\\v2 a"[..], b"\\x41", b"\\xE4"] {
            assert_eq!(*StringKind::Text.escaped(plain), *plain);
            assert_eq!(*StringKind::Text.unescaped(plain), *plain);
        }
        assert_eq!(*StringKind::Text.unescaped(b"a\\x00"), b"a\\x00"[..]);
    }
}
