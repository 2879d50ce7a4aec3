//! Widths that follow the fill within a range that a table of widths gave, drawn so that they come out as intended.

use metalith_core::Silent;
use metalith_design::{Design, PillarArray};
use metalith_optics::{CalibratedModel, DrawnElement, GeometryChange, Perturbation};
use metalith_verify::compensate::compensate;

/// Widths that may be drawn differ by this (nm), so pillars come out within half of it.
const STEP_NM: f64 = 2.0;

#[test]
fn pillars_come_out_as_intended_within_the_range_of_the_model() {
    let text = metalith_testing::changed(
        "mini_3x3",
        &[
            ("diameter_um = 60", "diameter_um = 20"),
            ("focal_length_um = 144", "focal_length_um = 48"),
            ("elements = [3, 3]", "elements = [1, 1]"),
            ("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [455, 530]"),
        ],
    );
    let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
    let intended = PillarArray::build(&design, &Silent).unwrap();
    let short = GeometryChange {
        cd_bias_nm: -4.0,
        cd_bias_density_nm: 30.0,
        cd_bias_density_range_um: Some(3.0),
        ..GeometryChange::default()
    };
    let perturbation = Perturbation {
        geometry: short.clone(),
        ..Perturbation::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    CalibratedModel::new("widths".into(), "proximity".into(), perturbation)
        .write(&path)
        .unwrap();
    let model = CalibratedModel::read(&path).unwrap();
    let compensated = compensate(&design, &intended, &model, &Silent).unwrap();

    // Median by which pillars come out other than intended, inside the range of widths: a few are exchanged for pillars of another
    // width that transmit alike.
    let off = |drawn: &PillarArray, geometry: &GeometryChange| {
        let (drawn, wanted) = (drawn.classes[0].widths.map(), intended.classes[0].widths.map());
        let element = DrawnElement::new(&drawn, 12.0);
        let (first, last) = design.cell.width_range_nm;
        let pairs = drawn.number.iter().zip(&wanted.number).enumerate();
        let inside = pairs.filter(|(_, (d, _))| (first + 1..last).contains(*d));
        let off = inside.map(|(site, (d, w))| (f64::from(*d) + element.bias_nm(site, geometry) - f64::from(*w)).abs());
        let mut off: Vec<f64> = off.collect();
        off.sort_by(f64::total_cmp);
        off[off.len() / 2]
    };
    let [before, after] = [&intended, &compensated.array].map(|array| off(array, &short));
    let other_range = GeometryChange {
        cd_bias_density_range_um: None,
        ..short.clone()
    };
    let elsewhere = off(&compensated.array, &other_range);
    println!("{before:.2} nm, compensated {after:.2} nm, within another range {elsewhere:.2} nm");
    assert!(after < 0.5 * STEP_NM && before > 2.0 * STEP_NM, "{before} {after}");
    assert!(elsewhere > STEP_NM, "{elsewhere}");
}
