//! Paths as words of a shell.

use std::fmt::Write as _;
use std::path::Path;

/// A path as one word of bash, on one line whatever its name is: nothing in it is ever read as shell.
pub(crate) fn quoted(path: &Path) -> String {
    match path.to_str().filter(|text| !text.contains(char::is_control)) {
        Some(text) => format!("'{}'", text.replace('\'', "'\\''")),
        None => escaped(path.as_os_str().as_encoded_bytes()),
    }
}

/// Bytes as `$'...'` of bash: line breaks, other control characters and bytes that are no text by their numbers.
fn escaped(bytes: &[u8]) -> String {
    let mut word = String::from("$'");
    for byte in bytes {
        match byte {
            b'\'' | b'\\' => {
                word.push('\\');
                word.push(char::from(*byte));
            }
            b' '..=b'~' => word.push(char::from(*byte)),
            // Octal numbers have three digits at the most, and end there.
            _ => _ = write!(word, "\\{byte:03o}"),
        }
    }
    word.push('\'');
    word
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    use std::process::Command;

    #[test]
    fn bash_reads_back_every_name() {
        let names: [&[u8]; 8] = [
            b"plain",
            b"it's a \"name\" with $HOME `id` $(id) \\ ; & | * ?",
            b"-n",
            b"line\nbreak; touch forged",
            b"\x1b[2J\ttab 'quoted\\' 7\n7",
            b"not \xff\xfe text 1\xff1",
            "Größe \u{202e} right to left".as_bytes(),
            b"'",
        ];
        for name in names {
            let word = quoted(Path::new(OsStr::from_bytes(name)));
            assert!(!word.contains('\n'), "{word}");
            let said = Command::new("bash")
                .args(["-c", &format!("printf %s {word}")])
                .output()
                .unwrap();
            assert_eq!(said.stdout, name, "{word}");
        }
    }
}
