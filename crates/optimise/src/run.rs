//! Run from a design to its optimised phase.

use crate::cells::check_shape;
use crate::merit::field::FieldProblem;
use crate::merit::focus::Lens;
use crate::problem;
use crate::rings::mapping::Mapping;
use crate::rings::phase_step_limit::StepLimit;
use crate::rings::sites::Rings;
use crate::solvers::checkpoint::Checkpoint;
use crate::solvers::start::Start;
use metalith_cell::CellModel;
use metalith_core::{Error, Result};
use metalith_design::array::PillarRule;
use metalith_design::phase::RadialPhase;
use metalith_design::{Design, MeritSpec, OptimiseSpec, StartSpec};

/// Result of an optimisation.
#[derive(Clone, Debug)]
pub struct Optimised {
    /// Phase of each ring (waves), in [0, 1).
    pub waves: Vec<f64>,
    /// Width of the pillars of each ring (nm).
    pub widths_nm: Vec<u16>,
    /// The merit, as it was optimised.
    pub merit: f64,
    /// Name of the phases it began from.
    pub start: &'static str,
    /// Merit at every fiftieth part of the way.
    pub history: Vec<(u32, f64)>,
    /// Checkpoint to go on from if it was interrupted.
    pub interrupted: Option<Checkpoint>,
}

/// The lens and the mapping of a design, ring by ring.
#[derive(Clone, Debug)]
pub struct OptimiseTask {
    /// The rings and the distance to the sensor.
    pub lens: Lens,
    /// Mapping from phase to width.
    pub mapping: Mapping,
    /// Settings of the optimisation.
    pub spec: OptimiseSpec,
    /// The design's own phase (waves).
    pub own_waves: Vec<f64>,
    /// Reference phase (waves) of gains: the design's own phase, or where that is a table, which may well be an
    /// optimised one, a hyperbolic lens for the middle of the band.
    pub reference_waves: Vec<f64>,
    pub(crate) limit: StepLimit,
}

impl OptimiseTask {
    /// The task that a design sets.
    ///
    /// # Errors
    /// If its lens has no rings or a phase over the plane, or elements have their own lenses.
    pub fn of(design: &Design) -> Result<Self> {
        check_shape(design)?;
        design.one_lens("the optimiser")?;
        design.radial_phase("the optimiser")?;
        let rings = Rings::new(design.lattice(), design.lens.diameter_nm)?;
        let own_waves = turns_of(&rings, &design.lens.phase);
        let lens = Lens {
            rings,
            distance_um: design.lens.focal_length_um,
        };
        let band_um = design.optimise.band_um;
        let hyperbolic = Start::Hyperbolic {
            wavelength_um: 0.5 * (band_um.0 + band_um.1),
        };
        let reference_waves = match design.lens.phase {
            RadialPhase::Table { .. } => hyperbolic.waves(&lens, 0),
            _ => own_waves.clone(),
        };
        Ok(Self {
            lens,
            reference_waves,
            mapping: Mapping::new(&PillarRule::new(&design.cell, &design.mapping)),
            spec: design.optimise.clone(),
            own_waves,
            limit: StepLimit::new(design.optimise.step_limit_waves)?,
        })
    }

    /// The limit on the step from ring to ring.
    pub fn limit(&self) -> StepLimit {
        self.limit
    }

    /// This task without errors of fabrication.
    #[must_use]
    pub fn regardless_of_errors(&self) -> Self {
        let mut plain = self.clone();
        plain.spec.robust = None;
        plain
    }

    /// Widths that are made of phases, without any limit on their steps (nm).
    pub fn widths_nm(&self, waves: &[f64]) -> Vec<u16> {
        let choices = self.mapping.choices();
        waves
            .iter()
            .map(|&t| choices[self.mapping.nearest(t)].width_nm)
            .collect()
    }

    pub(crate) fn field_problem(&self, merit: &MeritSpec, cells: &[&dyn CellModel]) -> Result<Option<FieldProblem>> {
        problem::field_problem(&self.lens, &self.spec, merit, cells, &self.mapping)
    }

    /// The start of one chain of several.
    pub(crate) fn start(&self, chain: u32) -> Result<Start> {
        let band_um = self.spec.band_um;
        let log_asphere = Start::LogAsphere { band_um };
        let hyperbolic = Start::Hyperbolic {
            wavelength_um: 0.5 * (band_um.0 + band_um.1),
        };
        Ok(match self.spec.start {
            StartSpec::All => match chain % 4 {
                0 => log_asphere,
                1 => Start::Previous(self.own_waves.clone()),
                2 => Start::Random,
                _ => hyperbolic,
            },
            StartSpec::LogAsphere => log_asphere,
            StartSpec::Hyperbolic => hyperbolic,
            StartSpec::Random => Start::Random,
            StartSpec::Previous => Start::Previous(self.own_waves.clone()),
            StartSpec::Log => {
                return Err(Error::refused(
                    "optimise/start-needs-own-result",
                    "the merit `log` cannot begin with its own result",
                    "use start = \"all\" or \"log_asphere\"; \"log\" is for Adam, and for the merit `deconvolution`",
                ));
            }
        })
    }
}

/// Phase in the middle of each ring (waves).
pub(crate) fn turns_of(rings: &Rings, phase: &RadialPhase) -> Vec<f64> {
    (0..rings.len())
        .map(|ring| phase.turns(rings.middle_um(ring).powi(2)))
        .collect()
}
