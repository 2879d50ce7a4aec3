//! Simulation case of elements: as drawn, or as fabricated.

use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;

use super::drawn::{DrawnCells, DrawnOptics, coupled, not_held};
use super::light::wave_of;
use super::{
    ArrivingLight, AsBuiltChip, AsBuiltElement, CameraChange, ClassTable, DrawnElement, Field, IncoherentFields,
    ModelStatement, Perturbation,
};
use metalith_cell::{CellModel, CellResponse, Fidelity, Illumination};
use metalith_core::{Progress, Result};
use metalith_pillars::{LatticeKind, PillarMap, PillarRows};

/// Simulation case of the pillars of a layout.
#[derive(Clone, Copy)]
pub enum SimulationCase<'a> {
    /// Pillars as drawn, by a cell; chip, light and sensor are where the design has them.
    Cell(&'a dyn CellModel),
    /// Pillars as fabricated on a measured line and bench.
    Made(&'a AsBuiltChip),
}

impl<'a> From<&'a dyn CellModel> for SimulationCase<'a> {
    fn from(cell: &'a dyn CellModel) -> Self {
        Self::Cell(cell)
    }
}

impl<'a> From<&'a AsBuiltChip> for SimulationCase<'a> {
    fn from(chip: &'a AsBuiltChip) -> Self {
        Self::Made(chip)
    }
}

impl<'a> SimulationCase<'a> {
    /// Fidelity of the description of the cell.
    pub fn fidelity(&self) -> Fidelity {
        match self {
            Self::Cell(cell) => cell.fidelity(),
            Self::Made(_) => Fidelity::Calibrated,
        }
    }

    /// Perturbation of the design; empty as drawn.
    pub fn perturbation(&self) -> Perturbation {
        match self {
            Self::Cell(_) => Perturbation::default(),
            Self::Made(chip) => chip.perturbation().clone(),
        }
    }

    /// The model that a chip is fabricated by, for reports; none as drawn.
    pub fn statement(&self) -> Option<ModelStatement> {
        match self {
            Self::Cell(_) => None,
            Self::Made(chip) => Some(chip.statement()),
        }
    }

    /// |t| of a cell that passes all its power in the zero order.
    ///
    /// # Errors
    /// If the wavelength is outside what the cell covers.
    pub fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        match self {
            Self::Cell(cell) => cell.full_transmission(wavelength_um),
            Self::Made(chip) => chip.full_transmission(wavelength_um),
        }
    }

    /// Check that pillars, of each element so many by width or number, are such as the model can be applied to.
    ///
    /// # Errors
    /// As [`AsBuiltChip::check_drawn`].
    pub fn check_drawn(&self, counts: impl IntoIterator<Item = Vec<u64>>) -> Result<()> {
        match self {
            Self::Cell(_) => Ok(()),
            Self::Made(chip) => chip.check_drawn(counts),
        }
    }

    /// The optics of elements on a lattice whose pillars have widths (nm) or numbers up to the largest.
    pub fn optics(self, lattice: LatticeKind, largest_number: u16) -> CaseOptics<'a> {
        CaseOptics {
            case: self,
            source: match self {
                Self::Cell(cell) => Source::Drawn(DrawnCells::new(cell, lattice, largest_number)),
                Self::Made(chip) => Source::AsBuilt(chip),
            },
            part_bytes: None,
        }
    }
}

/// Place of an element, and its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Radius of the circle that light passes as drawn (um).
    pub radius_um: f64,
    /// Radius of the opening in the metal (um).
    pub aperture_radius_um: f64,
    /// Centre on the chip (um).
    pub centre_um: [f64; 2],
}

/// An element whose light is asked for.
pub trait ElementOptics: Sync {
    /// Its fields in a light.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    fn in_light(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<IncoherentFields<'_>>;

    /// Mean response over the element of its pillars of these widths (nm) or numbers to light along the normal.
    ///
    /// # Errors
    /// As [`ElementOptics::in_light`].
    fn response(&self, light: &Illumination<'_>, numbers: &[u16], progress: &dyn Progress)
    -> Result<Arc<CellResponse>>;

    /// Transmission of its sites along the normal of the light that has the phase of the design, whatever light is
    /// simulated; with equal neighbours.
    ///
    /// # Errors
    /// As [`ElementOptics::in_light`].
    fn focused(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<FocusedSites<'_>>;
}

/// Transmissions of focused light by site.
pub struct FocusedSites<'e> {
    pub table: Vec<Complex64>,
    /// Place in the table for each site, row by row; the width (nm) or number of its pillar if there are none.
    pub classes: Option<&'e [u16]>,
}

impl FocusedSites<'_> {
    /// Place in the table of a site, counted row by row, with a pillar of a width (nm) or number.
    pub fn class(&self, site: usize, number: u16) -> usize {
        self.classes.map_or(number, |classes| classes[site]).into()
    }
}

