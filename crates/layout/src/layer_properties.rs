//! A KLayout layer-properties file, so that a layout opens with names and colours.

use std::fmt::Write;
use std::path::Path;

use metalith_core::{AtomicFile, Result};
use metalith_design::Design;

/// Frame and fill colour and dither pattern of each layer, in the order of [`metalith_design::Layers::all`]:
/// exposed layers are filled, the others only drawn.
const LOOKS: [(&str, &str); 6] = [
    ("#0072b2", "I0"),
    ("#56b4e9", "I0"),
    ("#e69f00", "I5"),
    ("#d55e00", "I0"),
    ("#666666", "I1"),
    ("#009e73", "I1"),
];

/// Write the `.lyp` file of a design.
///
/// # Errors
/// If the file cannot be written; the old file is then as it was.
pub fn write_layer_properties(design: &Design, path: &Path) -> Result<()> {
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<layer-properties>\n");
    for ((key, layer), (colour, dither)) in design.layout.layers.all().iter().zip(LOOKS) {
        let name = escape(&format!("{key}: {}", layer.purpose));
        let (number, datatype) = (layer.layer, layer.datatype);
        write!(
            xml,
            " <properties>\n  <frame-color>{colour}</frame-color>\n  <fill-color>{colour}</fill-color>\n  \
             <frame-brightness>0</frame-brightness>\n  <fill-brightness>0</fill-brightness>\n  \
             <dither-pattern>{dither}</dither-pattern>\n  <valid>true</valid>\n  <visible>true</visible>\n  \
             <transparent>false</transparent>\n  <width>1</width>\n  <marked>false</marked>\n  \
             <animation>0</animation>\n  <name>{name}</name>\n  <source>{number}/{datatype}@1</source>\n </properties>\n"
        )
        .expect("a string grows");
    }
    xml.push_str("</layer-properties>\n");
    AtomicFile::write(path, xml.as_bytes())
}

/// Text as it may stand between XML tags.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
