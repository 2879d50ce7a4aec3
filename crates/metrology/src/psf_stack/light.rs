//! Light of an object: from its transmission to the intensity on the sensor.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, Mutex, PoisonError};

use metalith_core::Zernike;
use ndarray::{Array2, ArrayView2};
use num_complex::{Complex32, Complex64};

use super::bench::ApertureShape;
use super::sampling::{Method, Sampling};
use super::set::{StackSet, Transmission};
use super::setting::{FIRST_ZERNIKE, PupilSetting, ZERNIKES};
use crate::heights::fft::{Fft2, frequency};

/// Light behind opening, object and lens at each wavelength, or its spectrum.
type Pupil = Arc<Vec<Array2<Complex32>>>;

/// Pupils of an object that are kept.
const KEPT: usize = 12;

/// Light of all objects of a set.
pub(super) struct Light<'a> {
    set: &'a StackSet,
    sampling: &'a Sampling,
    zernikes: Vec<Array2<f32>>,
    kept: Vec<Mutex<Vec<(PupilSetting, Pupil)>>>,
    transforms: Option<[Fft2<f32>; 2]>,
}

/// Where a plane is, and where its window is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// From the lens, or from the object without one (um).
    pub distance_um: f64,
    /// Edge of a pixel (um).
    pub pixel_um: f64,
    /// Whole pixels by which the pattern is displaced, along x and y.
    pub origin_px: [f64; 2],
}

impl<'a> Light<'a> {
    pub(super) fn new(set: &'a StackSet, sampling: &'a Sampling) -> Self {
        let at_lens = set.bench.lens.filter(|l| l.distance_um > 0.0);
        let radius = 0.5 * at_lens.map_or(set.bench.aperture_um, |l| l.diameter_um);
        let n = sampling.n;
        let along = |k: usize| place(k, n, sampling.dx_um) / radius;
        let zernikes = (0..ZERNIKES as u32)
            .map(|k| {
                let z = Zernike::noll(FIRST_ZERNIKE + k);
                Array2::from_shape_fn((n, n), |(y, x)| {
                    let (x, y) = (along(x), along(y));
                    // No light comes from farther out than a grown opening.
                    if x.hypot(y) > 1.5 {
                        0.0
                    } else {
                        (z.norm() * z.value(x, y)) as f32
                    }
                })
            })
            .collect();
        let needs = sampling.method == Method::AngularSpectrum || at_lens.is_some();
        Self {
            set,
            sampling,
            zernikes,
            kept: set.objects.iter().map(|_| Mutex::new(Vec::new())).collect(),
            transforms: needs.then(|| [Fft2::new(n, n, false), Fft2::new(n, n, true)]),
        }
    }

    /// Light behind the lens of an object.
    pub(super) fn pupil(&self, object: usize, setting: &PupilSetting) -> Pupil {
        let mut kept = self.kept[object].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = kept.iter().position(|(s, _)| s == setting) {
            let found = kept.remove(at);
            let pupil = found.1.clone();
            kept.push(found);
            return pupil;
        }
        let waves = 0..self.set.bench.wavelengths.len();
        let pupil: Pupil = Arc::new(waves.map(|w| self.behind(object, setting, w)).collect());
        if kept.len() >= KEPT {
            kept.remove(0);
        }
        kept.push((*setting, pupil.clone()));
        pupil
    }

