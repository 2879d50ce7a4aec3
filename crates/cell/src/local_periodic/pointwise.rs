//! Local periodic approximation at a few wavelengths, without a table.

use std::path::{Path, PathBuf};

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use crate::cache_file::{CacheEntry, bytes_of, complex_of, solver_of};
use crate::{CellModel, CellResponse, CellStack, Fidelity, Illumination, JonesTables, ObliqueTables, Spectral};
use metalith_core::{Progress, Result, Silent};
use metalith_rcwa::Orders;

/// Median phase error over the cell's whole range 0.002 rad: finer than the table, and for a few
/// wavelengths faster than making one.
pub const ORDERS: usize = 17;

/// Number of orders for oblique light, where less is saved by symmetry: median error 0.007 rad.
pub const OBLIQUE_ORDERS: usize = 11;

/// Number of orders for one of many wavelengths of a band: resonances move by some 0.3 nm, which no average over a band
/// shows.
pub const BAND_ORDERS: usize = 9;

/// Number of orders for oblique light of one of many wavelengths of a band.
pub const OBLIQUE_BAND_ORDERS: usize = 7;

/// Solves every width of a list at each wavelength that is asked for.
///
/// Seconds for the wavelengths of a run, where the table of [`super::RigorousCell`] takes minutes once;
/// and the same answer whether or not a table is at hand.
#[derive(Clone, Debug)]
pub struct PointwiseCell {
    stack: CellStack,
    widths_nm: Vec<u16>,
    orders: Orders,
    /// Folder of the cache of what is solved along the normal.
    folder: Option<PathBuf>,
}

const MAGIC: [u8; 8] = *b"MLLINE\0\x01";

impl PointwiseCell {
    /// The cell for these widths (nm). Widths between them are interpolated, those beyond them get the
    /// nearest.
    pub fn new(stack: CellStack, widths_nm: impl IntoIterator<Item = u16>) -> Self {
        let orders = Orders::new(ORDERS).expect("a constant that is odd and not large");
        Self::with_orders(stack, widths_nm, orders)
    }

    /// Cell with another number of diffraction orders.
    pub fn with_orders(stack: CellStack, widths_nm: impl IntoIterator<Item = u16>, orders: Orders) -> Self {
        let mut widths_nm = widths_nm.into_iter().filter(|w| *w > 0).collect::<Vec<_>>();
        widths_nm.sort_unstable();
        widths_nm.dedup();
        Self {
            stack,
            widths_nm,
            orders,
            folder: None,
        }
    }

    /// This cell, whose answers along the normal are cached in a folder from one run to the next.
    #[must_use]
    pub fn cached_in(mut self, folder: Option<&Path>) -> Self {
        self.folder = folder.map(Path::to_owned);
        self
    }

