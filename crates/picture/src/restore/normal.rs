//! The linear systems of restoration: A* W A x + a D* D x + m x = b, with D the slopes along rows and columns.
//!
//! They are solved by conjugate gradients. The preconditioner is the system of a scene that is seen everywhere as it is on
//! the mean: a diagonal of how much light each place of the scene sends into the frame, on both sides of a circular
//! convolution with the mean response of A* W A to a point, in closed form.

use metalith_core::{Error, Progress, Result};
use metalith_wave::kernels::fft_size;
use ndarray::Array2;
use num_complex::Complex32;

use super::Recorded;
use crate::operator::{FftScratch, FrameOperator, SquareFft};

/// Planes of a picture.
pub type Planes = Vec<Array2<f32>>;

/// The data term of a frame.
pub struct NormalSystem<'a> {
    operator: &'a FrameOperator<'a>,
    elements: Vec<usize>,
    veil: bool,
    /// Weights of the pixels, scaled.
    weight: Planes,
    /// A* W S.
    pub data: Planes,
    /// What one unit of the data term is, in units of the inverse variance of the picture.
    pub scale: f64,
    /// How much light of each place counts, about one where most does.
    share: Planes,
    response: Response,
}

/// Mean response of A* W A to a point, as a spectrum over periodic squares.
struct Response {
    fft: SquareFft,
    spectrum: Vec<Vec<f32>>,
}

/// Strengths of a system.
#[derive(Clone, Copy)]
pub struct Terms {
    /// Of squared slopes.
    pub slopes: f64,
    /// Of the picture itself.
    pub identity: f64,
}

/// Points an axis at which the response is measured.
const POINTS: usize = 3;
/// Reach of a response (pixels of the scene).
const REACH: usize = 24;
/// A place that sends less light than this share of the best is preconditioned as if it sent so much.
const LEAST_SHARE: f32 = 0.02;

impl<'a> NormalSystem<'a> {
    /// For some of the elements, with or without the veil.
    pub fn new(recorded: &Recorded<'a>, elements: &[usize], veil: bool) -> Self {
        let operator = recorded.operator;
        let view = operator.view();
        let shape = (view.rows, view.columns);
        let ones = vec![Array2::<f32>::ones(shape); operator.inputs()];
        let seen = operator.apply_elements(&ones, elements, veil);
        let weighted: Planes = seen.iter().zip(recorded.trust).map(|(s, t)| s * t).collect();
        let lumped = operator.adjoint_elements(&weighted, elements, veil);
        let most = lumped
            .iter()
            .flatten()
            .copied()
            .fold(0.0f32, f32::max)
            .max(f32::MIN_POSITIVE);
        let scale = f64::from(most);
        let weight: Planes = recorded.trust.iter().map(|t| t.mapv(|v| v / most)).collect();
        let products: Planes = weight.iter().zip(recorded.light).map(|(w, s)| w * s).collect();
        let mut system = Self {
            operator,
            elements: elements.to_vec(),
            veil,
            data: operator.adjoint_elements(&products, elements, veil),
            weight,
            scale,
            share: lumped
                .iter()
                .map(|p| p.mapv(|v| (v / most).max(LEAST_SHARE).sqrt()))
                .collect(),
            response: Response {
                fft: SquareFft::new(fft_size(shape.0.max(shape.1) + REACH)),
                spectrum: Vec::new(),
            },
        };
        system.measure(shape);
        system
    }

    /// Rows and columns of the picture.
    pub fn shape(&self) -> (usize, usize) {
        let view = self.operator.view();
        (view.rows, view.columns)
    }

    /// Channels.
    pub fn channels(&self) -> usize {
        self.data.len()
    }

    /// The picture of back-projected light over how much of it there is: where iterations begin.
    pub fn start(&self) -> Planes {
        let pairs = self.data.iter().zip(&self.share);
        pairs
            .map(|(d, s)| ndarray::Zip::from(d).and(s).map_collect(|d, s| d / (s * s)))
            .collect()
    }

    /// How much light counts, mean over the picture; one where most does.
    pub fn mean_share(&self) -> f64 {
        let all = self.share.iter().flatten();
        let count = self.share.iter().map(Array2::len).sum::<usize>().max(1);
        all.map(|s| f64::from(s * s)).sum::<f64>() / count as f64
    }

