//! Rectangles that a process makes too small, drawn so that they come out as intended.

use std::fs;

use metalith_cell::PolarisationAxis;
use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_layout::write_pillars;
use metalith_optics::{CalibratedModel, Perturbation};
use metalith_verify::compensate::{compensate, compensation_cases};

/// Four sizes, with phases of `designs/phases/birefringent_532.csv`.
const LIBRARY: &str = "width_x_nm,width_y_nm,turns_x,turns_y,passed_x,passed_y
120,120,0.25685,0.19435,0.9835,0.9835
140,120,0.38602,0.23967,0.9736,0.9768
120,140,0.30217,0.32352,0.9768,0.9736
140,140,0.45898,0.39648,0.9745,0.9745
";
/// Shortfall of edges (nm): one step of the widths that may be drawn.
const SHORT_NM: f64 = 20.0;

/// A shipped design, smaller.
fn design(name: &str, changes: &[(&str, &str)]) -> Design {
    let small = [("diameter_um = 80", "diameter_um = 24")];
    let text = metalith_testing::changed(name, &[&small, changes].concat());
    Design::parse(&metalith_testing::design(name), &text).unwrap()
}

fn model(change: impl FnOnce(&mut Perturbation)) -> CalibratedModel {
    let mut perturbation = Perturbation::default();
    change(&mut perturbation);
    CalibratedModel::new("made up".into(), "edges too short".into(), perturbation)
}

#[test]
fn upright_rectangles_are_drawn_longer_where_they_come_out_short() {
    /// Relative: rounding of sums over thousands of pillars.
    const ROUNDING: f64 = 1e-9;
    /// A relative error that nobody would call rounding.
    const FELT: f64 = 0.1;
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("library.csv");
    fs::write(&library, LIBRARY).unwrap();
    let design = design(
        "birefringent_532",
        &[
            ("focal_length_um = 120", "focal_length_um = 40"),
            ("width_min_nm = 90", "width_min_nm = 120"),
            ("width_max_nm = 280", "width_max_nm = 160"),
            ("width_step_nm = 10", "width_step_nm = 20"),
            ("\"phases/birefringent_532.csv\"", &format!("{library:?}")),
        ],
    );
    let intended = PillarArray::build(&design, &Silent).unwrap();
    let short = model(|d| d.geometry.cd_bias_nm = -SHORT_NM);
    let compensated = compensate(&design, &intended, &short, &Silent).unwrap();
    let [before, after] = compensated.summary.error;
    assert!(before > FELT && after < ROUNDING, "{before} {after}");
    assert!((compensated.summary.moved_rms_nm - SHORT_NM).abs() < ROUNDING);
    let (drawn, was) = (&compensated.array.classes[0], &intended.classes[0]);
    let (drawn, was) = (drawn.widths.map(), was.widths.map());
    let (mut pillars, mut ends) = (0, 0);
    for (&to, &from) in drawn.number.iter().zip(&was.number) {
        assert_eq!(to == 0, from == 0);
        if to > 0 {
            let [to, from] = [to, from].map(|number| {
                design
                    .cell
                    .shape
                    .edges_nm(metalith_pillars::PillarId(number))
                    .map(f64::from)
            });
            assert_eq!(to, from.map(|edge| edge + SHORT_NM));
            pillars += 1;
            ends += u64::from(to.contains(&160.0));
        }
    }
    assert!(pillars > 3000 && compensated.summary.at_limit == ends && ends > 0);

    // What is written and read back focuses each polarisation as intended.
    let layout = folder.path().join("pillars.gds");
    write_pillars(&design, &compensated.array, Hierarchy::Folded, &layout, &Silent).unwrap();
    let cases = compensation_cases(&design, &intended, &compensated, &layout, &Silent).unwrap();
    let seen = cases.chunks(3).map(|chips| {
        let [wanted, uncorrected, corrected] = [0, 1, 2].map(|k| chips[k].spot.metrics.strehl);
        assert!((corrected / wanted - 1.0).abs() < ROUNDING, "{corrected} {wanted}");
        assert!(uncorrected < wanted * (1.0 - FELT), "{uncorrected} {wanted}");
        chips[0].axis
    });
    let seen: Vec<_> = seen.collect();
    assert_eq!(seen, PolarisationAxis::ALL.map(Some));
}

#[test]
fn rotated_rectangles_have_one_size_and_say_so() {
    let design = design("geometric_phase_532", &[]);
    let intended = PillarArray::build(&design, &Silent).unwrap();
    let short = model(|d| d.geometry.cd_bias_nm = -SHORT_NM);
    let refused = compensate(&design, &intended, &short, &Silent).map(|_| ()).unwrap_err();
    assert_eq!(refused.id(), "compensate/rotated-rectangles");
}
