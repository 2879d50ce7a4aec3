//! How far `calibrate` can be trusted, by twins: false claims, what is found at which size, what is
//! taken for what.

mod page;
mod summary;

use ndarray::Array2;
use serde::Serialize;
use serde_json::Value;

pub use page::write_proof;
pub use summary::{Limit, Proof};

use super::attribute::Finding;
use super::diagnosis::{Diagnosis, SetVerdict};
use super::free::FreeTerm;
use super::session::{Session, Settings};
use super::set::MeasuredSet;
use super::twin::{Exposed, OffList, Twins};
use crate::error::Result;
use crate::progress::Progress;

/// Sizes that every effect is tried at, in typical sizes.
pub const SIZES: [f64; 3] = [0.5, 1.0, 2.0];

/// The truth of a set without any effect.
pub const NOTHING: &str = "nothing";

/// Seeds of sets that thresholds are held against, apart from all that are judged.
const THRESHOLD_SEED: u64 = 900_000;

/// Seeds of sets that are judged.
const JUDGED_SEED: u64 = 1000;

/// One twin and what was said of it.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// What differed; [`NOTHING`] for a set without effect.
    pub truth: String,
    /// Whether that is in no list.
    pub off_list: bool,
    /// Its size in typical sizes.
    pub size: f64,
    /// Its value as it is reported, where it is one number.
    pub value: Option<f64>,
    pub unit: String,
    pub seed: u64,
    pub verdict: SetVerdict,
    /// What was claimed.
    pub found: Vec<String>,
    /// Whether the true effect is among what was found, alone or as one of a set.
    pub named: bool,
    pub found_value: Option<Value>,
    pub interval: Option<Value>,
    /// Whether the interval of the true effect holds its true value, for effects of one number.
    pub inside: Option<bool>,
    /// Largest gain of any single effect on captures left out.
    pub largest_gain: f64,
    pub held_out_before: f64,
    pub held_out_after: f64,
    /// What is left, for what is in no list.
    pub left: Option<Left>,
}

/// What a diagnosis could not name, as a person is shown it.
#[derive(Clone, Debug, Serialize)]
pub struct Left {
    /// Coefficients of the free path by Noll's number, with standard deviations [nm].
    pub path_nm: Vec<(u32, f64, f64)>,
    /// Covariance of the free blur, xx, xy, yy, with standard deviations [um^2].
    pub blur_um2: [(f64, f64); 3],
    /// Capture whose residual is shown.
    pub capture: String,
    #[serde(skip)]
    pub path: Array2<f64>,
    #[serde(skip)]
    pub radius_um: f64,
    /// Residual of that capture [sigma].
    #[serde(skip)]
    pub residual: Array2<f64>,
}

/// What the proof runs.
#[derive(Clone, Debug)]
pub struct Extent {
    /// Sets without any effect that are judged.
    pub nulls: u64,
    /// Other sets without effect, which thresholds are held against.
    pub threshold_nulls: u64,
    /// Effects that twins are made with; all if empty.
    pub effects: Vec<String>,
    /// Whether effects in no list are tried.
    pub off_list: bool,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            nulls: 60,
            threshold_nulls: 10,
            effects: Vec::new(),
            off_list: true,
        }
    }
}

