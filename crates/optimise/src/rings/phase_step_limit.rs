//! The limit on the phase step from ring to ring: a hard constraint on every design.

use crate::rings::mapping::{Mapping, step};
use metalith_core::{Error, Result};
use metalith_pillars::PillarMap;

/// Steps are held to the limit but for rounding (waves).
const ROUNDING: f64 = 1e-9;

/// Largest wrapped step between neighbouring rings (waves).
///
/// The transmission of a ring is that of an endless lattice of its own pillars; it holds only while the
/// neighbours are alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepLimit {
    waves: f64,
}

impl StepLimit {
    /// No limit: half a turn is the largest step there is.
    pub const NONE: Self = Self { waves: 0.5 };

    /// A limit in waves, above 0 and up to 0.5.
    ///
    /// # Errors
    /// If it is outside.
    pub fn new(waves: f64) -> Result<Self> {
        if waves > 0.0 && waves <= 0.5 {
            return Ok(Self { waves });
        }
        Err(Error::refused(
            "optimise/phase-step-out-of-range",
            format!("the limit of the phase step is {waves} waves"),
            "give more than 0 and at most 0.5 waves; 0.5 is no limit",
        ))
    }

    /// The limit (waves).
    pub fn waves(self) -> f64 {
        self.waves
    }

    /// True if a step keeps the limit.
    pub fn allows(self, from_waves: f64, to_waves: f64) -> bool {
        step(from_waves, to_waves).abs() <= self.waves + ROUNDING
    }

    /// Move phases as little as is simple until every step keeps the limit: neighbours too far apart come
    /// closer by half the excess each, over and over; what is left after that is cut from the centre out.
    pub fn enforce(self, waves: &mut [f64]) {
        const ROUNDS: usize = 20;
        if self.waves >= 0.5 {
            return;
        }
        for round in 0..ROUNDS {
            let mut kept = true;
            for i in 0..waves.len().saturating_sub(1) {
                let i = if round % 2 == 0 { i } else { waves.len() - 2 - i };
                let d = step(waves[i], waves[i + 1]);
                if d.abs() > self.waves {
                    let excess = 0.5 * (d - self.waves.copysign(d));
                    waves[i] += excess;
                    waves[i + 1] -= excess;
                    kept = false;
                }
            }
            if kept {
                return;
            }
        }
        for i in 1..waves.len() {
            let d = step(waves[i - 1], waves[i]);
            waves[i] = waves[i - 1] + d.clamp(-self.waves, self.waves);
        }
    }

    /// The choices nearest to given phases, in the sum of squares, whose steps keep the limit.
    ///
    /// Dynamic programming from the centre out: for each ring and choice, the least sum so far.
    pub fn nearest_choices(self, mapping: &Mapping, waves: &[f64]) -> Vec<usize> {
        self.best_choices(mapping, waves.len(), |ring, choice| {
            -step(mapping.choices()[choice].waves, waves[ring]).powi(2)
        })
    }

    /// The choices with the largest sum of `score(ring, choice)` whose steps keep the limit.
    pub fn best_choices(self, mapping: &Mapping, rings: usize, score: impl Fn(usize, usize) -> f64) -> Vec<usize> {
        let count = mapping.choices().len();
        let allowed = self.neighbours(mapping);
        let mut sums = (0..count).map(|c| score(0, c)).collect::<Vec<_>>();
        let mut came_from = Vec::<Vec<u16>>::with_capacity(rings);
        for ring in 1..rings {
            let from = allowed
                .iter()
                .map(|near| {
                    let best = near
                        .iter()
                        .copied()
                        .max_by(|&a, &b| sums[usize::from(a)].total_cmp(&sums[usize::from(b)]).then(b.cmp(&a)));
                    best.expect("a choice is its own neighbour")
                })
                .collect::<Vec<_>>();
            sums = (0..count)
                .map(|c| sums[usize::from(from[c])] + score(ring, c))
                .collect();
            came_from.push(from);
        }
        let mut at = (0..count)
            .max_by(|&a, &b| sums[a].total_cmp(&sums[b]).then(b.cmp(&a)))
            .unwrap_or(0);
        let mut path = vec![at; rings];
        for ring in (0..rings.saturating_sub(1)).rev() {
            at = usize::from(came_from[ring][at]);
            path[ring] = at;
        }
        path
    }

    /// Choices that may stand next to each choice.
    pub fn neighbours(self, mapping: &Mapping) -> Vec<Vec<u16>> {
        let choices = mapping.choices();
        choices
            .iter()
            .map(|a| {
                (0..choices.len() as u16)
                    .filter(|&b| self.allows(a.waves, choices[usize::from(b)].waves))
                    .collect()
            })
            .collect()
    }
}

