//! Powers of pads of equal pillars: solutions by RCWA at nodes of the parameters, found when they are first needed, and interpolated.
//!
//! Widths and heights have a full grid, solved with many orders. Residual film, taper, index and cone are lines through the stated
//! pillar, and the product of each two of the first three; these changes are solved with fewer orders.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use metalith_rcwa::{Incidence, Layer, LayerStack, Orders, Outline, Side, solve_each};
use num_complex::Complex64;
use rayon::prelude::*;

use super::set::{SpectrumSet, StatedPads};

/// Orders along an axis of the pillars as stated.
const ORDERS: usize = 11;

/// Orders along an axis of changes.
const FEW_ORDERS: usize = 7;

/// Orders along an axis that the bank is compared with.
const MANY_ORDERS: usize = 15;

/// Steps of a leaning wall that the bank is compared with.
const MANY_STEPS: usize = 12;

/// Heights that are solved, at Chebyshev's nodes.
const HEIGHTS: usize = 8;

/// Farthest height from the stated one (nm), or half of it: eight nodes then hold a quarter wave of index 2.4 at 400 nm.
const HEIGHT_REACH_NM: f64 = 50.0;

/// Distance of two widths that are solved (nm), but for rounding to the pitch.
const WIDTH_STEP_NM: f64 = 8.0;

/// Widths that are interpolated over.
const WIDTHS: usize = 4;

/// Steps of a leaning wall at a node: its ends have their own widths, since they reflect most, and slices half as thick.
const STEPS: usize = 4;

/// Distance of two thicknesses of the residual film (nm), and of two indices.
const RESIDUAL_STEP_NM: f64 = 20.0;
const INDEX_STEP: f64 = 0.1;

/// Nodes of the taper, in steps of the width at each step of the wall, and of the index.
const TAPERS: [i8; 4] = [-1, 0, 1, 2];
const INDICES: [i8; 5] = [-2, -1, 0, 1, 2];

/// Widths on either side of a drawn one between which a power must be smooth.
const SMOOTH_OVER: usize = 4;

/// Largest difference of a power from its interpolation by two neighbours on either side. Between these the bank errs by a seventh of
/// it.
const SMOOTH: f64 = 0.006;

/// Sine of the oblique wave; powers change with the square of the sine, alike at each azimuth.
const OBLIQUE_SINE: f64 = 0.15;

/// Largest numerical aperture for which the square of the sine suffices.
pub(super) const LARGEST_APERTURE: f64 = 0.2;

/// A solution at a node: steps from the stated pillar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Solution {
    /// As stated, with many orders.
    Stated,
    /// Changed by steps of the index, the taper and the residual film.
    Changed { index: i8, taper: i8, residual: i8 },
    /// As stated, mean of both polarisations of an oblique wave.
    Oblique,
}

const FEW: Solution = changed(0, 0, 0);

const fn changed(index: i8, taper: i8, residual: i8) -> Solution {
    Solution::Changed { index, taper, residual }
}

/// Pillars of a pad, and the cone that they are seen in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pillar {
    /// Width at half height (nm).
    pub(super) width_nm: f64,
    pub(super) height_nm: f64,
    /// Angle of the walls from upright (degrees), positive if the foot is wider.
    pub(super) taper_deg: f64,
    pub(super) residual_nm: f64,
    /// Mean square of the sine over the cone.
    pub(super) sine2: f64,
}

/// Change of the index of the pillars, relative and absolute.
pub(super) type IndexChange = [f64; 2];

/// Powers at the heights of a node, by medium, number of the width and solution.
type Nodes = HashMap<(usize, usize, Solution), [f64; HEIGHTS]>;

/// Solutions of the pads of a set.
pub(super) struct PadBank<'a> {
    set: &'a SpectrumSet,
    pads: &'a StatedPads,
    /// Nodes of each wavelength, with some beyond both ends.
    nodes: Vec<Mutex<Nodes>>,
    /// Wavelengths before the first of the set.
    beyond: usize,
    heights_nm: [f64; HEIGHTS],
    step_nm: f64,
    /// Smallest step of the residual film.
    least_residual: i8,
}