/// The optics of all elements of a layout. What cells have answered is held for as long as this lives.
pub struct CaseOptics<'a> {
    case: SimulationCase<'a>,
    source: Source<'a>,
    part_bytes: Option<usize>,
}

enum Source<'a> {
    Drawn(DrawnCells<'a>),
    AsBuilt(&'a AsBuiltChip),
}

impl<'a> CaseOptics<'a> {
    /// Same optics with at most so many bytes of spectra for a thread at a time, if that is given.
    #[must_use]
    pub fn within(self, part_bytes: Option<usize>) -> Self {
        Self { part_bytes, ..self }
    }

    /// Simulation case of the elements.
    pub fn case(&self) -> SimulationCase<'a> {
        self.case
    }

    /// Response of pillars as drawn to a light, computed here so that elements have it in memory. `None` for a chip as
    /// fabricated.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn response(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<Option<Arc<CellResponse>>> {
        progress.check_stopped()?;
        match &self.source {
            Source::Drawn(cells) => cells.response(light, progress).map(Some),
            Source::AsBuilt(_) => Ok(None),
        }
    }

    /// Responses at some wavelengths (um) of a light, at once where that does not solve anything twice.
    ///
    /// # Errors
    /// As [`CaseOptics::response`].
    pub fn respond_over(
        &self,
        wavelengths_um: &[f64],
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let at = |um: &f64| {
            let light = Illumination {
                wavelength_um: *um,
                ..*light
            };
            self.response(&light, progress)?;
            progress.advance(1);
            Ok(())
        };
        match &self.source {
            Source::Drawn(cells) if cells.cell.uncoupled().is_some() => wavelengths_um.iter().try_for_each(at),
            _ => wavelengths_um.par_iter().try_for_each(at),
        }
    }

    /// An element, whose rows are looked at when light passes it.
    ///
    /// # Errors
    /// As [`AsBuiltElement::new`]; also if an element as fabricated is not held as a map.
    pub fn element<'e>(
        &'e self,
        pillars: &'e dyn PillarRows,
        placement: &Placement,
    ) -> Result<Box<dyn ElementOptics + 'e>> {
        Ok(match &self.source {
            Source::Drawn(cells) => Box::new(DrawnOptics {
                cells,
                pillars,
                radius_um: placement.radius_um,
                part_bytes: self.part_bytes,
            }),
            Source::AsBuilt(chip) => {
                let map = pillars.held().ok_or_else(not_held)?;
                let drawn = chip
                    .drawn(map, placement.aperture_radius_um)
                    .placed(placement.centre_um);
                Box::new(AsBuiltOptics {
                    chip,
                    element: chip.element(&drawn)?,
                    drawn,
                })
            }
        })
    }
}

/// An element as fabricated.
struct AsBuiltOptics<'e> {
    chip: &'e AsBuiltChip,
    drawn: DrawnElement<'e>,
    element: AsBuiltElement,
}

impl ElementOptics for AsBuiltOptics<'_> {
    fn in_light(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<IncoherentFields<'_>> {
        self.chip.view(&self.element, light, progress)
    }

    fn response(
        &self,
        light: &Illumination<'_>,
        numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<Arc<CellResponse>> {
        let steps = self.drawn.mean_site_steps(&self.chip.perturbation().geometry);
        let response = self.chip.pillars(numbers, steps, light.wavelength_um, progress)?;
        Ok(Arc::new(response))
    }

    fn focused(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<FocusedSites<'_>> {
        let light = Illumination::normal(wavelength_um);
        let tables = self
            .element
            .tables_of(&self.chip.solve(&self.element, &light, progress)?);
        let own = tables.first().expect("light that is focused passes");
        let double = |t: &num_complex::Complex32| Complex64::new(f64::from(t.re), f64::from(t.im));
        Ok(FocusedSites {
            table: own.t.iter().map(double).collect(),
            classes: Some(self.element.classes()),
        })
    }
}

/// Fields of the classes of an element in one light, for pictures: from any direction, along which cells are not solved
/// anew.
pub struct ClassFields {
    tables: Vec<ClassTable>,
    departing: Option<Vec<(ClassTable, i32)>>,
    weight: f64,
    defocus_um: f64,
    camera: CameraChange,
}

