//! Transfer function of free space between the element and the sensor, faded.
//!
//! Columns of frequencies go through two loops: where each ray lands, which says how much of it counts, and the
//! phase to a distance. Several distances that differ little share the first.

use num_complex::Complex32;

use super::Fade;
use crate::kernels::{cis, fade};

/// The transfer function on a grid of frequencies, one wavelength and window.
pub(super) struct Transfer<'a> {
    pub wavelength_um: f64,
    /// Middle of the window from the element's centre (um).
    pub centre_um: [f64; 2],
    /// Shift from the first site of the lattice to the origin of the inverse transform (um).
    pub shift_um: [f64; 2],
    pub fade: &'a Fade,
    /// Edges of the cell of a site (um).
    pub cell_um: [f64; 2],
}

/// One column of frequencies: kx is the same for all, ky rises by one.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrequencyColumn {
    /// Frequencies of the first [cycles a period].
    pub first: [f64; 2],
    pub count: usize,
}

/// Destinations of the rays of a column. Working memory.
#[derive(Default)]
pub(crate) struct FadedColumn {
    /// Cycles along z (1/um).
    axial: Vec<f64>,
    /// Weight of each frequency, with the weights of both transforms.
    weight: Vec<f32>,
}

/// Below the square of this many cycles along z (1/um^2) light does not propagate; its ray lands at infinity.
const GRAZING: f64 = 1e-12;

impl Transfer<'_> {
    /// Works out how much each frequency of a column counts for the window, by where its ray from the element's
    /// centre lands `distance_um` behind it: it fades from `full_um` to `zero_um` of the window's middle.
    pub(crate) fn fade(&self, distance_um: f64, column: FrequencyColumn, faded: &mut FadedColumn) {
        let df = self.fade.period_um.map(|period| 1.0 / period);
        let [fx, first] = [0, 1].map(|a| column.first[a] * df[a]);
        let rest = self.wavelength_um.powi(-2) - fx * fx;
        let [cx, cy] = self.centre_um;
        let Fade { full_um, zero_um, .. } = *self.fade;
        let (full, slope) = (full_um as f32, (1.0 / (zero_um - full_um)) as f32);
        // The cell of the sum over the aperture, 1 / period along each axis of that over frequencies.
        let scale = (self.cell_um[0] * df[0] * (self.cell_um[1] * df[1])) as f32;
        faded.axial.resize(column.count, 0.0);
        faded.weight.resize(column.count, 0.0);
        pulp::Arch::new().dispatch(|| {
            for (i, (axial, weight)) in faded.axial.iter_mut().zip(&mut faded.weight).enumerate() {
                let fy = first + i as f64 * df[1];
                let fz = (rest - fy * fy).max(GRAZING).sqrt();
                let per_cycle = distance_um / fz;
                let (sx, sy) = (per_cycle * fx - cx, per_cycle * fy - cy);
                let off = ((sx * sx + sy * sy) as f32).sqrt();
                *axial = fz;
                *weight = fade((off - full) * slope) * scale;
            }
        });
    }

    /// Factor from the transfer function to one distance to the one for a distance that is `step_um` farther.
    pub(crate) fn step(step_um: f64, faded: &FadedColumn, out: &mut [Complex32]) {
        pulp::Arch::new().dispatch(|| {
            for (out, fz) in out.iter_mut().zip(&faded.axial) {
                *out = cis(step_um * fz);
            }
        });
    }

    /// Multiplies factors of [`Transfer::to_distance`] so that they give the derivative along z of the field over exp(i k z).
    /// The weights of the fade are constants.
    pub(crate) fn slope(&self, faded: &FadedColumn, out: &mut [Complex32]) {
        let along = 1.0 / self.wavelength_um;
        for (out, fz) in out.iter_mut().zip(&faded.axial) {
            let rate = (std::f64::consts::TAU * (fz - along)) as f32;
            *out = Complex32::new(-out.im * rate, out.re * rate);
        }
    }

    /// `out[i]` is what multiplies frequency `i` of a column on its way to `distance_um`.
    pub(crate) fn to_distance(
        &self,
        distance_um: f64,
        column: FrequencyColumn,
        faded: &FadedColumn,
        out: &mut [Complex32],
    ) {
        let df = self.fade.period_um.map(|period| 1.0 / period);
        let [fx, first] = [0, 1].map(|a| column.first[a] * df[a]);
        let along_x = fx * self.shift_um[0];
        let along_y = self.shift_um[1];
        pulp::Arch::new().dispatch(|| {
            for (i, (out, (fz, weight))) in out.iter_mut().zip(faded.axial.iter().zip(&faded.weight)).enumerate() {
                let fy = first + i as f64 * df[1];
                let way = cis(distance_um * fz + along_x + fy * along_y);
                *out = Complex32 {
                    re: way.re * weight,
                    im: way.im * weight,
                };
            }
        });
    }
}
