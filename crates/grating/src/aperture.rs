//! The pillars of an element, each in the local grating that it stands in.

use std::collections::HashMap;
use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};

use metalith_core::{Error, Result};
use metalith_pillars::{Lattice, PillarMap};
use metalith_wave::Aperture;

use crate::node::{FIRST_KEPT, KEPT};
use crate::slopes::BLOCK;
use crate::{GratingTable, Mapping, Orientation, SlopeMap};

/// Grating vectors closer than this share a table (turns a site): the phase of the first order changes by a hundredth
/// of a radian over it.
const BIN: f64 = 0.002;

/// The cell that widths transmit as which the mapping does not draw.
#[derive(Clone, Debug)]
pub struct LocalCell<'a> {
    /// Transmission with the width (nm) as index.
    pub by_width: &'a [Complex64],
    /// |t| of a cell that passes all its power in the zero order.
    pub full: f64,
}

/// Pillars that transmit as they do among the neighbours that the slope of the design's phase gives them:
///
/// t(w; K) = sum over the kept orders m of c_m(K) exp(i 2 pi m u(w)),
///
/// where u(w) is the phase that the width stands for and c_m(K) the amplitude of order m of the grating with vector K.
/// The orders of a cell of a lattice of equal pillars are not added: resonances that neighbours suppress would stay in
/// them. Widths that the mapping does not draw transmit as such a cell.
#[derive(Clone, Debug)]
pub struct GratingPillars<'a> {
    widths: &'a PillarMap,
    slopes: &'a SlopeMap,
    radius_um: f64,
    /// Column of each drawn width (nm).
    columns: Vec<u16>,
    /// Index of the table of each block, as in [`SlopeMap::all`].
    bins: Vec<u32>,
    blocks: usize,
    /// Transmissions of all columns, one table after the other.
    tables: Vec<Complex32>,
    width: usize,
}

impl<'a> GratingPillars<'a> {
    /// `orientation` turns grating vectors of the element to those of the table; `polarisation` is 0 for s, 1 for p of
    /// the element's light.
    ///
    /// # Errors
    /// If a width is beyond the table of the cell.
    pub fn new(
        widths: &'a PillarMap,
        slopes: &'a SlopeMap,
        mapping: &Mapping,
        table: &GratingTable,
        orientation: &Orientation,
        local: &LocalCell<'_>,
        polarisation: usize,
    ) -> Result<Self> {
        let drawn = drawn_widths(widths);
        let last = drawn.last().copied().unwrap_or(0);
        let by_width = local.by_width;
        if usize::from(last) >= by_width.len() {
            return Err(Error::refused(
                "grating/width-out-of-range",
                format!(
                    "a pillar {last} nm wide for a cell up to {} nm",
                    by_width.len().saturating_sub(1)
                ),
                "solve the cell up to the widest pillar",
            ));
        }
        let mut columns = vec![0; usize::from(last) + 1];
        for (column, width) in drawn.iter().enumerate() {
            columns[usize::from(*width)] = column as u16;
        }
        let polarisation = orientation.polarisation(polarisation);
        let mut numbers: HashMap<[i32; 2], u32> = HashMap::new();
        let mut tables = Vec::new();
        let mut bins = Vec::with_capacity(slopes.all().len());
        for slope in slopes.all() {
            let bin = orientation.turned(*slope).map(|k| (k / BIN).round() as i32);
            let number = *numbers.entry(bin).or_insert_with(|| {
                let number = (tables.len() / drawn.len().max(1)) as u32;
                let found = table.amplitudes(bin.map(|b| f64::from(b) * BIN))[polarisation];
                let orders = found.map(|c| c * local.full);
                tables.extend(
                    drawn
                        .iter()
                        .map(|&width| single(transmission(width, mapping, &orders, by_width))),
                );
                number
            });
            bins.push(number);
        }
        Ok(Self {
            radius_um: widths.circle_um(),
            blocks: widths.lattice.sites().div_ceil(BLOCK),
            widths,
            slopes,
            columns,
            bins,
            tables,
            width: drawn.len(),
        })
    }

    /// The grating vector of a site (turns a site along x and y).
    pub fn slope(&self, ix: usize, iy: usize) -> [f64; 2] {
        self.slopes.at(ix, iy)
    }
}

impl Aperture for GratingPillars<'_> {
    fn lattice(&self) -> Lattice {
        self.widths.lattice
    }

    fn radius_um(&self) -> f64 {
        self.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let widths = self.widths.number.row(iy);
        let bins = &self.bins[iy / BLOCK * self.blocks..];
        for (ix, (t, &width)) in row.iter_mut().zip(widths).enumerate() {
            let table = bins[ix / BLOCK] as usize * self.width;
            *t = self.tables[table + usize::from(self.columns[usize::from(width)])];
        }
    }
}

/// Transmission of a drawn width in a grating of these orders; nothing without a pillar.
fn transmission(width: u16, mapping: &Mapping, orders: &[Complex64; KEPT], by_width: &[Complex64]) -> Complex64 {
    if width == 0 {
        return Complex64::ZERO;
    }
    let Some(u) = mapping.phase(width) else {
        return by_width[usize::from(width)];
    };
    let step = Complex64::cis(TAU * u);
    let lowest = Complex64::cis(TAU * f64::from(FIRST_KEPT) * u);
    // Horner's rule, from the highest order down.
    orders.iter().rev().fold(Complex64::ZERO, |sum, c| sum * step + c) * lowest
}

/// Widths of an element (nm), rising from 0, each once.
fn drawn_widths(widths: &PillarMap) -> Vec<u16> {
    let counts = widths.histogram().into_iter().enumerate();
    counts
        .filter(|(w, n)| *w == 0 || *n > 0)
        .map(|(w, _)| w as u16)
        .collect()
}

fn single(t: Complex64) -> Complex32 {
    Complex32::new(t.re as f32, t.im as f32)
}
