//! Light of an object: from its transmission to the intensity on the sensor.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use metalith_core::Zernike;
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

use super::bench::ApertureShape;
use super::chirp::{Chirp, ChirpSum};
use super::mask::{Mask, boxed};
use super::recent::Recent;
use super::sampling::{Method, Sampling};
use super::set::StackSet;
use super::setting::{FIRST_ZERNIKE, PupilSetting, ZERNIKES};
use crate::heights::fft::{Fft2, frequency};

/// Light behind opening, object and lens at each wavelength, or its spectrum.
type Pupil = Arc<Vec<Array2<Complex32>>>;

/// Pupils of an object that are kept: one for each parameter that is fitted, as far as memory (bytes) has them.
const KEPT: usize = 48;
const KEPT_BYTES: usize = 300_000_000;

/// Light behind openings and masks, and masks of one depth, that are kept.
const KEPT_PASSED: usize = 16;
const KEPT_MASKS: usize = 4;

/// Light of all objects of a set.
pub(super) struct Light<'a> {
    set: &'a StackSet,
    sampling: &'a Sampling,
    zernikes: Vec<Array2<f32>>,
    pupils: Vec<Recent<PupilSetting, Pupil>>,
    /// Without the path of the lens.
    passed: Vec<Recent<PupilSetting, Pupil>>,
    masks: Vec<Recent<[f64; 2], Arc<Mask>>>,
    /// Sums over samples of the light, to points along x and along y.
    sums: [ChirpSum; 2],
    transforms: Option<[Fft2<f32>; 2]>,
}

