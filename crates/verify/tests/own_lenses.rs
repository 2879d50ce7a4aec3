//! Elements with separate lenses are simulated as what they are: each at its own focus and against its own aperture.

use metalith_cell::Fidelity;
use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray, cell_models};
use metalith_layout::write_pillars;
use metalith_testing::layouts::hologram_of;
use metalith_testing::{design, replaced};
use metalith_verify::{SimulationCases, Verification, verify};
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
    with_term("", "field_x_deg = [0]", elements)
}

/// The elements of a lens with a further phase over the plane, seen from these field angles.
fn with_term(term: &str, field: &str, elements: &str) -> Design {
    let own = [
        ("[array]", format!("{term}\n[array]")),
        ("field_x_deg = [0]", field.into()),
    ];
    Design::parse(&design("hologram"), &replaced(&hologram_of(elements), &own)).unwrap()
}

fn verified(design: &Design, accuracy: Accuracy) -> Verification {
    let array = PillarArray::build(design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pillars.gds");
    write_pillars(design, &array, Hierarchy::Folded, &path, &Silent).unwrap();
    let models = cell_models(design, &[Fidelity::Published]).unwrap();
    let cases = SimulationCases::of_cells(&models).unwrap();
    verify(design, &array, &path, &cases, accuracy, &Silent).unwrap()
}

/// A lens that is rotated by a quarter turn has the pillars of the other, turned; the light that it is asked for is not turned.
/// Its figures are those that it has alone.
#[test]
fn a_rotated_lens_has_its_own_figures() {
    /// Tolerance of Strehl ratios above a hundredth: fields are true to 1e-5 of the field of a perfect lens.
    const SAME: f64 = 1e-3;
    let term = "[[phase.term]]\nsource = \"polynomial\"\npowers_x = [2, 3]\npowers_y = [0, 0]\ncoefficients_rad = [4.0, 3.0]\n";
    let plain = "\n[[element]]\nx_um = -70\ny_um = 0\n";
    let rotated = "\n[[element]]\nx_um = 70\ny_um = 0\nrotation_deg = 90\n";
    let of = |elements: &str| verified(&with_term(term, "field_x_deg = [8]", elements), Accuracy::Accurate);
    let strehl = |found: &Verification, k: usize| found.distinct[0].spots[k].judged().metrics.strehl;
    let [one, other] = [plain, rotated].map(|element| strehl(&of(element), 0));
    assert!((one / other - 1.0).abs() > 20.0 * SAME, "{one} {other}");
    let both = of(&format!("{plain}{rotated}"));
    assert_eq!((both.distinct.len(), both.distinct[0].copies), (1, 2));
    let spots = &both.distinct[0].spots;
    let labels: Vec<_> = spots.iter().map(|s| s.label(&both.distinct[0].element)).collect();
    assert_eq!(labels, ["element (1, 0), 532 nm, 8°", "element (2, 0), 532 nm, 8°"]);
    assert_eq!((spots[0].copy, spots[1].asked()), (None, spots[0].field));
    for (k, alone) in [one, other].into_iter().enumerate() {
        let found = strehl(&both, k);
        assert!((found / alone - 1.0).abs() < SAME, "{found} {alone}");
    }
}

#[test]
fn ideal_lenses_are_ideal_at_their_own_focus() {
    let found = verified(&of(ELEMENTS), Accuracy::Fast);
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