    /// Table of its widths along the normal in the cache.
    fn entry(&self, wavelength_um: f64, orders: Orders) -> CacheEntry {
        #[derive(Serialize)]
        struct Inputs<'a> {
            solver: u32,
            stack: &'a CellStack,
            widths_nm: &'a [u16],
            wavelength_um: f64,
            orders: usize,
        }
        let inputs = Inputs {
            solver: solver_of(self.stack.shape),
            stack: &self.stack,
            widths_nm: &self.widths_nm,
            wavelength_um,
            orders: orders.along_axis(),
        };
        let inputs = serde_json::to_vec(&inputs).expect("plain data serialises");
        CacheEntry::new(self.folder.as_deref(), "line", MAGIC, inputs, "pillars at a wavelength")
    }

    /// Transmissions of its widths along the normal.
    fn solved(&self, orders: Orders, wavelength_um: f64, progress: &dyn Progress) -> Result<Vec<Complex64>> {
        let table = self.entry(wavelength_um, orders);
        let decode = |content: &[u8]| complex_of(content).filter(|t| t.len() == self.widths_nm.len());
        if let Some(solved) = table.read(decode, progress) {
            return Ok(solved);
        }
        let one = |w| self.stack.transmission(f64::from(w), wavelength_um, orders);
        let solved = solve_widths(&self.widths_nm, one, wavelength_um, progress)?;
        table.write(&bytes_of(solved.iter().copied()), progress);
        Ok(solved)
    }

    /// Orders, at most as many as the cell was made with.
    fn at_most(&self, orders: usize) -> Result<Orders> {
        Ok(Orders::new(orders.min(self.orders.along_axis()))?)
    }

    fn normal(
        &self,
        orders: usize,
        wavelength_um: f64,
        max_width_nm: u16,
        progress: &dyn Progress,
    ) -> Result<Vec<Complex64>> {
        let solved = self.solved(self.at_most(orders)?, wavelength_um, progress)?;
        Ok(spread(&self.widths_nm, &solved, max_width_nm))
    }

    fn tilted(
        &self,
        orders: usize,
        wavelength_um: f64,
        sines: [f64; 2],
        max_width_nm: u16,
        progress: &dyn Progress,
    ) -> Result<ObliqueTables> {
        let orders = self.at_most(orders)?;
        let solve = |w| {
            let [[ss, sp], [ps, pp]] = self.stack.oblique(f64::from(w), wavelength_um, sines, orders)?;
            Ok([ss, pp, sp, ps])
        };
        let solved = solve_widths(&self.widths_nm, solve, wavelength_um, progress)?;
        let [ss, pp, sp, ps] = std::array::from_fn(|k| {
            let own: Vec<Complex64> = solved.iter().map(|t: &[Complex64; 4]| t[k]).collect();
            spread(&self.widths_nm, &own, max_width_nm)
        });
        Ok(ObliqueTables {
            kept: [ss, pp],
            turned: [sp, ps],
        })
    }
}

impl CellModel for PointwiseCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, widest_nm: u16, progress: &dyn Progress) -> Result<CellResponse> {
        let (um, sines) = (light.wavelength_um, light.cell_sines());
        // Of a band whoever asks says how far it is.
        let progress = if light.spectral == Spectral::InBand {
            &Silent
        } else {
            progress
        };
        if sines == [0.0; 2] {
            let orders = light.spectral.choose(self.orders.along_axis(), BAND_ORDERS);
            return self.normal(orders, um, widest_nm, progress).map(CellResponse::Scalar);
        }
        let orders = light.spectral.choose(OBLIQUE_ORDERS, OBLIQUE_BAND_ORDERS);
        let tables = self.tilted(orders, um, sines, widest_nm, progress)?;
        Ok(CellResponse::Jones(JonesTables::Oblique(tables)))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.stack.full_transmission(wavelength_um)
    }
}

/// Solution for each width (nm) at a wavelength (um), with progress.
fn solve_widths<T: Send>(
    widths_nm: &[u16],
    solve: impl Fn(u16) -> Result<T> + Sync,
    wavelength_um: f64,
    progress: &dyn Progress,
) -> Result<Vec<T>> {
    progress.begin(
        &format!("pillars at {:.1} nm", wavelength_um * 1e3),
        widths_nm.len() as u64,
    );
    let one = |&width_nm: &u16| {
        progress.check_stopped()?;
        let solved = solve(width_nm);
        progress.advance(1);
        solved
    };
    widths_nm.par_iter().map(one).collect()
}

