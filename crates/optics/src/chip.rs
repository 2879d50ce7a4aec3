//! The chip as made: a stated cell and a perturbation, for any layout and light.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use num_complex::Complex64;
use serde::Serialize;

use super::cells::{RealisedCells, SolvedWidths};
use super::rectangles::{MadeRectangles, RectangleColour};
use super::stack::to_middle_tops;
use super::{
    Applied, ArrivingLight, AsBuiltElement, CalibratedModel, CameraChange, CellBank, CellChange, ClassTable,
    DrawnElement, NotApplied, Perturbation, RectangleClass, cell_direction, mixed, realised_nm,
};
use metalith_cell::{CellStack, LitStack, PassedTable, PolarisedLight, PolarisedTables};
use metalith_core::{Error, Progress, Result};
use metalith_pillars::PillarMap;
use metalith_wave::Psf;
use metalith_wave::{Accuracy, FoldedPropagator, PlaneWave, Propagator, Scratch, Window};

/// Chips of one line and bench, by its calibrated model.
pub struct AsBuiltChip {
    model: CalibratedModel,
    cells: RealisedCells,
    /// Rectangles, which stand for the cells where pillars are rectangles.
    rectangles: Option<MadeRectangles>,
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

/// One made element in one light: everything between a wave that arrives and the PSF on the sensor.
pub struct AsBuiltOptics<'a> {
    pub element: &'a AsBuiltElement,
    /// Transmissions of sites, as [`SolvedWidths`] has them.
    pub tables: Vec<ClassTable>,
    /// Share of the light that arrives that is in the polarisation of each table. What leaves by different tables does
    /// not interfere: intensities are added.
    pub share: f64,
    pub light: ArrivingLight,
    /// Added to the distance of the sensor (um).
    pub gap_um: f64,
    pub camera: CameraChange,
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
                "model/refused",
                all.join("\n"),
                "correct the calibrated model",
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
    pub fn in_light(stated: &LitStack, model: &CalibratedModel) -> Result<Self> {
        let made = Self::new(&stated.stack, model)?;
        let of = |focused| MadeRectangles::new(&stated.stack, model, focused, stated.polarised);
        let rectangles = stated.focused.map(of);
        Ok(Self {
            rectangles: rectangles.transpose()?,
            ..made
        })
    }

    /// Same chip, whose rectangles, which take longer to solve than pillars of one width, are cached in a folder from
    /// one run to the next: see [`metalith_cell::cache_folder`].
    #[must_use]
    pub fn kept_in(self, folder: Option<&Path>) -> Self {
        Self {
            rectangles: self.rectangles.map(|rectangles| rectangles.kept_in(folder)),
            ..self
        }
    }

    /// Same chip with all cells from a bank of the stated pillar: nothing is solved.
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