impl<'a> PadBank<'a> {
    /// An empty bank; `share` of the wavelength is needed beyond both ends.
    pub(super) fn new(set: &'a SpectrumSet, pads: &'a StatedPads, share: f64) -> Self {
        let all = &set.wavelengths_nm;
        let step = all[1] - all[0];
        let beyond = (share * all[all.len() - 1] / step).ceil() as usize + 1;
        let reach = HEIGHT_REACH_NM.min(0.5 * pads.height_nm);
        let node = |k: usize| (std::f64::consts::PI * (k as f64 + 0.5) / HEIGHTS as f64).cos();
        let nearest = pads.nearest_nm();
        Self {
            set,
            pads,
            nodes: (0..all.len() + 2 * beyond).map(|_| Mutex::default()).collect(),
            beyond,
            heights_nm: std::array::from_fn(|k| pads.height_nm + reach * node(k)),
            step_nm: nearest / (nearest / WIDTH_STEP_NM).round().max(WIDTHS as f64),
            least_residual: if pads.residual_nm >= RESIDUAL_STEP_NM { -1 } else { 0 },
        }
    }

    /// Ranges in which the bank interpolates: height less the stated one (nm), taper (degrees), residual film (nm).
    pub(super) fn ranges(pads: &StatedPads) -> [(f64, f64); 3] {
        let reach = 0.95 * HEIGHT_REACH_NM.min(0.5 * pads.height_nm);
        let step = STEPS as f64 * WIDTH_STEP_NM / (2.0 * pads.height_nm);
        let taper = |u: f64| (u * step).atan().to_degrees();
        [
            (-reach, reach),
            (taper(-1.0), taper(2.0)),
            (
                (pads.residual_nm - RESIDUAL_STEP_NM).max(0.0),
                pads.residual_nm + 2.0 * RESIDUAL_STEP_NM,
            ),
        ]
    }

    /// Power of the zeroth order at each wavelength; `moved` is each wavelength in the stack (nm).
    pub(super) fn powers(&self, medium: usize, pillar: &Pillar, index: IndexChange, moved: &[f64]) -> Vec<f64> {
        let (from, step) = (
            self.set.wavelengths_nm[0],
            self.set.wavelengths_nm[1] - self.set.wavelengths_nm[0],
        );
        let lean = 2.0 * pillar.height_nm * pillar.taper_deg.to_radians().tan();
        let taper = lean / (STEPS as f64 * self.step_nm);
        let widths = self.width_weights(pillar.width_nm);
        let heights = lagrange(&self.heights_nm, pillar.height_nm);
        let residual = (pillar.residual_nm - self.pads.residual_nm) / RESIDUAL_STEP_NM;
        let at = |slot: usize| {
            let dn = index[0] * self.index(self.wavelength(slot)).re + index[1];
            let parts = self.parts([dn / INDEX_STEP, taper, residual], pillar.sine2);
            self.value(slot, medium, &widths, &heights, &parts)
        };
        { moved.iter() }
            .map(|nm| {
                let place = (nm - from) / step + self.beyond as f64;
                let near = place.round();
                // A shift of the wavelengths by less than this is rounding.
                if (place - near).abs() < 1e-9 {
                    return at(near as usize);
                }
                let first = (place.floor() as usize).clamp(1, self.nodes.len() - 3) - 1;
                let nodes: Vec<f64> = (0..4).map(|k| (first + k) as f64).collect();
                let weights = lagrange(&nodes, place);
                weights.iter().enumerate().map(|(k, w)| w * at(first + k)).sum()
            })
            .collect()
    }

