//! The chip as fabricated: a stated cell and a perturbation, for any layout and light.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use num_complex::Complex64;
use serde::Serialize;

use super::as_built_rectangles::AsBuiltRectangles;
use super::etched_stack::to_middle_tops;
use super::light::wave_of;
use super::realised_cells::{RealisedCells, SolvedWidths};
use super::{
    Applied, ArrivingLight, AsBuiltElement, CalibratedModel, CellBank, CellChange, ClassTable, DrawnElement,
    IncoherentFields, NotApplied, Perturbation, RectangleClass, cell_direction, mixed, realised_nm,
};
use metalith_cell::{
    CellResponse, CellStack, FocusingStack, Illumination, Incidence, JonesTables, PassedTable, PolarisedTables,
    Spectral,
};
use metalith_core::{Error, Progress, Result};
use metalith_pillars::PillarMap;

/// Chips of one line and bench, by its calibrated model.
pub struct AsBuiltChip {
    model: CalibratedModel,
    cells: RealisedCells,
    /// Rectangles, which stand for the cells where pillars are rectangles.
    rectangles: Option<AsBuiltRectangles>,
}

/// Statement in a report of the model that it rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelStatement {
    /// The session that the model comes from.
    pub set: String,
    /// Finding of the calibration.
    pub finding: String,
    /// Changes by the model to what is stated.
    pub applied: Vec<Applied>,
    /// Parts of the model that were not simulated, each with the reason.
    pub not_applied: Vec<NotApplied>,
}

impl ModelStatement {
    /// Statement of simulations at single wavelengths by a model.
    pub fn of(model: &CalibratedModel) -> Self {
        Self {
            set: model.set.clone(),
            finding: model.finding.clone(),
            applied: model.perturbation.applied(),
            not_applied: model.perturbation.not_applied(),
        }
    }
}

impl AsBuiltChip {
    /// Chips with this stated cell, made as the model says.
    ///
    /// # Errors
    /// If a number of the model cannot be, all of them at once.
    pub fn new(stated: &CellStack, model: &CalibratedModel) -> Result<Self> {
        let faults = model.perturbation.faults();
        if !faults.is_empty() {
            let all: Vec<String> = faults.iter().map(ToString::to_string).collect();
            return Err(Error::refused(
                "model/impossible-values",
                all.join("; "),
                "correct these values of the calibrated model",
            ));
        }
        let perturbation = &model.perturbation;
        Ok(Self {
            cells: RealisedCells::changed(stated, &perturbation.cell, perturbation.geometry.cd_bias_nm),
            model: model.clone(),
            rectangles: None,
        })
    }

    /// Chip of pillars in their light, also of pillars that distinguish polarisations.
    ///
    /// # Errors
    /// As [`AsBuiltChip::new`]; also if the pillars are no rectangles that focus this, or the model has what rectangles have no meaning for.
    pub fn in_light(stated: &FocusingStack, model: &CalibratedModel) -> Result<Self> {
        let made = Self::new(&stated.stack, model)?;
        let of = |focused| AsBuiltRectangles::new(&stated.stack, model, focused);
        let rectangles = stated.focused.map(of);
        Ok(Self {
            rectangles: rectangles.transpose()?,
            ..made
        })
    }

    /// This chip, whose rectangles, which take longer to solve than pillars of one width, are cached in a folder from
    /// one run to the next: see [`metalith_cell::cache_folder`].
    #[must_use]
    pub fn cached_in(self, folder: Option<&Path>) -> Self {
        Self {
            rectangles: self.rectangles.map(|rectangles| rectangles.cached_in(folder)),
            ..self
        }
    }

    /// This chip with all cells from a bank of the stated pillar: nothing is solved.
    #[must_use]
    pub fn from_bank(self, bank: &Arc<CellBank>) -> Self {
        Self {
            cells: RealisedCells::of_bank(bank, &self.model.perturbation.cell),
            rectangles: self.rectangles.map(|rectangles| rectangles.of_bank(bank)),
            ..self
        }
    }

    /// The perturbation.
    pub fn perturbation(&self) -> &Perturbation {
        &self.model.perturbation
    }

    /// Check as [`CalibratedModel::check_drawn`], of pillars of the chip.
    ///
    /// # Errors
    /// As [`CalibratedModel::check_drawn`].
    pub fn check_drawn(&self, counts: impl IntoIterator<Item = Vec<u64>>) -> Result<()> {
        self.model.check_drawn(self.cells.stack(), counts)
    }

    /// The cells as etched, by realised width.
    pub fn cells(&self) -> &RealisedCells {
        &self.cells
    }

    /// Statement for a report of simulations at single wavelengths.
    pub fn statement(&self) -> ModelStatement {
        ModelStatement::of(&self.model)
    }

