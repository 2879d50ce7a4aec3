//! Rectangles as fabricated: light of both polarisations that they distinguish, and what of it reaches the sensor.

mod cache;
mod rows;
mod solved;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use num_complex::Complex64;

use rows::RowOrders;
pub(crate) use rows::{bare_row, row_length, solve_rotated, solve_upright};

use self::solved::SolvedRectangles;
use super::realised_cells::SolvedWidths;
use super::{CalibratedModel, CellBank, CellChange, DeclaredQuantity};
use metalith_cell::{
    BAND_ORDERS, CellStack, CircularTables, FocusedLight, Handedness, LinearTables, ORDERS, PassedTable,
    PolarisationAxis, PolarisedTables, RotationSamples, Spectral, UPRIGHT_ORDERS,
};
use metalith_core::{Error, Progress, Result};
use metalith_pillars::{PillarShape, PolarisationBasis, Rectangles, RotatedRectangles};

/// A class of rectangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectangleClass {
    /// Number; zero is a site without pillar.
    pub number: u16,
    /// Error of both edges (nm).
    pub bias_nm: f64,
}

impl RectangleClass {
    /// Class of sites whose pillar is missing.
    pub const WITHOUT_PILLAR: Self = Self {
        number: 0,
        bias_nm: 0.0,
    };
}

/// A wavelength (um), and how closely it is looked at.
pub(super) type Colour = (f64, Spectral);

/// Diffraction orders an axis that a bank of pillars of a shape is solved with at single wavelengths. Those of upright rectangles are as many
/// as of pillars as drawn: with fewer, those of a lens beside a resonance have a Strehl ratio that is off by two in a hundred.
pub fn bank_orders(shape: PillarShape) -> usize {
    match shape.basis() {
        Some(PolarisationBasis::Linear) => UPRIGHT_ORDERS,
        _ => ORDERS,
    }
}

/// A row for each bias, and one for a site without pillar: see [`rows`].
pub(crate) type RowsOfBiases = (Vec<Vec<Complex64>>, Vec<Complex64>);

/// Source of rows.
enum RowSource {
    Bank(Arc<CellBank>),
    Solved(Box<SolvedRectangles>),
}

/// The rectangles of a chip.
pub(super) struct AsBuiltRectangles {
    pillars: Rectangles,
    focused: FocusedLight,
    source: RowSource,
}

impl AsBuiltRectangles {
    /// Rectangles of a stack, which focus `focused`; solved where they are needed.
    ///
    /// # Errors
    /// If they are no such rectangles, or the model has what they have no meaning for.
    pub(crate) fn new(stated: &CellStack, model: &CalibratedModel, focused: FocusedLight) -> Result<Self> {
        let fits = stated.shape.basis() == Some(focused.basis());
        let (true, PillarShape::Rectangle(pillars)) = (fits, stated.shape) else {
            return Err(Error::refused(
                "light/not-focused",
                "the light has a polarisation that these pillars do not focus",
                "give circular polarisation for rotated rectangles, linear polarisation for upright ones, and none for other pillars",
            ));
        };
        model.check_shape(stated.shape)?;
        Ok(Self {
            pillars,
            focused,
            source: RowSource::Solved(Box::new(SolvedRectangles::new(stated.clone(), pillars))),
        })
    }

    /// These rectangles, whose solved rows are cached in a folder from one run to the next.
    pub(crate) fn cached_in(mut self, folder: Option<&Path>) -> Self {
        if let RowSource::Solved(solved) = &mut self.source {
            solved.folder = folder.map(Path::to_owned);
        }
        self
    }

    /// These rectangles with all rows from a bank of the same pillars.
    pub(crate) fn of_bank(self, bank: &Arc<CellBank>) -> Self {
        Self {
            source: RowSource::Bank(Arc::clone(bank)),
            ..self
        }
    }

    /// Tables of each class for light of both polarisations; after them a site without pillar, and one that light
    /// passes as it is.
    ///
    /// # Errors
    /// If a cell cannot be solved, or is not in the bank; also if the user stopped it.
    pub(crate) fn tables(
        &self,
        change: &CellChange,
        classes: &[RectangleClass],
        (um, spectral): Colour,
        progress: &dyn Progress,
    ) -> Result<PolarisedTables> {
        let mut places: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (class, RectangleClass { bias_nm, .. }) in classes.iter().enumerate().filter(|(_, c)| c.number > 0) {
            places.entry(bias_nm.to_bits()).or_default().push(class);
        }
        let (keys, members): (Vec<_>, Vec<Vec<usize>>) = places.into_iter().unzip();
        let biases: Vec<f64> = keys.into_iter().map(f64::from_bits).collect();
        let mut numbers: Vec<u16> = classes.iter().map(|c| c.number).filter(|n| *n > 0).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let (rows, bare) = match &self.source {
            RowSource::Bank(bank) => {
                let orders = spectral.choose(bank_orders(bank.stated().shape), BAND_ORDERS);
                bank.rectangles(change, (um, orders), &biases, &numbers)?
            }
            RowSource::Solved(solved) => solved.rows(change, (um, spectral), &biases, &numbers, progress)?,
        };
        let found = Found {
            classes,
            members: &members,
            numbers: &numbers,
            rows: &rows,
            bare: &bare,
        };
        Ok(match (self.pillars, self.focused) {
            (Rectangles::Rotated(pillars), FocusedLight::Circular(hand)) => {
                PolarisedTables::Hands(found.hands(pillars, hand))
            }
            (_, FocusedLight::Linear(axis)) => PolarisedTables::Axes(found.axes(axis)),
            (Rectangles::Upright(_), FocusedLight::Circular(_)) => unreachable!("checked when they were made"),
        })
    }

