//! Golden files: what was right once is held to, byte for byte, until someone says otherwise.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use flate2::write::GzEncoder;

/// The root of the project.
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// A design that is shipped.
pub fn design(name: &str) -> PathBuf {
    root().join("designs").join(format!("{name}.toml"))
}

/// A text with the first place of each of these words, all of which it has, changed in turn.
pub fn replaced(text: &str, changes: &[(&str, impl AsRef<str>)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to.as_ref(), 1)
    })
}

/// An NPY file in rows: kind of its numbers and shape as Python writes them, and the numbers.
pub fn npy(kind: &str, shape: &str, numbers: impl IntoIterator<Item = u8>) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    // The numbers begin at a multiple of 64 bytes, the header ends with a new line.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{header:<width$}\n", width = length - 1).bytes());
    bytes.extend(numbers);
    bytes
}

/// Rows of a table of texts: ` | ` stands between fields, `\n` for the end of a line; lines that begin with `# ` are comments.
pub fn rows<const N: usize>(table: &str) -> Vec<[String; N]> {
    let lines = table.lines().filter(|line| !line.is_empty() && !line.starts_with("# "));
    let row = |line: &str| {
        let fields: Vec<String> = line.split(" | ").map(|field| field.replace("\\n", "\n")).collect();
        fields
            .try_into()
            .unwrap_or_else(|_| panic!("{N} fields are wanted: {line}"))
    };
    lines.map(row).collect()
}

/// The text of a shipped design, [`replaced`].
pub fn changed(name: &str, changes: &[(&str, &str)]) -> String {
    replaced(&fs::read_to_string(design(name)).unwrap(), changes)
}

/// A design file in a folder: the small one that is shipped, with an `[optimise]` section.
pub fn optimised(folder: &Path, optimise: &str) -> PathBuf {
    let path = folder.join("lens.toml");
    let text = fs::read_to_string(design("mini_3x3")).unwrap();
    fs::write(&path, format!("{text}\n{optimise}")).unwrap();
    path
}

/// The text of a shipped design that takes its mapping whatever its cell is.
pub fn accepting(text: &str) -> String {
    text.replacen("[mapping]", "[mapping]\naccept = \"a test of another cell\"", 1)
}

/// Compare with `golden/NAME`, kept compressed if the name ends in `.gz`. With `METALITH_GOLDEN=renew` in
/// the environment the file is written instead, and what changed is printed.
pub fn golden(name: &str, found: &[u8]) {
    let path = root().join("golden").join(name);
    let expected = read(&path);
    if expected.as_deref() == Some(found) {
        return;
    }
    let change = describe(expected.as_deref(), found);
    if std::env::var_os("METALITH_GOLDEN").is_some_and(|v| v == "renew") {
        println!("golden/{name}: {change}");
        write(&path, found);
        return;
    }
    panic!("golden/{name}: {change}\nIf this is meant, renew it as golden/README.md says and look at what changed.");
}

fn read(path: &Path) -> Option<Vec<u8>> {
    let bytes = fs::read(path).ok()?;
    if path.extension().is_none_or(|e| e != "gz") {
        return Some(bytes);
    }
    let mut plain = Vec::new();
    GzDecoder::new(&bytes[..]).read_to_end(&mut plain).ok()?;
    Some(plain)
}

fn write(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    if path.extension().is_none_or(|e| e != "gz") {
        return fs::write(path, bytes).unwrap();
    }
    let mut out = GzEncoder::new(fs::File::create(path).unwrap(), flate2::Compression::best());
    out.write_all(bytes).unwrap();
    out.finish().unwrap();
}

/// Place where two files part, in lines if they are text.
fn describe(expected: Option<&[u8]>, found: &[u8]) -> String {
    let Some(expected) = expected else {
        return format!("new, {} bytes", found.len());
    };
    if let (Ok(old), Ok(new)) = (std::str::from_utf8(expected), std::str::from_utf8(found)) {
        let pairs = old.lines().zip(new.lines());
        return pairs.enumerate().find(|(_, (a, b))| a != b).map_or_else(
            || format!("{} lines instead of {}", new.lines().count(), old.lines().count()),
            |(k, (a, b))| format!("line {}:\n  - {a}\n  + {b}", k + 1),
        );
    }
    let at = expected
        .iter()
        .zip(found)
        .position(|(a, b)| a != b)
        .unwrap_or(expected.len().min(found.len()));
    format!(
        "{} bytes instead of {}, the first difference at byte {at}",
        found.len(),
        expected.len()
    )
}
