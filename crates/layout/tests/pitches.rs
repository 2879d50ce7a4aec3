//! Any pitch on any database unit: what is written is read back from both formats, at the places of the lattice.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, convert, extraction_plan, write_apertures_as, write_pillars_as};
use metalith_testing::design;

/// A row of three lenses: one that folds by all its symmetries, two that fold by one.
fn design_of(cell: &str) -> Design {
    let path = design("mini_3x3");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = metalith_testing::accepting(&text)
        .replacen("database_unit_nm = 1\n", "", 1)
        .replacen("elements = [3, 3]", "elements = [3, 1]", 1)
        .replacen("diameter_um = 60", "diameter_um = 20", 1);
    let own: Vec<&str> = cell.lines().filter_map(|line| line.split(' ').next()).collect();
    let is_own = |line: &&str| !own.contains(&line.split(' ').next().unwrap_or_default());
    let text: Vec<&str> = text.lines().filter(is_own).collect();
    let text = text.join("\n").replacen("[cell]\n", &format!("[cell]\n{cell}"), 1);
    Design::parse(&path, &text).unwrap()
}

/// Checks a layout, read as one of its design and, where no place is rounded, as one from anywhere.
fn holds(path: &Path, design: &Design, array: &PillarArray) {
    let name = format!("{} of {} nm", path.display(), design.cell.pitch_nm);
    let layout = Layout::open(path).unwrap();
    assert_eq!(layout.unit_nm(), design.cell.database_unit.nm(), "{name}");
    let mut plans = vec![extraction_plan(design)];
    if design.lattice().rounding_nm() == 0.0 {
        plans.push(ExtractionPlan::discover(design.layout.layers.pillars.number()));
    }
    for plan in plans {
        let read = extract(&layout, &plan, &Silent).unwrap();
        assert_eq!((read.pillars, read.oddities.total()), (array.pillars(), 0), "{name}");
        for (element, placed) in read.elements.iter().zip(&array.placed) {
            assert_eq!(element.site.lattice.pitch_nm(), design.cell.pitch_nm, "{name}");
            let written = array.widths(placed);
            let places = |map: &metalith_pillars::PillarMap| {
                let there = map.number.indexed_iter().filter(|(_, width)| **width > 0);
                let place = |iy, ix| [map.lattice.place_units(0, ix), map.lattice.place_units(1, iy)];
                there
                    .map(|((iy, ix), width)| (place(iy, ix), *width))
                    .collect::<std::collections::BTreeMap<_, _>>()
            };
            assert_eq!(places(&element.widths), places(&written), "{name}");
        }
    }
}

#[test]
fn pitches_of_published_lenses_are_read_back_from_every_hierarchy_and_format() {
    let even = "width_min_nm = 90\nwidth_max_nm = 320\n";
    let odd = "width_min_nm = 91\nwidth_max_nm = 361\nwidth_step_nm = 1\n";
    for cell in [
        format!("pitch_nm = 325\n{even}"),
        format!("pitch_nm = 351\ndatabase_unit_nm = 0.5\n{}", odd.replace("361", "341")),
        format!("pitch_nm = 433.3\ndatabase_unit_nm = 0.1\nshape = \"circle\"\n{odd}"),
        format!("pitch_nm = 350.25\ndatabase_unit_nm = 0.25\n{even}"),
        format!("pitch_nm = 325\ndatabase_unit_nm = 0.5\nlattice = \"hexagonal\"\nshape = \"circle\"\n{even}"),
        // Places that the grid does not hold.
        format!("pitch_nm = 433.3\n{}", even.replace("320", "420")),
        format!("pitch_nm = 325\nlattice = \"hexagonal\"\nshape = \"circle\"\n{even}"),
    ] {
        let design = design_of(&cell);
        let array = PillarArray::build(&design, &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let gds = folder.path().join("pitch.gds");
        for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
            write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &gds, &Silent).unwrap();
            holds(&gds, &design, &array);
        }
        let oasis = folder.path().join("pitch.oas");
        for encoding in [OasisEncoding::Compact, OasisEncoding::Plain, OasisEncoding::Smallest] {
            let format = LayoutFormat::Oasis(encoding);
            write_pillars_as(&design, &array, Hierarchy::Folded, format, &oasis, &Silent).unwrap();
            holds(&oasis, &design, &array);
        }
        let converted = folder.path().join("converted.gds");
        convert(&Layout::open(&oasis).unwrap(), LayoutFormat::Gds, &converted, &Silent).unwrap();
        holds(&converted, &design, &array);
        let is_rounded = design.lattice().rounding_nm() > 0.0;
        let warned = design
            .warnings()
            .unwrap()
            .iter()
            .any(|w| w.id == "layout/rounded-places");
        assert_eq!(warned, is_rounded, "{cell}");
        // Openings keep their size.
        let openings = folder.path().join("openings.gds");
        write_apertures_as(&design, LayoutFormat::Gds, &openings).unwrap();
        assert_eq!(
            Layout::open(&openings).unwrap().unit_nm(),
            design.cell.database_unit.nm()
        );
    }
}
