//! Supercells: different pillars side by side that repeat as a whole, such as one period of a blazed grating.
//!
//! The lateral reference is the middle of site 0. The theory is that of one cell (see `layer`). What differs: there
//! are more plane waves, as many for each site as a single cell has, and the permittivity couples all of them. Circles on staggered
//! rows are met as in one cell of these (`staggered`), other pillars by strips (`permittivity`).

mod permittivity;
mod placed;
mod response;
mod sites;
mod staggered;
mod waves;

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;

pub use response::{SupercellOrder, SupercellResponse};
pub use sites::SiteLattice;

use crate::basis::Space;
use crate::error::{Error, Result};
use crate::layer::Modes;
use crate::propagate::{Ends, propagate_wave};
use crate::{CellLattice, Incidence, Layer, LayerStack, MOST_UNKNOWNS, Orders, Outline, Side, off_cutoff};
use permittivity::permittivity;
use placed::Placed;
use waves::Waves;

/// Different pillars side by side between two half-spaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Supercell {
    /// Pitch of the sites (nm).
    pub pitch_nm: f64,
    /// Lattice of the sites; staggered rows have circles.
    pub sites: CellLattice,
    /// Lattice on which the sites repeat.
    pub lattice: SiteLattice,
    /// Complex index of the half-space below, where the substrate is.
    pub below: Complex64,
    /// Layers from the substrate upwards.
    pub layers: Vec<SiteLayer>,
    /// Complex index of the half-space above.
    pub above: Complex64,
}

/// One layer: pillars of one material in another.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteLayer {
    /// Thickness (nm).
    pub height_nm: f64,
    /// Cross-section of the pillar of each site.
    pub outlines: Vec<Outline>,
    /// Complex index n + i k of the pillars; k > 0 absorbs.
    pub inside: Complex64,
    /// Complex index around them.
    pub outside: Complex64,
}

impl Supercell {
    /// Cells side by side, one for each site. They share all but the cross-sections of their pillars.
    ///
    /// # Errors
    /// If their number is not that of the sites, or they differ in more than the cross-sections.
    pub fn of_cells(lattice: SiteLattice, cells: &[LayerStack]) -> Result<Self> {
        let Some(first) = cells.first().filter(|_| cells.len() == lattice.len()) else {
            return Err(Error::CellCount {
                cells: cells.len(),
                sites: lattice.len(),
            });
        };
        for (number, cell) in cells.iter().enumerate() {
            let same_lattice = cell.pitch_nm == first.pitch_nm && cell.lattice == first.lattice;
            let same_media = cell.below == first.below && cell.above == first.above;
            let same_layers = cell.layers.len() == first.layers.len()
                && cell
                    .layers
                    .iter()
                    .zip(&first.layers)
                    .all(|(a, b)| a.height_nm == b.height_nm && a.inside == b.inside && a.outside == b.outside);
            if !(same_lattice && same_media && same_layers) {
                return Err(Error::UnlikeCells { cell: number + 1 });
            }
        }
        let layers = first
            .layers
            .iter()
            .enumerate()
            .map(|(number, layer)| SiteLayer {
                height_nm: layer.height_nm,
                outlines: cells.iter().map(|cell| cell.layers[number].outline.clone()).collect(),
                inside: layer.inside,
                outside: layer.outside,
            })
            .collect();
        let supercell = Self {
            pitch_nm: first.pitch_nm,
            sites: first.lattice,
            lattice,
            below: first.below,
            layers,
            above: first.above,
        };
        supercell.check()?;
        Ok(supercell)
    }

    /// Refuses what is not physical: each site must be a valid cell.
    fn check(&self) -> Result<()> {
        for (number, layer) in self.layers.iter().enumerate() {
            if layer.outlines.len() != self.lattice.len() {
                return Err(Error::OutlineCount {
                    layer: number + 1,
                    outlines: layer.outlines.len(),
                    sites: self.lattice.len(),
                });
            }
        }
        (0..self.lattice.len()).try_for_each(|site| {
            if self.layers.iter().any(|layer| !layer.outlines[site].is_mirrored()) {
                return Err(Error::RotatedSite { site: site + 1 });
            }
            let layers = self.layers.iter().map(|layer| Layer {
                height_nm: layer.height_nm,
                outline: layer.outlines[site].clone(),
                inside: layer.inside,
                outside: layer.outside,
            });
            let cell = LayerStack {
                pitch_nm: self.pitch_nm,
                lattice: self.sites,
                below: self.below,
                layers: layers.collect(),
                above: self.above,
            };
            cell.check()
        })
    }

