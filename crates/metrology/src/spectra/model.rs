//! Forward model of spectra: a film stack over the cone of an objective, and what the instrument makes of it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use metalith_attribution::{
    ConditionalEffect, LeaveOut, RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitPlan,
};
use metalith_rcwa::Material;
use nalgebra::DMatrix;
use num_complex::Complex64;

use super::film_reflectance::{Film, film_powers};
use super::pads::{LARGEST_APERTURE, PadBank, Pillar};
use super::set::{SCALED_BY, Spectrum, SpectrumSet, StatedPads};
use crate::declared::{DeclaredEffect, DeclaredSlots, Stage};

/// Gauss-Legendre nodes on (-1, 1) with their weights: the squared sine over the cone. Six nodes are exact to 1e-4 at 0.95.
const NODES: [[f64; 2]; 6] = [
    [-0.932_469_514_203_152, 0.171_324_492_379_170],
    [-0.661_209_386_466_265, 0.360_761_573_048_139],
    [-0.238_619_186_083_197, 0.467_913_934_572_691],
    [0.238_619_186_083_197, 0.467_913_934_572_691],
    [0.661_209_386_466_265, 0.360_761_573_048_139],
    [0.932_469_514_203_152, 0.171_324_492_379_170],
];

/// Widest standard deviation of the resolution, in steps of the wavelength.
const WIDEST_LINE: f64 = 2.0;

const APERTURE: usize = 0;
const ROUGHNESS: usize = 1;
const REFERENCE: usize = 2;
const STRAY: usize = 3;
const WAVELENGTH: usize = 4;
const RESOLUTION: usize = 5;
/// Offset of the height of the object, or of the widths of pillars.
const SIZE: usize = 6;
const APODISATION: usize = 7;
/// First of the parameters of each layer that is not the object: thickness, scale and offset of the index, offset of the extinction.
const LAYERS: usize = 8;
/// Parameters of a layer. Pillars have a taper in place of an extinction, and a residual film after all layers.
const OF_A_LAYER: usize = 4;

/// Fewest wavelengths of a pad that are used.
const FEWEST_USED: f64 = 8.0;

/// Largest bias of the widths of pillars (nm).
const MOST_BIAS_NM: f64 = 60.0;

/// Largest changes of the index of pillars: relative, absolute.
const MOST_INDEX: [f64; 2] = [0.08, 0.2];

/// Parameters of what acts after the stack of smooth films.
const AFTER_THE_STACK: [usize; 4] = [ROUGHNESS, REFERENCE, STRAY, RESOLUTION];

/// First spectrum of an object, and bits of the values that act on its stack.
type StackKey = (usize, Vec<u64>);

/// Most spectra of smooth films that are held.
const MOST_HELD: usize = 1024;

/// A set of spectra with its forward model.
pub struct SpectrumModel<'a> {
    set: &'a SpectrumSet,
    parameters: Vec<RefitParameter>,
    /// Effects that are tried.
    pub(crate) effects: Vec<RefitEffect>,
    steps: Vec<f64>,
    /// Mean of the repeats that each spectrum is one of.
    means: Vec<Vec<f64>>,
    /// Wavelengths of each spectrum that are fitted and judged.
    used: Vec<Vec<bool>>,
    /// Solutions of pads of pillars.
    bank: Option<(&'a StatedPads, PadBank<'a>)>,
    declared: DeclaredSlots,
    /// First spectrum of the object and medium of each spectrum.
    first: Vec<usize>,
    /// Number of the height of each spectrum.
    groups: Vec<usize>,
    /// Reflectances of smooth films by first spectrum and values: repeats, and derivatives at one place, share them.
    smooth: Mutex<HashMap<StackKey, Arc<Vec<f64>>>>,
}

/// Condition of the effects of a film.
const OF_A_FILM: &str = "a `[[layer]]` of this name with `material` and `thickness_nm`, and no pillars";

/// Condition of the effects of pillars.
const OF_PILLARS: &str = "a `[[layer]]` with `object = \"pillars\"`";

/// Condition of the effects of films alone.
const WITHOUT_PILLARS: &str = "a `[[layer]]` with `object = \"yes\"`";