/// A table over all widths (nm): straight lines between those that were solved, the nearest beyond, nothing at
/// zero.
fn spread(widths_nm: &[u16], solved: &[Complex64], max_width_nm: u16) -> Vec<Complex64> {
    let at = |width: u16| {
        let above = widths_nm
            .partition_point(|&w| w < width)
            .min(solved.len().saturating_sub(1));
        let below = above.saturating_sub(1);
        let (low, high) = (f64::from(*widths_nm.get(below)?), f64::from(*widths_nm.get(above)?));
        let share = if high > low {
            ((f64::from(width) - low) / (high - low)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        Some(solved[below] * (1.0 - share) + solved[above] * share)
    };
    let mut table = vec![Complex64::ZERO];
    table.extend((1..=max_width_nm).map(|w| at(w).unwrap_or(Complex64::ZERO)));
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Material;

    /// Mean power of a band by few orders equals the result by many orders.
    #[test]
    fn fewer_orders_do_for_the_mean_over_a_band() {
        /// Tolerance of the mean power that passes over 400 to 700 nm and all widths; of the mean |t - t exact| / |t|.
        const POWER: f64 = 0.005;
        const AMPLITUDE: f64 = 0.05;
        let cell = PointwiseCell::new(crate::stack::tests::paper(), (100..=300).step_by(20));
        let (mut power, mut exact, mut apart, mut count) = (0.0, 0.0, 0.0, 0.0);
        for um in (0..24).map(|i| 0.406_25 + 0.0125 * f64::from(i)) {
            let coarse = cell
                .response(&Illumination::normal(um).in_band(), 300, &Silent)
                .unwrap();
            let coarse = coarse.focused().unwrap();
            let fine = cell.transmissions(um, 300).unwrap();
            for w in (100..=300).step_by(20) {
                power += coarse[w].norm_sqr();
                exact += fine[w].norm_sqr();
                apart += (coarse[w] - fine[w]).norm() / fine[w].norm();
                count += 1.0;
            }
        }
        let (power, apart) = (f64::abs(power / exact - 1.0), apart / count);
        println!("power {power}, amplitude {apart}");
        assert!(power < POWER && apart < AMPLITUDE, "{power} {apart}");
    }

    #[test]
    fn fewer_orders_do_for_the_mean_of_oblique_light() {
        /// Tolerance of the mean power that passes over 410 to 690 nm, some widths and both polarisations.
        const POWER: f64 = 0.02;
        let cell = PointwiseCell::new(crate::stack::tests::paper(), [120, 160, 200, 240]);
        let power = |light: Illumination<'_>| -> f64 {
            let CellResponse::Jones(JonesTables::Oblique(tables)) = cell.response(&light, 300, &Silent).unwrap() else {
                panic!("the cell knows angles")
            };
            let widths = [120, 160, 200, 240];
            tables.passed().flat_map(|t| widths.map(|w| t[w].norm_sqr())).sum()
        };
        let (mut coarse, mut fine) = (0.0, 0.0);
        for um in (0..8).map(|i| 0.41 + 0.04 * f64::from(i)) {
            let light = Illumination::from_direction(um, [-0.2588, 0.0]).oblique();
            coarse += power(light.in_band());
            fine += power(light);
        }
        println!("{coarse} {fine}");
        assert!((coarse / fine - 1.0).abs() < POWER, "{coarse} {fine}");
    }

    /// What was solved once is the same to the last bit when it is read again.
    #[test]
    fn a_cached_table_is_the_solved_one() {
        let folder = tempfile::tempdir().unwrap();
        let cell = PointwiseCell::with_orders(crate::stack::tests::paper(), [120, 160], Orders::new(3).unwrap());
        let solved = cell.transmissions(0.6, 160).unwrap();
        let cached = cell.cached_in(Some(folder.path()));
        assert_eq!(cached.transmissions(0.6, 160).unwrap(), solved);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(cached.transmissions(0.6, 160).unwrap(), solved);
    }

    #[test]
    fn widths_of_the_list_are_solved_and_others_lie_between() {
        let stack = CellStack {
            film: Material::constant(2.0, 0.0).unwrap(),
            ..crate::stack::tests::paper()
        };
        let orders = Orders::new(ORDERS).unwrap();
        let direct = |w: f64| stack.transmission(w, 0.6, orders).unwrap();
        let table = PointwiseCell::new(stack.clone(), [140, 120, 120])
            .transmissions(0.6, 160)
            .unwrap();
        assert_eq!(
            (table[120], table[140], table[0]),
            (direct(120.0), direct(140.0), Complex64::ZERO)
        );
        // One sum and one product of numbers of size one.
        const ROUNDING: f64 = 1e-14;
        assert!((table[130] - 0.5 * (table[120] + table[140])).norm() < ROUNDING);
        assert_eq!((table[100], table[160]), (table[120], table[140]));
    }
}
