//! What no bench knows and no finding is made of: where each window is, how bright each LED, how black black.
//!
//! They are fitted together with everything else, held by what the lab states of them. Placement belongs to
//! one capture alone and is eliminated there; flux and black level are shared.

use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use rayon::prelude::*;

use crate::optics::{PixelGrid, Reading};
use crate::set::MeasuredSet;

/// How far the black level may be off [DN], one standard deviation: sensors drift by less over a session.
pub const BLACK_SIGMA_DN: f64 = 0.5;

/// Steps of Gauss and Newton; within a pixel, three bring placement to a thousandth.
const STEPS: usize = 6;

/// A set's frames with their noise.
#[derive(Clone)]
pub struct Data {
    /// One over the standard deviation of each pixel [1 / DN], zero where a pixel does not count.
    pub weight: Vec<Array2<f32>>,
    /// DN less the stated black level.
    pub signal: Vec<Array2<f32>>,
    /// LED of each capture.
    pub led: Vec<usize>,
    /// DN for unit intensity.
    pub scale: Vec<f64>,
    /// Number of LEDs.
    pub leds: usize,
    pub registration_um: f64,
    pub flux_sigma: f64,
}

impl Data {
    /// Frames of a set, whitened by Poisson and read noise over their frames. Saturated pixels do not count.
    pub fn new(set: &MeasuredSet) -> Self {
        let camera = &set.camera;
        let black = camera.black_level_dn as f32;
        let signal: Vec<_> = set.captures.iter().map(|c| c.dn.mapv(|v| v - black)).collect();
        let weight = set
            .captures
            .iter()
            .map(|c| {
                c.dn.mapv(|v| {
                    if f64::from(v) >= SATURATED * camera.saturation_dn {
                        return 0.0;
                    }
                    let photons = f64::from(v - black).max(0.0) / camera.gain_e_per_dn;
                    let variance = (photons + camera.read_noise_dn.powi(2)) / f64::from(c.frames);
                    variance.sqrt().recip() as f32
                })
            })
            .collect();
        Self {
            weight,
            signal,
            led: set.captures.iter().map(|c| c.led).collect(),
            scale: set.captures.iter().map(|c| c.scale_dn).collect(),
            leds: set.leds.len(),
            registration_um: camera.registration_sigma_px * camera.pixel_um,
            flux_sigma: camera.flux_sigma,
        }
    }

    /// Pixels of a capture that count.
    pub fn pixels(&self, capture: usize) -> usize {
        self.weight[capture].iter().filter(|w| **w > 0.0).count()
    }
}

/// A mean of frames this near to saturation has clipped frames in it.
const SATURATED: f64 = 0.97;

/// The nuisances of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisances {
    /// Where each window really is, off its stated place [um].
    pub shift_um: Vec<[f64; 2]>,
    /// Flux of each LED over what is stated.
    pub flux: Vec<f64>,
    /// Black level over what is stated [DN].
    pub black_dn: f64,
}

impl Nuisances {
    /// Everything as stated.
    pub fn stated(data: &Data) -> Self {
        Self {
            shift_um: vec![[0.0; 2]; data.signal.len()],
            flux: vec![1.0; data.leds],
            black_dn: 0.0,
        }
    }

    /// Fit to the captures in `used`, starting from here. Captures that are not used have their own placement
    /// fitted, but have no say in what is shared.
    pub fn fit(&self, data: &Data, grids: &[PixelGrid], used: &[bool]) -> Self {
        let mut now = self.clone();
        let shared = data.leds + 1;
        for _ in 0..STEPS {
            let blocks: Vec<CaptureEquations> = (0..grids.len())
                .into_par_iter()
                .map(|c| CaptureEquations::new(data, c, &now, &grids[c], &[]))
                .collect();
            let mut normal = DMatrix::<f64>::zeros(shared, shared);
            let mut rhs = DVector::<f64>::zeros(shared);
            for (block, _) in blocks.iter().zip(used).filter(|(_, used)| **used) {
                let reduced = block.reduced();
                for i in 0..shared {
                    rhs[i] += reduced[(i, shared)];
                    for j in 0..shared {
                        normal[(i, j)] += reduced[(i, j)];
                    }
                }
            }
            for l in 0..data.leds {
                normal[(l, l)] += data.flux_sigma.powi(-2);
                rhs[l] += (1.0 - now.flux[l]) * data.flux_sigma.powi(-2);
            }
            normal[(data.leds, data.leds)] += BLACK_SIGMA_DN.powi(-2);
            rhs[data.leds] -= now.black_dn * BLACK_SIGMA_DN.powi(-2);
            let step = normal
                .cholesky()
                .map_or_else(|| DVector::zeros(shared), |c| c.solve(&rhs));
            for (c, block) in blocks.iter().enumerate() {
                let [dx, dy] = block.placement(&step);
                // A pixel a step at most: the slopes hold no further.
                let most = 2.0 * data.registration_um;
                now.shift_um[c][0] += dx.clamp(-most, most);
                now.shift_um[c][1] += dy.clamp(-most, most);
            }
            for l in 0..data.leds {
                now.flux[l] += step[l];
            }
            now.black_dn += step[data.leds];
        }
        now
    }

