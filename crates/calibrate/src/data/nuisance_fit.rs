//! Fits of the nuisances by the normal equations of each measurement.

use metalith_attribution::{MeasurementEquations, Measurements};
use nalgebra::{DMatrix, DVector};

use super::Data;
use super::equations::FrameEquations;
use super::nuisances::{BLACK_SIGMA_DN, Nuisances};
use super::registration::whole_pixel_shift;
use crate::optics::PixelGrid;
use crate::set::{LedIndex, PerMeasurement};

/// Gauss-Newton steps; within a pixel, three bring registration to a thousandth.
const STEPS: usize = 6;

/// Largest step of registration, as a multiple of its standard deviation: the slopes are not valid further.
const LARGEST_SHIFT: f64 = 2.0;

impl Nuisances {
    /// Everything as stated, but each window to within a pixel where its image is.
    pub fn registered(data: &Data, images: &PerMeasurement<PixelGrid>) -> Self {
        let mut now = Self::stated(data);
        now.shift_um = data.for_each(|c| {
            let shift = whole_pixel_shift(&data.signal[c], &images[c].pixels([0.0; 2]));
            shift.map(|pixels| pixels * data.pixel_um)
        });
        if data.free_scale {
            now.scale = data.for_each(|c| data.scale_of(c, &images[c].pixels(now.shift_um[c])));
        }
        now
    }

    /// Fit to the measurements in `used`, starting from here. The registration of other measurements is fitted too, but
    /// they do not affect what is shared.
    #[must_use]
    pub fn fit(&self, data: &Data, images: &PerMeasurement<PixelGrid>, used: &PerMeasurement<bool>) -> Self {
        let mut now = self.clone();
        let shared = data.leds + 1;
        for _ in 0..STEPS {
            let equations = data.for_each(|c| FrameEquations::new(data, c, &now, &images[c], &[]));
            let mut normal = DMatrix::<f64>::zeros(shared, shared);
            let mut rhs = DVector::<f64>::zeros(shared);
            for (measurement, _) in equations.iter().zip(used).filter(|(_, used)| **used) {
                let reduced = measurement.reduced();
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
    pub fn advance(&mut self, data: &Data, equations: &PerMeasurement<FrameEquations>, step: &DVector<f64>) {
        let most = LARGEST_SHIFT * data.registration_um;
        for ((shift, scale), measurement) in self.shift_um.iter_mut().zip(&mut self.scale).zip(equations) {
            let ((by, factor), following) = (measurement.own_step(step), measurement.following(step));
            // A scale is positive, and a step that would double it is too long for slopes.
            *scale *= factor.clamp(0.5, 2.0);
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
}
