//! One set from its measurements to its diagnosis, in stages. Each is a function of the former's result:
//! simulate, screen the measurements, compare the fidelities of the cell, attribute the residual, diagnose.

use std::path::PathBuf;

use metalith_attribution::{RandomNoise, check_names};
use metalith_core::{Progress, Result};

use crate::bench::{Bench, BenchSampling};
use crate::cells::{CellSource, RigorousCells};
use crate::data::Data;
use crate::diagnosis::Diagnosis;
use crate::effects::{self, DeclaredEffect, Effect, Stage};
use crate::fidelity::compare_fidelities;
use crate::interval_parts::WidthParts;
use crate::screening::{UnusableMeasurement, recognise, unusable_measurements};
use crate::set::{MeasuredSet, PerMeasurement};
use crate::simulator::{Simulator, WIDTH_ROOM_NM};
use crate::speckle::DefectNoise;
use crate::statistics::{EndsSearch, Evidence, Fit, FitProblem, Slot, Surrogate, attribute_set, fit_of, half_widths};

/// Values at which a parameter is simulated before a search, about.
const NODES_OF_PARAMETER: usize = 4;

/// Settings of the work on a set.
#[derive(Clone, Debug)]
pub struct Settings {
    pub sampling: BenchSampling,
    /// Folder of cached tables of cells; no cache if none.
    pub cache: Option<PathBuf>,
    /// Try these effects alone; all if empty.
    pub only: Vec<String>,
    /// Effects that are tried beside those of the library.
    pub declared: Vec<DeclaredEffect>,
    /// Try the effects that are proposed for the residual as well.
    pub adopt: bool,
    /// Compare the three fidelities of the cell first.
    pub compare_fidelities: bool,
    /// Simulate smooth terms, which null tests are made of as well.
    pub smooth_terms: bool,
    /// Refine what is found with full simulations, where the surrogate adds up polynomials.
    pub refine: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sampling: BenchSampling::default(),
            cache: None,
            only: Vec::new(),
            declared: Vec::new(),
            adopt: false,
            compare_fidelities: true,
            smooth_terms: true,
            refine: true,
        }
    }
}

/// Simulations that depend on the plan of a session, and not on what it measured: sessions of one plan share
/// them.
pub struct Simulations {
    pub surrogate: Surrogate,
    /// The noise of the effect that strikes single pillars at random, if it is among the effects.
    pub defects: Option<(usize, DefectNoise)>,
}

/// Measurements that can be used.
pub struct Screening {
    pub used: PerMeasurement<bool>,
    pub unusable: Vec<UnusableMeasurement>,
    /// Mistakes of frames that were recognised and masked, or that the user may correct.
    pub warnings: Vec<String>,
    /// The data without pixels that are masked; none where none is.
    masked: Option<Data>,
    /// The nuisances fitted to all measurements, nothing else.
    pub fit: Fit,
}

impl Screening {
    /// True if more than half of the measurements cannot be used, or one alone can: what is fitted to it has nothing to be judged by.
    pub fn is_data_unfit(&self) -> bool {
        2 * self.unusable.len() > self.used.len() || self.used.iter().filter(|used| **used).count() < 2
    }
}

/// A set with its simulator and its data.
pub struct Session<'a> {
    pub simulator: Simulator<'a>,
    pub data: Data,
    pub settings: Settings,
}

impl<'a> Session<'a> {
    /// Plan the work on a set.
    ///
    /// # Errors
    /// If an effect or a material is not known.
    pub fn new(set: &'a MeasuredSet, settings: Settings) -> Result<Self> {
        let tried = tried_effects(set, &settings)?;
        let bench = Bench::new(set, settings.sampling);
        let (low, high) = bench.widths_nm();
        let cells = RigorousCells::new(
            set.stack.cell.clone(),
            bench.wavelengths_nm(),
            (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            settings.cache.clone(),
        );
        Ok(Self {
            simulator: Simulator::new(bench, CellSource::Rigorous(Box::new(cells)), tried),
            data: Data::new(set),
            settings,
        })
    }

    /// The same set, with these effects tried beside the others.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn adopting(&self, proposed: Vec<DeclaredEffect>) -> Result<Self> {
        let mut settings = self.settings.clone();
        if !settings.only.is_empty() {
            settings.only.extend(proposed.iter().map(|e| e.name.clone()));
        }
        settings.declared.extend(proposed);
        let mut wider = Self::new(self.set(), settings)?;
        wider.simulator.work = self.simulator.work.clone();
        Ok(wider)
    }