    /// Variance that noise and unknown detail leave at a place of the picture, by channel, in the most likely picture
    /// where slopes are normal: one over what data and prior know at each frequency, mean over the frequencies. The data
    /// know as much as the mean response says, times the light of the place.
    pub fn expected_variance(&self, place: (usize, usize), terms: Terms) -> Vec<f64> {
        let (size, half) = (self.response.fft.size(), self.response.fft.size() / 2 + 1);
        let slope = |k: usize| 2.0 - 2.0 * (std::f64::consts::TAU * k as f64 / size as f64).cos();
        let slopes: Vec<f64> = (0..size).map(slope).collect();
        let channels = self.share.iter().zip(&self.response.spectrum);
        channels
            .map(|(share, response)| {
                let light = f64::from(share[place]).powi(2);
                let mut sum = 0.0;
                for kx in 0..half {
                    // Half of the frequencies stand for two.
                    let pair = if kx == 0 || kx + 1 == half { 1.0 } else { 2.0 };
                    for ky in 0..size {
                        let prior = terms.slopes * (slopes[kx] + slopes[ky]);
                        let known = light * f64::from(response[kx * size + ky]) + prior;
                        sum += pair / known.max(f64::MIN_POSITIVE);
                    }
                }
                sum / (size * size) as f64 / self.scale
            })
            .collect()
    }

    fn data_term(&self, x: &[Array2<f32>]) -> Planes {
        let mut seen = self.operator.apply_elements(x, &self.elements, self.veil);
        seen.iter_mut().zip(&self.weight).for_each(|(s, w)| *s *= w);
        self.operator.adjoint_elements(&seen, &self.elements, self.veil)
    }

    /// The left side of the system.
    pub fn apply(&self, x: &[Array2<f32>], terms: Terms) -> Planes {
        let mut out = self.data_term(x);
        for (to, x) in out.iter_mut().zip(x) {
            add_slopes(to, x, terms.slopes as f32);
            to.scaled_add(terms.identity as f32, x);
        }
        out
    }

    /// Measure the mean response to a point over the share of its place.
    fn measure(&mut self, shape: (usize, usize)) {
        let at = |k: usize, n: usize| (k + 1) * n / (POINTS + 1);
        let mut points = Array2::<f32>::zeros(shape);
        for k in 0..POINTS * POINTS {
            points[[at(k / POINTS, shape.0), at(k % POINTS, shape.1)]] = 1.0;
        }
        let responses = self.data_term(&vec![points; self.data.len()]);
        let size = self.response.fft.size();
        let reach = REACH.min(shape.0 / (2 * POINTS + 2)).min(shape.1 / (2 * POINTS + 2)) as i64;
        let mut scratch = FftScratch::default();
        for (response, share) in responses.iter().zip(&self.share) {
            let mut square = vec![0.0f32; size * size];
            for k in 0..POINTS * POINTS {
                let (y, x) = (at(k / POINTS, shape.0) as i64, at(k % POINTS, shape.1) as i64);
                let own = share[[y as usize, x as usize]].powi(2) * (POINTS * POINTS) as f32;
                for dy in -reach..=reach {
                    for dx in -reach..=reach {
                        let value = response[[(y + dy) as usize, (x + dx) as usize]] / own;
                        let to = dy.rem_euclid(size as i64) as usize * size + dx.rem_euclid(size as i64) as usize;
                        square[to] += value;
                    }
                }
            }
            let mut spectrum = vec![Complex32::ZERO; self.response.fft.entries()];
            self.response
                .fft
                .forward(&mut square, size, &mut spectrum, &mut scratch);
            self.response.spectrum.push(spectrum.iter().map(|v| v.norm()).collect());
        }
    }

