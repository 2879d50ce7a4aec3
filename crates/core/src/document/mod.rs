//! Text files that people write: TOML with a place for every fault.
//!
//! A [`Document`] is read section by section. A fault (missing, unknown, of the wrong type, out of
//! range) is recorded with its line and column, a value inside the limits takes the place of the bad one, and
//! reading goes on; at its end all faults are reported at once. What depends on a value with a fault is not judged:
//! it would be a second fault for one mistake, and its advice would be wrong.

mod binary_kind;
mod fault;
mod keys;
mod renamed;
mod scalar;
mod section;

pub use fault::{Fault, FaultKind, Faults};
pub use keys::{Forms, Key, KeyTable, ListForm, OtherKeys, explore};
pub use renamed::renamed;
pub use scalar::{NoPlace, Scalar, with_values};
pub use section::{Limits, Section};

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::de::DeTable;

use binary_kind::binary_kind;

use crate::error::{Error, Result};
use crate::text::printable_message;

/// The text of one file, its parsed table, and the faults found so far.
pub struct Document<'t> {
    path: PathBuf,
    text: &'t str,
    /// Faults in order; `None` where a fault turned out to be part of another.
    faults: RefCell<Vec<Option<Fault>>>,
    /// Faults found after the list was full.
    more: Cell<usize>,
    /// Paths of values with a fault, and of those among them that another value stands in for.
    doubted: RefCell<HashSet<String>>,
    replaced: RefCell<HashSet<String>>,
    /// Files that keys name: path of the key, its place in the text, and the file.
    named: RefCell<Vec<(String, Range<usize>, PathBuf)>>,
    /// Keys that the reader asks for, where they are noted.
    noted: Option<RefCell<KeyTable>>,
}

/// Longest text file that is read: a design is a few kilobytes.
const LONGEST: u64 = 4 << 20;

/// Faults that are held; the rest is counted.
const MOST_HELD: usize = 1000;

/// The text of a file that a person wrote.
///
/// # Errors
/// If it cannot be read, is longer than 4 MiB, or is not UTF-8. Of a file of another kind it is said what it is.
pub fn load(path: &Path) -> Result<String> {
    load_text(path).map_err(|error| match binary_kind(path) {
        Some(kind) => Error::refused(
            "file/not-text",
            format!("{} is {kind}, and a text file is needed here", path.display()),
            "check which file is given where: `--help` says the order",
        ),
        None => error,
    })
}

