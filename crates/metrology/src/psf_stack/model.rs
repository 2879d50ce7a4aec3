//! Forward model of stacks.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use metalith_attribution::{LeaveOut, RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitPlan, RefitScope};
use ndarray::Array2;
use num_complex::Complex32;
use rayon::prelude::*;

use super::detector::{Detector, Images, Measured, eliminated};
use super::light::{Light, Place};
use super::sampling::Sampling;
use super::set::StackSet;
use super::setting::{self, BY_OBJECT, Effects, Setting};

/// Memory for predictions that are kept (bytes).
const KEPT_BYTES: usize = 400_000_000;

/// Planes of each object by which a fit finds where to start.
const SCANNED: usize = 3;

/// Share by which another start has to be better.
const BETTER_START: f64 = 0.005;

/// Whole pixels by which a pattern may wander from where the stated model has it, while effects are tried.
const WANDERS: usize = 5;

/// A set of stacks with its forward model.
pub struct StackModel<'a> {
    set: &'a StackSet,
    light: Light<'a>,
    detector: Detector,
    /// Parameters and effects that are tried.
    pub(crate) own: Effects,
    measured: Vec<Measured>,
    /// Whole pixels by which each frame is displaced from the stated model.
    origins: Vec<[f64; 2]>,
    /// Middle of the positions of the planes (um).
    middle_um: f64,
    kept: Vec<Mutex<Vec<Arc<Base>>>>,
    keep: usize,
}

/// Prediction of a plane for a setting.
struct Base {
    setting: Setting,
    shift: [f64; 2],
    images: Images,
    gain: f32,
    residual: Vec<f32>,
    columns: Mutex<BTreeMap<usize, Arc<Vec<f32>>>>,
}

