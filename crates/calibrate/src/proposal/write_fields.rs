//! Where a boundary of write fields in every lens would explain most of what is left.

use super::WORTH_PROPOSING;
use crate::fit::minimise;
use crate::optics::PixelGrid;
use crate::search::Evidence;
use crate::session::Session;
use metalith_core::{Progress, Result};
use metalith_made::{Perturbation, Stitching};

/// Places that are tried, over the diameter of a lens: [`crate::effects::StitchedFields`] finds its own from the nearest of them.
const PLACES: [f64; 5] = [-0.3, -0.15, 0.0, 0.15, 0.3];

/// Displacement that images are linear in (nm).
const STEP_NM: f64 = 10.0;

/// The place of a boundary across x and of one across y, from the middle of every lens (um), that would remove most of what a
/// finding leaves; none if neither removes much.
///
/// # Errors
/// If the user stopped it.
pub fn boundary_of_fields(
    session: &Session<'_>,
    evidence: &Evidence,
    progress: &dyn Progress,
) -> Result<Option<[f64; 2]>> {
    let (simulator, fit) = (&session.simulator, &evidence.finding.after);
    let problem = evidence.problem(simulator);
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
    let places = || [0, 1].into_iter().flat_map(|axis| PLACES.map(|place| (axis, place)));
    let steps = [[STEP_NM, 0.0], [0.0, STEP_NM]];
    let mut chips = vec![found.clone()];
    chips.extend(places().flat_map(|(axis, place)| steps.map(|by_nm| displaced(axis, place, by_nm))));
    let images = simulator.expose(&chips, progress)?;
    let (as_found, moved) = images.split_first().expect("the first is of the finding");
    let mut best = [(f64::INFINITY, 0.0); 2];
    for ((axis, place), moved) in places().zip(moved.chunks_exact(steps.len())) {
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
            best[axis] = (chi2, place * diameter_um);
        }
    }
    let left = best[0].0.min(best[1].0);
    let is_worth = fit.chi2 - left > WORTH_PROPOSING * (fit.chi2 - problem.pixels());
    Ok(is_worth.then(|| best.map(|(_, at_um)| at_um)))
}
