//! On-axis focal intensity: the rows of the merits `sum` and `log`, and the Strehl ratio by which every
//! design is judged.

use std::collections::BTreeMap;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use crate::merit::field_point::{Condition, FieldPoint};
use crate::rings::kernel::RingField;
use crate::rings::neighbour_links::{distance_of, neighbour};
use crate::rings::pair_response::{PRODUCTS, PairResponse};
use crate::rings::sites::Rings;
use metalith_cell::{CellModel, NEIGHBOUR_DEGREE, NEIGHBOURS};
use metalith_core::{Error, Result};
use metalith_pillars::PillarMap;

/// A lens to optimise: its rings, and the sensor behind it.
#[derive(Clone, Debug)]
pub struct Lens {
    /// The rings of its lattice.
    pub rings: Rings,
    /// Distance from the tops of the pillars to the sensor (um).
    pub distance_um: f64,
}

/// One draw of what the cleanroom and the assembly get wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FabricationError {
    /// Made width less designed width (nm).
    pub width_bias_nm: f64,
    /// Index of the cell among the cells given, by their film height.
    pub cell: usize,
    /// Distance to the sensor less the designed one (um).
    pub defocus_um: f64,
}

impl FabricationError {
    /// The condition at a wavelength.
    pub(crate) fn at(self, wavelength_um: f64) -> Condition {
        Condition {
            wavelength_um,
            cell: self.cell,
            width_bias_nm: self.width_bias_nm,
        }
    }
}

