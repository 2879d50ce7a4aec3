//! What is left, put as effects that a file could declare: candidates for what the list lacks.
//!
//! A proposal is a guess with a place to start from. It becomes a finding only where the search takes it: fitted,
//! cross-validated and held against all other effects like these.

mod ghost;
mod wavefront;

use crate::effects::DeclaredEffect;
use crate::search::Evidence;
use crate::session::Session;
use crate::smooth_residual::SmoothResidual;

/// A shape is proposed if it removes this share of the chi-square above noise: less is a part of something else.
const WORTH_PROPOSING: f64 = 0.3;

/// Effects that may explain what a finding leaves, those that remove most first; none where nothing stands out.
pub fn propose(session: &Session<'_>, evidence: &Evidence) -> Vec<DeclaredEffect> {
    let problem = evidence.problem(&session.simulator);
    let fit = &evidence.finding.after;
    let above_noise = fit.chi2 - problem.pixels();
    let mut found = Vec::new();
    if let Some(ghost) = ghost::strongest(&problem, fit) {
        let effect = ghost.declared(session.set().camera.pixel_um);
        found.push((ghost.removed, vec![effect]));
    }
    if let Some(smooth) = SmoothResidual::new(&session.simulator, &problem, fit) {
        let removed = (smooth.chi2.0 - smooth.chi2.1) * problem.pixels();
        found.push((removed, wavefront::declared(&smooth, session.set())));
    }
    found.retain(|(removed, _)| *removed > WORTH_PROPOSING * above_noise);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().flat_map(|(_, effects)| effects).collect()
}
