//! Figures of a sample of zones agree with those of the whole lens, where it can be simulated.

use std::path::Path;

use metalith_cell::Fidelity;
use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray, cell_models};
use metalith_layout::write_pillars;
use metalith_testing::layouts::hologram_of;
use metalith_testing::{changed, design};
use metalith_verify::{Estimate, SampledStrehl, SimulationCases, Verification, verify, verify_sampled};
use metalith_wave::Accuracy;

/// Standard errors that two figures may differ by.
const ERRORS: f64 = 3.0;
/// Difference that is no error of the sample: fast transforms (1e-3 of the amplitude), and samples of the window that stand elsewhere.
const METHOD: f64 = 4e-3;
/// Largest standard error where samples with one patch of each zone have eight patches.
const LARGEST_ERROR: f64 = 0.06;
/// Largest standard error of the Strehl ratio of a lens of 400 um, whose samples have 126 patches.
const LARGEST_ERROR_400_UM: f64 = 0.004;

/// A layout simulated in full, and by a sample.
fn both(name: &str, changes: &[(&str, &str)], fidelity: Fidelity) -> [Verification; 2] {
    both_of(&design(name), &changed(name, changes), fidelity)
}

fn both_of(file: &Path, text: &str, fidelity: Fidelity) -> [Verification; 2] {
    let design = Design::parse(file, text).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pillars.gds");
    write_pillars(&design, &array, Hierarchy::Folded, &path, &Silent).unwrap();
    let cells = cell_models(&design, &[fidelity]).unwrap();
    let cases = SimulationCases::of_cells(&cells).unwrap();
    let whole = verify(&design, &array, &path, &cases, Accuracy::Fast, &Silent).unwrap();
    let sample = || {
        verify_sampled(
            &design,
            &array,
            &path,
            (fidelity, Some(&cases)),
            "a test".into(),
            &Silent,
        )
        .unwrap()
    };
    let sampled = sample();
    let text = |found: &Verification| format!("{:?}", found.sampled());
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(
        text(&one.install(sample)),
        text(&sampled),
        "the same sample on one thread"
    );
    [whole, sampled]
}

fn agrees(what: &str, estimate: &Estimate, whole: f64) {
    let allowed = ERRORS * estimate.standard_error + METHOD;
    assert!(
        (estimate.value - whole).abs() < allowed,
        "{what}: {estimate:?}, whole {whole}"
    );
    assert!(estimate.standard_error < LARGEST_ERROR, "{what}: {estimate:?}");
}

/// Compare all figures; answers how many Strehl ratios of the layout were found.
fn all_agree([whole, sampled]: &[Verification; 2]) -> usize {
    let sample = sampled.sampled().unwrap();
    assert_eq!(sample.elements.len(), whole.distinct.len());
    let mut found = 0;
    for (element, full) in sample.elements.iter().zip(&whole.distinct) {
        assert_eq!((element.copies, element.spots.len()), (full.copies, full.spots.len()));
        assert!(element.share > 0.0 && element.share < 0.5, "{}", element.share);
        agrees("mapping", &element.mapping_rms_rad, full.phase.mapping.rms_rad);
        agrees("rounding", &element.rounding_rms_rad, full.phase.rounding.rms_rad);
        for spot in &element.spots {
            let same = |of: &&metalith_verify::PsfPair| {
                (of.wavelength_um, of.field, of.copy) == (spot.wavelength_um, spot.field, spot.copy)
            };
            let other = full.spots.iter().find(same).unwrap();
            let label = spot.label(&element.element);
            assert_eq!(label, other.label(&full.element));
            let (layout, target) = (&other.judged().metrics, &other.designed.metrics);
            eprintln!(
                "{label}: {spot:?}\n  whole {} {} {:?}",
                layout.strehl, target.strehl, layout.focusing_efficiency
            );
            for (strehl, of_whole) in [(&spot.strehl, layout.strehl), (&spot.target_strehl, target.strehl)] {
                match strehl {
                    SampledStrehl::Found(estimate) => agrees(&label, estimate, of_whole),
                    SampledStrehl::Below(most) => assert!(of_whole < *most, "{label}: {of_whole}, {most}"),
                }
            }
            found += usize::from(matches!(spot.strehl, SampledStrehl::Found(_)));
            if let (Some(estimate), Some(share)) = (&spot.focusing_efficiency, layout.focusing_efficiency) {
                agrees(&label, estimate, share);
            }
        }
    }
    found
}

#[test]
fn steered_lenses_of_a_grid_agree_in_each_light() {
    assert!(all_agree(&both("mini_3x3", &[], Fidelity::Rigorous)) > 6);
}

#[test]
fn pillars_among_neighbours_are_sampled_with_them() {
    let changes = [
        ("field_x_deg = [0, 15] ", "field_x_deg = [0] "),
        ("field_y_deg = [0, 0]", "field_y_deg = [0]"),
    ];
    assert!(all_agree(&both("mini_3x3", &changes, Fidelity::Neighbours)) > 2);
}

#[test]
fn a_larger_lens_is_known_better() {
    let changes = [
        ("diameter_um = 10000", "diameter_um = 400"),
        ("focal_length_um = 24000", "focal_length_um = 960"),
    ];
    let found = both("lens_10mm", &changes, Fidelity::Rigorous);
    assert_eq!(all_agree(&found), 1);
    let SampledStrehl::Found(strehl) = found[1].sampled().unwrap().elements[0].spots[0].strehl else {
        panic!("no focus")
    };
    assert!(strehl.standard_error < LARGEST_ERROR_400_UM, "{strehl:?}");
}

/// A hexagon fills 0.83 of its circle.
#[test]
fn a_lens_that_is_not_round_is_sampled_within_its_outline() {
    let elements = "\n[[element]]\nx_um = 0\ny_um = 0\naperture = \"regular\"\naperture_sides = 6\ndiameter_um = 56\n";
    assert!(
        all_agree(&both_of(
            &design("hologram"),
            &hologram_of(elements),
            Fidelity::Published
        )) > 0
    );
}