const fn conditional(name: &'static str, needs: &'static str) -> ConditionalEffect {
    ConditionalEffect { name, needs }
}

/// Effects that are tried on some sets only.
pub(crate) const CONDITIONAL: [ConditionalEffect; 12] = [
    conditional("cd_bias", OF_PILLARS),
    conditional("film_height", OF_PILLARS),
    conditional("sidewall_taper", OF_PILLARS),
    conditional("residual_film", OF_PILLARS),
    conditional("height_offset", WITHOUT_PILLARS),
    conditional("roughness", "films whose reflectance is measured"),
    conditional("pupil_apodisation", WITHOUT_PILLARS),
    conditional("numerical_aperture", "films, or a stated `numerical_aperture` of pads"),
    conditional("*_thickness", OF_A_FILM),
    conditional("*_index_scale", OF_A_FILM),
    conditional("*_index_offset", OF_A_FILM),
    conditional("*_extinction_offset", OF_A_FILM),
];

impl<'a> SpectrumModel<'a> {
    /// A model of a set that was read.
    pub fn new(set: &'a SpectrumSet) -> Self {
        let mut parameters = Vec::new();
        let mut steps = Vec::new();
        let mut add = |name: String, unit, (neutral, start): (f64, f64), range, step, shown: fn(f64) -> f64| {
            parameters.push(RefitParameter {
                name,
                unit,
                neutral,
                start,
                range,
                shown,
            });
            steps.push(step);
        };
        let stated = set.numerical_aperture;
        let start = if stated > 0.0 { stated } else { 0.5 };
        add(
            "numerical_aperture".into(),
            "",
            (stated, start),
            (0.0, if set.pads.is_some() { LARGEST_APERTURE } else { 0.99 }),
            1e-4,
            |v| v,
        );
        add("roughness".into(), "nm", (0.0, 16.0), (0.0, 1e4), 1e-2, f64::sqrt);
        add("reference_gain".into(), "", (0.0, 0.0), (-0.9, 9.0), 1e-4, |v| v);
        add("stray_light".into(), "", (0.0, 0.0), (-1.0, 1.0), 1e-4, |v| v);
        add(
            "wavelength_scale".into(),
            "",
            (0.0, 0.0),
            (-SCALED_BY, SCALED_BY),
            1e-5,
            |v| v,
        );
        // A spectrometer whose lines are wider would be read in wider steps.
        let widest = match set.wavelengths_nm.as_slice() {
            [first, second, ..] => (WIDEST_LINE * (second - first)).powi(2),
            _ => 1.0,
        };
        add(
            "resolution".into(),
            "nm",
            (0.0, 0.25 * widest),
            (0.0, widest),
            1e-3 * widest,
            f64::sqrt,
        );
        let (size, sizes_range) = match &set.pads {
            None => ("height_offset", (-1e3, 1e3)),
            Some(pads) => ("cd_bias", bias_range(set, pads)),
        };
        add(size.into(), "nm", (0.0, 0.0), sizes_range, 1e-2, |v| v);
        add("pupil_apodisation".into(), "", (0.0, 0.0), (-3.0, 6.0), 1e-3, |v| v);
        let mut effects: Vec<RefitEffect> = Vec::new();
        let names = [
            "numerical_aperture",
            "roughness",
            "reference_gain",
            "stray_light",
            "wavelength_scale",
            "resolution",
            size,
            "pupil_apodisation",
        ];
        let effect = |name: &str, slot: usize| RefitEffect {
            name: name.into(),
            slots: vec![slot],
            after: Vec::new(),
            across: None,
        };
        effects.extend(names.iter().enumerate().map(|(slot, name)| effect(name, slot)));
        if stated == 0.0 {
            // The first of the effects is the numerical aperture.
            effects[APODISATION].after = vec![0];
        }
        if set.is_transmission {
            // The law of scattering is of reflected light.
            effects.retain(|e| e.name != "roughness");
        }
        if set.pads.is_some() {
            let kept = |e: &RefitEffect| match e.name.as_str() {
                "roughness" | "pupil_apodisation" => false,
                "numerical_aperture" => stated > 0.0,
                _ => true,
            };
            effects.retain(kept);
        }
        for (k, layer) in set.layers.iter().enumerate() {
            let name = &layer.name;
            let slot = LAYERS + OF_A_LAYER * k;
            if let Some(pads) = set.pads.as_ref().filter(|pads| pads.layer == k) {
                for (place, (name, unit, neutral, range)) in of_pillars(name, pads).into_iter().enumerate() {
                    // The last one stands after all layers.
                    if place < OF_A_LAYER {
                        effects.push(effect(&name, slot + place));
                        add(name, unit, (neutral, neutral), range, 1e-3, |v| v);
                    }
                }
                continue;
            }
            let own = [
                (format!("{name}_thickness"), "nm", 1e4, 1e-2),
                (format!("{name}_index_scale"), "", 0.5, 1e-5),
                (format!("{name}_index_offset"), "", 1.0, 1e-5),
                (format!("{name}_extinction_offset"), "", 1.0, 1e-5),
            ];
            for (place, (name, unit, most, step)) in own.into_iter().enumerate() {
                let film = layer.thickness_nm.filter(|_| set.pads.is_none());
                if let Some(thickness) = film {
                    effects.push(effect(&name, slot + place));
                    let low = if place == 0 { -thickness } else { -most };
                    add(name, unit, (0.0, 0.0), (low, most), step, |v| v);
                } else {
                    add(name, unit, (0.0, 0.0), (0.0, 0.0), step, |v| v);
                }
            }
        }
        if let Some(pads) = &set.pads {
            let [.., (name, unit, neutral, range)] = of_pillars("", pads);
            effects.push(effect(&name, LAYERS + OF_A_LAYER * set.layers.len()));
            add(name, unit, (neutral, neutral), range, 1e-2, |v| v);
        }
        let mut means = vec![Vec::new(); set.spectra.len()];
        let mut first = vec![0; set.spectra.len()];
        for own in set.repeats() {
            let mean: Vec<f64> = (0..set.wavelengths_nm.len())
                .map(|k| own.iter().map(|&s| set.spectra[s].reflectance[k]).sum::<f64>() / own.len() as f64)
                .collect();
            own.iter().for_each(|&s| {
                means[s].clone_from(&mean);
                first[s] = own[0];
            });
        }
        let bank = set.pads.as_ref().map(|pads| (pads, PadBank::new(set, pads, SCALED_BY)));
        let used = wavelengths_used(set, bank.as_ref().map(|(_, bank)| bank), &first);
        let sizes = sizes(set);
        let group = |s: &Spectrum| sizes.iter().position(|h| *h == s.size_nm).unwrap_or(0);
        let groups = set.spectra.iter().map(group).collect();
        Self {
            set,
            parameters,
            effects,
            steps,
            means,
            used,
            bank,
            declared: DeclaredSlots::default(),
            first,
            groups,
            smooth: Mutex::default(),
        }
    }

