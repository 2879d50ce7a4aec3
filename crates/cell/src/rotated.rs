//! The rigorous cell of rectangular pillars of one size, by their rotation.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_8};
use std::sync::{Mutex, PoisonError};

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_core::{Error, Rectangles, Result};
use metalith_rcwa::{Orders, circular};

use super::{CellModel, CellStack, Fidelity, Handedness, ObliqueTables, RotatedRectangle};

/// Rotations that are solved, from upright to an eighth of a turn: the lattice has the symmetries of the square, so that these
/// and their mirror images are evenly spaced over the quarter turn after which all repeats.
const SOLVED: usize = 7;

/// Rotations over the quarter turn that the solved ones stand for.
const SAMPLES: usize = 2 * (SOLVED - 1);

/// Diffraction orders an axis: of thirty cells of three materials all are within 0.005 in the complex transmission, of 17 orders
/// 22 (`scripts/shape_peers.py`). Seven rotations a wavelength bear that.
pub const ROTATED_ORDERS: usize = 25;

/// The same for one of many wavelengths of a band.
const BAND_ORDERS: usize = 9;

/// What rectangular pillars do to circularly polarised light, in an infinite lattice of pillars that are all rotated alike. By its
/// number a pillar is rotated as it is drawn, with its corners on the grid; that these also shear it a little is left out.
///
/// A pillar that is rotated by an angle converts light to the other circular polarisation with twice that angle as phase, more
/// or less: the lattice does not turn with it. What the lattice adds repeats every quarter turn, and is solved at a few
/// rotations and carried to all others by its Fourier series.
#[derive(Debug)]
pub struct RotatedCell {
    stack: CellStack,
    pillars: Rectangles,
    arriving: Handedness,
    /// By wavelength and orders.
    solved: Mutex<HashMap<(u64, usize), Series>>,
}

/// Fourier coefficients over a quarter turn, those of `exp(4 i m rotation)` for m from `-SAMPLES / 2`.
#[derive(Clone, Copy, Debug)]
struct Series {
    /// Of the converted light, less its geometric phase.
    converted: [Complex64; SAMPLES],
    unconverted: [Complex64; SAMPLES],
}

impl RotatedCell {
    /// The cell of these pillars in light of this handedness.
    pub fn new(stack: CellStack, pillars: Rectangles, arriving: Handedness) -> Self {
        Self {
            stack,
            pillars,
            arriving,
            solved: Mutex::default(),
        }
    }

    /// The pillars.
    pub fn pillars(&self) -> Rectangles {
        self.pillars
    }

    /// The handedness of the light.
    pub fn arriving(&self) -> Handedness {
        self.arriving
    }

    /// Converted and unconverted light of a pillar of any rotation (rad), as ratios of fields.
    ///
    /// # Errors
    /// As [`CellStack::jones`].
    pub fn response(&self, rotation: f64, wavelength_um: f64) -> Result<[Complex64; 2]> {
        Ok(self.series(wavelength_um, ROTATED_ORDERS)?.at(rotation, self.arriving))
    }

    fn series(&self, wavelength_um: f64, orders: usize) -> Result<Series> {
        let key = (wavelength_um.to_bits(), orders);
        let known = self
            .solved
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get(&key)
            .copied();
        if let Some(series) = known {
            return Ok(series);
        }
        let series = self.solve(wavelength_um, Orders::new(orders)?)?;
        self.solved
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(key, series);
        Ok(series)
    }

    fn solve(&self, wavelength_um: f64, orders: Orders) -> Result<Series> {
        let jones: Vec<[[Complex64; 2]; 2]> = (0..SOLVED)
            .into_par_iter()
            .map(|k| {
                let pillar = RotatedRectangle {
                    width_nm: f64::from(self.pillars.width_nm),
                    length_nm: f64::from(self.pillars.length_nm),
                    rotation: rotation_of(k),
                };
                Ok(circular(self.stack.jones(&pillar, wavelength_um, [0.0; 2], orders)?))
            })
            .collect::<Result<_>>()?;
        let (from, to) = match self.arriving {
            Handedness::Left => (0, 1),
            Handedness::Right => (1, 0),
        };
        // A mirror turns the pillar back and one handedness into the other.
        let samples: [[Complex64; 2]; SAMPLES] = std::array::from_fn(|k| {
            if k < SOLVED {
                [jones[k][to][from], jones[k][from][from]]
            } else {
                let mirrored = &jones[SAMPLES - k];
                [mirrored[from][to], mirrored[to][to]]
            }
        });
        let less_geometric = std::array::from_fn(|k| {
            let rotation = if k < SOLVED {
                rotation_of(k)
            } else {
                -rotation_of(SAMPLES - k)
            };
            samples[k][0] * Complex64::cis(-self.arriving.geometric_phase(rotation))
        });
        Ok(Series {
            converted: coefficients(less_geometric),
            unconverted: coefficients(samples.map(|s| s[1])),
        })
    }