    fn behind(&self, object: usize, setting: &PupilSetting, wavelength: usize) -> Array2<Complex32> {
        let (n, dx, bench) = (self.sampling.n, self.sampling.dx_um, &self.set.bench);
        let wavelength_um = bench.wavelengths[wavelength][0];
        let mask = { self.set.objects[object].transmission.as_ref() }
            .map(|t| Mask::new(t, t.factors[wavelength] * (1.0 + setting.depth), dx));
        let turned = Complex64::cis(-setting.rotation_deg.to_radians()) / (1.0 + setting.mask_scale);
        let share = setting.unmodulated as f32;
        let mut field = Array2::from_shape_fn((n, n), |(y, x)| {
            let (x, y) = (place(x, n, dx), place(y, n, dx));
            let open = self.opening(x, y, setting.aperture);
            let Some(mask) = mask.as_ref().filter(|_| open > 0.0) else {
                return Complex32::from(open);
            };
            let at = Complex64::new(x - setting.shift_um[0], y - setting.shift_um[1]) * turned;
            let passed = mask.at(at.re, at.im, dx);
            (passed * (1.0 - share) + share) * open
        });
        let lens = bench.lens.filter(|l| l.distance_um > 0.0);
        if let (Some(lens), Some([forward, inverse])) = (lens, &self.transforms) {
            let curvature = bench.source_um.map_or(0.0, |s| 1.0 / s);
            self.bend(&mut field, curvature / wavelength_um);
            let spectrum = forward.transposed(field.into_raw_vec_and_offset().0);
            let scale = 1.0 / (n * n) as f64;
            let step = |k: usize| PI * wavelength_um * lens.distance_um * (frequency(k, n) / dx).powi(2);
            let moved = spectrum
                .into_iter()
                .enumerate()
                .map(|(k, v)| v * single(Complex64::cis(-step(k / n) - step(k % n)) * scale));
            field = Array2::from_shape_vec((n, n), inverse.transposed(moved.collect())).expect("as many as samples");
            let radius = 0.5 * lens.diameter_um;
            field.indexed_iter_mut().for_each(|((y, x), v)| {
                let r = place(x, n, dx).hypot(place(y, n, dx));
                *v *= (0.5 + (radius - r) / dx).clamp(0.0, 1.0) as f32;
            });
        }
        if setting.zernike_nm.iter().any(|nm| *nm != 0.0) {
            let mut path = Array2::<f32>::zeros((n, n));
            for (map, nm) in self
                .zernikes
                .iter()
                .zip(setting.zernike_nm)
                .filter(|(_, nm)| *nm != 0.0)
            {
                path.scaled_add((TAU * nm * 1e-3 / wavelength_um) as f32, map);
            }
            field.zip_mut_with(&path, |v, phase| *v *= Complex32::cis(*phase));
        }
        match (self.sampling.method, &self.transforms) {
            (Method::AngularSpectrum, Some([forward, _])) => {
                self.bend(&mut field, self.curvature() / wavelength_um);
                let spectrum = forward.transposed(field.into_raw_vec_and_offset().0);
                Array2::from_shape_vec((n, n), spectrum).expect("as many as samples")
            }
            _ => field,
        }
    }

    /// Curvature of source and lens together, where both are in the plane of the light (1/um).
    fn curvature(&self) -> f64 {
        let b = &self.set.bench;
        let lens = b.lens.map_or(0.0, |l| -1.0 / l.focal_um);
        let moved = b.lens.is_some_and(|l| l.distance_um > 0.0);
        lens + b.source_um.filter(|_| !moved).map_or(0.0, |s| 1.0 / s)
    }

    /// Multiply by a quadratic phase.
    fn bend(&self, field: &mut Array2<Complex32>, curvature_over_wavelength: f64) {
        if curvature_over_wavelength == 0.0 {
            return;
        }
        let (n, dx) = (self.sampling.n, self.sampling.dx_um);
        let line: Vec<_> = (0..n)
            .map(|k| single(Complex64::cis(PI * curvature_over_wavelength * place(k, n, dx).powi(2))))
            .collect();
        field.indexed_iter_mut().for_each(|((y, x), v)| *v *= line[x] * line[y]);
    }

    /// Amplitude of the opening at a place.
    fn opening(&self, x: f64, y: f64, grown: f64) -> f32 {
        let dx = self.sampling.dx_um;
        let half = 0.5 * self.set.bench.aperture_um * (1.0 + grown);
        let inside = |r: f64| (0.5 + (half - r) / dx).clamp(0.0, 1.0);
        match &self.set.bench.shape {
            ApertureShape::Round => inside(x.hypot(y)) as f32,
            ApertureShape::Square => (inside(x.abs()) * inside(y.abs())) as f32,
            ApertureShape::Map { amplitude, sample_um } => {
                let scale = sample_um * (1.0 + grown);
                let (rows, cols) = amplitude.dim();
                let k = [y, x].map(|v| v / scale).into_iter().zip([rows, cols]);
                let at: Vec<f64> = k.map(|(v, n)| v + 0.5 * n as f64).collect();
                if at[0] < 0.0 || at[1] < 0.0 || at[0] >= rows as f64 || at[1] >= cols as f64 {
                    return 0.0;
                }
                boxed(amplitude.view(), at[1], at[0], 0.5 * dx / scale)
            }
        }
    }

    /// Intensity on the fine points of the padded window, summed over wavelengths.
    pub(super) fn intensity(&self, pupil: &Pupil, place_of: Place) -> Array2<f32> {
        let (s, b) = (self.sampling, &self.set.bench);
        let [rows, cols] = s.padded.map(|n| n * s.fine);
        let mut out = Array2::<f32>::zeros((rows, cols));
        for (field, [wavelength_um, weight]) in pupil.iter().zip(&b.wavelengths) {
            let [ey, ex] = [(rows, 1), (cols, 0)].map(|(m, axis)| self.kernel(m, place_of, axis, *wavelength_um));
            let light = match s.method {
                Method::FourierSum => ey.dot(field).dot(&ex.t()),
                Method::AngularSpectrum => ey.dot(&field.t()).dot(&ex.t()),
            };
            let weight = *weight as f32;
            out.zip_mut_with(&light, |sum, v| *sum += weight * v.norm_sqr());
        }
        out
    }

