//! Gain of an optimisation: Strehl ratios off the grid that was optimised on, three ways.

use std::path::Path;

use serde::Serialize;

use crate::merit::fabrication_errors;
use crate::merit::focus::{Strehl, judging_wavelengths};
use crate::rings::phase_step_limit::{largest_step, largest_step_in_layout};
use crate::run::OptimiseTask;
use metalith_cell::{CellModel, Fidelity};
use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_design::phase::{Interpolation, RadialPhase};
use metalith_pillars::PillarMap;

/// Strehl ratio over wavelength of one phase, judged in one way.
#[derive(Clone, Debug, Serialize)]
pub struct StrehlSummary {
    /// `rings` or `layout`: from the widths of the rings, or of all pillars read back from a file.
    pub source: &'static str,
    /// The cell that it was judged with.
    pub fidelity: Fidelity,
    /// Geometric mean over 0.5 nm steps between the wavelengths optimised on.
    pub geometric_mean: f64,
    /// Arithmetic mean.
    pub mean: f64,
    /// Smallest.
    pub smallest: f64,
    /// Largest wrapped phase step between neighbours (waves).
    pub largest_step_waves: f64,
    #[serde(skip)]
    pub strehl: Strehl,
}

impl StrehlSummary {
    fn new(source: &'static str, fidelity: Fidelity, strehl: Strehl, largest_step_waves: f64) -> Self {
        Self {
            source,
            fidelity,
            geometric_mean: strehl.geometric_mean(),
            mean: strehl.mean(),
            smallest: strehl.smallest(),
            largest_step_waves,
            strehl,
        }
    }
}

/// The design of a lens alone, with the phase in `table`.
///
/// # Errors
/// If the table cannot be read.
pub fn lens_alone(design: &Design, table: &Path) -> Result<Design> {
    let mut alone = design.clone();
    alone.lens.phase = RadialPhase::read_table(table, Interpolation::Nearest, design.lens.radius_um())?;
    alone.array = design.array.alone();
    alone.lens.terms.clear();
    Ok(alone)
}

impl OptimiseTask {
    fn judging_wavelengths(&self) -> Vec<f64> {
        judging_wavelengths(self.spec.band_um.0 * 1e3, self.spec.band_um.1 * 1e3)
    }

    /// Strehl ratios from the widths that phases (waves) give, with one cell.
    ///
    /// # Errors
    /// If the cell does not cover the band.
    pub fn judge_rings(&self, waves: &[f64], cell: &dyn CellModel) -> Result<StrehlSummary> {
        let widths = self.widths_nm(waves);
        let strehl = self.lens.strehl_of_rings(&widths, cell, &self.judging_wavelengths())?;
        Ok(StrehlSummary::new(
            "rings",
            cell.fidelity(),
            strehl,
            largest_step(waves),
        ))
    }

    /// Strehl ratios from the pillars of a layout of the lens alone, summed over every pillar.
    ///
    /// # Errors
    /// If a width is none that a phase is mapped to, or the cell does not cover the band.
    pub fn judge_layout(&self, pillars: &PillarMap, cell: &dyn CellModel) -> Result<StrehlSummary> {
        let strehl = self.lens.strehl_of_layout(pillars, cell, &self.judging_wavelengths())?;
        let step = largest_step_in_layout(pillars, &self.mapping)?;
        Ok(StrehlSummary::new("layout", cell.fidelity(), strehl, step))
    }

    /// Geometric-mean Strehl ratio of phases (waves) for errors of fabrication drawn afresh: one for each
    /// draw. `cells` as in [`OptimiseTask::solve`].
    ///
    /// # Errors
    /// If a cell does not cover the band, or is coupled.
    pub fn judge_errors(
        &self,
        waves: &[f64],
        robust: &metalith_design::RobustSpec,
        cells: &[&dyn CellModel],
        draws: usize,
    ) -> Result<Vec<f64>> {
        if cells.iter().any(|cell| cell.fidelity() == Fidelity::Neighbours) {
            return Err(Error::refused(
                "optimise/errors-with-neighbours",
                "errors of fabrication are not supported with the coupled model",
                "simulate them with the cell `rigorous`",
            ));
        }
        let widths = self.widths_nm(waves);
        let band = self.judging_wavelengths().into_iter().step_by(4).collect::<Vec<_>>();
        fabrication_errors::draw(robust, draws, cells.len(), self.spec.seed ^ 0x0dd)
            .into_iter()
            .map(|error| {
                let rows = self.lens.focal_rows(&band, error, cells)?;
                let blocks = vec![(crate::MeritKind::Log, 1.0, rows)];
                let problem = crate::FieldProblem::new(blocks, cells, self.mapping.clone(), 1 << 30)?;
                Ok(problem.merit_of_widths(&widths).exp())
            })
            .collect()
    }
}