    fn table(&self, wavelength_um: f64, orders: usize, most: u16, which: usize) -> Result<Vec<Complex64>> {
        let series = self.series(wavelength_um, orders)?;
        let of = |number: u16| series.at(self.pillars.drawn_rotation(number), self.arriving)[which];
        Ok(std::iter::once(Complex64::ZERO).chain((1..=most).map(of)).collect())
    }
}

/// One of the solved rotations (rad).
fn rotation_of(k: usize) -> f64 {
    2.0 * FRAC_PI_8 * k as f64 / (SOLVED - 1) as f64
}

/// Coefficients of samples over a quarter turn.
fn coefficients(samples: [Complex64; SAMPLES]) -> [Complex64; SAMPLES] {
    std::array::from_fn(|m| {
        let order = m as f64 - (SAMPLES / 2) as f64;
        let term =
            |(k, t): (usize, &Complex64)| t * Complex64::cis(-4.0 * order * FRAC_PI_2 * k as f64 / SAMPLES as f64);
        samples.iter().enumerate().map(term).sum::<Complex64>() / SAMPLES as f64
    })
}

impl Series {
    fn at(&self, rotation: f64, arriving: Handedness) -> [Complex64; 2] {
        let sum = |coefficients: &[Complex64; SAMPLES]| -> Complex64 {
            let term = |(m, c): (usize, &Complex64)| match m {
                // The fastest of an even number of samples has no sign.
                0 => c * (2.0 * SAMPLES as f64 * rotation).cos(),
                _ => c * Complex64::cis(4.0 * (m as f64 - (SAMPLES / 2) as f64) * rotation),
            };
            coefficients.iter().enumerate().map(term).sum()
        };
        let geometric = Complex64::cis(arriving.geometric_phase(rotation));
        [sum(&self.converted) * geometric, sum(&self.unconverted)]
    }
}

impl CellModel for RotatedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    /// Of the converted light, with the number of the rotation as index.
    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.table(wavelength_um, ROTATED_ORDERS, max_width_nm, 0)
    }

    fn transmissions_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.table(wavelength_um, BAND_ORDERS, max_width_nm, 0)
    }

    fn unconverted(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Option<Vec<Complex64>>> {
        self.table(wavelength_um, ROTATED_ORDERS, max_width_nm, 1).map(Some)
    }

    fn unconverted_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Option<Vec<Complex64>>> {
        self.table(wavelength_um, BAND_ORDERS, max_width_nm, 1).map(Some)
    }

    fn oblique(&self, _wavelength_um: f64, _sines: [f64; 2], _max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        Err(Error::invalid(
            "rectangular pillars in light that arrives at an angle",
            "leave out --as-lit, or set `incidence = \"normal\"` in [verify]: their cells are solved along the normal",
        ))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.stack.full_transmission(wavelength_um)
    }
}

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::titania;
    use super::*;

    const PILLARS: Rectangles = Rectangles {
        width_nm: 100,
        length_nm: 250,
        steps: 180,
    };

    /// Between the solved rotations, of |t| near 1.1: what the series leaves out; ten times more with five rotations.
    const BETWEEN: f64 = 5e-4;

    /// Both channels at rotations between those that are solved, and at mirrored ones, against the solver itself.
    #[test]
    fn the_series_meets_the_solver_between_its_samples() {
        for arriving in [Handedness::Left, Handedness::Right] {
            let cell = RotatedCell::new(titania(), PILLARS, arriving);
            let (from, to) = match arriving {
                Handedness::Left => (0, 1),
                Handedness::Right => (1, 0),
            };
            for degrees in [7.0_f64, 31.0, 70.0, 124.0] {
                let number = PILLARS.number(degrees.to_radians());
                let pillar = RotatedRectangle {
                    width_nm: 100.0,
                    length_nm: 250.0,
                    rotation: PILLARS.drawn_rotation(number),
                };
                let orders = Orders::new(BAND_ORDERS).unwrap();
                let exact = circular(titania().jones(&pillar, 0.532, [0.0; 2], orders).unwrap());
                let converted = cell.transmissions_in_band(0.532, 180).unwrap()[usize::from(number)];
                let unconverted = cell.unconverted_in_band(0.532, 180).unwrap().unwrap()[usize::from(number)];
                let (a, b) = (
                    (converted - exact[to][from]).norm(),
                    (unconverted - exact[from][from]).norm(),
                );
                assert!(a < BETWEEN && b < BETWEEN, "{arriving:?} {degrees}: {a} {b}");
            }
        }
    }
}
