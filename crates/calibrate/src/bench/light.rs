//! Light from the LEDs through the pillars to the windows of the camera.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::{Bench, FocusSeries};
use crate::cells::PillarTable;
use crate::set::{ElementIndex, PerCapture};
use metalith_core::{Error, Lattice, Progress, Result};
use metalith_made::{
    ArrivingLight, ClassTable, GeometryChange, LightChange, MadeAperture, MadeElement, PathChange, spread,
};
use metalith_wave::propagation::DistancesScratch;
use metalith_wave::{Aperture, PlaneWave};

/// Memory for elements as they are made, all chips that are worked on at once together (bytes): eight chips with one lens
/// of 1 mm.
const MADE_BYTES: usize = 1_200_000_000;

/// What an element on a lattice takes as it is made (bytes).
fn made_bytes(lattice: Lattice) -> usize {
    MadeElement::MOST_BYTES_PER_SITE * lattice.sites() * lattice.sites()
}

/// A candidate chip, and the light that it is illuminated with.
pub struct Lit<'a> {
    pub cells: Arc<PillarTable>,
    /// Those at the rim of each lens, to the tops of the pillars in its middle, where they differ.
    pub rim: Option<Arc<PillarTable>>,
    pub geometry: &'a GeometryChange,
    pub lights: Vec<&'a LightChange>,
    /// Seed of the random positions of missing pillars; without one, their mean effect is used.
    pub scatter: Option<u64>,
}

