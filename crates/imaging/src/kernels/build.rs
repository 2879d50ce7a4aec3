//! Kernels from the field behind each element.

use std::time::Instant;

use metalith_core::{Progress, Quiet, Result, numerical_aperture};
use metalith_optics::SharedFields;
use metalith_wave::kernels::FftScratch;
use metalith_wave::{Accuracy, PlaneWave, Psf, Scratch, Window};
use rayon::prelude::*;

use super::bank::{BankSpec, DistinctKernels, KernelBank, SMALL_UM};
use super::nodes::{BETWEEN_PARTS, FoundNodes, NodeKernels};
use super::spectrum::{MovedPart, QUARTERS, SpectrumPlan};
use crate::chip::{ChipInLight, ElementInLight};
use crate::geometry::ElementView;
use crate::kernel_parts::{KernelParts, NodeId};
use crate::spectra::SceneSpectrum;

/// Nodes that are found together at first; twice as many while these take less than a third of the time between two parts.
const FEWEST_NODES: usize = 16;
/// Most quarters of pixels of nodes that are found together: 256 MB.
const MOST_QUARTERS: usize = 1 << 26;

impl KernelBank {
    /// Checks that the kernels of a chip can be held, for so many spectra of a scene.
    ///
    /// # Errors
    /// As [`BankSpec::check_size`].
    pub fn check_size(chip: &ChipInLight<'_>, bases: usize, spec: &BankSpec) -> Result<()> {
        let sampling = &chip.sampling;
        let places = count(&orbits_of(chip, spec));
        spec.check_size(places, sampling.channels.len(), bases, sampling.wavelengths_nm.len())
    }

    /// Simulate the kernels of a chip for the spectra of a scene.
    ///
    /// # Errors
    /// If they would be too many, light cannot be brought to a window, or the user stopped it.
    pub fn build(
        chip: &ChipInLight<'_>,
        basis: &[SceneSpectrum],
        spec: BankSpec,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::build_in_parts(chip, basis, spec, &KernelParts::none(), progress)
    }

    /// Variant of [`KernelBank::build`] that stores what is found so far, and continues from what is stored.
    ///
    /// # Errors
    /// As [`KernelBank::build`]; if parts cannot be stored in a folder that was asked for.
    pub(crate) fn build_in_parts(
        chip: &ChipInLight<'_>,
        basis: &[SceneSpectrum],
        spec: BankSpec,
        parts: &KernelParts<'_>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let channel_um: Vec<f64> = chip.sampling.channels.iter().map(|c| c.mean_um()).collect();
        let orbits = orbits_of(chip, &spec);
        let count = count(&orbits);
        let wavelengths = chip.sampling.wavelengths_nm.len();
        spec.check_size(count, channel_um.len(), basis.len(), wavelengths)?;
        let side = spec.side();
        let sizes = [channel_um.len() * basis.len() * side * side, wavelengths];
        let counts: Vec<usize> = orbits.iter().map(|(unique, _)| unique.len()).collect();
        let nodes = FoundNodes::new(parts, &spec, &counts, sizes);
        progress.begin("simulating kernels", (nodes.wanted() * wavelengths) as u64);
        if nodes.wanted() < count {
            let there = count - nodes.wanted();
            progress.note(&format!("{there} of {count} places are from an interrupted run"));
        }
        let plan = SpectrumPlan::new(spec.window);
        let all: Vec<usize> = (0..wavelengths).collect();
        let simulate = || -> Result<()> {
            // One element after the other: what its sites transmit at all wavelengths is held while it is at work.
            for (element, (unique, _)) in orbits.iter().enumerate() {
                let missing = nodes.missing(element);
                if missing.is_empty() {
                    continue;
                }
                let builder = Builder {
                    element,
                    light: &nodes.timed(|| chip.in_light(element, &all, &Quiet(progress)))?,
                    view: chip.distinct[element].view,
                    chip,
                    basis,
                    spec: &spec,
                    plan: &plan,
                    channel_um: &channel_um,
                };
                builder.find(&missing, unique, &nodes, progress)?;
            }
            Ok(())
        };
        let done = simulate();
        if done.is_err() {
            nodes.store_fresh(progress)?;
        }
        done?;
        let mut distinct = Vec::new();
        for ((_, turned), found) in orbits.into_iter().zip(nodes.into_all()) {
            let mut kernels = DistinctKernels {
                nodes: turned,
                // At once: a list that grows has room for twice as many.
                values: Vec::with_capacity(found.iter().map(|n| n.values.len()).sum()),
                in_window: Vec::new(),
            };
            for node in found {
                kernels.values.extend(node.values);
                kernels.in_window.extend(node.in_window);
            }
            distinct.push(kernels);
        }
        Ok(Self {
            spec,
            channel_um,
            bases: basis.len(),
            elements: chip.copies.clone(),
            distinct,
        })
    }
}

