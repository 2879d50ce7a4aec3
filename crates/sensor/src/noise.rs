//! Noise of a sensor.

use ndarray::Array2;
use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};

/// Noise of a sensor: photons counted in units of `photon`, and what reading adds. Signals are of full scale, or in another
/// unit that both fields share.
///
/// The model and numbers of Tseng et al., Nature Communications 12, 6493 (2021).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Signal of one photon, a_p, of full scale.
    pub photon: f64,
    /// Standard deviation of what reading adds, sigma_g, of full scale.
    pub read: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            photon: 4e-5,
            read: 1e-5,
        }
    }
}

impl Noise {
    /// Noise of a data sheet, for images of which one is this number of electrons. `read_e`: standard deviation of reading (electrons).
    pub fn of_electrons(full_scale_e: f64, read_e: f64) -> Self {
        Self {
            photon: 1.0 / full_scale_e,
            read: read_e / full_scale_e,
        }
    }

    /// Noise of frames in DN above the black level. `read_dn`: standard deviation of reading (DN).
    pub fn of_dn(gain_e_per_dn: f64, read_dn: f64) -> Self {
        Self {
            photon: 1.0 / gain_e_per_dn,
            read: read_dn,
        }
    }

    /// Variance at a signal of this size.
    pub fn variance(&self, signal: f64) -> f64 {
        self.photon * signal.max(0.0) + self.read.powi(2)
    }

    /// One exposure: Poisson numbers of photons, and a normal number from reading, pixel by pixel in reading order.
    /// The same generator in the same state gives the same noise.
    pub fn expose(&self, image: &Array2<f64>, random: &mut impl RngExt) -> Array2<f64> {
        image.map(|&signal| {
            let read: f64 = StandardNormal.sample(random);
            self.photons(signal, random) + self.read * read
        })
    }

    /// Counted photons of a signal. Where no photon is to be expected, or photons have no size, the signal itself.
    fn photons(&self, signal: f64, random: &mut impl RngExt) -> f64 {
        let mean = signal.max(0.0) / self.photon;
        match Poisson::new(mean) {
            Ok(poisson) => poisson.sample(random) * self.photon,
            Err(_) => signal.max(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn noise_has_the_mean_and_variance_it_says() {
        // Moments of 40,000 numbers: a standard error of 0.5 % of the deviation, and of 0.7 % in the variance.
        const FIVE_SIGMA: f64 = 5.0;
        let n = 200 * 200;
        for (photon, signal) in [(4e-5, 0.5), (4e-5, 2e-4), (0.01, 0.3), (0.0, 0.3), (4e-5, 0.0)] {
            let noise = Noise { photon, read: 1e-5 };
            let image = noise.expose(
                &Array2::from_elem((200, 200), signal),
                &mut ChaCha8Rng::seed_from_u64(7),
            );
            let mean = image.sum() / f64::from(n);
            let variance = image.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
            let want = noise.variance(signal);
            assert!((mean - signal).abs() < FIVE_SIGMA * (want / f64::from(n)).sqrt());
            assert!(
                (variance / want - 1.0).abs() < FIVE_SIGMA * (2.5 / f64::from(n)).sqrt(),
                "{photon} {signal}"
            );
        }
    }

    /// The number of photons is whole, and its third moment is that of Poisson's law, not of a normal one.
    #[test]
    fn few_photons_are_counted() {
        let noise = Noise { photon: 0.1, read: 0.0 };
        let image = noise.expose(&Array2::from_elem((200, 200), 0.3), &mut ChaCha8Rng::seed_from_u64(3));
        let counts: Vec<f64> = image.iter().map(|v| v / 0.1).collect();
        const ROUNDING: f64 = 1e-12;
        assert!(counts.iter().all(|c| *c >= 0.0 && (c - c.round()).abs() < ROUNDING));
        let third = counts.iter().map(|c| (c - 3.0).powi(3)).sum::<f64>() / counts.len() as f64;
        // Third moment 3, and the root of the variance of (c - 3)^3, sqrt(1 x 3 + 25 x 9 + 15 x 27 - 9) = 25, over 200.
        const STANDARD_ERROR: f64 = 25.0 / 200.0;
        assert!((third - 3.0).abs() < 5.0 * STANDARD_ERROR, "{third}");
    }
}
