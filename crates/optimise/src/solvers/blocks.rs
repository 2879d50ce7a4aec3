//! Exchange of many rings at once, for merits that cost too much to try ring by ring.
//!
//! About the present widths the merit is expanded to first order in what every ring transmits
//! ([`Objective::expand`]). It then is a sum over rings, of which the best choices that keep the limit are
//! found exactly by dynamic programming ([`StepLimit::best_choices`]): a run of rings moves together where
//! the limit holds each single one. What the expansion leaves out is how the rings that moved act on one
//! another. It grows with their number, and so only some of all rings may move at a time, drawn at random;
//! the true merit decides whether they stay moved, and how many may move next time.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::merit::objective::Objective;
use crate::rings::mapping::Mapping;
use crate::rings::phase_step_limit::StepLimit;

/// Rings side by side that are free to move in a block; blocks draw one of these. Single rings take the
/// widest jumps, long runs pass a step of phase from ring to ring.
const RUNS: [usize; 4] = [1, 4, 16, 64];
/// Rings that are free in the first block of each kind, as a share of all.
const FIRST_SHARE: f64 = 0.2;
/// Shares at most: runs overlap, so that a share of two leaves exp(-2) of the rings in place.
const LARGEST_SHARE: f64 = 2.0;
/// Bounds of the factor by which a share changes from one block of a kind to the next.
const FACTORS: (f64, f64) = (0.5, 1.5);

/// An exchange of blocks under way: what is needed to go on, and what a checkpoint holds.
pub struct BlockExchange<'p> {
    objective: &'p dyn Objective,
    mapping: &'p Mapping,
    limit: StepLimit,
    seed: u64,
    blocks: u32,
    /// Choice of each ring.
    choices: Vec<usize>,
    block: u32,
    /// Share of the rings that a block of each kind sets free.
    shares: [f64; RUNS.len()],
    merit: f64,
    /// First-order gain of each choice, `[ring][choice]`.
    gains: Vec<f64>,
    /// No choices, all rings free, promise any gain.
    settled: bool,
}

impl<'p> BlockExchange<'p> {
    /// Begin at the choices nearest to `waves` that keep the limit, for `blocks` blocks.
    pub fn new(
        objective: &'p dyn Objective,
        mapping: &'p Mapping,
        limit: StepLimit,
        blocks: u32,
        seed: u64,
        waves: &[f64],
    ) -> Self {
        let choices = limit.nearest_choices(mapping, waves);
        let mut gains = vec![0.0; choices.len() * mapping.choices().len()];
        let merit = objective.expand(&mapping.widths_of(&choices), &mut gains);
        Self {
            objective,
            mapping,
            limit,
            seed,
            blocks,
            choices,
            block: 0,
            shares: [FIRST_SHARE; RUNS.len()],
            merit,
            gains,
            settled: false,
        }
    }

    /// Go on after `block` blocks with these [`BlockExchange::shares`]: the same result as if never
    /// interrupted. Shares of another number of kinds are left aside.
    #[must_use]
    pub fn resume(mut self, block: u32, shares: &[f64]) -> Self {
        self.block = block;
        if let Ok(shares) = shares.try_into() {
            self.shares = shares;
        }
        self
    }

    /// Blocks done.
    pub fn block(&self) -> u32 {
        self.block
    }

    /// Share of the rings that the next block of each kind sets free, for a checkpoint.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// True if all blocks are done or none promises any gain.
    pub fn finished(&self) -> bool {
        self.settled || self.block >= self.blocks
    }

    /// The true merit; it never falls.
    pub fn merit(&self) -> f64 {
        self.merit
    }

    /// Phase of each ring (waves); every step keeps the limit.
    pub fn waves(&self) -> Vec<f64> {
        self.mapping.turns_of(&self.choices)
    }

    /// Width of the pillars of each ring (nm).
    pub fn widths_nm(&self) -> Vec<u16> {
        self.mapping.widths_of(&self.choices)
    }

    /// Move one block of rings to where the merit should be largest, and back if it is not larger. What is
    /// random depends on the seed and the number of the block alone.
    pub fn exchange_once(&mut self) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(u64::from(self.block));
        self.block += 1;
        let kind = random.random_range(0..RUNS.len());
        let free = draw_runs(self.choices.len(), RUNS[kind], self.shares[kind], &mut random);
        let (moved, expected) = self.best(&free);
        if expected <= 0.0 {
            self.shares[kind] = (self.shares[kind] * FACTORS.1).min(LARGEST_SHARE);
            self.settled = self.best(&vec![true; self.choices.len()]).1 <= 0.0;
            return;
        }
        let mut gains = vec![0.0; self.gains.len()];
        let merit = self.objective.expand(&self.mapping.widths_of(&moved), &mut gains);
        let gained = merit - self.merit;
        // Of a share s, what rings do to one another takes away in proportion to s^2: a gain of
        // expected (1 - s / s0), largest at s0 / 2.
        let lost = 1.0 - gained / expected;
        let factor = (0.5 / lost.max(0.1)).clamp(FACTORS.0, FACTORS.1);
        let smallest = 1.0 / self.choices.len() as f64;
        self.shares[kind] = (self.shares[kind] * factor).clamp(smallest, LARGEST_SHARE);
        if gained > 0.0 {
            (self.choices, self.merit, self.gains) = (moved, merit, gains);
        }
    }

    /// The choices of largest first-order merit if only `free` rings move, and what they should gain.
    fn best(&self, free: &[bool]) -> (Vec<usize>, f64) {
        let count = self.mapping.choices().len();
        let moved = self.limit.best_choices(self.mapping, free.len(), |ring, choice| {
            if free[ring] {
                self.gains[ring * count + choice]
            } else if choice == self.choices[ring] {
                0.0
            } else {
                f64::NEG_INFINITY
            }
        });
        let expected = (moved.iter().enumerate())
            .map(|(ring, &choice)| self.gains[ring * count + choice])
            .sum();
        (moved, expected)
    }
}

