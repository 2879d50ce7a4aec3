//! Forward model of stacks.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex, PoisonError};

use metalith_attribution::{LeaveOut, RefitEffect, RefitPlan};
use nalgebra::DMatrix;
use ndarray::Array2;
use num_complex::Complex32;
use rayon::prelude::*;

use super::Prepared;
use super::detector::{Detector, Images, Measured, STEPS, dot, eliminate, eliminated};
use super::light::{Light, Place};
use super::set::StackSet;
use super::setting::{self, Effects, Setting};

/// Memory for predictions that are kept (bytes).
const KEPT_BYTES: usize = 400_000_000;

/// Steps of a derivative by which a parameter may move before derivatives are taken anew.
const NEAR: f64 = 6.0;

/// Whole pixels by which a pattern may wander from where the stated model has it, while effects are tried.
const WANDERS: usize = 5;

/// Change of a prediction with a parameter, and the values of all parameters where it was taken.
pub(super) struct Change {
    theta: Vec<f64>,
    pub(super) values: Vec<f32>,
}

/// A set of stacks with its forward model.
pub struct StackModel<'a> {
    pub(super) set: &'a StackSet,
    light: Light<'a>,
    detector: Detector,
    /// Parameters and effects that are tried.
    pub(crate) own: Effects,
    pub(super) measured: Vec<Measured>,
    /// Whole pixels by which each frame is displaced from the stated model.
    origins: Vec<[f64; 2]>,
    /// Middle of the positions of the planes (um).
    middle_um: f64,
    kept: Vec<Mutex<Vec<Arc<Base>>>>,
    keep: usize,
    /// Relative error that noise makes alone.
    pub(super) noise: f64,
    /// Times that starts of each effect were compared.
    pub(super) scans: Vec<AtomicUsize>,
}

/// Prediction of a plane for a setting.
pub(super) struct Base {
    setting: Setting,
    /// Values of all parameters.
    theta: Vec<f64>,
    shift: [f64; 2],
    pub(super) images: Images,
    gain: f32,
    pub(super) residual: Vec<f32>,
    /// Sums of products of columns that were asked for.
    products: Mutex<HashMap<[usize; 2], f64>>,
    columns: Mutex<BTreeMap<usize, Arc<Change>>>,
}

impl Base {
    /// Square of the relative error of a plane.
    pub(super) fn error(&self) -> f64 {
        self.residual.iter().map(|r| f64::from(*r).powi(2)).sum()
    }
}

impl<'a> StackModel<'a> {
    /// A model of a set whose frames have the orientation of the sensor.
    pub(crate) fn new(set: &'a StackSet, prepared: &'a Prepared) -> Self {
        let (sampling, focus_um) = (&prepared.sampling, prepared.focus_um);
        let (rows, cols) = set.planes[0].frame.dim();
        let detector = Detector::new(rows, cols, sampling);
        let measured: Vec<Measured> = { set.planes.par_iter() }
            .map(|p| detector.measured(p, set.bench.background))
            .collect();
        let positions = || set.planes.iter().map(|p| p.position_um);
        let (low, high) = positions().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        let keep = KEPT_BYTES / (set.planes.len() * rows * cols * 4 * 12).max(1);
        let mut out = Self {
            set,
            light: Light::new(set, sampling),
            detector,
            own: setting::effects(set, sampling),
            measured,
            origins: vec![[0.0; 2]; set.planes.len()],
            middle_um: 0.5 * (low + high),
            kept: set.planes.iter().map(|_| Mutex::default()).collect(),
            keep: keep.clamp(1, 5),
            noise: prepared.noise,
            scans: Vec::new(),
        };
        out.scans = out.own.effects.iter().map(|_| AtomicUsize::new(0)).collect();
        if set.bench.shift {
            let mut theta = vec![0.0; out.own.parameters.len()];
            theta[setting::FOCUS] = focus_um;
            let found = (0..set.planes.len()).into_par_iter().map(|m| {
                let spectrum = out.spectrum(m, &out.setting(&theta, set.planes[m].object));
                out.detector
                    .correlate(&spectrum, &out.measured[m], [cols / 2, rows / 2])
                    .0
            });
            out.origins = found.collect();
        }
        out
    }

    /// Try only some of the effects.
    pub(crate) fn keep(&mut self, effects: &[RefitEffect]) {
        let kept: Vec<bool> = self
            .own
            .effects
            .iter()
            .map(|e| effects.iter().any(|k| k.name == e.name))
            .collect();
        let mut by_effect = kept.iter();
        self.own.effects.retain(|_| by_effect.next() == Some(&true));
        let mut by_scope = kept.iter();
        self.own.scopes.retain(|_| by_scope.next() == Some(&true));
        let mut by_scan = kept.iter();
        self.own.scans.retain(|_| by_scan.next() == Some(&true));
    }