    /// |t| of a cell that passes all its power in the zero order.
    ///
    /// # Errors
    /// If the wavelength is outside the range of a material.
    pub fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.cells.stack().full_transmission(wavelength_um)
    }

    /// Pillars of this chip's shape as drawn, with the radius of the opening in the metal around them (um).
    pub fn drawn<'a>(&self, pillars: &'a PillarMap, aperture_radius_um: f64) -> DrawnElement<'a> {
        DrawnElement::new(pillars, aperture_radius_um).of_shape(self.cells.stack().shape)
    }

    /// An element as it is made.
    ///
    /// # Errors
    /// As [`AsBuiltElement::new`].
    pub fn element(&self, drawn: &DrawnElement<'_>) -> Result<AsBuiltElement> {
        AsBuiltElement::new(drawn, &self.perturbation().geometry)
    }

    /// A made element in a light: cells are solved along the normal, or for the direction of the light on the tilted chip.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn view<'a>(
        &self,
        element: &'a AsBuiltElement,
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<IncoherentFields<'a>> {
        let solved = self.solve(element, light, progress)?;
        let arriving = ArrivingLight::new(&wave_of(light), &self.perturbation().path);
        Ok(IncoherentFields::as_built(
            element,
            arriving,
            self.perturbation(),
            &solved,
        ))
    }

    /// Transmission of the classes of an element in a light.
    pub(crate) fn solve(
        &self,
        element: &AsBuiltElement,
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<SolvedWidths> {
        let Some(rectangles) = &self.rectangles else {
            let plane = ArrivingLight::new(&wave_of(light), &self.perturbation().path).plane;
            let cells = Illumination {
                sines: cell_direction([plane.sin_x, plane.sin_y], element.lattice().kind()),
                ..*light
            };
            return self.cells.solve(element.widths_nm(), &cells, progress);
        };
        if light.incidence == Incidence::Oblique {
            return Err(RealisedCells::along_normal_alone());
        }
        let passed = |tables: &PolarisedTables| tables.passed(light.polarised);
        self.through(rectangles, element, light, &passed, progress)
    }

    /// Part of the light behind the classes of rectangles that `leaving` takes.
    fn through(
        &self,
        rectangles: &AsBuiltRectangles,
        element: &AsBuiltElement,
        light: &Illumination<'_>,
        leaving: &dyn Fn(&PolarisedTables) -> Vec<PassedTable>,
        progress: &dyn Progress,
    ) -> Result<SolvedWidths> {
        let of = |change: &CellChange| -> Result<SolvedWidths> {
            let colour = (light.wavelength_um, light.spectral);
            let tables = rectangles.tables(change, element.rectangles(), colour, progress)?;
            Ok(AsBuiltRectangles::solved(leaving(&tables)))
        };
        let change = &self.perturbation().cell;
        let mut solved = of(&change.in_the_middle())?;
        if let Some(rim) = change.at_the_rim() {
            let mut rim = of(&rim)?;
            let phase = to_middle_tops(self.cells.stack(), change.rim_height_nm, light.wavelength_um)?;
            let all = rim.pillars.iter_mut().flatten().chain(&mut rim.bare);
            all.for_each(|t| *t *= phase);
            solved.rim = Some(Box::new(rim));
        }
        Ok(solved)
    }

    /// Transmission of each class of rectangles along the normal by direction of departure, each table with the
    /// multiple of the phase of the element in it: as [`PolarisedTables::departing`]. `None` for other pillars.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub(crate) fn departing(
        &self,
        element: &AsBuiltElement,
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<(ClassTable, i32)>>> {
        let Some(rectangles) = &self.rectangles else {
            return Ok(None);
        };
        let orders = RefCell::new(Vec::new());
        let departing = |tables: &PolarisedTables| {
            let departing = tables.departing(light.polarised);
            *orders.borrow_mut() = departing.iter().map(|p| p.order).collect();
            departing
        };
        let solved = self.through(rectangles, element, light, &departing, progress)?;
        let tables = element.tables_of(&solved).into_iter();
        Ok(Some(tables.zip(orders.into_inner()).collect()))
    }

    /// Response of pillars with these widths (nm) or numbers to light along the normal, where so many steps of density
    /// are added to their width (see [`super::realised_nm`]), with missing pillars and unmodulated light mixed in; by
    /// width or number.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn pillars(
        &self,
        numbers: &[u16],
        density_steps: i32,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<CellResponse> {
        let geometry = &self.perturbation().geometry;
        let last = numbers.iter().copied().max().unwrap_or(0);
        let Some(rectangles) = &self.rectangles else {
            let widths: Vec<f64> = numbers
                .iter()
                .map(|w| realised_nm(*w, geometry, density_steps))
                .collect();
            let solved = self
                .cells
                .solve(&widths, &Illumination::normal(wavelength_um), progress)?;
            let mut table = vec![Complex64::ZERO; usize::from(last) + 1];
            for ((number, width), t) in numbers.iter().zip(&widths).zip(&solved.pillars[0]) {
                let pillar = t * geometry.transmission_factor(*width);
                let (missing, bare) = (geometry.missing_pillars, solved.bare[0]);
                table[usize::from(*number)] = mixed(geometry, missing, pillar, bare, Complex64::ONE);
            }
            return Ok(CellResponse::Scalar(table));
        };
        let change = self.perturbation().cell.in_the_middle();
        let bias_nm = realised_nm(0, geometry, density_steps);
        let mut classes = vec![RectangleClass::WITHOUT_PILLAR; usize::from(last) + 1];
        for &number in numbers {
            classes[usize::from(number)] = RectangleClass { number, bias_nm };
        }
        let mut tables = rectangles.tables(&change, &classes, (wavelength_um, Spectral::Exact), progress)?;
        for table in tables.all_mut() {
            let (unseen, bare) = (table.pop().unwrap_or_default(), table.pop().unwrap_or_default());
            for (t, class) in table.iter_mut().zip(&classes) {
                *t = match class.number {
                    0 => Complex64::ZERO,
                    _ => mixed(geometry, geometry.missing_pillars, *t, bare, unseen),
                };
            }
        }
        Ok(CellResponse::Jones(JonesTables::Polarised(tables)))
    }
}
