//! How far `calibrate` can be trusted, by twins: false claims, what is found at which size, what is
//! taken for what.

use serde::Serialize;

use super::diagnosis::{Diagnosis, SetVerdict};
use super::session::{Session, Settings};
use super::set::MeasuredSet;
use super::twin::{Exposed, OffList, Twins};
use crate::error::Result;
use crate::progress::Progress;

/// Sizes that every effect is tried at, in typical sizes.
const SIZES: [f64; 3] = [0.5, 1.0, 2.0];

/// One twin and what was said of it.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// What differed; `nothing` for a set without effect.
    pub truth: String,
    /// Its size in typical sizes.
    pub size: f64,
    pub seed: u64,
    pub verdict: SetVerdict,
    pub found: Vec<String>,
    /// Whether the true effect is among what was found, alone or as one of a set.
    pub named: bool,
    /// Whether the interval of the true effect holds its true value, for effects of one number.
    pub inside: Option<bool>,
    pub held_out_before: f64,
    pub held_out_after: f64,
}

/// What the proof runs.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Sets without any effect.
    pub nulls: u64,
    /// Sizes of every effect, from the list of half, one and two typical sizes.
    pub sizes: usize,
    /// Whether effects in no list are tried.
    pub off_list: bool,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            nulls: 40,
            sizes: SIZES.len(),
            off_list: true,
        }
    }
}

/// Judge `calibrate` on twins of a set.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn prove(like: &MeasuredSet, settings: &Settings, extent: Extent, progress: &dyn Progress) -> Result<Vec<Trial>> {
    let settings = Settings {
        ladder: false,
        exact: false,
        ..settings.clone()
    };
    let session = Session::new(like, settings.clone())?;
    let atlas = session.atlas(progress)?;
    let twins = Twins::new(like, &settings)?;
    let mut trials = Vec::new();
    let mut seed = 1000;
    let mut judge = |truth: &str, size: f64, numbers: &[f64], exposed: &Exposed| -> Result<Trial> {
        seed += 1;
        let set = twins.draw(exposed, seed);
        let mut twin = Session::new(&set, settings.clone())?;
        let (diagnosis, _) = twin.diagnose(&atlas, progress)?;
        let truth_value = session
            .simulator
            .effects
            .iter()
            .find(|e| e.name() == truth)
            .filter(|_| numbers.len() == 1)
            .map(|e| e.value(numbers[0], like));
        Ok(trial(truth, size, seed, truth_value, &diagnosis))
    };
    let nothing = twins.with_effect("", &[], progress)?;
    for _ in 0..extent.nulls {
        trials.push(judge("nothing", 0.0, &[], &nothing)?);
    }
    for effect in &session.simulator.effects {
        for size in SIZES.into_iter().rev().take(extent.sizes).rev() {
            // Both numbers of an effect along two axes, unequal and of opposite signs.
            let numbers: Vec<f64> = effect
                .parameters()
                .iter()
                .zip([1.0, -0.6])
                .map(|(p, share)| share * size * p.typical)
                .collect();
            let exposed = twins.with_effect(&effect.name(), &numbers, progress)?;
            trials.push(judge(&effect.name(), size, &numbers, &exposed)?);
        }
    }
    if extent.off_list {
        let list = [
            ("astigmatism", OffList::Astigmatism(30.0)),
            ("ghost", OffList::Ghost(0.04, [5.0, -3.0])),
            ("anisotropy", OffList::Anisotropy(8.0)),
        ];
        for (name, what) in list {
            let exposed = twins.off_list(what, progress)?;
            trials.push(judge(name, 1.0, &[], &exposed)?);
        }
    }
    Ok(trials)
}

fn trial(truth: &str, size: f64, seed: u64, value: Option<f64>, diagnosis: &Diagnosis) -> Trial {
    let own = diagnosis.effects.iter().find(|e| e.name == truth);
    let inside = value.zip(own).and_then(|(value, e)| {
        let ends = e.interval.as_array()?;
        Some((ends.first()?.as_f64()?..=ends.get(1)?.as_f64()?).contains(&value))
    });
    Trial {
        truth: truth.into(),
        size,
        seed,
        verdict: diagnosis.verdict,
        found: diagnosis.effects.iter().map(|e| e.name.clone()).collect(),
        named: own.is_some(),
        inside,
        held_out_before: diagnosis.error.before.held_out,
        held_out_after: diagnosis.error.after.held_out,
    }
}

/// The trials in words: shares, then one line for each.
pub fn summary(trials: &[Trial]) -> String {
    let nulls: Vec<&Trial> = trials.iter().filter(|t| t.truth == "nothing").collect();
    let claims = nulls.iter().filter(|t| !t.found.is_empty()).count();
    let mut text = format!("{claims} false claims in {} sets without effect\n", nulls.len());
    for t in trials.iter().filter(|t| t.truth != "nothing") {
        let inside = match t.inside {
            Some(true) => "inside",
            Some(false) => "outside",
            None => "",
        };
        text.push_str(&format!(
            "{:18} x{:<4} {:12} {:40} {inside:8} {:9.4} -> {:.4}\n",
            t.truth,
            t.size,
            serde_json::to_value(t.verdict)
                .ok()
                .and_then(|v| v.as_str().map(str::to_owned))
                .unwrap_or_default(),
            t.found.join(", "),
            t.held_out_before,
            t.held_out_after
        ));
    }
    text
}