    /// Add effects of a file.
    pub(crate) fn declare(&mut self, effects: &[DeclaredEffect]) -> metalith_core::Result<()> {
        let groups = sizes(self.set).len();
        self.declared
            .add(effects, groups, (&mut self.parameters, &mut self.effects))?;
        let new = self.steps.len()..self.parameters.len();
        self.steps
            .extend(new.map(|slot| self.declared.step(slot).unwrap_or(1e-3)));
        Ok(())
    }

    /// True if the object has more than one medium.
    fn has_media(&self) -> bool {
        let spectra = &self.set.spectra;
        spectra.iter().any(|s| s.medium != spectra[0].medium)
    }

    /// First and last wavelength (nm).
    pub(crate) fn range_nm(&self) -> [f64; 2] {
        [0, self.set.wavelengths_nm.len() - 1].map(|k| self.set.wavelengths_nm[k])
    }

    /// Roles of the spectra: heights, media and single spectra are left out in turn.
    pub fn plan(&self) -> RefitPlan {
        let spectra = &self.set.spectra;
        let way = |name: &str, groups: Vec<usize>| LeaveOut {
            name: name.into(),
            groups,
        };
        let size = if self.bank.is_some() { "width" } else { "height" };
        let mut ways = vec![way(size, self.groups.clone())];
        if self.has_media() {
            ways.push(way("medium", spectra.iter().map(|s| s.medium).collect()));
        }
        ways.push(way("spectrum", (0..spectra.len()).collect()));
        RefitPlan {
            fitted: spectra.iter().map(|s| s.fitted).collect(),
            ways,
        }
    }

