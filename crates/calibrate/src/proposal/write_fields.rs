//! Place of a boundary of write fields in every lens that explains most of the residual.

use crate::optics::PixelGrid;
use crate::session::Session;
use crate::statistics::{Fit, FitProblem, minimise};
use metalith_core::{Progress, Result};
use metalith_optics::{Perturbation, Stitching};

/// Places that are tried first, over the diameter of a lens, and then about the best of them: [`crate::effects::StitchedFields`] finds
/// its own from the nearest.
const PLACES: [f64; 7] = [-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45];
const NEARER: [f64; 4] = [-0.1, -0.05, 0.05, 0.1];

/// Displacement that images are linear in (nm).
const STEP_NM: f64 = 10.0;

/// Least error above noise that a share is relative to.
const LEAST_ERROR: f64 = 1e-9;

/// A boundary of write fields, at the same place in every lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldBoundary {
    /// The place of one across x and of one across y, from the middle of a lens (um).
    pub at_um: [f64; 2],
    /// Share of the error above noise that the better of them would remove, about: places between are not tried.
    pub removes: f64,
}

/// The boundary that would remove most of what a fit leaves.
///
/// # Errors
/// If the user stopped it.
pub fn boundary_of_fields(
    session: &Session<'_>,
    problem: &FitProblem<'_>,
    fit: &Fit,
    progress: &dyn Progress,
) -> Result<FieldBoundary> {
    let first = best_of([PLACES.to_vec(), PLACES.to_vec()], (session, problem, fit), progress)?;
    let about = first.map(|(_, place)| NEARER.map(|step| place + step).to_vec());
    let nearer = best_of(about, (session, problem, fit), progress)?;
    let better = |axis: usize| {
        if nearer[axis].0 < first[axis].0 {
            nearer[axis]
        } else {
            first[axis]
        }
    };
    let best = [0, 1].map(better);
    let left = best[0].0.min(best[1].0);
    let above_noise = (fit.chi2 - problem.points()).max(LEAST_ERROR);
    Ok(FieldBoundary {
        at_um: best.map(|(_, place)| place * session.set().stack.lens_diameter_um),
        removes: (fit.chi2 - left) / above_noise,
    })
}

/// The best of some places across x and of some across y, over the diameter of a lens, and the chi-square that each would leave.
fn best_of(
    places: [Vec<f64>; 2],
    (session, problem, fit): (&Session<'_>, &FitProblem<'_>, &Fit),
    progress: &dyn Progress,
) -> Result<[(f64, f64); 2]> {
    let simulator = &session.simulator;
    let diameter_um = session.set().stack.lens_diameter_um;
    let found = simulator.perturbation(&fit.theta);
    let displaced = |axis, place: f64, by_nm| {
        let mut perturbation: Perturbation = found.clone();
        perturbation.geometry.stitching.push(Stitching {
            axis,
            at_um: place * diameter_um,
            by_nm,
        });
        perturbation
    };
    let tried: Vec<(usize, f64)> = (0..2)
        .flat_map(|axis| places[axis].iter().map(move |place| (axis, *place)))
        .collect();
    let steps = [[STEP_NM, 0.0], [0.0, STEP_NM]];
    let mut chips = vec![found.clone()];
    chips.extend(
        tried
            .iter()
            .flat_map(|&(axis, place)| steps.map(|by_nm| displaced(axis, place, by_nm))),
    );
    let images = simulator.expose(&chips, progress)?;
    let (as_found, moved) = images.split_first().expect("the first is of the finding");
    let mut best = [(f64::INFINITY, 0.0); 2];
    for ((axis, place), moved) in tried.into_iter().zip(moved.chunks_exact(steps.len())) {
        let equations = problem.equations_with(fit, |c, _| {
            let change = |to: &Vec<PixelGrid>| {
                let c = usize::from(c);
                PixelGrid::combine(&[(&to[c], 1.0 / STEP_NM as f32), (&as_found[c], -1.0 / STEP_NM as f32)])
            };
            moved.iter().map(change).collect()
        });
        let total = problem.total(&equations, &fit.nuisances);
        let (_, chi2) = minimise(&total, &(0..equations.size() - 1).collect::<Vec<_>>());
        if chi2 < best[axis].0 {
            best[axis] = (chi2, place);
        }
    }
    Ok(best)
}
