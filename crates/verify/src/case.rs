//! Simulation of a layout: by a cell, or as a fabricated chip.

use metalith_cell::CellModel;
use metalith_core::{Error, Result};
use metalith_optics::SimulationCase;

/// The case that judges, and those that are simulated beside it.
#[derive(Clone)]
pub struct SimulationCases<'a> {
    pub judge: SimulationCase<'a>,
    pub beside: Vec<SimulationCase<'a>>,
    /// True if the central element is also simulated in planes along z.
    pub through_focus: bool,
}

impl<'a> SimulationCases<'a> {
    /// Judged by this case alone.
    pub fn judged_by(judge: impl Into<SimulationCase<'a>>) -> Self {
        Self {
            judge: judge.into(),
            beside: Vec::new(),
            through_focus: false,
        }
    }

    /// Judged by the first of some cells, with the others beside it.
    ///
    /// # Errors
    /// If there is no cell.
    pub fn of_cells(cells: &'a [Box<dyn CellModel>]) -> Result<Self> {
        let (judge, beside) = cells.split_first().ok_or_else(|| {
            Error::refused(
                "verify/no-fidelity",
                "no simulation model is given",
                "give at least one `fidelity`",
            )
        })?;
        Ok(Self::judged_by(judge.as_ref()).with_cells(beside))
    }

    /// These cases with these cells besides.
    #[must_use]
    pub fn with_cells(mut self, cells: &'a [Box<dyn CellModel>]) -> Self {
        self.beside
            .extend(cells.iter().map(|c| SimulationCase::from(c.as_ref())));
        self
    }

    /// Same cases, with a through-focus series of the central element.
    #[must_use]
    pub fn with_through_focus(self) -> Self {
        Self {
            through_focus: true,
            ..self
        }
    }

    /// All cases, the one that judges first.
    pub fn iter(&self) -> impl Iterator<Item = SimulationCase<'a>> {
        std::iter::once(self.judge).chain(self.beside.iter().copied())
    }
}
