//! One chain of an exchange: its sweeps over single rings, and its blocks.

use std::sync::{Mutex, PoisonError};

use crate::merit::field::FieldProblem;
use crate::merit::objective::Objective;
use crate::run::{OptimiseTask, Optimised};
use crate::solvers::blocks::BlockExchange;
use crate::solvers::checkpoint::{BlockState, Chain, Checkpoint, ExactNumbers};
use crate::solvers::exchange::{Exchange, Schedule};
use metalith_core::Progress;

/// Sweeps at temperature zero at most; an exchange ends where nothing is gained, commonly within thirty.
pub(crate) const COLD_SWEEPS: u32 = 200;

/// Course of a chain: the exchange of single rings, and the number of blocks that follow.
#[derive(Clone, Copy)]
pub(crate) struct Course {
    pub chains: u32,
    pub schedule: Schedule,
    pub blocks: u32,
}

impl Course {
    pub(crate) fn new((chains, hot_sweeps, temperature): (u32, u32, (f64, f64)), blocks: u32) -> Self {
        let schedule = Schedule {
            hot_sweeps,
            cold_sweeps: COLD_SWEEPS,
            temperature,
        };
        Self {
            chains,
            schedule,
            blocks,
        }
    }
}

/// Result of one chain.
pub(crate) struct Found {
    pub waves: Vec<f64>,
    widths_nm: Vec<u16>,
    pub merit: f64,
    history: Vec<(u32, f64)>,
    /// Chain to go on from.
    pub chain: Chain,
    pub finished: bool,
}

/// The best merit of all chains, which the user is shown.
pub(crate) struct Best<'p> {
    merit: Mutex<f64>,
    progress: &'p dyn Progress,
}

impl<'p> Best<'p> {
    pub(crate) fn new(progress: &'p dyn Progress) -> Self {
        Self {
            merit: Mutex::new(f64::MIN),
            progress,
        }
    }

    fn show(&self, merit: f64) {
        let mut best = self.merit.lock().unwrap_or_else(PoisonError::into_inner);
        if merit > *best {
            *best = merit;
            self.progress.note(&format!("merit {merit:.4}"));
        }
    }
}

impl Found {
    pub(crate) fn optimised(self, start: &'static str, interrupted: Option<Checkpoint>) -> Optimised {
        Optimised {
            waves: self.waves,
            widths_nm: self.widths_nm,
            merit: self.merit,
            start,
            history: self.history,
            interrupted,
        }
    }
}

impl OptimiseTask {
    /// One chain: its sweeps over single rings, and its blocks.
    pub(crate) fn chain(
        &self,
        problem: &FieldProblem,
        course: Course,
        seed: u64,
        chain: Chain,
        best: &Best<'_>,
    ) -> Found {
        if chain.blocks.is_some() {
            best.progress.advance(u64::from(course.schedule.sweeps()));
            return self.blocks(problem, course.blocks, seed, chain, Vec::new(), best);
        }
        let (progress, schedule) = (best.progress, course.schedule);
        let mut exchange =
            Exchange::new(problem, self.limit, schedule, seed, &chain.waves.values()).resume(chain.sweep);
        let mut history = Vec::new();
        let every = (schedule.hot_sweeps / 50).max(1);
        while !exchange.finished() && !progress.stopped() {
            exchange.sweep_once();
            progress.advance(1);
            if exchange.sweep().is_multiple_of(every) || exchange.finished() {
                let merit = problem.merit_of_widths(&exchange.widths_nm());
                history.push((exchange.sweep(), merit));
                best.show(merit);
            }
        }
        let finished = exchange.finished();
        let chain = Chain {
            sweep: exchange.sweep(),
            waves: ExactNumbers::of(&exchange.waves()),
            blocks: finished.then(BlockState::default),
        };
        if finished && course.blocks > 0 && !progress.stopped() {
            progress.advance(u64::from(schedule.sweeps().saturating_sub(exchange.sweep())));
            return self.blocks(problem, course.blocks, seed, chain, history, best);
        }
        Found {
            waves: exchange.waves(),
            merit: problem.merit_of_widths(&exchange.widths_nm()),
            widths_nm: exchange.widths_nm(),
            history,
            chain,
            finished: finished && course.blocks == 0,
        }
    }

    /// The blocks of one chain.
    pub(crate) fn blocks(
        &self,
        objective: &dyn Objective,
        blocks: u32,
        seed: u64,
        chain: Chain,
        mut history: Vec<(u32, f64)>,
        best: &Best<'_>,
    ) -> Found {
        let state = chain.blocks.unwrap_or_default();
        let waves = chain.waves.values();
        let mut exchange = BlockExchange::new(objective, &self.mapping, self.limit, blocks, seed, &waves)
            .resume(state.block, &state.shares.values());
        best.progress.advance(u64::from(exchange.block()));
        best.show(exchange.merit());
        let every = (blocks / 50).max(1);
        while !exchange.finished() && !best.progress.stopped() {
            exchange.exchange_once();
            best.progress.advance(1);
            best.show(exchange.merit());
            if exchange.block().is_multiple_of(every) || exchange.finished() {
                history.push((chain.sweep.saturating_add(exchange.block()), exchange.merit()));
            }
        }
        best.progress
            .advance(u64::from(blocks.saturating_sub(exchange.block())));
        Found {
            waves: exchange.waves(),
            widths_nm: exchange.widths_nm(),
            merit: exchange.merit(),
            history,
            finished: exchange.finished(),
            chain: Chain {
                sweep: chain.sweep,
                waves: ExactNumbers::of(&exchange.waves()),
                blocks: Some(BlockState {
                    block: exchange.block(),
                    shares: ExactNumbers::of(exchange.shares()),
                }),
            },
        }
    }
}
