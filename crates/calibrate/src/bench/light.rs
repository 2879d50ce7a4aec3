//! Light from the lamps through the pillars to the windows of the camera.

use std::sync::Arc;

use num_complex::Complex32;
use rayon::prelude::*;

use super::sites::{Sites, legendre};
use super::{Bench, Group};
use crate::cells::CellTable;
use crate::departure::{Geometry, LightChange, PathChange};
use crate::optics::{Passed, Scratch, cis};
use crate::set::{ElementIndex, PerCapture};
use crate::zernike;
use metalith_core::{Error, Lattice, Progress, Result};

/// A chip as it may be, and the lamps that it is seen by.
pub struct Lit<'a> {
    pub cells: Arc<CellTable>,
    pub geometry: &'a Geometry,
    pub lights: Vec<&'a LightChange>,
    /// Seed of the places of missing pillars; without one, their mean is counted with.
    pub scatter: Option<u64>,
}

/// What an element passes, but for wavelength.
struct Element {
    sites: Sites,
    /// Optical path added over the lens [um]; empty for none.
    path_um: Vec<f32>,
}

impl Bench<'_> {
    /// Intensity around the window of each capture, for each chip and each of its lamps:
    /// by chip, light and capture, each a square of samples. Chips on one path share the work of carrying light along it.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn intensities(
        &self,
        chips: &[Lit<'_>],
        path: &PathChange,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<PerCapture<Vec<f32>>>>> {
        let elements: Vec<Vec<Element>> = (0..self.set.elements.len())
            .into_par_iter()
            .map(|e| chips.iter().map(|chip| self.element(e.into(), chip)).collect())
            .collect();
        let tasks: Vec<_> = self
            .groups
            .par_iter()
            .map(|group| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                Ok(self.group(group, chips, &elements[usize::from(group.element)], path))
            })
            .collect::<Result<_>>()?;
        let mut out: Vec<_> = chips
            .iter()
            .map(|chip| vec![PerCapture::from(vec![Vec::new(); self.set.captures.len()]); chip.lights.len()])
            .collect();
        for (group, of_chips) in self.groups.iter().zip(tasks) {
            for (out, of_lights) in out.iter_mut().zip(of_chips) {
                for (out, planes) in out.iter_mut().zip(of_lights) {
                    for (plane, &capture) in planes.into_iter().zip(&group.captures) {
                        out[capture] = plane;
                    }
                }
            }
        }
        Ok(out)
    }

    fn element(&self, element: ElementIndex, chip: &Lit<'_>) -> Element {
        let geometry = chip.geometry;
        let measured = &self.set.elements[element];
        let path_um = if geometry.wavefront_nm.is_empty() {
            Vec::new()
        } else {
            let radius_um = 0.5 * measured.aperture_diameter_um;
            zernike::map(&geometry.wavefront_nm, measured.pillars.lattice, radius_um)
        };
        let mut sites = self.sites(element, geometry);
        if let Some(seed) = chip.scatter {
            sites.fell(geometry.missing_pillars, seed + usize::from(element) as u64);
        }
        Element { sites, path_um }
    }

    /// `[chip][light][distance][sample]` of one group.
    fn group(
        &self,
        group: &Group,
        chips: &[Lit<'_>],
        elements: &[Element],
        path: &PathChange,
    ) -> Vec<Vec<Vec<Vec<f32>>>> {
        let lattice = self.set.elements[group.element].pillars.lattice;
        let n = lattice.sites();
        let distances: Vec<f64> = group
            .captures
            .iter()
            .map(|&c| self.set.captures[c].distance_um + path.gap_um)
            .collect();
        let quadrature = &self.quadratures[group.led];
        let weights: Vec<Vec<Vec<f64>>> = chips
            .iter()
            .map(|chip| {
                let of = |l: &&LightChange| quadrature.weights(l.shift_nm(group.led.into()), 1.0 + l.led_width);
                chip.lights.iter().map(of).collect()
            })
            .collect();
        let samples = group.plan.window() * group.plan.window();
        let mut sums: Vec<_> = chips
            .iter()
            .map(|chip| vec![vec![vec![0.0f32; samples]; distances.len()]; chip.lights.len()])
            .collect();
        let mut scratch = Scratch::default();
        let mut planes = vec![vec![Vec::new(); distances.len()]; chips.len()];
        for (k, nm) in quadrature.wavelengths_nm.iter().enumerate() {
            let um = nm * 1e-3;
            let (wx, wy) = (
                self.wave(group, path, lattice, 0, um),
                self.wave(group, path, lattice, 1, um),
            );
            let (tables, hazes): (Vec<_>, Vec<_>) = chips
                .iter()
                .zip(elements)
                .map(|(chip, element)| self.passed(chip, &element.sites, self.first[group.led] + k))
                .unzip();
            let fills: Vec<Box<Passed<'_>>> = tables
                .iter()
                .zip(elements)
                .map(|(table, element)| {
                    let (wx, wy) = (&wx, &wy);
                    let fill = move |iy: usize, row: &mut [Complex32]| {
                        let classes = &element.sites.class[iy * n..(iy + 1) * n];
                        for ((to, &class), x) in row.iter_mut().zip(classes).zip(wx) {
                            *to = table[usize::from(class)] * x * wy[iy];
                        }
                        if !element.path_um.is_empty() {
                            for (to, p) in row.iter_mut().zip(&element.path_um[iy * n..]) {
                                *to *= cis(f64::from(*p) / um);
                            }
                        }
                    };
                    Box::new(fill) as Box<Passed<'_>>
                })
                .collect();
            let fills: Vec<&Passed<'_>> = fills.iter().map(|f| &**f).collect();
            group
                .plan
                .intensities(um, &distances, &fills, &mut scratch, &mut planes);
            for (i, planes) in planes.iter_mut().enumerate() {
                for (d, plane) in planes.iter_mut().enumerate() {
                    let level = hazes[i] * spread(group, lattice, distances[d], um);
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

    /// The wave that arrives, along one axis.
    fn wave(&self, group: &Group, path: &PathChange, lattice: Lattice, axis: usize, um: f64) -> Vec<Complex32> {
        let sine = (group.aoi_rad[axis] + path.tilt_mrad[axis] * 1e-3).sin();
        (0..lattice.sites())
            .map(|i| {
                let x = lattice.coordinate_um(i);
                // A source at a finite distance adds the sag of its sphere; 1 / m is 1e-6 / um.
                cis((x * sine + 0.5e-6 * path.source_per_m * x * x) / um)
            })
            .collect()
    }

    /// What each class of sites passes, and the power that missing pillars scatter.
    fn passed(&self, chip: &Lit<'_>, sites: &Sites, wavelength: usize) -> (Vec<Complex32>, f64) {
        let (narrow, wide) = self.widths_nm();
        let bare = chip.cells.bare(wavelength);
        let missing = if chip.scatter.is_some() {
            0.0
        } else {
            chip.geometry.missing_pillars
        };
        let unstructured = chip.geometry.unstructured();
        let unstructured = Complex32::new(unstructured.re as f32, unstructured.im as f32);
        let mut haze = 0.0f64;
        let table = sites
            .width_nm
            .iter()
            .zip(&sites.count)
            .enumerate()
            .map(|(class, (width, &count))| {
                if class == 0 {
                    return Complex32::ZERO;
                }
                let place = (2.0 * width - narrow - wide) / (wide - narrow).max(1.0);
                let free = (1.0 + legendre(&chip.geometry.transmission, place)) as f32;
                let t = if *width > 0.0 {
                    chip.cells.at(wavelength, *width) * free
                } else {
                    bare
                };
                haze += f64::from(count) * f64::from((t - bare).norm_sqr());
                t + (bare - t) * missing as f32 + unstructured
            })
            .collect();
        // What missing pillars take from the wave they scatter, each on its own.
        (table, missing * (1.0 - missing) * haze)
    }
}

/// Intensity in the middle of a window for a unit of power that one site scatters on its own.
fn spread(group: &Group, lattice: Lattice, distance_um: f64, um: f64) -> f64 {
    let [x, y] = group.centre_um;
    let r2 = x * x + y * y + distance_um * distance_um;
    (lattice.pitch_um().powi(2) / (um * r2) * distance_um).powi(2)
}
