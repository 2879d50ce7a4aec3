//! The text of a TOML file with other values in one of its sections.

/// Characters of a line up to its comment, and the brackets that it opens and does not close.
fn before_comment(line: &str) -> (&str, i32) {
    let (mut quote, mut depth) = (None, 0);
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') => return (&line[..at], depth),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            (None, '[') => depth += 1,
            (None, ']') => depth -= 1,
            _ => {}
        }
    }
    (line, depth)
}

/// The text with these values at keys of a section, such as `[mapping]`, or of the section of such a name at place `nth` from zero,
/// such as `[[mark]]`; a key without a value is taken out. Values that are there are replaced where they stand, others follow the
/// head of the section, and a section that is not there is added at the end. All other lines and comments stay.
pub(crate) fn with_keys(text: &str, head: &str, nth: usize, keys: &[(&str, Option<&str>)]) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut seen, mut depth, mut dropped) = (0, 0, false);
    let (mut within, mut after_head) = (false, None);
    let mut found = vec![false; keys.len()];
    for line in text.split_inclusive('\n') {
        let (said, opened) = before_comment(line);
        if depth > 0 {
            depth += opened;
            if !dropped {
                out += line;
            }
            continue;
        }
        let said = said.trim();
        if said.starts_with('[') {
            let is_head = said.replace(char::is_whitespace, "") == head;
            within = is_head && seen == nth;
            seen += usize::from(is_head);
            out += line;
            if within {
                if !line.ends_with('\n') {
                    out.push('\n');
                }
                after_head = Some(out.len());
            }
            continue;
        }
        depth = opened.max(0);
        let name = said.split('=').next().unwrap_or_default().trim().trim_matches('"');
        let place = keys
            .iter()
            .position(|(key, _)| within && said.contains('=') && *key == name);
        dropped = place.is_some();
        let Some(place) = place else {
            out += line;
            continue;
        };
        found[place] = true;
        if let Some(value) = keys[place].1 {
            let comment = &line.trim_end()[before_comment(line.trim_end()).0.len()..];
            let space = if comment.is_empty() { "" } else { "  " };
            out += &format!("{name} = {value}{space}{comment}\n");
        }
    }
    let others = keys.iter().zip(&found).filter(|(_, found)| !**found);
    let others: String = others
        .filter_map(|((key, value), _)| Some(format!("{key} = {}\n", (*value)?)))
        .collect();
    if let Some(at) = after_head {
        out.insert_str(at, &others);
    } else {
        let end = if out.ends_with('\n') { "" } else { "\n" };
        out += &format!("{end}\n{head}\n{others}");
    }
    out
}

/// The text without a section, such as `[mapping.cell]`: from its head to the head of the next one.
pub(crate) fn without_section(text: &str, head: &str) -> String {
    let (mut within, mut depth) = (false, 0);
    let kept = text.split_inclusive('\n').filter(|line| {
        let (said, opened) = before_comment(line);
        if depth == 0 && said.trim().starts_with('[') {
            within = said.trim().replace(char::is_whitespace, "") == head;
            return !within;
        }
        depth = (depth + opened).max(0);
        !within
    });
    kept.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_keys_of_the_section_are_replaced() {
        let keys = [
            ("table", Some("\"new.csv\"")),
            ("coefficients", None),
            ("wavelength_nm", Some("633")),
        ];
        let text = "[lens]\nwavelength_nm = 1\n[ mapping ]  # mine\n# a note\nwavelength_nm = 532   # green\ncoefficients = [ # [\n  1,\n  \
                    2\n]\nband_nm = [1, 2]\n[layout]\ntable = 3\nx = [\n[1]]\n";
        let want = "[lens]\nwavelength_nm = 1\n[ mapping ]  # mine\ntable = \"new.csv\"\n# a note\nwavelength_nm = 633  # green\nband_nm = \
                    [1, 2]\n[layout]\ntable = 3\nx = [\n[1]]\n";
        assert_eq!(with_keys(text, "[mapping]", 0, &keys), want);
        assert_eq!(with_keys(want, "[mapping]", 0, &keys), want);
        let table = &keys[..1];
        assert_eq!(
            with_keys("a = 1", "[mapping]", 0, table),
            "a = 1\n\n[mapping]\ntable = \"new.csv\"\n"
        );
        assert_eq!(
            with_keys("[mapping]", "[mapping]", 0, table),
            "[mapping]\ntable = \"new.csv\"\n"
        );
        let marks = "[[mark]]\nx = 1\n[[mark]]\nx = 2\n";
        assert_eq!(
            with_keys(marks, "[[mark]]", 1, &[("x", Some("5"))]),
            "[[mark]]\nx = 1\n[[mark]]\nx = 5\n"
        );
    }
    #[test]
    fn a_section_ends_with_the_head_of_the_next() {
        let text = "[mapping]\na = 1\n[mapping.cell]   # mine\nb = [\n[2]]\n\n[layout]\nc = 3\n";
        assert_eq!(
            without_section(text, "[mapping.cell]"),
            "[mapping]\na = 1\n[layout]\nc = 3\n"
        );
        assert_eq!(without_section(text, "[array]"), text);
    }
}
