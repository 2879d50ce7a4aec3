//! Kernels from the field behind each element.

use metalith_core::{Progress, Result, numerical_aperture};
use metalith_wave::kernels::FftScratch;
use metalith_wave::{Accuracy, Scratch, Window};
use rayon::prelude::*;

use super::bank::{BankSpec, DistinctKernels, KernelBank, SMALL_UM};
use super::nodes::{FoundNodes, NodeKernels};
use super::spectrum::{MovedPart, QUARTERS, SpectrumPlan};
use crate::chip::{ChipInLight, ElementInLight};
use crate::geometry::ElementView;
use crate::kernel_parts::{KernelParts, NodeId};
use crate::spectra::SceneSpectrum;

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
                    light: &nodes.timed(|| chip.in_light(element, &all, progress))?,
                    view: chip.distinct[element].view,
                    chip,
                    basis,
                    spec: &spec,
                    plan: &plan,
                    channel_um: &channel_um,
                };
                missing.par_iter().try_for_each_init(
                    || (Scratch::default(), FftScratch::default()),
                    |(scratch, fft), node| {
                        let kernels = builder.node(unique[*node], scratch, fft, (&nodes, progress))?;
                        nodes.add(NodeId { element, node: *node }, kernels, progress)
                    },
                )?;
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
    chip: &'a ChipInLight<'a>,
    light: &'a ElementInLight<'a>,
    view: ElementView,
    basis: &'a [SceneSpectrum],
    spec: &'a BankSpec,
    plan: &'a SpectrumPlan,
    channel_um: &'a [f64],
}

impl Builder<'_> {
    fn node(
        &self,
        node: [usize; 2],
        scratch: &mut Scratch,
        fft: &mut FftScratch,
        (nodes, progress): (&FoundNodes<'_>, &dyn Progress),
    ) -> Result<NodeKernels> {
        let view = self.view;
        let place = [self.spec.node_um(node[1]), self.spec.node_um(node[0])];
        let sines = view.sines_of_landing(place, view.wedge.wavelength_um);
        let (mut spectra, mut in_window) = (Vec::new(), Vec::new());
        for (i, nm) in self.chip.sampling.wavelengths_nm.iter().enumerate() {
            progress.check_stopped()?;
            let quarters = self.quarters(i, nm * 1e-3, sines, scratch)?;
            in_window.push(quarters.iter().map(|v| f64::from(*v)).sum::<f64>() as f32);
            spectra.push(self.plan.spectrum(&quarters, fft));
            nodes.advance(progress);
        }
        let mut values = Vec::new();
        for (channel, reference_um) in self.chip.sampling.channels.iter().zip(self.channel_um) {
            let parts = self.parts(sines, channel, *reference_um);
            let kernels = self.plan.kernels(&spectra, &parts, self.basis, fft);
            values.extend(kernels.into_iter().flatten());
        }
        Ok(NodeKernels { values, in_window })
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

    /// Share of the light of one wavelength in each quarter of the pixels about its chief ray; nothing where that does
    /// not reach the sensor.
    fn quarters(&self, wavelength: usize, um: f64, sines: [f64; 2], scratch: &mut Scratch) -> Result<Vec<f32>> {
        let side = self.spec.window * QUARTERS;
        let view = self.view;
        let mut quarters = vec![0.0f32; side * side];
        if sines[0].hypot(sines[1]) >= 1.0 {
            return Ok(quarters);
        }
        let Some(landing) = view.landing_um(sines, um) else {
            return Ok(quarters);
        };
        let lit = self.light.lit(wavelength, sines);
        // The PSF has no structure finer than wavelength / (2 NA).
        let aperture = numerical_aperture(lit.radius_um(), view.sensor_um);
        let quarter = self.spec.pixel_um / QUARTERS as f64;
        let within = (quarter * 4.0 * aperture / um).ceil().max(1.0) as usize;
        let window = Window {
            centre_um: landing,
            step_um: quarter / within as f64,
            samples: side * within,
            distance_um: view.distance_um(landing),
        };
        let accuracy = if self.spec.accurate || lit.radius_um() < SMALL_UM {
            Accuracy::Accurate
        } else {
            Accuracy::Fast
        };
        let psf = lit.psf(window, accuracy, &[], scratch)?;
        let share = window.step_um.powi(2) / self.light.arriving_um2(wavelength);
        for (iy, row) in psf.values.rows().into_iter().enumerate() {
            let out = &mut quarters[iy / within * side..][..side];
            for (ix, v) in row.iter().enumerate() {
                out[ix / within] += (v * share) as f32;
            }
        }
        Ok(quarters)
    }
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
