//! Fits that go farther than the atlas was simulated, or nearer to the truth than its polynomials.

use super::effects::Stage;
use super::fit::{Fit, Problem};
use super::optics::PixelGrid;
use metalith_core::{Progress, Result};

/// Times that the atlas is carried on towards where a fit went.
const STRETCHES: usize = 3;

/// Where a fit came to a new place, the atlas is simulated there and so much farther from its middle.
const FARTHER: f64 = 1.4;

/// Exact simulations that a fit is brought to rest with.
const EXACT_STEPS: usize = 3;

/// Cells are solved at multiples of this share of a typical size; the atlas goes the rest of the way.
const CELLS_APART: f64 = 1.0 / 16.0;

/// It has come to rest when no number moves by more than this share of its typical size.
const AT_REST: f64 = 2e-2;

impl Problem<'_> {
    /// Whether a fit went beyond what was simulated.
    pub fn beyond(&self, fit: &Fit) -> bool {
        fit.active.iter().any(|&s| self.is_beyond(s, fit.theta[s]))
    }

    fn is_beyond(&self, slot: usize, value: f64) -> bool {
        let (low, high) = self.atlas.known(slot);
        let room = 1e-9 * (high - low);
        value < low - room || value > high + room
    }

    /// Follow a fit to where it wants to go, simulating the atlas farther on.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn stretch(&mut self, mut fit: Fit, progress: &dyn Progress) -> Result<Fit> {
        for _ in 0..STRETCHES {
            let far: Vec<usize> = fit
                .active
                .iter()
                .copied()
                .filter(|&s| self.is_beyond(s, fit.theta[s]))
                .collect();
            if far.is_empty() {
                break;
            }
            for slot in far {
                let (low, high) = self.simulator.slots[slot].parameter.range;
                let (value, about) = (fit.theta[slot], self.atlas.about[slot]);
                let mut values = vec![value, (about + FARTHER * (value - about)).clamp(low, high)];
                values.dedup();
                let looked_up = self.exact.is_some().then(|| self.looked_up(&fit.theta));
                self.simulator.extend(&mut self.atlas, slot, &values, progress)?;
                // What the exact simulation added was counted from the atlas as it was.
                if let Some((exact, before)) = self.exact.take().zip(looked_up) {
                    let after = self.looked_up(&fit.theta);
                    let parts = exact.iter().zip(before.iter().zip(&after));
                    self.exact = Some(
                        parts
                            .map(|(e, (b, a))| PixelGrid::combine(&[(e, 1.0), (b, 1.0), (a, -1.0)]))
                            .collect(),
                    );
                }
            }
            let active = fit.active.clone();
            fit = self.fit(&active, &fit);
        }
        Ok(fit)
    }

    /// Bring a fit to rest on exact simulations of where it is, or close by.
    ///
    /// # Errors
    /// As [`Problem::stretch`].
    pub fn settle(&mut self, mut fit: Fit, progress: &dyn Progress) -> Result<Fit> {
        for _ in 0..EXACT_STEPS {
            fit = self.stretch(fit, progress)?;
            let at = self.rounded(&fit.theta);
            let departure = self.simulator.perturbation(&at);
            let exposed = self.simulator.expose(&[departure], progress)?.remove(0);
            let offset = exposed
                .iter()
                .zip(self.looked_up(&at))
                .map(|(made, looked_up)| PixelGrid::combine(&[(made, 1.0), (&looked_up, -1.0)]))
                .collect();
            self.exact = Some(offset);
            let next = self.fit(&fit.active, &fit);
            let moved = fit
                .active
                .iter()
                .map(|&s| (next.theta[s] - fit.theta[s]).abs() / self.simulator.slots[s].parameter.typical)
                .fold(0.0, f64::max);
            fit = next;
            if moved < AT_REST {
                break;
            }
        }
        Ok(fit)
    }

    /// Numbers close by whose cells are likely to be known already.
    fn rounded(&self, theta: &[f64]) -> Vec<f64> {
        let slots = self.simulator.slots.iter().zip(theta);
        slots
            .map(|(slot, value)| {
                if self.simulator.effects[slot.effect].stage() != Stage::Stack {
                    return *value;
                }
                let step = CELLS_APART * slot.parameter.typical;
                let (low, high) = slot.parameter.range;
                ((value / step).round() * step).clamp(low, high)
            })
            .collect()
    }

    fn looked_up(&self, theta: &[f64]) -> Vec<PixelGrid> {
        (0..self.data.signal.len()).map(|c| self.atlas.grid(theta, c)).collect()
    }
}