impl<'a> StackModel<'a> {
    /// A model of a set whose frames have the orientation of the sensor; `focus_um` is where the stated model is registered.
    pub(crate) fn new(set: &'a StackSet, sampling: &'a Sampling, focus_um: f64) -> Self {
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
        };
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
        if self.set.objects[object].transmission.is_none() {
            let p = &mut out.pupil;
            (p.depth, p.shift_um, p.rotation_deg, p.mask_scale, p.unmodulated) = (0.0, [0.0; 2], 0.0, 0.0, 0.0);
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
            pixel_um,
            origin_px: self.origins[m].map(|v| -v),
        };
        let intensity = self.light.intensity(&pupil, place);
        self.detector.spectrum(intensity, pixel_um, setting.blur_um2)
    }

    /// Prediction of a plane, registered to its frame.
    fn predict(&self, m: usize, setting: &Setting) -> Base {
        let spectrum = self.spectrum(m, setting);
        let measured = &self.measured[m];
        let (shift, images) = if self.set.bench.shift {
            let (from, _) = self.detector.correlate(&spectrum, measured, [WANDERS; 2]);
            self.detector.register(&spectrum, measured, from)
        } else {
            ([0.0; 2], self.detector.images(&spectrum, [0.0; 2]))
        };
        let ones = vec![1.0_f32; measured.values.len()];
        let own: &[&[f32]] = if self.set.bench.background { &[&ones] } else { &[] };
        let form = eliminated(&[&images.value, &measured.values], own, &measured.used);
        let gain = (form[(0, 1)] / form[(0, 0)].max(f64::MIN_POSITIVE)).max(0.0);
        let gain = if gain.is_finite() { gain as f32 } else { 0.0 };
        let mut residual: Vec<f32> = { measured.values.iter().zip(&images.value) }
            .map(|(v, i)| v - gain * i)
            .collect();
        if self.set.bench.background {
            let count: f32 = measured.used.iter().sum();
            let level = residual.iter().zip(&measured.used).map(|(r, u)| r * u).sum::<f32>() / count.max(1.0);
            residual.iter_mut().for_each(|r| *r -= level);
        }
        Base {
            setting: *setting,
            shift,
            images,
            gain,
            residual,
            columns: Mutex::default(),
        }
    }

    fn base(&self, m: usize, setting: &Setting) -> Arc<Base> {
        let mut kept = self.kept[m].lock().unwrap_or_else(PoisonError::into_inner);
        let base = match kept.iter().position(|b| b.setting == *setting) {
            Some(at) => kept.remove(at),
            None => Arc::new(self.predict(m, setting)),
        };
        if kept.len() >= self.keep {
            kept.remove(0);
        }
        kept.push(base.clone());
        base
    }

    /// Square of the relative error of a plane.
    fn error(&self, m: usize, base: &Base) -> f64 {
        let used = &self.measured[m].used;
        base.residual
            .iter()
            .zip(used)
            .map(|(r, u)| f64::from(r * u).powi(2))
            .sum()
    }

    /// Change of the prediction with a parameter; none if there is no change.
    fn column(&self, m: usize, base: &Base, slot: usize, theta: &[f64]) -> Option<Arc<Vec<f32>>> {
        let step = self.own.steps[slot];
        let mut moved = theta.to_vec();
        moved[slot] += step;
        let object = self.set.planes[m].object;
        let setting = self.setting(&moved, object);
        if setting == base.setting {
            return None;
        }
        let mut columns = base.columns.lock().unwrap_or_else(PoisonError::into_inner);
        let column = columns.entry(slot).or_insert_with(|| {
            let there = self.detector.image(&self.spectrum(m, &setting), base.shift);
            let factor = base.gain / step as f32;
            let change = there.iter().zip(&base.images.value).map(|(a, b)| (a - b) * factor);
            Arc::new(change.collect())
        });
        Some(column.clone())
    }

    /// A predicted frame and the measured one, both over the norm of the measured one.
    pub(crate) fn pair(&self, m: usize, theta: &[f64]) -> [Array2<f64>; 2] {
        let base = self.base(m, &self.setting(theta, self.set.planes[m].object));
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

    /// Planes by which starts are compared: the planes of objects that an effect changes.
    fn scanned(&self, effect: usize) -> Vec<usize> {
        let planes = &self.set.planes;
        let objects = 0..self.set.objects.len();
        let of = |object: usize| -> Vec<usize> {
            let own: Vec<usize> = (0..planes.len())
                .filter(|&m| planes[m].object == object && planes[m].fitted)
                .collect();
            let n = own.len();
            let mut picked: Vec<usize> = (0..SCANNED.min(n))
                .map(|k| own[(2 * k + 1) * n / (2 * SCANNED.min(n))])
                .collect();
            picked.dedup();
            picked
        };
        match self.own.scopes[effect] {
            RefitScope::One { group, .. } => of(group),
            _ => objects.flat_map(of).collect(),
        }
    }
}

