//! Pillars that are higher at the rim of a lens than in its middle.

use metalith_cell::{CellStack, Illumination, ORDERS};
use metalith_core::Silent;
use metalith_optics::{AsBuiltChip, CalibratedModel, DrawnElement, Perturbation, perturbed, to_middle_tops};
use metalith_pillars::{Lattice, PillarMap};
use metalith_rcwa::Orders;
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

/// Sites along an axis, of a lens of 140 um.
const SITES: usize = 400;

/// Height at the rim over that in the middle (nm): twice the typical size of the effect.
const HIGHER_NM: f64 = 20.0;

/// Rms error of transmissions over widths, colours and radii without the worst twentieth: half of what the stated cells
/// themselves err by. The logarithm of a transmission is nearly in proportion to the height.
const SMOOTH: f64 = 2.5e-3;

/// And of all: of one width in thirty a resonance passes between the two heights.
const ALL: f64 = 0.02;

/// Transmission of a site at a radius equals the pillar solved with the height that it has there.
#[test]
fn heights_between_middle_and_rim_are_those_of_solved_pillars() {
    let stack = CellStack::paper(350.0, 700.0).unwrap();
    let orders = Orders::new(ORDERS).unwrap();
    let mut perturbation = Perturbation::default();
    perturbation.cell.rim_height_nm = HIGHER_NM;
    let model = CalibratedModel::new("set".into(), "finding".into(), perturbation);
    let chip = AsBuiltChip::new(&stack, &model).unwrap();
    let lattice = Lattice::new(350, SITES).unwrap();
    let radius_um = 70.0;
    let (mut errors, mut changes) = (Vec::new(), Vec::new());
    for um in [0.455, 0.53, 0.66] {
        for width in (110..280).step_by(17) {
            let map = PillarMap {
                lattice,
                number: Array2::from_elem((SITES, SITES), width),
            };
            let drawn = DrawnElement::new(&map, radius_um);
            let element = chip.element(&drawn).unwrap();
            let fields = chip.view(&element, &Illumination::normal(um), &Silent).unwrap();
            let aperture = fields.fields[0].aperture(&fields.light).unwrap();
            let mut row = vec![Complex32::ZERO; SITES];
            aperture.fill_row(SITES / 2, &mut row);
            let double = |t: Complex32| Complex64::new(f64::from(t.re), f64::from(t.im));
            for ix in [200, 290, 340, 390] {
                let place = [ix, SITES / 2].map(|i| lattice.coordinate_um(i) / radius_um);
                let mut change = model.perturbation.cell.in_the_middle();
                change.height_nm = HIGHER_NM * (place[0].powi(2) + place[1].powi(2));
                let made = perturbed(&stack, &change);
                let own = made.transmission(f64::from(width), um, orders).unwrap();
                let want = own * to_middle_tops(&stack, change.height_nm, um).unwrap();
                errors.push((double(row[ix]) - want).norm());
                changes.push((want - double(row[SITES / 2])).norm());
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let rms = |of: &[f64]| (of.iter().map(|e| e * e).sum::<f64>() / of.len() as f64).sqrt();
    let smooth = rms(&errors[..errors.len() * 19 / 20]);
    let (all, change) = (rms(&errors), rms(&changes));
    println!("rms error {smooth}, {all} with resonances, of a change of {change}");
    assert!(smooth < SMOOTH, "{smooth}");
    assert!(all < ALL && change > 4.0 * ALL, "{all} {change}");
}