fn load_text(path: &Path) -> Result<String> {
    let bytes = crate::file::read_at_most(path, LONGEST, "a text that a person wrote")?;
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
    /// If the syntax is wrong, the first place where it is: what follows may be read in another sense than it was
    /// written in. Else all faults of content, at once.
    pub fn read<T>(path: &Path, text: &'t str, read: impl FnOnce(&Section<'_, '_>) -> T) -> Result<T> {
        let (value, _) = Self::new(path, text, None).read_by(read);
        value
    }

    /// Variant of [`Document::read`] that notes the keys that the reader asks for.
    fn read_noting<T>(path: &Path, text: &'t str, read: impl FnOnce(&Section<'_, '_>) -> T) -> (Result<T>, KeyTable) {
        Self::new(path, text, Some(RefCell::default())).read_by(read)
    }

    fn new(path: &Path, text: &'t str, noted: Option<RefCell<KeyTable>>) -> Self {
        Document {
            path: path.to_owned(),
            text,
            faults: RefCell::default(),
            more: Cell::default(),
            doubted: RefCell::default(),
            replaced: RefCell::default(),
            named: RefCell::default(),
            noted,
        }
    }

    /// Hand the root section to `read`, and give what it returns or all faults, and the keys that it asked for if they are noted.
    fn read_by<T>(mut self, read: impl FnOnce(&Section<'_, '_>) -> T) -> (Result<T>, KeyTable) {
        let value = self.value(read);
        let noted = self.noted.take().map(RefCell::into_inner).unwrap_or_default();
        let result = match value {
            Some(value) if self.is_faultless() => Ok(value),
            _ => Err(self.into_error()),
        };
        (result, noted)
    }

    /// Value that `read` makes of the root section; `None` where the syntax is wrong.
    fn value<T>(&self, read: impl FnOnce(&Section<'_, '_>) -> T) -> Option<T> {
        let table = match DeTable::parse(self.text) {
            Ok(table) => table,
            Err(error) => {
                let span = error.span().unwrap_or(0..0);
                self.fault(
                    FaultKind::Syntax,
                    String::new(),
                    span,
                    error.message().trim(),
                    "mend the TOML syntax here or just before",
                );
                return None;
            }
        };
        let root = Section::root(self, &table);
        let value = read(&root);
        root.finish();
        Some(value)
    }

    /// Record a fault of the value at a key, at a byte range of the text. Its number, if it is held and not only counted.
    pub fn fault(
        &self,
        kind: FaultKind,
        key: String,
        span: Range<usize>,
        what: impl Into<String>,
        hint: impl Into<String>,
    ) -> Option<usize> {
        if self.is_full() {
            self.count_one_more();
            return None;
        }
        let mut faults = self.faults.borrow_mut();
        faults.push(Some(Fault {
            kind,
            key,
            span,
            // An error of another file has its own remedy, in a separate line.
            what: printable_message(&what.into().replace("\n  help: ", "; ")).into_owned(),
            hint: printable_message(&hint.into()).into_owned(),
        }));
        Some(faults.len() - 1)
    }

    /// The folder of the file: relative paths in it count from here.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().map_or_else(PathBuf::new, Path::to_owned)
    }

    /// Record at a key, whose path this is, that the file that it names cannot be used; once for each key. The key names a file
    /// nevertheless: it is in no doubt.
    fn unusable_file(&self, key: &str, span: Range<usize>, error: &Error) {
        let faults = self.faults.borrow();
        let mut there = faults.iter().flatten();
        let is_known = there.any(|fault| fault.kind == FaultKind::UnusableFile && fault.key == key);
        drop(faults);
        if is_known || !self.is_sound(key) {
            return;
        }
        let words = error.to_string();
        let (what, hint) = words
            .split_once("\n  help: ")
            .unwrap_or((&words, "mend the file, or name another"));
        let name = key.rsplit('.').next().unwrap_or_default();
        self.fault(
            FaultKind::UnusableFile,
            key.to_owned(),
            span,
            format!("`{name}`: {what}"),
            hint,
        );
    }

    /// True if no value in a section has a fault, other than names of files.
    fn is_sound_within(&self, section: &str) -> bool {
        let (doubted, named) = (self.doubted.borrow(), self.named.borrow());
        let is_within = |path: &str| {
            let rest = path.strip_prefix(section);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '#']))
        };
        let is_file = |path: &str| named.iter().any(|(key, ..)| key == path);
        !doubted.iter().any(|path| is_within(path) && !is_file(path))
    }

    /// True if further faults are only counted.
    fn is_full(&self) -> bool {
        self.faults.borrow().len() >= MOST_HELD
    }

    fn count_one_more(&self) {
        self.more.set(self.more.get() + 1);
    }

    /// A fault turned out to be part of another.
    fn withdraw(&self, number: usize) {
        self.faults.borrow_mut()[number] = None;
    }

    /// The value at a path has a fault.
    fn doubt(&self, path: String) {
        self.doubted.borrow_mut().insert(path);
    }

    /// Another value stands in for the one at a path.
    fn replace(&self, path: String) {
        self.doubt(path.clone());
        self.replaced.borrow_mut().insert(path);
    }

    fn is_replaced(&self, path: &str) -> bool {
        self.replaced.borrow().contains(path)
    }

    /// True if neither the value at a path nor any section that contains it has a fault.
    fn is_sound(&self, path: &str) -> bool {
        let doubted = self.doubted.borrow();
        let sections = path.match_indices('.').map(|(end, _)| &path[..end]);
        !sections.chain([path]).any(|p| doubted.contains(p))
    }

    fn is_faultless(&self) -> bool {
        self.more.get() == 0 && self.faults.borrow().iter().all(Option::is_none)
    }

    fn into_error(self) -> Error {
        let mut faults: Vec<Fault> = self.faults.into_inner().into_iter().flatten().collect();
        faults.sort_by_key(|f| f.span.start);
        let total = faults.len() + self.more.get();
        Error::Text(Box::new(Faults::new(&self.path, self.text, faults, total)))
    }
}

#[cfg(test)]
mod tests;