    /// Mean of the repeats of a spectrum.
    pub fn mean(&self, spectrum: usize) -> &[f64] {
        &self.means[spectrum]
    }

    /// Reflectance that the instrument shows of a spectrum, at each wavelength of the set.
    pub fn predicted(&self, spectrum: usize, theta: &[f64]) -> Vec<f64> {
        self.shown(spectrum, &self.smooth_stack(spectrum, theta), theta)
    }

    /// Reflectance of the stack with smooth films over the cone of the objective, at each wavelength of the set.
    fn smooth_stack(&self, spectrum: usize, theta: &[f64]) -> Arc<Vec<f64>> {
        let bits = theta.iter().enumerate();
        let bits = bits.map(|(slot, v)| {
            if AFTER_THE_STACK.contains(&slot) {
                0
            } else {
                v.to_bits()
            }
        });
        let key = (self.first[spectrum], bits.collect());
        let held = || self.smooth.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = held().get(&key) {
            return Arc::clone(known);
        }
        let found = Arc::new(self.stack(spectrum, theta));
        let mut held = held();
        if held.len() >= MOST_HELD {
            held.clear();
        }
        held.insert(key, Arc::clone(&found));
        found
    }

    /// Pillars of a pad.
    fn pillar(&self, pads: &StatedPads, spectrum: usize, theta: &[f64]) -> Pillar {
        let own = LAYERS + OF_A_LAYER * pads.layer;
        Pillar {
            width_nm: self.set.spectra[spectrum].size_nm + theta[SIZE],
            height_nm: pads.height_nm + theta[own],
            taper_deg: theta[own + OF_A_LAYER - 1],
            residual_nm: theta[LAYERS + OF_A_LAYER * self.set.layers.len()],
            // Of a pupil that is uniformly bright.
            sine2: 0.5 * theta[APERTURE].powi(2),
        }
    }

    /// True if the pads of the set, if it has any, can be solved.
    ///
    /// # Errors
    /// If they cannot.
    pub(crate) fn check(&self) -> metalith_core::Result<()> {
        let Some((_, bank)) = &self.bank else { return Ok(()) };
        let path = self.set.path.display();
        bank.can_be_solved().map_err(|error| {
            metalith_core::Error::refused(
                "calibrate/pads-unsolvable",
                format!("{path}: the pillars cannot be solved: {error}"),
                "check `pitch_nm`, `height_nm` and the materials of the layer of pillars",
            )
        })?;
        let few = (0..self.used.len()).find(|&s| self.points(s) < FEWEST_USED);
        few.map_or(Ok(()), |s| {
            let width_nm = self.set.spectra[s].size_nm;
            Err(metalith_core::Error::refused(
                "calibrate/pads-resonant",
                format!(
                    "{path}: pads of {width_nm} nm have fewer than {FEWEST_USED} wavelengths far from guided-mode resonances"
                ),
                "extend [range] to longer wavelengths, or leave these pads out",
            ))
        })
    }

