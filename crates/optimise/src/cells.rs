//! The cells that a design is optimised and judged with.

use std::path::Path;
use std::sync::Arc;

use metalith_cell::{CellModel, CellResponse, Fidelity, Illumination, RigorousCell, RotatedCell};
use metalith_core::{Error, Progress, Result};
use metalith_design::{Design, NeighbourCell, cell_models, neighbour_cell};
use metalith_pillars::PolarisationBasis;

use crate::merit::fabrication_errors::cells_off_height;

/// Cells that a design is optimised and judged with.
pub struct TaskCells {
    own: Box<dyn CellModel>,
    /// Cell of the report, if there is a report and the own cell is another.
    judge: Option<Box<dyn CellModel>>,
    /// Of rotated rectangles, the own one solved for single wavelengths.
    at_single_wavelengths: Option<Arc<RotatedCell>>,
    off_height: Vec<RigorousCell>,
}

impl TaskCells {
    /// Cells that a design names; tables are taken from the folder `cache`, or made and kept there. `report`: also what
    /// a report judges with.
    ///
    /// # Errors
    /// If a material is not known over the band, dissimilar neighbours have one table alone, or the user stopped it.
    pub fn of(design: &Design, report: bool, cache: Option<&Path>, progress: &dyn Progress) -> Result<Self> {
        let rigorous = || -> Result<Box<dyn CellModel>> {
            Ok(Box::new(
                RigorousCell::obtain(&design.table_spec()?, cache, progress)?.0,
            ))
        };
        check_shape(design)?;
        if let Some(pillars) = design.cell.shape.rotated() {
            let arriving = design.cell.arriving.unwrap_or_default();
            let cell = Arc::new(RotatedCell::new(design.cell_stack()?, pillars, arriving));
            return Ok(Self {
                own: Box::new(RotationBand(Arc::clone(&cell))),
                judge: None,
                at_single_wavelengths: Some(cell),
                off_height: Vec::new(),
            });
        }
        let fidelity = design.optimise.fidelity;
        let own = match fidelity {
            Fidelity::Rigorous => rigorous()?,
            Fidelity::Neighbours => Box::new(among_neighbours(design, cache, progress)?),
            _ => cell_models(design, &[fidelity])?.remove(0),
        };
        let judge = (report && fidelity != Fidelity::Rigorous).then(rigorous).transpose()?;
        let off_height = match &design.optimise.robust {
            Some(robust) if fidelity == Fidelity::Rigorous && robust.height > 0.0 => {
                cells_off_height(&design.table_spec()?, robust, cache, progress)?
            }
            _ => Vec::new(),
        };
        Ok(Self {
            own,
            judge,
            at_single_wavelengths: None,
            off_height,
        })
    }

    /// Cell that is optimised with.
    pub fn own(&self) -> &dyn CellModel {
        self.own.as_ref()
    }

    /// The own one for single wavelengths, where it answers for those of a band alone.
    pub fn at_single_wavelengths(&self) -> Option<&dyn CellModel> {
        self.at_single_wavelengths.as_deref().map(|cell| cell as _)
    }

    /// The cell of equal neighbours that figures are by too.
    pub fn rigorous(&self) -> &dyn CellModel {
        self.judge.as_deref().unwrap_or(self.own())
    }

    /// Cell that layouts are simulated with: the truest of these.
    pub fn judge(&self) -> &dyn CellModel {
        match self.own.fidelity() {
            Fidelity::Neighbours => self.own(),
            _ => self.rigorous(),
        }
    }

    /// The own one, then those at other film heights that a robust design counts.
    pub fn all(&self) -> Vec<&dyn CellModel> {
        let off_height = self.off_height.iter().map(|c| c as &dyn CellModel);
        std::iter::once(self.own()).chain(off_height).collect()
    }
}

/// Rotated rectangles at the many wavelengths of a band, each solved as one of them: the light that they convert, by the number of
/// the rotation.
struct RotationBand(Arc<RotatedCell>);

impl CellModel for RotationBand {
    fn fidelity(&self) -> Fidelity {
        self.0.fidelity()
    }

    fn response(&self, light: &Illumination<'_>, last: u16, progress: &dyn Progress) -> Result<CellResponse> {
        self.0.response(&light.in_band(), last, progress)
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.0.full_transmission(wavelength_um)
    }
}

/// The coupled model, whose tables are solved here where there are none.
fn among_neighbours(design: &Design, cache: Option<&Path>, progress: &dyn Progress) -> Result<NeighbourCell> {
    let tables = &design.verify.wavelengths_um;
    let ends = |all: &[f64]| {
        all.iter()
            .fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), l| (a.min(*l), b.max(*l)))
    };
    let ((first, last), band) = (ends(tables), design.optimise.band_um);
    let words = |(a, b): (f64, f64)| format!("from {:.0} to {:.0} nm", a * 1e3, b * 1e3);
    if first >= last {
        return Err(Error::refused(
            "optimise/too-few-wavelengths",
            format!(
                "the table of the coupled model has one wavelength, and the band is {}",
                words(band)
            ),
            "name at least two in [verify] wavelengths_nm: the band is interpolated between them",
        ));
    }
    if band.0 < first || band.1 > last {
        progress.warn(&format!(
            "unlike neighbours have tables {}, and the band is {}: beyond them the paths through pillars go on straight, unless \
             [verify] wavelengths_nm names its ends too",
            words((first, last)),
            words(band)
        ));
    }
    let cell = neighbour_cell(design, cache.map(Path::to_owned))?;
    cell.response(&Illumination::normal(band.0).in_band(), 0, progress)?;
    Ok(cell)
}
/// Succeeds if the pillars of a design are such as a phase is found for.
///
/// # Errors
/// If they are upright rectangles.
pub(crate) fn check_shape(design: &Design) -> Result<()> {
    match design.cell.shape.basis() {
        None | Some(PolarisationBasis::Circular) => Ok(()),
        Some(PolarisationBasis::Linear) => Err(Error::refused(
            "optimise/rectangles-with-two-phases",
            "the pillars are upright rectangles, which have a phase for each polarisation",
            "use squares, circles or rotated rectangles: the optimiser finds one phase for all light",
        )),
    }
}
