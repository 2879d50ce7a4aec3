//! Nuisance parameters: the registration of each window, its scale where this is free, the flux of each LED, the black level.
//!
//! They are fitted together with everything else, within what the lab states of them, and are never a finding.
//! Registration and scale belong to one measurement alone and are eliminated there; flux and black level are shared.

use nalgebra::DMatrix;
use ndarray::Array2;

use super::Data;
use crate::optics::PixelGrid;
use crate::set::{MeasurementIndex, PerLed, PerMeasurement};

/// Error of the black level (DN), one standard deviation: sensors drift by less over a session.
pub(crate) const BLACK_SIGMA_DN: f64 = 0.5;

/// The nuisances of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisances {
    /// Position of each window, relative to its stated position, along x and y (um).
    pub shift_um: PerMeasurement<[f64; 2]>,
    /// Flux of each LED over what is stated.
    pub flux: PerLed<f64>,
    /// Scale of each measurement over what is stated, besides the flux of its LED; one where scales are known.
    pub scale: PerMeasurement<f64>,
    /// Black level less what is stated (DN).
    pub black_dn: f64,
}

impl Nuisances {
    /// Everything as stated.
    pub fn stated(data: &Data) -> Self {
        Self {
            shift_um: vec![[0.0; 2]; data.signal.len()].into(),
            flux: data.stated_flux(),
            scale: vec![1.0; data.signal.len()].into(),
            black_dn: 0.0,
        }
    }

    /// DN of a measurement for unit intensity.
    pub fn dn(&self, data: &Data, c: MeasurementIndex) -> f64 {
        data.scale[c] * self.scale[c] * self.flux[data.beam[c].led]
    }

    /// Prior knowledge of flux and black level, as normal equations of `size` columns about the present values.
    pub fn prior(&self, data: &Data, size: usize) -> DMatrix<f64> {
        let mut form = DMatrix::zeros(size, size);
        let last = size - 1;
        let mut hold = |k: usize, off: f64, sigma: f64| {
            let weight = sigma.powi(-2);
            form[(k, k)] = weight;
            form[(k, last)] = -off * weight;
            form[(last, k)] = -off * weight;
            form[(last, last)] += off * off * weight;
        };
        for (l, flux) in self.flux.iter().enumerate() {
            hold(l, flux - 1.0, data.flux_sigma);
        }
        hold(data.leds, self.black_dn, BLACK_SIGMA_DN);
        form
    }

    /// Residual of a measurement in units of its noise.
    pub fn residual(&self, data: &Data, image: &PixelGrid, measurement: MeasurementIndex) -> Array2<f32> {
        let model = image.pixels(self.shift_um[measurement]);
        self.whitened(data, measurement, &model)
    }

    /// The same against the pixels of a model.
    pub fn whitened(&self, data: &Data, c: MeasurementIndex, model: &Array2<f32>) -> Array2<f32> {
        let factor = self.dn(data, c) as f32;
        let black = self.black_dn as f32;
        let mut out = data.signal[c].clone();
        ndarray::Zip::from(&mut out)
            .and(model)
            .and(&data.weight[c])
            .for_each(|r, m, w| *r = (*r - factor * m - black) * w);
        out
    }
}