impl Bench<'_> {
    /// Intensity around the window of each capture, `[chip][light][capture]`, each a square of samples. Chips with the
    /// same light path share the cost of propagation.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn intensities(
        &self,
        chips: &[Lit<'_>],
        path: &PathChange,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<PerCapture<Vec<f32>>>>> {
        let mut out: Vec<_> = chips
            .iter()
            .map(|chip| vec![PerCapture::from(vec![Vec::new(); self.set.captures.len()]); chip.lights.len()])
            .collect();
        for batch in self.batches(chips.len()) {
            let elements: Vec<Vec<MadeElement>> = batch
                .clone()
                .into_par_iter()
                .map(|e| {
                    chips
                        .iter()
                        .map(|chip| self.element(e.into(), chip))
                        .collect::<Result<_>>()
                })
                .collect::<Result<_>>()?;
            let groups: Vec<&FocusSeries> = self
                .groups
                .iter()
                .filter(|g| batch.contains(&usize::from(g.element)))
                .collect();
            let tasks: Vec<_> = groups
                .par_iter()
                .map(|group| {
                    if progress.stopped() {
                        return Err(Error::Interrupted);
                    }
                    let own = usize::from(group.element) - batch.start;
                    Ok(self.group(group, chips, &elements[own], path))
                })
                .collect::<Result<_>>()?;
            for (group, of_chips) in groups.into_iter().zip(tasks) {
                for (out, of_lights) in out.iter_mut().zip(of_chips) {
                    for (out, planes) in out.iter_mut().zip(of_lights) {
                        for (plane, &capture) in planes.into_iter().zip(&group.captures) {
                            out[capture] = plane;
                        }
                    }
                }
            }
        }
        Ok(out)
    }

    /// Elements whose versions for so many chips are held at once: as many as [`MADE_BYTES`] hold, one at least.
    fn batches(&self, chips: usize) -> Vec<Range<usize>> {
        let mut out: Vec<Range<usize>> = Vec::new();
        let mut held = 0;
        for (e, element) in self.set.elements.iter().enumerate() {
            let bytes = chips * made_bytes(element.pillars.lattice);
            match out.last_mut() {
                Some(last) if held + bytes <= MADE_BYTES => {
                    last.end = e + 1;
                    held += bytes;
                }
                _ => {
                    out.push(e..e + 1);
                    held = bytes;
                }
            }
        }
        out
    }

    /// Chips of which 1.2 GB hold the largest element, one at least.
    pub fn chips_at_once(&self) -> usize {
        let largest = self.set.elements.iter().map(|e| made_bytes(e.pillars.lattice)).max();
        (MADE_BYTES / largest.unwrap_or(1).max(1)).max(1)
    }

    /// An element of a candidate chip.
    pub(super) fn element(&self, element: ElementIndex, chip: &Lit<'_>) -> Result<MadeElement> {
        let made = MadeElement::new(&self.drawn[element], chip.geometry)?;
        Ok(match chip.scatter {
            Some(seed) => made.with_pillars_removed(seed + usize::from(element) as u64),
            None => made,
        })
    }

    /// `[chip][light][distance][sample]` of one focus series.
    fn group(
        &self,
        group: &FocusSeries,
        chips: &[Lit<'_>],
        elements: &[MadeElement],
        path: &PathChange,
    ) -> Vec<Vec<Vec<Vec<f32>>>> {
        let lattice = self.set.elements[group.element].pillars.lattice;
        let farther_um = path.added_distance_um(self.set.elements[group.element].centre_um);
        let distances: Vec<f64> = group
            .captures
            .iter()
            .map(|&c| self.set.captures[c].distance_um + farther_um)
            .collect();
        let quadrature = &self.quadratures[group.led];
        let weights: Vec<Vec<Vec<f64>>> = chips
            .iter()
            .map(|chip| {
                let of = |l: &&LightChange| quadrature.weights(group.led.into(), l);
                chip.lights.iter().map(of).collect()
            })
            .collect();
        let samples = group.plan.window() * group.plan.window();
        let mut sums: Vec<_> = chips
            .iter()
            .map(|chip| vec![vec![vec![0.0f32; samples]; distances.len()]; chip.lights.len()])
            .collect();
        let mut scratch = DistancesScratch::default();
        let mut planes = vec![vec![Vec::new(); distances.len()]; chips.len()];
        for (k, nm) in quadrature.wavelengths_nm.iter().enumerate() {
            let um = nm * 1e-3;
            let light = light(group, path, um);
            let (wx, wy) = (light.along(lattice, 0), light.along(lattice, 1));
            let tables: Vec<ClassTable> = chips
                .iter()
                .zip(elements)
                .map(|(chip, element)| table(chip, element, self.first[group.led] + k))
                .collect();
            let apertures: Vec<MadeAperture<'_>> = tables
                .iter()
                .zip(elements)
                .map(|(table, element)| element.aperture(table, um))
                .collect();
            let apertures: Vec<&dyn Aperture> = apertures.iter().map(|a| a as &dyn Aperture).collect();
            group
                .plan
                .intensities(um, &distances, [&wx, &wy], &apertures, &mut scratch, &mut planes);
            for (i, planes) in planes.iter_mut().enumerate() {
                for (d, plane) in planes.iter_mut().enumerate() {
                    let level = tables[i].scattered * scattered_to(group, lattice, distances[d], um);
                    if level > 0.0 {
                        plane.iter_mut().for_each(|v| *v += level as f32);
                    }
                    for (sum, weights) in sums[i].iter_mut().zip(&weights[i]) {
                        let w = weights[k] as f32;
                        for (to, v) in sum[d].iter_mut().zip(plane.iter()) {
                            *to += w * v;
                        }
                    }
                }
            }
        }
        sums
    }
}

/// The incident wave at the element of a focus series.
pub(super) fn light(group: &FocusSeries, path: &PathChange, wavelength_um: f64) -> ArrivingLight {
    let [sin_x, sin_y] = group.aoi_rad.map(f64::sin);
    let stated = PlaneWave {
        wavelength_um,
        sin_x,
        sin_y,
    };
    ArrivingLight::new(&stated, path)
}

/// Transmission of the sites of an element at one of the wavelengths.
fn table(chip: &Lit<'_>, element: &MadeElement, wavelength: usize) -> ClassTable {
    let of = |cells: &PillarTable| element.table(|width| cells.at(wavelength, width), cells.bare[wavelength]);
    let mut table = of(&chip.cells);
    if let Some(rim) = &chip.rim {
        table.set_rim(&of(rim));
    }
    table
}

/// Intensity at the centre of the window of a focus series for a unit of |t|^2 that one site scatters incoherently.
fn scattered_to(group: &FocusSeries, lattice: Lattice, distance_um: f64, wavelength_um: f64) -> f64 {
    spread(lattice.cell_um2(), group.centre_um, distance_um, wavelength_um)
}
