//! Plan of a session before it is measured: the measurements that distinguish the effects.
//!
//! ```text
//! design, layout, bench -> candidates -> what each tells -> the fewest that do -> set folder, check list
//! ```
//!
//! | file | holds |
//! | --- | --- |
//! | `bench_file` | what the bench can do and what is asked of it |
//! | `limits` | whether a set of the design can be planned |
//! | `candidates` | every measurement that it could take |
//! | `requirements` | what is asked of them |
//! | `information` | normal equations of each, by the simulator and the noise |
//! | `choice` | the fewest measurements |
//! | `expected_performance` | what they find, and what they cannot distinguish |
//! | `cheap` | spectra and widths that cost less, and the effects that they determine |
//! | `filled_in_files` | a folder whose plan is not to be overwritten |
//! | `files`, `page` | the set folder, and the check list |

mod bench_file;
mod candidates;
mod cheap;
mod choice;
mod expected_performance;
mod files;
mod filled_in_files;
mod information;
mod limits;
mod page;
mod requirements;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_pillars::PillarReader;
use serde::Serialize;

pub use bench_file::{BenchFile, SemOffer, Spectrometer};
pub use cheap::{CheapEffect, CheapMeasurements};
pub use expected_performance::{Confusion, PlannedEffect};
pub use filled_in_files::check_not_begun;
pub use limits::check_plannable;

use candidates::{Candidates, sem_sites};
use choice::{Choice, ChosenMeasurement, Place, Requirement};
use information::{Information, cells_of, exposed};
use metalith_calibrate::MeasuredSet;
use metalith_calibrate::Simulator;
use metalith_calibrate::check_effects;
use metalith_calibrate::{Bench, BenchSampling};
use metalith_calibrate::{Effect, all_effects};
use metalith_calibrate::{Surrogate, check_calibration_fits};
use requirements::{check_wanted, only_of_what_is_found, requirements};

/// Spectra of a plan: steps in wavelength are coarser than those of a calibration, since nothing is fitted.
const SAMPLING: BenchSampling = BenchSampling {
    spectrum: 0.3,
    step_nm: 6.0,
    step_um: 0.5,
    margin: 22,
};

/// A session that was planned, with what it is expected to find.
#[derive(Clone, Debug, Serialize)]
pub struct MeasurementPlan {
    /// Folder of the set.
    pub folder: PathBuf,
    /// The check list.
    pub page: PathBuf,
    /// Measurements that the bench could take, and those among them that are to be taken.
    pub candidates: usize,
    pub measurements: Vec<PlannedMeasurement>,
    pub effects: Vec<PlannedEffect>,
    /// Pairs that the measurements cannot distinguish.
    pub confusions: Vec<Confusion>,
    /// Spectra and widths that cost less than the session, if the bench has a spectrometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cheap: Option<CheapMeasurements>,
    /// SHA-256 in hexadecimal of the files that a person fills in, as they were written.
    pub written: BTreeMap<String, String>,
}

/// A measurement to take.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedMeasurement {
    pub file: String,
    pub element: [i64; 2],
    pub led_nm: f64,
    pub aoi_deg: [f64; 2],
    pub distance_um: f64,
    pub window_centre_um: [f64; 2],
    pub frames: u32,
    pub scale_dn: f64,
    /// Value of the brightest pixel (DN), black level included.
    pub brightest_dn: f64,
}

/// Subject of the plan, and its folder.
pub struct PlanRequest<'a> {
    pub design: &'a Design,
    pub bench: &'a BenchFile,
    /// The layout that is or will be written.
    pub layout: &'a Path,
    /// Path as the set names it.
    pub layout_in_set: String,
    /// Folder of the set.
    pub folder: &'a Path,
    /// Folder that the files are written into before they take their places there; the same one if nothing stands there.
    pub into: &'a Path,
    /// Plan for these effects alone; for all if empty.
    pub only: Vec<String>,
    /// Folder of cached tables of cells.
    pub cache: Option<PathBuf>,
}

impl MeasurementPlan {
    /// True if every effect that this bench can see at all is found at its wanted size.
    pub fn finds_all(&self) -> bool {
        self.effects.iter().all(|e| e.detected)
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let missed: Vec<&str> = self
            .effects
            .iter()
            .filter(|e| !e.detected)
            .map(|e| e.name.as_str())
            .collect();
        let found = format!(
            "{} of {} measurements find {} of {} effects at their wanted size",
            self.measurements.len(),
            self.candidates,
            self.effects.len() - missed.len(),
            self.effects.len()
        );
        if missed.is_empty() {
            return found;
        }
        format!("{found}; not found: {}", missed.join(", "))
    }
}