    /// True for each wavelength at which the power is smooth over widths about a drawn one, for pillars as stated and of other
    /// heights: far from guided-mode resonances, which no polynomial follows. A cone of a numerical aperture widens these.
    pub(super) fn smooth(&self, medium: usize, width_nm: f64) -> Vec<bool> {
        let last = (self.pads.nearest_nm() / self.step_nm).round() as usize;
        let near = (width_nm / self.step_nm).round() as usize;
        let (first, last) = (near.saturating_sub(SMOOTH_OVER), (near + SMOOTH_OVER).min(last));
        let widths: Vec<(usize, f64)> = (first..=last).map(|w| (w, 1.0)).collect();
        let all = &self.set.wavelengths_nm;
        let is_smooth = |k: usize| {
            let slot = self.beyond + k;
            let mut nodes = self.nodes[slot].lock().unwrap_or_else(PoisonError::into_inner);
            self.complete(&mut nodes, slot, medium, &widths, &[(FEW, 1.0)]);
            let at = |w: usize, h: usize| nodes[&(medium, w, FEW)][h];
            (first + 2..last.saturating_sub(1)).all(|w| {
                (0..HEIGHTS).all(|h| {
                    let (near, far) = (at(w - 1, h) + at(w + 1, h), at(w - 2, h) + at(w + 2, h));
                    (at(w, h) - (4.0 * near - far) / 6.0).abs() <= SMOOTH
                })
            })
        };
        let smooth: Vec<bool> = (0..all.len()).into_par_iter().map(is_smooth).collect();
        let reach = self.set.numerical_aperture * self.pads.pitch_nm;
        let far = |nm: f64| {
            let mut others = all.iter().zip(&smooth);
            others.all(|(other, smooth)| *smooth || (other - nm).abs() > reach)
        };
        all.iter().map(|nm| far(*nm)).collect()
    }

    /// Root mean square by which the bank differs from direct solutions with more orders and slices, at some of the wavelengths that
    /// are used, at normal incidence.
    pub(super) fn error(&self, pads: &[(usize, Pillar, &[bool])], index: IndexChange) -> f64 {
        const WAVELENGTHS: usize = 10;
        let differences = pads.iter().flat_map(|(medium, pillar, used)| {
            let all = self.set.wavelengths_nm.iter().zip(*used).filter(|(_, used)| **used);
            let all: Vec<f64> = all.map(|(nm, _)| *nm).collect();
            let some: Vec<f64> = { 0..WAVELENGTHS }
                .filter_map(|k| all.get(k * all.len() / WAVELENGTHS).copied())
                .collect();
            let pillar = Pillar { sine2: 0.0, ..*pillar };
            let own = self.powers(*medium, &pillar, index, &some);
            let direct: Vec<f64> = { some.par_iter() }
                .map(|nm| self.direct(*medium, &pillar, index, *nm, MANY_ORDERS))
                .collect();
            own.into_iter().zip(direct).map(|(a, b)| a - b)
        });
        crate::noise::root_mean_square(differences)
    }

    /// Power of the zeroth order without any interpolation, at normal incidence.
    pub(super) fn direct(&self, medium: usize, pillar: &Pillar, index: IndexChange, nm: f64, orders: usize) -> f64 {
        let lean = 2.0 * pillar.taper_deg.to_radians().tan() * pillar.height_nm;
        let steps = if lean == 0.0 { 0 } else { MANY_STEPS };
        let share = |k: usize| 0.5 - k as f64 / steps.max(1) as f64;
        let widths: Vec<f64> = match steps {
            0 => vec![pillar.width_nm],
            _ => (0..=steps).map(|k| pillar.width_nm + lean * share(k)).collect(),
        };
        let dn = index[0] * self.index(nm).re + index[1];
        let stack = self.stack((nm, medium), (&widths, pillar.height_nm), pillar.residual_nm, dn);
        self.solved(&[stack], nm, 0.0, orders).map_or(0.0, |found| found[0])
    }

    /// True if the pillars can be solved at the ends of the range.
    pub(super) fn can_be_solved(&self) -> Result<(), metalith_rcwa::Error> {
        let all = &self.set.wavelengths_nm;
        for nm in [all[0], all[all.len() - 1]] {
            let stack = self.stack(
                (nm, 0),
                (&[0.5 * self.pads.nearest_nm()], self.pads.height_nm),
                0.0,
                0.0,
            );
            self.solved(&[stack], nm, 0.0, FEW_ORDERS)?;
        }
        Ok(())
    }

