//! Lenses of their own that a process makes too narrow, each with its own focal length, outline and opening.

use std::path::Path;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_layout::write_pillars;
use metalith_optics::{CalibratedModel, Perturbation};
use metalith_verify::compensate::{compensate, compensation_cases};

/// Shortfall of widths (nm): five steps of those that may be drawn.
const SHORT_NM: f64 = 10.0;

#[test]
fn each_lens_is_drawn_wider_where_it_comes_out_narrow() {
    /// Rounding of sums over tens of thousands of pillars: all of them may be drawn as much wider.
    const ROUNDING: f64 = 1e-9;
    /// A relative error that nobody would call rounding.
    const FELT: f64 = 0.03;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/mixed_lenses.toml");
    let design = Design::read(&path).unwrap();
    let intended = PillarArray::build(&design, &Silent).unwrap();
    let mut short = Perturbation::default();
    short.geometry.cd_bias_nm = -SHORT_NM;
    let model = CalibratedModel::new("made up".into(), "widths too small".into(), short);
    let compensated = compensate(&design, &intended, &model, &Silent).unwrap();
    let [before, after] = compensated.summary.error;
    assert!(before > FELT && after < ROUNDING, "{before} {after}");

    let folder = tempfile::tempdir().unwrap();
    let layout = folder.path().join("pillars.gds");
    write_pillars(&design, &compensated.array, Hierarchy::Folded, &layout, &Silent).unwrap();
    let cases = compensation_cases(&design, &intended, &compensated, &layout, &Silent).unwrap();
    let mut elements = Vec::new();
    for chips in cases.chunks(3) {
        let [wanted, uncorrected, corrected] = [0, 1, 2].map(|k| chips[k].spot.metrics.strehl);
        println!("{}: {wanted} {uncorrected} {corrected}", chips[0].element);
        assert!((corrected / wanted - 1.0).abs() < ROUNDING, "{corrected} {wanted}");
        assert!((uncorrected / wanted - 1.0).abs() > FELT, "{uncorrected} {wanted}");
        elements.push(chips[0].element.clone());
    }
    assert_eq!(elements, ["(1, 0)", "(2, 0)", "(3, 0)", "(4, 0)"]);
}