/// Plan a session, and write its folder: `measurement.toml`, the tables that it names, `plan.html` and `plan.json`.
///
/// # Errors
/// As [`check_plannable`]; if a name is not known, a wanted size is beyond what physics allows, the layout cannot be read, a cell
/// cannot be solved, a calibration of the set would not fit into memory, a file cannot be written, or the user stopped it.
pub fn plan(request: &PlanRequest<'_>, reader: &dyn PillarReader, progress: &dyn Progress) -> Result<MeasurementPlan> {
    let (design, bench) = (request.design, request.bench);
    check_plannable(design, bench)?;
    let candidates = candidates::candidates(design, bench, request.layout, reader, progress)?;
    let effects = |set: &MeasuredSet| wanted_effects(set, request);
    let cells = cells_of(&candidates.set, SAMPLING, request.cache.clone());
    let known = effects(&candidates.set)?;
    check_wanted(&candidates.set, bench)?;
    let (information, cells) = information::information(&candidates, bench, SAMPLING, &effects, cells, progress)?;
    let choice = Choice {
        places: information.measurements.iter().map(|t| place(&t.measurement)).collect(),
        requirements: requirements(&known, bench),
        frames: bench.frames.clone(),
        information: &information,
    };
    let mut reachable = choice.reachable();
    only_of_what_is_found(&choice, &mut reachable);
    let picked = choice.measurements(&reachable, bench.most_measurements);
    let set = chosen_set(&candidates, bench, &information, &picked);

    let simulator = Simulator::new(Bench::new(&set, SAMPLING), cells, known);
    check_calibration_fits(&simulator)?;
    let nothing = vec![0.0; simulator.slots.len()];
    let surrogate = Surrogate::beside(&simulator, &nothing, true, progress)?;
    let shown = exposed(&set, &surrogate, bench.peak);
    let margins = choice.margins(&picked);
    let detections: Vec<(Requirement, f64, bool)> = choice
        .requirements
        .iter()
        .zip(margins)
        .zip(&reachable)
        .filter(|((r, _), _)| r.beside.is_empty())
        .map(|((r, margin), reachable)| (r.clone(), margin, *reachable))
        .collect();
    let effects = expected_performance::effects(&simulator, &surrogate, &shown, &detections, progress)?;
    let confusions = expected_performance::confusions(&simulator, &shown, &choice, &picked, &reachable);
    let of_spectrometer = |s| cheap::cheap(&set, s, bench.sem, &effects, progress);
    let cheap = bench.spectrometer.as_ref().map(of_spectrometer).transpose()?;
    files::write_set(request.into, design, bench, &shown, &request.layout_in_set)?;
    let plan = MeasurementPlan {
        folder: request.folder.to_owned(),
        page: request.folder.join("plan.html"),
        candidates: candidates.measurements.len(),
        measurements: shown.measurements.iter().map(|c| planned(c, &shown, bench)).collect(),
        effects,
        confusions,
        cheap,
        written: filled_in_files::digests(request.into)?,
    };
    page::write_page(&request.into.join("plan.html"), &plan, &shown, candidates.unseen)?;
    metalith_report::write_json(&request.into.join("plan.json"), "plan", &plan)?;
    Ok(plan)
}

fn wanted_effects(set: &MeasuredSet, request: &PlanRequest<'_>) -> Result<Vec<Box<dyn Effect>>> {
    let mut effects = all_effects(set);
    check_effects(&effects, &request.only)?;
    if !request.only.is_empty() {
        effects.retain(|e| request.only.contains(&e.name()));
    }
    Ok(effects)
}

fn place(measurement: &metalith_calibrate::Measurement) -> Place {
    Place {
        element: measurement.element.into(),
        led: measurement.led.into(),
        aoi_rad: measurement.aoi_rad,
        distance_um: measurement.distance_um,
    }
}

/// The session of the measurements that were chosen, and the widths by SEM that are offered.
fn chosen_set(
    candidates: &Candidates,
    bench: &BenchFile,
    information: &Information,
    picked: &[ChosenMeasurement],
) -> MeasuredSet {
    let mut set = candidates.set.clone();
    set.measurements = picked
        .iter()
        .map(|p| {
            let mut measurement = information.measurements[p.candidate].measurement.clone();
            measurement.frames = p.frames;
            measurement
        })
        .collect();
    if let Some(offer) = bench.sem {
        set.sem = sem_sites(&set, offer);
    }
    set
}

fn planned(measurement: &metalith_calibrate::Measurement, set: &MeasuredSet, bench: &BenchFile) -> PlannedMeasurement {
    PlannedMeasurement {
        file: files::frame_file(&measurement.name, bench),
        element: set.elements[measurement.element].index,
        led_nm: set.leds[measurement.led].centre_nm,
        aoi_deg: measurement.aoi_rad.map(|a| (a.to_degrees() * 1e4).round() / 1e4),
        distance_um: measurement.distance_um,
        window_centre_um: measurement.window_centre_um,
        frames: measurement.frames,
        scale_dn: measurement.scale_dn,
        brightest_dn: f64::from(measurement.dn.iter().copied().fold(0.0, f32::max)),
    }
}
