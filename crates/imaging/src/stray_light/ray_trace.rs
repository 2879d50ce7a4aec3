//! Ray trace of the light of each square of the scene.

use metalith_core::{Progress, Result};
use metalith_sensor::{ChannelSampling, Sensor};
use metalith_wave::PlaneWave;
use metalith_wave::propagation::{LandingGrid, LocalAngularSpectrum, leaving};
use rayon::prelude::*;

use super::coarse_grid::solid_angle;
use super::{CELL_PIXELS, LightShares, SCENE_CELLS, StrayLight, sensor_cells};
use crate::acceptance::Acceptance;
use crate::chip::ChipInLight;
use crate::geometry::{ElementView, SceneView};
use crate::kernels::KernelBank;
use crate::spectra::SceneSpectrum;

/// Blocks an axis of an element.
const BLOCKS: usize = 20;
/// Wavelengths of the stray light are at most so far apart (nm): it moves with the chief ray by less than a square.
const STRAY_LIGHT_STEP_NM: f64 = 38.0;

impl StrayLight {
    /// Trace the stray light of a scene's field.
    ///
    /// # Errors
    /// If the user stopped it, or a map is too large.
    pub fn build(
        chip: &ChipInLight<'_>,
        bank: &KernelBank,
        basis: &[SceneSpectrum],
        sensor: &Sensor,
        view: &SceneView,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let stride = (STRAY_LIGHT_STEP_NM / metalith_sensor::WavelengthSteps::USUAL_NM) as usize;
        let all = &chip.sampling.wavelengths_nm;
        let mut chosen: Vec<usize> = (0..all.len()).step_by(stride.max(1)).collect();
        chosen.extend((chosen.last() != Some(&(all.len() - 1))).then_some(all.len() - 1));
        progress.begin("tracing the stray light", (chosen.len() * chip.elements.len()) as u64);
        let weights = weights(chip, basis, &chosen);
        let cells = sensor_cells(sensor);
        let tracer = Tracer {
            chip,
            bank,
            sensor,
            view,
            acceptance: Acceptance::new(&chip.elements, sensor),
            cells,
            chosen: &chosen,
            weights: &weights,
        };
        let pairs = chip.sampling.channels.len() * basis.len();
        let size = SCENE_CELLS * SCENE_CELLS * cells[0] * cells[1];
        let mut values = vec![0.0f32; pairs * size];
        let mut budget = vec![LightShares::default(); pairs];
        for distinct in 0..chip.distinct.len() {
            progress.check_stopped()?;
            let light = chip.in_light(distinct, &chosen, progress)?;
            let distance_um = chip.distinct[distinct].view.distance_um([0.0; 2]);
            let departed: Vec<DepartingLight> = chosen
                .par_iter()
                .map(|i| {
                    let lit = light.lit(*i, [0.0; 2]);
                    // Where light arrives in two polarisations one stands for both: their tables differ in obliquely lit
                    // cells alone.
                    let departing = light.departing(*i);
                    let parts = if lit.weight < 1.0 {
                        &departing[..1]
                    } else {
                        &departing[..]
                    };
                    let of = |(table, order): &(&_, i32)| {
                        let aperture = chip.distinct[distinct].made.lit_aperture(table, &lit.light);
                        (
                            *order,
                            LocalAngularSpectrum::of(&aperture, all[*i] * 1e-3, distance_um, BLOCKS),
                        )
                    };
                    DepartingLight {
                        parts: parts.iter().map(of).collect(),
                        arriving_um2: light.arriving_um2(*i),
                        zero_order: light.zero_order(*i),
                    }
                })
                .collect();
            for element in (0..chip.elements.len()).filter(|e| chip.copies[*e].0 == distinct) {
                let area = chip.elements[element].area;
                // Row by row: the light of all squares is larger than the stray light itself.
                for row in 0..SCENE_CELLS {
                    progress.check_stopped()?;
                    let squares = row * SCENE_CELLS..(row + 1) * SCENE_CELLS;
                    let traced: Vec<Traced> = squares
                        .clone()
                        .into_par_iter()
                        .map(|square| tracer.trace(element, square, &departed))
                        .collect::<Result<_>>()?;
                    for (square, one) in squares.zip(&traced) {
                        for (pair, total) in budget.iter_mut().enumerate() {
                            let from = (pair * SCENE_CELLS * SCENE_CELLS + square) * cells[0] * cells[1];
                            let to = &mut values[from..from + cells[0] * cells[1]];
                            to.iter_mut()
                                .zip(&one.light[pair])
                                .for_each(|(a, b)| *a += (area * *b) as f32);
                            total.add(&one.shares[pair], area * tracer.solid(square));
                        }
                    }
                }
                progress.advance(chosen.len() as u64);
            }
        }
        Ok(Self {
            cells,
            channels: chip.sampling.channels.len(),
            bases: basis.len(),
            values,
            budget,
        })
    }
}

