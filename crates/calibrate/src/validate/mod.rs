//! Validation of the calibration on synthetic sets: false claims, detection limits, confusions.

mod chips;
mod coverage;
mod journal;
mod noiseless;
mod page;
mod summary;
pub(crate) mod synthetic;

use std::path::PathBuf;

use ndarray::Array2;
use rayon::prelude::*;
use serde::Serialize;

pub use coverage::{ClaimedNumber, Coverage};
pub use page::write_validation;
pub use summary::{DetectionLimit, Validation};

use crate::diagnosis::Diagnosis;
use crate::effects::Effect;
use crate::session::{Session, Settings, check_effects};
use crate::set::{MeasuredSet, MeasurementIndex};
use crate::smooth_residual::SmoothResidual;
use crate::statistics::{Evidence, Measurements};
use chips::{AppliedEffect, SyntheticChip};
use journal::Journal;
use metalith_attribution::SetVerdict;
use metalith_core::{Progress, Result};
use metalith_rcwa::Orders;
use synthetic::{Synthesizer, SyntheticImages, UnlistedEffect};

/// First seed of the sets that thresholds are compared with; none of these is judged.
const THRESHOLD_SEED: u64 = 900_000;

/// First seed of the sets that are judged.
const JUDGED_SEED: u64 = 1000;

/// First seed of the chips that are drawn at random.
const RANDOM_SEED: u64 = 15;

/// Distance of the seeds of judged sets for each of [`ValidationPlan::seed`]: none meets the thresholds' or another's.
const SEEDS_APART: u64 = 1_000_000;

/// One synthetic set and its diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct ValidationTrial {
    /// Effects that differed; `nothing` for a set without effect.
    pub truth: String,
    /// Effects with their numbers, each in the unit of its parameter.
    pub parts: Vec<AppliedEffect>,
    /// True if it is no known effect.
    pub off_list: bool,
    /// True if it is two effects at once.
    pub pair: bool,
    /// Size in typical sizes.
    pub size: f64,
    pub seed: u64,
    pub verdict: SetVerdict,
    /// What was claimed.
    pub found: Vec<String>,
    /// True if the true effect (both of two) is among the effects found, alone or as one of several alternatives.
    pub named: bool,
    /// What was claimed and is neither there nor an alternative to what is there.
    pub not_there: Vec<String>,
    /// Numbers of the true effects that were named, beside the true ones.
    pub numbers: Vec<ClaimedNumber>,
    /// Unit of the effect; empty for two.
    pub unit: String,
    /// Largest gain of any single effect on measurements left out.
    pub largest_gain: f64,
    pub held_out_before: f64,
    pub held_out_after: f64,
    /// What is left of an effect that is not listed.
    pub left: Option<UnexplainedResidual>,
}

/// What a diagnosis could not name, for people.
#[derive(Clone, Debug, Serialize)]
pub struct UnexplainedResidual {
    /// Coefficients of the smooth path by Noll's number, with standard deviations (nm).
    pub path_nm: Vec<(u32, f64, f64)>,
    /// Covariance of the smooth blur, xx, xy, yy, with standard deviations (um^2).
    pub blur_um2: [(f64, f64); 3],
    /// Measurement whose residual is shown.
    pub measurement: String,
    #[serde(skip)]
    pub path: Array2<f64>,
    #[serde(skip)]
    pub radius_um: f64,
    /// Residual of that measurement (sigma).
    #[serde(skip)]
    pub residual: Array2<f64>,
}

/// What a validation runs.
#[derive(Clone, Debug)]
pub struct ValidationPlan {
    /// Sets without any effect that are judged.
    pub nulls: u64,
    /// Other sets without effect, which thresholds are compared with.
    pub threshold_nulls: u64,
    /// Effects that sets are made with; all if empty.
    pub effects: Vec<String>,
    /// True if effects that are not listed are tried.
    pub off_list: bool,
    /// Chips in the place of one for each effect, size and pair: effects with their sizes in typical sizes, as in
    /// `cd_bias=1+film_index=-0.5`.
    pub trials: Vec<String>,
    /// So many chips with one or two effects of random sizes, in the place of one for each effect, size and pair.
    pub random: u64,
    /// Chips that are drawn at random, and noise and bench of all sets that are judged.
    pub seed: u32,
    /// Sets without noise, in which the effects that are there are fitted and no others are looked for: what their values err by is
    /// the model's own error, which intervals count with.
    pub noiseless: bool,
    /// File that each set is written to as soon as it is judged, one line of JSON for each: a validation takes long, and may be
    /// stopped.
    pub journal: Option<PathBuf>,
    /// Diffraction orders along an axis of the cells that sets are made with; odd. Fits use 13.
    pub orders: usize,
}

