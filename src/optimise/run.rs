//! From a design to its optimised phase.

use std::sync::Mutex;

use rayon::prelude::*;

use super::adam::Adam;
use super::checkpoint::{AdamState, Chain, Checkpoint, Numbers};
use super::exchange::{Exchange, Schedule};
use super::field::FieldProblem;
use super::focus::Lens;
use super::limit::StepLimit;
use super::mapping::Mapping;
use super::objective::{Objective, Sum};
use super::problem;
use super::rings::Rings;
use super::start::Start;
use crate::array::WidthRule;
use crate::cell::CellModel;
use crate::design::{Design, MeritSpec, OptimiseSpec, SolverSpec, StartSpec};
use crate::error::{Error, Result};
use crate::phase::RadialPhase;
use crate::progress::Progress;

/// Sweeps at temperature zero at most; an exchange ends where nothing is gained, commonly within thirty.
const COLD_SWEEPS: u32 = 200;

/// What an optimisation found.
#[derive(Clone, Debug)]
pub struct Optimised {
    /// Phase of each ring [turns], in [0, 1).
    pub turns: Vec<f64>,
    /// Width of the pillars of each ring [nm].
    pub widths_nm: Vec<u16>,
    /// The merit, as it was optimised.
    pub merit: f64,
    /// Name of the phases it began from.
    pub start: &'static str,
    /// Merit at every fiftieth part of the way.
    pub history: Vec<(u32, f64)>,
    /// Where to go on if it was interrupted.
    pub interrupted: Option<Checkpoint>,
}

/// The lens and the mapping of a design, ring by ring.
#[derive(Clone, Debug)]
pub struct Task {
    /// The rings and the distance to the sensor.
    pub lens: Lens,
    /// From phase to width.
    pub mapping: Mapping,
    /// How it is to be optimised.
    pub spec: OptimiseSpec,
    /// The design's own phase [turns].
    pub own_turns: Vec<f64>,
    /// What gains are counted from: the design's own phase, or where that is a table, which may well be an
    /// optimised one, a hyperbolic lens for the middle of the band.
    pub reference_turns: Vec<f64>,
    limit: StepLimit,
}

impl Task {
    /// The task that a design sets.
    ///
    /// # Errors
    /// If its lens has no rings.
    pub fn of(design: &Design) -> Result<Self> {
        let rings = Rings::new(design.lattice(), design.lens.diameter_nm)?;
        let own_turns = turns_of(&rings, &design.lens.phase);
        let lens = Lens {
            rings,
            gap_um: design.lens.focal_length_um,
        };
        let band_um = design.optimise.band_um;
        let hyperbolic = Start::Hyperbolic {
            wavelength_um: 0.5 * (band_um.0 + band_um.1),
        };
        let reference_turns = match design.lens.phase {
            RadialPhase::Table { .. } => hyperbolic.turns(&lens, 0),
            _ => own_turns.clone(),
        };
        Ok(Self {
            lens,
            reference_turns,
            mapping: Mapping::new(&WidthRule::new(&design.cell, &design.mapping)),
            spec: design.optimise.clone(),
            own_turns,
            limit: StepLimit::new(design.optimise.step_limit_turns)?,
        })
    }

    /// The limit on the step from ring to ring.
    pub fn limit(&self) -> StepLimit {
        self.limit
    }

    /// The same task without errors of fabrication in mind.
    pub fn regardless_of_errors(&self) -> Self {
        let mut plain = self.clone();
        plain.spec.robust = None;
        plain
    }

    /// Widths that are made of phases, without any limit on their steps [nm].
    pub fn widths_nm(&self, turns: &[f64]) -> Vec<u16> {
        let choices = self.mapping.choices();
        turns
            .iter()
            .map(|&t| choices[self.mapping.nearest(t)].width_nm)
            .collect()
    }

    /// Find the phase. `cells` are the cell that is optimised with and, for robust designs, that at other
    /// film heights ([`super::cells_off_height`]).
    ///
    /// Stopped by the user, it returns the best so far and where to go on.
    ///
    /// # Errors
    /// If a kernel does not fit, or a cell does not cover the band.
    pub fn solve(
        &self,
        cells: &[&dyn CellModel],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        match self.spec.solver {
            SolverSpec::Exchange {
                chains,
                hot_sweeps,
                temperature,
            } => {
                let problem = self.field_problem(&self.spec.merit, cells)?;
                let problem = problem.ok_or_else(|| {
                    Error::invalid("exchange has no merit to gain", "give sum, log or side_lobes a weight")
                })?;
                let schedule = Schedule {
                    hot_sweeps,
                    cold_sweeps: COLD_SWEEPS,
                    temperature,
                };
                let starts = (0..chains).map(|i| self.start(i)).collect::<Result<Vec<_>>>()?;
                self.exchange(&problem, schedule, &starts, checkpoint, progress)
            }
            SolverSpec::Adam { steps, rate_turns } => self.adam(steps, rate_turns, cells, checkpoint, progress),
        }
    }

