//! Stacks as the selection of effects sees them: equations, figures of merit, and where fits start.

use std::sync::atomic::Ordering;

use metalith_attribution::{RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitScope};
use rayon::prelude::*;

use super::model::StackModel;
use super::setting::{self, BY_OBJECT};

/// Planes of each object by which a fit finds where to start.
const SCANNED: usize = 3;

/// Share by which another start has to be better.
const BETTER_START: f64 = 0.005;

/// Times that starts of an effect are compared: at first, and once when others were found.
const MOST_SCANS: usize = 2;

/// Least share of the mean square that an effect removes: samples of the light err by a few thousandths of a frame.
const LEAST_SHARE: f64 = 0.02;

impl StackModel<'_> {
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

    /// Objects are the second way of leaving out, after planes.
    fn objects(&self) -> usize {
        1
    }

    fn noise(&self, _theta: &[f64]) -> Option<f64> {
        Some(self.noise)
    }

    fn count(&self) -> usize {
        self.set.planes.len()
    }

    /// Frames have norm one, so that a root mean square is the relative error.
    fn points(&self, _: usize) -> f64 {
        1.0
    }

    fn equations(&self, m: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
        RefitEquations::alike(self.form(m, active, theta))
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
        let base = self.base(m, theta);
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
        vec![base.error().sqrt(), at_peak.sqrt(), 1.0 - correlation]
    }

    fn decides(&self, figure: usize) -> bool {
        figure == 0
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn least_share(&self) -> f64 {
        LEAST_SHARE
    }

    fn scope(&self, effect: usize) -> RefitScope {
        self.own.scopes[effect]
    }

    fn common(&self, effect: usize) -> Option<usize> {
        let RefitScope::One { group, .. } = self.own.scopes[effect] else {
            return None;
        };
        let effects = &self.own.effects;
        let name = effects[effect]
            .name
            .strip_suffix(&setting::end_of(&self.set.objects[group].name))?;
        effects
            .iter()
            .position(|e| e.name == name || e.name == format!("lens_{name}"))
    }

    /// Objects without a mask judge an effect of the lens first.
    fn group_order(&self, way: usize, group: usize) -> usize {
        match self.set.objects.get(group).filter(|_| way == BY_OBJECT) {
            Some(object) => usize::from(object.transmission.is_some()),
            None => group,
        }
    }

    fn group_name(&self, way: usize, group: usize) -> String {
        match self.set.objects.get(group).filter(|_| way == BY_OBJECT) {
            Some(object) => object.name.clone(),
            // As `not_fitted` counts them.
            None => group.to_string(),
        }
    }

    fn start(&self, effect: usize, theta: &[f64]) -> Vec<f64> {
        let slots = &self.own.effects[effect].slots;
        let from: Vec<f64> = slots.iter().map(|&s| self.own.parameters[s].start).collect();
        let Some((step, n)) = self.own.scans[effect] else {
            return from;
        };
        if self.scans[effect].fetch_add(1, Ordering::Relaxed) >= MOST_SCANS {
            return from;
        }
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
                planes.iter().map(|&m| self.rough_error(m, &theta)).sum()
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
