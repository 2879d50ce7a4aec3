//! Text files that people write: TOML with a place for every fault.
//!
//! A [`Document`] is read section by section. A fault (missing, unknown, of the wrong type, out of
//! range) is recorded with its line and column, a harmless value takes the place of the bad one, and
//! reading goes on; [`Document::finish`] then reports all faults at once.

mod fault;
mod section;

pub use fault::{Fault, Faults};
pub use section::{Limits, Section};

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use toml::de::DeTable;

use crate::error::{Error, Result};

/// The text of one file, its parsed table, and the faults found so far.
pub struct Document<'t> {
    path: PathBuf,
    text: &'t str,
    faults: RefCell<Vec<Fault>>,
}

/// Longest text file that is read: a design is a few kilobytes.
const LONGEST: u64 = 4 << 20;

/// The text of a file that a person wrote.
///
/// # Errors
/// If it cannot be read, is longer than 4 MiB, or is not UTF-8.
pub fn load(path: &Path) -> Result<String> {
    let size = std::fs::metadata(path).map_err(Error::io("read", path))?.len();
    if size > LONGEST {
        return Err(Error::invalid(
            format!("{} is {size} bytes long", path.display()),
            "text files of up to 4 MiB are read; is this the right file?",
        ));
    }
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    String::from_utf8(bytes).map_err(|e| Error::Table {
        path: path.to_owned(),
        line: Some(
            1 + e.as_bytes()[..e.utf8_error().valid_up_to()]
                .iter()
                .filter(|&&b| b == b'\n')
                .count(),
        ),
        what: "this is not UTF-8 text".into(),
        hint: "save the file as UTF-8".into(),
    })
}

impl<'t> Document<'t> {
    /// Parse the text of the file at `path` and hand its root section to `read`.
    ///
    /// # Errors
    /// All faults that were found, of syntax or of content, at once.
    pub fn read<T>(path: &Path, text: &'t str, read: impl FnOnce(&Section<'_, '_>) -> T) -> Result<T> {
        let document = Document {
            path: path.to_owned(),
            text,
            faults: RefCell::default(),
        };
        let (table, syntax) = DeTable::parse_recoverable(text);
        for error in &syntax {
            let span = error.span().unwrap_or(0..0);
            document.fault(span, error.message().trim(), "mend the TOML syntax here");
        }
        if !syntax.is_empty() {
            return Err(document.into_error());
        }
        let root = Section::root(&document, &table);
        let value = read(&root);
        root.finish();
        if document.faults.borrow().is_empty() {
            Ok(value)
        } else {
            Err(document.into_error())
        }
    }

    /// Record a fault at a byte range of the text.
    pub fn fault(&self, span: std::ops::Range<usize>, what: impl Into<String>, hint: impl Into<String>) {
        self.faults.borrow_mut().push(Fault {
            span,
            what: what.into(),
            hint: hint.into(),
        });
    }

    /// The folder of the file: relative paths in it count from here.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().map_or_else(PathBuf::new, Path::to_owned)
    }

    fn into_error(self) -> Error {
        let mut faults = self.faults.into_inner();
        faults.sort_by_key(|f| f.span.start);
        Error::Text(Box::new(Faults::new(&self.path, self.text, faults)))
    }
}
