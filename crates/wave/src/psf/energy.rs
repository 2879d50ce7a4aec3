//! Energy of a PSF in parts of the sensor's plane.

use ndarray::Array2;

use super::Psf;
use crate::error::{Result, WaveError};
use crate::kernels::sinc;

impl Psf {
    /// Energy in the window (um^2), in units of |E_inc|^2.
    pub fn energy_um2(&self) -> f64 {
        self.values.sum() * self.window.step_um.powi(2)
    }

    /// Energy in a square with edges along x and y (um^2): in as much of it as the window holds.
    pub fn energy_in_square_um2(&self, centre_um: [f64; 2], edge_um: f64) -> f64 {
        let weights = [0, 1].map(|axis| {
            let (middle, length) = self.held(axis, centre_um[axis], edge_um);
            self.interval(axis, middle, length)
        });
        let rows = self.values.rows().into_iter().zip(&weights[1]);
        rows.map(|(row, wy)| wy * row.iter().zip(&weights[0]).map(|(v, wx)| v * wx).sum::<f64>())
            .sum()
    }

    /// Image of a point on square, gapless pixels: the energy in each of `pixels` x `pixels` (um^2), with the middle of
    /// the array at `centre_um`.
    ///
    /// # Errors
    /// If the pixels have no size or reach beyond the window.
    pub fn on_pixels(&self, centre_um: [f64; 2], pixel_um: f64, pixels: usize) -> Result<Array2<f64>> {
        let reach = 0.5 * pixels as f64 * pixel_um;
        let room = self.window.half_width_um() + 0.5 * self.window.step_um;
        // Pixels that end where the window does fit into it, however decimals were rounded.
        const ROUNDING: f64 = 1e-9;
        let inside = (0..2).all(|a| (centre_um[a] - self.window.centre_um[a]).abs() + reach <= room * (1.0 + ROUNDING));
        if !(pixel_um > 0.0 && pixels > 0 && inside) {
            return Err(WaveError::Pixels {
                pixels,
                pixel_um,
                centre_um,
            });
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

    /// Middle and length of the part of an interval that the window holds, each sample with half a step on both sides (um):
    /// beyond that the series through the samples goes on with copies of them.
    fn held(&self, axis: usize, middle_um: f64, length_um: f64) -> (f64, f64) {
        let half = 0.5 * self.window.samples as f64 * self.window.step_um;
        let (first, last) = (self.window.centre_um[axis] - half, self.window.centre_um[axis] + half);
        let (from, to) = (middle_um - 0.5 * length_um, middle_um + 0.5 * length_um);
        if first <= from && to <= last {
            return (middle_um, length_um);
        }
        let (from, to) = (from.max(first), to.min(last));
        (0.5 * (from + to), (to - from).max(0.0))
    }

    /// Weights of the samples of an axis in the integral over an interval (um): each term of the finite Fourier
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

#[cfg(test)]
mod tests {
    use super::super::tests::{AT, BAND, SIGMA, gaussian};

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
        let psf = gaussian(SIGMA, AT);
        let total = std::f64::consts::TAU * SIGMA * SIGMA;
        assert!((psf.energy_um2() - total).abs() < BAND * total);
        let square = psf.energy_in_square_um2(AT, 5.86);
        assert!((square - interval(SIGMA, 5.86).powi(2)).abs() < BAND * total);
    }

    #[test]
    fn a_square_holds_nothing_from_beyond_the_window() {
        /// Tolerance for the series at the border of a cut Gaussian, which is 1e-4 of its peak there.
        const RIM: f64 = 1e-3;
        let total = std::f64::consts::TAU * SIGMA * SIGMA;
        let psf = gaussian(SIGMA, AT);
        for edge_um in [32.5, 100.0, 1e6] {
            let square = psf.energy_in_square_um2(AT, edge_um);
            assert!((square - psf.energy_um2()).abs() < BAND * total, "{edge_um}: {square}");
        }
        // Beside the left border, of a window from 84 to 116 um: its copy is beside the right one.
        let beside = gaussian(SIGMA, [90.0, -40.0]);
        let across = beside.energy_in_square_um2([116.0, -40.0], 20.0);
        assert!(across.abs() < RIM * total, "{across}");
        let own = beside.energy_in_square_um2([84.0, -40.0], 40.0);
        assert!((own - total).abs() < RIM * total, "{own}");
        assert_eq!(beside.energy_in_square_um2([150.0, -40.0], 20.0), 0.0);
    }

    #[test]
    fn pixels_tile_the_plane() {
        let psf = gaussian(SIGMA, AT);
        let pixels = psf.on_pixels(AT, 1.7, 9).unwrap();
        assert!((pixels.sum() - psf.energy_in_square_um2(AT, 9.0 * 1.7)).abs() < BAND);
        assert!((pixels[[4, 4]] - interval(SIGMA, 1.7).powi(2)).abs() < BAND);
        assert!((pixels[[4, 5]] - pixels[[5, 4]]).abs() < BAND);
        assert!(psf.on_pixels(AT, 5.86, 9).is_err());
    }
}
