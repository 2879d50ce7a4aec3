//! Texts from files, made safe to print: names and titles that somebody else chose may hold control characters
//! that move a cursor, change a terminal, reverse a line, or that HTML, XML and CSV cannot carry. The sinks of the program call these
//! functions: the terminal, pages, JSON, XML and CSV.

use std::borrow::Cow;
use std::fmt::Write;

/// True if a character can stand unchanged in one line of a terminal, of HTML and of XML 1.0: no control character, no
/// end of a line, nothing that changes the direction of a line, nothing without a width, no code point that is no character.
pub fn is_printable(c: char) -> bool {
    let directs = matches!(
        c,
        '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{206F}'
    );
    // Two names that look alike could differ by these, the tags of U+E0000 among them.
    let has_no_width = matches!(
        c,
        '\u{AD}' | '\u{180E}' | '\u{200B}'..='\u{200D}' | '\u{2060}'..='\u{2065}' | '\u{FEFF}' | '\u{FFF9}'..='\u{FFFB}'
            | '\u{E0000}'..='\u{E007F}'
    );
    let ends_a_line = matches!(c, '\u{2028}' | '\u{2029}');
    let is_none = matches!(c, '\u{FDD0}'..='\u{FDEF}') || u32::from(c) & 0xFFFE == 0xFFFE;
    !(c.is_control() || directs || has_no_width || ends_a_line || is_none)
}

/// The first character of a text that is not [printable](is_printable).
pub fn first_unprintable(text: &str) -> Option<char> {
    text.chars().find(|&c| !is_printable(c))
}

/// A text for one line: what is not [printable](is_printable) is written as `\u{1b}`. Characters with a meaning
/// in HTML, XML or CSV (`<`, `&`, `"`, a leading `=`) are left for whoever writes that format.
pub fn printable(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_printable) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    text.chars().for_each(|c| push(&mut out, c));
    Cow::Owned(out)
}

/// Variant of [`printable`] for several lines: ends of lines and tabs stay.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    let stays = |c: char| is_printable(c) || c == '\n' || c == '\t';
    if text.chars().all(stays) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if stays(c) {
            out.push(c);
        } else {
            push(&mut out, c);
        }
    }
    Cow::Owned(out)
}

/// Variant of [`printable`] for messages: a break before two spaces, which begins a remedy or an entry of a list, stays. A break in a
/// name is written out, since it would begin a line that the program did not say.
pub fn printable_message(text: &str) -> Cow<'_, str> {
    const OWN: &str = "\n  ";
    if text.chars().all(is_printable) {
        return Cow::Borrowed(text);
    }
    let lines: Vec<_> = text.split(OWN).map(printable).collect();
    Cow::Owned(lines.join(OWN))
}

/// JSON in which strings hold no character that is not [printable](is_printable): such a one is written as `\u202e`, which readers
/// take for the same character. Ends of lines between values stay.
pub fn printable_json(json: &str) -> Cow<'_, str> {
    let stays = |c: char| is_printable(c) || c == '\n';
    if json.chars().all(stays) {
        return Cow::Borrowed(json);
    }
    let mut out = String::with_capacity(json.len() + 16);
    for c in json.chars() {
        if stays(c) {
            out.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a string cannot fail.
                let _ = write!(out, "\\u{unit:04x}");
            }
        }
    }
    Cow::Owned(out)
}

/// Bytes that should be text, for one line: as [`printable`]; bytes that are not UTF-8 are written as `\xff`, and
/// `\` as `\\`, so that different bytes never look alike.
pub fn printable_bytes(bytes: &[u8]) -> String {
    let mut out = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            if c == '\\' {
                out.push_str("\\\\");
            } else {
                push(&mut out, c);
            }
        }
        for byte in chunk.invalid() {
            // Writing to a string cannot fail.
            let _ = write!(out, "\\x{byte:02x}");
        }
    }
    out
}

/// A text without the mark of its byte order (U+FEFF) that some programs write before it.
pub fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{FEFF}').unwrap_or(text)
}

