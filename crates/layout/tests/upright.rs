//! Layouts of upright rectangles: written in both formats and all hierarchies, read back as given and as found.

use std::collections::BTreeMap;
use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, convert, extraction_plan, write_pillars_as};
use metalith_pillars::PillarMap;
use metalith_testing::design;

fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = path.display();
    let layout = Layout::open(path).unwrap();
    let pillars = design.cell.shape.upright().unwrap();
    for plan in [
        extraction_plan(design),
        ExtractionPlan::discover(design.layout.layers.pillars.number()),
    ] {
        let read = extract(&layout, &plan, &Silent).unwrap();
        assert_eq!((read.pillars, read.oddities.total()), (array.pillars(), 0), "{name}");
        // A layout from anywhere has the lengths that occur; edges are what counts.
        let found = read.shape.upright();
        let found = found.unwrap_or_else(|| panic!("{name}: {:?}", read.shape));
        for (element, placed) in read.elements.iter().zip(&array.placed) {
            // Where a lens has no pillar in the outermost sites, fewer are found.
            let edges = |map: &PillarMap, of: &dyn Fn(u16) -> [u16; 2]| -> BTreeMap<[i64; 2], [u16; 2]> {
                let there = map.number.indexed_iter().filter(|(_, number)| **number > 0);
                let place = |iy, ix| [map.lattice.whole_nm(0, ix), map.lattice.whole_nm(1, iy)];
                there.map(|((iy, ix), number)| (place(iy, ix), of(*number))).collect()
            };
            let written = edges(&array.widths(placed), &|number| pillars.edges_nm(number));
            assert!(
                edges(&element.widths, &|number| found.edges_nm(number)) == written,
                "{name}"
            );
        }
    }
}

#[test]
fn what_is_written_is_read_in_every_hierarchy_and_format() {
    let design = Design::read(&design("birefringent_532")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (gds, oasis) = (folder.path().join("pillars.gds"), folder.path().join("pillars.oas"));
    for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
        write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &gds, &Silent).unwrap();
        holds(&gds, &design, &array);
    }
    for encoding in [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest] {
        for hierarchy in [Hierarchy::Folded, Hierarchy::Flat] {
            let format = LayoutFormat::Oasis(encoding);
            write_pillars_as(&design, &array, hierarchy, format, &oasis, &Silent).unwrap();
            holds(&oasis, &design, &array);
        }
    }
    convert(&Layout::open(&oasis).unwrap(), LayoutFormat::Gds, &gds, &Silent).unwrap();
    holds(&gds, &design, &array);
}