    /// Residual of a capture in units of its noise.
    pub fn residual(&self, data: &Data, grid: &PixelGrid, capture: usize) -> Array2<f32> {
        let model = grid.pixels(self.shift_um[capture]);
        whitened(data, capture, self, &model)
    }

    /// Chi-square of each capture.
    pub fn chi2(&self, data: &Data, grids: &[PixelGrid]) -> Vec<f64> {
        (0..grids.len())
            .into_par_iter()
            .map(|c| {
                self.residual(data, &grids[c], c)
                    .iter()
                    .map(|r| f64::from(*r).powi(2))
                    .sum()
            })
            .collect()
    }

    /// What the prior knowledge of the shared nuisances adds to chi-square.
    pub fn prior_chi2(&self, data: &Data) -> f64 {
        let flux: f64 = self.flux.iter().map(|f| ((f - 1.0) / data.flux_sigma).powi(2)).sum();
        flux + (self.black_dn / BLACK_SIGMA_DN).powi(2)
    }
}

fn whitened(data: &Data, c: usize, now: &Nuisances, model: &Array2<f32>) -> Array2<f32> {
    let factor = (data.scale[c] * now.flux[data.led[c]]) as f32;
    let black = now.black_dn as f32;
    let mut out = data.signal[c].clone();
    ndarray::Zip::from(&mut out)
        .and(model)
        .and(&data.weight[c])
        .for_each(|r, m, w| *r = (*r - factor * m - black) * w);
    out
}

/// Products of the whitened columns of one capture: placement x, y first, then flux of every LED, black,
/// further columns, and the residual last.
#[derive(Clone)]
pub struct CaptureEquations {
    gram: DMatrix<f64>,
}

impl CaptureEquations {
    /// Of the model `grid` of a capture; `more` are further columns, as changes of it.
    pub fn new(data: &Data, c: usize, now: &Nuisances, grid: &PixelGrid, more: &[PixelGrid]) -> Self {
        let reading = Reading::new(more.iter().chain([grid]), now.shift_um[c]);
        let lines = [
            reading.pixels(grid),
            reading.pixels(&grid.slope(0)),
            reading.pixels(&grid.slope(1)),
        ];
        let more: Vec<_> = more.iter().map(|m| reading.pixels(m)).collect();
        let residual = whitened(data, c, now, &lines[0]);
        let scale = data.scale[c] as f32;
        let scaled = scale * now.flux[data.led[c]] as f32;
        let weight = &data.weight[c];
        let column =
            |a: &Array2<f32>, factor: f32| -> Vec<f32> { a.iter().zip(weight).map(|(v, w)| factor * v * w).collect() };
        let mut columns = vec![column(&lines[1], scaled), column(&lines[2], scaled)];
        columns.push(column(&lines[0], scale));
        columns.push(weight.iter().copied().collect());
        columns.extend(more.iter().map(|m| column(m, scaled)));
        columns.push(residual.iter().copied().collect());
        // Where each column goes: only this capture's own LED has a flux column.
        let size = 2 + data.leds + 1 + more.len() + 1;
        let place: Vec<usize> = [0, 1, 2 + data.led[c]].into_iter().chain(2 + data.leds..size).collect();
        let mut gram = DMatrix::zeros(size, size);
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                let dot = dot(a, b);
                gram[(place[i], place[j])] = dot;
                gram[(place[j], place[i])] = dot;
            }
        }
        let prior = data.registration_um.powi(-2);
        let last = size - 1;
        for axis in [0, 1] {
            gram[(axis, axis)] += prior;
            let pull = -now.shift_um[c][axis] * prior;
            gram[(axis, last)] += pull;
            gram[(last, axis)] += pull;
            gram[(last, last)] += now.shift_um[c][axis].powi(2) * prior;
        }
        Self { gram }
    }

    /// The products after placement has been fitted away: flux, black, further columns, residual.
    pub fn reduced(&self) -> DMatrix<f64> {
        let n = self.gram.nrows() - 2;
        let inner = self.inner();
        let cross = self.gram.view((0, 2), (2, n));
        self.gram.view((2, 2), (n, n)) - cross.transpose() * inner * cross
    }

    /// The best placement step after the shared parameters have moved by `step` (flux, black, further).
    pub fn placement(&self, step: &DVector<f64>) -> [f64; 2] {
        let last = self.gram.ncols() - 1;
        let mut rhs = self.gram.view((0, last), (2, 1)).into_owned();
        for (j, s) in step.iter().enumerate() {
            for axis in [0, 1] {
                rhs[axis] -= self.gram[(axis, 2 + j)] * s;
            }
        }
        let step = self.inner() * rhs;
        [step[0], step[1]]
    }

    fn inner(&self) -> DMatrix<f64> {
        let a = self.gram.view((0, 0), (2, 2)).into_owned();
        a.try_inverse().unwrap_or_else(|| DMatrix::zeros(2, 2))
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    // Short partial sums in single precision, their total in double.
    a.chunks(64)
        .zip(b.chunks(64))
        .map(|(a, b)| f64::from(a.iter().zip(b).map(|(x, y)| x * y).sum::<f32>()))
        .sum()
}
