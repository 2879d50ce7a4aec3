//! Elements that stand nearer to one another than the lattice of the largest is wide: each pillar is read back as that of its own
//! element.

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_layout::{LayoutFormat, OasisEncoding, extraction_plan, write_pillars_as};
use metalith_testing::design;

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
    let text = std::fs::read_to_string(design("hologram")).unwrap();
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let (_, tail) = rest.split_once("[mapping]").unwrap();
    let head = head.replacen("diameter_um = 60", "diameter_um = 100", 1);
    let tail = tail.replacen("size_um = [300, 200]", "size_um = [400, 300]", 1);
    Design::parse(
        &design("hologram"),
        &format!("{head}[array]\n{ELEMENTS}\n[mapping]{tail}"),
    )
    .unwrap()
}

#[test]
fn each_pillar_is_read_back_as_one_of_its_element() {
    let design = near();
    let own: Vec<bool> = design.sites().iter().map(|site| site.within_nm.is_some()).collect();
    assert_eq!(own, [false, true, true, true, true, true]);
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for format in [LayoutFormat::Gds, LayoutFormat::Oasis(OasisEncoding::Compact)] {
        for hierarchy in [Hierarchy::Folded, Hierarchy::Sref, Hierarchy::Flat] {
            let path = folder.path().join(format!("pillars.{}", format.extension()));
            write_pillars_as(&design, &array, hierarchy, format, &path, &Silent).unwrap();
            let layout = Layout::open(&path).unwrap();
            let mut plans = vec![extraction_plan(&design)];
            // In any order: which element is met first decides nothing.
            let mut sites = design.sites();
            sites.reverse();
            plans.push(ExtractionPlan::given(plans[0].pillar_layer, sites));
            for (plan, is_reversed) in plans.into_iter().zip([false, true]) {
                let mut read = extract(&layout, &plan, &Silent).unwrap();
                assert_eq!(
                    (read.pillars, read.oddities.total()),
                    (array.pillars(), 0),
                    "{hierarchy:?}"
                );
                if is_reversed {
                    read.elements.reverse();
                }
                for (element, placed) in read.elements.iter().zip(&array.placed) {
                    let meant = array.widths(placed);
                    let label = placed.element.label();
                    assert!(
                        element.widths.number == meant.number,
                        "{format:?} {hierarchy:?} {label}"
                    );
                }
            }
        }
    }
}

/// Elements that are found have the ends that they are found with, so that strips whose squares overlap are
/// distinguished without the design.
#[test]
fn strips_are_found_without_the_design() {
    let text = std::fs::read_to_string(design("hologram")).unwrap();
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let (_, tail) = rest.split_once("[mapping]").unwrap();
    let strip = |y_um: f64| {
        format!("[[element]]\nx_um = 0\ny_um = {y_um}\naperture = \"rectangle\"\naperture_um = [100, 20]\n")
    };
    let elements = strip(-35.0) + &strip(0.0) + &strip(35.0);
    let text = format!("{head}[array]\n{elements}\n[mapping]{tail}");
    let design = Design::parse(&design("hologram"), &text).unwrap();
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