/// Lines of a table of text with their numbers, counted from one: without empty ones, comments, which begin with #, and the mark of
/// [`without_mark`].
pub fn table_rows(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = without_mark(text).lines().enumerate();
    lines
        .map(|(k, line)| (k + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// A count with its digits in groups of three: `12,000`.
pub fn count(n: u64) -> String {
    grouped(&n.to_string())
}

/// Digits in groups of three.
pub fn grouped(digits: &str) -> String {
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Bytes as hexadecimal digits, such as those of a digest.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Variant of [`printable`] that cuts at 80 characters, to quote a text of any length in a message.
pub fn quoted(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        None => printable(text).into_owned(),
        Some((end, _)) => format!("{}...", printable(&text[..end])),
    }
}

fn push(out: &mut String, c: char) {
    if is_printable(c) {
        out.push(c);
    } else {
        let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
    }
}

/// A count with what is counted, in the singular for one: `1 term`, `12,000 terms`, `2 copies`.
pub fn counted(n: usize, what: &str) -> String {
    let stem = what
        .strip_suffix('y')
        .filter(|stem| !stem.ends_with(['a', 'e', 'i', 'o', 'u']));
    match (n, stem) {
        (1, _) => format!("1 {what}"),
        (_, Some(stem)) => format!("{} {stem}ies", count(n as u64)),
        _ => format!("{} {what}s", count(n as u64)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_a_cursor_is_written_out() {
        assert_eq!(printable("a\u{1b}[2Jb\u{7}\n"), "a\\u{1b}[2Jb\\u{7}\\u{a}");
        assert_eq!(printable("\u{fffe}\u{9b}1m\u{202e}x"), "\\u{fffe}\\u{9b}1m\\u{202e}x");
        assert_eq!(printable_lines("a\n\tb\r"), "a\n\tb\\u{d}");
        assert_eq!(
            printable_message("2 of 3:\n  a\npass\n  b\r"),
            "2 of 3:\n  a\\u{a}pass\n  b\\u{d}"
        );
        for plain in ["LENS_1", "Ünïcode µm 透镜", "<&\"=", ""] {
            assert!(matches!(printable(plain), Cow::Borrowed(same) if same == plain));
        }
        assert_eq!(first_unprintable("ab\u{fffe}"), Some('\u{fffe}'));
    }

    #[test]
    fn what_has_no_width_is_written_out() {
        assert_eq!(printable("a\u{200b}b\u{2060}c\u{ad}"), "a\\u{200b}b\\u{2060}c\\u{ad}");
        assert_eq!(printable("\u{2066}\u{2028}\u{e0041}"), "\\u{2066}\\u{2028}\\u{e0041}");
    }

    /// The characters come back, whatever plane they are of.
    #[test]
    fn json_keeps_its_meaning() {
        assert_eq!(
            printable_json("{\n\"a\u{202e}\": \"\u{7f}\u{e0041}µ\"}"),
            "{\n\"a\\u202e\": \"\\u007f\\udb40\\udc41µ\"}"
        );
        assert!(matches!(printable_json("{\"µ\": 1}"), Cow::Borrowed(_)));
    }

    #[test]
    fn different_bytes_look_different() {
        let names: [&[u8]; 6] = [b"A\x01", b"A\\u{1}", b"A\xff", b"A\\xff", b"A", "A\u{fffd}".as_bytes()];
        let shown: std::collections::BTreeSet<String> = names.iter().map(|n| printable_bytes(n)).collect();
        assert_eq!(shown.len(), names.len());
        assert!(shown.iter().all(|s| first_unprintable(s).is_none()));
    }

    #[test]
    fn long_texts_are_cut() {
        assert_eq!(quoted(&"ä".repeat(200)), format!("{}...", "ä".repeat(80)));
        assert_eq!(quoted("short"), "short");
    }

    #[test]
    fn one_is_singular() {
        let words = [(1, "term"), (0, "term"), (12_000, "copy"), (2, "array")].map(|(n, what)| counted(n, what));
        assert_eq!(words, ["1 term", "0 terms", "12,000 copies", "2 arrays"]);
    }
}
