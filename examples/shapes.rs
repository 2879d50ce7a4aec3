//! Complex transmission of cells of circles, for `scripts/shape_peers.py`: `cargo run --release --example shapes -- 17 25`.
//!
//! One line of JSON for each number of orders: all cases of [`CASES`] at all their diameters, along the normal.

use metalith::cell::{CellStack, Material};
use metalith::rcwa::Orders;
use metalith::{PillarShape, Result};

/// Film, pitch, height (nm), wavelength (um) and the smallest diameter and its step (nm); five diameters each. From fused
/// silica to air.
const CASES: [(&str, f64, f64, f64, f64, f64); 6] = [
    ("sin_luke_2015", 350.0, 700.0, 0.455, 110.0, 45.0),
    ("sin_luke_2015", 350.0, 700.0, 0.530, 110.0, 45.0),
    ("sin_luke_2015", 350.0, 700.0, 0.660, 110.0, 45.0),
    ("tio2_siefke_2016", 320.0, 600.0, 0.532, 90.0, 40.0),
    ("a_si_pierce_1972", 450.0, 550.0, 0.940, 100.0, 50.0),
    ("a_si_pierce_1972", 750.0, 900.0, 1.550, 200.0, 70.0),
];

fn main() -> Result<()> {
    for argument in std::env::args().skip(1) {
        let along_axis: usize = argument.parse().expect("a number of orders");
        let orders = Orders::new(along_axis)?;
        let mut values = Vec::new();
        for (film, pitch, height, wavelength, first, step) in CASES {
            let stack = CellStack {
                shape: PillarShape::Circle,
                film: Material::named(film)?,
                ..CellStack::paper(pitch, height)?
            };
            for k in 0..5 {
                let diameter = first + step * f64::from(k);
                let t = stack.transmission(diameter, wavelength, orders)?;
                let index = stack.film.index(wavelength)?;
                let below = stack.substrate.index(wavelength)?;
                values.push(format!(
                    "{{\"pitch\": {pitch}, \"height\": {height}, \"wavelength\": {}, \"diameter\": {diameter}, \"film\": [{}, {}], \
                     \"below\": {}, \"t\": [{:.8}, {:.8}]}}",
                    wavelength * 1e3,
                    index.re,
                    index.im,
                    below.re,
                    t.re,
                    t.im
                ));
            }
        }
        println!("{{\"orders\": {along_axis}, \"points\": [{}]}}", values.join(", "));
    }
    Ok(())
}
