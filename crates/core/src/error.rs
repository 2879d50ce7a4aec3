//! Everything that can go wrong, in one enum. Each variant says what, where, and what to do.

use std::path::{Path, PathBuf};

use crate::text::{printable, printable_message};

/// Cause of an error, for [`std::error::Error::source`].
pub(crate) type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Result of every fallible operation of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Error of the library. The text of each variant names the place and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// One or more mistakes in a text file that a person wrote (design, rules, process, measurement).
    #[cfg(feature = "documents")]
    #[error("{0}")]
    Text(Box<crate::document::Faults>),

    /// A layout file breaks the GDSII format, or a limit that keeps reading it bounded.
    #[error(
        "{}, byte {offset}: {}\n  help: {}",
        name(path),
        printable_message(what),
        printable_message(hint)
    )]
    Layout {
        path: PathBuf,
        /// Offset of the record at fault from the start of the file.
        offset: u64,
        what: String,
        hint: String,
        /// The error of the crate that reads layouts, which can be matched on.
        source: Option<Cause>,
    },

    /// The operating system refused.
    #[error("cannot {action} {}: {source}{}", name(path), io_hint(source))]
    Io {
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },

    /// A file of numbers (CSV, NPY) that does not hold what was expected.
    #[error("{}{}: {}\n  help: {}", name(path), at_line(*line), printable_message(what), printable_message(hint))]
    Table {
        path: PathBuf,
        /// Line of a text file, counted from one; none for a binary one.
        line: Option<usize>,
        what: String,
        hint: String,
    },

    /// A value that cannot be: out of range, inconsistent, not physical.
    #[error("{}\n  help: {}", printable_message(what), printable_message(hint))]
    Invalid {
        /// The identity of the refusal, `subject/cause`: the text may change, the identity stays.
        id: &'static str,
        what: String,
        hint: String,
        /// The error of the crate that found it, which can be matched on, if it has its own errors.
        source: Option<Cause>,
    },

    /// The user asked to stop. What was complete has been kept, nothing is half written.
    #[error("interrupted; no file is half-written")]
    Interrupted,
}

impl Error {
    /// A value that cannot be, by the identity of the refusal (`subject/cause`), with the remedy.
    pub fn refused(id: &'static str, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Invalid {
            id,
            what: what.into(),
            hint: hint.into(),
            source: None,
        }
    }

    /// A file of numbers that does not hold what was expected, by line, with the remedy.
    pub fn table(path: &Path, line: Option<usize>, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Table {
            path: path.to_owned(),
            line,
            what: what.into(),
            hint: hint.into(),
        }
    }

    /// An operating-system error with what was attempted: `Error::io("write", path)`.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }

    /// The identity of what went wrong, `subject/cause`, for callers and tests: the text may change, the identity stays. Several
    /// mistakes of one text file have identities each, see [`Faults`](crate::Faults).
    pub fn id(&self) -> &'static str {
        match self {
            #[cfg(feature = "documents")]
            Self::Text(_) => "text/mistakes",
            Self::Layout { .. } => "layout/malformed",
            Self::Io { .. } => "file/operation-failed",
            Self::Table { .. } => "table/malformed",
            Self::Invalid { id, .. } => id,
            Self::Interrupted => "run/interrupted",
        }
    }

    /// Identities of all mistakes: [`Fault::id`](crate::Fault::id) of each mistake of a text, else [`Error::id`] alone.
    pub fn ids(&self) -> Vec<String> {
        match self {
            #[cfg(feature = "documents")]
            Self::Text(faults) => faults.faults().iter().map(crate::Fault::id).collect(),
            other => vec![other.id().to_owned()],
        }
    }

    /// True if the error is a text with a mistake of this kind at the key with this path, such as `lens.diameter_um`.
    #[cfg(feature = "documents")]
    pub fn has_fault(&self, kind: crate::FaultKind, key: &str) -> bool {
        matches!(self, Self::Text(faults) if faults.has(kind, key))
    }

    /// Exit code of the program: 2 for bad input, 3 for what could not be done.
    pub fn exit_code(&self) -> u8 {
        match self {
            #[cfg(feature = "documents")]
            Self::Text(_) => 2,
            Self::Layout { .. } | Self::Table { .. } | Self::Invalid { .. } => 2,
            Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Self::Io { .. } | Self::Interrupted => 3,
        }
    }
}

/// Name of a file in one line, whatever it holds.
fn name(path: &Path) -> String {
    printable(&path.to_string_lossy()).into_owned()
}

fn at_line(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!(", line {line}"))
}

fn io_hint(source: &std::io::Error) -> &'static str {
    match source.kind() {
        std::io::ErrorKind::NotFound => {
            "\n  help: check the path; a relative path in a file counts from the folder of that file, another one from the folder where you are"
        }
        std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::ReadOnlyFilesystem => {
            "\n  help: choose a folder that you may write to"
        }
        std::io::ErrorKind::StorageFull => "\n  help: free space or choose another folder; nothing was replaced",
        _ => "",
    }
}