    /// A made element in the light of a stated wave; `as_lit` solves the cells at the angle at which light
    /// arrives, for both polarisations, instead of along the normal.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn view<'a>(
        &self,
        element: &'a AsBuiltElement,
        stated: &PlaneWave,
        as_lit: bool,
        progress: &dyn Progress,
    ) -> Result<AsBuiltOptics<'a>> {
        let sines = self.cell_sines(element, stated, as_lit);
        let colour = RectangleColour::Single(stated.wavelength_um);
        let solved = match self.passed(element, colour, as_lit, progress)? {
            Some(solved) => solved,
            None => self
                .cells
                .solve(element.widths_nm(), stated.wavelength_um, sines, progress)?,
        };
        Ok(self.viewed(element, stated, &solved))
    }

    /// Variant of [`AsBuiltChip::view`] along the normal, for pillars that distinguish polarisations, in this light
    /// instead of the chip's.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn view_in<'a>(
        &self,
        element: &'a AsBuiltElement,
        stated: &PlaneWave,
        light: PolarisedLight,
        progress: &dyn Progress,
    ) -> Result<AsBuiltOptics<'a>> {
        let Some(rectangles) = &self.rectangles else {
            return self.view(element, stated, false, progress);
        };
        let colour = RectangleColour::Single(stated.wavelength_um);
        let passed = |tables: &PolarisedTables| tables.passed(light);
        let solved = self.through(rectangles, element, colour, &passed, progress)?;
        Ok(self.viewed(element, stated, &solved))
    }

    /// Variant of [`AsBuiltChip::view`] for one of many wavelengths that a band is averaged over: cells are solved more
    /// coarsely, see [`RealisedCells::solve_in_band`].
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn view_in_band<'a>(
        &self,
        element: &'a AsBuiltElement,
        stated: &PlaneWave,
        as_lit: bool,
        progress: &dyn Progress,
    ) -> Result<AsBuiltOptics<'a>> {
        let sines = self.cell_sines(element, stated, as_lit);
        let colour = RectangleColour::OfBand(stated.wavelength_um);
        let solved = match self.passed(element, colour, as_lit, progress)? {
            Some(solved) => solved,
            None => self
                .cells
                .solve_in_band(element.widths_nm(), stated.wavelength_um, sines, progress)?,
        };
        Ok(self.viewed(element, stated, &solved))
    }

    /// Light that reaches the sensor behind the classes of rectangles; `None` for other pillars.
    fn passed(
        &self,
        element: &AsBuiltElement,
        colour: RectangleColour,
        as_lit: bool,
        progress: &dyn Progress,
    ) -> Result<Option<SolvedWidths>> {
        let Some(rectangles) = &self.rectangles else {
            return Ok(None);
        };
        if as_lit {
            return Err(RealisedCells::along_normal_alone());
        }
        let passed = |tables: &PolarisedTables| tables.passed(rectangles.polarised);
        self.through(rectangles, element, colour, &passed, progress).map(Some)
    }

    /// Part of the light behind the classes of rectangles that `leaving` takes.
    fn through(
        &self,
        rectangles: &MadeRectangles,
        element: &AsBuiltElement,
        colour: RectangleColour,
        leaving: &dyn Fn(&PolarisedTables) -> Vec<PassedTable>,
        progress: &dyn Progress,
    ) -> Result<SolvedWidths> {
        let of = |change: &CellChange| -> Result<SolvedWidths> {
            let tables = rectangles.tables(change, element.rectangles(), colour, progress)?;
            Ok(MadeRectangles::solved(leaving(&tables)))
        };
        let change = &self.perturbation().cell;
        let mut solved = of(&change.in_the_middle())?;
        if let Some(rim) = change.at_the_rim() {
            let mut rim = of(&rim)?;
            let phase = to_middle_tops(self.cells.stack(), change.rim_height_nm, colour.um())?;
            let all = rim.pillars.iter_mut().flatten().chain(&mut rim.bare);
            all.for_each(|t| *t *= phase);
            solved.rim = Some(Box::new(rim));
        }
        Ok(solved)
    }

    /// The direction that cells of an element are solved for.
    fn cell_sines(&self, element: &AsBuiltElement, stated: &PlaneWave, as_lit: bool) -> [f64; 2] {
        if as_lit {
            let plane = ArrivingLight::new(stated, &self.perturbation().path).plane;
            cell_direction(&plane, element.lattice().kind())
        } else {
            [0.0; 2]
        }
    }

    fn viewed<'a>(&self, element: &'a AsBuiltElement, stated: &PlaneWave, solved: &SolvedWidths) -> AsBuiltOptics<'a> {
        let light = ArrivingLight::new(stated, &self.perturbation().path);
        AsBuiltOptics::new(element, light, self.perturbation(), solved)
    }
}

impl AsBuiltChip {
    /// Transmission of each class of rectangles along the normal by the direction in which light leaves, for one of
    /// many wavelengths of a band. Each table has the multiple of the phase of the element in it, as
    /// [`PolarisedTables::departing`]. None of other pillars.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn departing_in_band(
        &self,
        element: &AsBuiltElement,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<(ClassTable, i32)>>> {
        let Some(rectangles) = &self.rectangles else {
            return Ok(None);
        };
        let orders = RefCell::new(Vec::new());
        let departing = |tables: &PolarisedTables| {
            let departing = tables.departing(rectangles.polarised);
            *orders.borrow_mut() = departing.iter().map(|p| p.order).collect();
            departing
        };
        let colour = RectangleColour::OfBand(wavelength_um);
        let solved = self.through(rectangles, element, colour, &departing, progress)?;
        let view = self.viewed(element, &PlaneWave::normal(wavelength_um), &solved);
        Ok(Some(view.tables.into_iter().zip(orders.into_inner()).collect()))
    }

    /// Transmission of each class of an element along the normal of the light that has the phase of the design, in
    /// whatever light the chip is simulated.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn focused_table(
        &self,
        element: &AsBuiltElement,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<ClassTable> {
        let stated = PlaneWave::normal(wavelength_um);
        let view = match &self.rectangles {
            None => self.view(element, &stated, false, progress)?,
            Some(_) => self.view_in(element, &stated, PolarisedLight::default(), progress)?,
        };
        let mut tables = view.tables.into_iter();
        Ok(tables.next().expect("light that is focused passes"))
    }

