//! What every effect would do to every capture, simulated once and then looked up.
//!
//! Each number of each effect is simulated at a few sizes; between them the change of an image is a
//! polynomial. Changes of different numbers add. That is right where effects are small, and a fit that moves
//! far is carried on from an atlas about its new place.

use std::sync::Arc;

use rayon::prelude::*;

use super::curve::Curve;
use super::effects::Parameter;
use super::optics::PixelGrid;
use super::simulator::Simulator;
use super::speckle::Speckle;
use metalith_core::{Progress, Result};
use metalith_made::Perturbation;

/// Multiples of the typical size that a number is simulated at, on both sides.
const TWO_SIDED: [f64; 4] = [-2.5, -1.25, 1.25, 2.5];

/// And where it can only be positive.
const ONE_SIDED: [f64; 3] = [0.8, 1.8, 3.5];

/// And about a place that a fit has come to.
const NEAR: [f64; 4] = [-0.6, -0.3, 0.3, 0.6];

/// How far beyond what was simulated a fit may look, in reaches.
const BEYOND: f64 = 1.6;

/// Polynomials of the free phase term: Noll's 5 to 15, through fourth order.
pub const FREE_PHASES: usize = 11;

/// Size at which a polynomial of the free phase is simulated [nm of path]: small enough to be linear.
const FREE_PHASE_NM: f64 = 8.0;

/// Polynomials of the free transmission over width, for each LED.
pub const FREE_TRANSMISSIONS: usize = 3;

/// Size at which one is simulated.
const FREE_TRANSMISSION: f64 = 0.03;

/// What a set should show, and how every number changes it.
#[derive(Clone)]
pub struct Atlas {
    /// The numbers that it is about.
    pub about: Vec<f64>,
    pub base: Arc<Vec<PixelGrid>>,
    curves: Vec<Curve>,
    /// Changes for a unit of each free term: phases [1/nm], then transmissions of each LED.
    pub free: Arc<Vec<Vec<Option<PixelGrid>>>>,
    /// The grain of what strikes single pillars at random, if that is among the effects.
    pub grain: Option<Arc<Speckle>>,
}

impl Simulator<'_> {
    /// Simulate every effect about the numbers `about`.
    ///
    /// # Errors
    /// As [`Simulator::expose`].
    pub fn atlas(&self, about: &[f64], free: bool, progress: &dyn Progress) -> Result<Atlas> {
        let mut departures = vec![self.perturbation(about)];
        let mut nodes: Vec<Vec<f64>> = Vec::new();
        for (s, slot) in self.slots.iter().enumerate() {
            let one_sided = slot.parameter.one_sided() && about[s] == 0.0;
            let multiples: &[f64] = if one_sided { &ONE_SIDED } else { &TWO_SIDED };
            nodes.push(self.nodes(about, s, multiples, &mut departures));
        }
        if free {
            for k in 0..FREE_PHASES {
                let mut d = departures[0].clone();
                d.geometry.wavefront_nm = vec![0.0; FREE_PHASES];
                d.geometry.wavefront_nm[k] = FREE_PHASE_NM;
                departures.push(d);
            }
            for k in 0..FREE_TRANSMISSIONS {
                let mut d = departures[0].clone();
                d.geometry.transmission = vec![0.0; FREE_TRANSMISSIONS];
                d.geometry.transmission[k] = FREE_TRANSMISSION;
                d.geometry.transmission_range_nm = self.bench.widths_nm().into();
                departures.push(d);
            }
        }
        let mut exposed = self.expose(&departures, progress)?.into_iter();
        let base = exposed.next().expect("the first is the base");
        let change = |grids: Vec<PixelGrid>, factor: f32| change(&grids, &base, factor);
        let curves = nodes
            .into_iter()
            .zip(&self.slots)
            .map(|(nodes, slot)| {
                let grids: Vec<_> = exposed.by_ref().take(nodes.len()).map(|g| change(g, 1.0)).collect();
                let kinked = self.effects[slot.effect].kinked();
                Curve::new(nodes, grids, kinked && about.iter().all(|v| *v == 0.0))
            })
            .collect();
        let mut terms = Vec::new();
        let leds = self.bench.set().leds.len();
        for (k, grids) in exposed.enumerate() {
            if k < FREE_PHASES {
                terms.push(
                    change(grids, 1.0 / FREE_PHASE_NM as f32)
                        .into_iter()
                        .map(Some)
                        .collect(),
                );
            } else {
                let grids = change(grids, 1.0 / FREE_TRANSMISSION as f32);
                for led in 0..leds {
                    let own = |c: usize| self.bench.set().captures[c].led == led;
                    terms.push(
                        grids
                            .iter()
                            .enumerate()
                            .map(|(c, g)| own(c).then(|| g.clone()))
                            .collect(),
                    );
                }
            }
        }
        let random = self.slots.iter().position(|s| self.effects[s.effect].random());
        let grain = match random {
            Some(slot) => Some(Arc::new(Speckle::of(self, about, slot, progress)?)),
            None => None,
        };
        Ok(Atlas {
            about: about.to_vec(),
            base: Arc::new(base),
            curves,
            free: Arc::new(terms),
            grain,
        })
    }

    /// Sizes of one number about `about` within what physics allows, with the departures that they are.
    fn nodes(&self, about: &[f64], s: usize, multiples: &[f64], departures: &mut Vec<Perturbation>) -> Vec<f64> {
        let Parameter { typical, range, .. } = self.slots[s].parameter;
        let offsets = multiples.iter().map(|m| m * typical);
        let offsets: Vec<f64> = offsets
            .filter(|o| (range.0..=range.1).contains(&(about[s] + o)))
            .collect();
        for offset in &offsets {
            let mut theta = about.to_vec();
            theta[s] += offset;
            departures.push(self.perturbation(&theta));
        }
        offsets
    }

    /// An atlas about other numbers: those in `slots` are simulated anew close to where they are, the changes of
    /// all others are taken to add as they did.
    ///
    /// # Errors
    /// As [`Simulator::expose`].
    pub fn recentred(&self, atlas: &Atlas, about: &[f64], slots: &[usize], progress: &dyn Progress) -> Result<Atlas> {
        let mut departures = vec![self.perturbation(about)];
        let nodes: Vec<Vec<f64>> = slots
            .iter()
            .map(|&s| self.nodes(about, s, &NEAR, &mut departures))
            .collect();
        let mut exposed = self.expose(&departures, progress)?.into_iter();
        let base = exposed.next().expect("the first is the base");
        let mut out = atlas.clone();
        for (&s, nodes) in slots.iter().zip(nodes) {
            let grids: Vec<_> = exposed
                .by_ref()
                .take(nodes.len())
                .map(|g| change(&g, &base, 1.0))
                .collect();
            out.curves[s] = Curve::new(nodes, grids, false);
        }
        out.about = about.to_vec();
        out.base = Arc::new(base);
        Ok(out)
    }

    /// Simulate one number at more sizes, where a fit has gone beyond those that are known.
    ///
    /// # Errors
    /// As [`Simulator::expose`].
    pub fn extend(&self, atlas: &mut Atlas, slot: usize, values: &[f64], progress: &dyn Progress) -> Result<()> {
        let departures: Vec<_> = values
            .iter()
            .map(|value| {
                let mut theta = atlas.about.clone();
                theta[slot] = *value;
                self.perturbation(&theta)
            })
            .collect();
        for (grids, value) in self.expose(&departures, progress)?.into_iter().zip(values) {
            let change = change(&grids, &atlas.base, 1.0);
            atlas.curves[slot].add(value - atlas.about[slot], change);
        }
        Ok(())
    }
}

