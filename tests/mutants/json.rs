//! Damage to JSON after which it is JSON still.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::damage::{VALUES, text};

/// Damage to the words of JSON, or to its values: then it stays JSON, and its reader goes on to judge what it says. `is_lines` if each
/// line is a document.
pub(crate) fn text_or_json(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>], is_lines: bool) -> Vec<u8> {
    if rng.random_range(0..2) == 0 {
        return text(rng, corpus);
    }
    let whole = std::str::from_utf8(&corpus[rng.random_range(0..corpus.len())]).expect("an original is text");
    if !is_lines {
        return format!("{:#}\n", json(rng, whole)).into_bytes();
    }
    let mut lines: Vec<_> = whole.lines().map(str::to_owned).collect();
    let at = rng.random_range(0..lines.len());
    lines[at] = json(rng, &lines[at]).to_string();
    (lines.join("\n") + "\n").into_bytes()
}

/// A JSON document of which some values are others, stand at other places, or are missing.
fn json(rng: &mut ChaCha8Rng, text: &str) -> Value {
    let mut all: Value = serde_json::from_str(text).expect("an original is JSON");
    for _ in 0..rng.random_range(1..=3) {
        let mut places = vec![String::new()];
        pointers(&all, "", &mut places);
        let any = |rng: &mut ChaCha8Rng| places[rng.random_range(0..places.len())].clone();
        let (at, other) = (any(rng), any(rng));
        match rng.random_range(0..8) {
            0 => {
                let (parent, key) = at.rsplit_once('/').unwrap_or_default();
                match all.pointer_mut(parent) {
                    Some(Value::Object(fields)) => drop(fields.remove(key)),
                    Some(Value::Array(entries)) if !entries.is_empty() => {
                        entries.remove(key.parse::<usize>().unwrap_or(0).min(entries.len() - 1));
                    }
                    _ => {}
                }
            }
            1 | 2 => {
                let value = all.pointer(&other).cloned().unwrap_or_default();
                if let Some(to) = all.pointer_mut(&at) {
                    *to = value;
                }
            }
            _ => {
                let word = VALUES[rng.random_range(0..VALUES.len())];
                let value: Value = serde_json::from_str(word).unwrap_or_else(|_| word.into());
                if let Some(to) = all.pointer_mut(&at) {
                    *to = value;
                }
            }
        }
    }
    all
}

/// Places of all values below one.
fn pointers(value: &Value, at: &str, out: &mut Vec<String>) {
    let below: Vec<(String, &Value)> = match value {
        Value::Object(fields) => fields.iter().map(|(key, v)| (key.clone(), v)).collect(),
        Value::Array(entries) => entries.iter().enumerate().map(|(k, v)| (k.to_string(), v)).collect(),
        _ => Vec::new(),
    };
    for (key, value) in below {
        let own = format!("{at}/{}", key.replace('~', "~0").replace('/', "~1"));
        pointers(value, &own, out);
        out.push(own);
    }
}