    /// Roles of the planes: planes and objects are left out in turn.
    pub fn plan(&self) -> RefitPlan {
        let planes = &self.set.planes;
        let way = |name: &str, groups: Vec<usize>| LeaveOut {
            name: name.into(),
            groups,
        };
        RefitPlan {
            fitted: planes.iter().map(|p| p.fitted).collect(),
            ways: vec![
                way("plane", planes.iter().map(|p| p.number).collect()),
                way("object", planes.iter().map(|p| p.object).collect()),
            ],
        }
    }

    fn setting(&self, theta: &[f64], object: usize) -> Setting {
        let mut out = Setting::of(theta, object);
        let transmission = self.set.objects[object].transmission.as_ref();
        let p = &mut out.pupil;
        if !transmission.is_some_and(|t| t.has_depth) {
            (p.depth, p.mask_blur_um2) = (0.0, 0.0);
        }
        if transmission.is_none() {
            (p.shift_um, p.rotation_deg, p.mask_scale, p.unmodulated) = ([0.0; 2], 0.0, 0.0, 0.0);
        }
        out
    }

    /// Spectrum of the predicted frame of a plane.
    fn spectrum(&self, m: usize, setting: &Setting) -> Vec<Complex32> {
        let (plane, bench) = (&self.set.planes[m], &self.set.bench);
        let pupil = self.light.pupil(plane.object, &setting.pupil);
        let moved = (plane.position_um - self.middle_um) * (1.0 + setting.spacing) + self.middle_um;
        let distance_um = (bench.sensor_um + moved + setting.focus_um).max(0.05 * bench.sensor_um);
        let pixel_um = bench.pixel_um * (1.0 + setting.pixel);
        let place = Place {
            distance_um,
            mask_um: setting.mask_distance_um.clamp(-0.5 * distance_um, 4.0 * distance_um),
            pixel_um,
            origin_px: self.origins[m].map(|v| -v),
        };
        let intensity = self.light.intensity(&pupil, place);
        self.detector.spectrum(intensity, pixel_um, setting.blur_um2)
    }

    /// Prediction of a plane, registered to its frame; from where the last one was, if that is near.
    fn predict(&self, m: usize, theta: &[f64], last: Option<[f64; 2]>) -> Base {
        let setting = &self.setting(theta, self.set.planes[m].object);
        let spectrum = self.spectrum(m, setting);
        let measured = &self.measured[m];
        let correlated = || {
            let (from, _) = self.detector.correlate(&spectrum, measured, [WANDERS; 2]);
            self.detector.register(&spectrum, measured, from, STEPS).0
        };
        let (shift, mut images) = if self.set.bench.shift {
            let at_last = last.map(|from| self.detector.register(&spectrum, measured, from, STEPS));
            let at_last = at_last.filter(|(_, found)| *found).map(|(at, _)| at);
            at_last.unwrap_or_else(correlated)
        } else {
            ([0.0; 2], self.detector.images(&spectrum, [0.0; 2]))
        };
        // Pixels that are not used have no part in any sum.
        for own in [&mut images.value].into_iter().chain(&mut images.along) {
            own.iter_mut().zip(&measured.used).for_each(|(v, u)| *v *= u);
        }
        let own: &[&[f32]] = if self.set.bench.background {
            &[&measured.used]
        } else {
            &[]
        };
        let form = eliminated(&[&images.value, &measured.values], own);
        let gain = (form[(0, 1)] / form[(0, 0)].max(f64::MIN_POSITIVE)).max(0.0);
        let gain = if gain.is_finite() { gain as f32 } else { 0.0 };
        let mut residual: Vec<f32> = { measured.values.iter().zip(&images.value) }
            .map(|(v, i)| v - gain * i)
            .collect();
        if self.set.bench.background {
            let count: f32 = measured.used.iter().sum();
            let level = residual.iter().sum::<f32>() / count.max(1.0);
            residual
                .iter_mut()
                .zip(&measured.used)
                .for_each(|(r, u)| *r -= level * u);
        }
        Base {
            setting: *setting,
            theta: theta.to_vec(),
            shift,
            images,
            gain,
            residual,
            products: Mutex::default(),
            columns: Mutex::default(),
        }
    }

    pub(super) fn base(&self, m: usize, theta: &[f64]) -> Arc<Base> {
        let setting = &self.setting(theta, self.set.planes[m].object);
        let mut kept = self.kept[m].lock().unwrap_or_else(PoisonError::into_inner);
        let base = match kept.iter().position(|b| b.setting == *setting) {
            Some(at) => kept.remove(at),
            None => Arc::new(self.predict(m, theta, kept.last().map(|b| b.shift))),
        };
        if kept.len() >= self.keep {
            kept.remove(0);
        }
        kept.push(base.clone());
        base
    }