/// Shares of a channel's light at the chosen wavelengths, for each spectrum: channel, spectrum, wavelength.
fn weights(chip: &ChipInLight<'_>, basis: &[SceneSpectrum], chosen: &[usize]) -> Vec<Vec<f64>> {
    let nm: Vec<f64> = chosen.iter().map(|i| chip.sampling.wavelengths_nm[*i]).collect();
    let of = |channel: &ChannelSampling, spectrum: &SceneSpectrum| {
        let total: f64 = channel.parts.iter().map(|p| p.weight).sum();
        let mut sums = vec![0.0; nm.len()];
        for part in &channel.parts {
            let at = 0.5 * (part.nm[0] + part.nm[1]);
            let weight = part.weight / total * spectrum.at(at);
            let above = nm.partition_point(|n| *n <= at).clamp(1, nm.len() - 1);
            let share = ((at - nm[above - 1]) / (nm[above] - nm[above - 1])).clamp(0.0, 1.0);
            sums[above - 1] += weight * (1.0 - share);
            sums[above] += weight * share;
        }
        sums
    };
    let channels = chip.sampling.channels.iter();
    channels.flat_map(|c| basis.iter().map(move |b| of(c, b))).collect()
}

struct Tracer<'a> {
    chip: &'a ChipInLight<'a>,
    bank: &'a KernelBank,
    sensor: &'a Sensor,
    view: &'a SceneView,
    acceptance: Acceptance<'a>,
    cells: [usize; 2],
    chosen: &'a [usize],
    weights: &'a [Vec<f64>],
}

/// Light of one wavelength behind a distinct element.
struct DepartingLight {
    /// Each with how often it has the phase of the element.
    parts: Vec<(i32, LocalAngularSpectrum)>,
    /// Area of the light that arrives (um^2), as
    /// [`ElementInLight::arriving_um2`](crate::chip::ElementInLight::arriving_um2).
    arriving_um2: f64,
    /// Zeroth order, as [`ElementInLight::zero_order`](crate::chip::ElementInLight::zero_order).
    zero_order: f64,
}

/// The stray light of one square of the scene through one element, of what arrives there.
struct Traced {
    /// Light on each square of the sensor, by channel and spectrum.
    light: Vec<Vec<f64>>,
    shares: Vec<LightShares>,
}

