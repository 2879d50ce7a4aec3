//! Light from the LEDs through the pillars to the windows of the camera.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::{Bench, FocusSeries};
use crate::cells::PillarTable;
use crate::set::{ElementIndex, PerMeasurement};
use metalith_core::{Progress, Result};
use metalith_optics::{
    ArrivingLight, AsBuiltAperture, AsBuiltElement, ClassTable, GeometryChange, LightChange, PathChange, spread,
};
use metalith_pillars::Lattice;
use metalith_wave::propagation::DistancesScratch;
use metalith_wave::{Aperture, PlaneWave};

/// Memory for elements as they are made, all chips that are worked on at once together (bytes): eight chips with one lens
/// of 1 mm.
const MADE_BYTES: usize = 1_200_000_000;

/// Memory of an element on a lattice while it is made (bytes).
fn made_bytes(lattice: Lattice) -> usize {
    AsBuiltElement::MOST_BYTES_PER_SITE * lattice.sites() * lattice.sites()
}

/// A candidate chip, and the light that it is illuminated with.
pub struct IlluminatedChip<'a> {
    pub cells: Arc<PillarTable>,
    /// Those at the rim of each lens, to the tops of the pillars in its middle, where they differ.
    pub rim: Option<Arc<PillarTable>>,
    pub geometry: &'a GeometryChange,
    pub lights: Vec<&'a LightChange>,
    /// Every so many wavelengths of each spectrum are taken: 1 for all.
    pub every: usize,
    /// Seed of the random positions of missing pillars; without one, their mean effect is used.
    pub scatter: Option<u64>,
}

