//! Formats of other drawings, named by their first bytes.

use crate::error::LayoutError;

/// Way of a drawing in the binary form of DXF to a layout.
const FROM_BINARY: &str = "save it as DXF in its text form, which is read";

/// Way of a design, or of another text of settings, to a layout.
const FROM_DESIGN: &str = "a layout is wanted here: `metalith layout DESIGN` writes the one of a design";
/// Bytes of a text that are looked at.
const LOOKED_AT: usize = 4096;

/// True if the first line of a text that says anything is a section or a value of TOML.
fn is_toml(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(LOOKED_AT)]);
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with('#'));
    first.is_some_and(|line| {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "_-. ".contains(c);
        let is_section = line.starts_with('[') && line.contains(']');
        is_section || line.split_once('=').is_some_and(|(key, _)| key.chars().all(is_name))
    })
}

/// Error that names the format of a file that begins with these bytes, if it is another than GDSII and OASIS.
pub(super) fn format_of(bytes: &[u8]) -> Option<LayoutError> {
    let (format, remedy) = match bytes {
        _ if bytes.starts_with(b"AutoCAD Binary DXF") => ("the binary form of DXF", FROM_BINARY),
        _ if is_toml(bytes) => ("TOML, as designs are", FROM_DESIGN),
        _ => return None,
    };
    Some(LayoutError::OtherFormat { format, remedy })
}
