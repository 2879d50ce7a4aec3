//! Fits and mappings: exact where the cell is a polynomial, and what they leave of the real one.

use std::collections::HashMap;
use std::sync::Mutex;

use metalith_cell::{
    Basis, CellModel, CellResponse, CellStack, Fidelity, FittedCell, ForwardPolynomial, Illumination,
    InversePolynomial, MappingTable, PhaseCurve, PublishedCell, bad_cells, curves_over, fit_forward, fit_inverse,
    forward_errors, round_trip,
};
use metalith_core::{Error, Progress, Result};
use metalith_rcwa::Orders;
use num_complex::Complex64;

const PITCH_NM: f64 = 350.0;

/// Mean share of the zero order at 452 nm is known to two digits.
const MEAN_POWER: f64 = 0.02;

/// A cubic in all powers misses the paper's cell at 452 nm by 0.20 rad at worst; half as much again is allowed, and
/// the rms must be well below the worst.
const CUBIC_RMS_RAD: f64 = 0.08;
const CUBIC_WORST_RAD: f64 = 0.3;

/// Widths in steps of 2 nm over 200 nm are 0.06 rad apart on average, and further where the phase is steep.
const WIDTH_STEP_RMS_RAD: f64 = 0.05;

/// A polynomial of degree two over the band misses the resonances by about 0.28 rad rms.
const RESONANCES_RMS_RAD: f64 = 0.3;

/// A choice of widths is worth naming from this share of the arriving light.
const GAIN: f64 = 0.02;

/// Sums of some hundred powers below one in double precision.
const ROUNDING: f64 = 1e-12;

/// A least-squares fit of a polynomial by its normal equations, whose condition costs half the digits.
const FITTED: f64 = 1e-6;

/// The cell of the paper by the solver itself, without a table; each wavelength is solved once.
struct Solved(CellStack, Mutex<HashMap<u64, Vec<Complex64>>>);

impl Solved {
    fn paper() -> Self {
        Self(CellStack::paper(PITCH_NM, 700.0).unwrap(), Mutex::default())
    }
}

impl CellModel for Solved {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, widest_nm: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let wavelength_um = light.wavelength_um;
        // Even widths from 100 to 300 nm; what is narrower or odd is not looked at below.
        let mut known = self.1.lock().unwrap();
        let t = if let Some(t) = known.get(&wavelength_um.to_bits()) {
            t
        } else {
            let widths: Vec<f64> = (100..=300).step_by(2).map(f64::from).collect();
            let solved = self.0.transmissions(&widths, &[wavelength_um], Orders::new(13)?)?;
            let mut t = vec![Complex64::ZERO; 301];
            for (width, value) in widths.iter().zip(&solved) {
                t[*width as usize] = *value;
            }
            known.entry(wavelength_um.to_bits()).or_insert(t)
        };
        Ok(CellResponse::Scalar(t[..=usize::from(widest_nm)].to_vec()))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.0.full_transmission(wavelength_um)
    }
}

fn even_widths() -> Vec<u16> {
    (100..=300).step_by(2).collect()
}

#[test]
fn what_the_published_polynomials_miss_and_a_fit_does_not() {
    let cell = Solved::paper();
    let curve = PhaseCurve::new(&cell, 0.452, &even_widths()).unwrap();
    // The zero order carries 35 to 96 % at 452 nm, 63 % on average.
    let powers: Vec<f64> = curve.zero_order().collect();
    let mean = powers.iter().sum::<f64>() / powers.len() as f64;
    let (least, most) = powers
        .iter()
        .fold((1.0_f64, 0.0_f64), |(a, b), &p| (a.min(p), b.max(p)));
    assert!((mean - 0.63).abs() < MEAN_POWER && (0.25..0.40).contains(&least) && (0.94..1.0).contains(&most));

    let published = round_trip(&InversePolynomial::published(), &curve, PITCH_NM);
    assert!((0.4..0.6).contains(&published.rms_rad), "{published:?}");
    let all = fit_inverse(&curve, PITCH_NM, Basis::AllPowers, 3, 0.2).unwrap();
    assert!(
        all.round_trip.rms_rad < CUBIC_RMS_RAD && all.round_trip.worst_rad < CUBIC_WORST_RAD,
        "{all:?}"
    );
    assert!(all.span_waves > 1.0);
    // As printed in the paper, in even powers, the form is the worse one.
    let even = fit_inverse(&curve, PITCH_NM, Basis::EvenPowers, 2, 0.2).unwrap();
    assert!(even.round_trip.rms_rad > 2.0 * all.round_trip.rms_rad, "{even:?}");

    // The exact inverse is within the steps of the widths, and on average far closer.
    let exact = MappingTable::nearest(&curve, &[]).unwrap();
    let error = exact.phase_error(&curve);
    assert!(error.rms_rad < WIDTH_STEP_RMS_RAD, "{error:?}");
    let avoid: Vec<u16> = bad_cells(&cell, &[0.452], &even_widths(), 0.45)
        .unwrap()
        .iter()
        .map(|b| b.width_nm)
        .collect();
    assert!(!avoid.is_empty() && avoid.len() < 40, "{avoid:?}");
    let wary = MappingTable::nearest(&curve, &avoid).unwrap();
    assert!(wary.widths_nm.iter().all(|w| !avoid.contains(w)));
    assert!(wary.phase_error(&curve).rms_rad > error.rms_rad);
    let passed = |m: &MappingTable| m.orders(&cell, 0.452).unwrap().passed;
    assert!(passed(&wary) > passed(&exact));
}

