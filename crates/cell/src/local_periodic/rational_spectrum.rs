//! Transmission of one pillar over the band as a rational function of wavelength, solved where it is least known.
//!
//! A guided-mode resonance is a pole beside the real axis, which a rational function has too. So it takes some samples for each
//! resonance, however narrow, where a cubic takes many.

use num_complex::Complex64;

use super::barycentric::Barycentric;
use metalith_core::Result;

/// Samples at the start for each wavelength of band, in shortest wavelengths: one every 18 nm at 400 nm. At least [`FEWEST`].
const FIRST_STEP: f64 = 0.045;
const FEWEST: usize = 9;

/// Step of the wavelengths where two functions are compared, in shortest wavelengths: 0.5 nm at 400 nm; and their least number.
const GRID_STEP: f64 = 1.0 / 800.0;
const FEWEST_COMPARED: usize = 64;

/// Samples past which no function is sought any more: cubics between samples then take no more time.
const MOST: usize = 128;

/// Samples in turn that must be as foretold: in the middle of the longest interval, where nothing was in doubt.
const CALM: usize = 2;

/// Shares of the tolerance: the misfit at samples, and the change by one more sample at which a function is settled.
const FITTED: f64 = 0.1;
const SETTLED: f64 = 0.5;

/// Half width (um) of a resonance that is not looked for any more: one narrower moves less light of any LED than the camera's noise.
const NARROWEST_UM: f64 = 5e-5;

/// Pole near the band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resonance {
    /// Wavelength (um).
    pub um: f64,
    /// Half of its width (um), at least [`NARROWEST_UM`].
    pub half_um: f64,
    /// Modulus of its part of t at its wavelength, for a width of at least [`NARROWEST_UM`].
    pub height: f64,
}

/// Samples of one width over the band, and the function through some of them.
#[derive(Clone, Debug)]
pub(super) struct RationalSpectrum {
    band_um: (f64, f64),
    tolerance: f64,
    /// Wavelengths (um), rising, and t there.
    wavelengths_um: Vec<f64>,
    t: Vec<Complex64>,
    /// Wavelengths where functions are compared (um), and the last function there.
    compared_um: Vec<f64>,
    compared: Vec<Complex64>,
    function: Barycentric,
    resonances: Vec<Resonance>,
}

impl RationalSpectrum {
    /// Sample `t` until one more sample changes the function by less than half of `tolerance` and foretold ones are met; none if that
    /// takes too many samples.
    pub(super) fn sample(
        band_um: (f64, f64),
        tolerance: f64,
        t: &impl Fn(f64) -> Result<Complex64>,
    ) -> Result<Option<Self>> {
        let (low, high) = band_um;
        let long = (high - low) / low;
        let first = ((long / FIRST_STEP).ceil() as usize + 1).clamp(FEWEST, MOST / 2);
        let steps = ((long / GRID_STEP).ceil() as usize).max(FEWEST_COMPARED);
        let between = |share: f64| low + (high - low) * share;
        // Closer at the ends, as polynomials ask for.
        let shares = (0..first).map(|k| 0.5 - 0.5 * (std::f64::consts::PI * k as f64 / (first - 1) as f64).cos());
        let wavelengths_um: Vec<f64> = shares.map(between).collect();
        let values = wavelengths_um.iter().map(|um| t(*um)).collect::<Result<Vec<_>>>()?;
        let mut spectrum = Self {
            band_um,
            tolerance,
            function: Barycentric::fit(&wavelengths_um[..1], &values[..1], 0.0),
            wavelengths_um,
            t: values,
            compared_um: (0..=steps).map(|k| between(k as f64 / steps as f64)).collect(),
            compared: Vec::new(),
            resonances: Vec::new(),
        };
        let settled = spectrum.settle(0, t)?;
        Ok(settled.then_some(spectrum))
    }