    fn wavelength(&self, slot: usize) -> f64 {
        let all = &self.set.wavelengths_nm;
        all[0] + (slot as f64 - self.beyond as f64) * (all[1] - all[0])
    }

    /// Index of the pillars as stated.
    fn index(&self, nm: f64) -> Complex64 {
        let material = self.set.layers[self.pads.layer].material.as_ref();
        material.map_or(Complex64::ONE, |m| index_near(m, nm))
    }

    /// Numbers of the widths that a width is interpolated over, with their weights.
    fn width_weights(&self, width_nm: f64) -> Vec<(usize, f64)> {
        let most = (self.pads.nearest_nm() / self.step_nm).round();
        let place = (width_nm / self.step_nm).clamp(0.0, most);
        let first = (place.floor() - 1.0).clamp(0.0, most - (WIDTHS - 1) as f64);
        let nodes: Vec<f64> = (0..WIDTHS).map(|k| first + k as f64).collect();
        let weights = lagrange(&nodes, place);
        nodes
            .iter()
            .map(|n| *n as usize)
            .zip(weights)
            .filter(|(_, w)| *w != 0.0)
            .collect()
    }

    /// Solutions that make a pillar which is changed by steps of index, taper and residual film, with their weights.
    fn parts(&self, [index, taper, residual]: [f64; 3], sine2: f64) -> Vec<(Solution, f64)> {
        let mut out = vec![(Solution::Stated, 1.0)];
        let mut line = |nodes: &[i8], at: f64, of: &dyn Fn(i8) -> Solution| {
            if at == 0.0 {
                return;
            }
            let places: Vec<f64> = nodes.iter().map(|n| f64::from(*n)).collect();
            out.extend(nodes.iter().zip(lagrange(&places, at)).map(|(n, w)| (of(*n), w)));
            out.push((FEW, -1.0));
        };
        let residuals: Vec<i8> = (0..4).map(|k| self.least_residual + k).collect();
        line(&INDICES, index, &|n| changed(n, 0, 0));
        line(&TAPERS, taper, &|n| changed(0, n, 0));
        line(&residuals, residual, &|n| changed(0, 0, n));
        let pairs = [
            (index * taper, [changed(1, 1, 0), changed(1, 0, 0), changed(0, 1, 0)]),
            (index * residual, [changed(1, 0, 1), changed(1, 0, 0), changed(0, 0, 1)]),
            (taper * residual, [changed(0, 1, 1), changed(0, 1, 0), changed(0, 0, 1)]),
        ];
        for (product, [both, a, b]) in pairs {
            if product != 0.0 {
                out.extend([(both, product), (a, -product), (b, -product), (FEW, product)]);
            }
        }
        if sine2 > 0.0 {
            let share = sine2 / OBLIQUE_SINE.powi(2);
            out.extend([(Solution::Oblique, share), (FEW, -share)]);
        }
        out
    }

    fn value(
        &self,
        slot: usize,
        medium: usize,
        widths: &[(usize, f64)],
        heights: &[f64],
        parts: &[(Solution, f64)],
    ) -> f64 {
        let mut nodes = self.nodes[slot].lock().unwrap_or_else(PoisonError::into_inner);
        self.complete(&mut nodes, slot, medium, widths, parts);
        let mut sum = 0.0;
        for (w, own) in widths {
            for (solution, part) in parts {
                let at = &nodes[&(medium, *w, *solution)];
                sum += own * part * at.iter().zip(heights).map(|(v, h)| v * h).sum::<f64>();
            }
        }
        sum
    }

    /// Solve nodes of one wavelength as far as they are missing.
    fn complete(
        &self,
        nodes: &mut Nodes,
        slot: usize,
        medium: usize,
        widths: &[(usize, f64)],
        parts: &[(Solution, f64)],
    ) {
        let keys = || {
            widths
                .iter()
                .flat_map(|(w, _)| parts.iter().map(move |(s, _)| (medium, *w, *s)))
        };
        let mut missing: Vec<_> = keys().filter(|key| !nodes.contains_key(key)).collect();
        if !missing.is_empty() {
            // Neighbours have modes in common: of one index, one width after the other.
            let place = |(_, w, s): &(usize, usize, Solution)| match s {
                Solution::Changed { index, taper, residual } => (*index, *w, *taper, *residual),
                _ => (i8::MAX, *w, 0, 0),
            };
            missing.sort_by_key(place);
            missing.dedup();
            self.fill(nodes, slot, &missing);
        }
    }

