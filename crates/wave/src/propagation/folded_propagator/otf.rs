//! Contrast of all the light near a window, not of what the window holds: the autocorrelation of the field's spectrum.
//!
//! The optical transfer function at a frequency is the transform of the intensity over the whole plane, which is the
//! sum over the spectrum of the field of each amplitude times the conjugate of the one a frequency below it
//! (Goodman, Introduction to Fourier Optics, ch. 6). The spectrum is at hand before the window is formed, with all
//! rays that land within the fade; light beyond it is stray light without contrast, and counts in the power alone.

use ndarray::Array2;
use num_complex::{Complex32, Complex64};

use super::FoldedPropagator;
use super::planes::Plane;
use crate::error::Result;
use crate::kernels::product_sum;
use crate::propagation::{ApertureSet, Field, PlaneWave, Scratch};

/// Transfer of all the light that an element passes, at some frequencies.
#[derive(Clone, Debug, PartialEq)]
pub struct Otf {
    /// Frequencies (line pairs a millimetre).
    pub lp_mm: Vec<f64>,
    /// Transform of the intensity along x and along y [um^2, in units of |E_inc|^2]; the phase counts from the
    /// window's middle.
    pub transform_um2: [Vec<Complex64>; 2],
    /// Power that the element passes [um^2, in the same units]: the transform at zero frequency, of all light.
    pub power_um2: f64,
}

impl Otf {
    /// Sum of those of fields that do not interfere, times a share.
    ///
    /// # Panics
    /// If there is none, or they are at other frequencies.
    pub fn sum(all: &[Self], share: f64) -> Self {
        let mut sum = all[0].clone();
        sum.power_um2 = all.iter().map(|o| o.power_um2).sum::<f64>() * share;
        for (axis, values) in sum.transform_um2.iter_mut().enumerate() {
            for (i, value) in values.iter_mut().enumerate() {
                *value = all.iter().map(|o| o.transform_um2[axis][i]).sum::<Complex64>() * share;
            }
        }
        sum
    }

    /// Multiply the transform at each frequency (line pairs a millimetre) by what a camera leaves of it.
    pub fn scale(&mut self, factor: impl Fn(f64) -> f64) {
        for values in &mut self.transform_um2 {
            for (value, f) in values.iter_mut().zip(&self.lp_mm) {
                *value *= factor(*f);
            }
        }
    }

    /// Contrast along x and y at the `i`-th frequency: one if all light fell into one point.
    pub fn contrast(&self, i: usize) -> [f64; 2] {
        [0, 1].map(|axis| self.transform_um2[axis][i].norm() / self.power_um2)
    }
}

impl FoldedPropagator {
    /// The field of each aperture of a set in the window, and the transfer function of all its light at `lp_mm` (line pairs a
    /// millimetre).
    ///
    /// Between two bins of the transform the transfer function is interpolated: right for light that lands within a
    /// tenth of the period of the window's middle, less for what is farther and has no contrast there.
    ///
    /// # Errors
    /// As `Propagator::field`.
    pub(super) fn with_otfs(
        &self,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<(Field, Option<Otf>)>> {
        let period_um = self.band.fade.period_um;
        let at = |axis: usize, f: &f64| f * 1e-3 * period_um[axis];
        let shifts = [0, 1].map(|axis| {
            let around = |f| [at(axis, f) as usize, at(axis, f) as usize + 1];
            let mut shifts: Vec<usize> = lp_mm.iter().flat_map(around).collect();
            shifts.sort_unstable();
            shifts.dedup();
            shifts
        });
        let mut correlations = vec![Correlation::new(shifts, self.band.count[1]); set.count()];
        let planes = [Plane::field(self.window)];
        let powers_um2 = self.spectra(set, wave, &planes, scratch, &mut |number, column| {
            correlations[number].add(column);
        })?;
        let finished = |(number, (correlation, power_um2)): (usize, (&Correlation, f64))| {
            let transform_um2 = [0, 1].map(|axis| {
                let of = |shift: usize| correlation.sum(axis, shift) * period_um[0] * period_um[1];
                let between = |f: &f64| {
                    let (bin, share) = (at(axis, f) as usize, at(axis, f).fract());
                    of(bin) * (1.0 - share) + of(bin + 1) * share
                };
                lp_mm.iter().map(between).collect()
            });
            let otf = Otf {
                lp_mm: lp_mm.to_vec(),
                transform_um2,
                power_um2,
            };
            let mut values = Array2::zeros([self.window.samples; 2]);
            self.window_rows(number, scratch, &mut values.view_mut());
            (self.finished(values, wave), Some(otf))
        };
        Ok(correlations.iter().zip(powers_um2).enumerate().map(finished).collect())
    }
}

/// Autocorrelation of a spectrum that comes column by column, at some shifts along x and along y.
#[derive(Clone)]
struct Correlation {
    /// Bins along x and along y, ascending.
    shifts: [Vec<usize>; 2],
    sums: [Vec<Complex64>; 2],
    /// The last columns, as many as the greatest shift along x, and one.
    ring: Vec<Vec<Complex32>>,
    seen: usize,
}

impl Correlation {
    fn new(shifts: [Vec<usize>; 2], rows: usize) -> Self {
        let columns = shifts[0].last().copied().unwrap_or(0) + 1;
        Self {
            sums: [0, 1].map(|axis: usize| vec![Complex64::ZERO; shifts[axis].len()]),
            shifts,
            ring: vec![vec![Complex32::ZERO; rows]; columns],
            seen: 0,
        }
    }

