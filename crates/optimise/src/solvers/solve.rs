//! The solvers at work: from a start to the end, or to where the user stops.

use rayon::prelude::*;

use crate::image::deconvolution::Deconvolution;
use crate::merit::field::FieldProblem;
use crate::merit::objective::{Objective, Sum};
use crate::problem;
use crate::rings::phase_step_limit::StepLimit;
use crate::run::{OptimiseTask, Optimised};
use crate::solvers::adam::Adam;
use crate::solvers::chain::{Best, COLD_SWEEPS, Course};
use crate::solvers::checkpoint::{AdamState, BlockState, Chain, Checkpoint, ExactNumbers};
use crate::solvers::exchange::{Exchange, Schedule};
use crate::solvers::start::Start;
use metalith_cell::CellModel;
use metalith_core::{Error, Progress, Result};
use metalith_design::{MeritSpec, SolverSpec, StartSpec};

impl OptimiseTask {
    /// Find the phase. `cells` are the cell that is optimised with and, for robust designs, that at other
    /// film heights ([`crate::cells_off_height`]).
    ///
    /// Exchange takes ring after ring where that is cheap, and then blocks of rings; a merit with
    /// `deconvolution` in it is exchanged by blocks alone.
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
                blocks,
            } => {
                let annealing = (chains, hot_sweeps, temperature);
                if self.spec.merit.deconvolution != 0.0 {
                    return self.exchange_images(Course::new(annealing, blocks), cells, checkpoint, progress);
                }
                let problem = self.field_problem(&self.spec.merit, cells)?;
                let problem = problem.ok_or_else(|| {
                    Error::refused(
                        "optimise/no-merit-weight",
                        "the exchange has no merit: all weights are zero",
                        "give `sum`, `log` or `side_lobes` a weight above zero",
                    )
                })?;
                let starts = (0..chains).map(|i| self.start(i)).collect::<Result<Vec<_>>>()?;
                let course = Course::new(annealing, blocks);
                self.exchange(&problem, course, &starts, checkpoint, progress)
            }
            SolverSpec::Adam { steps, rate_waves } => self.adam(steps, rate_waves, cells, checkpoint, progress),
        }
    }

    fn exchange(
        &self,
        problem: &FieldProblem,
        course: Course,
        starts: &[Start],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        let steps = u64::from(course.schedule.sweeps()) + u64::from(course.blocks);
        progress.begin("exchange", starts.len() as u64 * steps);
        let best = Best::new(progress);
        let done = starts
            .par_iter()
            .enumerate()
            .map(|(i, start)| {
                let seed = self.spec.seed.wrapping_add(i as u64);
                let chain = checkpoint.chains.get(i).cloned().unwrap_or_else(|| Chain {
                    sweep: 0,
                    waves: ExactNumbers::of(&start.waves(&self.lens, seed)),
                    blocks: None,
                });
                self.chain(problem, course, seed, chain, &best)
            })
            .collect::<Vec<_>>();
        let unfinished = done.iter().any(|found| !found.finished);
        let interrupted = unfinished.then(|| Checkpoint {
            chains: done.iter().map(|found| found.chain.clone()).collect(),
            ..checkpoint
        });
        let (at, found) = done
            .into_iter()
            .enumerate()
            .max_by(|(i, a), (j, b)| a.merit.total_cmp(&b.merit).then(j.cmp(i)))
            .ok_or_else(|| {
                Error::refused(
                    "optimise/no-chains",
                    "the exchange has no chains",
                    "use `chains = 1` or more",
                )
            })?;
        Ok(found.optimised(starts[at].name(), interrupted))
    }

    /// Blocks alone: one chain over all views.
    fn exchange_images(
        &self,
        course: Course,
        cells: &[&dyn CellModel],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        let kept = checkpoint.chains.first().cloned();
        let (waves, name) = self.start_of_images(course, kept.is_some(), cells, progress)?;
        let chain = kept.unwrap_or_else(|| Chain {
            sweep: 0,
            waves: ExactNumbers::of(&waves),
            blocks: Some(BlockState::default()),
        });
        let parts = Parts::new(self, cells, progress)?;
        progress.begin("exchange of blocks", u64::from(course.blocks));
        let best = Best::new(progress);
        let found = self.blocks(&parts.merit(), course.blocks, self.spec.seed, chain, Vec::new(), &best);
        let interrupted = (!found.finished).then(|| Checkpoint {
            chains: vec![found.chain.clone()],
            ..checkpoint
        });
        Ok(found.optimised(name, interrupted))
    }

    /// Phases (waves) that Adam, or an exchange of blocks alone, begins from, and their name. What exchange
    /// makes of a logarithmic asphere for the merit `log` costs some seconds; it is not made again for a run
    /// that goes on from a checkpoint.
    fn start_of_images(
        &self,
        log: Course,
        goes_on: bool,
        cells: &[&dyn CellModel],
        progress: &dyn Progress,
    ) -> Result<(Vec<f64>, &'static str)> {
        if self.spec.start != StartSpec::Log {
            let start = self.start(0)?;
            return Ok((start.waves(&self.lens, self.spec.seed), start.name()));
        }
        if goes_on {
            return Ok((self.own_waves.clone(), "log"));
        }
        let problem = self
            .field_problem(&MeritSpec::LOG, cells)?
            .expect("the weight of `log` is one");
        let start = Start::LogAsphere {
            band_um: self.spec.band_um,
        };
        let starts = vec![start; log.chains as usize];
        let log = Course { blocks: 0, ..log };
        let found = self.exchange(&problem, log, &starts, Checkpoint::default(), progress)?;
        Ok((found.waves, "log"))
    }

    fn adam(
        &self,
        steps: u32,
        rate_waves: f64,
        cells: &[&dyn CellModel],
        checkpoint: Checkpoint,
        progress: &dyn Progress,
    ) -> Result<Optimised> {
        let log = Course::new(SolverSpec::ANNEALED, 0);
        let (waves, name) = self.start_of_images(log, checkpoint.adam.is_some(), cells, progress)?;
        let parts = Parts::new(self, cells, progress)?;
        let merit = parts.merit();
        let mut adam = Adam::new(waves, self.limit, steps, rate_waves);
        if let Some(state) = &checkpoint.adam {
            adam = state.resume(adam);
        }
        progress.begin("Adam", u64::from(steps));
        progress.advance(u64::from(adam.step()));
        let (mut history, mut smooth) = (Vec::new(), None::<f64>);
        let mut gradient = vec![0.0; self.lens.rings.len()];
        while !adam.finished() && !progress.stopped() {
            gradient.fill(0.0);
            let value = merit.climb(adam.waves(), self.spec.seed, adam.step(), &mut gradient);
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
        let chosen = self.limit.nearest_choices(&self.mapping, adam.waves());
        let widths_nm = self.mapping.widths_of(&chosen);
        let merit = if interrupted.is_some() {
            smooth.unwrap_or(f64::NAN)
        } else {
            merit.merit(&widths_nm)
        };
        Ok(Optimised {
            merit,
            widths_nm,
            waves: self.mapping.turns_of(&chosen),
            start: name,
            history,
            interrupted,
        })
    }

    /// Merit of an exchange that begins from phases, for each of several limits on the step: what the limit
    /// costs.
    ///
    /// # Errors
    /// As [`OptimiseTask::solve`].
    pub fn merit_over_limit(
        &self,
        cells: &[&dyn CellModel],
        waves: &[f64],
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
                let mut exchange = Exchange::new(&problem, limit, schedule, self.spec.seed, waves);
                while !exchange.finished() {
                    progress.check_stopped()?;
                    exchange.sweep_once();
                }
                progress.advance(1);
                Ok((turns_limit, problem.merit_of_widths(&exchange.widths_nm()).exp()))
            })
            .collect()
    }
}

/// The parts of a merit that is not a function of the field at a few points alone.
struct Parts {
    weight: f64,
    images: Option<Deconvolution>,
    field: Option<FieldProblem>,
}

impl Parts {
    fn new(task: &OptimiseTask, cells: &[&dyn CellModel], progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            weight: task.spec.merit.deconvolution,
            images: problem::deconvolution(&task.lens, &task.spec, cells[0], &task.mapping, progress)?,
            field: task.field_problem(&task.spec.merit, cells)?,
        })
    }

    fn merit(&self) -> Sum<'_> {
        let images = self.images.iter().map(|p| (self.weight, p as &dyn Objective));
        let field = self.field.iter().map(|p| (1.0, p as &dyn Objective));
        Sum(images.chain(field).collect())
    }
}
