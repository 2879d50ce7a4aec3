//! What a layout is judged by: a cell, or a chip as made.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use num_complex::Complex64;

use metalith_cell::{
    BandResponse, CellModel, FittedNeighbours, ObliqueTables, POLARISATION_SHARE, PassedTable, PolarisedLight,
    PolarisedTables,
};
use metalith_core::{Error, Progress, Result};
use metalith_optics::{NeighbourPillars, SimulationCase, cell_direction};
use metalith_pillars::{LatticeKind, PillarRows};
use metalith_wave::{Aperture, FoldedPropagator, Pillars, PlaneWave, Psf, Scratch};

/// The case that judges, and those that are simulated beside it.
#[derive(Clone)]
pub struct SimulationCases<'a> {
    pub judge: SimulationCase<'a>,
    pub beside: Vec<SimulationCase<'a>>,
}

impl<'a> SimulationCases<'a> {
    /// Judged by this case alone.
    pub fn judged_by(judge: impl Into<SimulationCase<'a>>) -> Self {
        Self {
            judge: judge.into(),
            beside: Vec::new(),
        }
    }

    /// Judged by the first of some cells, with the others beside it.
    ///
    /// # Errors
    /// If there is no cell.
    pub fn of_cells(cells: &'a [Box<dyn CellModel>]) -> Result<Self> {
        let (judge, beside) = cells.split_first().ok_or_else(|| {
            Error::refused(
                "verify/no-model",
                "there is no cell to judge a layout by",
                "ask for at least one fidelity",
            )
        })?;
        Ok(Self::judged_by(judge.as_ref()).with_cells(beside))
    }

    /// The same with these cells beside.
    #[must_use]
    pub fn with_cells(mut self, cells: &'a [Box<dyn CellModel>]) -> Self {
        self.beside
            .extend(cells.iter().map(|c| SimulationCase::Cell(c.as_ref())));
        self
    }

    /// All cases, the one that judges first.
    pub fn iter(&self) -> impl Iterator<Item = SimulationCase<'a>> {
        std::iter::once(self.judge).chain(self.beside.iter().copied())
    }
}

/// Transmissions by drawn width of one cell at one wavelength.
pub(super) struct TransmissionTables {
    /// Along the normal.
    pub normal: Vec<Complex64>,
    /// Of a cell that tells polarisations apart, along the normal.
    polarised: Option<Polarised>,
    /// By direction, for s and p; empty where the design asks for normal incidence, or the cell knows no angles.
    oblique: HashMap<[u64; 2], ObliqueTables>,
    /// By direction, of a cell that knows unlike neighbours.
    neighbours: HashMap<[u64; 2], Neighbourhood>,
    /// True if it is one of many wavelengths of a band.
    in_band: bool,
    /// What the pillars stand on.
    lattice: LatticeKind,
}

/// What pillars that tell polarisations apart do to light of both, and what of it reaches the sensor.
struct Polarised {
    tables: PolarisedTables,
    light: PolarisedLight,
    passed: Vec<PassedTable>,
}

impl Polarised {
    fn of(tables: PolarisedTables, light: PolarisedLight) -> Self {
        Self {
            passed: tables.passed(light),
            tables,
            light,
        }
    }
}

/// What pillars transmit among unlike neighbours in one light.
enum Neighbourhood {
    /// For s and p.
    Polarised(FittedNeighbours),
    /// For one of many wavelengths of a band.
    Band(BandResponse),
}

impl TransmissionTables {
    /// Solve a cell of pillars on such a lattice along the normal; `light` counts where they tell polarisations apart.
    ///
    /// # Errors
    /// If it has no answer at this wavelength.
    pub fn new(
        cell: &dyn CellModel,
        lattice: LatticeKind,
        wavelength_um: f64,
        largest_number: u16,
        light: PolarisedLight,
    ) -> Result<Self> {
        let polarised = cell.polarised(wavelength_um, largest_number)?;
        let normal = cell.transmissions(wavelength_um, largest_number)?;
        Ok(Self::along_normal(normal, polarised, lattice, light))
    }

    /// The same for one of many wavelengths of a band.
    ///
    /// # Errors
    /// As [`TransmissionTables::new`].
    pub fn in_band(
        cell: &dyn CellModel,
        lattice: LatticeKind,
        wavelength_um: f64,
        largest_number: u16,
        light: PolarisedLight,
    ) -> Result<Self> {
        let polarised = cell.polarised_in_band(wavelength_um, largest_number)?;
        let normal = cell.transmissions_in_band(wavelength_um, largest_number)?;
        Ok(Self {
            in_band: true,
            ..Self::along_normal(normal, polarised, lattice, light)
        })
    }

    /// Of one wavelength, before other directions are added.
    fn along_normal(
        normal: Vec<Complex64>,
        polarised: Option<PolarisedTables>,
        lattice: LatticeKind,
        light: PolarisedLight,
    ) -> Self {
        Self {
            normal,
            polarised: polarised.map(|tables| Polarised::of(tables, light)),
            oblique: HashMap::new(),
            neighbours: HashMap::new(),
            in_band: false,
            lattice,
        }
    }

    /// Of a cell that tells polarisations apart, what it does to light of both, and the light that it is in.
    pub fn polarised(&self) -> Option<(&PolarisedTables, PolarisedLight)> {
        self.polarised.as_ref().map(|p| (&p.tables, p.light))
    }

