//! The cell of a design whose pillars have the neighbours that they have.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use num_complex::Complex64;

use metalith_core::{Progress, Result};

use super::{BandNode, BandResponse, FittedNeighbours, Mapping, NEIGHBOURS, NeighbourTable, NeighbourTableSpec};
use crate::{CellModel, CellStack, Fidelity, ObliqueTables, PointwiseCell};

/// Pillars among unlike neighbours, by [`NeighbourTable`]. Where it is asked for the transmission of a width alone, it
/// answers as [`PointwiseCell`]: that of a lattice of equal pillars.
#[derive(Debug)]
pub struct NeighbourCell {
    equal: PointwiseCell,
    stack: CellStack,
    mappings: Vec<Mapping>,
    cache: Option<PathBuf>,
    /// Wavelengths with tables, for those of a band between them (um), in rising order.
    tabulated_um: Vec<f64>,
    /// Share of the light that equal neighbours pass, by wavelength bit by bit: see [`NeighbourCell::passed`].
    passed: Mutex<HashMap<u64, f64>>,
    /// Tables by wavelength and direction, bit by bit.
    tables: Mutex<HashMap<[u64; 3], Arc<NeighbourTable>>>,
}

impl NeighbourCell {
    /// `mappings`, at least one, say how often each width is drawn beside which others; tables are kept in the folder
    /// `cache`.
    pub fn new(stack: CellStack, mappings: Vec<Mapping>, cache: Option<PathBuf>) -> Self {
        let widths_nm = mappings.iter().flat_map(|m| m.samples_nm().iter().copied());
        Self {
            equal: PointwiseCell::new(stack.clone(), widths_nm),
            stack,
            mappings,
            cache,
            tabulated_um: Vec::new(),
            passed: Mutex::default(),
            tables: Mutex::default(),
        }
    }

    /// Same cell, which knows bands by the tables of these wavelengths (um).
    #[must_use]
    pub fn tabulated_at(mut self, wavelengths_um: &[f64]) -> Self {
        self.tabulated_um = wavelengths_um.to_vec();
        self.tabulated_um.sort_by(f64::total_cmp);
        self.tabulated_um.dedup();
        self
    }

    /// Share of the light that passes lattices of equal pillars, mean over the phases that the mappings draw.
    fn passed(&self, wavelength_um: f64) -> Result<f64> {
        let known = || self.passed.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(&wavelength_um.to_bits()) {
            return Ok(*found);
        }
        let widths = || self.mappings.iter().flat_map(Mapping::samples_nm);
        let widest = widths().copied().max().unwrap_or(0);
        let t = self.equal.transmissions_in_band(wavelength_um, widest)?;
        let full = self.equal.full_transmission(wavelength_um)?;
        let sum: f64 = widths().map(|w| (t[usize::from(*w)] / full).norm_sqr()).sum();
        let found = sum / widths().count().max(1) as f64;
        known().insert(wavelength_um.to_bits(), found);
        Ok(found)
    }

    /// Widths around a pillar of a width (nm) where the phase is that of a grating (turns a pitch), in the order of
    /// [`NEIGHBOURS`].
    fn around(&self, width_nm: f64, grating: [f64; 2]) -> [f64; NEIGHBOURS.len()] {
        let mapping = &self.mappings[0];
        let phase = mapping.nearest_phase(width_nm);
        NEIGHBOURS.map(|[x, y]| {
            let on = grating[0] * f64::from(x) + grating[1] * f64::from(y);
            mapping.width_nm((phase + on).rem_euclid(1.0))
        })
    }

    fn table(&self, wavelength_um: f64, sines: [f64; 2], progress: &dyn Progress) -> Result<Arc<NeighbourTable>> {
        let key = [wavelength_um, sines[0], sines[1]].map(f64::to_bits);
        let known = || self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(&key) {
            return Ok(Arc::clone(found));
        }
        let spec = NeighbourTableSpec { wavelength_um, sines };
        let cache = self.cache.as_deref();
        let found = Arc::new(NeighbourTable::obtain(
            &spec,
            &self.stack,
            &self.mappings,
            cache,
            progress,
        )?);
        known().insert(key, Arc::clone(&found));
        Ok(found)
    }
}

impl CellModel for NeighbourCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Neighbours
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.equal.transmissions(wavelength_um, max_width_nm)
    }

    fn transmissions_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.equal.transmissions_in_band(wavelength_um, max_width_nm)
    }

    fn oblique(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        self.equal.oblique(wavelength_um, sines, max_width_nm)
    }

    fn oblique_in_band(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        self.equal.oblique_in_band(wavelength_um, sines, max_width_nm)
    }

    fn among_neighbours(
        &self,
        wavelength_um: f64,
        sines: [f64; 2],
        progress: &dyn Progress,
    ) -> Result<Option<FittedNeighbours>> {
        let table = self.table(wavelength_um, sines, progress)?;
        Ok(Some(FittedNeighbours {
            responses: table.responses(self.full_transmission(wavelength_um)?),
            left_out: table.left_out(),
        }))
    }

    fn among_neighbours_in_band(
        &self,
        wavelength_um: f64,
        looks: &dyn Fn(f64) -> [f64; 2],
        progress: &dyn Progress,
    ) -> Result<Option<BandResponse>> {
        // What turns this light to the normal (turns a pitch).
        let step = wavelength_um * 1e3 / self.stack.pitch_nm;
        let straight = looks(wavelength_um).map(|sine| -sine / step);
        let node = |um: &f64| {
            let table = self.table(*um, looks(*um), progress)?;
            BandNode::new(*um, &table.responses(1.0), &self.stack, |w| self.around(w, straight))
        };
        let nodes = self.tabulated_um.iter().map(node).collect::<Result<Vec<_>>>()?;
        let [Some(first), Some(last)] = [self.tabulated_um.first(), self.tabulated_um.last()] else {
            return Ok(None);
        };
        let mut scale = self.full_transmission(wavelength_um)?;
        let end = wavelength_um.clamp(*first, *last);
        if end != wavelength_um {
            scale *= (self.passed(wavelength_um)? / self.passed(end)?).sqrt();
        }
        Ok(BandResponse::at(&nodes, wavelength_um, scale))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.equal.full_transmission(wavelength_um)
    }
}
