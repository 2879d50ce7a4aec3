//! Exchange: one ring after the other takes the best of all its candidates, given all others.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::merit::field::{FLOOR, FieldProblem};
use crate::rings::phase_step_limit::StepLimit;
use crate::rings::split_complex::Planes;
use crate::solvers::score::Fields;

/// Schedule of an exchange: how long it lasts, and how hot it begins.
///
/// While hot, a ring takes a candidate at random, with a probability that grows with its merit
/// (exp(merit / temperature), Gibbs sampling), and so leaves optima that a greedy exchange is caught in.
/// The temperature falls by a constant factor a sweep; at the end it is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Sweeps over all rings with a temperature above zero.
    pub hot_sweeps: u32,
    /// Sweeps at zero at most; they end when nothing changes.
    pub cold_sweeps: u32,
    /// First and last temperature, in units of the merit.
    pub temperature: (f64, f64),
}

impl Schedule {
    /// Temperature of a sweep.
    pub fn temperature_of(&self, sweep: u32) -> f64 {
        if sweep >= self.hot_sweeps {
            return 0.0;
        }
        let (first, last) = self.temperature;
        first * (last / first).powf(f64::from(sweep) / f64::from(self.hot_sweeps.max(2) - 1))
    }

    /// Number of sweeps at most.
    pub fn sweeps(&self) -> u32 {
        self.hot_sweeps + self.cold_sweeps
    }
}

/// An exchange under way: what is needed to go on, and what a checkpoint holds.
pub struct Exchange<'p> {
    problem: &'p FieldProblem,
    limit: StepLimit,
    neighbours: Vec<Vec<u16>>,
    seed: u64,
    schedule: Schedule,
    /// Choice of each ring.
    choices: Vec<usize>,
    sweep: u32,
    finished: bool,
}

impl<'p> Exchange<'p> {
    /// Begin at the choices nearest to `waves` that keep the limit.
    pub fn new(problem: &'p FieldProblem, limit: StepLimit, schedule: Schedule, seed: u64, waves: &[f64]) -> Self {
        let choices = limit.nearest_choices(problem.mapping(), waves);
        Self {
            problem,
            limit,
            neighbours: limit.neighbours(problem.mapping()),
            seed,
            schedule,
            choices,
            sweep: 0,
            finished: false,
        }
    }

    /// Go on after `sweep` sweeps: the same result as if never interrupted.
    #[must_use]
    pub fn resume(mut self, sweep: u32) -> Self {
        self.sweep = sweep;
        self
    }

    /// Sweeps done.
    pub fn sweep(&self) -> u32 {
        self.sweep
    }

    /// True if the schedule is done or no exchange gains any more.
    pub fn finished(&self) -> bool {
        self.finished || self.sweep >= self.schedule.sweeps()
    }

    /// Phase of each ring (waves).
    pub fn waves(&self) -> Vec<f64> {
        self.problem.mapping().turns_of(&self.choices)
    }

    /// Width of the pillars of each ring (nm).
    pub fn widths_nm(&self) -> Vec<u16> {
        self.problem.mapping().widths_of(&self.choices)
    }

    /// Visit every ring once, in random order. The generator depends on the seed and the sweep alone.
    pub fn sweep_once(&mut self) {
        let temperature = self.schedule.temperature_of(self.sweep);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(u64::from(self.sweep));
        let mut order = (0..self.problem.rings()).collect::<Vec<_>>();
        order.shuffle(&mut random);

        let mut widths = self.widths_nm();
        let exact = self.problem.fields_of_widths(&widths);
        let mut fields = Planes::zeros(self.problem.rows());
        for (i, e) in exact.iter().enumerate() {
            fields.set(i, *e);
        }
        let mut one_over_now = vec![0.0f32; self.problem.rows()];
        let mut own = Planes::zeros(self.problem.rows());
        let (mut candidates, mut widths_nm, mut scores) = (Vec::new(), Vec::new(), Vec::new());
        let mut changed = false;
        for ring in order {
            self.candidates(ring, &mut candidates);
            if candidates.len() < 2 {
                continue;
            }
            widths_nm.clear();
            widths_nm.extend(candidates.iter().map(|&c| self.width_of(c)));
            scores.resize(candidates.len(), 0.0);
            for (i, now) in one_over_now.iter_mut().enumerate() {
                *now = 1.0 / (fields.re[i] * fields.re[i] + fields.im[i] * fields.im[i] + FLOOR as f32);
            }
            let context = self.problem.context(ring, &widths);
            let context = context.as_ref();
            let old = self.choices[ring];
            self.problem.contribution(ring, widths[ring], context, &mut own);
            add(&own, -1.0, &mut fields);
            let without = Fields {
                without: &fields,
                one_over_now: &one_over_now,
            };
            self.problem.score(ring, context, without, &widths_nm, &mut scores);
            let new = candidates[pick(&scores, temperature, &mut random)];
            widths[ring] = self.width_of(new);
            self.problem.contribution(ring, widths[ring], context, &mut own);
            add(&own, 1.0, &mut fields);
            changed |= new != old;
            self.choices[ring] = new;
        }
        self.sweep += 1;
        self.finished = temperature == 0.0 && !changed;
    }

    /// Choices that keep the limit on both sides of a ring.
    fn candidates(&self, ring: usize, out: &mut Vec<usize>) {
        out.clear();
        let waves = |c: usize| self.problem.mapping().choices()[c].waves;
        let inner = ring.checked_sub(1).map(|r| self.choices[r]);
        let outer = self.choices.get(ring + 1).copied();
        let (from, other) = match (inner, outer) {
            (Some(inner), outer) => (inner, outer),
            (None, Some(outer)) => (outer, None),
            (None, None) => (self.choices[ring], None),
        };
        out.extend(
            self.neighbours[from]
                .iter()
                .map(|&c| usize::from(c))
                .filter(|&c| other.is_none_or(|o| self.limit.allows(waves(c), waves(o)))),
        );
    }

