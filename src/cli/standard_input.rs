//! `-` as the name of an input: what another program pipes in.

use std::fs::File;
use std::io::{self, Read};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use metalith::file::settled;
use metalith::layout::{LayoutFormat, convert};
use metalith::{Design, Error, Result, Silent};
use tempfile::TempDir;

use super::Terminal;
use super::reading::FileArgs;

/// Name of standard input in messages.
const NAME: &str = "standard input";

/// Most bytes of a design that is piped in: thousands of times what a person writes.
const LONGEST_DESIGN: u64 = 16 << 20;

fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Reason why a plan names its files.
pub(crate) const OF_PLANS: [&str; 2] = ["a plan", "each shard reads it again"];

/// Refuse standard input for files that are read again by their names.
///
/// # Errors
/// If one of these is `-`.
pub(crate) fn named<'p>([what, why]: [&str; 2], paths: impl IntoIterator<Item = &'p Path>) -> Result<()> {
    if paths.into_iter().any(is_standard_input) {
        Err(Error::refused(
            "option/plan-from-standard-input",
            format!("{what} cannot use a file from standard input"),
            format!("name the file: {why}"),
        ))
    } else {
        Ok(())
    }
}

/// Standard input, which ends where it has been read once.
fn take() -> Result<io::StdinLock<'static>> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return Err(Error::refused(
            "option/two-on-standard-input",
            "`-` (standard input) is given for two files",
            "give one of them as `-`, and the others by their names",
        ));
    }
    Ok(io::stdin().lock())
}

/// A file that is read: that of its path, or for `-` a copy of standard input, which is removed with this. Layouts are read
/// more than once and from many places, which a pipe cannot.
pub(crate) struct InputFile {
    path: PathBuf,
    _copy: Option<TempDir>,
}

impl InputFile {
    /// The file at `path`; waits for the end of standard input where that is meant.
    ///
    /// # Errors
    /// If there is no room for the copy in the folder of temporary files, or what a killed run left beside the file cannot be
    /// finished.
    pub(crate) fn of(path: &Path) -> Result<Self> {
        if !is_standard_input(path) {
            settled(path, &Silent)?;
            return Ok(Self {
                path: path.to_owned(),
                _copy: None,
            });
        }
        let mut input = take()?;
        let folder = TempDir::new().map_err(Error::io("create a folder in", &std::env::temp_dir()))?;
        super::output::hide_folder(folder.path());
        let path = folder.path().join(NAME);
        let copied = File::create(&path).and_then(|mut copy| io::copy(&mut input, &mut copy));
        copied.map_err(Error::io("copy standard input to", &path))?;
        Ok(Self {
            path,
            _copy: Some(folder),
        })
    }

    /// The layout below the cell that is asked for, in a copy that is removed with this; the file as it is if none is.
    ///
    /// # Errors
    /// If it cannot be read or has no such cell, or there is no room for the copy.
    pub(crate) fn below(self, reading: &FileArgs, terminal: &Terminal) -> Result<Self> {
        if reading.top.is_none() {
            reading.apply(terminal);
            return Ok(self);
        }
        let layout = reading.open(&self, terminal)?;
        let folder = TempDir::new().map_err(Error::io("create a folder in", &std::env::temp_dir()))?;
        let path = folder.path().join(self.file_name().unwrap_or_else(|| NAME.as_ref()));
        convert(&layout, LayoutFormat::of_name(&path), &path, terminal)?;
        Ok(Self {
            path,
            _copy: Some(folder),
        })
    }
}

impl Deref for InputFile {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

/// The design at `path`, or for `-` that of standard input; files that such a one names count from the current folder.
///
/// # Errors
/// As [`Design::read`]; also if standard input is no text, or too long.
pub(crate) fn design(path: &Path, terminal: &Terminal) -> Result<Design> {
    let design = if is_standard_input(path) {
        Design::parse_with(Path::new(NAME), &design_text()?, terminal)
    } else {
        Design::read_with(path, terminal)
    };
    terminal.clear();
    design
}

/// Variant of [`design`] for a caller that makes the library of its pillars, which need not be there yet.
///
/// # Errors
/// As [`design`].
pub(crate) fn design_without_library(path: &Path) -> Result<Design> {
    if is_standard_input(path) {
        Design::parse_without_library(Path::new(NAME), &design_text()?)
    } else {
        Design::read_without_library(path)
    }
}

/// The text of a design on standard input.
fn design_text() -> Result<String> {
    let name = Path::new(NAME);
    let mut text = String::new();
    let read = take()?.take(LONGEST_DESIGN + 1).read_to_string(&mut text);
    read.map_err(Error::io("read", name))?;
    if text.len() as u64 > LONGEST_DESIGN {
        return Err(Error::refused(
            "design/too-long",
            format!("a design of more than {LONGEST_DESIGN} bytes on standard input"),
            "pipe in the text of a design file",
        ));
    }
    Ok(text)
}
