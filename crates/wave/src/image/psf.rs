//! A point spread function on a window, and what is measured of it.

use ndarray::{Array2, Axis};
use serde::Serialize;

use super::{HALF_NYQUIST_LP_MM, Matched, NYQUIST_LP_MM, pixel_mtf};
use crate::{Field, Window};
use metalith_core::{Error, Result};

/// |E|^2 / |E_inc|^2 on a window of the sensor's plane, E_inc in the medium of incidence.
///
/// Energies are integrals over the sensor's plane of the function through the samples that has no frequencies
/// beyond half their rate: exact where the step is at most wavelength / (4 NA).
#[derive(Clone, Debug, PartialEq)]
pub struct Psf {
    /// Where the samples are.
    pub window: Window,
    /// Shape `[samples, samples]`, row index along +y, column index along +x.
    pub values: Array2<f64>,
}

/// The numbers that two PSFs are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PsfMeasures {
    /// Largest sample over the peak of the same aperture with all its power and the perfect phase.
    pub strehl: f64,
    /// Place of the largest sample from the element's centre, x and y [um].
    pub peak_um: [f64; 2],
    /// Centre of gravity of the window from the element's centre, x and y [um].
    pub centroid_um: [f64; 2],
    /// Energy in a square of one pixel about the peak, over what the perfect aperture passes.
    pub energy_1_pixel: f64,
    /// The same in a square of two pixels an edge.
    pub energy_2_pixels: f64,
    /// Energy in the whole window, over the same.
    pub energy_window: f64,
    /// MTF at 42.7 line pairs a millimetre along x and y.
    pub mtf_half_nyquist: [f64; 2],
    /// MTF at 85.3 line pairs a millimetre along x and y.
    pub mtf_nyquist: [f64; 2],
    /// The first times the MTF of a pixel.
    pub mtf_half_nyquist_pixel: [f64; 2],
    /// The second times the MTF of a pixel.
    pub mtf_nyquist_pixel: [f64; 2],
}

impl Psf {
    /// Of a field of a unit wave.
    pub fn of(field: &Field) -> Self {
        Self {
            window: field.window,
            values: field.values.map(|e| f64::from(e.re).powi(2) + f64::from(e.im).powi(2)),
        }
    }

    /// Mean of PSFs on the same window, as of light that is not polarised.
    ///
    /// # Panics
    /// If there is none, or their windows are of different sizes.
    pub fn mean(psfs: Vec<Self>) -> Self {
        let share = 1.0 / psfs.len() as f64;
        let mut all = psfs.into_iter();
        let mut sum = all.next().expect("a PSF to take the mean of");
        for psf in all {
            sum.values += &psf.values;
        }
        if share < 1.0 {
            sum.values *= share;
        }
        sum
    }

    /// All numbers that are reported of a PSF.
    pub fn measures(&self, matched: &Matched, pixel_um: f64) -> PsfMeasures {
        let (peak, peak_um) = self.peak();
        let mtf = |lp_mm: f64| [0, 1].map(|axis| self.mtf_curve(axis, &[lp_mm])[0]);
        let seen = |lp_mm: f64| mtf(lp_mm).map(|m| m * pixel_mtf(pixel_um, lp_mm));
        let share = |edge_um| self.energy_in_square_um2(peak_um, edge_um) / matched.power_um2;
        PsfMeasures {
            strehl: peak / matched.peak,
            peak_um,
            centroid_um: self.centroid_um(),
            energy_1_pixel: share(pixel_um),
            energy_2_pixels: share(2.0 * pixel_um),
            energy_window: self.energy_um2() / matched.power_um2,
            mtf_half_nyquist: mtf(HALF_NYQUIST_LP_MM),
            mtf_nyquist: mtf(NYQUIST_LP_MM),
            mtf_half_nyquist_pixel: seen(HALF_NYQUIST_LP_MM),
            mtf_nyquist_pixel: seen(NYQUIST_LP_MM),
        }
    }

    /// The largest sample and its place from the element's centre [um]; of equals the first in reading order.
    pub fn peak(&self) -> (f64, [f64; 2]) {
        let mut best = (f64::NEG_INFINITY, [0, 0]);
        for ((iy, ix), &v) in self.values.indexed_iter() {
            if v > best.0 {
                best = (v, [ix, iy]);
            }
        }
        let (value, [ix, iy]) = best;
        (
            value,
            [self.window.coordinate_um(0, ix), self.window.coordinate_um(1, iy)],
        )
    }

    /// Energy in the window [um^2], in units of |E_inc|^2.
    pub fn energy_um2(&self) -> f64 {
        self.values.sum() * self.window.step_um.powi(2)
    }