fn change(grids: &[PixelGrid], base: &[PixelGrid], factor: f32) -> Vec<PixelGrid> {
    let pairs = grids.par_iter().zip(base);
    pairs
        .map(|(g, b)| PixelGrid::combine(&[(g, factor), (b, -factor)]))
        .collect()
}

impl Atlas {
    /// Captures without any effect.
    pub fn alone(base: Vec<PixelGrid>) -> Self {
        Self {
            about: Vec::new(),
            base: Arc::new(base),
            curves: Vec::new(),
            free: Arc::default(),
            grain: None,
        }
    }

    /// What a capture should show for these numbers.
    pub fn grid(&self, theta: &[f64], capture: usize) -> PixelGrid {
        let mut parts = vec![(&self.base[capture], 1.0)];
        for ((curve, t), about) in self.curves.iter().zip(theta).zip(&self.about) {
            if t != about {
                parts.extend(curve.change(t - about, capture));
            }
        }
        PixelGrid::combine(&parts)
    }

    /// Its derivative by one of the numbers.
    pub fn slope(&self, theta: &[f64], slot: usize, capture: usize) -> PixelGrid {
        let parts: Vec<_> = self.curves[slot]
            .slope(theta[slot] - self.about[slot], capture)
            .collect();
        PixelGrid::combine(&parts)
    }

    /// The change for a unit of a free term in a capture that shows `grid`; nothing where it does not act.
    pub fn free_term(&self, term: usize, capture: usize, grid: &PixelGrid) -> PixelGrid {
        let known = self.free[term][capture].clone();
        known.unwrap_or_else(|| PixelGrid::combine(&[(grid, 0.0)]))
    }

    /// Values of a number between which the atlas was simulated.
    pub fn known(&self, slot: usize) -> (f64, f64) {
        let (low, high) = self.curves[slot].ends();
        (self.about[slot] + low, self.about[slot] + high)
    }

    /// Values of a number that a fit may look at.
    pub fn reach(&self, slot: usize) -> (f64, f64) {
        let (low, high) = self.curves[slot].ends();
        (self.about[slot] + BEYOND * low, self.about[slot] + BEYOND * high)
    }
}
