//! The normal equations of one measurement, its registration eliminated.

use metalith_attribution::{MeasurementEquations, eliminate, own_step};
use nalgebra::{DMatrix, DVector};
use ndarray::Array2;

use super::Data;
use super::nuisances::Nuisances;
use crate::optics::{PixelGrid, Reading};
use crate::set::MeasurementIndex;
use metalith_wave::kernels::sum_of_products;

/// Axes along which a window is registered: its columns stand first.
const AXES: usize = 2;

/// Relative standard deviation of a scale that nobody states: far more than any change of a step.
const FREE_SCALE: f64 = 1e3;

/// Inner products of the whitened columns of one measurement, in this order: registration along x and y, its scale if this is
/// free, flux of every LED, black level, further parameters, and the residual last.
#[derive(Clone)]
pub struct FrameEquations {
    gram: DMatrix<f64>,
    /// Columns of this measurement alone, which stand first.
    own: usize,
    /// Shift of the window that follows the image, for a unit of each further parameter (um).
    follows_um: Vec<[f64; 2]>,
}

impl FrameEquations {
    /// Equations of a measurement whose predicted image is `grid`; `more` are the derivatives of the image by further
    /// parameters. Where the window of a prediction follows the image, the window of the bench, which stands still, is expected
    /// to be as much off the other way.
    pub fn new(data: &Data, c: MeasurementIndex, now: &Nuisances, grid: &PixelGrid, more: &[PixelGrid]) -> Self {
        let reading = Reading::new(more.iter().chain([grid]), now.shift_um[c]);
        let lines = reading.with_slopes(grid);
        let follows_um: Vec<[f64; 2]> = more.iter().map(PixelGrid::off_um).collect();
        let more: Vec<_> = more.iter().map(|m| reading.pixels(m)).collect();
        let residual = now.whitened(data, c, &lines[0]);
        let led = data.beam[c].led;
        let scale = (data.scale[c] * now.scale[c]) as f32;
        let scaled = scale * now.flux[led] as f32;
        let weight = &data.weight[c];
        let column =
            |a: &Array2<f32>, factor: f32| -> Vec<f32> { a.iter().zip(weight).map(|(v, w)| factor * v * w).collect() };
        let mut columns = vec![column(&lines[1], scaled), column(&lines[2], scaled)];
        let own = AXES + usize::from(data.free_scale);
        if data.free_scale {
            columns.push(column(&lines[0], scaled));
        }
        columns.push(column(&lines[0], scale));
        columns.push(weight.iter().copied().collect());
        columns.extend(more.iter().map(|m| column(m, scaled)));
        columns.push(residual.iter().copied().collect());
        // Where each column goes: only this measurement's own LED has a flux column.
        let size = own + data.leds + 1 + more.len() + 1;
        let place: Vec<usize> = (0..own)
            .chain([own + usize::from(led)])
            .chain(own + data.leds..size)
            .collect();
        let mut gram = DMatrix::zeros(size, size);
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                let dot = sum_of_products(a, b);
                gram[(place[i], place[j])] = dot;
                gram[(place[j], place[i])] = dot;
            }
        }
        let prior = data.registration_um.powi(-2);
        let first = own + data.leds + 1;
        if data.free_scale {
            gram[(AXES, AXES)] += FREE_SCALE.powi(-2);
        }
        for axis in [0, 1] {
            // The place of the window is known: what its derivatives are by shift and further parameters, and what it is off by.
            let off = now.shift_um[c][axis] + grid.off_um()[axis];
            let follows = follows_um.iter().map(|f| f[axis]).enumerate();
            let mut parts: Vec<(usize, f64)> = vec![(axis, 1.0)];
            parts.extend(follows.filter(|(_, f)| *f != 0.0).map(|(k, f)| (first + k, f)));
            parts.push((size - 1, -off));
            for &(i, a) in &parts {
                for &(j, b) in &parts {
                    gram[(i, j)] += a * b * prior;
                }
            }
        }
        Self { gram, own, follows_um }
    }

    /// The best step of registration (um), and of the scale by a factor, after the others have moved by `step` (flux, black
    /// level, further).
    pub fn own_step(&self, step: &DVector<f64>) -> ([f64; 2], f64) {
        let step = own_step(&self.gram, self.own, step);
        ([step[0], step[1]], 1.0 + step.get(AXES).copied().unwrap_or(0.0))
    }

    /// Shift of the window that follows the image after such a step of the others (um).
    pub fn following(&self, step: &DVector<f64>) -> [f64; 2] {
        let first = step.len().saturating_sub(self.follows_um.len());
        let mut out = [0.0; 2];
        for (follows, step) in self.follows_um.iter().zip(step.iter().skip(first)) {
            out = [out[0] + follows[0] * step, out[1] + follows[1] * step];
        }
        out
    }
}

impl MeasurementEquations for FrameEquations {
    /// The products after registration has been eliminated: flux, black level, further parameters, residual.
    fn reduced(&self) -> DMatrix<f64> {
        eliminate(&self.gram, self.own)
    }
}