    fn width_of(&self, choice: usize) -> u16 {
        self.problem.mapping().choices()[choice].width_nm
    }
}

fn add(part: &Planes, sign: f32, fields: &mut Planes) {
    for (to, from) in [(&mut fields.re, &part.re), (&mut fields.im, &part.im)] {
        to.iter_mut().zip(from).for_each(|(to, from)| *to += sign * from);
    }
}

/// The best at zero temperature, the first of equals; else one at random by exp(score / temperature).
fn pick(scores: &[f64], temperature: f64, random: &mut impl RngExt) -> usize {
    let best = (0..scores.len())
        .max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a)))
        .unwrap_or(0);
    if temperature <= 0.0 {
        return best;
    }
    let weight = |s: f64| ((s - scores[best]) / temperature).exp();
    let total = scores.iter().map(|&s| weight(s)).sum::<f64>();
    let mut left = random.random::<f64>() * total;
    for (i, &s) in scores.iter().enumerate() {
        left -= weight(s);
        if left <= 0.0 {
            return i;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::merit::focus::{FabricationError, Lens};
    use crate::rings::mapping::tests::published;
    use crate::rings::phase_step_limit::largest_step;
    use crate::rings::sites::Rings;
    use crate::{MeritKind, Start, wavelengths};
    use metalith_cell::{CellModel, PublishedCell};
    use metalith_pillars::Lattice;

    const SCHEDULE: Schedule = Schedule {
        hot_sweeps: 4,
        cold_sweeps: 30,
        temperature: (1e-2, 1e-3),
    };

    /// A difference of phases (waves) that are below one.
    const ROUNDING_TURNS: f64 = 1e-9;

    /// Scores sum thousands of numbers in single precision, so a gain may be a loss of this size; the losses
    /// of a whole sweep may add up to ten of them.
    const SCORE: f64 = 1e-5;

    fn with_problem(test: impl FnOnce(&Lens, &FieldProblem)) {
        let rings = Rings::new(Lattice::covering(40_000, 350).unwrap(), 40_000).unwrap();
        let (lens, cell) = (
            Lens {
                rings,
                distance_um: 96.0,
            },
            PublishedCell::new(350),
        );
        let cells: [&dyn CellModel; 1] = [&cell];
        let rows = lens
            .focal_rows(&wavelengths(400.0, 700.0, 10.0), FabricationError::default(), &cells)
            .unwrap();
        let problem = FieldProblem::new(vec![(MeritKind::Log, 1.0, rows)], &cells, published(), 1 << 24).unwrap();
        test(&lens, &problem);
    }

    #[test]
    fn every_sweep_keeps_the_limit_and_cold_ones_gain() {
        with_problem(|lens, problem| {
            let limit = StepLimit::new(0.2).unwrap();
            let start = Start::Random.waves(lens, 3);
            let mut exchange = Exchange::new(problem, limit, SCHEDULE, 5, &start);
            let mut last = f64::MIN;
            while !exchange.finished() {
                let cold = SCHEDULE.temperature_of(exchange.sweep()) == 0.0;
                exchange.sweep_once();
                assert!(largest_step(&exchange.waves()) <= limit.waves() + ROUNDING_TURNS);
                let merit = problem.merit_of_widths(&exchange.widths_nm());
                assert!(!cold || merit > last - 10.0 * SCORE, "{merit} after {last}");
                last = merit;
            }
            let before = problem.merit_of_phases(&Start::Hyperbolic { wavelength_um: 0.55 }.waves(lens, 0), None);
            assert!(last > before, "{last} from {before}");
        });
    }

    /// Test by brute force that at the end of a cold exchange no single ring has a better candidate.
    #[test]
    fn it_ends_where_no_ring_gains() {
        with_problem(|lens, problem| {
            let limit = StepLimit::new(0.25).unwrap();
            let start = Start::LogAsphere { band_um: (0.4, 0.7) }.waves(lens, 0);
            let mut exchange = Exchange::new(problem, limit, SCHEDULE, 5, &start);
            while !exchange.finished() {
                exchange.sweep_once();
            }
            let (mut widths, waves) = (exchange.widths_nm(), exchange.waves());
            let best = problem.merit_of_widths(&widths);
            for ring in [0, 1, 20, problem.rings() - 1] {
                let kept = widths[ring];
                for choice in problem.mapping().choices() {
                    let inner = ring.checked_sub(1).is_none_or(|i| limit.allows(waves[i], choice.waves));
                    let outer = waves.get(ring + 1).is_none_or(|&t| limit.allows(t, choice.waves));
                    if inner && outer {
                        widths[ring] = choice.width_nm;
                        assert!(problem.merit_of_widths(&widths) <= best + SCORE);
                    }
                }
                widths[ring] = kept;
            }
        });
    }

    #[test]
    fn resumed_is_as_if_never_interrupted() {
        with_problem(|lens, problem| {
            let limit = StepLimit::new(0.2).unwrap();
            let start = Start::Hyperbolic { wavelength_um: 0.5 }.waves(lens, 0);
            let mut whole = Exchange::new(problem, limit, SCHEDULE, 9, &start);
            for _ in 0..3 {
                whole.sweep_once();
            }
            let mut parts = Exchange::new(problem, limit, SCHEDULE, 9, &whole.waves()).resume(3);
            for _ in 0..4 {
                whole.sweep_once();
                parts.sweep_once();
            }
            assert_eq!(whole.widths_nm(), parts.widths_nm());
            assert_eq!(whole.sweep(), parts.sweep());
        });
    }
}