    /// Solve some nodes of one wavelength.
    fn fill(&self, nodes: &mut Nodes, slot: usize, missing: &[(usize, usize, Solution)]) {
        let nm = self.wavelength(slot);
        let kinds = [
            (Solution::Stated, 0.0, ORDERS),
            (FEW, 0.0, FEW_ORDERS),
            (Solution::Oblique, OBLIQUE_SINE, FEW_ORDERS),
        ];
        for (kind, sine, orders) in kinds {
            let own = missing
                .iter()
                .filter(|m| std::mem::discriminant(&m.2) == std::mem::discriminant(&kind));
            let own: Vec<_> = own.copied().collect();
            let stacks: Vec<LayerStack> = { own.iter() }
                .flat_map(|(medium, width, solution)| {
                    self.heights_nm.map(|h| self.node(nm, *medium, *width, h, *solution))
                })
                .collect();
            let values = self
                .solved(&stacks, nm, sine, orders)
                .unwrap_or_else(|_| vec![0.0; stacks.len()]);
            for (key, at) in own.into_iter().zip(values.chunks_exact(HEIGHTS)) {
                nodes.insert(key, std::array::from_fn(|k| at[k]));
            }
        }
    }

    /// Stack of a node.
    fn node(&self, nm: f64, medium: usize, width: usize, height_nm: f64, solution: Solution) -> LayerStack {
        let (index, taper, residual) = match solution {
            Solution::Changed { index, taper, residual } => (index, taper, residual),
            _ => (0, 0, 0),
        };
        let at = |step: i8| (width as f64 + f64::from(step * taper)) * self.step_nm;
        let widths = [at(2), at(1), at(0), at(-1), at(-2)];
        let widths = if taper == 0 { &widths[2..3] } else { &widths };
        let residual_nm = self.pads.residual_nm + RESIDUAL_STEP_NM * f64::from(residual);
        self.stack(
            (nm, medium),
            (widths, height_nm),
            residual_nm,
            INDEX_STEP * f64::from(index),
        )
    }

    /// Pillars of some widths from the foot upwards, on a residual film, among the other layers as stated.
    fn stack(
        &self,
        (nm, medium): (f64, usize),
        (widths, height_nm): (&[f64], f64),
        residual_nm: f64,
        dn: f64,
    ) -> LayerStack {
        let set = self.set;
        let around = index_near(&set.media[medium].1, nm);
        let film = self.index(nm) + dn;
        let nearest = self.pads.nearest_nm();
        let uniform = |layers: &[super::set::StatedLayer]| -> Vec<Layer> {
            let films = layers
                .iter()
                .rev()
                .filter_map(|l| Some((l.material.as_ref()?, l.thickness_nm?)));
            films
                .filter(|(_, nm)| *nm > 0.0)
                .map(|(m, thickness)| Layer::uniform(thickness, index_near(m, nm)))
                .collect()
        };
        let mut layers = uniform(&set.layers[self.pads.layer + 1..]);
        if residual_nm > 0.0 {
            layers.push(Layer::uniform(residual_nm, film));
        }
        // The slices of both ends are half as thick.
        let parts = |k: usize| if k == 0 || k + 1 == widths.len() { 0.5 } else { 1.0 };
        let all: f64 = (0..widths.len()).map(parts).sum();
        layers.extend(widths.iter().enumerate().map(|(k, width)| {
            let width = width.min(nearest);
            Layer {
                height_nm: height_nm * parts(k) / all,
                outline: match width {
                    _ if width <= 0.0 => Outline::empty(),
                    _ if self.pads.is_round => Outline::circle(width),
                    _ => Outline::square(width),
                },
                inside: if width <= 0.0 { around } else { film },
                outside: around,
            }
        }));
        layers.extend(uniform(&set.layers[..self.pads.layer]));
        LayerStack {
            pitch_nm: self.pads.pitch_nm,
            lattice: self.pads.lattice,
            below: set.substrate.as_ref().map_or(Complex64::ONE, |m| index_near(m, nm)),
            layers,
            above: Complex64::from(set.ambient_index),
        }
    }

