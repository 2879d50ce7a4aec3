//! Tables of changed cells against those that are solved in full.

use super::*;
use metalith_cell::Material;
use metalith_core::Silent;

/// Root mean square error of t over widths and three wavelengths, with resonances: the truncation error of the
/// stated cell itself.
const TOLERANCE: f64 = 0.005;

fn made_up() -> CellStack {
    let constant = |n| Material::constant(n, 0.0).unwrap();
    CellStack {
        lattice: metalith_rcwa::CellLattice::Square,
        pitch_nm: 350.0,
        height_nm: 700.0,
        shape: metalith_pillars::PillarShape::Square,
        under: Vec::new(),
        film: constant(2.02),
        substrate: constant(1.46),
        ambient: constant(1.0),
        taper: 0.0,
        corner_radius_nm: 0.0,
        mask_height_nm: 0.0,
        mask: constant(1.7),
    }
}

/// Leaning walls are solved with few orders and corrected by upright ones, which may be of more or fewer.
#[test]
fn tables_that_are_corrected_by_others_are_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let table = |fine| {
        let kept = Some(folder.path().to_owned());
        let cells = RigorousCells::new(made_up(), vec![660.0], (118.0, 122.0), kept).with_orders(fine, 5);
        let leaning = CellChange {
            taper_deg: 1.0,
            ..CellChange::default()
        };
        cells.table(&leaning, &Silent).unwrap().t.clone()
    };
    let first = table(7);
    assert_ne!(table(11), first);
    assert_eq!(table(7), first);
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_change_solved_with_few_orders_is_that_with_many() {
    let cells = RigorousCells::new(made_up(), vec![460.0, 531.0, 660.0], (100.0, 240.0), None);
    let stated = CellChange::default();
    for change in [
        CellChange {
            taper_deg: 0.6,
            ..stated
        },
        CellChange {
            taper_deg: -1.0,
            ..stated
        },
        CellChange {
            corner_rounding_nm: 25.0,
            ..stated
        },
        CellChange { index: 0.02, ..stated },
        CellChange {
            height_nm: -24.0,
            ..stated
        },
        CellChange {
            height_nm: 10.0,
            ..stated
        },
        CellChange {
            residual_mask_nm: 15.0,
            ..stated
        },
    ] {
        let made = cells.table(&change, &Silent).unwrap();
        let truth = cells.solved(&change, FINE, &Silent).unwrap();
        let pairs = made.t.iter().flatten().zip(truth.t.iter().flatten());
        let squares: Vec<f64> = pairs.map(|(a, b)| (a - b).norm_sqr()).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms < TOLERANCE, "{change:?}: {rms}");
    }
}

/// Error of transmission by few orders as a smooth function of width, in the mean of the spectrum of an LED: coefficients of
/// the polynomials that intervals count with, root mean square over LEDs and polynomials, of amplitude and of phase.
fn smooth_error(cells: &RigorousCells, few: usize, many: usize, leds: &[Vec<f64>]) -> [f64; 2] {
    use crate::smooth_shape::TRANSMISSION_TERMS;
    use metalith_optics::legendre;
    use nalgebra::{DMatrix, DVector};
    let tables = [few, many].map(|orders| cells.solved(&CellChange::default(), orders, &Silent).unwrap());
    let count = tables[0].t[0].len();
    let basis = |k: usize, at: usize| match k {
        0 => 1.0,
        k => {
            let mut one = [0.0; TRANSMISSION_TERMS];
            one[k - 1] = 1.0;
            legendre(&one, 2.0 * at as f64 / (count - 1) as f64 - 1.0)
        }
    };
    let (mut amplitudes, mut phases) = (0.0, 0.0);
    let mut first = 0;
    for weights in leds {
        let size = TRANSMISSION_TERMS + 1;
        let mut form = DMatrix::<f64>::zeros(size, size);
        let (mut re, mut im) = (DVector::<f64>::zeros(size), DVector::<f64>::zeros(size));
        for (l, weight) in weights.iter().enumerate() {
            for at in 0..count {
                let [a, b] = [0, 1].map(|k| tables[k].t[first + l][at]);
                // The logarithm of what hardly transmits tells of nothing that is seen.
                let (ratio, weight) = ((a / b).ln(), weight * b.norm_sqr());
                for i in 0..size {
                    re[i] += weight * basis(i, at) * ratio.re;
                    im[i] += weight * basis(i, at) * ratio.im;
                    for j in 0..size {
                        form[(i, j)] += weight * basis(i, at) * basis(j, at);
                    }
                }
            }
        }
        let inverse = form.try_inverse().unwrap();
        let sum = |x: DVector<f64>| -> f64 { x.iter().skip(1).map(|c| c * c).sum() };
        amplitudes += sum(&inverse * re);
        phases += sum(&inverse * im);
        first += weights.len();
    }
    let n = (TRANSMISSION_TERMS * leds.len()) as f64;
    [(amplitudes / n).sqrt(), (phases / n).sqrt()]
}

/// The error of a cell that intervals count with is that of its truncation: of the orders of fits against many more, and of
/// those of fits against those of synthetic sets, which intervals are judged by.
#[test]
#[ignore = "second tier: a minute of CPU time, in scripts/slow_tests.sh"]
fn the_error_of_a_cell_in_intervals_is_that_of_its_truncation() {
    use crate::cell_error::CellError;
    /// Relative: the constants are rounded, and other films have other resonances.
    const TOLERANCE: f64 = 1.2;
    /// Orders that stand for all.
    const MANY: usize = 17;
    /// Wavelengths of an LED, over 1.5 standard deviations of its spectrum on each side.
    const SAMPLES: usize = 7;
    let film = Material::read_csv(std::path::Path::new("../../golden/measured/film_nk.csv")).unwrap();
    let stack = CellStack {
        film,
        ..CellStack::paper(350.0, 700.0).unwrap()
    };
    let mut wavelengths = Vec::new();
    let leds = [(455.0, 18.0), (530.0, 33.0), (660.0, 20.0)].map(|(centre, fwhm)| {
        let of = |k: usize| 3.0 * k as f64 / (SAMPLES - 1) as f64 - 1.5;
        wavelengths.extend((0..SAMPLES).map(|k| centre + of(k) * fwhm / 2.3548));
        (0..SAMPLES).map(|k| (-0.5 * of(k).powi(2)).exp()).collect::<Vec<f64>>()
    });
    let cells = RigorousCells::new(stack, wavelengths, (100.0, 300.0), None);
    for (few, many) in [(FINE, MANY), (FINE, crate::validate::synthetic::ORDERS)] {
        let [amplitude, phase] = smooth_error(&cells, few, many, &leds);
        println!("{few} orders against {many}: amplitude {amplitude:.5}, phase {phase:.5} rad");
        let CellError {
            amplitude: a,
            phase_rad,
            ..
        } = CellError::MEASURED;
        assert!(amplitude < TOLERANCE * a && phase < TOLERANCE * phase_rad);
        // Of more orders the error is that which intervals count with, and not a part of it.
        if many == MANY {
            assert!(amplitude > a / TOLERANCE && phase > phase_rad / TOLERANCE);
        }
    }
}