    /// Square of the relative error of a plane after one step towards its displacement, to compare starts.
    pub(super) fn rough_error(&self, m: usize, theta: &[f64]) -> f64 {
        let spectrum = self.spectrum(m, &self.setting(theta, self.set.planes[m].object));
        let measured = &self.measured[m];
        let from = if self.set.bench.shift {
            self.detector.correlate(&spectrum, measured, [WANDERS; 2]).0
        } else {
            [0.0; 2]
        };
        let mut images = self.detector.images(&spectrum, from);
        for own in [&mut images.value].into_iter().chain(&mut images.along) {
            own.iter_mut().zip(&measured.used).for_each(|(v, u)| *v *= u);
        }
        eliminated(&[&measured.values], &self.nuisances(m, &images))[(0, 0)]
    }

    /// Columns of what is free in each plane.
    pub(super) fn nuisances<'b>(&'b self, m: usize, images: &'b Images) -> Vec<&'b [f32]> {
        let mut own: Vec<&[f32]> = vec![&images.value];
        if self.set.bench.background {
            own.push(&self.measured[m].used);
        }
        if self.set.bench.shift {
            own.extend(images.along.iter().map(|v| &v[..]));
        }
        own
    }

    /// Normal equations of a plane over the changes with some parameters and the residual.
    pub(super) fn form(&self, m: usize, active: &[usize], theta: &[f64]) -> DMatrix<f64> {
        let base = self.base(m, theta);
        let columns: Vec<_> = active.iter().map(|&slot| self.column(m, &base, slot, theta)).collect();
        let own = self.nuisances(m, &base.images);
        let k = own.len();
        let mut products = base.products.lock().unwrap_or_else(PoisonError::into_inner);
        let last = active.len();
        let mut product = |i: usize, j: usize| {
            let values = |i: usize| match i.checked_sub(k) {
                None => Some(own[i]),
                Some(c) if c == last => Some(&base.residual[..]),
                Some(c) => columns[c].as_ref().map(|c| &c.values[..]),
            };
            // Names of columns: what is free, the residual, parameters.
            let name = |i: usize| match i.checked_sub(k) {
                None => i,
                Some(c) if c == last => k,
                Some(c) => k + 1 + active[c],
            };
            let (Some(a), Some(b)) = (values(i), values(j)) else {
                return 0.0;
            };
            let (low, high) = (name(i).min(name(j)), name(i).max(name(j)));
            *products.entry([low, high]).or_insert_with(|| dot(a, b))
        };
        let mut form = eliminate(k, k + last + 1, &mut product);
        form[(last, last)] = base.error();
        form
    }

    /// Change of the prediction with a parameter; none if there is no change.
    pub(super) fn column(&self, m: usize, base: &Base, slot: usize, theta: &[f64]) -> Option<Arc<Change>> {
        let step = self.own.steps[slot];
        let mut moved = theta.to_vec();
        moved[slot] += step;
        let object = self.set.planes[m].object;
        let setting = self.setting(&moved, object);
        if setting == base.setting {
            return None;
        }
        let near = self.near(m, base, slot);
        let mut columns = base.columns.lock().unwrap_or_else(PoisonError::into_inner);
        let column = columns.entry(slot).or_insert_with(|| {
            if let Some(near) = near {
                return near;
            }
            let there = self.detector.image(&self.spectrum(m, &setting), base.shift);
            let factor = base.gain / step as f32;
            let used = &self.measured[m].used;
            let change = { there.iter().zip(&base.images.value).zip(used) }.map(|((a, b), u)| (a * u - b) * factor);
            Arc::new(Change {
                theta: theta.to_vec(),
                values: change.collect(),
            })
        });
        Some(column.clone())
    }

    /// The change with a parameter at a prediction so near that it is almost equal.
    fn near(&self, m: usize, base: &Base, slot: usize) -> Option<Arc<Change>> {
        let kept = self.kept[m].lock().unwrap_or_else(PoisonError::into_inner);
        let is_near = |change: &Change| {
            let moved = base.theta.iter().zip(&change.theta).zip(&self.own.steps);
            { moved }.all(|((a, b), step)| (a - b).abs() <= NEAR * step)
        };
        let others = kept
            .iter()
            .rev()
            .filter(|other| !std::ptr::eq(Arc::as_ptr(other), base));
        let change = |other: &Arc<Base>| {
            let columns = other.columns.lock().unwrap_or_else(PoisonError::into_inner);
            columns.get(&slot).filter(|c| is_near(c)).cloned()
        };
        { others }.find_map(change)
    }

    /// A predicted frame and the measured one, both over the norm of the measured one.
    pub(crate) fn pair(&self, m: usize, theta: &[f64]) -> [Array2<f64>; 2] {
        let base = self.base(m, theta);
        let shape = self.set.planes[m].frame.dim();
        let measured = &self.measured[m].values;
        let predicted = measured
            .iter()
            .zip(&base.residual)
            .map(|(v, r)| f64::from(v - r))
            .collect();
        let measured = measured.iter().map(|v| f64::from(*v)).collect();
        [measured, predicted].map(|v| Array2::from_shape_vec(shape, v).expect("as many as pixels"))
    }
}