    /// Powers of the zeroth order of unpolarised light.
    fn solved(
        &self,
        stacks: &[LayerStack],
        nm: f64,
        sine: f64,
        orders: usize,
    ) -> Result<Vec<f64>, metalith_rcwa::Error> {
        let light = Incidence::of_sines(nm * 1e-3, Side::Above, [sine, 0.0]);
        let found = solve_each(stacks, &light, Orders::new(orders)?)?;
        let power = found.iter().map(|response| {
            let order = response.orders.iter().find(|o| o.order == [0, 0]);
            let both = order.map_or([0.0; 2], |o| {
                if self.set.is_transmission {
                    o.transmitted
                } else {
                    o.reflected
                }
            });
            0.5 * (both[0] + both[1])
        });
        Ok(power.collect())
    }
}

impl StatedPads {
    /// Distance of the nearest two pillars (nm), which is as wide as a pillar may be.
    pub(super) fn nearest_nm(&self) -> f64 {
        self.lattice.nearest_nm(self.pitch_nm)
    }
}

/// Index of a material, at the end of its table beyond it.
fn index_near(material: &metalith_rcwa::Material, nm: f64) -> Complex64 {
    let (low, high) = material.range_um();
    material.index((nm * 1e-3).clamp(low, high)).unwrap_or(Complex64::ONE)
}

