//! The model's own errors: what is found in sets without noise if nothing else is looked for than what is there.

use super::chips::AppliedEffect;
use super::{ClaimedNumber, ValidationTrial};
use crate::diagnosis::FoundEffect;
use crate::session::{Session, Simulations};
use metalith_attribution::SetVerdict;
use metalith_core::{Progress, Result};

impl ValidationTrial {
    /// Fit the effects that are there, and no others.
    pub(super) fn measure(
        &mut self,
        session: &Session<'_>,
        simulations: &Simulations,
        parts: &[AppliedEffect],
        progress: &dyn Progress,
    ) -> Result<()> {
        let (simulator, set) = (&session.simulator, session.set());
        let place = |name: &String| simulator.effects.iter().position(|e| e.name() == *name);
        let own: Vec<usize> = parts.iter().filter_map(|(name, _)| place(name)).collect();
        // Of a chip without effect each effect by itself: it is found as what the stated cell errs by.
        let fits: Vec<Vec<usize>> = if own.is_empty() {
            (0..simulator.effects.len()).map(|effect| vec![effect]).collect()
        } else {
            vec![own]
        };
        self.verdict = SetVerdict::Explained;
        self.named = !parts.is_empty();
        let pixels = session.problem(simulations).points().max(1.0);
        for own in fits {
            let (fit, widths) = session.fitted(simulations, &own, !parts.is_empty(), progress)?;
            self.held_out_after = fit.chi2 / pixels;
            for &effect in &own {
                let name = simulator.effects[effect].name();
                let slots = simulator.slots_of(effect);
                let numbers = parts.iter().find(|(own, _)| *own == name);
                let numbers = numbers.map_or(vec![0.0; slots.len()], |(_, numbers)| numbers.clone());
                let values: Vec<f64> = slots.iter().map(|&s| fit.theta[s]).collect();
                let found = FoundEffect::new(simulator, effect, &values, &fit.pick(&slots, &widths), &[]);
                let truth = simulator.effects[effect].reported(&numbers, &vec![0.0; numbers.len()], set);
                let truth: Vec<f64> = truth.into_iter().map(|r| r.0).collect();
                self.numbers.extend(ClaimedNumber::all(&found, &truth));
                self.found.extend((!parts.is_empty()).then_some(name));
            }
        }
        Ok(())
    }
}
