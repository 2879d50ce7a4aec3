//! The three fidelities of the cell, compared on a set: nuisances fitted, nothing else.

use metalith_cell::{FittedCell, PublishedCell, cache_folder};
use metalith_core::{Progress, Result};
use ndarray::Array2;
use serde::Serialize;

use crate::bench::{Bench, BenchSampling};
use crate::cells::CellSource;
use crate::set::{MeasuredSet, PerMeasurement};
use crate::simulator::Simulator;
use crate::statistics::{FitProblem, Measurements, Surrogate, held_out, mean_error};
use metalith_optics::Perturbation;

/// The error of one fidelity of the cell.
#[derive(Clone, Debug, Serialize)]
pub struct FidelityError {
    pub fidelity: String,
    /// Reduced chi-square per pixel of the fit.
    pub fit: f64,
    /// Error on measurements left out.
    pub held_out: f64,
    /// Residual of each measurement (sigma), nuisances fitted; for pictures.
    #[serde(skip)]
    pub residuals: PerMeasurement<Array2<f32>>,
}

/// The error of each fidelity: of the published and the fitted polynomials where the cell is that of the paper, and of
/// the rigorous cell. `problem` is that of the rigorous cell.
///
/// # Errors
/// If a cell cannot be fitted or simulated, or the user stopped it.
pub(crate) fn compare_fidelities(
    set: &MeasuredSet,
    sampling: BenchSampling,
    problem: &FitProblem<'_>,
    progress: &dyn Progress,
) -> Result<Vec<FidelityError>> {
    let mut rungs = Vec::new();
    if set.stack.is_of_the_paper() {
        rungs = polynomials(set, sampling, problem, progress)?;
    }
    rungs.push(rung("rigorous", problem));
    Ok(rungs)
}

/// The error of the cells that are polynomials: published, and fitted to the stack.
fn polynomials(
    set: &MeasuredSet,
    sampling: BenchSampling,
    problem: &FitProblem<'_>,
    progress: &dyn Progress,
) -> Result<Vec<FidelityError>> {
    let bench = Bench::new(set, sampling);
    let published = CellSource::Model(Box::new(PublishedCell::new(set.stack.cell.pitch_nm as u32)));
    let ends = bench
        .wavelengths_nm()
        .iter()
        .fold((f64::MAX, 0.0f64), |(a, b), &l| (a.min(l), b.max(l)));
    let (low, high) = bench.widths_nm();
    let fitted = FittedCell::of_stack(
        &set.stack.cell,
        (ends.0 * 1e-3, ends.1 * 1e-3),
        (low as u16, high as u16),
        cache_folder().as_deref(),
    )?;
    let fitted = CellSource::Model(Box::new(fitted));
    let mut rungs = Vec::new();
    for (name, cells) in [("published", published), ("fitted", fitted)] {
        let simulator = Simulator::new(Bench::new(set, sampling), cells, Vec::new());
        let images = simulator.expose(&[Perturbation::default()], progress)?.remove(0);
        let of_model = FitProblem {
            model: &simulator,
            surrogate: Surrogate::constant(images.into()),
            ..problem.clone()
        };
        rungs.push(rung(name, &of_model));
    }
    Ok(rungs)
}

fn rung(name: &str, problem: &FitProblem<'_>) -> FidelityError {
    let fit = problem.nuisance_fit();
    let residual = |c| {
        let image = problem.prediction(&fit.theta, c);
        fit.nuisances.residual(problem.data, &image, c)
    };
    FidelityError {
        fidelity: name.into(),
        fit: fit.chi2 / problem.points(),
        held_out: mean_error(&held_out(problem, &fit.equations, &fit)),
        residuals: problem.data.indices().map(residual).collect(),
    }
}
