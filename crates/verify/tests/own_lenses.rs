//! Elements with lenses of their own are simulated as what they are: each at its own focus and against its own aperture.

use metalith_cell::Fidelity;
use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray, cell_models};
use metalith_layout::write_pillars;
use metalith_testing::design;
use metalith_verify::{SimulationCases, verify};
use metalith_wave::Accuracy;

/// Least Strehl ratio of an ideal lens: what a fast simulation and the sampling of its focus leave of one.
const IDEAL: f64 = 0.995;

const ELEMENTS: &str = r#"
[[element]]
x_um = -70
y_um = 0

[[element]]
x_um = 0
y_um = 0
diameter_um = 40
focal_length_um = 90

[[element]]
x_um = 70
y_um = 0
diameter_um = 30
focal_length_um = 144
[element.phase]
source = "hyperbola"
wavelength_nm = 532
focal_length_um = 60

[[element]]
x_um = 0
y_um = 65
aperture = "regular"
aperture_sides = 6
diameter_um = 50
"#;

fn of(elements: &str) -> Design {
    let text = std::fs::read_to_string(design("hologram")).unwrap();
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let (_, array) = rest.split_once("[array]").unwrap();
    let (array, _) = array.split_once("[[element]]").unwrap();
    let (_, tail) = rest.split_once("[mapping]").unwrap();
    let text = format!("{head}[array]{array}{elements}\n[mapping]{tail}");
    Design::parse(&design("hologram"), &text).unwrap()
}

#[test]
fn ideal_lenses_are_ideal_at_their_own_focus() {
    let design = of(ELEMENTS);
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pillars.gds");
    write_pillars(&design, &array, Hierarchy::Folded, &path, &Silent).unwrap();
    let models = cell_models(&design, &[Fidelity::Published]).unwrap();
    let cases = SimulationCases::of_cells(&models).unwrap();
    let found = verify(&design, &array, &path, &cases, Accuracy::Fast, &Silent).unwrap();
    assert_eq!(found.distinct.len(), 4);
    for element in &found.elements {
        assert_eq!(element.widths.faults(), 0);
    }
    let strehl = |k: usize| found.distinct[k].spots[0].designed.metrics.strehl;
    assert!(strehl(0) > IDEAL && strehl(1) > IDEAL, "{} {}", strehl(0), strehl(1));
    // Against a circle a hexagon of its area would have 0.68.
    assert!(strehl(3) > IDEAL, "{}", strehl(3));
    // A lens of 30 um whose focus is 84 um before the plane that it is seen in.
    assert!(strehl(2) < 0.5, "{}", strehl(2));
}
