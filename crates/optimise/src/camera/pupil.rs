//! The transfer function of an element in one direction at one wavelength, and its adjoint.
//!
//! Light that arrives with the sines s from a point that is far away leaves an element of phase phi with s + grad phi / k, and its chief
//! ray lands at rho, a distance R0 from the middle of the element. The field about rho is the Fourier transform of the pupil
//! exp(i (phi + k s r + k |r - rho|)) over k (1 - s' s'^T) r / R0, with s' = rho / R0; the next term, of the order of r delta / R0^2
//! with delta the distance from rho, is left out. The pupil is sampled at places that are so far apart that its autocorrelation
//! holds the transfer function at the frequencies that are asked for.

use std::f64::consts::TAU;
use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use num_complex::Complex32;

use super::element::{CameraElement, TERMS, terms};

/// One view of an element.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// Sines of the light that arrives.
    pub sines: [f64; 2],
    pub wavelength_um: f64,
    /// Wavelength of wedges (um).
    pub wedge_um: f64,
    /// Wavelength of the chief ray that lands in the origin of the transfer function (um).
    pub chief_um: f64,
    /// Distance of the sensor (um).
    pub distance_um: f64,
    /// Step of frequency (1/um), and number of steps to the largest.
    pub step: f64,
    pub steps: usize,
    /// True of the bound: light of all wavelengths and directions meets in one point.
    pub perfect: bool,
}

/// Place at which a chief ray lands, from the middle of its element (um); none if no light leaves so.
pub(super) fn landing_um(sines: [f64; 2], distance_um: f64) -> Option<[f64; 2]> {
    let cos2 = 1.0 - sines[0].powi(2) - sines[1].powi(2);
    (cos2 > 0.0).then(|| sines.map(|s| distance_um * s / cos2.sqrt()))
}