    /// Factors of a sum over samples of the light along an axis, for each fine point.
    fn kernel(&self, m: usize, at: Place, axis: usize, wavelength_um: f64) -> Array2<Complex32> {
        let (s, n) = (self.sampling, self.sampling.n);
        let fine = at.pixel_um / s.fine as f64;
        let points = (0..m).map(|j| place(j, m, fine) + at.origin_px[axis] * at.pixel_um);
        let points: Vec<f64> = points.collect();
        let z = at.distance_um;
        match s.method {
            Method::FourierSum => {
                let bend = PI * (1.0 / z + self.curvature()) / wavelength_um;
                let xs: Vec<f64> = (0..n).map(|k| place(k, n, s.dx_um)).collect();
                let scale = s.dx_um / (wavelength_um * z).sqrt();
                let bent: Vec<Complex64> = xs.iter().map(|x| Complex64::cis(bend * x * x) * scale).collect();
                Array2::from_shape_fn((m, n), |(j, k)| {
                    single(bent[k] * Complex64::cis(-TAU * points[j] * xs[k] / (wavelength_um * z)))
                })
            }
            Method::AngularSpectrum => {
                let first = 0.5 * (n as f64 - 1.0) * s.dx_um;
                Array2::from_shape_fn((m, n), |(j, k)| {
                    let f = frequency(k, n) / s.dx_um;
                    let phase = -PI * wavelength_um * z * f * f + TAU * f * (points[j] + first);
                    single(Complex64::cis(phase) / n as f64)
                })
            }
        }
    }
}

/// Place of the sample `k` of `n`, about the middle.
fn place(k: usize, n: usize, step: f64) -> f64 {
    (k as f64 - 0.5 * (n as f64 - 1.0)) * step
}

fn single(v: Complex64) -> Complex32 {
    Complex32::new(v.re as f32, v.im as f32)
}

/// Complex transmission on blocks of samples.
struct Mask {
    values: Array2<Complex32>,
    sample_um: f64,
}

impl Mask {
    /// Means over blocks of at most half a sample of the light.
    fn new(t: &Transmission, factor: f64, dx_um: f64) -> Self {
        let block = ((0.5 * dx_um / t.sample_um) as usize).max(1);
        let (rows, cols) = t.phase.dim();
        let [m, n] = [rows, cols].map(|n| n.div_ceil(block));
        let mut values = Array2::<Complex32>::zeros((m, n));
        let mut counts = Array2::<f32>::zeros((m, n));
        for ((y, x), phase) in t.phase.indexed_iter() {
            let amplitude = t.amplitude.as_ref().map_or(1.0, |a| a[(y, x)]);
            let at = (y / block, x / block);
            values[at] += Complex32::from_polar(amplitude, (f64::from(*phase) * factor).rem_euclid(TAU) as f32);
            counts[at] += 1.0;
        }
        values.zip_mut_with(&counts, |v, n| *v /= *n);
        Self {
            values,
            sample_um: t.sample_um * block as f64,
        }
    }

    /// Mean over a sample of the light about a place (um) from the middle of the object; its outermost samples go on.
    fn at(&self, x: f64, y: f64, dx_um: f64) -> Complex32 {
        let (rows, cols) = self.values.dim();
        let [x, y] = [(x, cols), (y, rows)].map(|(v, n)| v / self.sample_um + 0.5 * n as f64);
        boxed(self.values.view(), x, y, 0.5 * dx_um / self.sample_um)
    }
}

/// Mean of samples, each a square of edge 1, over a square about a place.
fn boxed<T>(values: ArrayView2<'_, T>, x: f64, y: f64, half: f64) -> T
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T> + Default,
{
    let (rows, cols) = values.dim();
    let range = |v: f64, n: usize| {
        // Beyond the rim its samples go on.
        let v = v.clamp(-1.0, n as f64 + 1.0);
        let (low, high) = (v - half, v + half);
        (low.floor() as isize..=high.floor() as isize).filter_map(move |k| {
            let weight = (high.min(k as f64 + 1.0) - low.max(k as f64)) / (2.0 * half);
            (weight > 0.0).then(|| (k.clamp(0, n as isize - 1) as usize, weight as f32))
        })
    };
    let mut sum = T::default();
    for (row, by_row) in range(y, rows) {
        for (col, by_col) in range(x, cols) {
            sum = sum + values[(row, col)] * (by_row * by_col);
        }
    }
    sum
}
