//! Pillars as drawn, by a cell model.

use std::sync::{Arc, OnceLock};

use super::light::wave_of;
use super::{
    ArrivingLight, CameraChange, ElementOptics, Field, FocusedSites, IncoherentFields, NeighbourSites, PathChange,
    cell_direction,
};
use metalith_cell::{CellModel, CellResponse, Illumination, NeighbourTables, Spectral};
use metalith_core::{Error, Memo, Progress, Result};
use metalith_pillars::{LatticeKind, PillarRows};

/// Wavelength, direction of equal and of coupled pillars, bit by bit; how closely it is looked at, and whether neighbours are equal.
type Key = ([u64; 5], Spectral, bool);

/// A cell model with all that it has answered. Light from directions that a cell cannot distinguish is asked for once.
pub(crate) struct DrawnCells<'a> {
    pub cell: &'a dyn CellModel,
    lattice: LatticeKind,
    largest_number: u16,
    known: Memo<Key, Arc<CellResponse>>,
}

impl<'a> DrawnCells<'a> {
    /// Pillars up to a width (nm) or number on a lattice.
    pub(crate) fn new(cell: &'a dyn CellModel, lattice: LatticeKind, largest_number: u16) -> Self {
        Self {
            cell,
            lattice,
            largest_number,
            known: Memo::default(),
        }
    }

    /// Response of pillars to a light.
    ///
    /// # Errors
    /// As [`CellModel::response`].
    pub(crate) fn response(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<Arc<CellResponse>> {
        self.ask(self.cell, light, progress)
    }

    /// Response of pillars with equal neighbours to a light.
    ///
    /// # Errors
    /// As [`CellModel::response`].
    fn uncoupled(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<Arc<CellResponse>> {
        self.ask(self.cell.uncoupled().unwrap_or(self.cell), light, progress)
    }

    fn ask(
        &self,
        cell: &dyn CellModel,
        light: &Illumination<'_>,
        progress: &dyn Progress,
    ) -> Result<Arc<CellResponse>> {
        let coupled = cell.uncoupled().is_some();
        let viewing = |um: f64| cell_direction(light.coupled_sines(um), self.lattice);
        let asked = Illumination {
            sines: cell_direction(light.sines, self.lattice),
            viewing: Some(&viewing),
            ..*light
        };
        let um = light.wavelength_um;
        let ([x, y], [u, v]) = (asked.cell_sines(), if coupled { viewing(um) } else { [0.0; 2] });
        let key = ([um, x, y, u, v].map(f64::to_bits), light.spectral, coupled);
        let response = || cell.response(&asked, self.largest_number, progress);
        self.known.get_or_make(key, || response().map(Arc::new))
    }
}

/// An element as drawn.
pub(crate) struct DrawnOptics<'e> {
    pub cells: &'e DrawnCells<'e>,
    pub pillars: &'e dyn PillarRows,
    /// Radius of the circle that light passes (um).
    pub radius_um: f64,
    pub part_bytes: Option<usize>,
    /// Sites with their neighbours, once they are asked for.
    pub sites: OnceLock<NeighbourSites>,
}

impl ElementOptics for DrawnOptics<'_> {
    fn in_light(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<IncoherentFields<'_>> {
        let response = self.cells.response(light, progress)?;
        let drawn = |table| Field::Drawn {
            pillars: self.pillars,
            table,
        };
        let (fields, weight) = match response.as_ref() {
            CellResponse::Scalar(table) => (vec![drawn(table.clone())], 1.0),
            CellResponse::Jones(tables) => {
                let (tables, weight) = tables.incoherent(light.polarised);
                (tables.into_iter().map(drawn).collect(), weight)
            }
            CellResponse::Neighbours(tables) => {
                let pillars = self.pillars.held().ok_or_else(not_held)?;
                let sites = self.sites.get_or_init(|| NeighbourSites::of(pillars));
                coupled(sites, &response, tables, light)
            }
        };
        Ok(IncoherentFields {
            fields,
            weight,
            light: ArrivingLight::new(&wave_of(light), &PathChange::default()),
            defocus_um: 0.0,
            camera: CameraChange::default(),
            lattice: self.pillars.lattice(),
            radius_um: self.radius_um,
            part_bytes: self.part_bytes,
        })
    }

    fn response(
        &self,
        light: &Illumination<'_>,
        _numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<Arc<CellResponse>> {
        self.cells.response(light, progress)
    }

    fn focused(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<FocusedSites<'_>> {
        let response = self.cells.uncoupled(&Illumination::normal(wavelength_um), progress)?;
        Ok(FocusedSites {
            table: CellResponse::clone(&response).focused()?,
            classes: None,
        })
    }
}

/// The fields of pillars among their neighbours, and the share of the light for each: for s and p, or one for both.
pub(crate) fn coupled<'e>(
    sites: &'e NeighbourSites,
    response: &Arc<CellResponse>,
    tables: &NeighbourTables,
    light: &Illumination<'_>,
) -> (Vec<Field<'e>>, f64) {
    let polarisations = match tables {
        NeighbourTables::Fitted(_) => 2,
        NeighbourTables::Band(_) => 1,
    };
    let field = |polarisation| Field::Coupled {
        sites,
        response: Arc::clone(response),
        sines: light.coupled_sines(light.wavelength_um),
        polarisation,
    };
    ((0..polarisations).map(field).collect(), 1.0 / polarisations as f64)
}

/// The refusal of an element that is not held as a map: neighbours and chips as fabricated are looked at site by site in all
/// directions.
pub(crate) fn not_held() -> Error {
    Error::refused(
        "verify/element-too-large",
        "the element has too many pillars for a simulation as fabricated or with the coupled model",
        "simulate it as drawn, with the model `rigorous`, `fitted` or `published`",
    )
}
