//! The numbers of a report for programs.

use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use metalith_core::AtomicFile;
use metalith_core::text::printable_json;
use metalith_core::{Error, Result};

/// Write `report.json`: the fields of `numbers`, led by `report` (which command's numbers these are) and
/// `metalith` (the version that made them). Numbers that are not finite become `null`.
///
/// # Errors
/// If the file cannot be written, or `numbers` is not a map of fields.
pub fn write_json(path: &Path, report: &str, numbers: &impl Serialize) -> Result<()> {
    let fields = serde_json::to_value(numbers).map_err(|e| {
        Error::refused(
            "internal/serialisation-failed",
            format!("numbers of {report} have no JSON: {e}"),
            "report this as a bug",
        )
    })?;
    let Value::Object(fields) = fields else {
        return Err(Error::refused(
            "internal/serialisation-failed",
            format!("numbers of {report} are not a map of fields"),
            "report this as a bug",
        ));
    };
    let mut whole = Map::new();
    whole.insert("report".into(), report.into());
    whole.insert("metalith".into(), env!("CARGO_PKG_VERSION").into());
    whole.extend(fields);
    let mut text = format!("{:#}", Value::Object(whole));
    text.push('\n');
    AtomicFile::write(path, printable_json(&text).as_bytes())
}

/// Write values as an indented JSON file, as they are.
///
/// # Errors
/// If the file cannot be written.
///
/// # Panics
/// If the values have no JSON: a map whose keys are not texts.
pub fn write_plain_json(path: &Path, values: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(values).expect("plain data serialises");
    text.push('\n');
    AtomicFile::write(path, printable_json(&text).as_bytes())
}

/// Words for a number, or for lists of numbers, to four digits.
pub fn number_words(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(number_words).collect::<Vec<_>>().join(", ")),
        Value::Number(n) => crate::sig(n.as_f64().unwrap_or(f64::NAN), 4),
        other => other.to_string(),
    }
}

/// Clause for an effect: its values with their unit and intervals.
pub fn effect_words(name: &str, value: &Value, unit: &str, interval: &Value) -> String {
    let space = if unit.is_empty() { "" } else { " " };
    let [value, interval] = [value, interval].map(number_words);
    format!("{name} = {value}{space}{unit}, interval {interval}")
}