impl Bench<'_> {
    /// Intensity around the window of each measurement, `[chip][light][measurement]`, each a square of samples. Chips with the
    /// same light path share the cost of propagation.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn intensities(
        &self,
        chips: &[IlluminatedChip<'_>],
        path: &PathChange,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<PerMeasurement<Vec<f32>>>>> {
        let mut out: Vec<_> = chips
            .iter()
            .map(|chip| vec![PerMeasurement::from(vec![Vec::new(); self.set.measurements.len()]); chip.lights.len()])
            .collect();
        for batch in self.batches(chips.len()) {
            let elements: Vec<Vec<AsBuiltElement>> = batch
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
                    progress.check_stopped()?;
                    let own = usize::from(group.element) - batch.start;
                    Ok(self.group(group, chips, &elements[own], path))
                })
                .collect::<Result<_>>()?;
            for (group, of_chips) in groups.into_iter().zip(tasks) {
                for (out, of_lights) in out.iter_mut().zip(of_chips) {
                    for (out, planes) in out.iter_mut().zip(of_lights) {
                        for (plane, &measurement) in planes.into_iter().zip(&group.measurements) {
                            out[measurement] = plane;
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
    pub(super) fn element(&self, element: ElementIndex, chip: &IlluminatedChip<'_>) -> Result<AsBuiltElement> {
        let made = AsBuiltElement::new(&self.drawn[element], chip.geometry)?;
        Ok(match chip.scatter {
            Some(seed) => made.with_pillars_removed(seed + usize::from(element) as u64),
            None => made,
        })
    }

    /// `[chip][light][distance][sample]` of one focus series.
    fn group(
        &self,
        group: &FocusSeries,
        chips: &[IlluminatedChip<'_>],
        elements: &[AsBuiltElement],
        path: &PathChange,
    ) -> Vec<Vec<Vec<Vec<f32>>>> {
        let lattice = self.set.elements[group.element].pillars.lattice;
        let farther_um = path.added_distance_um(self.set.elements[group.element].centre_um);
        let distances: Vec<f64> = group
            .measurements
            .iter()
            .map(|&c| self.set.measurements[c].distance_um + farther_um)
            .collect();
        let quadrature = &self.quadratures[group.led];
        let weights: Vec<Vec<Vec<f64>>> = chips
            .iter()
            .map(|chip| {
                let of = |l: &&LightChange| quadrature.weights(group.led.into(), l, chip.every);
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
            let apertures: Vec<AsBuiltAperture<'_>> = tables
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
fn table(chip: &IlluminatedChip<'_>, element: &AsBuiltElement, wavelength: usize) -> ClassTable {
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

#[cfg(test)]
mod tests {
    use metalith_core::Silent;
    use metalith_design::{Design, PillarArray};
    use metalith_gds::extract::PillarsAt;
    use metalith_layout::write_pillars;
    use metalith_optics::Stitching;
    use metalith_pillars::PillarReader;
    use metalith_wave::Direct;
    use num_complex::Complex64;

    use super::*;
    use crate::bench::BenchSampling;
    use crate::set::{BenchLed, ElementIndex, LedIndex, MeasuredElement, MeasuredSet, Measurement, Stack};

    /// A small lens of the shipped hexagonal design, as a session of one line of 1550 nm that looks at it from the side, on the
    /// axis and beside it.
    fn hexagonal_set() -> MeasuredSet {
        let path = metalith_testing::design("hexagonal_1550");
        let text = std::fs::read_to_string(&path).unwrap();
        let small = text
            .replace("diameter_um = 160", "diameter_um = 30")
            .replace("focal_length_um = 240", "focal_length_um = 45");
        let design = Design::parse(&path, &small).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let layout = folder.path().join("layout.gds");
        let array = PillarArray::build(&design, &Silent).unwrap();
        write_pillars(&design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
        let sites = design.sites_of(&design.elements());
        let layer = design.layout.layers.pillars.number();
        let maps = PillarsAt::STATED
            .pillars(&layout, layer, design.cell.shape, &sites, &Silent)
            .unwrap();
        let mut set = MeasuredSet::read(
            &metalith_testing::session::small_set(folder.path()),
            &PillarsAt::STATED,
            &Silent,
        )
        .unwrap();
        set.stack = Stack {
            cell: design.cell_stack().unwrap(),
            lens_diameter_um: 30.0,
            focal_length_um: 45.0,
        };
        set.leds = vec![BenchLed {
            centre_nm: 1550.0,
            fwhm_nm: 0.5,
            channel: None,
        }]
        .into();
        let elements = design.elements().into_iter().zip(maps);
        set.elements = elements
            .map(|(element, pillars)| MeasuredElement {
                index: [element.index.0.into(), element.index.1.into()],
                centre_um: element.centre_um(),
                aperture_diameter_um: 2.0 * design.aperture_radius_of_um(&element),
                axis_um: [0.0; 2],
                pillars,
            })
            .collect();
        assert!(!set.elements.raw[0].pillars.lattice.is_square());
        let like = set.measurements.raw[0].clone();
        let seen = |aoi_deg: [f64; 2], distance_um: f64| {
            let aoi_rad = aoi_deg.map(f64::to_radians);
            let sines = aoi_rad.map(f64::sin);
            let along = (1.0 - sines[0].powi(2) - sines[1].powi(2)).sqrt();
            Measurement {
                name: format!("{aoi_deg:?} {distance_um}"),
                element: ElementIndex::from(0),
                led: LedIndex::from(0),
                aoi_rad,
                distance_um,
                window_centre_um: sines.map(|s| set.stack.focal_length_um * s / along),
                ..like.clone()
            }
        };
        let measurements = [[0.0, 0.0], [6.0, -3.0]].map(|aoi| [43.0, 46.0].map(|distance| seen(aoi, distance)));
        set.measurements = measurements.concat().into();
        set
    }

    /// All that the chip and the bench change: intensities are those of the direct sum over the pillars as made.
    #[test]
    fn light_of_a_hexagonal_lattice_is_that_of_the_direct_sum() {
        /// Share of the peak: transforms in single precision; 9e-6 is found.
        const OF_THE_PEAK: f64 = 1e-4;
        let set = hexagonal_set();
        assert_eq!(set.measurements.len(), 4);
        let bench = Bench::new(&set, BenchSampling::default());
        let wavelengths = bench.wavelengths_nm().len();
        let cells = Arc::new(PillarTable {
            first_nm: 100.0,
            step_nm: 10.0,
            t: vec![
                (0..60)
                    .map(|k| Complex64::from_polar(0.9, 0.13 * f64::from(k)))
                    .collect();
                wavelengths
            ],
            bare: vec![Complex64::ONE; wavelengths],
        });
        let geometry = GeometryChange {
            cd_bias_nm: 6.0,
            cd_bias_density_nm: 30.0,
            aperture_offset_um: [0.8, -0.5],
            wavefront_nm: vec![40.0, -25.0],
            stitching: vec![Stitching {
                axis: 0,
                at_um: 2.0,
                by_nm: [120.0, -60.0],
            }],
            ..GeometryChange::default()
        };
        let path = PathChange {
            defocus_um: 1.5,
            tilt_mrad: [4.0, -2.0],
            ..PathChange::default()
        };
        let light = LightChange::default();
        let chip = IlluminatedChip {
            cells,
            rim: None,
            geometry: &geometry,
            lights: vec![&light],
            every: 1,
            scatter: None,
        };
        let found = bench.intensities(std::slice::from_ref(&chip), &path, &Silent).unwrap();
        for group in &bench.groups {
            let element = bench.element(group.element, &chip).unwrap();
            let quadrature = &bench.quadratures[group.led];
            let weights = quadrature.weights(group.led.into(), &light, 1);
            let (n, step) = (group.plan.window(), group.plan.step_um());
            let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * step;
            for &measurement in &group.measurements {
                let plane = &found[0][0][measurement];
                let peak = plane.iter().copied().fold(0.0, f32::max);
                let brightest = plane.iter().position(|v| *v == peak).unwrap();
                let places: Vec<usize> = (0..30).map(|k| (k * 7919) % (n * n)).chain([brightest]).collect();
                let z = set.measurements[measurement].distance_um + path.defocus_um;
                let [cx, cy] = group.centre_um;
                let points: Vec<[f64; 3]> = places.iter().map(|&i| [cx + at(i % n), cy + at(i / n), z]).collect();
                let mut sums = vec![0.0; places.len()];
                for (k, nm) in quadrature.wavelengths_nm.iter().enumerate() {
                    let lit = super::light(group, &path, nm * 1e-3);
                    let table = table(&chip, &element, bench.first[group.led] + k);
                    let aperture = element.lit_aperture(&table, &lit);
                    let fields = Direct::at(&aperture, &lit.plane, &points);
                    sums.iter_mut()
                        .zip(fields)
                        .for_each(|(sum, e)| *sum += weights[k] * e.norm_sqr());
                }
                let worst = places
                    .iter()
                    .zip(&sums)
                    .map(|(i, sum)| (f64::from(plane[*i]) - sum).abs());
                let worst = worst.fold(0.0, f64::max) / f64::from(peak);
                println!("{}: {worst:.1e} of the peak", set.measurements[measurement].name);
                assert!(worst < OF_THE_PEAK, "{worst}");
            }
        }
    }
}
