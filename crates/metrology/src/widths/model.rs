//! Forward model of widths: what dose, surroundings, place and etch add to a drawn width.

use std::collections::BTreeMap;

use metalith_attribution::{LeaveOut, RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitPlan};
use nalgebra::DMatrix;

use super::set::{WidthSet, WidthSite};
use super::terms::{GROUPS, Terms, effects};

/// Fewest values of a kind that are left out in turn: the others then predict it.
const FEWEST_GROUPS: usize = 4;

/// A set of widths with its forward model.
pub struct WidthModel<'a> {
    pub(super) set: &'a WidthSet,
    pub(super) terms: Terms,
    parameters: Vec<RefitParameter>,
    /// Effects that are tried.
    pub(crate) effects: Vec<RefitEffect>,
}

impl<'a> WidthModel<'a> {
    /// A model of a set that was read.
    pub fn new(set: &'a WidthSet) -> Self {
        let terms = Terms::of(set);
        let (parameters, effects) = effects(set, &terms);
        Self {
            set,
            terms,
            parameters,
            effects,
        }
    }

    /// Roles of the sites: groups, places, doses and drawn widths are left out in turn, and single sites.
    pub fn plan(&self) -> RefitPlan {
        let sites = &self.set.sites;
        let numbered = |name: &str, of: &dyn Fn(&WidthSite) -> u64| {
            let mut known = BTreeMap::new();
            let groups: Vec<usize> = sites
                .iter()
                .map(|s| {
                    let next = known.len();
                    *known.entry(of(s)).or_insert(next)
                })
                .collect();
            (known.len() >= FEWEST_GROUPS).then(|| LeaveOut {
                name: name.into(),
                groups,
            })
        };
        let mut ways = Vec::new();
        if let Some((name, _)) = &self.set.groups {
            ways.push(LeaveOut {
                name: name.clone(),
                groups: sites.iter().map(|s| s.group).collect(),
            });
        }
        if self.set.places > 0 && self.set.groups.as_ref().is_none_or(|(_, g)| g.len() != self.set.places) {
            ways.extend(numbered("place", &|s| s.place as u64));
        }
        ways.extend(numbered("dose", &|s| s.dose_percent.to_bits()));
        ways.extend(numbered("drawn width", &|s| s.drawn_nm.to_bits()));
        ways.push(LeaveOut {
            name: "site".into(),
            groups: (0..sites.len()).collect(),
        });
        RefitPlan {
            fitted: sites.iter().map(|s| s.fitted).collect(),
            ways,
        }
    }

    /// Predicted width of a site (nm).
    pub fn predicted_nm(&self, site: usize, theta: &[f64]) -> f64 {
        let own = &self.set.sites[site];
        own.drawn_nm + Terms::added_nm(own, &self.terms.factors(own, theta, &[]), theta)
    }
}

impl RefitModel for WidthModel<'_> {
    fn parameters(&self) -> &[RefitParameter] {
        &self.parameters
    }

    fn effects(&self) -> &[RefitEffect] {
        &self.effects
    }

    fn noise(&self, _theta: &[f64]) -> Option<f64> {
        self.set.repeat_rms()
    }

    fn count(&self) -> usize {
        self.set.sites.len()
    }

    fn points(&self, site: usize) -> f64 {
        self.set.sites[site].measured_nm.len() as f64
    }

    fn equations(&self, site: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
        let own = &self.set.sites[site];
        let factors = self.terms.factors(own, theta, active);
        let factor = |slot: usize| match slot.checked_sub(GROUPS) {
            None => factors[slot],
            Some(group) => f64::from(u8::from(group == own.group)),
        };
        let predicted = own.drawn_nm + Terms::added_nm(own, &factors, theta);
        let count = own.measured_nm.len() as f64;
        let residual: f64 = own.measured_nm.iter().map(|v| v - predicted).sum();
        let squares: f64 = own.measured_nm.iter().map(|v| (v - predicted).powi(2)).sum();
        let n = active.len();
        RefitEquations::alike(DMatrix::from_fn(n + 1, n + 1, |i, j| {
            match (active.get(i), active.get(j)) {
                (Some(&a), Some(&b)) => count * factor(a) * factor(b),
                (Some(&a), None) | (None, Some(&a)) => factor(a) * residual,
                (None, None) => squares,
            }
        }))
    }

    fn figure_names(&self) -> Vec<(&'static str, &'static str)> {
        vec![("width", "nm rms")]
    }

    fn figures(&self, site: usize, theta: &[f64]) -> Vec<f64> {
        let predicted = self.predicted_nm(site, theta);
        let own = &self.set.sites[site].measured_nm;
        let squares: f64 = own.iter().map(|v| (v - predicted).powi(2)).sum();
        vec![(squares / own.len() as f64).sqrt()]
    }

    fn decides(&self, _: usize) -> bool {
        true
    }

    /// A bias hides a proximity of the opposite sign: over all places they may cancel.
    fn tries_pairs(&self) -> bool {
        true
    }
}