    /// Words on wavelengths that are not used.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let all: usize = self.used.iter().map(Vec::len).sum();
        let used = self.used.iter().flatten().filter(|used| **used).count();
        let words = format!(
            "{} of {all} points are not used: near guided-mode resonances the power of pads changes too much from one width to the next to be interpolated",
            all - used
        );
        (used < all).then_some(words).into_iter().collect()
    }

    /// Wavelengths of a spectrum that are used.
    pub(crate) fn used(&self, spectrum: usize) -> &[bool] {
        &self.used[spectrum]
    }

    /// Values at the wavelengths that are used.
    fn of_used(&self, spectrum: usize, values: &[f64]) -> Vec<f64> {
        let all = values.iter().zip(&self.used[spectrum]);
        all.filter(|(_, used)| **used).map(|(v, _)| *v).collect()
    }

    /// Measured values less the prediction of a spectrum, where they are used.
    fn residual(&self, spectrum: usize, measured: &[f64], theta: &[f64]) -> Vec<f64> {
        let model = self.predicted(spectrum, theta);
        let off: Vec<f64> = measured.iter().zip(&model).map(|(m, p)| m - p).collect();
        self.of_used(spectrum, &off)
    }

    fn stack(&self, spectrum: usize, theta: &[f64]) -> Vec<f64> {
        let own = &self.set.spectra[spectrum];
        let medium = &self.set.media[own.medium].1;
        let height_nm = (own.size_nm + theta[SIZE]).max(0.0);
        let scale = 1.0 + theta[WAVELENGTH];
        let aperture2 = theta[APERTURE].powi(2);
        let cone = cone(theta[APODISATION]);
        let [from, to] = self.range_nm();
        let ends = [from * (1.0 - SCALED_BY), to * (1.0 + SCALED_BY)];
        let (group, is_moved) = (self.groups[spectrum], self.declared.acts(Stage::Wavelength, theta));
        let moved = |nm: f64| {
            if is_moved {
                self.declared.value(Stage::Wavelength, group, &[nm, own.size_nm], theta)
            } else {
                0.0
            }
        };
        let inside = |nm: &f64| (nm * scale + moved(*nm)).clamp(ends[0], ends[1]);
        let wavelengths_nm: Vec<f64> = self.set.wavelengths_nm.iter().map(inside).collect();
        if let Some((pads, bank)) = &self.bank {
            let index = [1, 2].map(|k| theta[LAYERS + OF_A_LAYER * pads.layer + k]);
            return bank.powers(own.medium, &self.pillar(pads, spectrum, theta), index, &wavelengths_nm);
        }
        let values = wavelengths_nm.into_iter().map(|nm| {
            let index = |m: &Material| m.index(nm * 1e-3).unwrap_or(Complex64::from(1.0));
            let films: Vec<Film> = self
                .set
                .layers
                .iter()
                .enumerate()
                .map(|(k, layer)| match (&layer.material, layer.thickness_nm) {
                    (Some(material), Some(thickness)) => {
                        let [thicker, scaled, more, lossy] = [0, 1, 2, 3].map(|p| theta[LAYERS + OF_A_LAYER * k + p]);
                        let stated = index(material);
                        let n = Complex64::new(stated.re * (1.0 + scaled) + more, (stated.im + lossy).max(0.0));
                        (n, thickness + thicker)
                    }
                    _ => (index(medium), height_nm),
                })
                .collect();
            let substrate = self.set.substrate.as_ref().map_or(Complex64::from(1.5), index);
            let power = usize::from(self.set.is_transmission);
            let at = |sine2: f64| film_powers(self.set.ambient_index, &films, substrate, nm, sine2)[power];
            if aperture2 > 0.0 {
                cone.iter().map(|(part, weight)| weight * at(part * aperture2)).sum()
            } else {
                at(0.0)
            }
        });
        values.collect()
    }

    /// What rough films and the instrument make of the reflectance of smooth ones.
    fn shown(&self, spectrum: usize, smooth: &[f64], theta: &[f64]) -> Vec<f64> {
        let scale = 1.0 + theta[WAVELENGTH];
        let scattered = |nm: f64| (-(4.0 * std::f64::consts::PI / (nm * scale)).powi(2) * theta[ROUGHNESS]).exp();
        let mut values: Vec<f64> = smooth
            .iter()
            .zip(&self.set.wavelengths_nm)
            .map(|(v, nm)| v * scattered(*nm))
            .collect();
        if theta[RESOLUTION] > 0.0 {
            values = self.smoothed(&values, theta[RESOLUTION]);
        }
        let gain = 1.0 + theta[REFERENCE];
        values.iter_mut().for_each(|v| *v = *v * gain + theta[STRAY]);
        let (group, height_nm) = (self.groups[spectrum], self.set.spectra[spectrum].size_nm);
        if [Stage::Factor, Stage::Added]
            .iter()
            .any(|stage| self.declared.acts(*stage, theta))
        {
            for (v, nm) in values.iter_mut().zip(&self.set.wavelengths_nm) {
                let of = |stage| self.declared.value(stage, group, &[*nm, height_nm], theta);
                *v = *v * (1.0 + of(Stage::Factor)) + of(Stage::Added);
            }
        }
        values
    }

    /// Values under a Gaussian of a variance (nm^2), to four standard deviations.
    fn smoothed(&self, values: &[f64], variance: f64) -> Vec<f64> {
        let step = self.set.wavelengths_nm[1] - self.set.wavelengths_nm[0];
        let reach = ((4.0 * variance.sqrt() / step).ceil() as usize).min(values.len());
        (0..values.len())
            .map(|k| {
                let near = k.saturating_sub(reach)..(k + reach + 1).min(values.len());
                let weighted = near.map(|j| {
                    let off = (j as f64 - k as f64) * step;
                    let weight = (-0.5 * off * off / variance).exp();
                    (weight, weight * values[j])
                });
                let (all, sum) = weighted.fold((0.0, 0.0), |(a, s), (w, v)| (a + w, s + v));
                sum / all
            })
            .collect()
    }
}