    /// Response of rectangles with these numbers to light of both polarisations along the normal, by their number, with
    /// missing pillars and unmodulated light mixed in, and the light that they are in; `None` for other pillars.
    /// `density_steps` as for [`AsBuiltChip::drawn_widths`].
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn drawn_rectangles(
        &self,
        numbers: &[u16],
        density_steps: i32,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<Option<(PolarisedTables, PolarisedLight)>> {
        let Some(rectangles) = &self.rectangles else {
            return Ok(None);
        };
        let (geometry, change) = (&self.perturbation().geometry, self.perturbation().cell.in_the_middle());
        let bias_nm = realised_nm(0, geometry, density_steps);
        let last = numbers.iter().copied().max().unwrap_or(0);
        let mut classes = vec![RectangleClass::WITHOUT_PILLAR; usize::from(last) + 1];
        for &number in numbers {
            classes[usize::from(number)] = RectangleClass { number, bias_nm };
        }
        let colour = RectangleColour::Single(wavelength_um);
        let mut tables = rectangles.tables(&change, &classes, colour, progress)?;
        for table in tables.all_mut() {
            let (unseen, bare) = (table.pop().unwrap_or_default(), table.pop().unwrap_or_default());
            for (t, class) in table.iter_mut().zip(&classes) {
                *t = match class.number {
                    0 => Complex64::ZERO,
                    _ => mixed(geometry, geometry.missing_pillars, *t, bare, unseen),
                };
            }
        }
        Ok(Some((tables, rectangles.polarised)))
    }

    /// Transmission of pillars drawn this wide (nm) along the normal where so many steps of density are added to their
    /// width (see [`super::realised_nm`]), with missing pillars and unmodulated light mixed in.
    ///
    /// # Errors
    /// As [`AsBuiltChip::view`].
    pub fn drawn_widths(
        &self,
        drawn_nm: &[u16],
        density_steps: i32,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<Complex64>> {
        let geometry = &self.perturbation().geometry;
        let widths: Vec<f64> = drawn_nm
            .iter()
            .map(|w| realised_nm(*w, geometry, density_steps))
            .collect();
        let solved = self.cells.solve(&widths, wavelength_um, [0.0; 2], progress)?;
        let pairs = solved.pillars[0].iter().zip(&widths);
        Ok(pairs
            .map(|(t, w)| {
                let pillar = t * geometry.transmission_factor(*w);
                mixed(
                    geometry,
                    geometry.missing_pillars,
                    pillar,
                    solved.bare[0],
                    Complex64::ONE,
                )
            })
            .collect())
    }
}

impl<'a> AsBuiltOptics<'a> {
    /// A made element in a light, behind the path and before the camera of a chip; `solved`: transmission of its widths.
    pub fn new(
        element: &'a AsBuiltElement,
        light: ArrivingLight,
        perturbation: &Perturbation,
        solved: &SolvedWidths,
    ) -> Self {
        let tables = |solved: &SolvedWidths| -> Vec<ClassTable> {
            let polarisations = solved.pillars.iter().zip(&solved.bare).zip(&solved.unseen);
            polarisations
                .map(|((t, bare), unseen)| element.table_of(t, *bare, *unseen))
                .collect()
        };
        let mut own = tables(solved);
        if let Some(rim) = &solved.rim {
            let pairs = own.iter_mut().zip(tables(rim));
            pairs.for_each(|(table, rim)| table.set_rim(&rim));
        }
        Self {
            element,
            share: solved.share,
            tables: own,
            light,
            gap_um: perturbation.path.added_distance_um(element.centre_um()),
            camera: perturbation.camera.clone(),
        }
    }

    /// The PSF on a window at the stated distance of the sensor; where the sensor stands farther off, the window
    /// keeps its place in it; with the transfer of all light at `lp_mm` (line pairs a millimetre). Missing pillars scatter evenly over the window, blur and veil of the camera follow.
    ///
    /// # Errors
    /// If the window is none, or the light arrives too steeply.
    pub fn psf(&self, stated: Window, accuracy: Accuracy, lp_mm: &[f64], scratch: &mut Scratch) -> Result<Psf> {
        let window = Window {
            distance_um: stated.distance_um + self.gap_um,
            ..stated
        };
        let (lattice, wavelength_um) = (self.element.lattice(), self.light.plane.wavelength_um);
        let fold = FoldedPropagator::plan(lattice, self.element.radius_um(), wavelength_um, window, accuracy)?;
        self.psf_by(&fold, lp_mm, scratch)
            .map(|psf| Psf { window: stated, ..psf })
    }

    /// PSF by a propagator of the caller's, whose window is at the distance as fabricated.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    pub fn psf_by(&self, propagator: &dyn Propagator, lp_mm: &[f64], scratch: &mut Scratch) -> Result<Psf> {
        let psfs = self
            .tables
            .iter()
            .map(|table| {
                let aperture = self.element.lit_aperture(table, &self.light);
                let mut psf = Psf::formed(propagator, &aperture, &self.light.plane, lp_mm, scratch)?;
                psf.values += self.scattered(table, psf.window.centre_um, psf.window.distance_um);
                if let Some(otf) = &mut psf.otf {
                    otf.power_um2 += table.scattered * self.element.lattice().cell_um2();
                }
                Ok(psf)
            })
            .collect::<Result<Vec<_>>>()?;
        let mut psf = Psf::sum(psfs, self.share);
        self.camera.apply(&mut psf);
        Ok(psf)
    }

    fn scattered(&self, table: &ClassTable, at_um: [f64; 2], distance_um: f64) -> f64 {
        let um = self.light.plane.wavelength_um;
        table.scattered * spread(self.element.lattice().cell_um2(), at_um, distance_um, um)
    }
}

/// Intensity at a place on the sensor for a unit of |t|^2 that one site scatters on its own: the square of a term
/// of the Rayleigh-Sommerfeld sum, far from the site, that of the element's centre for all. `cell_um2` is the area of the cell of a site; lengths in um.
pub fn spread(cell_um2: f64, at_um: [f64; 2], distance_um: f64, wavelength_um: f64) -> f64 {
    let [x, y] = at_um;
    let r2 = x * x + y * y + distance_um * distance_um;
    (cell_um2 / (wavelength_um * r2) * distance_um).powi(2)
}
