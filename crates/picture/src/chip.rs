//! The chip before its sensor: elements as read from a layout, in light.

use metalith_cell::{BandResponse, CellModel, PassedTable};
use metalith_core::{Error, Progress, Result};
use metalith_design::array::Symmetry;
use metalith_design::phase::OpenAreas;
use metalith_design::{Design, Element};
use metalith_gds::extract::Extraction;
use metalith_grating::NeighbourPillars;
use metalith_optics::{
    ArrivingLight, AsBuiltElement, AsBuiltOptics, CameraChange, ClassTable, DrawnElement, PathChange, Perturbation,
    SimulationCase, cell_direction,
};
use metalith_pillars::{PillarId, PillarMap};
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::PlaneWave;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::ElementView;

/// An element that differs from all others by more than a symmetry.
pub struct DistinctChipElement<'a> {
    pub view: ElementView,
    widths: &'a PillarMap,
    made: AsBuiltElement,
    /// Symmetries that leave its pillars and its wedge as they are.
    pub symmetries: Vec<Symmetry>,
    /// Area of its sites (um^2).
    open_um2: f64,
    /// What its pillars transmit among unlike neighbours, of a cell that knows; one for each wavelength.
    among_neighbours: Vec<Option<BandResponse>>,
}

/// All elements of a chip, with what decides what they transmit at the wavelengths of a camera.
pub struct ChipInLight<'a> {
    pub elements: Vec<ElementView>,
    /// For each element the distinct one that it is a copy of, and what turns that one into it.
    pub copies: Vec<(usize, Symmetry)>,
    pub distinct: Vec<DistinctChipElement<'a>>,
    pub sampling: Sampling,
    case: SimulationCase<'a>,
    /// Transmission of a cell by wavelength and width.
    by_width: Vec<Vec<Complex64>>,
    /// Of a cell that changes polarisation, what reaches the sensor, by wavelength.
    polarised: Vec<Option<Polarised>>,
    perturbation: Perturbation,
    /// Share of the light that cells send on that pass everything, at each wavelength.
    full: Vec<f64>,
    /// One over the distance of the scene (1/m).
    source_per_m: f64,
}

/// A distinct element in the light of some wavelengths of the camera.
pub struct ElementInLight<'c> {
    chip: &'c ChipInLight<'c>,
    distinct: usize,
    /// By wavelength of the camera; of those that were not asked for, nothing.
    tables: Vec<Option<Tables>>,
}

struct Tables {
    classes: Vec<ClassTable>,
    /// As [`ElementInLight::departing`], where these are not `classes`, each once with the phase of the element.
    departing: Option<Vec<(ClassTable, i32)>>,
    /// As [`AsBuiltOptics::share`].
    share: f64,
    gap_um: f64,
    camera: CameraChange,
}

/// Largest distance of the wavelengths that are simulated (nm), as in the figures of white light of a run.
pub const STEP_NM: f64 = 12.5;

/// From the pillar tops of a design to the sensor of a camera, below the middle of the chip (um): as the camera says, else in the
/// focus of the lens that elements share.
pub fn sensor_um(design: &Design, camera: &Camera) -> f64 {
    camera.sensor.distance_um.unwrap_or(design.lens.focal_length_um)
}

/// Where the elements of a design are before a sensor: one plane for all, whatever their focal lengths.
pub fn element_views(design: &Design, camera: &Camera) -> Vec<ElementView> {
    views_of(design, camera, &OpenAreas::of(design))
}

fn views_of(design: &Design, camera: &Camera, areas: &OpenAreas) -> Vec<ElementView> {
    let view = |(element, open_um2): (Element, &f64)| ElementView {
        centre_um: element.centre_um(),
        wedge: element.wedge,
        area: open_um2 / areas.lens_um2,
        sensor_um: sensor_um(design, camera),
        slope: camera.sensor.tilt_rad.map(f64::tan),
    };
    design
        .elements()
        .into_iter()
        .zip(&areas.elements_um2)
        .map(view)
        .collect()
}

/// Wavelengths at which a camera is simulated behind a design.
///
/// # Errors
/// If a channel counts no light at which the design's materials are known.
pub fn sampling_of(design: &Design, camera: &Camera) -> Result<Sampling> {
    let (low, high) = design.band_um()?;
    let steps = WavelengthSteps::from(STEP_NM).behind(design.lens_sizes_um(), camera.sensor.pixel_um);
    camera.sampling([low * 1e3, high * 1e3], steps)
}