    fn add(&mut self, column: &[Complex32]) {
        let columns = self.ring.len();
        let place = self.seen % columns;
        self.ring[place].copy_from_slice(column);
        let [along_x, along_y] = &mut self.sums;
        let [shifts_x, shifts_y] = &self.shifts;
        for (&shift, x) in shifts_x.iter().zip(along_x) {
            if shift <= self.seen {
                *x += product_sum(column, &self.ring[(self.seen - shift) % columns]);
            }
        }
        for (&shift, y) in shifts_y.iter().zip(along_y) {
            if shift < column.len() {
                *y += product_sum(&column[shift..], &column[..column.len() - shift]);
            }
        }
        self.seen += 1;
    }

    fn sum(&self, axis: usize, shift: usize) -> Complex64 {
        let place = self.shifts[axis]
            .binary_search(&shift)
            .expect("asked for when it was made");
        self.sums[axis][place]
    }
}

#[cfg(test)]
mod tests {
    use metalith_pillars::Lattice;

    use super::*;
    use crate::propagation::{Accuracy, Aperture, PhaseFunction, Propagator, Window};
    use crate::psf::Psf;

    const WAVELENGTH_UM: f64 = 0.53;
    const FOCAL_UM: f64 = 400.0;
    const RADIUS_UM: f64 = 40.0;
    const LP_MM: [f64; 4] = [20.0, 60.0, 150.0, 300.0];

    fn fold(samples: usize) -> FoldedPropagator {
        let window = Window {
            centre_um: [0.0; 2],
            step_um: 0.35,
            samples,
            distance_um: FOCAL_UM,
        };
        let lattice = Lattice::covering(80_000, 350).unwrap();
        FoldedPropagator::plan(lattice, RADIUS_UM, WAVELENGTH_UM, window, Accuracy::Accurate).unwrap()
    }

    /// A lens with the phase times a factor: one for a perfect lens, less for one that leaves stray light round its image.
    fn lens(strength: f64) -> PhaseFunction<impl Fn(f64, f64) -> f64 + Sync> {
        PhaseFunction {
            lattice: Lattice::covering(80_000, 350).unwrap(),
            radius_um: RADIUS_UM,
            amplitude: 1.0,
            phase_rad: move |x: f64, y: f64| {
                let path = (x * x + y * y + FOCAL_UM * FOCAL_UM).sqrt() - FOCAL_UM;
                -strength * std::f64::consts::TAU * path / WAVELENGTH_UM
            },
        }
    }

    fn formed(fold: &FoldedPropagator, lens: &dyn Aperture, wave: &PlaneWave) -> (Field, Otf) {
        let (field, otf) = fold.field_and_otf(lens, wave, &LP_MM, &mut Scratch::default()).unwrap();
        (field, otf.unwrap())
    }

