//! Errors of transmissions by few diffraction orders against those by many, over widths and the three design
//! wavelengths, and what extrapolation over the number of orders would gain.
//!
//! `cargo run --release -p metalith-cell --example truncation` (half a CPU minute)

use metalith_cell::CellStack;
use metalith_core::Result;
use metalith_rcwa::Orders;
use num_complex::Complex64;
use rayon::prelude::*;

/// Orders along an axis; the last stand for the limit.
const ORDERS: [usize; 6] = [9, 11, 13, 17, 21, 27];

/// Powers of the number of orders by which an error that falls steadily would fall.
const POWERS: [f64; 3] = [2.0, 3.0, 4.0];

fn main() -> Result<()> {
    let stack = CellStack::paper(350.0, 700.0)?;
    let places: Vec<(f64, f64)> = (0..40)
        .flat_map(|i| [0.455, 0.53, 0.66].map(|um| (100.0 + 5.0 * f64::from(i), um)))
        .collect();
    let solve = |&(width, um): &(f64, f64)| -> Result<Vec<Complex64>> {
        let by = |n: &usize| stack.transmission(width, um, Orders::new(*n)?);
        ORDERS.iter().map(by).collect()
    };
    let solved = places.par_iter().map(solve).collect::<Result<Vec<_>>>()?;
    let limit = ORDERS.len() - 1;
    println!("|t - t by {} orders| of {} cells", ORDERS[limit], places.len());
    for (i, n) in ORDERS[..limit].iter().enumerate() {
        print(&format!("{n} orders"), solved.iter().map(|t| (t[i] - t[limit]).norm()));
    }
    let (few, more) = (2, 3);
    for power in POWERS {
        let gain = 1.0 / ((ORDERS[more] as f64 / ORDERS[few] as f64).powf(power) - 1.0);
        let errors = solved
            .iter()
            .map(|t| (t[more] + (t[more] - t[few]) * gain - t[limit]).norm());
        print(
            &format!("{} and {} extrapolated, power {power}", ORDERS[few], ORDERS[more]),
            errors,
        );
    }
    Ok(())
}

fn print(what: &str, errors: impl Iterator<Item = f64>) {
    let mut all: Vec<f64> = errors.collect();
    all.sort_by(f64::total_cmp);
    let rms = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
    let part = |share: usize| all[(all.len() - 1) * share / 100];
    println!(
        "{what}: rms {rms:.4}, median {:.4}, 95 % {:.4}, worst {:.4}",
        part(50),
        part(95),
        part(100)
    );
}
