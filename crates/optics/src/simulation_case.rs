//! Simulation case of elements: as drawn, or as fabricated.

use std::sync::{Arc, OnceLock};

use num_complex::Complex64;
use rayon::prelude::*;

use super::as_built_optics::AsBuiltOptics;
use super::class_fields::scaled_to;
use super::drawn_optics::{DrawnCells, DrawnOptics, coupled, not_held};
use super::light::wave_of;
use super::{
    ArrivingLight, AsBuiltChip, AsBuiltElement, ClassFields, ClassTable, DrawnElement, ElementOptics, Field,
    ModelStatement, NeighbourSites, Perturbation, Placement,
};
use metalith_cell::{CellModel, CellResponse, Fidelity, Illumination};
use metalith_core::{Progress, Result, Steps};
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
    /// These optics with at most so many bytes of spectra for a thread at a time, if that is given.
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
    pub fn respond_over(&self, wavelengths_um: &[f64], light: &Illumination<'_>, progress: &Steps<'_>) -> Result<()> {
        let at = |um: &f64| {
            let light = Illumination {
                wavelength_um: *um,
                ..*light
            };
            self.response(&light, progress)?;
            progress.done();
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
                sites: OnceLock::new(),
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
                        let sites = NeighbourSites::of(pillars);
                        let (fields, weight) = coupled(&sites, &response, tables, light);
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