impl Tracer<'_> {
    /// Middle of a square of the scene, in pixels of its picture.
    fn middle(&self, cell: usize) -> [f64; 2] {
        let at = |i: usize, n: usize| (i as f64 + 0.5) / SCENE_CELLS as f64 * n as f64 - 0.5;
        [
            at(cell / SCENE_CELLS, self.view.rows),
            at(cell % SCENE_CELLS, self.view.columns),
        ]
    }

    /// Projected solid angle of a square of the scene.
    fn solid(&self, cell: usize) -> f64 {
        let [row, column] = self.middle(cell);
        let pixels = (self.view.rows * self.view.columns) as f64 / (SCENE_CELLS * SCENE_CELLS) as f64;
        solid_angle(self.view, row, column) * pixels
    }

    fn trace(&self, element: usize, cell: usize, departed: &[DepartingLight]) -> Result<Traced> {
        let pairs = self.weights.len();
        let view: &ElementView = &self.chip.elements[element];
        let [row, column] = self.middle(cell);
        let sines = view.sines(self.view.tangents(row, column), self.view.distance_um);
        let size = self.cells[0] * self.cells[1];
        let mut traced = Traced {
            light: vec![vec![0.0; size]; pairs],
            shares: vec![LightShares::default(); pairs],
        };
        let spec = &self.bank.spec;
        // The field of the kernels, by the wavelength of the wedge.
        let place = view
            .landing_um(sines, view.wedge.wavelength_um)
            .filter(|p| p.iter().all(|v| v.abs() <= spec.reach_um))
            .map(|p| [spec.place(p[1]), spec.place(p[0])]);
        let maps: Vec<LandedLight> = self
            .chosen
            .iter()
            .zip(departed)
            .map(|(i, departed)| self.landed(element, *i, sines, departed, place))
            .collect::<Result<_>>()?;
        let bases = self.bank.bases;
        for pair in 0..pairs {
            let weights = &self.weights[pair];
            let in_kernel = place.map_or(0.0, |p| self.bank.energy(element, p, pair / bases, pair % bases));
            let masked = place.is_some();
            let sum = |of: &dyn Fn(&LandedLight) -> f64| weights.iter().zip(&maps).map(|(w, m)| w * of(m)).sum::<f64>();
            let travelling = sum(&|m| m.travelling);
            let outside = sum(&|m| if masked { m.outside } else { m.travelling });
            // What the kernel holds has been taken from the map where the image is: the rest has all that is left.
            let scale = ((travelling - in_kernel).max(0.0) / outside.max(f64::MIN_POSITIVE)).min(MOST_SCALE);
            let light = &mut traced.light[pair];
            for (w, map) in weights.iter().zip(&maps) {
                let cells = if masked { &map.cells_outside } else { &map.cells };
                for (at, v) in cells {
                    light[*at as usize] += w * scale * f64::from(*v);
                }
            }
            let on_sensor: f64 = light.iter().sum();
            let arrives: f64 = weights.iter().sum();
            traced.shares[pair] = LightShares {
                arrives,
                in_kernels: in_kernel,
                stray_light: on_sensor,
                beyond: scale * outside - on_sensor,
                evanescent: sum(&|m| m.evanescent),
                zero_order: sum(&|m| m.zero_order),
                not_passed: arrives - sum(&|m| m.travelling + m.evanescent),
            };
        }
        Ok(traced)
    }

    fn landed(
        &self,
        element: usize,
        wavelength: usize,
        sines: [f64; 2],
        departed: &DepartingLight,
        place: Option<[f64; 2]>,
    ) -> Result<LandedLight> {
        let view = &self.chip.elements[element];
        let um = self.chip.sampling.wavelengths_nm[wavelength] * 1e-3;
        let (base, turn) = self.chip.copies[element];
        let own = turn.inverse().vector(sines);
        let wave = PlaneWave {
            wavelength_um: um,
            sin_x: own[0],
            sin_y: own[1],
        };
        let focused = leaving(&self.chip.distinct[base].view.wedge, &wave);
        // What is not converted goes on as it came, and what diverges goes to the other side of that.
        let towards = |order: i32| match order {
            1 => focused,
            0 => own,
            _ => [0, 1].map(|a| 2.0 * own[a] - focused[a]),
        };
        let pixel = self.sensor.pixel_um;
        let cell_um = pixel * CELL_PIXELS as f64;
        // The middle of the sensor from this element's axis, and how far any of its corners is.
        let middle = [0, 1].map(|a| self.sensor.offset_um[a] - view.centre_um[a]);
        let half = [self.sensor.columns, self.sensor.rows].map(|n| 0.5 * f64::from(n) * pixel);
        let far = (0..2).map(|a| middle[a].abs() + half[a]).fold(0.0, f64::max);
        let grid = LandingGrid {
            cell_um,
            cells: 2 * (far / cell_um).ceil() as usize + 2,
            distance_um: view.distance_um([0.0; 2]),
        };
        let (order, departure) = &departed.parts[0];
        let mut landing = departure.landing(own, towards(*order), grid)?;
        for (order, departure) in &departed.parts[1..] {
            let other = departure.landing(own, towards(*order), grid)?;
            landing.power_um2 += &other.power_um2;
            landing.beyond_um2 += other.beyond_um2;
            landing.evanescent_um2 += other.evanescent_um2;
        }
        let share = 1.0 / departed.arriving_um2;
        let chief = place.and_then(|_| view.landing_um(sines, um));
        let window = 0.5 * self.bank.spec.window as f64 * pixel;
        let mut found = LandedLight {
            travelling: landing.travelling_um2() * share,
            evanescent: landing.evanescent_um2 * share,
            zero_order: departed.zero_order,
            ..LandedLight::default()
        };
        let mut inside = 0.0;
        let (mut all, mut outside) = (
            vec![0.0f32; self.cells[0] * self.cells[1]],
            vec![0.0f32; self.cells[0] * self.cells[1]],
        );
        for ((iy, ix), power) in landing.power_um2.indexed_iter() {
            if *power == 0.0 {
                continue;
            }
            let at = |i: usize| (i as f64 + 0.5 - 0.5 * grid.cells as f64) * cell_um;
            let here = turn.vector([at(ix), at(iy)]);
            let in_window = chief.is_some_and(|c| (0..2).all(|a| (here[a] - c[a]).abs() <= window));
            let power = power * share;
            if in_window {
                inside += power;
            }
            // Corner of the sensor's first square.
            let place = [0, 1].map(|a| (here[a] - middle[a] + half[a]) / cell_um - 0.5);
            let counted = power
                * self
                    .acceptance
                    .share(element, [0, 1].map(|a| here[a] + view.centre_um[a]));
            for (cy, wy) in neighbours(place[1], self.cells[0]) {
                for (cx, wx) in neighbours(place[0], self.cells[1]) {
                    let value = (counted * wy * wx) as f32;
                    all[cy * self.cells[1] + cx] += value;
                    if !in_window {
                        outside[cy * self.cells[1] + cx] += value;
                    }
                }
            }
        }
        found.outside = found.travelling - inside;
        found.cells = sparse(&all);
        found.cells_outside = sparse(&outside);
        Ok(found)
    }
}

/// More than this a masked map is not scaled up: where rays see next to nothing outside of a window, what a window
/// lacks has left it by diffraction, and is near it.
const MOST_SCALE: f64 = 50.0;

/// Light of one wavelength, square of the scene and element where it lands, as shares of what arrives.
#[derive(Default)]
struct LandedLight {
    cells: Vec<(u32, f32)>,
    /// Light without the window of the kernel.
    cells_outside: Vec<(u32, f32)>,
    travelling: f64,
    outside: f64,
    evanescent: f64,
    zero_order: f64,
}

fn sparse(cells: &[f32]) -> Vec<(u32, f32)> {
    let lit = cells.iter().enumerate().filter(|(_, v)| **v > 0.0);
    lit.map(|(i, v)| (i as u32, *v)).collect()
}

/// The squares on both sides of a place, with their weights; those that are there.
fn neighbours(place: f64, cells: usize) -> impl Iterator<Item = (usize, f64)> {
    let low = place.floor();
    let share = place - low;
    [(low, 1.0 - share), (low + 1.0, share)]
        .into_iter()
        .filter(move |(at, weight)| *at >= 0.0 && *at < cells as f64 && *weight > 0.0)
        .map(|(at, weight)| (at as usize, weight))
}
