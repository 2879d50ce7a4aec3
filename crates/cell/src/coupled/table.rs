//! Responses of pillars among dissimilar neighbours for one light: fitted to supercells, and kept.

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use metalith_core::{Error, Progress, Result};
use metalith_rcwa::SiteLattice;

use super::coarse_cell::coarse;
use super::fit::{Fitted, fit, neighbours_nm, samples};
use super::training::{self, TrainingCell};
use super::{CoarseCell, Mapping, NEIGHBOUR_TERMS, NeighbourBasis, NeighbourResponse, SiteGrid, SiteResponse, shipped};
use crate::CellStack;
use crate::cache_file::{self, CacheEntry};

/// Raised whenever the supercells or the fit change: kept tables are then of no use.
const VERSION: u32 = 3;

const MAGIC: [u8; 8] = *b"MLNEIG\0\x01";

/// The light that a table is for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NeighbourTableSpec {
    pub wavelength_um: f64,
    /// Direction of arrival, sines in air along x and y; x >= y >= 0 shares tables between directions that are alike.
    pub sines: [f64; 2],
}

/// Transmission of pillars by the coupled model in one light.
#[derive(Clone, Debug)]
pub struct NeighbourTable {
    /// Responses for s and p; |t| of a site that passes all its light is 1.
    responses: [NeighbourResponse; 2],
    left_out: f64,
}

impl NeighbourTable {
    /// The table of a light for pillars that these mappings draw: from the folder `cache` if it is kept there, else solved,
    /// and kept there.
    ///
    /// # Errors
    /// If there is no mapping, no such light arrives, a supercell cannot be solved, or the user stopped it.
    pub fn obtain(
        spec: &NeighbourTableSpec,
        stack: &CellStack,
        mappings: &[Mapping],
        cache: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        check(spec, mappings)?;
        let kept = kept(spec, stack, mappings, cache);
        if let Some(table) = kept.read(|content| decode(content, basis(mappings)), progress) {
            return Ok(table);
        }
        let table = Self::solved(spec, stack, mappings, progress)?;
        kept.write(&encode(&table), progress);
        Ok(table)
    }

    /// Table that is solved now, whatever is cached.
    ///
    /// # Errors
    /// As [`NeighbourTable::obtain`].
    pub fn solved(
        spec: &NeighbourTableSpec,
        stack: &CellStack,
        mappings: &[Mapping],
        progress: &dyn Progress,
    ) -> Result<Self> {
        check(spec, mappings)?;
        let Fitted { responses, left_out } = solve(spec, stack, mappings, basis(mappings), progress)?;
        Ok(Self { responses, left_out })
    }

    /// True if the table of a light is shipped with the program, as it is for the designs that are.
    pub fn is_shipped(spec: &NeighbourTableSpec, stack: &CellStack, mappings: &[Mapping]) -> bool {
        kept(spec, stack, mappings, None).is_shipped()
    }

    /// The responses for s and p, where |t| of a site that passes all its light is `full`.
    pub fn responses(&self, full: f64) -> [NeighbourResponse; 2] {
        self.responses.clone().map(|mut response| {
            response.weights.iter_mut().for_each(|w| *w *= full);
            response
        })
    }

    /// Transmission of the sites of a supercell on a square lattice by the sum over pairs, `[polarisation][site]`,
    /// where |t| of a site that passes all its light is `full`; one width (nm) for each site.
    pub fn sites(&self, lattice: &SiteLattice, widths_nm: &[f64], full: f64) -> [Vec<Complex64>; 2] {
        self.responses(full).map(|r| sites_by(&r, lattice, widths_nm))
    }

    /// Light that the sum over pairs puts elsewhere than supercells do that it was not fitted to: mean of |t - t'|^2 over
    /// sites, s and p.
    pub fn left_out(&self) -> f64 {
        self.left_out
    }
}

/// Transmission of the sites of a supercell on a square lattice by a sum over pairs; one width (nm) for each site.
pub fn sites_by(response: &impl SiteResponse, lattice: &SiteLattice, widths_nm: &[f64]) -> Vec<Complex64> {
    let site = |i: usize| response.among(widths_nm[i], &neighbours_nm(SiteGrid::SQUARE, lattice, widths_nm, i));
    (0..lattice.len()).map(site).collect()
}

fn check(spec: &NeighbourTableSpec, mappings: &[Mapping]) -> Result<()> {
    let numbers = [spec.wavelength_um, spec.sines[0], spec.sines[1]];
    if mappings.is_empty() || !numbers.iter().all(|v| v.is_finite()) {
        return Err(Error::refused(
            "neighbours/table-not-numbers",
            format!("a table of neighbours for {spec:?} and {} mappings", mappings.len()),
            "give finite numbers and a mapping",
        ));
    }
    Ok(())
}