impl<'a> ChipInLight<'a> {
    /// Elements as they were read, at the wavelengths of a camera, before a scene at a distance (um).
    ///
    /// # Errors
    /// If a cell has no answer, a channel no light, or the user stopped it.
    pub fn new(
        design: &Design,
        extraction: &'a Extraction,
        case: SimulationCase<'a>,
        camera: &Camera,
        scene_distance_um: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let sampling = sampling_of(design, camera)?;
        let areas = OpenAreas::of(design);
        let elements = views_of(design, camera, &areas);
        let perturbation = match case {
            SimulationCase::Cell(_) => Perturbation::default(),
            SimulationCase::Made(chip) => chip.perturbation().clone(),
        };
        let symmetric = perturbation.keeps_symmetry() && elements.iter().all(|e| e.slope == [0.0; 2]);
        let widths: Vec<&PillarMap> = extraction.elements.iter().map(|e| &e.widths).collect();
        if let SimulationCase::Made(chip) = case {
            chip.check_drawn(widths.iter().map(|map| map.histogram()))?;
        }
        let symmetries = Symmetry::ALL
            .into_iter()
            .filter(|s| symmetric && s.keeps(design.cell.shape));
        let (chosen, copies) = distinct_of(&elements, &widths, &symmetries.collect::<Vec<_>>());
        let full = |nm: &f64| Ok(case.full_transmission(nm * 1e-3)?.powi(2));
        progress.begin("solving the cells", sampling.wavelengths_nm.len() as u64);
        let by_width = match case {
            SimulationCase::Made(_) => Vec::new(),
            SimulationCase::Cell(cell) => by_width(cell, &sampling, design, progress)?,
        };
        let polarised = match case {
            SimulationCase::Cell(cell) => polarised(cell, &sampling, design)?,
            SimulationCase::Made(_) => sampling.wavelengths_nm.iter().map(|_| None).collect(),
        };
        let mut distinct = Vec::new();
        for (k, symmetries) in chosen {
            let element = &design.elements()[k];
            let drawn = DrawnElement::new(widths[k], design.aperture_radius_of_um(element))
                .of_shape(design.cell.shape)
                .placed(element.centre_um());
            distinct.push(DistinctChipElement {
                view: elements[k],
                widths: widths[k],
                made: AsBuiltElement::new(&drawn, &perturbation.geometry)?,
                symmetries,
                open_um2: areas.elements_um2[k],
                among_neighbours: among_neighbours(case, &sampling, &elements[k], widths[k], progress)?,
            });
        }
        Ok(Self {
            copies,
            distinct,
            full: sampling.wavelengths_nm.iter().map(full).collect::<Result<_>>()?,
            sampling,
            elements,
            case,
            by_width,
            polarised,
            perturbation,
            source_per_m: 1e6 / scene_distance_um,
        })
    }

    /// A distinct element in the light of some wavelengths, by their indices. Where pillars have unlike neighbours, each
    /// wavelength takes two bytes a site.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn in_light(
        &'a self,
        distinct: usize,
        wavelengths: &[usize],
        progress: &dyn Progress,
    ) -> Result<ElementInLight<'a>> {
        let mut tables: Vec<Option<Tables>> = self.sampling.wavelengths_nm.iter().map(|_| None).collect();
        for i in wavelengths {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            tables[*i] = Some(self.tables(&self.distinct[distinct], *i, progress)?);
        }
        Ok(ElementInLight {
            chip: self,
            distinct,
            tables,
        })
    }

    /// Power of the light that arrives at a distinct element at a wavelength, by its index, in the unit of a PSF's energy (um^2).
    pub fn arriving_um2(&self, distinct: usize, wavelength: usize) -> f64 {
        self.full[wavelength] * self.distinct[distinct].open_um2
    }

    fn tables(&self, element: &DistinctChipElement<'_>, index: usize, progress: &dyn Progress) -> Result<Tables> {
        let um = self.sampling.wavelengths_nm[index] * 1e-3;
        if let SimulationCase::Made(chip) = self.case {
            let view = chip.view_in_band(&element.made, &PlaneWave::normal(um), false, progress)?;
            let departing = chip.departing_in_band(&element.made, um, progress)?;
            return Ok(Tables {
                departing: departing.map(|departing| scaled_to(&view.tables, departing, element.made.classes())),
                classes: view.tables,
                share: view.share,
                gap_um: view.gap_um,
                camera: view.camera,
            });
        }
        let of = |table: &Vec<Complex64>| element.made.table_by_number(table, Complex64::ZERO);
        let (classes, departing) = match (&element.among_neighbours[index], &self.polarised[index]) {
            (Some(response), _) => {
                let (x, y) = element.view.wedge.looks_at(um);
                let pillars = NeighbourPillars::new(element.widths, response, [x, y])?;
                (vec![ClassTable::of_sites(&pillars)], None)
            }
            (None, Some(polarised)) => {
                let departing = polarised.departing_from(element.widths).into_iter();
                (
                    polarised.passed.iter().map(|p| of(&p.table)).collect(),
                    Some(departing.map(|p| (of(&p.table), p.order)).collect()),
                )
            }
            (None, None) => (vec![of(&self.by_width[index])], None),
        };
        Ok(Tables {
            classes,
            departing,
            // What passes pillars that change polarisation is of all light that arrives.
            share: 1.0,
            gap_um: 0.0,
            camera: CameraChange::default(),
        })
    }
}

