//! Smooth terms that stand for nothing: what a winner must beat.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::fit::cross_validation::{HeldOutErrors, SEED, held_out, mean};
use crate::fit::normal_equations::sum;
use crate::fit::nuisances::CaptureEquations;
use crate::fit::problem::{Fit, Problem};
use crate::optics::PixelGrid;
use crate::surrogate::FREE_PHASES;

/// Random smooth terms that stand against a winner.
const PLACEBOS: usize = 60;

/// The forms of further columns, after the numbers that are active; `more` has them for a capture and what it
/// should show.
pub fn forms_with(
    problem: &Problem<'_>,
    now: &Fit,
    more: impl Fn(usize, &PixelGrid) -> Vec<PixelGrid> + Sync,
) -> Vec<DMatrix<f64>> {
    let mut forms: Vec<DMatrix<f64>> = (0..problem.data.signal.len())
        .into_par_iter()
        .map(|c| {
            let grid = problem.grid(&now.theta, c);
            let active = now.active.iter().map(|&s| problem.atlas.slope(&now.theta, s, c));
            let columns: Vec<_> = active.chain(more(c, &grid)).collect();
            CaptureEquations::new(problem.data, c, &now.nuisances, &grid, &columns).reduced()
        })
        .collect();
    let size = forms[0].nrows();
    // The SEM says nothing of free terms: their rows stay empty.
    let sem = problem.sem_form(&now.active, &now.theta);
    let mut wide = DMatrix::zeros(size, size);
    let inner = sem.nrows() - 1;
    let place = |i: usize| if i == inner { size - 1 } else { i };
    for i in 0..=inner {
        for j in 0..=inner {
            wide[(place(i), place(j))] = sem[(i, j)];
        }
    }
    forms.push(wide);
    forms
}

/// What random smooth terms gain on captures left out: what 95 % of them stay below.
pub fn null_gain(problem: &Problem<'_>, now: &Fit, held_now: &HeldOutErrors, numbers: usize) -> f64 {
    if problem.atlas.free.len() < FREE_PHASES {
        return 0.0;
    }
    let forms = forms_with(problem, now, |c, grid| {
        (0..FREE_PHASES).map(|t| problem.atlas.free_term(t, c, grid)).collect()
    });
    let size = forms[0].nrows();
    let first = size - 1 - FREE_PHASES;
    let total = sum(&forms[..problem.used.len()], size);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut gains: Vec<f64> = (0..PLACEBOS)
        .map(|_| {
            let kept = first + numbers + 1;
            let mut mix = DMatrix::zeros(size, kept);
            for i in 0..first {
                mix[(i, i)] = 1.0;
            }
            mix[(size - 1, kept - 1)] = 1.0;
            for k in 0..numbers {
                for t in 0..FREE_PHASES {
                    let scale = total[(first + t, first + t)].max(f64::MIN_POSITIVE).sqrt();
                    mix[(first + t, first + k)] = rng.random_range(-1.0..1.0) / scale;
                }
            }
            let mixed: Vec<DMatrix<f64>> = forms.iter().map(|f| mix.transpose() * f * &mix).collect();
            mean(held_now) - mean(&held_out(problem, &mixed, now))
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    gains[(gains.len() - 1) * 95 / 100].max(0.0)
}