fn basis(mappings: &[Mapping]) -> NeighbourBasis {
    let samples = mappings.iter().flat_map(|m| m.samples_nm());
    NeighbourBasis::new(samples.map(|w| f64::from(*w)))
}

fn kept(spec: &NeighbourTableSpec, stack: &CellStack, mappings: &[Mapping], cache: Option<&Path>) -> CacheEntry {
    CacheEntry::new(cache, "neighbours", MAGIC, inputs(spec, stack, mappings), "neighbours").or_shipped(shipped::file)
}

fn solve(
    spec: &NeighbourTableSpec,
    stack: &CellStack,
    mappings: &[Mapping],
    basis: NeighbourBasis,
    progress: &dyn Progress,
) -> Result<Fitted> {
    let step = spec.wavelength_um * 1e3 / stack.pitch_nm;
    let grid = SiteGrid::of(stack);
    let cells = training::cells(grid, mappings, spec.sines.map(|sine| -sine / step))?;
    progress.begin(
        &format!("solving unlike neighbours at {:.0} nm", spec.wavelength_um * 1e3),
        cells.len() as u64,
    );
    let ranges = mappings.iter().map(Mapping::range_nm);
    let range_nm = ranges.fold((f64::INFINITY, 0.0), |(low, high), (l, h)| (l.min(low), h.max(high)));
    let coarse = CoarseCell::new(stack, spec.wavelength_um, range_nm)?;
    let sites = cells
        .par_iter()
        .enumerate()
        .map(|(number, cell)| {
            progress.check_stopped()?;
            let TrainingCell { lattice, widths_nm, .. } = cell;
            let response = coarse.solve(*lattice, widths_nm, spec.sines)?;
            let t = coarse.transmissions(lattice, &response, 1.0);
            progress.advance(1);
            Ok(samples(grid, number, cell, &t))
        })
        .collect::<Result<Vec<_>>>()?;
    fit(grid, basis, spec.sines, &sites.concat())
}

/// The inputs as text: equal if and only if the table is the same.
fn inputs(spec: &NeighbourTableSpec, stack: &CellStack, mappings: &[Mapping]) -> Vec<u8> {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        version: u32,
        terms: usize,
        coarse: usize,
        spec: &'a NeighbourTableSpec,
        stack: &'a CellStack,
        widths_nm: Vec<&'a [u16]>,
    }
    serde_json::to_vec(&Inputs {
        solver: cache_file::solver_of(stack.shape),
        version: VERSION,
        terms: NEIGHBOUR_TERMS,
        coarse: coarse(SiteGrid::of(stack)),
        spec,
        stack,
        widths_nm: mappings.iter().map(Mapping::samples_nm).collect(),
    })
    .expect("plain data serialises")
}

/// Bytes of a table: what was left out, then Re and Im of each weight, s then p (f64, little-endian).
fn encode(table: &NeighbourTable) -> Vec<u8> {
    let weights = table.responses.iter().flat_map(|r| &r.weights);
    let numbers = std::iter::once(table.left_out).chain(weights.flat_map(|w| [w.re, w.im]));
    numbers.flat_map(f64::to_le_bytes).collect()
}

/// The table of these bytes; none if they are not so many, or not finite.
fn decode(content: &[u8], basis: NeighbourBasis) -> Option<NeighbourTable> {
    let (numbers, rest) = content.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
    if numbers.len() != 1 + 4 * NEIGHBOUR_TERMS || !rest.is_empty() || numbers.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let weight = |i: usize| Complex64::new(numbers[1 + 2 * i], numbers[2 + 2 * i]);
    Some(NeighbourTable {
        left_out: numbers[0],
        responses: [0, 1].map(|pol| NeighbourResponse {
            basis,
            weights: (0..NEIGHBOUR_TERMS)
                .map(|i| weight(pol * NEIGHBOUR_TERMS + i))
                .collect(),
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_weights_come_back() {
        let basis = NeighbourBasis::new([100.0, 300.0].into_iter());
        let weights = |pol: usize| (0..NEIGHBOUR_TERMS).map(move |i| Complex64::new(i as f64, pol as f64));
        let table = NeighbourTable {
            left_out: 0.02,
            responses: [0, 1].map(|pol| NeighbourResponse {
                basis,
                weights: weights(pol).collect(),
            }),
        };
        let mut bytes = encode(&table);
        let back = decode(&bytes, basis).unwrap();
        assert_eq!((back.left_out, &back.responses), (table.left_out, &table.responses));
        assert!(decode(&bytes[8..], basis).is_none());
        bytes[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(decode(&bytes, basis).is_none());
    }
}