/// Heights of the object, or widths of pillars, rising.
fn sizes(set: &SpectrumSet) -> Vec<f64> {
    let mut sizes: Vec<f64> = set.spectra.iter().map(|s| s.size_nm).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    sizes
}

/// Wavelengths of each spectrum that are used: of films, all; of pads, those far from resonances.
fn wavelengths_used(set: &SpectrumSet, bank: Option<&PadBank<'_>>, first: &[usize]) -> Vec<Vec<bool>> {
    let mut out: Vec<Vec<bool>> = Vec::new();
    for (s, own) in set.spectra.iter().enumerate() {
        let used = match bank {
            None => vec![true; set.wavelengths_nm.len()],
            Some(_) if first[s] < s => out[first[s]].clone(),
            Some(bank) => bank.smooth(own.medium, own.size_nm),
        };
        out.push(used);
    }
    out
}

/// Widest range of a bias (nm) in which all pillars are wider than nothing and narrower than their distance.
fn bias_range(set: &SpectrumSet, pads: &StatedPads) -> (f64, f64) {
    let sizes = sizes(set);
    let (narrowest, widest) = (sizes[0], sizes[sizes.len() - 1]);
    (
        (-narrowest).clamp(-MOST_BIAS_NM, 0.0),
        (pads.nearest_nm() - widest).clamp(0.0, MOST_BIAS_NM),
    )
}

