//! The wording of faults.

use super::Limits;

/// ` from 10 to 300 nm`, or as much of it as there are limits.
pub(super) fn describe(limits: &Limits) -> String {
    let unit = if limits.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", limits.unit)
    };
    match (*limits.range.start(), *limits.range.end()) {
        (a, b) if a == f64::MIN && b == f64::MAX => unit,
        (a, b) if b == f64::MAX => format!(" of at least {a}{unit}"),
        (a, b) => format!(" from {a} to {b}{unit}"),
    }
}

pub(super) fn article(kind: &str) -> String {
    match kind.chars().next() {
        Some('a' | 'e' | 'i' | 'o' | 'u') => format!("an {kind}"),
        _ => format!("a {kind}"),
    }
}

/// Words longer than this are compared with nothing: no key is as long, and the comparison grows with the length.
const LONGEST: usize = 64;

/// The known word that is close to the one given, if one is.
pub(super) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > LONGEST {
        return None;
    }
    known
        .map(|k| (distance(word, k), k))
        .filter(|(d, k)| *d <= 1 + k.len() / 4)
        .min()
        .map(|(_, k)| k)
}

/// `; did you mean ...?` if a known word is close to the one given.
pub(super) fn did_you_mean<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    nearest(word, known).map_or_else(String::new, |k| format!("; did you mean `{k}`?"))
}

/// Number of single-letter edits between two words (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b = b.as_bytes();
    let mut row = (0..=b.len()).collect::<Vec<_>>();
    for (i, ca) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(1 + row[j].min(diagonal));
        }
    }
    row[b.len()]
}