    fn field_problem(&self, merit: &MeritSpec, cells: &[&dyn CellModel]) -> Result<Option<FieldProblem>> {
        problem::field_problem(&self.lens, &self.spec, merit, cells, &self.mapping)
    }

    /// The start of one chain of several.
    fn start(&self, chain: u32) -> Result<Start> {
        let band_um = self.spec.band_um;
        let log_asphere = Start::LogAsphere { band_um };
        let hyperbolic = Start::Hyperbolic {
            wavelength_um: 0.5 * (band_um.0 + band_um.1),
        };
        Ok(match self.spec.start {
            StartSpec::All => match chain % 4 {
                0 => log_asphere,
                1 => Start::Previous(self.own_turns.clone()),
                2 => Start::Random,
                _ => hyperbolic,
            },
            StartSpec::LogAsphere => log_asphere,
            StartSpec::Hyperbolic => hyperbolic,
            StartSpec::Random => Start::Random,
            StartSpec::Previous => Start::Previous(self.own_turns.clone()),
            StartSpec::Log => {
                return Err(Error::invalid(
                    "an exchange cannot begin with its own result",
                    "use start = \"all\" or \"log_asphere\"; \"log\" is for solver = \"adam\"",
                ));
            }
        })
    }

    fn exchange(
        &self,
        problem: &FieldProblem,
        schedule: Schedule,
        starts: &[Start],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        progress.begin("exchange", starts.len() as u64 * u64::from(schedule.sweeps()));
        let best = Mutex::new(f64::MIN);
        let done = starts
            .par_iter()
            .enumerate()
            .map(|(i, start)| {
                let seed = self.spec.seed.wrapping_add(i as u64);
                let begin = |turns: &[f64]| Exchange::new(problem, self.limit, schedule, seed, turns);
                let mut exchange = match checkpoint.chains.get(i) {
                    Some(chain) => begin(&chain.turns.values()).resume(chain.sweep),
                    None => begin(&start.turns(&self.lens, seed)),
                };
                let mut history = Vec::new();
                let every = (schedule.hot_sweeps / 50).max(1);
                while !exchange.finished() && !progress.stopped() {
                    exchange.sweep_once();
                    progress.advance(1);
                    if exchange.sweep().is_multiple_of(every) || exchange.finished() {
                        let merit = problem.merit_of_widths(&exchange.widths_nm());
                        history.push((exchange.sweep(), merit));
                        let mut best = best.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                        if merit > *best {
                            *best = merit;
                            progress.note(&format!("merit {merit:.4}"));
                        }
                    }
                }
                progress.advance(u64::from(schedule.sweeps() - exchange.sweep()));
                (problem.merit_of_widths(&exchange.widths_nm()), exchange, history)
            })
            .collect::<Vec<_>>();
        let unfinished = done.iter().any(|(_, exchange, _)| !exchange.finished());
        let interrupted = unfinished.then(|| Checkpoint {
            chains: done
                .iter()
                .map(|(_, exchange, _)| Chain {
                    sweep: exchange.sweep(),
                    turns: Numbers::of(&exchange.turns()),
                })
                .collect(),
            ..checkpoint
        });
        let (at, (merit, exchange, history)) = done
            .into_iter()
            .enumerate()
            .max_by(|(i, a), (j, b)| a.0.total_cmp(&b.0).then(j.cmp(i)))
            .ok_or_else(|| Error::invalid("an exchange without chains", "use chains = 1 or more"))?;
        Ok(Optimised {
            turns: exchange.turns(),
            widths_nm: exchange.widths_nm(),
            merit,
            start: starts[at].name(),
            history,
            interrupted,
        })
    }

    /// What exchange makes of a logarithmic asphere for the merit `log`: where Adam begins.
    fn log_design(&self, cells: &[&dyn CellModel], progress: &dyn Progress) -> Result<Vec<f64>> {
        let problem = self
            .field_problem(&MeritSpec::LOG, cells)?
            .expect("the weight of `log` is one");
        let (chains, hot_sweeps, temperature) = SolverSpec::ANNEALED;
        let schedule = Schedule {
            hot_sweeps,
            cold_sweeps: COLD_SWEEPS,
            temperature,
        };
        let start = Start::LogAsphere {
            band_um: self.spec.band_um,
        };
        let starts = vec![start; chains as usize];
        Ok(self
            .exchange(&problem, schedule, &starts, Checkpoint::default(), progress)?
            .turns)
    }

