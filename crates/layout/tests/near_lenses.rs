//! Elements that stand nearer to one another than the lattice of the largest is wide: each pillar is read back as that of its own
//! element.

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, extraction_plan, write_pillars_as};
use metalith_testing::layouts::{all_pillars, each_layout, hologram_of, same_pillars};
use metalith_testing::{design, replaced};

/// A lens of 100 um; beside it two small ones, two strips whose rows are a pitch apart, and one that is turned. Those in the middle
/// are in step with one another: a place of one lattice is a place of the other.
const ELEMENTS: &str = r#"
[[element]]
x_um = -101
y_um = 0

[[element]]
x_um = 0
y_um = 0
diameter_um = 20

[[element]]
x_um = 22.05
y_um = 0
diameter_um = 20

[[element]]
x_um = 0
y_um = 40.25
aperture = "rectangle"
aperture_um = [60, 8]

[[element]]
x_um = 0
y_um = 47.95
aperture = "rectangle"
aperture_um = [60, 8]

[[element]]
x_um = 60
y_um = 40
rotation_deg = 90
aperture = "rectangle"
aperture_um = [60, 8]
"#;

fn near() -> Design {
    let larger = [
        ("diameter_um = 60", "diameter_um = 100"),
        ("size_um = [300, 200]", "size_um = [400, 300]"),
    ];
    Design::parse(&design("hologram"), &replaced(&hologram_of(ELEMENTS), &larger)).unwrap()
}

#[test]
fn each_pillar_is_read_back_as_one_of_its_element() {
    let design = near();
    let own: Vec<bool> = design.sites().iter().map(|site| site.within_nm.is_some()).collect();
    assert_eq!(own, [false, true, true, true, true, true]);
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    each_layout(folder.path(), &design, &array, |path| {
        let plan = extraction_plan(&design);
        same_pillars(path, &plan, &array);
        // In any order: which element is met first decides nothing.
        let mut sites = design.sites();
        sites.reverse();
        let read = all_pillars(path, &ExtractionPlan::given(plan.pillar_layer, sites), &array);
        for (element, placed) in read.elements.iter().rev().zip(&array.placed) {
            let is_same = element.widths.number == array.widths(placed).number;
            assert!(is_same, "{} {}", path.display(), placed.element.label());
        }
    });
}

/// Elements that are found have the ends that they are found with, so that strips whose squares overlap are
/// distinguished without the design.
#[test]
fn strips_are_found_without_the_design() {
    let strip = |y_um: f64| {
        format!("[[element]]\nx_um = 0\ny_um = {y_um}\naperture = \"rectangle\"\naperture_um = [100, 20]\n")
    };
    let elements = strip(-35.0) + &strip(0.0) + &strip(35.0);
    let design = Design::parse(&design("hologram"), &hologram_of(&elements)).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for hierarchy in [Hierarchy::Folded, Hierarchy::Flat] {
        let path = folder.path().join("pillars.gds");
        write_pillars_as(&design, &array, hierarchy, LayoutFormat::Gds, &path, &Silent).unwrap();
        let plan = ExtractionPlan::discover(design.layout.layers.pillars.number());
        let read = extract(&Layout::open(&path).unwrap(), &plan, &Silent).unwrap();
        let places: Vec<_> = read.elements.iter().map(|e| e.site.centre_nm).collect();
        assert_eq!(places, [[0, -35_000], [0, 0], [0, 35_000]]);
        let pillars: Vec<_> = read.elements.iter().map(|e| e.widths.pillars()).collect();
        let meant: Vec<_> = array.placed.iter().map(|p| array.widths(p).pillars()).collect();
        assert_eq!((pillars, read.oddities.total()), (meant, 0), "{hierarchy:?}");
    }
}
