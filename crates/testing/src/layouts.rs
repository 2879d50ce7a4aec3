//! Layouts of an array in every hierarchy and format, and the pillars that are read back from them.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{Extraction, ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, convert, write_pillars, write_pillars_as};
use tempfile::TempDir;

/// Writes the pillars of a design in each hierarchy and format, and converts each to the other format; all are given to `check`.
pub fn each_layout(folder: &Path, design: &Design, array: &PillarArray, check: impl Fn(&Path)) {
    let oasis = [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest];
    for format in oasis.map(LayoutFormat::Oasis).into_iter().chain([LayoutFormat::Gds]) {
        for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
            let path = folder.join(format!("{hierarchy:?}.{}", format.extension()));
            write_pillars_as(design, array, hierarchy, format, &path, &Silent).unwrap();
            check(&path);
            let other = match format {
                LayoutFormat::Gds => LayoutFormat::Oasis(OasisEncoding::Compact),
                LayoutFormat::Oasis(_) => LayoutFormat::Gds,
            };
            let converted = folder.join(format!("converted.{}", other.extension()));
            convert(&Layout::open(&path).unwrap(), other, &converted, &Silent).unwrap();
            check(&converted);
        }
    }
}

/// A design with its array, and its layout as `lens.gds` in a folder.
pub fn written(design: Design) -> (Design, PillarArray, TempDir) {
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.gds");
    write_pillars(&design, &array, design.layout.hierarchy, &path, &Silent).unwrap();
    (design, array, folder)
}

/// The pillars that a plan reads from a layout: as many as the array has, and nothing else.
pub fn all_pillars(path: &Path, plan: &ExtractionPlan, array: &PillarArray) -> Extraction {
    let read = extract(&Layout::open(path).unwrap(), plan, &Silent).unwrap();
    let found = (read.pillars, read.oddities.total());
    assert_eq!(found, (array.pillars(), 0), "{}", path.display());
    read
}

/// [`all_pillars`], each at its site of the array.
pub fn same_pillars(path: &Path, plan: &ExtractionPlan, array: &PillarArray) -> Extraction {
    let read = all_pillars(path, plan, array);
    assert_eq!(read.elements.len(), array.placed.len(), "{}", path.display());
    for (element, placed) in read.elements.iter().zip(&array.placed) {
        let is_same = element.widths.number == array.widths(placed).number;
        assert!(is_same, "{}, {}", path.display(), placed.element.label());
    }
    read
}

/// The shipped hologram with these elements in place of those shipped, and without its term for single elements.
pub fn hologram_of(elements: &str) -> String {
    let text = std::fs::read_to_string(crate::design("hologram")).unwrap();
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let (_, rest) = rest.split_once("[array]").unwrap();
    let (array, rest) = rest.split_once("[[element]]").unwrap();
    let (_, tail) = rest.split_once("[mapping]").unwrap();
    format!("{head}[array]{array}{elements}\n[mapping]{tail}")
}