/// Runs of `length` rings that begin anywhere, also before the first ring, `share` of all rings together.
fn draw_runs(rings: usize, length: usize, share: f64, random: &mut impl RngExt) -> Vec<bool> {
    let chance = (share / length as f64).min(1.0);
    let mut free = vec![false; rings + length - 1];
    for begin in 0..free.len() {
        if random.random_bool(chance) {
            let end = (begin + length).min(free.len());
            free[begin..end].fill(true);
        }
    }
    free.split_off(length - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::deconvolution::tests::small;
    use crate::merit::field::tests::problem;
    use crate::rings::phase_step_limit::largest_step;
    use crate::{Start, Sum};

    fn limit() -> StepLimit {
        StepLimit::new(0.2).unwrap()
    }

    /// Three free rings, two of them neighbours, against all that they could be.
    #[test]
    fn a_block_takes_the_best_of_the_expansion() {
        let (lens, images) = small();
        let start = Start::LogAsphere { band_um: (0.4, 0.7) }.waves(&lens, 0);
        let exchange = BlockExchange::new(&images, &images.mapping, limit(), 1, 3, &start);
        let choices = images.mapping.choices();
        let mut free = vec![false; start.len()];
        for ring in [11, 12, 40] {
            free[ring] = true;
        }
        let (moved, expected) = exchange.best(&free);
        assert!((0..start.len()).all(|ring| free[ring] || moved[ring] == exchange.choices[ring]));
        let gain = |ring: usize, choice: usize| exchange.gains[ring * choices.len() + choice];
        let (at, allows) = (
            |ring: usize| choices[exchange.choices[ring]].waves,
            |a: f64, b: f64| limit().allows(a, b),
        );
        let (mut pair, mut single) = (f64::MIN, f64::MIN);
        for (a, t) in choices.iter().map(|c| c.waves).enumerate() {
            if allows(at(39), t) && allows(t, at(41)) {
                single = single.max(gain(40, a));
            }
            for (b, u) in choices.iter().map(|c| c.waves).enumerate() {
                if allows(at(10), t) && allows(t, u) && allows(u, at(13)) {
                    pair = pair.max(gain(11, a) + gain(12, b));
                }
            }
        }
        assert!(pair > 0.0 && single > 0.0);
        // Of three sums of numbers below one.
        const ROUNDING: f64 = 1e-12;
        assert!(
            (expected - pair - single).abs() < ROUNDING,
            "{expected} {pair} {single}"
        );
    }

    /// A difference of phases (waves) that are below one.
    const ROUNDING_TURNS: f64 = 1e-9;

    #[test]
    fn the_true_merit_never_falls_and_the_limit_holds() {
        let (lens, images) = small();
        let field = problem();
        // Either alone, and both together.
        let both = || Sum(vec![(1.0, &images as &dyn Objective), (0.01, &field)]);
        let start = Start::Hyperbolic { wavelength_um: 0.55 }.waves(&lens, 0);
        for objective in [&images as &dyn Objective, &field, &both()] {
            let mut exchange = BlockExchange::new(objective, &images.mapping, limit(), 40, 3, &start);
            let before = exchange.merit();
            assert_eq!(before, objective.merit(&exchange.widths_nm()));
            while !exchange.finished() {
                let last = exchange.merit();
                exchange.exchange_once();
                assert!(exchange.merit() >= last);
                assert_eq!(exchange.merit(), objective.merit(&exchange.widths_nm()));
                assert!(largest_step(&exchange.waves()) <= limit().waves() + ROUNDING_TURNS);
            }
            assert!(exchange.merit() > before);
        }
    }

    #[test]
    fn resumed_is_as_if_never_interrupted() {
        let (lens, images) = small();
        let start = Start::Hyperbolic { wavelength_um: 0.55 }.waves(&lens, 0);
        let begin = |waves: &[f64]| BlockExchange::new(&images, &images.mapping, limit(), 30, 7, waves);
        let mut whole = begin(&start);
        (0..9).for_each(|_| whole.exchange_once());
        let mut rest = begin(&whole.waves()).resume(whole.block(), whole.shares());
        for _ in 0..9 {
            whole.exchange_once();
            rest.exchange_once();
        }
        assert_eq!(whole.widths_nm(), rest.widths_nm());
        assert_eq!((whole.merit(), whole.shares()), (rest.merit(), rest.shares()));
    }

    /// All rings are as likely to move, those at the centre and at the edge too.
    #[test]
    fn runs_cover_all_rings_alike() {
        /// Four standard errors of two thousand draws.
        const TOLERANCE: f64 = 0.05;
        let (rings, share) = (40, 0.5f64);
        for length in RUNS {
            let mut counts = vec![0; rings];
            for seed in 0..2000 {
                let free = draw_runs(rings, length, share, &mut ChaCha8Rng::seed_from_u64(seed));
                counts
                    .iter_mut()
                    .zip(free)
                    .for_each(|(count, free)| *count += u32::from(free));
            }
            let expected = 1.0 - (1.0 - share / length as f64).powi(length as i32);
            for count in counts {
                let found = f64::from(count) / 2000.0;
                assert!((found - expected).abs() < TOLERANCE, "{length}: {found} {expected}");
            }
        }
    }
}