    fn adam(
        &self,
        steps: u32,
        rate_turns: f64,
        cells: &[&dyn CellModel],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        let (turns, name) = match self.spec.start {
            StartSpec::Log => (self.log_design(cells, progress)?, "log"),
            _ => {
                let start = self.start(0)?;
                (start.turns(&self.lens, self.spec.seed), start.name())
            }
        };
        let images = problem::deconvolution(&self.lens, &self.spec, cells[0], &self.mapping, progress)?;
        let field = self.field_problem(&self.spec.merit, cells)?;
        let mut parts: Vec<(f64, &dyn Objective)> = Vec::new();
        if let Some(images) = &images {
            parts.push((self.spec.merit.deconvolution, images));
        }
        if let Some(field) = &field {
            parts.push((1.0, field));
        }
        let merit = Sum(parts);
        let mut adam = Adam::new(turns, self.limit, steps, rate_turns);
        if let Some(state) = &checkpoint.adam {
            adam = state.resume(adam);
        }
        progress.begin("Adam", u64::from(steps));
        progress.advance(u64::from(adam.step()));
        let (mut history, mut smooth) = (Vec::new(), None::<f64>);
        let mut gradient = vec![0.0; self.lens.rings.len()];
        while !adam.finished() && !progress.stopped() {
            gradient.fill(0.0);
            let value = merit.climb(adam.turns(), self.spec.seed, adam.step(), &mut gradient);
            adam.climb(&gradient);
            // Merits of steps that draw afresh scatter; their running mean is shown.
            let mean = smooth.map_or(value, |s| 0.9 * s + 0.1 * value);
            smooth = Some(mean);
            if adam.step().is_multiple_of((steps / 50).max(1)) {
                history.push((adam.step(), mean));
                progress.note(&format!("merit {mean:.4}"));
            }
            progress.advance(1);
        }
        let interrupted = (!adam.finished()).then(|| Checkpoint {
            adam: Some(AdamState::of(&adam)),
            ..checkpoint
        });
        let chosen = self.limit.nearest_choices(&self.mapping, adam.turns());
        let choices = chosen.iter().map(|&c| self.mapping.choices()[c]).collect::<Vec<_>>();
        let turns = choices.iter().map(|c| c.turns).collect::<Vec<_>>();
        let merit = if interrupted.is_some() {
            smooth.unwrap_or(f64::NAN)
        } else {
            merit.merit(&turns)
        };
        Ok(Optimised {
            merit,
            widths_nm: choices.iter().map(|c| c.width_nm).collect(),
            turns,
            start: name,
            history,
            interrupted,
        })
    }

    /// Merit of an exchange that begins from phases, for each of several limits on the step: what the limit
    /// costs.
    ///
    /// # Errors
    /// As [`Task::solve`].
    pub fn merit_over_limit(
        &self,
        cells: &[&dyn CellModel],
        turns: &[f64],
        limits: &[f64],
        progress: &dyn Progress,
    ) -> Result<Vec<(f64, f64)>> {
        let Some(problem) = self.field_problem(&MeritSpec::LOG, cells)? else {
            return Ok(Vec::new());
        };
        let schedule = Schedule {
            hot_sweeps: 0,
            cold_sweeps: COLD_SWEEPS,
            temperature: (1.0, 1.0),
        };
        progress.begin("merit against limit", limits.len() as u64);
        limits
            .par_iter()
            .map(|&turns_limit| {
                let limit = StepLimit::new(turns_limit)?;
                let mut exchange = Exchange::new(&problem, limit, schedule, self.spec.seed, turns);
                while !exchange.finished() {
                    if progress.stopped() {
                        return Err(Error::Interrupted);
                    }
                    exchange.sweep_once();
                }
                progress.advance(1);
                Ok((turns_limit, problem.merit_of_widths(&exchange.widths_nm()).exp()))
            })
            .collect()
    }
}

/// Phase in the middle of each ring [turns].
pub fn turns_of(rings: &Rings, phase: &RadialPhase) -> Vec<f64> {
    (0..rings.len())
        .map(|ring| phase.turns(rings.middle_um(ring).powi(2)))
        .collect()
}
