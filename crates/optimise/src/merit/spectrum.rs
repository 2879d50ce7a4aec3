//! Pictures of a broadband lens: PSF and MTF over wavelength, on the axis.

use ndarray::Array2;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::merit::focus::Lens;
use crate::rings::kernel::RingField;
use metalith_cell::CellModel;
use metalith_core::Result;
use metalith_wave::psf::{PixelFrequencies, pixel_mtf};
use metalith_wave::{Accuracy, FoldedPropagator, Pillars, PlaneWave, Psf, Scratch, Window};

/// Samples of the window about the focus that contrast is computed with; light outside of it counts too.
const WINDOW_SAMPLES: usize = 128;

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
        let shortest = wavelengths_um.iter().copied().fold(f64::MAX, f64::min);
        let farthest = radii_um.iter().copied().fold(0.0, f64::max);
        let bessel = RingField::new(&self.lens.rings, shortest, self.lens.distance_um).bessel(farthest);
        let columns = wavelengths_um
            .par_iter()
            .map(|&wavelength| {
                let of = |widths: &&[u16]| self.lens.transmissions_of_rings(widths, self.cell, wavelength);
                let t = self.widths_nm.iter().map(of).collect::<Result<Vec<_>>>()?;
                let field = RingField::new(&self.lens.rings, wavelength, self.lens.distance_um);
                let column = radii_um
                    .iter()
                    .map(|&rho| {
                        let mut sums = vec![Complex64::ZERO; self.widths_nm.len()];
                        for ring in 0..self.lens.rings.len() {
                            let e = field.at_radius(ring, rho, &bessel);
                            for (sum, t) in sums.iter_mut().zip(&t) {
                                *sum += e * t[ring];
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

    /// Contrast of all light with pixels of `pixel_um`, as for the PSFs of a layout: for each phase, one pair for each
    /// wavelength, at [`PixelFrequencies::reported`].
    ///
    /// # Errors
    /// If the cell does not cover a wavelength.
    pub fn mtf(&self, pixel_um: f64, wavelengths_um: &[f64]) -> Result<Vec<Vec<(f64, f64)>>> {
        let (rings, focus_um) = (&self.lens.rings, self.lens.distance_um);
        let lattice = rings.lattice();
        let radius_um = 0.5e-3 * f64::from(rings.diameter_nm());
        // By the number of the ring, from one: sites of a ring are taken to transmit alike. A map of more rings could not be held.
        let numbers: Vec<u16> = (1..=u16::MAX).take(rings.len()).collect();
        let pillars = rings.width_map(&numbers);
        let window = Window::about([0.0; 2], lattice.pitch_um(), WINDOW_SAMPLES, focus_um);
        let reported = PixelFrequencies::of(pixel_um).reported();
        let contrast = |scratch: &mut Scratch, &wavelength_um: &f64| {
            let wave = PlaneWave::normal(wavelength_um);
            let fold = FoldedPropagator::plan(lattice, radius_um, wavelength_um, window, Accuracy::Fast)?;
            let mut of = |widths: &&[u16]| {
                let mut table = vec![Complex64::ZERO];
                table.extend(self.lens.transmissions_of_rings(widths, self.cell, wavelength_um)?);
                let psf = Psf::formed(&fold, &Pillars::new(&pillars, &table)?, &wave, &reported, scratch)?;
                let [half, all] = reported.map(|f| psf.contrast(0, f) * pixel_mtf(pixel_um, f));
                Ok((half, all))
            };
            self.widths_nm.iter().map(&mut of).collect::<Result<Vec<_>>>()
        };
        let at_wavelength = wavelengths_um
            .par_iter()
            .map_init(Scratch::default, contrast)
            .collect::<Result<Vec<_>>>()?;
        Ok((0..self.widths_nm.len())
            .map(|i| at_wavelength.iter().map(|pairs| pairs[i]).collect())
            .collect())
    }
}