/// Weights of values at nodes for the polynomial through them.
fn lagrange(nodes: &[f64], at: f64) -> Vec<f64> {
    let weight = |k: usize| {
        let others = nodes.iter().enumerate().filter(|(j, _)| *j != k);
        others.map(|(_, x)| (at - x) / (nodes[k] - x)).product()
    };
    (0..nodes.len()).map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::super::film_reflectance::film_powers;
    use super::super::set::StatedLayer;
    use super::*;
    use metalith_rcwa::{CellLattice, Material};

    const FILM: f64 = 2.05;
    const GLASS: f64 = 1.46;

    fn set(is_transmission: bool) -> SpectrumSet {
        let layer = |name: &str, n: f64, thickness_nm| StatedLayer {
            name: name.into(),
            material: Material::constant(n, 0.0).ok(),
            thickness_nm,
        };
        SpectrumSet {
            remarks: Vec::new(),
            path: "set".into(),
            title: String::new(),
            wavelengths_nm: (0..=30).map(|k| 480.0 + 10.0 * f64::from(k)).collect(),
            is_transmission,
            ambient_index: 1.0,
            layers: vec![layer("pillars", FILM, None), layer("spacer", 1.4, Some(60.0))],
            pads: Some(StatedPads {
                layer: 0,
                pitch_nm: 320.0,
                lattice: CellLattice::Square,
                is_round: false,
                height_nm: 500.0,
                residual_nm: 0.0,
                taper_deg: 0.0,
            }),
            substrate: Material::constant(GLASS, 0.0).ok(),
            numerical_aperture: 0.0,
            media: vec![("air".into(), Material::constant(1.0, 0.0).unwrap())],
            spectra: Vec::new(),
        }
    }

    fn pillar(width_nm: f64) -> Pillar {
        Pillar {
            width_nm,
            height_nm: 500.0,
            taper_deg: 0.0,
            residual_nm: 0.0,
            sine2: 0.0,
        }
    }

    /// Pillars as wide as the pitch are a film, pillars without width are bare.
    #[test]
    fn ends_of_the_width_are_films() {
        for is_transmission in [false, true] {
            let set = set(is_transmission);
            let bank = PadBank::new(&set, set.pads.as_ref().unwrap(), 0.01);
            for (width, index) in [(320.0, FILM), (0.0, 1.0)] {
                let found = bank.powers(0, &pillar(width), [0.0; 2], &[550.0, 700.0]);
                for (found, nm) in found.into_iter().zip([550.0, 700.0]) {
                    let films = [(Complex64::from(index), 500.0), (Complex64::from(1.4), 60.0)];
                    let film = film_powers(1.0, &films, Complex64::from(GLASS), nm, 0.0)[usize::from(is_transmission)];
                    // The height is interpolated, at its middle between two nodes.
                    assert!((found - film).abs() < 1e-4, "{width} {nm}: {found} {film}");
                }
            }
        }
    }

    /// Pillars that are changed in all ways at once, off the nodes, against direct solutions with more orders and slices.
    #[test]
    fn the_bank_agrees_with_direct_solutions() {
        let set = set(false);
        let bank = PadBank::new(&set, set.pads.as_ref().unwrap(), 0.01);
        let changed = Pillar {
            width_nm: 143.0,
            height_nm: 513.0,
            taper_deg: 0.6,
            residual_nm: 14.0,
            sine2: 0.0,
        };
        for (pillar, index) in [(pillar(187.0), [0.0, 0.0]), (changed, [0.01, 0.01])] {
            let nm = [620.0, 690.0, 770.0];
            let found = bank.powers(0, &pillar, index, &nm);
            for (found, nm) in found.into_iter().zip(nm) {
                let direct = bank.direct(0, &pillar, index, nm, 13);
                println!("{nm}: {found:.5} {direct:.5}");
                assert!((found - direct).abs() < 0.004, "{pillar:?} {nm}: {found} {direct}");
            }
        }
    }

    /// A guided-mode resonance is narrow, and wide pillars have it at longer wavelengths.
    #[test]
    fn resonances_are_not_smooth() {
        let set = set(false);
        let bank = PadBank::new(&set, set.pads.as_ref().unwrap(), 0.01);
        let (narrow, wide) = (bank.smooth(0, 100.0), bank.smooth(0, 240.0));
        let count = |smooth: &[bool]| smooth.iter().filter(|s| **s).count();
        println!("{} {}", count(&narrow), count(&wide));
        assert!(count(&wide) < count(&narrow) && wide[25..].iter().all(|s| *s) && !wide.iter().all(|s| *s));
    }

    /// The powers over a small cone against direct solutions of oblique waves at two azimuths.
    #[test]
    fn a_small_cone_is_the_mean_of_oblique_waves() {
        let set = set(false);
        let bank = PadBank::new(&set, set.pads.as_ref().unwrap(), 0.01);
        let aperture: f64 = 0.15;
        let cone = Pillar {
            sine2: 0.5 * aperture.powi(2),
            ..pillar(180.0)
        };
        for nm in [640.0, 720.0] {
            let found = bank.powers(0, &cone, [0.0; 2], &[nm])[0];
            let normal = bank.powers(0, &pillar(180.0), [0.0; 2], &[nm])[0];
            // Two nodes of Gauss over the squared sine.
            let shares = [-1.0, 1.0].map(|s| 0.5 + s * 0.5 / 3.0_f64.sqrt());
            let stack = bank.stack((nm, 0), (&[180.0], 500.0), 0.0, 0.0);
            let power = |azimuth: f64, share: f64| {
                let sine = aperture * share.sqrt();
                let light =
                    Incidence::of_sines(nm * 1e-3, Side::Above, [azimuth.cos(), azimuth.sin()].map(|v| v * sine));
                let found =
                    &solve_each(std::slice::from_ref(&stack), &light, Orders::new(FEW_ORDERS).unwrap()).unwrap()[0];
                let order = found.orders.iter().find(|o| o.order == [0, 0]).unwrap();
                0.5 * (order.reflected[0] + order.reflected[1])
            };
            let azimuths = [0.0, std::f64::consts::FRAC_PI_4];
            let all = azimuths.iter().flat_map(|a| shares.iter().map(move |s| power(*a, *s)));
            let direct: f64 = all.sum::<f64>() / 4.0;
            println!("{nm}: {normal:.5} {found:.5} {direct:.5}");
            assert!(
                (found - direct).abs() < 0.001,
                "{nm}: {found} {direct}, normal {normal}"
            );
        }
    }
}