    /// Centre of gravity from the element's centre, x and y [um].
    pub fn centroid_um(&self) -> [f64; 2] {
        let total = self.values.sum();
        [0, 1].map(|axis| {
            let line = self.line_spread(axis);
            let moments = line.iter().enumerate();
            moments
                .map(|(i, v)| v * self.window.coordinate_um(axis, i))
                .sum::<f64>()
                / total
        })
    }

    /// Sum over the other axis, the image of a line. Axis 0 is x.
    pub fn line_spread(&self, axis: usize) -> Vec<f64> {
        self.values.sum_axis(Axis(axis)).to_vec()
    }

    /// Energy in a square with edges along x and y [um^2].
    pub fn energy_in_square_um2(&self, centre_um: [f64; 2], edge_um: f64) -> f64 {
        let weights = [0, 1].map(|axis| self.interval(axis, centre_um[axis], edge_um));
        let rows = self.values.rows().into_iter().zip(&weights[1]);
        rows.map(|(row, wy)| wy * row.iter().zip(&weights[0]).map(|(v, wx)| v * wx).sum::<f64>())
            .sum()
    }

    /// Energy in a circle [um^2]. Each sample stands for its square, of which parts of a sixteenth an edge are
    /// counted: good to a percent of a sample's width in radius.
    pub fn energy_in_circle_um2(&self, centre_um: [f64; 2], radius_um: f64) -> f64 {
        const PARTS: usize = 16;
        let step = self.window.step_um;
        let part = |i: usize| ((i as f64 + 0.5) / PARTS as f64 - 0.5) * step;
        let mut sum = 0.0;
        for ((iy, ix), &v) in self.values.indexed_iter() {
            let x = self.window.coordinate_um(0, ix) - centre_um[0];
            let y = self.window.coordinate_um(1, iy) - centre_um[1];
            let (r, reach) = (x.hypot(y), 0.75 * step);
            if r < radius_um - reach {
                sum += v;
            } else if r < radius_um + reach {
                let inside = (0..PARTS * PARTS)
                    .filter(|i| (x + part(i % PARTS)).hypot(y + part(i / PARTS)) < radius_um)
                    .count();
                sum += v * inside as f64 / (PARTS * PARTS) as f64;
            }
        }
        sum * step * step
    }

    /// What a camera with square, gapless pixels sees of a point: the energy in each of `pixels` x `pixels` [um^2],
    /// with the middle of the array at `centre_um`.
    ///
    /// # Errors
    /// If the pixels have no size or reach beyond the window.
    pub fn on_pixels(&self, centre_um: [f64; 2], pixel_um: f64, pixels: usize) -> Result<Array2<f64>> {
        let reach = 0.5 * pixels as f64 * pixel_um;
        let room = self.window.half_width_um() + 0.5 * self.window.step_um;
        let inside = (0..2).all(|a| (centre_um[a] - self.window.centre_um[a]).abs() + reach <= room * (1.0 + 1e-9));
        if !(pixel_um > 0.0 && pixels > 0 && inside) {
            return Err(Error::invalid(
                format!("{pixels} pixels of {pixel_um} um about {centre_um:?} um do not fit into the window"),
                "use fewer pixels, or form the PSF on a larger window",
            ));
        }
        let [wx, wy] = [0, 1].map(|axis| {
            let mut weights = Array2::zeros((pixels, self.window.samples));
            for (i, mut row) in weights.rows_mut().into_iter().enumerate() {
                let middle = centre_um[axis] + (i as f64 - 0.5 * (pixels as f64 - 1.0)) * pixel_um;
                for (w, v) in row.iter_mut().zip(self.interval(axis, middle, pixel_um)) {
                    *w = v;
                }
            }
            weights
        });
        Ok(wy.dot(&self.values).dot(&wx.t()))
    }

    /// Root mean square difference from `reference`, over the root mean square of `reference`.
    ///
    /// # Errors
    /// If the windows differ in their samples.
    pub fn difference(&self, reference: &Self) -> Result<f64> {
        self.compare(reference, 1.0)
    }

    /// The same with both brought to the same energy: what differs in shape alone.
    ///
    /// # Errors
    /// If the windows differ in their samples.
    pub fn shape_difference(&self, reference: &Self) -> Result<f64> {
        self.compare(reference, reference.values.sum() / self.values.sum())
    }

    fn compare(&self, reference: &Self, scale: f64) -> Result<f64> {
        if self.values.dim() != reference.values.dim() || self.window.step_um != reference.window.step_um {
            return Err(Error::invalid(
                "PSFs on windows of different samples cannot be compared",
                "form both on the same number of samples and with the same step",
            ));
        }
        let pairs = self.values.iter().zip(&reference.values);
        let squares: f64 = pairs.map(|(a, b)| (a * scale - b).powi(2)).sum();
        let norm: f64 = reference.values.iter().map(|b| b * b).sum();
        Ok((squares / norm).sqrt())
    }

