//! The cell of a design whose pillars have the neighbours that they have.

use std::path::PathBuf;
use std::sync::Arc;

use metalith_core::{Memo, Progress, Result, Silent};

use super::{BandNode, BandResponse, FittedNeighbours, Mapping, NEIGHBOURS, NeighbourTable, NeighbourTableSpec};
use crate::{CellModel, CellResponse, CellStack, Fidelity, Illumination, NeighbourTables, PointwiseCell, Spectral};

/// Pillars among dissimilar neighbours, by [`NeighbourTable`]. [`PointwiseCell`] answers where the width of a pillar
/// alone is known, as in a lattice of equal pillars.
#[derive(Debug)]
pub struct NeighbourCell {
    equal: PointwiseCell,
    stack: CellStack,
    mappings: Vec<Mapping>,
    cache: Option<PathBuf>,
    /// Wavelengths with tables, for those of a band between them (um), in rising order.
    tabulated_um: Vec<f64>,
    /// Share of the light that equal neighbours pass, by wavelength bit by bit: see [`NeighbourCell::passed`].
    passed: Memo<u64, f64>,
    /// Tables by wavelength and direction, bit by bit.
    tables: Memo<[u64; 3], Arc<NeighbourTable>>,
}

impl NeighbourCell {
    /// `mappings`, at least one, say how often each width is drawn beside which others; tables are kept in the folder
    /// `cache`.
    pub fn new(stack: CellStack, mappings: Vec<Mapping>, cache: Option<PathBuf>) -> Self {
        let widths_nm = mappings.iter().flat_map(|m| m.samples_nm().iter().copied());
        Self {
            equal: PointwiseCell::new(stack.clone(), widths_nm).cached_in(cache.as_deref()),
            stack,
            mappings,
            cache,
            tabulated_um: Vec::new(),
            passed: Memo::default(),
            tables: Memo::default(),
        }
    }

    /// This cell, which knows bands by the tables of these wavelengths (um).
    #[must_use]
    pub fn tabulated_at(mut self, wavelengths_um: &[f64]) -> Self {
        self.tabulated_um = wavelengths_um.to_vec();
        self.tabulated_um.sort_by(f64::total_cmp);
        self.tabulated_um.dedup();
        self
    }

    /// Share of the light that passes lattices of equal pillars, mean over the phases that the mappings draw.
    fn passed(&self, wavelength_um: f64) -> Result<f64> {
        self.passed.get_or_make(wavelength_um.to_bits(), || {
            let widths = || self.mappings.iter().flat_map(Mapping::samples_nm);
            let widest = widths().copied().max().unwrap_or(0);
            let light = Illumination::normal(wavelength_um).in_band();
            let t = self.equal.response(&light, widest, &Silent)?.focused()?;
            let full = self.equal.full_transmission(wavelength_um)?;
            let sum: f64 = widths().map(|w| (t[usize::from(*w)] / full).norm_sqr()).sum();
            Ok(sum / widths().count().max(1) as f64)
        })
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
        let spec = NeighbourTableSpec { wavelength_um, sines };
        let obtain = || NeighbourTable::obtain(&spec, &self.stack, &self.mappings, self.cache.as_deref(), progress);
        self.tables.get_or_make(key, || obtain().map(Arc::new))
    }

    /// Between the wavelengths that have tables; none without any.
    fn in_band(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<Option<BandResponse>> {
        let [Some(first), Some(last)] = [self.tabulated_um.first(), self.tabulated_um.last()] else {
            return Ok(None);
        };
        let wavelength_um = light.wavelength_um;
        // What turns this light to the normal (turns a pitch).
        let step = wavelength_um * 1e3 / self.stack.pitch_nm;
        let straight = light.coupled_sines(wavelength_um).map(|sine| -sine / step);
        let node = |um: &f64| {
            let table = self.table(*um, light.coupled_sines(*um), progress)?;
            BandNode::new(*um, &table.responses(1.0), &self.stack, |w| self.around(w, straight))
        };
        let nodes = self.tabulated_um.iter().map(node).collect::<Result<Vec<_>>>()?;
        let mut scale = self.full_transmission(wavelength_um)?;
        let end = wavelength_um.clamp(*first, *last);
        if end != wavelength_um {
            scale *= (self.passed(wavelength_um)? / self.passed(end)?).sqrt();
        }
        Ok(BandResponse::at(&nodes, wavelength_um, scale))
    }
}

impl CellModel for NeighbourCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Neighbours
    }

    fn response(&self, light: &Illumination<'_>, largest_number: u16, progress: &dyn Progress) -> Result<CellResponse> {
        if light.spectral == Spectral::Exact {
            let um = light.wavelength_um;
            let table = self.table(um, light.coupled_sines(um), progress)?;
            return Ok(CellResponse::Neighbours(NeighbourTables::Fitted(FittedNeighbours {
                responses: table.responses(self.full_transmission(um)?),
                left_out: table.left_out(),
            })));
        }
        match self.in_band(light, progress)? {
            Some(response) => Ok(CellResponse::Neighbours(NeighbourTables::Band(response))),
            None => self.equal.response(light, largest_number, progress),
        }
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.equal.full_transmission(wavelength_um)
    }

    fn uncoupled(&self) -> Option<&dyn CellModel> {
        Some(&self.equal)
    }
}