    /// This supercell seen from the other side.
    fn flipped(&self) -> Self {
        Self {
            below: self.above,
            layers: self.layers.iter().rev().cloned().collect(),
            above: self.below,
            ..self.clone()
        }
    }
}

/// All orders into which a supercell diffracts a plane wave.
///
/// `highest` is the highest order of a single cell that is kept along each axis: 3 keeps -3..=3 for a cell and
/// -3 n..=3 n along a row of n cells. For a row along x that is lit in the x-z plane, only fields of the
/// symmetry of the incident one are solved for. Of staggered rows the waves of a circle are kept, as of a single cell of them.
///
/// # Errors
/// As [`crate::solve`].
pub fn solve_supercell(cell: &Supercell, incidence: &Incidence, highest: usize) -> Result<SupercellResponse> {
    off_cutoff(incidence.wavelength_um, |wavelength_um| {
        let incidence = Incidence {
            wavelength_um,
            ..*incidence
        };
        solve_once(cell, &incidence, highest)
    })
}

fn solve_once(cell: &Supercell, incidence: &Incidence, highest: usize) -> Result<SupercellResponse> {
    let problem = SupercellProblem::new(cell, incidence, highest)?;
    let unit = [[Complex64::ONE, Complex64::ZERO], [Complex64::ZERO, Complex64::ONE]];
    let parts = if Placed::of(cell).is_mirrored_row() && incidence.sines[1] == 0.0 {
        vec![
            problem.part(Space::Even, &unit[..1])?,
            problem.part(Space::Odd, &unit[1..])?,
        ]
    } else {
        vec![problem.part(Space::Full, &unit)?]
    };
    SupercellResponse::new(&problem, incidence, &parts)
}

/// A supercell with the wave's side below.
struct SupercellProblem {
    cell: Supercell,
    highest: usize,
    k: [f64; 2],
    /// Wavelength over pitch.
    step: f64,
    k0_per_nm: f64,
}

/// The fields of one symmetry.
struct SupercellPart {
    waves: Waves,
    ends: Ends,
    /// Transverse amplitudes of the incident zero order, for each column.
    incident: Vec<[Complex64; 2]>,
}

impl SupercellProblem {
    fn new(cell: &Supercell, incidence: &Incidence, highest: usize) -> Result<Self> {
        cell.check()?;
        incidence.check()?;
        if highest > Orders::MOST / 2 {
            return Err(Error::SupercellOrders { highest });
        }
        let cell = match incidence.side {
            Side::Below => cell.clone(),
            Side::Above => cell.flipped(),
        };
        incidence.check_medium(cell.below)?;
        let wavelength_nm = incidence.wavelength_um * 1e3;
        Ok(Self {
            k: incidence.sines,
            step: wavelength_nm / cell.pitch_nm,
            k0_per_nm: TAU / wavelength_nm,
            cell,
            highest,
        })
    }

    fn part(&self, y: Space, incident: &[[Complex64; 2]]) -> Result<SupercellPart> {
        let Supercell { lattice, pitch_nm, .. } = &self.cell;
        let placed = Placed::of(&self.cell);
        let unknowns = Waves::unknowns(&placed, self.highest, y);
        if unknowns > MOST_UNKNOWNS {
            return Err(Error::SupercellTooLarge {
                sites: lattice.len(),
                highest: self.highest,
                unknowns,
                most: MOST_UNKNOWNS,
            });
        }
        let waves = Waves::new(&placed, self.highest, y, self.k, self.step);
        let rows = &waves.rows;
        let layers = self.cell.layers.iter().map(|layer| {
            let plain = layer.inside == layer.outside || layer.outlines.iter().all(Outline::is_empty);
            let modes = if plain {
                Modes::uniform(layer.outside * layer.outside, rows)
            } else {
                let permittivity = match placed.staggered {
                    None => permittivity(layer, *pitch_nm, lattice, &waves),
                    Some(row) => staggered::permittivity(layer, *pitch_nm, row, &placed, &waves),
                };
                Modes::structured(&permittivity, rows)?
            };
            Ok((Arc::new(modes), layer.height_nm))
        });
        let indices = [self.cell.below, self.cell.above];
        let ends = propagate_wave(rows, indices, layers, self.k0_per_nm, incident, |component| {
            waves.plane_wave(component, [0, 0])
        })?;
        Ok(SupercellPart {
            waves,
            ends,
            incident: incident.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests;
