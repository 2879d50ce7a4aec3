//! Recentred leaders: an effect whose fit explains much of what is fitted and predicts nothing of what is left out.
//!
//! On a surrogate, numbers add. Where they do not (the two slopes of a tilted sensor far from none), the surrogate is at fault and
//! not the effect: all is simulated anew about its fit. If it explains the residual there it is taken, and otherwise one more effect is
//! looked for on top of it.

use metalith_core::{Progress, Result};

use super::pairs::{FoundTogether, sound};
use super::signatures::score_effects;
use super::state::SearchState;
use super::stepwise::{LEADERS, fit_with, step_forward};
use crate::fit::Fit;
use crate::measurements::Measurements;

/// Leaders that are simulated anew.
const FOLLOWED: usize = 2;

/// Share of the chi-square above noise, of measurements that are fitted, that such an effect explains at least: an aperture 2.6 and 2.2 um off beside a
/// blurred image explains 0.51. What is taken must explain nearly all.
const EXPLAINS: f64 = 0.3;

/// An effect that explains much of what is fitted, alone or with one more that explains the rest; only if what is taken is sound.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn follow_leaders_anew<'a, M: Measurements>(
    now: &SearchState<'a, M>,
    chosen: &[usize],
    progress: &dyn Progress,
) -> Result<Option<FoundTogether<'a, M>>> {
    let problem = &now.problem;
    let above_noise = |fit: &Fit<M>| fit.chi2 - problem.points();
    let leaders = score_effects(problem, &now.fit, chosen).into_iter().take(LEADERS);
    let mut leaders: Vec<(usize, f64, Fit<M>)> = leaders
        .filter_map(|(effect, score)| Some((effect, score, fit_with(problem, &now.fit, chosen, &[effect])?)))
        .filter(|(_, _, fit)| above_noise(fit) < (1.0 - EXPLAINS) * above_noise(&now.fit))
        .collect();
    leaders.sort_by(|a, b| a.2.chi2.total_cmp(&b.2.chi2));
    leaders.truncate(FOLLOWED);
    let runners_up: Vec<usize> = leaders.iter().map(|l| l.0).collect();
    for (effect, score, fit) in leaders {
        if problem.model.is_spent() {
            break;
        }
        let mut state = now.clone();
        state.fit = fit;
        state.recentre(progress)?;
        state.refine(progress)?;
        let mut taken = vec![(effect, score)];
        let mut runners_up = runners_up.clone();
        let alone = sound(now, &state, &taken);
        if alone.is_none() {
            state.renew_others(progress)?;
            let step = step_forward(&mut state, &[chosen, &[effect]].concat(), true, progress)?;
            let Some((second, fit, held)) = step.taken else {
                continue;
            };
            (state.fit, state.held_out) = (fit, held);
            state.refine(progress)?;
            taken.push((second.effect, second.score));
            runners_up.extend(step.leaders);
        }
        if let Some(tried) = alone.or_else(|| sound(now, &state, &taken)) {
            return Ok(Some(FoundTogether {
                tried,
                state,
                runners_up,
            }));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::super::attribute::attribute;
    use super::super::pairs::find_pair;
    use super::*;
    use crate::test_model::{LinearModel, Product, Term, setups};
    use metalith_core::Silent;

    /// Effects that are found. The first number of the joined effect acts three times as strongly in one element as it would alone,
    /// and backwards in the other: what is fitted to one predicts nothing of the other.
    fn found(truth: [f64; 4]) -> Vec<usize> {
        let periods = [[2, 3], [5, 4], [3, 0], [0, 6]];
        let own = Product {
            periods: [2, 3],
            factor: 17.0,
        };
        let model = LinearModel::new(periods.map(Term::linear).to_vec(), setups(2, 2, 2)).with_first_two_joined(own);
        let data = model.data(|_| truth.to_vec(), Some(3));
        let mut state = SearchState::new(model.problem(&data), model.problem(&data).nuisance_fit());
        assert!(step_forward(&mut state, &[], true, &Silent).unwrap().taken.is_none());
        assert!(find_pair(&state, &[], true, &Silent).unwrap().is_none());
        let found = attribute(model.problem(&data), true, None, &Silent).unwrap();
        for (k, slot) in found.after.active.iter().enumerate() {
            let error = found.after.theta[*slot] - truth[*slot];
            assert!(error.abs() < found.half_widths[k].half_width(), "{slot}: {error}");
        }
        found.chosen
    }

    #[test]
    fn an_effect_whose_numbers_do_not_add_is_found_alone_and_with_another() {
        assert_eq!(found([0.05, 0.12, 0.0, 0.0]), [0]);
        assert_eq!(found([0.05, 0.12, 0.0, 0.03]), [0, 2]);
    }
}