type Turned = (usize, metalith_design::array::Symmetry);

/// Nodes that no symmetry turns into one another, and for each node which of them it is, and turned how.
type Orbits = (Vec<[usize; 2]>, Vec<Turned>);

/// Orbits of each distinct element.
fn orbits_of(chip: &ChipInLight<'_>, spec: &BankSpec) -> Vec<Orbits> {
    let of_each = chip.distinct.iter();
    of_each.map(|d| orbits(spec.nodes, &d.symmetries)).collect()
}

fn count(orbits: &[Orbits]) -> usize {
    orbits.iter().map(|(unique, _)| unique.len()).sum()
}

fn orbits(n: usize, symmetries: &[metalith_design::array::Symmetry]) -> Orbits {
    let last = n as i64 - 1;
    let mut unique = Vec::new();
    let mut nodes: Vec<Option<Turned>> = vec![None; n * n];
    for i in 0..n * n {
        if nodes[i].is_some() {
            continue;
        }
        for turn in symmetries {
            let (x, y) = turn.point(2 * (i % n) as i64 - last, 2 * (i / n) as i64 - last);
            let at = ((y + last) / 2) as usize * n + ((x + last) / 2) as usize;
            nodes[at].get_or_insert((unique.len(), *turn));
        }
        unique.push([i / n, i % n]);
    }
    let nodes = nodes.into_iter().map(|node| node.expect("the identity is a symmetry"));
    (unique, nodes.collect())
}

/// Kernels of one distinct element.
struct Builder<'a> {
    element: usize,
    chip: &'a ChipInLight<'a>,
    light: &'a ElementInLight<'a>,
    view: ElementView,
    basis: &'a [SceneSpectrum],
    spec: &'a BankSpec,
    plan: &'a SpectrumPlan,
    channel_um: &'a [f64],
}