    /// Weights of the samples of an axis in the integral over an interval [um]: each term of the finite Fourier
    /// series through the samples is integrated exactly.
    fn interval(&self, axis: usize, middle_um: f64, length_um: f64) -> Vec<f64> {
        let n = self.window.samples;
        let period = n as f64 * self.window.step_um;
        let terms: Vec<f64> = (0..=n / 2)
            .map(|k| {
                let pair = if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
                pair * sinc(k as f64 * length_um / period) * length_um / n as f64
            })
            .collect();
        (0..n)
            .map(|i| {
                let turns = (middle_um - self.window.coordinate_um(axis, i)) / period;
                let cosine = |k: usize| (std::f64::consts::TAU * k as f64 * turns).cos();
                terms.iter().enumerate().map(|(k, t)| t * cosine(k)).sum()
            })
            .collect()
    }
}

/// sin(pi x) / (pi x).
pub(super) fn sinc(x: f64) -> f64 {
    let p = std::f64::consts::PI * x;
    if p.abs() < 1e-9 { 1.0 } else { p.sin() / p }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn gaussian(sigma_um: f64, at_um: [f64; 2]) -> Psf {
        let window = Window {
            centre_um: [100.0, -40.0],
            step_um: 0.5,
            samples: 64,
            distance_um: 100.0,
        };
        let values = Array2::from_shape_fn((64, 64), |(iy, ix)| {
            let x = window.coordinate_um(0, ix) - at_um[0];
            let y = window.coordinate_um(1, iy) - at_um[1];
            (-(x * x + y * y) / (2.0 * sigma_um * sigma_um)).exp()
        });
        Psf { window, values }
    }

    const AT: [f64; 2] = [100.3, -41.2];
    const SIGMA: f64 = 1.4;

    /// Integral of a Gaussian over an interval about its middle, by Simpson's rule.
    fn interval(sigma: f64, length: f64) -> f64 {
        let n = 200;
        let h = length / n as f64;
        let f = |i: usize| (-((i as f64 * h - 0.5 * length) / sigma).powi(2) / 2.0).exp();
        let weight = |i: usize| {
            if i == 0 || i == n {
                1.0
            } else {
                2.0 + 2.0 * (i % 2) as f64
            }
        };
        (0..=n).map(|i| weight(i) * f(i)).sum::<f64>() * h / 3.0
    }

    #[test]
    fn energies_of_a_gaussian_are_those_of_the_closed_form() {
        // The spectrum of the Gaussian at half the sampling rate is exp(-2 (pi sigma / 2 step)^2) = 1e-17.
        const BAND: f64 = 1e-9;
        let psf = gaussian(SIGMA, AT);
        let total = std::f64::consts::TAU * SIGMA * SIGMA;
        assert!((psf.energy_um2() - total).abs() < BAND * total);
        let square = psf.energy_in_square_um2(AT, 5.86);
        assert!((square - interval(SIGMA, 5.86).powi(2)).abs() < BAND * total);
        // Samples that stand for their squares are a Gaussian wider by step^2 / 12.
        const WIDER: f64 = 2e-2;
        let circle = psf.energy_in_circle_um2(AT, 3.0);
        let want = total * (1.0 - (-4.5 / (SIGMA * SIGMA)).exp());
        assert!((circle - want).abs() < WIDER * total, "{circle} is not {want}");
        let centroid = psf.centroid_um();
        assert!((0..2).all(|a| (centroid[a] - AT[a]).abs() < BAND));
    }

    #[test]
    fn pixels_tile_the_plane() {
        let psf = gaussian(SIGMA, AT);
        let pixels = psf.on_pixels(AT, 1.7, 9).unwrap();
        assert!((pixels.sum() - psf.energy_in_square_um2(AT, 9.0 * 1.7)).abs() < 1e-10);
        assert!((pixels[[4, 4]] - interval(SIGMA, 1.7).powi(2)).abs() < 1e-9);
        assert!((pixels[[4, 5]] - pixels[[5, 4]]).abs() < 1e-9);
        assert!(psf.on_pixels(AT, 5.86, 9).is_err());
    }

    #[test]
    fn differences_count_scale_or_leave_it_out() {
        let psf = gaussian(SIGMA, AT);
        let brighter = Psf {
            values: &psf.values * 1.1,
            ..psf.clone()
        };
        assert!((brighter.difference(&psf).unwrap() - 0.1).abs() < 1e-12);
        assert!(brighter.shape_difference(&psf).unwrap() < 1e-12);
        assert!(psf.difference(&gaussian(2.0, AT)).unwrap() > 0.1);
        let mut coarse = psf.clone();
        coarse.window.step_um = 1.0;
        assert!(coarse.difference(&psf).is_err());
    }
}