impl Default for ValidationPlan {
    fn default() -> Self {
        Self {
            nulls: 60,
            threshold_nulls: 10,
            effects: Vec::new(),
            off_list: true,
            trials: Vec::new(),
            random: 0,
            seed: 0,
            noiseless: false,
            journal: None,
            orders: synthetic::ORDERS,
        }
    }
}

impl ValidationPlan {
    /// These chips alone: no others, and no effects that are not listed.
    #[must_use]
    pub fn only(trials: Vec<String>, random: u64) -> Self {
        Self {
            nulls: 0,
            threshold_nulls: 0,
            off_list: false,
            trials,
            random,
            ..Self::default()
        }
    }
}

/// Judge the calibration on synthetic sets like a measured one.
///
/// # Errors
/// If an effect is not known, a cell cannot be solved, or the user stopped it.
pub fn validate(
    like: &MeasuredSet,
    settings: &Settings,
    plan: &ValidationPlan,
    progress: &dyn Progress,
) -> Result<Validation> {
    let settings = Settings {
        compare_fidelities: false,
        ..settings.clone()
    };
    // Simulations take minutes before the first of these cells is solved.
    Orders::new(plan.orders)?;
    let session = Session::new(like, settings.clone())?;
    check_effects(&session.simulator.effects, &plan.effects)?;
    let chips = chips(&session, plan)?;
    let simulations = session.simulate(progress)?;
    let synthesizer = Synthesizer::with_orders(like, &settings, plan.orders)?;
    let wanted: Vec<Vec<(&str, &[f64])>> = chips
        .iter()
        .map(|chip| {
            chip.parts
                .iter()
                .map(|(name, n)| (name.as_str(), n.as_slice()))
                .collect()
        })
        .collect();
    let exposed = synthesizer.with_effects(&wanted, progress)?;
    let mut odd = Vec::new();
    // Without a search nothing can be said of what is in no list.
    if plan.off_list && !plan.noiseless {
        let ghost = ("ghost", UnlistedEffect::Ghost(0.04, [5.0, -3.0]));
        // Sides of unequal lengths: circles have none.
        let is_square = like.stack.cell.shape.is_square();
        let anisotropy = is_square.then_some(("anisotropy", UnlistedEffect::Anisotropy(8.0)));
        for (name, what) in [ghost].into_iter().chain(anisotropy) {
            odd.push((name, synthesizer.off_list(what, progress)?));
        }
    }
    // The first chip is without effect.
    let thresholds = (0..plan.threshold_nulls).map(|k| (&exposed[0], &chips[0], THRESHOLD_SEED + k));
    let judged = JUDGED_SEED + SEEDS_APART * u64::from(plan.seed);
    let nulls = (0..plan.nulls).map(|k| (&exposed[0], &chips[0], judged + k));
    let others = judged + plan.nulls;
    let listed = exposed.iter().zip(&chips).skip(1).zip(others..);
    let mut work: Vec<(&SyntheticImages, ValidationTrial, &[AppliedEffect])> = thresholds
        .chain(nulls)
        .chain(listed.map(|((exposed, chip), seed)| (exposed, chip, seed)))
        .map(|(exposed, chip, seed)| (exposed, ValidationTrial::new(chip, seed), chip.parts.as_slice()))
        .collect();
    for ((name, exposed), seed) in odd.iter().zip(others + chips.len() as u64 - 1..) {
        let mut trial = ValidationTrial::new(&SyntheticChip::single(name, 1.0, Vec::new()), seed);
        trial.off_list = true;
        work.push((exposed, trial, &[]));
    }
    let journal = Journal::new(plan.journal.as_deref())?;
    progress.begin("synthetic sets diagnosed", work.len() as u64);
    // Sets are independent of one another, and the answers are in the order of the list.
    let mut trials = work
        .into_par_iter()
        .map(|(exposed, mut trial, parts)| {
            let set = if plan.noiseless {
                synthesizer.draw_noiseless(exposed, trial.seed)
            } else {
                synthesizer.draw(exposed, trial.seed)
            };
            let own = Session::new(&set, settings.clone())?;
            if plan.noiseless {
                trial.measure(&own, &simulations, parts, &StopOnly(progress))?;
                journal.keep(&trial)?;
                progress.advance(1);
                return Ok(trial);
            }
            let (diagnosis, evidence) = own.diagnose(&simulations, &StopOnly(progress))?;
            if trial.off_list {
                trial.left = evidence.and_then(|e| UnexplainedResidual::new(&own, &diagnosis, &e));
            }
            trial.judge(&diagnosis, parts, &session);
            journal.keep(&trial)?;
            progress.advance(1);
            Ok(trial)
        })
        .collect::<Result<Vec<_>>>()?;
    let judged = trials.split_off(plan.threshold_nulls as usize);
    Ok(Validation::new(like.title.clone(), &trials, judged))
}