    /// Number of simulations that a search about all effects is begun with, and of tables of cells.
    pub fn planned(&self) -> (usize, usize) {
        let slots = &self.simulator.slots;
        let changes_cells = |slot: &&Slot| self.simulator.effects[slot.effect].stage() == Stage::Stack;
        let nodes = NODES_OF_PARAMETER;
        (
            nodes * slots.len(),
            2 + nodes * slots.iter().filter(changes_cells).count(),
        )
    }

    /// The set.
    pub fn set(&self) -> &'a MeasuredSet {
        self.simulator.bench.set()
    }

    /// Simulate every effect about the stated chip and bench.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn simulate(&self, progress: &dyn Progress) -> Result<Simulations> {
        let nothing = vec![0.0; self.simulator.slots.len()];
        let smooth = self.settings.smooth_terms;
        let surrogate = Surrogate::simulate(&self.simulator, &nothing, smooth, progress)?;
        let random = self.simulator.effects.iter().position(|e| e.random());
        let defects = match random {
            None => None,
            Some(effect) => {
                let slot = self.simulator.slots_of(effect)[0];
                Some((effect, DefectNoise::of(&self.simulator, &nothing, slot, progress)?))
            }
        };
        Ok(Simulations { surrogate, defects })
    }

    /// The same, of a session on the same bench that tries the effects of another and more: what that one simulated is not simulated
    /// again, nor what `found` holds, its surrogate about what it found.
    ///
    /// # Errors
    /// As [`Session::simulate`].
    pub fn simulate_beyond(
        &self,
        (other, known): (&Session<'_>, &Simulations),
        found: Option<&Surrogate>,
        progress: &dyn Progress,
    ) -> Result<Simulations> {
        let (own, others) = (&self.simulator, &other.simulator);
        let number = |e: usize| others.effects.iter().position(|o| o.name() == own.effects[e].name());
        let slots = own.slots.iter();
        let slots: Vec<Option<usize>> = slots
            .map(|slot| Some(others.slots_of(number(slot.effect)?)[slot.index]))
            .collect();
        let random = own.effects.iter().position(|e| e.random());
        let widened = known.surrogate.widened(own, &slots, progress)?;
        let surrogate = match found {
            Some(found) => widened.knowing(found, &slots),
            None => widened,
        };
        Ok(Simulations {
            surrogate,
            defects: random.zip(known.defects.as_ref().map(|(_, noise)| noise.clone())),
        })
    }

    /// The set as stated, all measurements counted.
    pub fn problem(&self, simulations: &Simulations) -> FitProblem<'_> {
        FitProblem::new(&self.simulator, simulations.surrogate.clone(), &self.data)
    }

    /// Find the pixels and the measurements that cannot be used.
    ///
    /// # Errors
    /// If the frames are mirrored, turned or transposed.
    pub fn screen(&self, simulations: &Simulations) -> Result<Screening> {
        let problem = self.problem(simulations);
        let recognised = recognise(self.set(), &problem)?;
        let problem = FitProblem {
            data: recognised.data.as_ref().unwrap_or(&self.data),
            ..problem
        };
        let fit = problem.nuisance_fit();
        let unusable = unusable_measurements(self.set(), &problem, &fit.nuisances, &recognised);
        let mut used = problem.used;
        for u in &unusable {
            used[u.measurement] = false;
        }
        Ok(Screening {
            used,
            unusable,
            warnings: recognised.warnings,
            masked: recognised.data,
            fit,
        })
    }

    /// Attribute the residual of the measurements that can be used; `ends` may end the search before all is tried.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn attribute(
        &self,
        simulations: &Simulations,
        screening: &Screening,
        ends: Option<&EndsSearch<'_>>,
        progress: &dyn Progress,
    ) -> Result<Evidence> {
        let problem = self.screened(simulations, screening);
        let defects = simulations
            .defects
            .as_ref()
            .map(|(effect, noise)| (*effect, noise as &dyn RandomNoise<Data>));
        attribute_set(&problem, self.settings.refine, defects, ends, progress)
    }

    /// The fit of these effects and of no others, without a search, and what half of a 95 % interval of each of their parameters is
    /// made of. With `full`, it is refined with full simulations.
    ///
    /// # Errors
    /// If a simulation fails, or the user stopped it.
    pub fn fitted(
        &self,
        simulations: &Simulations,
        effects: &[usize],
        full: bool,
        progress: &dyn Progress,
    ) -> Result<(Fit, Vec<WidthParts>)> {
        let problem = self.problem(simulations);
        let fit = fit_of(problem, effects, full && self.settings.refine, progress)?;
        let parts = half_widths(&fit.problem, &fit.fit);
        Ok((fit.fit, parts.iter().map(WidthParts::from).collect()))
    }

    /// The answer for the set, and the evidence for it where there was enough to search in.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn diagnose(
        &self,
        simulations: &Simulations,
        progress: &dyn Progress,
    ) -> Result<(Diagnosis, Option<Evidence>)> {
        self.diagnose_unless(None, simulations, progress)
    }

    /// The same, but `ends` may end the search before all is tried.
    ///
    /// # Errors
    /// As [`Session::diagnose`].
    pub fn diagnose_unless(
        &self,
        ends: Option<&EndsSearch<'_>>,
        simulations: &Simulations,
        progress: &dyn Progress,
    ) -> Result<(Diagnosis, Option<Evidence>)> {
        let screening = self.screen(simulations)?;
        if screening.is_data_unfit() {
            let error = screening.fit.chi2 / self.screened(simulations, &screening).points().max(1.0);
            let mut diagnosis = Diagnosis::data_unfit(self.set(), error, &screening.unusable);
            diagnosis.warnings = screening.warnings;
            return Ok((diagnosis, None));
        }
        let ladder = if self.settings.compare_fidelities {
            let problem = self.screened(simulations, &screening);
            compare_fidelities(self.set(), self.settings.sampling, &problem, progress)?
        } else {
            Vec::new()
        };
        let evidence = self.attribute(simulations, &screening, ends, progress)?;
        let mut diagnosis = Diagnosis::new(&self.simulator, &evidence, &screening.unusable, ladder);
        diagnosis.warnings = screening.warnings;
        Ok((diagnosis, Some(evidence)))
    }

    fn screened<'s>(&'s self, simulations: &Simulations, screening: &'s Screening) -> FitProblem<'s> {
        FitProblem {
            used: screening.used.clone(),
            data: screening.masked.as_ref().unwrap_or(&self.data),
            ..self.problem(simulations)
        }
    }
}

/// The effects of a set that are called `only`; all if none are named.
fn tried_effects(set: &MeasuredSet, settings: &Settings) -> Result<Vec<Box<dyn Effect>>> {
    let only = &settings.only;
    let mut tried = effects::with_declared(set, &settings.declared)?;
    check_effects(&tried, only)?;
    if !only.is_empty() {
        tried.retain(|e| only.contains(&e.name()));
    }
    Ok(tried)
}

/// Refuse names that no effect of a set has.
///
/// # Errors
/// As [`check_names`].
pub fn check_effects(known: &[Box<dyn Effect>], wanted: &[String]) -> Result<()> {
    let known: Vec<String> = known.iter().map(|e| e.name()).collect();
    check_names(&known, &effects::CONDITIONAL, wanted)
}