impl CaseOptics<'_> {
    /// An element as fabricated; pillars as drawn are those of a chip without a perturbation.
    ///
    /// # Errors
    /// As [`AsBuiltElement::new`].
    pub fn as_built(&self, drawn: &DrawnElement<'_>) -> Result<AsBuiltElement> {
        AsBuiltElement::new(drawn, &self.case.perturbation().geometry)
    }

    /// Fields in a light of the classes of an element of [`CaseOptics::as_built`], drawn with these pillars. Where
    /// pillars have dissimilar neighbours it takes two bytes a site.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn classes(
        &self,
        element: &AsBuiltElement,
        pillars: &PillarMap,
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<ClassFields> {
        let perturbation = self.case.perturbation();
        let (tables, weight, departing) = match &self.source {
            Source::AsBuilt(chip) => {
                let solved = chip.solve(element, light, progress)?;
                let departing = chip.departing(element, light, progress)?;
                (element.tables_of(&solved), solved.share, departing)
            }
            Source::Drawn(cells) => {
                let of = |table: &Vec<Complex64>| element.table_by_number(table, Complex64::ZERO);
                let response = cells.response(light, progress)?;
                match response.as_ref() {
                    CellResponse::Neighbours(tables) => {
                        let (fields, weight) = coupled(pillars, &response, tables, light);
                        let arriving = ArrivingLight::new(&wave_of(light), &perturbation.path);
                        let sites = |field: &Field<'_>| Ok(ClassTable::of_sites(field.aperture(&arriving)?.as_ref()));
                        (fields.iter().map(sites).collect::<Result<_>>()?, weight, None)
                    }
                    CellResponse::Scalar(table) => (vec![of(table)], 1.0, None),
                    CellResponse::Jones(tables) => {
                        let (passed, weight) = tables.incoherent(light.polarised);
                        let departing = response.polarised().map(|tables| {
                            let departing = tables.departing(light.polarised).into_iter();
                            departing.map(|p| (of(&p.table), p.order)).collect()
                        });
                        (passed.iter().map(of).collect(), weight, departing)
                    }
                }
            }
        };
        Ok(ClassFields {
            departing: departing.map(|departing| scaled_to(&tables, departing, element.classes())),
            tables,
            weight,
            defocus_um: perturbation.path.added_distance_um(element.centre_um()),
            camera: perturbation.camera,
        })
    }
}

impl ClassFields {
    /// The element in light from a direction.
    pub fn lit<'e>(&self, element: &'e AsBuiltElement, light: ArrivingLight) -> IncoherentFields<'e> {
        let (tables, camera) = (self.tables.clone(), self.camera.clone());
        IncoherentFields::of_classes(element, tables, self.weight, light, self.defocus_um, camera)
    }

    /// Tables of light whose direction is asked for, each with how often it has the phase of the element: as those of
    /// [`PolarisedTables::departing`](metalith_cell::PolarisedTables::departing) where pillars distinguish
    /// polarisations, with the power of what passes; else those of all light.
    pub fn departing(&self) -> Vec<(&ClassTable, i32)> {
        match &self.departing {
            Some(departing) => departing.iter().map(|(table, order)| (table, *order)).collect(),
            None => self.tables.iter().map(|table| (table, 1)).collect(),
        }
    }

    /// Power of the light that leaves an element of so many classes in the direction it came from, as one wave, over its area: the
    /// square of the sum of the transmissions of its sites, mean over the polarisations in which light arrives.
    pub fn zeroth_order(&self, element: &AsBuiltElement, all_um4: f64) -> f64 {
        let site_um2 = element.lattice().cell_um2();
        let of = |table: &ClassTable| (table.sum(element.classes()) * site_um2).norm_sqr() / all_um4;
        self.tables.iter().map(of).sum::<f64>() * self.weight
    }
}

/// Tables of light of an element by direction of departure, with the power of what passes: over one element light of
/// unlike orders may interfere a little.
fn scaled_to(passed: &[ClassTable], departing: Vec<(ClassTable, i32)>, classes: &[u16]) -> Vec<(ClassTable, i32)> {
    let all: f64 = departing.iter().map(|(table, _)| table.power(classes)).sum();
    let passes: f64 = passed.iter().map(|table| table.power(classes)).sum();
    let scale = if all > 0.0 { (passes / all).sqrt() as f32 } else { 0.0 };
    let scaled = departing.into_iter().map(|(table, order)| (table.scaled(scale), order));
    scaled.collect()
}