    /// Two apertures whose rows are formed one after the other.
    struct Pair<'a>([&'a dyn Aperture; 2]);

    impl ApertureSet for Pair<'_> {
        fn lattice(&self) -> Lattice {
            self.0[0].lattice()
        }

        fn count(&self) -> usize {
            2
        }

        fn fill_rows(&self, iy: usize, rows: &mut [Complex32]) {
            let sites = self.lattice().sites();
            let each = self.0.iter().zip(rows.chunks_exact_mut(sites));
            each.for_each(|(aperture, row)| aperture.fill_row(iy, row));
        }
    }

    #[test]
    fn apertures_of_a_set_are_formed_as_each_alone_to_the_last_bit() {
        let (strong, weak) = (lens(1.0), lens(0.8));
        let wave = PlaneWave {
            wavelength_um: WAVELENGTH_UM,
            sin_x: 0.01,
            sin_y: -0.02,
        };
        for fold in [fold(48), fold(48).within(0)] {
            let pair = Pair([&strong, &weak]);
            let both = fold
                .fields_and_otfs(&pair, &wave, &LP_MM, &mut Scratch::default())
                .unwrap();
            for ((field, otf), lens) in both.into_iter().zip(pair.0) {
                let alone = formed(&fold, lens, &wave);
                assert!(field.values == alone.0.values && otf.unwrap() == alone.1);
            }
        }
    }

    #[test]
    fn a_perfect_lens_has_the_contrast_of_its_pupil() {
        /// The pupil is made of sites, and its rim is seen at an angle whose cosine is 0.995.
        const SITES_AND_ANGLE: f64 = 0.01;
        let wave = PlaneWave::normal(WAVELENGTH_UM);
        let (_, otf) = formed(&fold(64), &lens(1.0), &wave);
        for (i, f) in LP_MM.iter().enumerate() {
            // Overlap of two circles (Goodman, eq. 6-30).
            let x = f * 1e-3 * WAVELENGTH_UM * FOCAL_UM / (2.0 * RADIUS_UM);
            let want = std::f64::consts::FRAC_2_PI * (x.acos() - x * (1.0 - x * x).sqrt());
            for got in otf.contrast(i) {
                assert!((got - want).abs() < SITES_AND_ANGLE, "{f}: {got}, not {want}");
            }
        }
    }

    #[test]
    fn a_field_in_parts_is_the_whole_to_the_last_bit() {
        let wave = PlaneWave::normal(WAVELENGTH_UM);
        let whole = fold(48);
        let bytes = whole.spectra_bytes();
        assert_eq!(whole.parts(), 1);
        let whole = formed(&whole, &lens(0.8), &wave);
        for (part, parts) in [(bytes, 1), (bytes / 2, 3), (0, 0)] {
            let fold = fold(48).within(part);
            assert!(
                if parts > 0 {
                    fold.parts() <= parts
                } else {
                    fold.parts() > 5
                },
                "{}",
                fold.parts()
            );
            let (field, otf) = formed(&fold, &lens(0.8), &wave);
            assert!(field.values == whole.0.values && otf == whole.1);
        }
    }

    #[test]
    fn a_veil_outside_of_the_window_takes_contrast() {
        /// Tolerance as a share of the power that passes: light that a window of 210 um does not hold either, and
        /// interpolation of bins.
        const WIDE_WINDOW: f64 = 3e-3;
        let wave = PlaneWave::normal(WAVELENGTH_UM);
        let blurred = lens(0.8);
        let (field, otf) = formed(&fold(32), &blurred, &wave);
        let wide = Psf::of(&fold(600).field(&blurred, &wave, &mut Scratch::default()).unwrap());
        let narrow = Psf::of(&field);
        assert!(
            narrow.energy_um2() < 0.9 * otf.power_um2,
            "the window holds the whole image"
        );
        for (i, f) in LP_MM.iter().enumerate() {
            let exact = wide.window_otf([*f, 0.0]).norm() * wide.energy_um2() / otf.power_um2;
            let got = otf.contrast(i)[0];
            assert!((got - exact).abs() < WIDE_WINDOW, "{f}: {got}, not {exact}");
        }
    }
}
