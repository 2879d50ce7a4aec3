//! Modes that were found last, for stacks that differ in the heights of their layers alone.

use std::collections::VecDeque;
use std::sync::Arc;

use num_complex::Complex64;

use super::basis::{Family, RetainedOrders};
use super::layer::Modes;
use super::outline::Outline;
use super::{CellLattice, Result};

/// All that modes of a layer follow from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub family: Family,
    pub kept: RetainedOrders,
    /// Transverse wave vector of the incident wave over k0.
    pub k: [f64; 2],
    pub steps: [f64; 2],
    pub pitch_nm: f64,
    pub lattice: CellLattice,
    pub outline: Outline,
    pub inside: Complex64,
    pub outside: Complex64,
}

/// Modes of the last so many layers.
#[derive(Default)]
pub(super) struct KnownModes {
    room: usize,
    last: VecDeque<(Section, Arc<Modes>)>,
}

impl KnownModes {
    /// Room for layers of a stack in the symmetries of both polarisations. Of a stack that is solved individually,
    /// nothing is kept: see [`KnownModes::default`].
    pub(crate) fn of_layers(layers: usize) -> Self {
        Self {
            room: 2 * layers,
            last: VecDeque::new(),
        }
    }

    /// Modes that were found, or else those that `find` finds.
    ///
    /// # Errors
    /// Those of `find`.
    pub(crate) fn of(&mut self, section: Section, find: impl FnOnce() -> Result<Modes>) -> Result<Arc<Modes>> {
        if let Some((_, known)) = self.last.iter().find(|(known, _)| *known == section) {
            return Ok(Arc::clone(known));
        }
        let found = Arc::new(find()?);
        if self.room > 0 {
            self.last.truncate(self.room - 1);
            self.last.push_front((section, Arc::clone(&found)));
        }
        Ok(found)
    }
}