#[test]
fn more_light_by_choice_of_widths() {
    let cell = Solved::paper();
    let curves: Vec<_> = [0.455, 0.53, 0.59, 0.66]
        .iter()
        .map(|&l| PhaseCurve::new(&cell, l, &even_widths()).unwrap())
        .collect();
    let light = |m: &MappingTable| -> f64 {
        let each = curves.iter().map(|c| m.orders(&cell, c.wavelength_um).unwrap());
        each.map(|o| o.first).sum::<f64>() / curves.len() as f64
    };
    let published = InversePolynomial::published();
    let width = |p: &InversePolynomial, u: f64| ((p.duty(u) * PITCH_NM / 2.0).round() * 2.0).clamp(100.0, 300.0) as u16;
    let start = MappingTable::sampled(|u| width(&published, u));
    let polynomial = MappingTable::best_polynomial(&published, &curves, PITCH_NM);
    let better = MappingTable::sampled(|u| width(&polynomial, u));
    let best = start.exchanged(&curves);
    let (a, b, c) = (light(&start), light(&better), light(&best));
    println!("first order, mean of four: published {a:.3}, best polynomial {b:.3}, exchanged {c:.3}");
    assert!(b > a + GAIN && c > b, "{a} {b} {c}");
    // Powers of orders are powers.
    let orders = best.orders(&cell, 0.53).unwrap();
    assert!(orders.first + orders.zero + orders.second <= orders.passed + ROUNDING && orders.passed <= 1.0);
}

#[test]
fn a_polynomial_cell_is_fitted_exactly() {
    // Degree two in, degree two and three out: the published cell comes back, whatever its whole turns.
    let cell = PublishedCell::new(350);
    let curves = curves_over(&cell, (0.42, 0.68), (110, 280)).unwrap();
    for degree in [2, 3] {
        let fit = fit_forward(&curves, PITCH_NM, degree).unwrap();
        assert!(fit.overall.worst_rad < FITTED, "{:?}", fit.overall);
        let again = FittedCell::new(PITCH_NM, fit.polynomial);
        let (a, b) = (
            again.transmissions(0.5, 280).unwrap(),
            cell.transmissions(0.5, 280).unwrap(),
        );
        assert_eq!(a[0], Complex64::ZERO);
        let turn = a[200] / b[200];
        assert!((1..=280).all(|w| (a[w] / b[w] - turn).norm() < FITTED));
    }
    let (each, overall) = forward_errors(&ForwardPolynomial::published(), &curves, PITCH_NM);
    assert!(overall.worst_rad < FITTED && each.len() == curves.len());
}

#[test]
fn mappings_and_fits_that_cannot_be_are_refused() {
    let cell = PublishedCell::new(350);
    let widths: Vec<u16> = (100..=300).collect();
    let curve = PhaseCurve::new(&cell, 0.452, &widths).unwrap();
    assert!(MappingTable::nearest(&curve, &widths).is_err());
    assert!(fit_inverse(&curve, PITCH_NM, Basis::AllPowers, 0, 0.2).is_err());
    assert!(fit_inverse(&curve, PITCH_NM, Basis::AllPowers, 9, 0.2).is_err());
    assert!(fit_inverse(&curve, PITCH_NM, Basis::AllPowers, 2, 1.5).is_err());
    assert!(PhaseCurve::new(&cell, 0.452, &[100]).is_err());
    assert!(fit_forward(&[], PITCH_NM, 2).is_err());
}

#[test]
fn the_fitted_cell_follows_the_trend_of_the_rigorous_one() {
    let cell = Solved::paper();
    let fitted = FittedCell::of_stack(&cell.0, (0.50, 0.60), (100, 300), None).unwrap();
    let curve = PhaseCurve::new(&cell, 0.545, &even_widths()).unwrap();
    let (each, _) = forward_errors(fitted.forward(), std::slice::from_ref(&curve), PITCH_NM);
    let (published, _) = forward_errors(&ForwardPolynomial::published(), &[curve], PITCH_NM);
    println!("fitted {:?}, published {:?}", each[0].1, published[0].1);
    // What is left is the resonance that crosses at 200 nm.
    assert!(each[0].1.rms_rad < RESONANCES_RMS_RAD && each[0].1.rms_rad < published[0].1.rms_rad);
    assert_eq!(fitted.full_transmission(0.55).unwrap(), 1.0);
}

#[test]
fn mappings_go_through_files_and_bad_ones_name_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mapping.csv");
    let widths = even_widths();
    let curve = PhaseCurve::new(&PublishedCell::new(350), 0.452, &widths).unwrap();
    let exact = MappingTable::nearest(&curve, &[]).unwrap();
    std::fs::write(&file, exact.to_csv()).unwrap();
    assert_eq!(MappingTable::read_csv(&file, &widths).unwrap(), exact);
    let mut said = Vec::new();
    for (text, at) in [
        ("", None),
        ("turns,width_nm\n", None),
        ("turns,width_nm\n0.25,100\n0.5,102\n", Some(3)),
        ("turns,width_nm\n0.25,100\n0.75,101\n", Some(3)),
        ("turns,width_nm\n0.25,100\n0.75\n", Some(3)),
        ("turns,width_nm\n0.25,100\nNaN,102\n", Some(3)),
    ] {
        std::fs::write(&file, text).unwrap();
        match MappingTable::read_csv(&file, &widths).unwrap_err() {
            Error::Table { line, what, .. } => {
                said.push(what);
                assert_eq!(line, at, "{said:?}");
            }
            other => panic!("{other:?}"),
        }
    }
    insta::assert_snapshot!(said.join("\n"), @"
    there is nothing in it
    fewer than two parts of a turn
    0.5 turns stand where 0.750000 should
    a width of 101 nm may not be written
    1 fields under 2 columns: `0.75`
    `NaN` in column `turns` is not a finite number
    ");
}
