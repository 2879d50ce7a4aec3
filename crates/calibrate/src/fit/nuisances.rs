//! Nuisance parameters: the registration of each window, the flux of each LED, the black level.
//!
//! They are fitted together with everything else, within what the lab states of them, and are never a finding.
//! Registration belongs to one capture alone and is eliminated there; flux and black level are shared.

use nalgebra::{DMatrix, DVector};
use ndarray::Array2;

use super::capture_equations::CaptureEquations;
use super::data::Data;
use crate::optics::PixelGrid;
use crate::set::{CaptureIndex, LedIndex, PerCapture, PerLed};

/// How far the black level may be off (DN), one standard deviation: sensors drift by less over a session.
pub const BLACK_SIGMA_DN: f64 = 0.5;

/// Gauss-Newton steps; within a pixel, three bring registration to a thousandth.
const STEPS: usize = 6;

/// Largest step of registration, as a multiple of its standard deviation: the slopes are not valid further.
const LARGEST_SHIFT: f64 = 2.0;

/// The nuisances of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisances {
    /// Position of each window, relative to its stated position, along x and y (um).
    pub shift_um: PerCapture<[f64; 2]>,
    /// Flux of each LED over what is stated.
    pub flux: PerLed<f64>,
    /// Black level less what is stated (DN).
    pub black_dn: f64,
}

impl Nuisances {
    /// Everything as stated.
    pub fn stated(data: &Data) -> Self {
        Self {
            shift_um: vec![[0.0; 2]; data.signal.len()].into(),
            flux: data.stated_flux(),
            black_dn: 0.0,
        }
    }

    /// Fit to the captures in `used`, starting from here. The registration of other captures is fitted too, but
    /// they do not affect what is shared.
    pub fn fit(&self, data: &Data, images: &PerCapture<PixelGrid>, used: &PerCapture<bool>) -> Self {
        let mut now = self.clone();
        let shared = data.leds + 1;
        for _ in 0..STEPS {
            let equations = data.for_captures(|c| CaptureEquations::new(data, c, &now, &images[c], &[]));
            let mut normal = DMatrix::<f64>::zeros(shared, shared);
            let mut rhs = DVector::<f64>::zeros(shared);
            for (capture, _) in equations.iter().zip(used).filter(|(_, used)| **used) {
                let reduced = capture.reduced();
                for i in 0..shared {
                    rhs[i] += reduced[(i, shared)];
                    for j in 0..shared {
                        normal[(i, j)] += reduced[(i, j)];
                    }
                }
            }
            for (l, flux) in now.flux.iter().enumerate() {
                normal[(l, l)] += data.flux_sigma.powi(-2);
                rhs[l] += (1.0 - flux) * data.flux_sigma.powi(-2);
            }
            normal[(data.leds, data.leds)] += BLACK_SIGMA_DN.powi(-2);
            rhs[data.leds] -= now.black_dn * BLACK_SIGMA_DN.powi(-2);
            let step = normal
                .cholesky()
                .map_or_else(|| DVector::zeros(shared), |c| c.solve(&rhs));
            now.advance(data, &equations, &step);
        }
        now
    }

    /// Move by a step of the shared nuisances and further parameters; registration follows it.
    pub fn advance(&mut self, data: &Data, equations: &PerCapture<CaptureEquations>, step: &DVector<f64>) {
        let most = LARGEST_SHIFT * data.registration_um;
        for (shift, capture) in self.shift_um.iter_mut().zip(equations) {
            let (by, following) = (capture.registration(step), capture.following(step));
            for axis in [0, 1] {
                // Slopes hold as far as the image moves in the window.
                shift[axis] += (by[axis] + following[axis]).clamp(-most, most) - following[axis];
            }
        }
        for l in 0..data.leds {
            self.flux[LedIndex::from(l)] += step[l];
        }
        self.black_dn += step[data.leds];
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

    /// Residual of a capture in units of its noise.
    pub fn residual(&self, data: &Data, image: &PixelGrid, capture: CaptureIndex) -> Array2<f32> {
        let model = image.pixels(self.shift_um[capture]);
        self.whitened(data, capture, &model)
    }

    /// The same against the pixels of a model.
    pub fn whitened(&self, data: &Data, c: CaptureIndex, model: &Array2<f32>) -> Array2<f32> {
        let factor = (data.scale[c] * self.flux[data.beam[c].led]) as f32;
        let black = self.black_dn as f32;
        let mut out = data.signal[c].clone();
        ndarray::Zip::from(&mut out)
            .and(model)
            .and(&data.weight[c])
            .for_each(|r, m, w| *r = (*r - factor * m - black) * w);
        out
    }
}