impl RefitModel for StackModel<'_> {
    fn parameters(&self) -> &[RefitParameter] {
        &self.own.parameters
    }

    fn effects(&self) -> &[RefitEffect] {
        &self.own.effects
    }

    fn count(&self) -> usize {
        self.set.planes.len()
    }

    /// Frames have norm one, so that a root mean square is the relative error.
    fn points(&self, _: usize) -> f64 {
        1.0
    }

    fn equations(&self, m: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
        let base = self.base(m, &self.setting(theta, self.set.planes[m].object));
        let none = vec![0.0_f32; base.residual.len()];
        let columns: Vec<_> = active.iter().map(|&slot| self.column(m, &base, slot, theta)).collect();
        let mut all: Vec<&[f32]> = columns
            .iter()
            .map(|c| c.as_ref().map_or(&none[..], |c| &c[..]))
            .collect();
        all.push(&base.residual);
        let ones = vec![1.0_f32; none.len()];
        let mut own: Vec<&[f32]> = vec![&base.images.value];
        if self.set.bench.background {
            own.push(&ones);
        }
        if self.set.bench.shift {
            own.extend(base.images.along.iter().map(|v| &v[..]));
        }
        let mut form = eliminated(&all, &own, &self.measured[m].used);
        let last = active.len();
        form[(last, last)] = self.error(m, &base);
        RefitEquations::alike(form)
    }

    fn figure_names(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("residual over measured norm", ""),
            ("residual over measured norm, each at its peak", ""),
            ("1 - correlation", ""),
        ]
    }

    fn is_mean(&self, figure: usize) -> bool {
        figure == 2
    }

    fn figures(&self, m: usize, theta: &[f64]) -> Vec<f64> {
        let base = self.base(m, &self.setting(theta, self.set.planes[m].object));
        let measured = &self.measured[m];
        let own = || {
            measured
                .values
                .iter()
                .zip(&base.images.value)
                .zip(&measured.used)
                .filter(|(_, u)| **u > 0.0)
        };
        let top = own().map(|((_, i), _)| f64::from(*i)).fold(f64::MIN_POSITIVE, f64::max);
        let scale = measured.peak / top;
        let at_peak: f64 = own()
            .map(|((v, i), _)| (f64::from(*v) - scale * f64::from(*i)).powi(2))
            .sum();
        let count = own().count().max(1) as f64;
        let mean = |part: &dyn Fn(f64, f64) -> f64| {
            own().map(|((v, i), _)| part(f64::from(*v), f64::from(*i))).sum::<f64>() / count
        };
        let (v, i) = (mean(&|v, _| v), mean(&|_, i| i));
        let [vv, ii, vi] = [
            mean(&|v, _| v * v) - v * v,
            mean(&|_, i| i * i) - i * i,
            mean(&|v, i| v * i) - v * i,
        ];
        let correlation = vi / (vv * ii).sqrt().max(f64::MIN_POSITIVE);
        vec![self.error(m, &base).sqrt(), at_peak.sqrt(), 1.0 - correlation]
    }

    fn decides(&self, figure: usize) -> bool {
        figure == 0
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn scope(&self, effect: usize) -> RefitScope {
        self.own.scopes[effect]
    }

    /// Objects without a mask judge an effect of the lens first.
    fn group(&self, way: usize, group: usize) -> (String, usize) {
        match self.set.objects.get(group).filter(|_| way == BY_OBJECT) {
            Some(object) => (object.name.clone(), usize::from(object.transmission.is_some())),
            None => (group.to_string(), group),
        }
    }

    fn start(&self, effect: usize, theta: &[f64]) -> Vec<f64> {
        let slots = &self.own.effects[effect].slots;
        let from: Vec<f64> = slots.iter().map(|&s| self.own.parameters[s].start).collect();
        let Some((step, n)) = self.own.scans[effect] else {
            return from;
        };
        let planes = self.scanned(effect);
        let line = (-n..=n).map(|k| f64::from(k) * step);
        let candidates: Vec<Vec<f64>> = if slots.len() == 1 {
            line.map(|v| vec![v]).collect()
        } else {
            let ys = line.clone();
            line.flat_map(|x| ys.clone().map(move |y| vec![x, y])).collect()
        };
        let errors: Vec<f64> = candidates
            .par_iter()
            .map(|values| {
                let mut theta = theta.to_vec();
                slots.iter().zip(values).for_each(|(&s, v)| theta[s] += v);
                let error = |&m: &usize| {
                    let setting = self.setting(&theta, self.set.planes[m].object);
                    self.error(m, &self.predict(m, &setting))
                };
                planes.iter().map(error).sum()
            })
            .collect();
        let middle = errors[errors.len() / 2];
        let best = (0..errors.len())
            .min_by(|&a, &b| errors[a].total_cmp(&errors[b]))
            .unwrap_or(0);
        if errors[best] < (1.0 - BETTER_START) * middle {
            candidates[best].clone()
        } else {
            from
        }
    }
}
