//! The numbers of a report for programs.

use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use metalith_core::AtomicFile;
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
    AtomicFile::write(path, text.as_bytes())
}
