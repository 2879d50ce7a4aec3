//! Standard output: answers go there, and whoever reads them may stop reading.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::sync::OnceLock;

use serde::Serialize;

/// Reason why standard output took no more, if not because its reader had enough.
static FAILED: OnceLock<String> = OnceLock::new();

/// Folder of the copy of standard input, with its separator.
static COPIED_TO: OnceLock<String> = OnceLock::new();

/// Show the copy of standard input in this folder by its name alone.
pub(crate) fn hide_folder(folder: &Path) {
    let _ = COPIED_TO.set(folder.join("").display().to_string());
}

/// A text as a user reads it: paths of copies as the names of what was copied.
pub(crate) fn shown(text: String) -> String {
    match COPIED_TO.get() {
        Some(folder) if text.contains(folder) => text.replace(folder, ""),
        _ => text,
    }
}

/// Write one line to standard output, as `println!` does, but without a panic where nobody reads it any more.
macro_rules! print_line {
    ($($part:tt)*) => { $crate::cli::output::line(format_args!($($part)*)) };
}
pub(super) use print_line;

/// Write a value as indented JSON and a line break.
pub(crate) fn print_json(value: &impl Serialize) {
    let text = serde_json::to_string_pretty(value).expect("plain data serialises");
    line(format_args!("{text}"));
}

/// True if the path of an output means standard output.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Prints a line, for [`print_line!`].
pub(crate) fn line(text: Arguments<'_>) {
    let mut out = stdout().lock();
    let text = match COPIED_TO.get() {
        Some(_) => out.write_all(shown(text.to_string()).as_bytes()),
        None => out.write_fmt(text),
    };
    let written = text.and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush());
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = FAILED.set(error.to_string());
    }
}

/// Write a text to standard error, as `eprint!` does, but without a panic where it cannot be written: what it says is no answer.
pub(crate) fn tell(text: &str) {
    let _ = stderr().lock().write_all(shown(text.to_owned()).as_bytes());
}

/// Reason why something that was to be printed is not, if so. A closed pipe is no failure.
pub(crate) fn failure() -> Option<&'static str> {
    FAILED.get().map(String::as_str)
}