/// Judge `calibrate` on twins of a set.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn prove(like: &MeasuredSet, settings: &Settings, extent: &Extent, progress: &dyn Progress) -> Result<Proof> {
    let settings = Settings {
        ladder: false,
        exact: false,
        ..settings.clone()
    };
    let session = Session::new(like, settings.clone())?;
    let atlas = session.atlas(progress)?;
    let twins = Twins::new(like, &settings)?;
    let effects: Vec<_> = session
        .simulator
        .effects
        .iter()
        .filter(|e| extent.effects.is_empty() || extent.effects.contains(&e.name()))
        .collect();
    let mut chips = vec![(String::new(), 0.0, Vec::new())];
    for effect in &effects {
        for size in SIZES {
            // Both numbers of an effect along two axes, unequal and of opposite signs.
            let parameters = effect.parameters();
            let numbers = parameters.iter().zip([1.0, -0.6]).map(|(p, s)| s * size * p.typical);
            chips.push((effect.name(), size, numbers.collect()));
        }
    }
    let wanted: Vec<Vec<(&str, &[f64])>> = chips
        .iter()
        .map(|(name, _, numbers)| vec![(name.as_str(), numbers.as_slice())])
        .collect();
    let mut exposed = twins.with_effects(&wanted, progress)?.into_iter();
    let nothing = exposed.next().expect("the first is without effect");
    let off_list = [
        ("astigmatism", OffList::Astigmatism(30.0)),
        ("ghost", OffList::Ghost(0.04, [5.0, -3.0])),
        ("anisotropy", OffList::Anisotropy(8.0)),
    ];
    let mut odd = Vec::new();
    for (name, what) in off_list.into_iter().filter(|_| extent.off_list) {
        odd.push((name, twins.off_list(what, progress)?));
    }
    let count = extent.nulls + extent.threshold_nulls + (chips.len() - 1 + odd.len()) as u64;
    progress.begin("twins diagnosed", count);
    let diagnose = |exposed: &Exposed, mut trial: Trial| -> Result<Trial> {
        let set = twins.draw(exposed, trial.seed);
        let mut twin = Session::new(&set, settings.clone())?;
        let (diagnosis, finding) = twin.diagnose(&atlas, progress)?;
        if trial.off_list {
            trial.left = finding.and_then(|f| Left::new(&twin, &diagnosis, &f));
        }
        trial.judge(&diagnosis);
        progress.advance(1);
        Ok(trial)
    };
    let of_nothing = |first: u64, count: u64| {
        (first..first + count)
            .map(|seed| diagnose(&nothing, Trial::new(NOTHING, 0.0, seed)))
            .collect::<Result<Vec<_>>>()
    };
    let thresholds = of_nothing(THRESHOLD_SEED, extent.threshold_nulls)?;
    let mut trials = of_nothing(JUDGED_SEED, extent.nulls)?;
    let mut seed = JUDGED_SEED + extent.nulls;
    for ((name, size, numbers), exposed) in chips.iter().skip(1).zip(exposed) {
        let mut trial = Trial::new(name, *size, seed);
        let effect = effects.iter().find(|e| e.name() == *name);
        if let Some(effect) = effect {
            trial.unit = effect.unit().into();
            trial.value = match effect.reported(numbers, &vec![0.0; numbers.len()], like).as_slice() {
                [(value, _)] => Some(*value),
                _ => None,
            };
        }
        trials.push(diagnose(&exposed, trial)?);
        seed += 1;
    }
    for (name, exposed) in &odd {
        let mut trial = Trial::new(name, 1.0, seed);
        trial.off_list = true;
        trials.push(diagnose(exposed, trial)?);
        seed += 1;
    }
    Ok(Proof::new(like.title.clone(), &thresholds, trials))
}

impl Trial {
    fn new(truth: &str, size: f64, seed: u64) -> Self {
        Self {
            truth: truth.into(),
            off_list: false,
            size,
            value: None,
            unit: String::new(),
            seed,
            verdict: SetVerdict::DataUnfit,
            found: Vec::new(),
            named: false,
            found_value: None,
            interval: None,
            inside: None,
            largest_gain: 0.0,
            held_out_before: 0.0,
            held_out_after: 0.0,
            left: None,
        }
    }

    fn judge(&mut self, diagnosis: &Diagnosis) {
        self.verdict = diagnosis.verdict;
        self.found = diagnosis.effects.iter().map(|e| e.name.clone()).collect();
        if let Some(own) = diagnosis.effects.iter().find(|e| e.name == self.truth) {
            self.named = true;
            self.found_value = Some(own.value.clone());
            self.interval = Some(own.interval.clone());
            self.inside = self.value.and_then(|value| {
                let ends = own.interval.as_array()?;
                Some((ends.first()?.as_f64()?..=ends.get(1)?.as_f64()?).contains(&value))
            });
        }
        let gains = diagnosis.ranking.iter().filter_map(|r| r.held_out_gain);
        self.largest_gain = gains.fold(0.0, f64::max);
        self.held_out_before = diagnosis.error.before.held_out;
        self.held_out_after = diagnosis.error.after.held_out;
    }
}

impl Left {
    fn new(session: &Session<'_>, diagnosis: &Diagnosis, finding: &Finding) -> Option<Self> {
        let free = FreeTerm::new(session, finding)?;
        let error = |c: &usize| diagnosis.captures[*c].after.unwrap_or(0.0);
        let worst = (0..diagnosis.captures.len()).max_by(|a, b| error(a).total_cmp(&error(b)))?;
        let grid = finding.atlas.grid(&finding.after.theta, worst);
        let residual = finding.after.nuisances.residual(&session.data, &grid, worst);
        Some(Self {
            path_nm: free.coefficients_nm,
            blur_um2: free.blur_um2,
            capture: diagnosis.captures[worst].capture.clone(),
            path: free.path_nm,
            radius_um: free.radius_um,
            residual: residual.mapv(f64::from),
        })
    }
}