    /// Solve at more wavelengths (um), and go on where that changes the function. False if it takes too many samples.
    pub(super) fn resume(&mut self, at_um: &[f64], t: &impl Fn(f64) -> Result<Complex64>) -> Result<bool> {
        for &um in at_um {
            if !self.wavelengths_um.contains(&um) {
                self.add(um, t(um)?);
            }
        }
        self.settle(CALM, t)
    }

    fn settle(&mut self, mut calm: usize, t: &impl Fn(f64) -> Result<Complex64>) -> Result<bool> {
        loop {
            let before = std::mem::take(&mut self.compared);
            self.function = self.fitted();
            self.compared = self.compared_um.iter().map(|um| self.function.at(*um)).collect();
            self.resonances = self.found();
            let changed = self.most_changed(&before);
            if changed.is_some() {
                calm = 0;
            }
            let next = match changed.or_else(|| self.unseen()) {
                Some(um) => um,
                None if calm >= CALM => return Ok(true),
                None => self.middle(),
            };
            if self.wavelengths_um.len() >= MOST || self.wavelengths_um.contains(&next) {
                return Ok(false);
            }
            let value = t(next)?;
            let foretold = (self.function.at(next) - value).norm() <= SETTLED * self.tolerance;
            calm = if foretold { calm + 1 } else { 0 };
            self.add(next, value);
        }
    }

    fn fitted(&self) -> Barycentric {
        Barycentric::fit(&self.wavelengths_um, &self.t, FITTED * self.tolerance)
    }

    fn add(&mut self, um: f64, value: Complex64) {
        let place = self.wavelengths_um.partition_point(|w| *w < um);
        self.wavelengths_um.insert(place, um);
        self.t.insert(place, value);
    }

    /// Wavelength (um), no sample, where the function changed most, if it did anywhere.
    fn most_changed(&self, before: &[Complex64]) -> Option<f64> {
        let change = |k: &usize| (self.compared[*k] - before[*k]).norm();
        let places = (0..before.len()).filter(|k| !self.wavelengths_um.contains(&self.compared_um[*k]));
        let most = places.max_by(|a, b| change(a).total_cmp(&change(b)))?;
        // What is no number is a change too.
        let still = change(&most) <= SETTLED * self.tolerance;
        (!still).then_some(self.compared_um[most])
    }

    /// Wavelength (um) of the highest resonance that has no sample within its width.
    fn unseen(&self) -> Option<f64> {
        let unseen = |r: &&Resonance| r.height > self.tolerance && self.nearest_um(r.um) > r.half_um;
        let highest = self.resonances.iter().filter(unseen);
        highest.max_by(|a, b| a.height.total_cmp(&b.height)).map(|r| r.um)
    }

    /// Middle of the longest interval (um).
    fn middle(&self) -> f64 {
        let pairs = self.wavelengths_um.windows(2);
        let longest = pairs.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        longest.map_or(self.band_um.0, |pair| 0.5 * (pair[0] + pair[1]))
    }

    fn found(&self) -> Vec<Resonance> {
        let (low, high) = self.band_um;
        let poles = self
            .function
            .poles()
            .into_iter()
            .filter(|pole| (low..=high).contains(&pole.at.re));
        poles
            .map(|pole| {
                let half_um = pole.at.im.abs().max(NARROWEST_UM);
                Resonance {
                    um: pole.at.re,
                    half_um,
                    height: pole.residue.norm() / half_um,
                }
            })
            .collect()
    }

    /// Distance of a wavelength from the nearest sample (um).
    pub(super) fn nearest_um(&self, um: f64) -> f64 {
        let apart = self.wavelengths_um.iter().map(|w| (w - um).abs());
        apart.fold(f64::INFINITY, f64::min)
    }

    /// Resonances in the band.
    pub(super) fn resonances(&self) -> &[Resonance] {
        &self.resonances
    }

    /// Number of samples.
    pub(super) fn solved(&self) -> usize {
        self.t.len()
    }

    /// Value at a wavelength (um).
    pub(super) fn at(&self, wavelength_um: f64) -> Complex64 {
        self.function.at(wavelength_um)
    }

    pub(super) fn into_function(self) -> Barycentric {
        self.function
    }
}
