//! Residual, put as effects that a file could declare: candidates that the list lacks.
//!
//! A proposal is a guess with a place to start from. It becomes a finding only where the search takes it: fitted,
//! cross-validated and held against all other effects like these.

mod by_element;
mod ghost;
mod wavefront;
mod write_fields;

use crate::diagnosis::FreePattern;
use crate::effects::DeclaredEffect;
use crate::session::Session;
use crate::smooth_residual::SmoothResidual;
use crate::statistics::Evidence;
use metalith_core::{Progress, Result};
pub use write_fields::{FieldBoundary, boundary_of_fields};

/// A shape is proposed if it removes this share of the chi-square above noise: less is a part of something else.
pub(crate) const WORTH_PROPOSING: f64 = 0.3;

/// And if it changes the images by this share (rms) or more: no measurement distinguishes less from the error of the model.
const LEAST_CHANGE: f64 = 1e-3;

/// An effect that may explain what a finding leaves.
#[derive(Clone, Debug)]
pub struct Proposed {
    pub effect: DeclaredEffect,
    /// Evidence for it, for the user.
    pub reason: String,
}

/// Effects that may explain what a finding leaves, those that remove most first; none where nothing stands out. What has the
/// name of an effect that was tried is left out.
///
/// # Errors
/// If the user stopped it.
pub fn propose(session: &Session<'_>, evidence: &Evidence, progress: &dyn Progress) -> Result<Vec<Proposed>> {
    let problem = evidence.problem(&session.simulator);
    let fit = &evidence.finding.after;
    let above_noise = fit.chi2 - problem.points();
    let mut found = Vec::new();
    if let Some(ghost) = ghost::strongest(&problem, fit, progress)? {
        let effect = ghost.declared(session.set().camera.pixel_um);
        let reason = "a displaced copy of the image in every measurement".to_owned();
        found.push((ghost.removed, vec![Proposed { effect, reason }]));
    }
    if let Some(smooth) = SmoothResidual::new(&session.simulator, &problem, fit) {
        let removed = (smooth.chi2.0 - smooth.chi2.1) * problem.points();
        let of = |effect| Proposed {
            effect,
            reason: "a smooth path that every lens has".into(),
        };
        let both = wavefront::declared(&smooth, session.set()).into_iter().map(of);
        found.push((removed, both.collect()));
    }
    for pattern in evidence.patterns(&session.simulator) {
        let removed = (pattern.chi2.1 - pattern.chi2.0) * problem.points();
        let of = |effect| Proposed {
            effect,
            reason: FreePattern::new(&session.simulator, pattern).sentence(),
        };
        found.extend(by_element::declared(&session.simulator, pattern).map(|effect| (removed, vec![of(effect)])));
    }
    let least = LEAST_CHANGE.powi(2) * problem.data.energy(&problem.used);
    found.retain(|(removed, _)| *removed > (WORTH_PROPOSING * above_noise).max(least));
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let is_new = |p: &Proposed| session.simulator.effects.iter().all(|e| e.name() != p.effect.name);
    Ok(found.into_iter().flat_map(|(_, own)| own).filter(is_new).collect())
}
