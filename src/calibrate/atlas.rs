//! What every effect would do to every capture, simulated once and then looked up.
//!
//! Each number of each effect is simulated at a few sizes; between them the change of an image is a
//! polynomial. Changes of different numbers add. That is right where effects are small, and a fit that moves
//! far is carried on from an atlas about its new place.

use rayon::prelude::*;

use super::bench::Bench;
use super::cells::CellSource;
use super::departure::Departure;
use super::effects::{Effect, Parameter, Stage};
use super::optics::PixelGrid;
use crate::error::Result;
use crate::progress::Progress;

/// Multiples of the typical size that a number is simulated at, on both sides.
const TWO_SIDED: [f64; 4] = [-2.5, -1.25, 1.25, 2.5];

/// And where it can only be positive.
const ONE_SIDED: [f64; 3] = [0.8, 1.8, 3.5];

/// The same for numbers that every pillar has to be solved again for.
const TWO_SIDED_STACK: [f64; 2] = [-1.25, 1.25];
const ONE_SIDED_STACK: [f64; 2] = [1.0, 2.5];

/// Polynomials of the free phase term: Noll's 5 to 15, through fourth order.
pub const FREE_PHASES: usize = 11;

/// Size at which a polynomial of the free phase is simulated [nm of path]: small enough to be linear.
const FREE_PHASE_NM: f64 = 8.0;

/// Polynomials of the free transmission over width, for each LED.
pub const FREE_TRANSMISSIONS: usize = 3;

/// Size at which one is simulated.
const FREE_TRANSMISSION: f64 = 0.03;

/// A bench, its cells and the effects that are tried on it.
pub struct Simulator<'a> {
    pub bench: Bench<'a>,
    pub cells: CellSource,
    pub effects: Vec<Box<dyn Effect>>,
    pub slots: Vec<Slot>,
    wavelengths_nm: Vec<f64>,
    widths_nm: (f64, f64),
}

/// One number of one effect.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// Index into [`Simulator::effects`].
    pub effect: usize,
    /// Which of its numbers.
    pub index: usize,
    pub parameter: Parameter,
}

/// What a set should show, and how every number changes it.
pub struct Atlas {
    /// The numbers that it is about.
    pub about: Vec<f64>,
    pub base: Vec<PixelGrid>,
    curves: Vec<Curve>,
    /// Changes for a unit of each free term: phases [1/nm], then transmissions of each LED.
    pub free: Vec<Vec<Option<PixelGrid>>>,
}

struct Curve {
    /// Offsets from the middle, zero left out.
    nodes: Vec<f64>,
    /// Changes from the base at each node, `[node][capture]`.
    grids: Vec<Vec<PixelGrid>>,
}

/// Widths that a bias may add or take [nm]; cells are tabulated so far beyond the layout.
pub const WIDTH_ROOM_NM: f64 = 36.0;

impl<'a> Simulator<'a> {
    /// Everything that is needed to predict a set.
    pub fn new(bench: Bench<'a>, cells: CellSource, effects: Vec<Box<dyn Effect>>) -> Self {
        let slots = effects
            .iter()
            .enumerate()
            .flat_map(|(effect, e)| {
                let parameters = e.parameters().into_iter().enumerate();
                parameters.map(move |(index, parameter)| Slot {
                    effect,
                    index,
                    parameter,
                })
            })
            .collect();
        let (low, high) = bench.widths_nm();
        Self {
            wavelengths_nm: bench.wavelengths_nm(),
            widths_nm: (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            bench,
            cells,
            effects,
            slots,
        }
    }

    /// The numbers of an effect among all.
    pub fn slots_of(&self, effect: usize) -> Vec<usize> {
        (0..self.slots.len())
            .filter(|&s| self.slots[s].effect == effect)
            .collect()
    }

    /// What the numbers mean together.
    pub fn departure(&self, theta: &[f64]) -> Departure {
        let mut departure = Departure::default();
        for (e, effect) in self.effects.iter().enumerate() {
            let own: Vec<f64> = self.slots_of(e).into_iter().map(|s| theta[s]).collect();
            effect.apply(&own, &mut departure);
        }
        departure
    }

    /// What each capture should show under each of `departures`; those that differ in lamps and camera alone
    /// share their light.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn expose(&self, departures: &[Departure], progress: &dyn Progress) -> Result<Vec<Vec<PixelGrid>>> {
        let mut out: Vec<Option<Vec<PixelGrid>>> = departures.iter().map(|_| None).collect();
        let mut steps: Vec<Vec<usize>> = Vec::new();
        for (i, d) in departures.iter().enumerate() {
            let same = |j: &usize| {
                let o = &departures[*j];
                (&o.geometry, &o.cell, &o.path) == (&d.geometry, &d.cell, &d.path)
            };
            match steps.iter_mut().find(|s| same(&s[0])) {
                Some(step) => step.push(i),
                None => steps.push(vec![i]),
            }
        }
        // Cells first: they bring their own progress.
        let tables = steps
            .iter()
            .map(|s| {
                self.cells
                    .table(&departures[s[0]].cell, &self.wavelengths_nm, self.widths_nm, progress)
            })
            .collect::<Result<Vec<_>>>()?;
        progress.begin("captures as they should be", steps.len() as u64);
        for (step, table) in steps.iter().zip(tables) {
            let lights: Vec<_> = step.iter().map(|&i| departures[i].light.clone()).collect();
            let intensities = self
                .bench
                .intensities(&table, &departures[step[0]], &lights, progress)?;
            for (&i, planes) in step.iter().zip(&intensities) {
                out[i] = Some(self.bench.grids(planes, &departures[i]));
            }
            progress.advance(1);
        }
        Ok(out
            .into_iter()
            .map(|g| g.expect("every departure is in one step"))
            .collect())
    }