impl ElementInLight<'_> {
    /// As [`ChipInLight::arriving_um2`].
    pub fn arriving_um2(&self, wavelength: usize) -> f64 {
        self.chip.arriving_um2(self.distinct, wavelength)
    }

    /// In the light of one wavelength, by its index, from a direction.
    ///
    /// # Panics
    /// If it was not made for this wavelength.
    pub fn lit(&self, wavelength: usize, sines: [f64; 2]) -> AsBuiltOptics<'_> {
        let chip = self.chip;
        let stated = PlaneWave {
            wavelength_um: chip.sampling.wavelengths_nm[wavelength] * 1e-3,
            sin_x: sines[0],
            sin_y: sines[1],
        };
        let tables = self.at(wavelength);
        let path = PathChange {
            source_per_m: chip.perturbation.path.source_per_m + chip.source_per_m,
            ..chip.perturbation.path.clone()
        };
        AsBuiltOptics {
            element: &chip.distinct[self.distinct].made,
            tables: tables.classes.clone(),
            share: tables.share,
            light: ArrivingLight::new(&stated, &path),
            gap_um: tables.gap_um,
            camera: tables.camera.clone(),
        }
    }

    /// Tables of light whose direction is asked for, each with how often it has the phase of the element: as those of
    /// [`PolarisedTables::departing`](metalith_cell::PolarisedTables::departing) where pillars tell polarisations apart, else those of
    /// [`ElementInLight::lit`].
    ///
    /// # Panics
    /// As [`ElementInLight::lit`].
    pub fn departing(&self, wavelength: usize) -> Vec<(&ClassTable, i32)> {
        let tables = self.at(wavelength);
        match &tables.departing {
            Some(departing) => departing.iter().map(|(table, order)| (table, *order)).collect(),
            None => tables.classes.iter().map(|table| (table, 1)).collect(),
        }
    }

    /// Share of the light that leaves the element in the direction it came from, as one wave: the square of the mean
    /// transmission of its sites, at a wavelength by its index, mean over the polarisations in which it arrives.
    ///
    /// # Panics
    /// As [`ElementInLight::lit`].
    pub fn zero_order(&self, wavelength: usize) -> f64 {
        let made = &self.chip.distinct[self.distinct].made;
        let Tables { classes, share, .. } = self.at(wavelength);
        // The power of a wave is the square of its sum over the area, over the area.
        let site_um2 = made.lattice().cell_um2();
        let all = self.arriving_um2(wavelength) * self.chip.distinct[self.distinct].open_um2;
        let of = |table: &ClassTable| (table.sum(made.classes()) * site_um2).norm_sqr() / all;
        classes.iter().map(of).sum::<f64>() * share
    }

    fn at(&self, wavelength: usize) -> &Tables {
        self.tables[wavelength]
            .as_ref()
            .expect("wavelengths are asked for before")
    }
}

/// Distinct elements with those of these symmetries that leave each as it is; and for each element the distinct one that it is a
/// copy of, and how turned.
#[allow(clippy::type_complexity, reason = "both halves are taken apart at once")]
fn distinct_of(
    elements: &[ElementView],
    widths: &[&PillarMap],
    symmetries: &[Symmetry],
) -> (Vec<(usize, Vec<Symmetry>)>, Vec<(usize, Symmetry)>) {
    let turns = |t: Symmetry, from: usize, to: usize| {
        elements[from].area == elements[to].area
            && same_wedge(t, &elements[from], &elements[to])
            && t.maps(widths[from], widths[to])
    };
    let (mut distinct, mut copies): (Vec<(usize, Vec<Symmetry>)>, Vec<_>) = (Vec::new(), Vec::new());
    for k in 0..elements.len() {
        let copy = distinct.iter().enumerate().find_map(|(base, (of, _))| {
            let turned = symmetries.iter().find(|t| turns(**t, *of, k));
            Some((base, *turned?))
        });
        copies.push(copy.unwrap_or((distinct.len(), Symmetry::IDENTITY)));
        if copy.is_none() {
            let others = symmetries.iter().copied().filter(|t| *t != Symmetry::IDENTITY);
            let own = others.filter(|t| turns(*t, k, k));
            distinct.push((k, std::iter::once(Symmetry::IDENTITY).chain(own).collect()));
        }
    }
    (distinct, copies)
}

