//! Kind of a file, by its first bytes.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Kind of a file by its first bytes, if it is not one that a person writes.
pub(super) fn binary_kind(path: &Path) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 6] = [
        (&[0x00, 0x06, 0x00, 0x02], "a layout in GDSII"),
        (b"%SEMI-OASIS", "a layout in OASIS"),
        (b"\x89PNG", "a picture (PNG)"),
        (&[0xff, 0xd8, 0xff], "a picture (JPEG)"),
        (b"\x93NUMPY", "an array (NPY)"),
        (&[0x1f, 0x8b], "compressed (gzip)"),
    ];
    let mut first = Vec::new();
    let file = File::open(path)
        .ok()
        .filter(|f| f.metadata().is_ok_and(|m| m.is_file()))?;
    file.take(16).read_to_end(&mut first).ok()?;
    KINDS
        .iter()
        .find(|(start, _)| first.starts_with(start))
        .map(|(_, kind)| *kind)
}