impl Builder<'_> {
    /// Find the kernels of missing nodes, of the unique ones of the element. One wavelength after the other is simulated for some nodes
    /// at a time: the spectrum of the element is that of all directions, and not all wavelengths' are held.
    fn find(
        &self,
        missing: &[usize],
        unique: &[[usize; 2]],
        nodes: &FoundNodes<'_>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let wavelengths = self.chip.sampling.wavelengths_nm.len();
        let held = MOST_QUARTERS / (wavelengths * (self.spec.window * QUARTERS).pow(2));
        let (mut rest, mut at_once) = (missing, FEWEST_NODES);
        while !rest.is_empty() {
            let begun = Instant::now();
            let (now, later) = rest.split_at(at_once.min(held.max(1)).min(rest.len()));
            let mut quarters = vec![Vec::with_capacity(wavelengths); now.len()];
            for wavelength in 0..wavelengths {
                let found = self.quarters_of(wavelength, now, unique, nodes, progress)?;
                quarters
                    .iter_mut()
                    .zip(found)
                    .for_each(|(node, found)| node.push(found));
            }
            now.par_iter()
                .zip(quarters)
                .try_for_each_init(FftScratch::default, |fft, (node, quarters)| {
                    let id = NodeId {
                        element: self.element,
                        node: *node,
                    };
                    nodes.add(id, self.kernels(self.sines(unique[*node]), &quarters, fft), progress)
                })?;
            if begun.elapsed() < BETWEEN_PARTS / 3 {
                at_once *= 2;
            }
            rest = later;
        }
        Ok(())
    }

    /// Quarters of some nodes at a wavelength.
    fn quarters_of(
        &self,
        wavelength: usize,
        now: &[usize],
        unique: &[[usize; 2]],
        nodes: &FoundNodes<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<f32>>> {
        progress.check_stopped()?;
        // All directions of the element decide its plan: figures are the same whichever are found together.
        let seen: Vec<Option<Seen>> = unique
            .iter()
            .map(|node| self.seen(wavelength, self.sines(*node)))
            .collect();
        let all: Vec<(PlaneWave, Window)> = seen.iter().flatten().map(|seen| (seen.wave, seen.window)).collect();
        let shared = match self.light.lit_of_all_directions(wavelength).filter(|_| !all.is_empty()) {
            Some(fields) => Some(SharedFields::new(fields, self.accuracy(), &all)?),
            None => None,
        };
        now.par_iter()
            .map_init(Scratch::default, |scratch, node| {
                progress.check_stopped()?;
                let side = self.spec.window * QUARTERS;
                let quarters = match (&seen[*node], &shared) {
                    (None, _) => vec![0.0; side * side],
                    (Some(Seen { wave, window, .. }), Some(shared)) => {
                        self.quarters(&shared.psf(*wave, *window, scratch)?, wavelength)
                    }
                    (Some(Seen { sines, window, .. }), None) => {
                        let lit = self.light.lit(wavelength, *sines);
                        self.quarters(&lit.psf(*window, self.accuracy(), &[], scratch)?, wavelength)
                    }
                };
                nodes.advance(progress);
                Ok(quarters)
            })
            .collect()
    }

    /// Kernels of a node by its quarters at each wavelength.
    fn kernels(&self, sines: [f64; 2], quarters: &[Vec<f32>], fft: &mut FftScratch) -> NodeKernels {
        let in_window = quarters
            .iter()
            .map(|all| all.iter().map(|v| f64::from(*v)).sum::<f64>() as f32);
        let spectra: Vec<_> = quarters.iter().map(|all| self.plan.spectrum(all, fft)).collect();
        let mut values = Vec::new();
        for (channel, reference_um) in self.chip.sampling.channels.iter().zip(self.channel_um) {
            let parts = self.parts(sines, channel, *reference_um);
            let kernels = self.plan.kernels(&spectra, &parts, self.basis, fft);
            values.extend(kernels.into_iter().flatten());
        }
        NodeKernels {
            values,
            in_window: in_window.collect(),
        }
    }

    /// Direction that the light of a node arrives from.
    fn sines(&self, node: [usize; 2]) -> [f64; 2] {
        let place = [self.spec.node_um(node[1]), self.spec.node_um(node[0])];
        self.view.sines_of_landing(place, self.view.wedge.wavelength_um)
    }

    fn accuracy(&self) -> Accuracy {
        if self.spec.accurate || self.light.radius_um() < SMALL_UM {
            Accuracy::Accurate
        } else {
            Accuracy::Fast
        }
    }

    fn parts(&self, sines: [f64; 2], channel: &metalith_sensor::ChannelSampling, reference_um: f64) -> Vec<MovedPart> {
        let view = self.view;
        let Some(from) = view.landing_um(sines, reference_um) else {
            return Vec::new();
        };
        let total: f64 = channel.parts.iter().map(|p| p.weight).sum();
        let parts = channel.parts.iter().filter_map(|part| {
            let to = view.landing_um(sines, 0.5e-3 * (part.nm[0] + part.nm[1]))?;
            let offset = [0, 1].map(|a| (to[a] - from[a]) / self.spec.pixel_um);
            let blended = self.chip.sampling.blended(part.place);
            Some(MovedPart::new(part, total, blended, offset))
        });
        parts.collect()
    }

    /// Light of one wavelength from a direction, and the window about its chief ray; nothing where that does not reach the sensor.
    fn seen(&self, wavelength: usize, sines: [f64; 2]) -> Option<Seen> {
        let view = self.view;
        let um = self.chip.sampling.wavelengths_nm[wavelength] * 1e-3;
        if sines[0].hypot(sines[1]) >= 1.0 {
            return None;
        }
        let landing = view.landing_um(sines, um)?;
        // The PSF has no structure finer than wavelength / (2 NA).
        let aperture = numerical_aperture(self.light.radius_um(), view.sensor_um);
        let quarter = self.spec.pixel_um / QUARTERS as f64;
        let within = (quarter * 4.0 * aperture / um).ceil().max(1.0) as usize;
        Some(Seen {
            sines,
            wave: self.light.arriving(wavelength, sines).plane,
            window: Window {
                centre_um: landing,
                step_um: quarter / within as f64,
                samples: self.spec.window * QUARTERS * within,
                distance_um: view.distance_um(landing),
            },
        })
    }

    /// Share of the light of one wavelength in each quarter of the pixels of a PSF.
    fn quarters(&self, psf: &Psf, wavelength: usize) -> Vec<f32> {
        let side = self.spec.window * QUARTERS;
        let within = psf.window.samples / side;
        let mut quarters = vec![0.0f32; side * side];
        let share = psf.window.step_um.powi(2) / self.light.arriving_um2(wavelength);
        for (iy, row) in psf.values.rows().into_iter().enumerate() {
            let out = &mut quarters[iy / within * side..][..side];
            for (ix, v) in row.iter().enumerate() {
                out[ix / within] += (v * share) as f32;
            }
        }
        quarters
    }
}

/// Light of one wavelength that arrives at an element for a node.
struct Seen {
    sines: [f64; 2],
    wave: PlaneWave,
    /// Window about its chief ray.
    window: Window,
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_design::array::Symmetry;

    #[test]
    fn nodes_fall_into_orbits() {
        let (unique, nodes) = orbits(5, &Symmetry::ALL);
        assert_eq!(unique.len(), 6);
        for (i, (k, turn)) in nodes.iter().enumerate() {
            let [row, column] = unique[*k];
            let (x, y) = turn.point(2 * column as i64 - 4, 2 * row as i64 - 4);
            assert_eq!([(y + 4) / 2, (x + 4) / 2], [(i / 5) as i64, (i % 5) as i64]);
        }
        assert_eq!(orbits(5, &[Symmetry::IDENTITY]).0.len(), 25);
    }
}