impl Lens {
    /// A point of the field to which each ring contributes `field`.
    pub(crate) fn field_point(
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
                let field = RingField::new(&self.rings, wavelength_um, self.distance_um + error.defocus_um);
                let scale = 1.0 / (full * field.matched());
                let weight = 1.0 / wavelengths_um.len() as f32;
                Ok(self.field_point(error.at(wavelength_um), weight, |ring| field.on_axis(ring) * scale))
            })
            .collect()
    }

    /// The mean transmission of the sites of each ring, with pillars of `widths_nm[k]` in ring `k`.
    ///
    /// # Errors
    /// If the cell does not cover the wavelength.
    pub fn transmissions_of_rings(
        &self,
        widths_nm: &[u16],
        cell: &dyn CellModel,
        wavelength_um: f64,
    ) -> Result<Vec<Complex64>> {
        match PairResponse::of(cell, wavelength_um, widths_nm.iter().copied())? {
            Some(unlike) => Ok(unlike.of_rings(&self.rings, widths_nm)),
            None => among_equals(widths_nm, cell, wavelength_um),
        }
    }

    /// Strehl ratio on the axis at each wavelength, with pillars of `widths_nm[k]` in ring `k`: |E|^2
    /// against the same aperture passing all its power in the zero order with the perfect phase.
    ///
    /// # Errors
    /// If the cell does not cover a wavelength.
    pub fn strehl_of_rings(&self, widths_nm: &[u16], cell: &dyn CellModel, wavelengths_um: &[f64]) -> Result<Strehl> {
        let ratio = wavelengths_um
            .par_iter()
            .map(|&wavelength_um| {
                let field = RingField::new(&self.rings, wavelength_um, self.distance_um);
                let sum = if let Some(unlike) = PairResponse::of(cell, wavelength_um, widths_nm.iter().copied())? {
                    unlike.on_axis(&self.rings, &field, widths_nm)
                } else {
                    let t = among_equals(widths_nm, cell, wavelength_um)?;
                    t.iter().enumerate().map(|(ring, t)| field.on_axis(ring) * t).sum()
                };
                Ok((sum / (field.matched() * cell.full_transmission(wavelength_um)?)).norm_sqr())
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Strehl::new(wavelengths_um, ratio))
    }

    /// Strehl ratio from an array of pillars, such as one read back from a layout: a sum over every site.
    ///
    /// # Errors
    /// If the array is on another lattice, or the cell does not cover a wavelength or width.
    pub fn strehl_of_layout(&self, widths: &PillarMap, cell: &dyn CellModel, wavelengths_um: &[f64]) -> Result<Strehl> {
        if widths.lattice != self.rings.lattice() {
            return Err(Error::refused(
                "optimise/lattices-differ",
                "the lattice of the layout differs from the lattice of the lens",
                "compare it with the design that it was made from",
            ));
        }
        let drawn: Vec<u16> = (1..)
            .zip(&widths.histogram()[1..])
            .filter(|(_, n)| **n > 0)
            .map(|(w, _)| w)
            .collect();
        let unlike = |wavelength_um: f64| PairResponse::of(cell, wavelength_um, drawn.iter().copied());
        let neighbour = match wavelengths_um.first() {
            Some(um) => unlike(*um)?.map(|u| u.neighbour),
            None => None,
        };
        // Sites at one distance with one width are one term.
        let mut terms = BTreeMap::<(i64, u16), EqualSites>::new();
        for ((iy, ix), &width) in widths.number.indexed_iter().filter(|(_, w)| **w != 0) {
            let alike = terms.entry((widths.lattice.units2(ix, iy), width)).or_default();
            alike.count += 1;
            if let Some(neighbour) = &neighbour {
                alike.add_neighbours(widths, [ix, iy], neighbour);
            }
        }
        let terms = terms.into_iter().collect::<Vec<_>>();
        let widest = drawn.last().copied().unwrap_or(0);
        let unit_um2 = widths.lattice.unit_um().powi(2);
        let ratio = wavelengths_um
            .par_iter()
            .map(|&wavelength_um| {
                let unlike = unlike(wavelength_um)?;
                let table = match &unlike {
                    Some(unlike) => unlike.own.clone(),
                    None => cell.transmissions(wavelength_um, widest)?,
                };
                let field = RingField::new(&self.rings, wavelength_um, self.distance_um);
                let of = |&((r2, width), ref alike): &((i64, u16), EqualSites)| {
                    let width = usize::from(width);
                    let mut t = f64::from(alike.count) * table[width];
                    if let Some(unlike) = &unlike {
                        let each = unlike.factors[width].iter().zip(alike.neighbours);
                        t += each.map(|(factor, sum)| factor * sum).sum::<Complex64>();
                    }
                    field.point(r2 as f64 * unit_um2) * t
                };
                let sum = terms.iter().map(of).sum::<Complex64>();
                Ok((sum / (field.matched() * cell.full_transmission(wavelength_um)?)).norm_sqr())
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Strehl::new(wavelengths_um, ratio))
    }
}

/// Transmission of pillars of these widths, each in a lattice of its equals.
fn among_equals(widths_nm: &[u16], cell: &dyn CellModel, wavelength_um: f64) -> Result<Vec<Complex64>> {
    let widest = widths_nm.iter().copied().max().unwrap_or(0);
    let t = cell.transmissions(wavelength_um, widest)?;
    Ok(widths_nm.iter().map(|w| t[usize::from(*w)]).collect())
}

/// Sites at one distance from the axis with one width.
#[derive(Clone, Copy, Default)]
struct EqualSites {
    count: u32,
    /// Factors of the widths of all their neighbours, as [`PairResponse::factors`] has the own ones.
    neighbours: [f64; PRODUCTS],
}

impl EqualSites {
    fn add_neighbours(&mut self, widths: &PillarMap, site: [usize; 2], factors: &[[f64; NEIGHBOUR_DEGREE]]) {
        for offset in NEIGHBOURS {
            let at = neighbour(site, offset, widths.lattice.sites());
            let width = at.map_or(0, |[x, y]| widths.number[(y, x)]);
            if width != 0 {
                let to = &mut self.neighbours[distance_of(offset) * NEIGHBOUR_DEGREE..];
                to.iter_mut()
                    .zip(&factors[usize::from(width)])
                    .for_each(|(to, v)| *to += v);
            }
        }
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
