//! Standard output and standard error. Answers go to standard output, and whoever reads them may stop reading. Both hold nothing that
//! a text from a stranger could change a terminal by: what is not printable is written as `\u{1b}`.

use std::borrow::Cow;
use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::sync::OnceLock;

use metalith::text::{printable, printable_json, printable_lines};
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

/// Write one line to standard output, as `println!` does, but without a panic where nobody reads it any more. A line break in a
/// name is written out: it would begin a line that the program did not say.
macro_rules! print_line {
    ($($part:tt)*) => { $crate::cli::output::line(format_args!($($part)*)) };
}
pub(super) use print_line;

/// Write a value as indented JSON and a line break.
pub(crate) fn print_json(value: &impl Serialize) {
    let text = serde_json::to_string_pretty(value).expect("plain data serialises");
    write(&printable_json(&text));
}

/// True if the path of an output means standard output.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Prints a line, for [`print_line!`].
pub(crate) fn line(text: Arguments<'_>) {
    write(&printable(&text.to_string()));
}

/// Write a text of several lines, of which the parts that strangers chose have none, to standard output, and a line break.
pub(crate) fn print_text(text: &str) {
    write(&printable_lines(text));
}

fn write(printable: &str) {
    let mut out = stdout().lock();
    let written = out
        .write_all(shown(printable.to_owned()).as_bytes())
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush());
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = FAILED.set(error.to_string());
    }
}

/// Write a text to standard error, as `eprint!` does, but without a panic where it cannot be written: what it says is no answer.
pub(crate) fn tell(text: &str) {
    let _ = stderr()
        .lock()
        .write_all(printable_lines(&shown(text.to_owned())).as_bytes());
}

/// Variant of [`tell`] for a text that is drawn with colours: as it is if `plain`, the same without colours, is printable.
pub(crate) fn tell_drawn(drawn: &str, plain: &str) {
    match printable_lines(plain) {
        Cow::Borrowed(_) => {
            let _ = stderr().lock().write_all(shown(drawn.to_owned()).as_bytes());
        }
        Cow::Owned(printable) => tell(&printable),
    }
}

/// Reason why something that was to be printed is not, if so. A closed pipe is no failure.
pub(crate) fn failure() -> Option<&'static str> {
    FAILED.get().map(String::as_str)
}