    /// Solved widths from tables of light that leaves such classes: one table for all light that interferes with no
    /// other.
    pub(crate) fn solved(leaving: Vec<PassedTable>) -> SolvedWidths {
        let mut solved = SolvedWidths {
            pillars: Vec::new(),
            bare: Vec::new(),
            unseen: Vec::new(),
            share: 1.0,
            rim: None,
        };
        for mut table in leaving.into_iter().map(|p| p.table) {
            solved.unseen.extend(table.pop());
            solved.bare.extend(table.pop());
            solved.pillars.push(table);
        }
        solved
    }
}

impl CalibratedModel {
    /// Succeeds if all that the model says has a meaning for pillars of this shape.
    ///
    /// # Errors
    /// If they are rectangles and it says what counts for one width alone.
    pub fn check_shape(&self, shape: PillarShape) -> Result<()> {
        if shape.has_width() {
            Ok(())
        } else {
            check_rectangles(self)
        }
    }
}

/// Fails for what has no meaning for rectangles.
fn check_rectangles(model: &CalibratedModel) -> Result<()> {
    let (geometry, cell) = (&model.perturbation.geometry, &model.perturbation.cell);
    if !geometry.transmission.is_empty() || !geometry.transmission_phase_rad.is_empty() {
        return Err(Error::refused(
            "model/transmission-with-rectangles",
            "the pillars are rectangles, and the transmission of the model depends on one width",
            "give a model without `transmission` and `transmission_phase_rad`: rectangles have two edges",
        ));
    }
    if cell.corner_rounding_nm != 0.0 {
        return Err(Error::refused(
            "model/rounded-rectangles",
            "the pillars are rectangles, and the model rounds corners",
            "set `corner_rounding_nm = 0` in [perturbation.cell] of the model: rectangles are solved with sharp corners",
        ));
    }
    let by_width = geometry.declared.iter().find(|term| {
        let of_width = term.quantity == DeclaredQuantity::WidthNm;
        of_width && term.compiled().is_ok_and(|compiled| compiled.uses("w"))
    });
    match by_width {
        Some(term) => Err(Error::refused(
            "model/declared-width-with-rectangles",
            format!(
                "the declared width `{}` depends on the drawn width `w`, which rectangles do not have",
                term.name
            ),
            "declare it by `fill` and places only: rectangles have two edges",
        )),
        None => Ok(()),
    }
}

/// Rows that were found for classes.
struct Found<'a> {
    classes: &'a [RectangleClass],
    /// Classes of each row.
    members: &'a [Vec<usize>],
    /// Numbers of the pillars that rows of upright rectangles have, rising.
    numbers: &'a [u16],
    rows: &'a [Vec<Complex64>],
    bare: &'a [Complex64],
}

impl Found<'_> {
    /// A table of all sites without pillar, and the one that light passes as it is.
    fn room(&self, bare: Complex64, passes: Complex64) -> Vec<Complex64> {
        let mut room = vec![bare; self.classes.len() + 2];
        room[self.classes.len() + 1] = passes;
        room
    }

    fn hands(&self, pillars: RotatedRectangles, focused: Handedness) -> CircularTables {
        let bare = RotationSamples::of_numbers(self.bare).hands(pillars, &[0], focused);
        let mut all = CircularTables {
            focused,
            converted: bare.converted.each_ref().map(|t| self.room(t[0], Complex64::ZERO)),
            unconverted: bare.unconverted.each_ref().map(|t| self.room(t[0], Complex64::ONE)),
            rotation: None,
        };
        for (row, members) in self.rows.iter().zip(self.members) {
            let numbers: Vec<u16> = members.iter().map(|class| self.classes[*class].number).collect();
            let own = RotationSamples::of_numbers(row).hands(pillars, &numbers, focused);
            let tables = all.converted.iter_mut().zip(own.converted);
            for (to, from) in tables.chain(all.unconverted.iter_mut().zip(own.unconverted)) {
                members.iter().zip(from).for_each(|(class, t)| to[*class] = t);
            }
        }
        all
    }

    fn axes(&self, focused: PolarisationAxis) -> LinearTables {
        let along = PolarisationAxis::ALL.map(|axis| {
            let mut table = self.room(self.bare.first().copied().unwrap_or_default(), Complex64::ONE);
            for (row, members) in self.rows.iter().zip(self.members) {
                for class in members {
                    let place = self.numbers.partition_point(|n| *n < self.classes[*class].number);
                    table[*class] = row[2 * place + axis.index()];
                }
            }
            table
        });
        LinearTables { focused, along }
    }
}

#[cfg(test)]
mod tests;