    /// An approximate inverse of the system.
    fn precondition(&self, residual: &[Array2<f32>], terms: Terms) -> Planes {
        use rayon::prelude::*;
        let fft = &self.response.fft;
        let (size, half) = (fft.size(), fft.size() / 2 + 1);
        let shape = self.shape();
        let slope = |k: usize| 2.0 - 2.0 * (std::f64::consts::TAU * k as f64 / size as f64).cos();
        let slopes: Vec<f32> = (0..size).map(|k| slope(k) as f32).collect();
        let one = |(plane, (share, response)): (&Array2<f32>, (&Array2<f32>, &Vec<f32>))| {
            let mean = share.iter().map(|s| s * s).sum::<f32>() / share.len() as f32;
            let mut square = vec![0.0f32; size * size];
            for ((y, x), v) in plane.indexed_iter() {
                square[y * size + x] = v / share[[y, x]];
            }
            let mut spectrum = vec![Complex32::ZERO; fft.entries()];
            let mut scratch = FftScratch::default();
            fft.forward(&mut square, shape.0, &mut spectrum, &mut scratch);
            for kx in 0..half {
                for ky in 0..size {
                    let prior = terms.slopes as f32 * (slopes[kx] + slopes[ky]) + terms.identity as f32;
                    let at = kx * size + ky;
                    spectrum[at] /= response[at] + prior / mean + 1e-6;
                }
            }
            fft.inverse(&mut spectrum, &mut square, &mut scratch);
            Array2::from_shape_fn(shape, |(y, x)| square[y * size + x] / share[[y, x]])
        };
        residual
            .par_iter()
            .zip(self.share.par_iter().zip(&self.response.spectrum))
            .map(one)
            .collect()
    }

    /// Conjugate gradients from a picture towards the solution of the system with this right side.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn solve(
        &self,
        mut x: Planes,
        right: &[Array2<f32>],
        terms: Terms,
        iterations: usize,
        progress: &dyn Progress,
    ) -> Result<Planes> {
        let mut residual: Planes = self.apply(&x, terms);
        residual.iter_mut().zip(right).for_each(|(r, b)| *r = b - &*r);
        let mut z = self.precondition(&residual, terms);
        let mut direction = z.clone();
        let mut old = dot(&residual, &z);
        for _ in 0..iterations {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            progress.advance(1);
            let image = self.apply(&direction, terms);
            let curvature = dot(&direction, &image);
            if curvature <= 0.0 || old <= 0.0 {
                break;
            }
            let step = (old / curvature) as f32;
            for c in 0..x.len() {
                x[c].scaled_add(step, &direction[c]);
                residual[c].scaled_add(-step, &image[c]);
            }
            let before = z;
            z = self.precondition(&residual, terms);
            let new = dot(&residual, &z);
            // Polak and Ribiere: the preconditioner is not exactly the same for both signs of rounding.
            let turn = ((new - dot(&residual, &before)) / old).max(0.0) as f32;
            old = new;
            for c in 0..x.len() {
                direction[c].zip_mut_with(&z[c], |d, z| *d = z + turn * *d);
            }
        }
        Ok(x)
    }
}

fn dot(a: &[Array2<f32>], b: &[Array2<f32>]) -> f64 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// Slopes towards the next row and the next column; zero at the last.
pub fn slopes(x: &Array2<f32>) -> [Array2<f32>; 2] {
    let (rows, columns) = x.dim();
    let down = Array2::from_shape_fn((rows, columns), |(i, j)| {
        if i + 1 < rows { x[[i + 1, j]] - x[[i, j]] } else { 0.0 }
    });
    let right = Array2::from_shape_fn((rows, columns), |(i, j)| {
        if j + 1 < columns {
            x[[i, j + 1]] - x[[i, j]]
        } else {
            0.0
        }
    });
    [down, right]
}

/// The adjoint of [`slopes`].
pub fn slopes_adjoint([down, right]: &[Array2<f32>; 2]) -> Array2<f32> {
    let (rows, columns) = down.dim();
    Array2::from_shape_fn((rows, columns), |(i, j)| {
        let mut sum = 0.0;
        if i + 1 < rows {
            sum -= down[[i, j]];
        }
        if i > 0 {
            sum += down[[i - 1, j]];
        }
        if j + 1 < columns {
            sum -= right[[i, j]];
        }
        if j > 0 {
            sum += right[[i, j - 1]];
        }
        sum
    })
}

fn add_slopes(to: &mut Array2<f32>, x: &Array2<f32>, strength: f32) {
    if strength != 0.0 {
        to.scaled_add(strength, &slopes_adjoint(&slopes(x)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_have_their_adjoint() {
        let x = Array2::from_shape_fn((7, 9), |(i, j)| ((i * 5 + j * 3) % 7) as f32);
        let y = [3, 4].map(|k| Array2::from_shape_fn((7, 9), |(i, j)| ((i * k + j) % 5) as f32));
        let a: f32 = slopes(&x).iter().zip(&y).map(|(s, y)| (s * y).sum()).sum();
        let b = (&x * &slopes_adjoint(&y)).sum();
        // Sums of whole numbers.
        assert_eq!(a, b);
    }
}
