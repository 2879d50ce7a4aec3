//! What the model's own error does to the numbers that are found.
//!
//! Two correct programs do not predict the same image. They differ in the transmission of pillars, by a smooth function
//! of width, and in what an effect changes, by a small share of it. A fit takes such a difference for its parameters,
//! the more so the more alike these are: it makes some `cd_bias` and `sidewall_taper` of it, that cancel almost. The
//! difference is therefore added to the intervals: amplitude and phase over width for each LED, and the path over the
//! lens, each with a standard deviation of its own, are propagated through the fit.

use nalgebra::{DMatrix, DVector};

use super::cross_validation::SIGMAS_95;
use super::normal_equations::covariance;
use super::problem::{Fit, FitProblem};
use crate::forward_model::{PATH_TERMS, TRANSMISSION_TERMS};

/// Standard deviation of each polynomial over width of the relative amplitude and of the phase (rad) that a cell
/// transmits: the three of them together err by 0.005, the truncation error of the stated cell.
const CELL_ERROR: f64 = 0.003;

/// 95 % half-widths of the active parameters of a fit by the error of the model alone; zero where no smooth terms were
/// simulated.
pub fn model_half_widths(problem: &FitProblem<'_>, fit: &Fit) -> Vec<f64> {
    let surrogate = &problem.surrogate;
    let (terms, cells) = (surrogate.smooth_terms(), 2 * TRANSMISSION_TERMS * problem.data.leds);
    if terms < PATH_TERMS + cells {
        return vec![0.0; fit.active.len()];
    }
    let equations = problem.equations_with(fit, |c, image| {
        (0..terms).map(|t| surrogate.smooth_term(t, c, image)).collect()
    });
    let form = problem.total(&equations, &fit.nuisances);
    let (shared, first) = (problem.shared(), form.nrows() - 1 - terms);
    let inverse = covariance(&form, &(0..first).collect::<Vec<_>>());
    let cross = form.view((0, first), (first, terms)).into_owned();
    // What a fit makes of a unit of each term, and the energy of a unit that no nuisance takes.
    let taken = &inverse * &cross;
    let free = projected(&form, shared);
    let energy = change_energy(problem, fit);
    (0..fit.active.len())
        .map(|k| {
            let variance = (0..terms).map(|t| {
                let of_cells = if t < PATH_TERMS { 0.0 } else { CELL_ERROR.powi(2) };
                let place = first - shared + t;
                let own = free[(place, place)].max(f64::MIN_POSITIVE);
                let of_change = energy / (terms as f64 * own);
                // A term that shows in no capture is no error.
                let sigma2 = if own < VISIBLE { 0.0 } else { of_cells + of_change };
                sigma2 * taken[(shared + k, t)].powi(2)
            });
            SIGMAS_95 * variance.sum::<f64>().sqrt()
        })
        .collect()
}

/// Least energy of a unit of a term, as a share of the noise of one pixel, that shows at all.
const VISIBLE: f64 = 1e-6;

/// Energy (chi-square) that the model may err by in what the effects of a fit change.
pub fn change_energy(problem: &FitProblem<'_>, fit: &Fit) -> f64 {
    let form = problem.total(&fit.equations, &fit.nuisances);
    let free = projected(&form, problem.shared());
    (0..problem.model.effects())
        .map(|effect| {
            let slots = problem.model.slots_of(effect);
            let mut theta = DVector::zeros(free.nrows());
            for s in slots {
                if let Some(k) = fit.position(s) {
                    theta[k] = fit.theta[s];
                }
            }
            let energy = (&free * &theta).dot(&theta);
            problem.model.error_share(effect).powi(2) * energy.max(0.0)
        })
        .sum()
}

/// The inner products of all columns but the shared nuisances and the residual, with the nuisances projected out.
pub fn projected(form: &DMatrix<f64>, shared: usize) -> DMatrix<f64> {
    let n = form.nrows() - 1 - shared;
    let nuisances = form.view((0, 0), (shared, shared)).into_owned();
    let cross = form.view((0, shared), (shared, n)).into_owned();
    let inverse = nuisances
        .try_inverse()
        .unwrap_or_else(|| DMatrix::zeros(shared, shared));
    form.view((shared, shared), (n, n)) - cross.transpose() * inverse * &cross
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward_model::SmoothTerm;
    use crate::linear_model::{LinearModel, PHASE_PERIODS, SMOOTH_STEP, Term, beams};

    /// An effect that changes an image as the error of a cell does cannot be told from it: two LEDs, each with an error
    /// of its own and half of the captures, make an error of the effect of one over the root of two.
    #[test]
    fn an_effect_like_an_error_of_the_cell_has_the_interval_of_that_error() {
        /// Relative: single-precision images, and registration that follows the pattern a little.
        const TOLERANCE: f64 = 1e-2;
        let terms = vec![Term::linear(PHASE_PERIODS), Term::linear([2, 3])];
        let model = LinearModel::new(terms, beams(2, 2, 2));
        let data = model.data(|_| vec![0.01, 0.02], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0, 1], &problem.nuisance_fit());
        let [like, unlike] = model_half_widths(&problem, &fit)[..] else {
            panic!("two parameters are active")
        };
        let of_a_radian = SMOOTH_STEP / SmoothTerm::Phase(0).step();
        let expected = SIGMAS_95 * CELL_ERROR * of_a_radian / 2f64.sqrt();
        assert!((like / expected - 1.0).abs() < TOLERANCE, "{like} {expected}");
        assert!(unlike < TOLERANCE * expected, "{unlike}");
    }
}
