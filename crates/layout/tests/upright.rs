//! Layouts of upright rectangles: written in both formats and all hierarchies, read back as given and as found.

use std::collections::BTreeMap;
use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_gds::extract::ExtractionPlan;
use metalith_layout::extraction_plan;
use metalith_pillars::PillarMap;
use metalith_testing::design;
use metalith_testing::layouts::{all_pillars, each_layout};

fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = path.display();
    let pillars = design.cell.shape.upright().unwrap();
    for plan in [
        extraction_plan(design),
        ExtractionPlan::discover(design.layout.layers.pillars.number()),
    ] {
        let read = all_pillars(path, &plan, array);
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
    each_layout(folder.path(), &design, &array, |path| holds(path, &design, &array));
}
