//! Mistakes in a text file, each with its place and remedy.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use toml::de::DeTable;

use super::scalar::nearest_span;
use crate::text::{is_printable, printable};

/// Cause of a mistake in a text file. With the key it is the identity of the mistake: the text may change, both stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// Syntax of TOML that is wrong.
    Syntax,
    /// A key that must be there and is not.
    Missing,
    /// A key that no reader asked for.
    Unknown,
    /// A value of another type than the key has.
    WrongType,
    /// A number outside the limits of its key.
    OutOfRange,
    /// A word that is not among the choices of its key.
    UnknownChoice,
    /// A key or a word of an earlier version, which has another name now.
    Renamed,
    /// A list of another length than the key has.
    WrongLength,
    /// A text with characters that no line may hold.
    Unprintable,
    /// A file that is named and is not there.
    NoFile,
    /// A file that is named and cannot be read, or does not hold what it should.
    UnusableFile,
    /// A value that is possible alone and not together with other values, or with what it describes.
    Inconsistent,
}

impl FaultKind {
    /// The word for it in identities of mistakes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Syntax => "syntax",
            Self::Missing => "missing",
            Self::Unknown => "unknown",
            Self::WrongType => "wrong-type",
            Self::OutOfRange => "out-of-range",
            Self::UnknownChoice => "unknown-choice",
            Self::Renamed => "renamed",
            Self::WrongLength => "wrong-length",
            Self::Unprintable => "unprintable",
            Self::NoFile => "no-file",
            Self::UnusableFile => "unusable-file",
            Self::Inconsistent => "inconsistent",
        }
    }
}

/// One mistake: its cause and key, where in the text (bytes), and what to do.
#[derive(Clone, Debug)]
pub struct Fault {
    pub kind: FaultKind,
    /// Path of the key from the top of the file, as `lens.diameter_um`; empty for the file as a whole.
    pub key: String,
    pub span: Range<usize>,
    pub what: String,
    pub hint: String,
}

impl Fault {
    /// Identity of the mistake, `key/cause`, as `lens.diameter_um/out-of-range`; `file/cause` where the file as a whole is at fault.
    pub fn id(&self) -> String {
        let key = match self.key.as_str() {
            "" => "file".into(),
            key => printable(key),
        };
        format!("{key}/{}", self.kind.name())
    }
}

/// Mistakes that are listed; the rest is counted.
const MOST_LISTED: usize = 50;

/// All mistakes of one file, the first 50 of them in words. Its `Display` is one line for each with file, line
/// and column; as a [`miette::Diagnostic`] it shows the text with each place marked.
#[derive(Debug)]
pub struct Faults {
    path: PathBuf,
    source: NamedSource<String>,
    faults: Vec<Fault>,
    total: usize,
    single: Vec<Mark>,
}

/// One fault as a separate diagnostic, shown with the text around it.
#[derive(Debug)]
struct Mark {
    id: String,
    span: Range<usize>,
    what: String,
    hint: String,
}

impl Faults {
    /// Mistakes in the order of the file; `total` counts those that are not in the list too.
    pub fn new(path: &Path, text: &str, faults: Vec<Fault>, total: usize) -> Self {
        let mut faults = faults;
        faults.truncate(MOST_LISTED);
        for fault in &mut faults {
            for words in [&mut fault.what, &mut fault.hint] {
                *words = printable(words).into_owned();
            }
        }
        let single = faults
            .iter()
            .map(|f| Mark {
                id: f.id(),
                span: f.span.clone(),
                what: f.what.clone(),
                hint: f.hint.clone(),
            })
            .collect();
        Self {
            path: path.to_owned(),
            source: NamedSource::new(printable(&path.display().to_string()), drawable(text)),
            faults,
            total,
            single,
        }
    }

    /// Mistakes by the keys of the text that they are at, as [`with_values`](super::with_values) names them, each with what and what
    /// to do. One whose key is not there is placed at the last part of its key that is.
    pub fn at_keys(path: &Path, text: &str, faults: Vec<(String, String, String)>) -> Self {
        let table = DeTable::parse(text).ok();
        let placed = faults.into_iter().map(|(key, what, hint)| Fault {
            kind: FaultKind::Inconsistent,
            span: table.as_ref().map_or(0..0, |table| nearest_span(table.get_ref(), &key)),
            key,
            what,
            hint,
        });
        let mut placed: Vec<_> = placed.collect();
        placed.sort_by_key(|fault| fault.span.start);
        let total = placed.len();
        Self::new(path, text, placed, total)
    }

    /// Number of mistakes, listed or not.
    pub fn count(&self) -> usize {
        self.total
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The first mistakes, in the order of the file: 50 at most.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// True if there is a mistake of this kind at the key with this path from the top of the file.
    pub fn has(&self, kind: FaultKind, key: &str) -> bool {
        self.faults.iter().any(|fault| fault.kind == kind && fault.key == key)
    }

    /// Line and column, both from one, of a byte of the text.
    pub fn line_column(&self, byte: usize) -> (usize, usize) {
        let text = self.source.inner();
        let before = &text[..text.floor_char_boundary(byte.min(text.len()))];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }
}

/// The text as it can be drawn: another character of the same length for each that would change a terminal, so
/// that all places stay.
pub(super) fn drawable(text: &str) -> String {
    text.chars()
        .map(|c| match c.len_utf8() {
            _ if is_printable(c) || matches!(c, '\n' | '\r' | '\t') => c,
            1 => '?',
            2 => '\u{bf}',
            3 => '\u{fffd}',
            _ => '\u{1f5cc}',
        })
        .collect()
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, fault) in self.faults.iter().enumerate() {
            let (line, column) = self.line_column(fault.span.start);
            if k > 0 {
                writeln!(f)?;
            }
            write!(
                f,
                "{}:{line}:{column}: {}\n  help: {}",
                printable(&self.path.to_string_lossy()),
                fault.what,
                fault.hint
            )?;
        }
        match self.total - self.faults.len() {
            0 => Ok(()),
            more => write!(f, "\n{}: {more} more mistakes", printable(&self.path.to_string_lossy())),
        }
    }
}

impl std::error::Error for Faults {}

impl Diagnostic for Faults {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(self.single.iter().map(|m| m as &dyn Diagnostic)))
    }
}

impl fmt::Display for Mark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for Mark {}

impl Diagnostic for Mark {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.id))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.hint))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = LabeledSpan::new_with_span(Some("here".into()), self.span.clone());
        Some(Box::new(std::iter::once(label)))
    }
}
