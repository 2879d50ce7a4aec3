//! Formats of other drawings, named by their first bytes.

use crate::error::LayoutError;

/// Way of a drawing in DXF to GDSII.
const FROM_DXF: &str = "bring it over with KLayout: File, Open, options of DXF with a database unit of 0.001 um and the \
    unit of the drawing, then File, Save As GDS2; closed polylines become polygons";

/// Error that names the format of a file that begins with these bytes, if it is another than GDSII and OASIS.
pub(super) fn format_of(bytes: &[u8]) -> Option<LayoutError> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let binary = text.starts_with(b"AutoCAD Binary DXF");
    let mut lines = text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    // Pairs of a code and a value; comments have the code 999.
    let is_dxf = loop {
        match (lines.next(), lines.next()) {
            (Some(b"999"), Some(_)) => {}
            (Some(b"0"), Some(b"SECTION")) => break true,
            _ => break false,
        }
    };
    (binary || is_dxf).then_some(LayoutError::OtherFormat {
        format: "DXF",
        remedy: FROM_DXF,
    })
}