/// Buffers of transforms of one size.
pub(super) struct Transform {
    size: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Transform {
    pub(super) fn new(least: usize) -> Self {
        let size = (least..).find(|n| smooth(*n)).unwrap_or(least);
        Self {
            size,
            forward: forward(size),
            inverse: inverse(size),
        }
    }

    fn both(&self, fft: &Arc<dyn Fft<f32>>, values: &mut [Complex32], other: &mut [Complex32]) {
        let n = self.size;
        for _ in 0..2 {
            fft.process(values);
            for (i, line) in values.chunks_exact(n).enumerate() {
                for (j, v) in line.iter().enumerate() {
                    other[j * n + i] = *v;
                }
            }
            values.copy_from_slice(other);
        }
    }
}

/// True of even numbers without prime factors other than 2, 3 and 5.
fn smooth(n: usize) -> bool {
    let mut rest = n;
    for factor in [2, 3, 5] {
        while rest.is_multiple_of(factor) {
            rest /= factor;
        }
    }
    rest == 1 && n.is_multiple_of(2)
}

/// Pupil of a view.
pub(super) struct Pupil {
    half: usize,
    /// Places of the samples are this matrix times whole numbers (um).
    matrix: [[f64; 2]; 2],
    cut_um: f64,
}

impl View {
    /// Pupil of an element; none where no light of the direction leaves it.
    pub(super) fn pupil(&self, element: &CameraElement) -> Option<Pupil> {
        let rho = self.landing_um(element)?;
        let r0 = (rho[0].powi(2) + rho[1].powi(2) + self.distance_um.powi(2)).sqrt();
        let s = rho.map(|v| v / r0);
        let cos2 = 1.0 - s[0] * s[0] - s[1] * s[1];
        let least = self.wavelength_um * r0 * self.step;
        let entry = |i: usize, j: usize| least * (f64::from(u8::from(i == j)) + s[i] * s[j] / cos2);
        Some(Pupil {
            half: (element.radius_um() / least) as usize + 1,
            matrix: [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
            cut_um: least,
        })
    }

    /// Samples along an axis that a transform of this view needs.
    pub(super) fn samples(&self, element: &CameraElement) -> Option<usize> {
        self.pupil(element).map(|p| 2 * p.half + 2 + self.steps)
    }

    fn landing_um(&self, element: &CameraElement) -> Option<[f64; 2]> {
        let order = self.chief_um / self.wedge_um;
        landing_um(
            [0, 1].map(|a| self.sines[a] + order * element.wedge[a]),
            self.distance_um,
        )
    }

    /// Field in the pupil, its samples in the first places of a square of the transform; the open area in
    /// samples.
    fn field(&self, element: &CameraElement, pupil: &Pupil, size: usize, field: &mut [Complex32]) -> f64 {
        field.fill(Complex32::ZERO);
        let Some(rho) = self.landing_um(element) else {
            return 0.0;
        };
        let k = TAU / self.wavelength_um;
        let r0_2 = rho[0].powi(2) + rho[1].powi(2) + self.distance_um.powi(2);
        let r0 = r0_2.sqrt();
        let linear = [0, 1].map(|a| k * self.sines[a] + TAU / self.wedge_um * element.wedge[a]);
        let mut power = 0.0;
        pupil.each(element, |at, r, open| {
            let change = r[0] * (r[0] - 2.0 * rho[0]) + r[1] * (r[1] - 2.0 * rho[1]);
            let path = change / ((r0_2 + change).sqrt() + r0);
            let phase = if self.perfect {
                0.0
            } else {
                element.phase_rad(r) + linear[0] * r[0] + linear[1] * r[1] + k * path
            };
            let (sin, cos) = (phase.rem_euclid(TAU) as f32).sin_cos();
            let open = open as f32;
            field[at[1] * size + at[0]] = Complex32::new(cos * open, sin * open);
            power += f64::from(open);
        });
        power
    }

    /// Transfer function at frequencies (i, j) times the step, both from minus to plus `steps`, row by row; added with a weight for
    /// each of the sums.
    pub(super) fn add_transfer(
        &self,
        element: &CameraElement,
        transform: &Transform,
        buffers: &mut [Vec<Complex32>; 2],
        sums: &mut [(f64, &mut [num_complex::Complex64])],
    ) {
        let Some(pupil) = self.pupil(element) else { return };
        let n = transform.size;
        let [values, other] = buffers;
        values.resize(n * n, Complex32::ZERO);
        other.resize(n * n, Complex32::ZERO);
        let power = self.field(element, &pupil, n, values);
        transform.both(&transform.forward, values, other);
        values.iter_mut().for_each(|v| *v = Complex32::new(v.norm_sqr(), 0.0));
        transform.both(&transform.inverse, values, other);
        let scale = 1.0 / (power * (n * n) as f64);
        for (at, lag) in self.lags(n).enumerate() {
            let v = values[lag];
            // The squares of samples that are open in part are less than their area, at no shift alone.
            let v = if lag == 0 {
                num_complex::Complex64::ONE
            } else {
                num_complex::Complex64::new(f64::from(v.re), f64::from(v.im)) * scale
            };
            for (weight, sum) in sums.iter_mut() {
                sum[at] += *weight * v;
            }
        }
    }

    /// Index of each frequency in the autocorrelation: that at minus the frequency.
    fn lags(&self, n: usize) -> impl Iterator<Item = usize> {
        let side = 2 * self.steps + 1;
        let steps = self.steps;
        (0..side * side).map(move |at| {
            let [i, j] = [at % side, at / side].map(|k| (n + steps - k) % n);
            j * n + i
        })
    }

    /// Adds the slope by the coefficients of all terms to `slopes`, from the slope of a number by the transfer function: the number
    /// changes by the real part of the sum of conj(slope) times the change of the transfer function.
    pub(super) fn add_slopes(
        &self,
        element: &CameraElement,
        transform: &Transform,
        buffers: &mut [Vec<Complex32>; 3],
        by_transfer: impl Fn(usize) -> num_complex::Complex64,
        slopes: &mut [f64; TERMS],
    ) {
        let Some(pupil) = self.pupil(element) else { return };
        let n = transform.size;
        let [values, other, field] = buffers;
        values.resize(n * n, Complex32::ZERO);
        other.resize(n * n, Complex32::ZERO);
        field.resize(n * n, Complex32::ZERO);
        let power = self.field(element, &pupil, n, field);
        values.fill(Complex32::ZERO);
        for (at, lag) in self.lags(n).enumerate() {
            let v = by_transfer(at);
            values[lag] = Complex32::new(v.re as f32, v.im as f32);
        }
        // The inverse transform's adjoint is the forward one.
        transform.both(&transform.forward, values, other);
        let mut spectrum = field.clone();
        transform.both(&transform.forward, &mut spectrum, other);
        values.iter_mut().zip(&spectrum).for_each(|(q, p)| *q = *p * q.re);
        transform.both(&transform.inverse, values, other);
        let scale = 2.0 / (power * (n * n) as f64);
        let radius = element.radius_um();
        pupil.each(element, |at, r, _| {
            let at = at[1] * n + at[0];
            let slope = f64::from((values[at] * field[at].conj()).im) * scale;
            let own = terms(r.map(|v| v / radius));
            slopes.iter_mut().zip(&own).for_each(|(s, v)| *s += slope * v);
        });
    }
}

impl Pupil {
    /// Each sample that is open: its place in the square, its place from the middle (um), and the share of it that is open, which falls
    /// from one to nothing over a sample at the rim.
    fn each(&self, element: &CameraElement, mut each: impl FnMut([usize; 2], [f64; 2], f64)) {
        let half = self.half as i64;
        let [[a, b], [c, d]] = self.matrix;
        for j in -half..=half {
            for i in -half..=half {
                let (x, y) = (i as f64, j as f64);
                let r = [a * x + b * y, c * x + d * y];
                let inside = (element.radius_um() - r[0].hypot(r[1])) / self.cut_um + 0.5;
                if inside > 0.0 {
                    each([(i + half) as usize, (j + half) as usize], r, inside.min(1.0));
                }
            }
        }
    }
}