    /// Solve it for more directions, those that are alike by symmetry once.
    ///
    /// # Errors
    /// As [`TransmissionTables::new`]; also if the user stopped it.
    pub fn add_directions(
        &mut self,
        cell: &dyn CellModel,
        waves: &[PlaneWave],
        largest_number: u16,
        progress: &dyn Progress,
    ) -> Result<()> {
        for wave in waves {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let sines = cell_direction(wave, self.lattice);
            // Where unlike neighbours are known, equal ones are not asked for.
            let known = self.neighbours.contains_key(&key(sines)) || self.oblique.contains_key(&key(sines));
            if sines != [0.0; 2] && !known {
                let tables = if self.in_band {
                    cell.oblique_in_band(wave.wavelength_um, sines, largest_number)?
                } else {
                    cell.oblique(wave.wavelength_um, sines, largest_number)?
                };
                if let Some(tables) = tables {
                    self.oblique.insert(key(sines), tables);
                }
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// Obtain what pillars transmit among unlike neighbours in light of these directions, if the cell knows.
    ///
    /// # Errors
    /// If the cell has no answer, or the user stopped it.
    pub fn add_neighbours(&mut self, cell: &dyn CellModel, waves: &[PlaneWave], progress: &dyn Progress) -> Result<()> {
        for wave in waves {
            let sines = cell_direction(wave, self.lattice);
            if let Entry::Vacant(place) = self.neighbours.entry(key(sines)) {
                let Some(fitted) = cell.among_neighbours(wave.wavelength_um, sines, progress)? else {
                    return Ok(());
                };
                place.insert(Neighbourhood::Polarised(fitted));
            }
        }
        Ok(())
    }

    /// The same for one of many wavelengths of a band (um), in `light` of each wavelength (um).
    ///
    /// # Errors
    /// As [`TransmissionTables::add_neighbours`].
    pub fn add_neighbours_in_band(
        &mut self,
        cell: &dyn CellModel,
        wavelength_um: f64,
        light: &dyn Fn(f64) -> PlaneWave,
        progress: &dyn Progress,
    ) -> Result<()> {
        let sines = |um: f64| cell_direction(&light(um), self.lattice);
        if let Entry::Vacant(place) = self.neighbours.entry(key(sines(wavelength_um)))
            && let Some(response) = cell.among_neighbours_in_band(wavelength_um, &sines, progress)?
        {
            place.insert(Neighbourhood::Band(response));
        }
        Ok(())
    }

    /// Share of the light that the sums over pairs put elsewhere in this light than supercells that were left out of their fit; none
    /// where unlike neighbours are not known by a table of their own.
    pub fn left_out(&self, lit: &PlaneWave) -> Option<f64> {
        match self.neighbours.get(&key(cell_direction(lit, self.lattice)))? {
            Neighbourhood::Polarised(fitted) => Some(fitted.left_out),
            Neighbourhood::Band(_) => None,
        }
    }

    /// An element among its own neighbours, in light for which that is known: for s and p, or one for both.
    ///
    /// # Errors
    /// If it has too many widths, or they are not held as a map.
    pub fn among_neighbours<'w>(
        &self,
        widths: &'w dyn PillarRows,
        lit: &PlaneWave,
    ) -> Result<Option<Vec<NeighbourPillars<'w>>>> {
        let Some(known) = self.neighbours.get(&key(cell_direction(lit, self.lattice))) else {
            return Ok(None);
        };
        let widths = widths.held().ok_or_else(not_held)?;
        let sines = [lit.sin_x, lit.sin_y];
        Ok(Some(match known {
            Neighbourhood::Polarised(fitted) => [0, 1]
                .into_iter()
                .map(|polarisation| NeighbourPillars::polarised(widths, &fitted.responses, sines, polarisation))
                .collect::<Result<_>>()?,
            Neighbourhood::Band(one) => vec![NeighbourPillars::new(widths, one, sines)?],
        }))
    }

    /// The PSF of pillars for a wave on a window: the mean over polarisations where cells are solved at an angle, the sum of
    /// all that does not interfere where cells tell polarisations apart. `lit` is the wave that they are solved for where they are.
    ///
    /// # Errors
    /// As [`Psf::formed`].
    pub fn psf(
        &self,
        widths: &dyn PillarRows,
        wave: &PlaneWave,
        lit: &PlaneWave,
        fold: &FoldedPropagator,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Psf> {
        let mut of = |aperture: &dyn Aperture| Ok(Psf::formed(fold, aperture, wave, lp_mm, scratch)?);
        if let Some(all) = self.among_neighbours(widths, lit)? {
            let share = 1.0 / all.len() as f64;
            let psfs = all.iter().map(|a| of(a)).collect::<Result<_>>()?;
            return Ok(Psf::sum(psfs, share));
        }
        let mut of = |table: &Vec<Complex64>| of(&Pillars::new(widths, table)?);
        match self.oblique.get(&key(cell_direction(lit, self.lattice))) {
            Some(tables) => Ok(Psf::sum(
                tables.passed().map(of).collect::<Result<_>>()?,
                POLARISATION_SHARE,
            )),
            None => match &self.polarised {
                None => of(&self.normal),
                Some(polarised) => {
                    let psfs = polarised.passed.iter().map(|p| of(&p.table));
                    Ok(Psf::sum(psfs.collect::<Result<_>>()?, 1.0))
                }
            },
        }
    }
}

/// Neighbours and chips as made are looked at site by site in all directions.
pub(super) fn not_held() -> Error {
    Error::refused(
        "verify/too-large",
        "an element whose pillars are too many to be held is judged as made, or among its unlike neighbours",
        "judge it by the cell of a lattice of equal pillars, as drawn",
    )
}

fn key(sines: [f64; 2]) -> [u64; 2] {
    sines.map(f64::to_bits)
}