/// Largest wrapped step between neighbouring rings (waves).
pub fn largest_step(waves: &[f64]) -> f64 {
    waves.windows(2).map(|w| step(w[0], w[1]).abs()).fold(0.0, f64::max)
}

/// Largest wrapped phase step between neighbouring pillars of a layout (waves), by the phase that each
/// width stands for. Sites without pillar are passed over.
///
/// # Errors
/// If the layout holds a width that no phase is mapped to.
pub fn largest_step_in_layout(widths: &PillarMap, mapping: &Mapping) -> Result<f64> {
    let mut turns_of = vec![f64::NAN; usize::from(mapping.max_width_nm()) + 1];
    for choice in mapping.choices() {
        turns_of[usize::from(choice.width_nm)] = choice.waves;
    }
    let map = &widths.number;
    let waves = |w: u16| turns_of.get(usize::from(w)).copied().unwrap_or(f64::NAN);
    if let Some(stray) = map.iter().find(|&&w| w != 0 && waves(w).is_nan()) {
        return Err(Error::refused(
            "optimise/unmapped-width",
            format!("the layout holds pillars of {stray} nm, which no phase is mapped to"),
            "compare with the mapping that the layout was made with",
        ));
    }
    let (rows, columns) = map.dim();
    let mut largest = 0.0f64;
    for y in 0..rows {
        for x in 0..columns {
            let here = map[[y, x]];
            let next = [
                (x + 1 < columns).then(|| map[[y, x + 1]]),
                (y + 1 < rows).then(|| map[[y + 1, x]]),
            ];
            for near in next.into_iter().flatten() {
                if here != near && here != 0 && near != 0 {
                    largest = largest.max(step(waves(here), waves(near)).abs());
                }
            }
        }
    }
    Ok(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rings::mapping::tests::{published, rule};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn enforced_steps_keep_the_limit(
            mut waves in prop::collection::vec(-3.0..3.0, 2..60),
            limit in 0.02..0.5,
        ) {
            let limit = StepLimit::new(limit).unwrap();
            limit.enforce(&mut waves);
            prop_assert!(waves.windows(2).all(|w| limit.allows(w[0], w[1])));
        }

        #[test]
        fn chosen_steps_keep_the_limit(
            waves in prop::collection::vec(-3.0..3.0, 2..40),
            limit in 0.02..0.5,
        ) {
            let (mapping, limit) = (published(), StepLimit::new(limit).unwrap());
            let chosen = limit.nearest_choices(&mapping, &waves);
            let waves = mapping.turns_of(&chosen);
            prop_assert!(largest_step(&waves) <= limit.waves() + ROUNDING);
        }
    }

    #[test]
    fn phases_within_the_limit_are_left_alone() {
        let limit = StepLimit::new(0.2).unwrap();
        let smooth = (0..50).map(|i| 0.13 * f64::from(i)).collect::<Vec<_>>();
        let mut waves = smooth.clone();
        limit.enforce(&mut waves);
        assert_eq!(waves, smooth);
        let mapping = published();
        for (&c, &t) in limit.nearest_choices(&mapping, &smooth).iter().zip(&smooth) {
            assert_eq!(c, mapping.nearest(t));
        }
    }

    /// Against every sequence of three choices.
    #[test]
    fn dynamic_programming_finds_the_best() {
        let mapping = Mapping::new(&rule(&[0.30, 0.05]));
        let limit = StepLimit::new(0.2).unwrap();
        let count = mapping.choices().len();
        assert!(count > 5);
        let score = |ring: usize, c: usize| ((ring * 7 + c * 13) % 11) as f64;
        let found = limit.best_choices(&mapping, 3, score);
        let sum = |path: &[usize]| path.iter().enumerate().map(|(r, &c)| score(r, c)).sum::<f64>();
        let waves = |c: usize| mapping.choices()[c].waves;
        let mut best = f64::MIN;
        for a in 0..count {
            for b in 0..count {
                for c in 0..count {
                    if limit.allows(waves(a), waves(b)) && limit.allows(waves(b), waves(c)) {
                        best = best.max(sum(&[a, b, c]));
                    }
                }
            }
        }
        assert_eq!(sum(&found), best);
    }

    #[test]
    fn limits_that_cannot_be_are_refused() {
        for waves in [0.0, -0.1, 0.6, f64::NAN] {
            assert!(StepLimit::new(waves).is_err());
        }
    }
}