/// Largest index of a table of the cells of a design: a width (nm), or the number of a rectangle.
fn last_index(design: &Design) -> u16 {
    let last = design.cell.shape.last();
    last.map_or(design.cell.pitch_nm as u16, |PillarId(number)| number)
}

/// Where light of an element as made goes, with the power of what passes: as [`Polarised::departing_from`].
fn scaled_to(passed: &[ClassTable], departing: Vec<(ClassTable, i32)>, classes: &[u16]) -> Vec<(ClassTable, i32)> {
    let all: f64 = departing.iter().map(|(table, _)| table.power(classes)).sum();
    let passes: f64 = passed.iter().map(|table| table.power(classes)).sum();
    let scale = if all > 0.0 { (passes / all).sqrt() as f32 } else { 0.0 };
    let scaled = departing.into_iter().map(|(table, order)| (table.scaled(scale), order));
    scaled.collect()
}

/// What reaches the sensor of light whose polarisations pillars tell apart, and the same for where it goes.
struct Polarised {
    passed: Vec<PassedTable>,
    departing: Vec<PassedTable>,
}

impl Polarised {
    /// Where light of these pillars goes: over one element light of unlike orders may interfere a little, and all of it is what
    /// passes.
    fn departing_from(&self, pillars: &PillarMap) -> Vec<PassedTable> {
        let counts = pillars.histogram();
        let power = |all: &[PassedTable]| -> f64 {
            let of = |p: &PassedTable| -> f64 {
                let each = counts.iter().zip(&p.table).skip(1);
                each.map(|(n, t)| *n as f64 * t.norm_sqr()).sum()
            };
            all.iter().map(of).sum()
        };
        let all = power(&self.departing);
        let scale = if all > 0.0 {
            (power(&self.passed) / all).sqrt()
        } else {
            0.0
        };
        let scaled = |p: &PassedTable| PassedTable {
            table: p.table.iter().map(|t| t * scale).collect(),
            order: p.order,
        };
        self.departing.iter().map(scaled).collect()
    }
}

/// Of the light of a design.
fn polarised(cell: &dyn CellModel, sampling: &Sampling, design: &Design) -> Result<Vec<Option<Polarised>>> {
    let light = design.verify.light();
    let of = |nm: &f64| {
        let tables = cell.polarised_in_band(nm * 1e-3, last_index(design))?;
        Ok(tables.map(|tables| Polarised {
            passed: tables.passed(light),
            departing: tables.departing(light),
        }))
    };
    sampling.wavelengths_nm.iter().map(of).collect()
}

/// Transmission of a cell along the normal by wavelength and width (nm), or number of a rotation.
fn by_width(
    cell: &dyn CellModel,
    sampling: &Sampling,
    design: &Design,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Complex64>>> {
    let widest = last_index(design);
    let nm = sampling.wavelengths_nm.par_iter();
    nm.map(|nm| {
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        progress.advance(1);
        cell.transmissions_in_band(nm * 1e-3, widest)
    })
    .collect()
}

/// What the pillars of an element transmit among unlike neighbours, at each wavelength; nothing of cells that take them for
/// equals.
fn among_neighbours(
    case: SimulationCase<'_>,
    sampling: &Sampling,
    view: &ElementView,
    widths: &PillarMap,
    progress: &dyn Progress,
) -> Result<Vec<Option<BandResponse>>> {
    let lattice = widths.lattice.kind();
    let looks = |um: f64| cell_direction(&PlaneWave::looked_at(&view.wedge, um), lattice);
    let of = |nm: &f64| match case {
        SimulationCase::Cell(cell) => cell.among_neighbours_in_band(nm * 1e-3, &looks, progress),
        SimulationCase::Made(_) => Ok(None),
    };
    sampling.wavelengths_nm.iter().map(of).collect()
}

/// Whether a symmetry turns the wedge of one element into that of another.
fn same_wedge(turn: Symmetry, from: &ElementView, to: &ElementView) -> bool {
    /// Sines of the same angle, computed for both signs.
    const ROUNDING: f64 = 1e-12;
    let wedge = turn.vector([from.wedge.sin_x, from.wedge.sin_y]);
    (wedge[0] - to.wedge.sin_x).abs() < ROUNDING && (wedge[1] - to.wedge.sin_y).abs() < ROUNDING
}
