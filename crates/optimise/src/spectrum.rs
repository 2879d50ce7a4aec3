//! Pictures of a broadband lens: PSF and MTF over wavelength, on the axis.

use ndarray::Array2;
use num_complex::Complex64;
use rayon::prelude::*;

use super::PixelWindow;
use super::focus::Lens;
use super::imaging::{Imaging, Room};
use super::kernel::RingField;
use super::pupil::Pupil;
use metalith_cell::CellModel;
use metalith_core::Result;
use metalith_wave::kernels::Bessel;

/// One lens with each of several phases, over wavelength.
pub struct OverWavelength<'a> {
    /// The lens.
    pub lens: &'a Lens,
    /// The cell.
    pub cell: &'a dyn CellModel,
    /// Widths of the rings (nm), one list for each phase.
    pub widths_nm: &'a [&'a [u16]],
}

impl OverWavelength<'_> {
    /// Intensity |E|^2 / |E_inc|^2 averaged around the axis: for each phase, `[radius, wavelength]`.
    ///
    /// # Errors
    /// If the cell does not cover a wavelength.
    pub fn psf(&self, radii_um: &[f64], wavelengths_um: &[f64]) -> Result<Vec<Array2<f64>>> {
        let edge = 0.5e-3 * f64::from(self.lens.rings.diameter_nm());
        let shortest = wavelengths_um.iter().copied().fold(f64::MAX, f64::min);
        let farthest = radii_um.iter().copied().fold(0.0, f64::max);
        let bessel = Bessel::up_to(std::f64::consts::TAU / shortest * edge * farthest / self.lens.gap_um);
        let columns = wavelengths_um
            .par_iter()
            .map(|&wavelength| {
                let t = self.cell.transmissions(wavelength, self.widest())?;
                let field = RingField::new(&self.lens.rings, wavelength, self.lens.gap_um);
                let column = radii_um
                    .iter()
                    .map(|&rho| {
                        let mut sums = vec![Complex64::ZERO; self.widths_nm.len()];
                        for ring in 0..self.lens.rings.len() {
                            let e = field.at_radius(ring, rho, &bessel);
                            for (sum, widths) in sums.iter_mut().zip(self.widths_nm) {
                                *sum += e * t[usize::from(widths[ring])];
                            }
                        }
                        sums.into_iter().map(|e| e.norm_sqr()).collect::<Vec<_>>()
                    })
                    .collect::<Vec<_>>();
                Ok(column)
            })
            .collect::<Result<Vec<_>>>()?;
        Ok((0..self.widths_nm.len())
            .map(|i| Array2::from_shape_fn((radii_um.len(), wavelengths_um.len()), |(r, l)| columns[l][r][i]))
            .collect())
    }

    /// MTF at half and at all of the pixels' Nyquist frequency, pixel included: for each phase, one pair for
    /// each wavelength.
    ///
    /// # Errors
    /// If the cell does not cover a wavelength.
    pub fn mtf(&self, window: PixelWindow, wavelengths_um: &[f64]) -> Result<Vec<Vec<(f64, f64)>>> {
        let at_wavelength = wavelengths_um
            .par_iter()
            .map(|&wavelength| {
                let t = self.cell.transmissions(wavelength, self.widest())?;
                let pupil = Pupil::new(self.lens, wavelength, 0.0, window, 0.0)?;
                let pairs = self.widths_nm.iter().map(|widths| {
                    let (re, im): (Vec<_>, Vec<_>) = widths
                        .iter()
                        .map(|&w| (t[usize::from(w)].re as f32, t[usize::from(w)].im as f32))
                        .unzip();
                    let h = Imaging::new(&pupil, window, Room::default()).transfer(&re, &im);
                    let ratio = |i: usize| f64::from(h[i].norm() / h[0].norm());
                    (ratio(window.pixels / 4), ratio(window.pixels / 2))
                });
                Ok(pairs.collect::<Vec<_>>())
            })
            .collect::<Result<Vec<_>>>()?;
        Ok((0..self.widths_nm.len())
            .map(|i| at_wavelength.iter().map(|pairs| pairs[i]).collect())
            .collect())
    }

    fn widest(&self) -> u16 {
        self.widths_nm.iter().flat_map(|w| w.iter()).copied().max().unwrap_or(0)
    }
}
