//! What the model's own error does to the numbers that are found.
//!
//! Two correct programs do not predict the same image. They differ in the transmission of pillars, by a smooth function
//! of width, and in what an effect changes, by a small share of it. A fit takes such a difference for its parameters,
//! the more so the more alike these are: it makes some `cd_bias` and `sidewall_taper` of it, that cancel almost. The
//! difference is therefore added to the intervals: amplitude and phase over width for each LED, and the path over the
//! lens, each with a standard deviation of its own, are propagated through the fit; and a share of what was found itself.

use nalgebra::{DMatrix, DVector};

use super::cross_validation::SIGMAS_95;
use super::normal_equations::covariance;
use super::problem::{Fit, FitProblem};
use crate::forward_model::{PATH_TERMS, TRANSMISSION_TERMS};

/// What the model errs by, as one standard deviation.
#[derive(Clone, Copy, Debug)]
pub struct ModelError {
    /// Of each polynomial over width of the relative amplitude that a cell transmits.
    pub amplitude: f64,
    /// The same of the phase (rad).
    pub phase_rad: f64,
    /// Shapes that the error of what effects change is spread over: the fewer, the more of it looks like an effect. No fewer than the
    /// smooth terms.
    pub shapes: f64,
    /// Whether what is found errs by a share of itself besides.
    pub of_value: bool,
}

impl ModelError {
    /// As measured. Amplitude and phase are those of the truncation of the stated cell, in the mean of the spectrum of an LED (test
    /// `the_error_of_a_cell_in_intervals_is_that_of_its_truncation`). The shapes follow from gaps and tilts, in sets by a
    /// program that shares nothing with this one and in synthetic ones: they err by 0.18 (rms) of what an error spread over
    /// the 29 smooth terms of three LEDs would make of them.
    pub const MEASURED: Self = Self {
        amplitude: 0.0005,
        phase_rad: 0.0026,
        shapes: 900.0,
        of_value: true,
    };

    /// What a claim must stand against: the cell errs by the whole of its truncation in amplitude as well, and what effects change errs
    /// in the smooth shapes alone, which are most like effects.
    pub const CAUTIOUS: Self = Self {
        amplitude: 0.003,
        phase_rad: 0.003,
        shapes: 0.0,
        of_value: false,
    };
}

/// 95 % half-widths of the active parameters of a fit by the error of the model alone; zero where no smooth terms were
/// simulated.
pub fn model_half_widths(problem: &FitProblem<'_>, fit: &Fit, error: &ModelError) -> Vec<f64> {
    let surrogate = &problem.surrogate;
    let (terms, amplitudes) = (surrogate.smooth_terms(), TRANSMISSION_TERMS * problem.data.leds);
    if terms < PATH_TERMS + 2 * amplitudes {
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
    let shapes = error.shapes.max(terms as f64);
    let slots = problem.model.slots();
    (0..fit.active.len())
        .map(|k| {
            let variance = (0..terms).map(|t| {
                let of_cells = match t.checked_sub(PATH_TERMS) {
                    None => 0.0,
                    Some(t) if t < amplitudes => error.amplitude.powi(2),
                    Some(_) => error.phase_rad.powi(2),
                };
                let place = first - shared + t;
                let own = free[(place, place)].max(f64::MIN_POSITIVE);
                let of_change = energy / (shapes * own);
                // A term that shows in no capture is no error.
                let sigma2 = if own < VISIBLE { 0.0 } else { of_cells + of_change };
                sigma2 * taken[(shared + k, t)].powi(2)
            });
            let slot = fit.active[k];
            let of_value = match error.of_value {
                true => problem.model.value_share(slots[slot].effect) * fit.theta[slot],
                false => 0.0,
            };
            SIGMAS_95 * variance.sum::<f64>().sqrt().hypot(of_value)
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
        let [like, unlike] = model_half_widths(&problem, &fit, &ModelError::MEASURED)[..] else {
            panic!("two parameters are active")
        };
        let of_a_radian = SMOOTH_STEP / SmoothTerm::Phase(0).step();
        let expected = SIGMAS_95 * ModelError::MEASURED.phase_rad * of_a_radian / 2f64.sqrt();
        assert!((like / expected - 1.0).abs() < TOLERANCE, "{like} {expected}");
        assert!(unlike < TOLERANCE * expected, "{unlike}");
    }
}
