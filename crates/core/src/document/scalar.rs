//! Single values of a text file, and the text with others in their places.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::section::float_of;

/// A number, a text or a switch, as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Scalar {
    Switch(bool),
    Whole(i64),
    Number(f64),
    Text(String),
}

impl Scalar {
    /// Number that the value is, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Whole(v) => Some(*v as f64),
            Self::Number(v) => Some(*v),
            Self::Switch(_) | Self::Text(_) => None,
        }
    }

    /// Scalar of a TOML value; `None` for a date, a list or a table.
    pub(super) fn of(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::Boolean(v) => Some(Self::Switch(*v)),
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(Self::Whole),
            DeValue::Float(_) => float_of(value).map(Self::Number),
            DeValue::String(v) => Some(Self::Text(v.to_string())),
            DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => None,
        }
    }

    /// Text of the value as TOML writes it.
    fn toml(&self) -> String {
        match self {
            Self::Switch(v) => toml::Value::Boolean(*v),
            Self::Whole(v) => toml::Value::Integer(*v),
            Self::Number(v) => toml::Value::Float(*v),
            Self::Text(v) => toml::Value::String(v.clone()),
        }
        .to_string()
    }
}

/// Text of the value without quotes.
impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switch(v) => v.fmt(f),
            Self::Whole(v) => v.fmt(f),
            Self::Number(v) => v.fmt(f),
            Self::Text(v) => v.fmt(f),
        }
    }
}

/// Reason why a text cannot have another value at a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoPlace {
    /// Number of the change, in the order in which they were given.
    pub change: usize,
    pub what: String,
    pub hint: String,
}

/// The text of a TOML file with other values at some keys. Keys are named from the top of the file, such as
/// `cell.pitch_nm`; a whole number is the place in a list, from zero: `mark.1.x_um.0`. All else stays as it is.
///
/// # Errors
/// If the text is not TOML, a key is not in it, is there twice among the changes, or holds a list or a table.
pub fn with_values(text: &str, changes: &[(&str, &Scalar)]) -> Result<String, NoPlace> {
    let fault = |change, what: String, hint: String| NoPlace { change, what, hint };
    let table = DeTable::parse(text).map_err(|e| {
        fault(
            0,
            format!("the file is not TOML: {}", e.message().trim()),
            "mend its syntax".into(),
        )
    })?;
    let mut places = Vec::with_capacity(changes.len());
    for (change, (key, value)) in changes.iter().enumerate() {
        let place = find(table.get_ref(), key).map_err(|(what, hint)| fault(change, what, hint))?;
        places.push((place.span(), change, value.toml()));
    }
    places.sort_by_key(|p| p.0.start);
    if let Some(pair) = places.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let key = changes[pair[1].1].0;
        return Err(fault(
            pair[1].1,
            format!("`{key}` has two values"),
            "keep one of the two".into(),
        ));
    }
    let mut changed = text.to_owned();
    for (span, _, value) in places.iter().rev() {
        changed.replace_range(span.clone(), value);
    }
    Ok(changed)
}

