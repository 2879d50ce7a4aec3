//! Formats of other drawings, named by their first bytes.

use crate::error::LayoutError;

/// Way of a drawing in the binary form of DXF to a layout.
const FROM_BINARY: &str = "save it as DXF in its text form, which is read";

/// Error that names the format of a file that begins with these bytes, if it is another than GDSII and OASIS.
pub(super) fn format_of(bytes: &[u8]) -> Option<LayoutError> {
    bytes
        .starts_with(b"AutoCAD Binary DXF")
        .then_some(LayoutError::OtherFormat {
            format: "the binary form of DXF",
            remedy: FROM_BINARY,
        })
}
