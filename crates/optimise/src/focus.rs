//! On-axis focal intensity: the rows of the merits `sum` and `log`, and the Strehl ratio by which every
//! design is judged.

use std::collections::BTreeMap;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::field::{Condition, FieldPoint};
use super::kernel::RingField;
use super::rings::Rings;
use metalith_cell::CellModel;
use metalith_core::{Error, Result, WidthMap};

/// A lens to optimise: its rings, and the sensor behind it.
#[derive(Clone, Debug)]
pub struct Lens {
    /// The rings of its lattice.
    pub rings: Rings,
    /// Distance from the tops of the pillars to the sensor (um).
    pub gap_um: f64,
}

/// One draw of what the cleanroom and the assembly get wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FabricationError {
    /// Made width less designed width (nm).
    pub width_bias_nm: f64,
    /// Which of the cells given, by their film height.
    pub cell: usize,
    /// Distance to the sensor less the designed one (um).
    pub gap_error_um: f64,
}

impl FabricationError {
    /// The condition at a wavelength.
    pub(super) fn at(self, wavelength_um: f64) -> Condition {
        Condition {
            wavelength_um,
            cell: self.cell,
            width_bias_nm: self.width_bias_nm,
        }
    }
}

impl Lens {
    /// A point of the field to which each ring contributes `field`.
    pub(super) fn field_point(
        &self,
        condition: Condition,
        weight: f32,
        field: impl Fn(usize) -> Complex64,
    ) -> FieldPoint {
        let single = |e: Complex64| Complex32::new(e.re as f32, e.im as f32);
        FieldPoint {
            condition,
            kernel: (0..self.rings.len()).map(|ring| single(field(ring))).collect(),
            weight,
        }
    }

    /// One row for each wavelength: the field at the focus, such that its intensity is the Strehl ratio.
    ///
    /// # Errors
    /// If a cell does not cover a wavelength.
    pub fn focal_rows(
        &self,
        wavelengths_um: &[f64],
        error: FabricationError,
        cells: &[&dyn CellModel],
    ) -> Result<Vec<FieldPoint>> {
        wavelengths_um
            .par_iter()
            .map(|&wavelength_um| {
                let full = cells[error.cell].full_transmission(wavelength_um)?;
                let field = RingField::new(&self.rings, wavelength_um, self.gap_um + error.gap_error_um);
                let scale = 1.0 / (full * field.matched());
                let weight = 1.0 / wavelengths_um.len() as f32;
                Ok(self.field_point(error.at(wavelength_um), weight, |ring| field.on_axis(ring) * scale))
            })
            .collect()
    }

    /// Strehl ratio on the axis at each wavelength, with pillars of `widths_nm[k]` in ring `k`: |E|^2
    /// against the same aperture passing all its power in the zero order with the perfect phase.
    ///
    /// # Errors
    /// If the cell does not cover a wavelength.
    pub fn strehl_of_rings(&self, widths_nm: &[u16], cell: &dyn CellModel, wavelengths_um: &[f64]) -> Result<Strehl> {
        let widest = widths_nm.iter().copied().max().unwrap_or(0);
        let ratio = wavelengths_um
            .par_iter()
            .map(|&wavelength_um| {
                let t = cell.transmissions(wavelength_um, widest)?;
                let field = RingField::new(&self.rings, wavelength_um, self.gap_um);
                let sum = (0..self.rings.len())
                    .map(|ring| field.on_axis(ring) * t[usize::from(widths_nm[ring])])
                    .sum::<Complex64>();
                Ok((sum / (field.matched() * cell.full_transmission(wavelength_um)?)).norm_sqr())
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Strehl::new(wavelengths_um, ratio))
    }

    /// The same from an array of pillars, such as one read back from a layout: a sum over every site,
    /// whatever its neighbours are.
    ///
    /// # Errors
    /// If the array is on another lattice, or the cell does not cover a wavelength or width.
    pub fn strehl_of_layout(&self, widths: &WidthMap, cell: &dyn CellModel, wavelengths_um: &[f64]) -> Result<Strehl> {
        if widths.lattice != self.rings.lattice() {
            return Err(Error::invalid(
                "the layout is on another lattice than the lens",
                "judge it with the design that it was made from",
            ));
        }
        // Sites at one distance with one width are one term.
        let mut terms = BTreeMap::<(i64, u16), u32>::new();
        for ((iy, ix), &width) in widths.width_nm.indexed_iter() {
            if width != 0 {
                *terms.entry((widths.lattice.units2(ix, iy), width)).or_default() += 1;
            }
        }
        let terms = terms.into_iter().collect::<Vec<_>>();
        let widest = terms.iter().map(|t| t.0.1).max().unwrap_or(0);
        let unit_um2 = widths.lattice.unit_um().powi(2);
        let ratio = wavelengths_um
            .par_iter()
            .map(|&wavelength_um| {
                let t = cell.transmissions(wavelength_um, widest)?;
                let field = RingField::new(&self.rings, wavelength_um, self.gap_um);
                let sum = terms
                    .iter()
                    .map(|&((r2, width), count)| {
                        f64::from(count) * field.point(r2 as f64 * unit_um2) * t[usize::from(width)]
                    })
                    .sum::<Complex64>();
                Ok((sum / (field.matched() * cell.full_transmission(wavelength_um)?)).norm_sqr())
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Strehl::new(wavelengths_um, ratio))
    }
}

/// Strehl ratio over wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct Strehl {
    /// Wavelengths (um).
    pub wavelength_um: Vec<f64>,
    /// Strehl ratio at each.
    pub ratio: Vec<f64>,
}

impl Strehl {
    fn new(wavelength_um: &[f64], ratio: Vec<f64>) -> Self {
        Self {
            wavelength_um: wavelength_um.to_vec(),
            ratio,
        }
    }

    /// Geometric mean: the figure of merit of a broadband design.
    pub fn geometric_mean(&self) -> f64 {
        (self.ratio.iter().map(|s| s.ln()).sum::<f64>() / self.ratio.len() as f64).exp()
    }

    /// Arithmetic mean.
    pub fn mean(&self) -> f64 {
        self.ratio.iter().sum::<f64>() / self.ratio.len() as f64
    }

    /// Smallest ratio.
    pub fn smallest(&self) -> f64 {
        self.ratio.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Wavelengths (um) from `first` to `last` inclusive, `step_nm` apart.
pub fn wavelengths(first_nm: f64, last_nm: f64, step_nm: f64) -> Vec<f64> {
    let count = ((last_nm - first_nm) / step_nm + 1e-9) as usize + 1;
    (0..count).map(|i| (first_nm + i as f64 * step_nm) * 1e-3).collect()
}

/// The grid of 0.5 nm on which designs are judged: between the points of any grid of whole or half
/// nanometres that they were optimised on.
pub fn judging_wavelengths(first_nm: f64, last_nm: f64) -> Vec<f64> {
    wavelengths(first_nm + 0.25, last_nm - 0.25, 0.5)
}