/// The single value at a key; what is wrong and what to do.
fn find<'v, 't>(table: &'v DeTable<'t>, key: &str) -> Result<&'v Spanned<DeValue<'t>>, (String, String)> {
    let mut at: Option<&Spanned<DeValue<'_>>> = None;
    let mut above = String::new();
    for part in key.split('.') {
        let place = if above.is_empty() {
            "at the top".to_owned()
        } else {
            format!("in `{above}`")
        };
        let absent = |known: String| {
            let what = format!("there is no `{part}` {place}");
            (
                what,
                format!("known there: {known}; write a key that is left out into the file"),
            )
        };
        let of_table = |table: &'v DeTable<'t>| {
            let known = || {
                table
                    .keys()
                    .map(|k| k.get_ref().as_ref())
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            table.get(part).ok_or_else(|| absent(known()))
        };
        at = Some(match at.map(Spanned::get_ref) {
            None => of_table(table)?,
            Some(DeValue::Table(inner)) => of_table(inner)?,
            Some(DeValue::Array(items)) => part
                .parse()
                .ok()
                .and_then(|k: usize| items.get(k))
                .ok_or_else(|| absent(format!("places from 0 to {}", items.len().saturating_sub(1))))?,
            Some(_) => {
                return Err((format!("`{above}` is a single value"), "end the key there".into()));
            }
        });
        if !above.is_empty() {
            above.push('.');
        }
        above.push_str(part);
    }
    let value = at.expect("a split text has a part");
    match value.get_ref() {
        DeValue::Table(_) => Err((
            format!("`{key}` is a table"),
            "name one of its keys, such as `cell.pitch_nm`".into(),
        )),
        DeValue::Array(_) => Err((
            format!("`{key}` is a list"),
            format!("name one of its places, from zero: `{key}.0`"),
        )),
        _ => Ok(value),
    }
}

/// The bytes of what stands at a key, or at as much of it from the top of the file as is there.
pub(super) fn nearest_span(table: &DeTable<'_>, key: &str) -> Range<usize> {
    let mut parts = key.split('.');
    let mut at = parts.next().and_then(|first| table.get(first));
    let mut span = at.map_or(0..0, Spanned::span);
    for part in parts {
        at = match at.map(Spanned::get_ref) {
            Some(DeValue::Table(inner)) => inner.get(part),
            Some(DeValue::Array(items)) => part.parse().ok().and_then(|place: usize| items.get(place)),
            _ => None,
        };
        let Some(found) = at else { break };
        span = found.span();
    }
    span
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\"   # stays\n[cell]\npitch_nm = 350 # too\nsizes = [1, 2.5]\non = true\n\
                        [[mark]]\nx = { low = 1 }\n[[mark]]\nx = { low = 2 }\n";

    #[test]
    fn values_are_put_in_their_places_and_all_else_stays() {
        let changes = [
            ("mark.1.x.low", Scalar::Whole(-7)),
            ("cell.pitch_nm", Scalar::Number(400.0)),
            ("cell.sizes.1", Scalar::Number(1e-7)),
            ("name", Scalar::Text("b \"c\" \\".into())),
            ("cell.on", Scalar::Switch(false)),
        ];
        let changes: Vec<(&str, &Scalar)> = changes.iter().map(|(k, v)| (*k, v)).collect();
        let changed = with_values(TEXT, &changes).unwrap();
        assert!(
            changed.contains("# stays\n[cell]\npitch_nm = 400.0 # too\n"),
            "{changed}"
        );
        let table: toml::Table = changed.parse().unwrap();
        assert_eq!(table["name"].as_str(), Some("b \"c\" \\"));
        assert_eq!(table["cell"]["sizes"][1].as_float(), Some(1e-7));
        assert_eq!(table["cell"]["on"].as_bool(), Some(false));
        assert_eq!(table["mark"][0]["x"]["low"].as_integer(), Some(1));
        assert_eq!(table["mark"][1]["x"]["low"].as_integer(), Some(-7));
    }

    #[test]
    fn a_key_without_a_place_is_told_with_those_there_are() {
        let told = |key: &str| {
            let fault = with_values(TEXT, &[(key, &Scalar::Whole(1))]).unwrap_err();
            format!("{}; {}", fault.what, fault.hint)
        };
        for (key, part) in [
            ("cell.pitch", "no `pitch` in `cell`; known there: pitch_nm, sizes, on"),
            ("lens.f", "no `lens` at the top; known there: name, cell, mark"),
            ("cell", "is a table"),
            ("cell.sizes", "`cell.sizes.0`"),
            ("cell.sizes.2", "places from 0 to 1"),
            ("cell.pitch_nm.x", "`cell.pitch_nm` is a single value"),
            ("", "no `` at the top"),
        ] {
            assert!(told(key).contains(part), "{key}: {}", told(key));
        }
        let twice = with_values(TEXT, &[("name", &Scalar::Whole(1)), ("name", &Scalar::Whole(2))]);
        assert_eq!(twice.unwrap_err().change, 1);
    }
}