/// One chip without effect, then those that the plan asks for.
fn chips(session: &Session<'_>, plan: &ValidationPlan) -> Result<Vec<SyntheticChip>> {
    let known: Vec<&dyn Effect> = session.simulator.effects.iter().map(AsRef::as_ref).collect();
    let is_wanted = |e: &&&dyn Effect| plan.effects.is_empty() || plan.effects.contains(&e.name());
    let wanted: Vec<&dyn Effect> = known.iter().filter(is_wanted).copied().collect();
    let mut chips = vec![SyntheticChip::stated()];
    if plan.trials.is_empty() && plan.random == 0 {
        chips.extend(chips::of_each_effect(&wanted));
    }
    for text in &plan.trials {
        chips.push(chips::of_text(&known, text)?);
    }
    chips.extend(chips::at_random(
        &wanted,
        plan.random,
        RANDOM_SEED + u64::from(plan.seed),
    ));
    Ok(chips)
}

/// Passes on that the user wants to stop, but not the progress of each of many sets.
struct StopOnly<'p>(&'p dyn Progress);

impl Progress for StopOnly<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, _: u64) {}

    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

impl ValidationTrial {
    fn new(chip: &SyntheticChip, seed: u64) -> Self {
        Self {
            truth: chip.truth.clone(),
            parts: chip.parts.clone(),
            off_list: false,
            pair: chip.parts.len() > 1,
            size: chip.size,
            seed,
            verdict: SetVerdict::DataUnfit,
            found: Vec::new(),
            named: false,
            not_there: Vec::new(),
            numbers: Vec::new(),
            unit: String::new(),
            largest_gain: 0.0,
            held_out_before: 0.0,
            held_out_after: 0.0,
            left: None,
        }
    }

    fn judge(&mut self, diagnosis: &Diagnosis, parts: &[AppliedEffect], session: &Session<'_>) {
        self.verdict = diagnosis.verdict;
        self.found = diagnosis.effects.iter().map(|e| e.name.clone()).collect();
        self.named = !parts.is_empty() && parts.iter().all(|(name, _)| self.found.contains(name));
        let mut allowed: Vec<&str> = Vec::new();
        for (name, numbers) in parts {
            let Some(effect) = session.simulator.effects.iter().find(|e| e.name() == *name) else {
                continue;
            };
            if !self.pair {
                self.unit = effect.unit().into();
            }
            allowed.push(name);
            let Some(own) = diagnosis.effects.iter().find(|e| e.name == *name) else {
                continue;
            };
            allowed.extend(own.confounded_with.iter().map(String::as_str));
            let truth = effect.reported(numbers, &vec![0.0; numbers.len()], session.set());
            let truth: Vec<f64> = truth.into_iter().map(|r| r.0).collect();
            self.numbers.extend(ClaimedNumber::all(own, &truth));
        }
        self.not_there = self
            .found
            .iter()
            .filter(|f| !allowed.contains(&f.as_str()))
            .cloned()
            .collect();
        let gains = diagnosis.ranking.iter().filter_map(|r| r.held_out_gain);
        self.largest_gain = gains.fold(0.0, f64::max);
        self.held_out_before = diagnosis.error.before.held_out;
        self.held_out_after = diagnosis.error.after.held_out;
    }
}

impl UnexplainedResidual {
    fn new(session: &Session<'_>, diagnosis: &Diagnosis, evidence: &Evidence) -> Option<Self> {
        let (problem, fit) = (evidence.problem(&session.simulator), &evidence.finding.after);
        let smooth = SmoothResidual::new(&session.simulator, &problem, fit)?;
        let error = |c: &MeasurementIndex| diagnosis.measurements[usize::from(*c)].after.unwrap_or(0.0);
        let worst = problem.data.indices().max_by(|a, b| error(a).total_cmp(&error(b)))?;
        let image = problem.prediction(&fit.theta, worst);
        let residual = fit.nuisances.residual(problem.data, &image, worst);
        Some(Self {
            path_nm: smooth.coefficients_nm,
            blur_um2: smooth.blur_um2,
            measurement: diagnosis.measurements[usize::from(worst)].measurement.clone(),
            path: smooth.path_nm,
            radius_um: smooth.radius_um,
            residual: residual.mapv(f64::from),
        })
    }
}