/// Where a plane is, and where its window is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// From the lens, or from the object without one (um).
    pub distance_um: f64,
    /// From the object to a lens that is stated in its plane (um).
    pub mask_um: f64,
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
        let waves = set.bench.wavelengths.len();
        let keep = (KEPT_BYTES / (8 * n * n * waves * set.objects.len())).clamp(4, KEPT);
        let needs = sampling.method == Method::AngularSpectrum || at_lens.is_some();
        Self {
            set,
            sampling,
            zernikes,
            pupils: set.objects.iter().map(|_| Recent::new(keep)).collect(),
            passed: set.objects.iter().map(|_| Recent::new(keep.min(KEPT_PASSED))).collect(),
            masks: set.objects.iter().map(|_| Recent::new(KEPT_MASKS.max(waves))).collect(),
            sums: [1, 0].map(|axis| ChirpSum::new(n, sampling.padded[axis] * sampling.fine)),
            transforms: needs.then(|| [Fft2::new(n, n, false), Fft2::new(n, n, true)]),
        }
    }

    /// Light behind the lens of an object.
    pub(super) fn pupil(&self, object: usize, setting: &PupilSetting) -> Pupil {
        self.pupils[object].get(*setting, || {
            let waves = 0..self.set.bench.wavelengths.len();
            Arc::new(waves.map(|w| self.behind(object, setting, w)).collect())
        })
    }

    /// Light behind opening and object at each wavelength.
    fn passed(&self, object: usize, setting: &PupilSetting) -> Pupil {
        let flat = PupilSetting {
            zernike_nm: [0.0; ZERNIKES],
            falloff: [0.0; 3],
            ..*setting
        };
        self.passed[object].get(flat, || {
            let waves = 0..self.set.bench.wavelengths.len();
            Arc::new(waves.map(|w| self.pass(object, setting, w)).collect())
        })
    }

    fn pass(&self, object: usize, setting: &PupilSetting, wavelength: usize) -> Array2<Complex32> {
        let (n, dx) = (self.sampling.n, self.sampling.dx_um);
        let mask = self.set.objects[object].transmission.as_ref().map(|t| {
            let factor = t.factors[wavelength] * (1.0 + setting.depth);
            self.masks[object].get([factor, setting.mask_blur_um2], || {
                Arc::new(Mask::new(t, factor, setting.mask_blur_um2, dx))
            })
        });
        let turned = Complex64::cis(-setting.rotation_deg.to_radians()) / (1.0 + setting.mask_scale);
        let share = setting.unmodulated as f32;
        let step = mask
            .as_ref()
            .filter(|_| self.sampling.smooth_masks)
            .map_or(0.0, |m| m.sample_um);
        let width = dx.hypot(step);
        Array2::from_shape_fn((n, n), |(y, x)| {
            let (x, y) = (place(x, n, dx), place(y, n, dx));
            let open = self.opening(x, y, setting.aperture);
            let Some(mask) = mask.as_ref().filter(|_| open > 0.0) else {
                return Complex32::from(open);
            };
            let at = Complex64::new(x - setting.shift_um[0], y - setting.shift_um[1]) * turned;
            let passed = mask.at(at.re, at.im, width);
            (passed * (1.0 - share) + share) * open
        })
    }

    fn behind(&self, object: usize, setting: &PupilSetting, wavelength: usize) -> Array2<Complex32> {
        let (n, dx, bench) = (self.sampling.n, self.sampling.dx_um, &self.set.bench);
        let wavelength_um = bench.wavelengths[wavelength][0];
        let mut field = self.passed(object, setting)[wavelength].clone();
        if setting.falloff.iter().any(|v| *v != 0.0) {
            let radius = 0.5 * bench.aperture_um;
            let [fall, by_x, by_y] = setting.falloff;
            let line = |rise: f64| -> Vec<f32> {
                let at = |k: usize| place(k, n, dx) / radius;
                let value = |k: usize| (rise * at(k) - fall * at(k) * at(k)).clamp(-20.0, 20.0).exp() as f32;
                (0..n).map(value).collect()
            };
            let (xs, ys) = (line(by_x), line(by_y));
            field.indexed_iter_mut().for_each(|((y, x), v)| *v *= xs[x] * ys[y]);
        }
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
                let spectrum = Array2::from_shape_vec((n, n), spectrum).expect("as many as samples");
                // From the lowest frequency to the highest; a transform is transposed.
                let from = |k: usize| (k + n / 2 + 1) % n;
                Array2::from_shape_fn((n, n), |(y, x)| spectrum[(from(x), from(y))])
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
        let mut out = vec![0.0_f32; rows * cols];
        for (field, [wavelength_um, weight]) in pupil.iter().zip(&b.wavelengths) {
            let [by_x, by_y] = [0, 1].map(|axis| self.chirp(place_of, axis, *wavelength_um));
            let light = self.sums[1].sum(&self.sums[0].sum(field, &by_x), &by_y);
            let weight = *weight as f32;
            out.iter_mut()
                .zip(&light)
                .for_each(|(sum, v)| *sum += weight * v.norm_sqr());
        }
        Array2::from_shape_vec((rows, cols), out).expect("as many as points")
    }

    /// Factors of a sum over samples of the light along an axis.
    fn chirp(&self, at: Place, axis: usize, wavelength_um: f64) -> Chirp {
        let (s, n) = (self.sampling, self.sampling.n);
        let fine = at.pixel_um / s.fine as f64;
        // Of the window along the other axis there are as many rows.
        let first = place(0, s.padded[1 - axis] * s.fine, 1.0) + at.origin_px[axis] * s.fine as f64;
        let z = at.distance_um;
        match s.method {
            Method::FourierSum => {
                // A lens at a distance changes the curvature and the scale of the sum as if the sensor stood elsewhere.
                let through = 1.0 - z * self.set.bench.lens.map_or(0.0, |l| 1.0 / l.focal_um);
                let moved = at.mask_um * through;
                let bend = PI * (through / (z + moved) - through / z + 1.0 / z + self.curvature()) / wavelength_um;
                let z = z + moved;
                let scale = s.dx_um / (wavelength_um * z).sqrt();
                self.sums[axis].chirp([place(0, n, 1.0), first], -s.dx_um * fine / (wavelength_um * z), |k| {
                    Complex64::from_polar(scale, bend * (k * s.dx_um).powi(2))
                })
            }
            Method::AngularSpectrum => {
                let middle = 0.5 * (n as f64 - 1.0);
                self.sums[axis].chirp([1.0 - (n / 2) as f64, first], fine / (n as f64 * s.dx_um), |k| {
                    let f = k / (n as f64 * s.dx_um);
                    let phase = -PI * wavelength_um * z * f * f + TAU * k * middle / n as f64;
                    Complex64::from_polar(1.0 / n as f64, phase)
                })
            }
        }
    }
}

/// Place of the sample `k` of `n`, about the middle.
fn place(k: usize, n: usize, step: f64) -> f64 {
    (k as f64 - 0.5 * (n as f64 - 1.0)) * step
}

pub(super) fn single(v: Complex64) -> Complex32 {
    Complex32::new(v.re as f32, v.im as f32)
}
