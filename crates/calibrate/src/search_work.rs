//! Bound of a search, in simulations: the same set gives the same answer on every machine.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use metalith_optics::{CellChange, Perturbation};

/// Most simulations of a search. A set whose residual is explained takes a fraction of it.
pub const MOST_SIMULATIONS: u64 = 800;

/// Simulations that one with changed pillars counts as, whose cells are solved as well.
const WITH_CELLS: u64 = 3;

/// Simulations of the searches of one set, shared by all its sessions.
#[derive(Clone, Debug, Default)]
pub struct SearchWork(Arc<AtomicU64>);

impl SearchWork {
    /// Begin a search: what was simulated before it does not count.
    pub(crate) fn restart(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// Count the simulations of some perturbations.
    pub(crate) fn count(&self, perturbations: &[Perturbation]) {
        let cost = |p: &Perturbation| if p.cell == CellChange::default() { 1 } else { WITH_CELLS };
        self.0
            .fetch_add(perturbations.iter().map(cost).sum(), Ordering::Relaxed);
    }

    /// Number of simulations since the search began; those with changed pillars count three times.
    pub fn simulations(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// True if no further effect is tried.
    pub fn is_spent(&self) -> bool {
        self.simulations() >= MOST_SIMULATIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulations_with_changed_pillars_count_three_times_until_the_bound() {
        let work = SearchWork::default();
        let mut changed = Perturbation::default();
        changed.cell.height_nm = 5.0;
        work.count(&[Perturbation::default(), changed]);
        assert_eq!(work.simulations(), 1 + WITH_CELLS);
        let shared = work.clone();
        shared.count(&vec![Perturbation::default(); MOST_SIMULATIONS as usize]);
        assert!(work.is_spent());
        work.restart();
        assert!(!shared.is_spent());
    }
}