/// Parameters of pillars: name, unit, value as stated and range.
fn of_pillars(layer: &str, pads: &StatedPads) -> [(String, &'static str, f64, (f64, f64)); OF_A_LAYER + 1] {
    let [height, taper, residual] = PadBank::ranges(pads);
    let index = MOST_INDEX.map(|most| (-most, most));
    [
        ("film_height".into(), "nm", 0.0, height),
        (format!("{layer}_index_scale"), "", 0.0, index[0]),
        (format!("{layer}_index_offset"), "", 0.0, index[1]),
        ("sidewall_taper".into(), "deg", pads.taper_deg, taper),
        ("residual_film".into(), "nm", pads.residual_nm, residual),
    ]
}

/// Squared sines over the cone, as shares of that of its border, with their weights: light falls by exp(-apodisation) from the axis
/// of the pupil to its border.
fn cone(apodisation: f64) -> [(f64, f64); 6] {
    let nodes = NODES.map(|[x, w]| (0.5 * (x + 1.0), w * (-0.5 * apodisation * (x + 1.0)).exp()));
    let sum: f64 = nodes.iter().map(|(_, w)| w).sum();
    nodes.map(|(part, w)| (part, w / sum))
}

impl RefitModel for SpectrumModel<'_> {
    fn parameters(&self) -> &[RefitParameter] {
        &self.parameters
    }

    fn effects(&self) -> &[RefitEffect] {
        &self.effects
    }

    fn count(&self) -> usize {
        self.set.spectra.len()
    }

    fn points(&self, spectrum: usize) -> f64 {
        self.used[spectrum].iter().filter(|used| **used).count() as f64
    }

    fn equations(&self, spectrum: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
        let smooth = self.smooth_stack(spectrum, theta);
        let base = self.shown(spectrum, &smooth, theta);
        let measured = &self.set.spectra[spectrum].reflectance;
        let mut columns: Vec<Vec<f64>> = Vec::with_capacity(active.len() + 1);
        for &slot in active {
            let mut moved = theta.to_vec();
            let (_, high) = self.parameters[slot].range;
            // Towards the middle at the end of a range.
            let step = if theta[slot] + self.steps[slot] > high {
                -self.steps[slot]
            } else {
                self.steps[slot]
            };
            moved[slot] += step;
            let changed = if AFTER_THE_STACK.contains(&slot) {
                self.shown(spectrum, &smooth, &moved)
            } else {
                self.predicted(spectrum, &moved)
            };
            columns.push(changed.iter().zip(&base).map(|(c, b)| (c - b) / step).collect());
        }
        columns.push(measured.iter().zip(&base).map(|(m, b)| m - b).collect());
        let columns: Vec<Vec<f64>> = columns.iter().map(|c| self.of_used(spectrum, c)).collect();
        let product = |i: usize, j: usize| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
        RefitEquations::alike(DMatrix::from_fn(columns.len(), columns.len(), product))
    }

    fn figure_names(&self) -> Vec<(&'static str, &'static str)> {
        if self.set.is_transmission {
            vec![("transmission, mean of repeats", "rms"), ("transmission", "rms")]
        } else {
            vec![("reflectance, mean of repeats", "rms"), ("reflectance", "rms")]
        }
    }

    fn figures(&self, spectrum: usize, theta: &[f64]) -> Vec<f64> {
        let rms = |to: &[f64]| crate::noise::root_mean_square(self.residual(spectrum, to, theta).into_iter());
        vec![rms(self.mean(spectrum)), rms(&self.set.spectra[spectrum].reflectance)]
    }

    /// A residual goes on over neighbouring wavelengths, and repeats of an object share it.
    fn correlated_points(&self, spectrum: usize, theta: &[f64]) -> f64 {
        let residual = self.residual(spectrum, self.mean(spectrum), theta);
        let own = self.first[spectrum];
        let repeats = (0..self.count()).filter(|&s| self.first[s] == own && self.set.spectra[s].fitted);
        crate::noise::correlated_points(&residual) * repeats.count().max(1) as f64
    }

    fn model_error(&self, theta: &[f64]) -> f64 {
        let Some((pads, bank)) = &self.bank else { return 0.0 };
        let repeats = self.set.repeats();
        let object = |own: &Vec<usize>| {
            let first = own[0];
            let medium = self.set.spectra[first].medium;
            (medium, self.pillar(pads, first, theta), self.used(first))
        };
        let objects: Vec<_> = repeats.iter().map(object).collect();
        bank.error(&objects, [1, 2].map(|k| theta[LAYERS + OF_A_LAYER * pads.layer + k]))
    }

    /// By repeats, which show the drift of the instrument too; else by neighbouring wavelengths.
    fn noise(&self, theta: &[f64]) -> Option<f64> {
        self.set.repeat_rms().or_else(|| {
            let fitted = (0..self.count()).filter(|&s| self.set.spectra[s].fitted);
            let of = |s: usize| crate::noise::of_line(&self.residual(s, &self.set.spectra[s].reflectance, theta));
            Some(crate::noise::root_mean_square(fitted.map(of))).filter(|noise| *noise > 0.0)
        })
    }

    fn group_name(&self, way: usize, group: usize) -> String {
        match way {
            0 => sizes(self.set)[group].to_string(),
            1 if self.has_media() => self.set.media[group].0.clone(),
            _ => self.set.spectra[group].name.clone(),
        }
    }

    /// A film that is thicker hides the cone of the objective, and the cone hides the film.
    fn tries_pairs(&self) -> bool {
        true
    }

    fn decides(&self, figure: usize) -> bool {
        figure == 0
    }
}