    /// Simulate every effect about the numbers `about`.
    ///
    /// # Errors
    /// As [`Simulator::expose`].
    pub fn atlas(&self, about: &[f64], free: bool, progress: &dyn Progress) -> Result<Atlas> {
        let mut departures = vec![self.departure(about)];
        let mut nodes: Vec<Vec<f64>> = Vec::new();
        for (s, slot) in self.slots.iter().enumerate() {
            let one_sided = slot.parameter.one_sided() && about[s] == 0.0;
            let multiples: &[f64] = match (self.effects[slot.effect].stage(), one_sided) {
                (Stage::Stack, false) => &TWO_SIDED_STACK,
                (Stage::Stack, true) => &ONE_SIDED_STACK,
                (_, false) => &TWO_SIDED,
                (_, true) => &ONE_SIDED,
            };
            let (low, high) = slot.parameter.range;
            let offsets: Vec<f64> = multiples
                .iter()
                .map(|m| m * slot.parameter.typical)
                .filter(|o| (low..=high).contains(&(about[s] + o)))
                .collect();
            for offset in &offsets {
                let mut theta = about.to_vec();
                theta[s] += offset;
                departures.push(self.departure(&theta));
            }
            nodes.push(offsets);
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
                departures.push(d);
            }
        }
        let mut exposed = self.expose(&departures, progress)?.into_iter();
        let base = exposed.next().expect("the first is the base");
        let change = |grids: Vec<PixelGrid>, factor: f32| -> Vec<PixelGrid> {
            grids
                .par_iter()
                .zip(&base)
                .map(|(g, b)| PixelGrid::combine(&[(g, factor), (b, -factor)]))
                .collect()
        };
        let curves = nodes
            .into_iter()
            .map(|nodes| Curve {
                grids: exposed.by_ref().take(nodes.len()).map(|g| change(g, 1.0)).collect(),
                nodes,
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
        Ok(Atlas {
            about: about.to_vec(),
            base,
            curves,
            free: terms,
        })
    }
}

impl Atlas {
    /// Captures without any effect.
    pub fn alone(base: Vec<PixelGrid>) -> Self {
        Self {
            about: Vec::new(),
            base,
            curves: Vec::new(),
            free: Vec::new(),
        }
    }

    /// What a capture should show for these numbers.
    pub fn grid(&self, theta: &[f64], capture: usize) -> PixelGrid {
        let mut parts = vec![(&self.base[capture], 1.0)];
        for ((curve, t), about) in self.curves.iter().zip(theta).zip(&self.about) {
            if t != about {
                for (grids, w) in curve.grids.iter().zip(curve.weights(t - about)) {
                    parts.push((&grids[capture], w as f32));
                }
            }
        }
        PixelGrid::combine(&parts)
    }

    /// Its derivative by one of the numbers.
    pub fn slope(&self, theta: &[f64], slot: usize, capture: usize) -> PixelGrid {
        let curve = &self.curves[slot];
        let weights = curve.slopes(theta[slot] - self.about[slot]);
        let parts: Vec<_> = curve
            .grids
            .iter()
            .zip(weights)
            .map(|(g, w)| (&g[capture], w as f32))
            .collect();
        PixelGrid::combine(&parts)
    }

    /// How far from its middle a number may go for the atlas to be trusted.
    pub fn reach(&self, slot: usize) -> (f64, f64) {
        let nodes = &self.curves[slot].nodes;
        let low = nodes.iter().copied().fold(0.0, f64::min);
        let high = nodes.iter().copied().fold(0.0, f64::max);
        (self.about[slot] + 1.6 * low, self.about[slot] + 1.6 * high)
    }
}

impl Curve {
    fn ends(&self) -> (f64, f64) {
        let low = self.nodes.iter().copied().fold(0.0, f64::min);
        let high = self.nodes.iter().copied().fold(0.0, f64::max);
        (low, high)
    }

    /// Weights of the nodes' changes at `u`; straight on beyond the ends.
    fn weights(&self, u: f64) -> Vec<f64> {
        let (low, high) = self.ends();
        let inside = u.clamp(low, high);
        let beyond = u - inside;
        (0..self.nodes.len())
            .map(|i| {
                self.lagrange(i, inside)
                    + if beyond == 0.0 {
                        0.0
                    } else {
                        beyond * self.lagrange_slope(i, inside)
                    }
            })
            .collect()
    }

    fn slopes(&self, u: f64) -> Vec<f64> {
        let (low, high) = self.ends();
        (0..self.nodes.len())
            .map(|i| self.lagrange_slope(i, u.clamp(low, high)))
            .collect()
    }

    /// The polynomial that is one at node `i` and zero at the others and in the middle.
    fn lagrange(&self, i: usize, u: f64) -> f64 {
        let at = self.nodes[i];
        let others = self.nodes.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, n)| *n);
        others.chain([0.0]).map(|n| (u - n) / (at - n)).product()
    }

    fn lagrange_slope(&self, i: usize, u: f64) -> f64 {
        let at = self.nodes[i];
        let roots: Vec<f64> = self
            .nodes
            .iter()
            .enumerate()
            .filter(|(j, _)| *j != i)
            .map(|(_, n)| *n)
            .chain([0.0])
            .collect();
        let scale: f64 = roots.iter().map(|n| at - n).product();
        (0..roots.len())
            .map(|k| {
                let rest = roots.iter().enumerate().filter(|(j, _)| *j != k);
                rest.map(|(_, n)| u - n).product::<f64>()
            })
            .sum::<f64>()
            / scale
    }
}
