//! The calibrated model as a file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Perturbation, PerturbationFault};
use metalith_cell::CellStack;
use metalith_core::document::{self, Fault, FaultKind, Faults};
use metalith_core::file::check_unaltered;
use metalith_core::text::quoted;
use metalith_core::{AtomicFile, Error, Result};
use metalith_pillars::PillarId;

/// Version of the format that is written. The first called its perturbation `departure`; it is still read.
const SCHEMA: u32 = 2;

/// Keys of a perturbation that have another name now: section, old key, new key.
const RENAMED: [(&str, &str, &str); 1] = [("path", "gap_um", "defocus_um")];

/// The old keys of a model, each with what is wrong and what to write.
fn old_keys(text: &str) -> Vec<(String, String, String)> {
    let Ok(model) = text.parse::<toml::Table>() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for perturbation in ["perturbation", "departure"] {
        for (section, old, new) in RENAMED {
            let own = model
                .get(perturbation)
                .and_then(|p| p.get(section))
                .and_then(|s| s.get(old));
            if own.is_some() {
                let (what, hint) = document::renamed(old, new);
                found.push((format!("{perturbation}.{section}.{old}"), what, hint));
            }
        }
    }
    found
}

/// Model that a session has calibrated, in a file that later designs are simulated and compensated with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedModel {
    schema: u32,
    /// The session that it comes from.
    pub set: String,
    /// Finding of the calibration, in words.
    pub finding: String,
    /// Differences of chips and bench from what is stated.
    #[serde(alias = "departure")]
    pub perturbation: Perturbation,
    /// Change of widths with dose, where it was measured. Simulations are of the dose that the perturbation holds at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dose: Option<DoseResponse>,
}

/// Change of widths with the dose of the writer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoseResponse {
    /// Added to a width for each per cent of dose (nm).
    pub nm_per_percent: f64,
    /// Least and greatest change of dose that was measured (%).
    pub measured_percent: [f64; 2],
}

impl DoseResponse {
    /// Every number that cannot be, by its key with what is wrong and what to write.
    fn faults(&self) -> Vec<(String, String, String)> {
        let slope = (self.nm_per_percent.abs() <= MOST_NM_PER_PERCENT).then_some(());
        let [low, high] = self.measured_percent;
        let range = (-100.0 < low && low <= high && high <= MOST_PERCENT).then_some(());
        let fault = |key: &str, hint: String| (format!("dose.{key}"), format!("`{key}` cannot be this"), hint);
        let wrong = [
            slope.is_none().then(|| {
                let most = MOST_NM_PER_PERCENT;
                fault("nm_per_percent", format!("it must be a number from -{most} to {most}"))
            }),
            range.is_none().then(|| {
                let hint = format!("give the least and the greatest change, from above -100 to {MOST_PERCENT}");
                fault("measured_percent", hint)
            }),
        ];
        wrong.into_iter().flatten().collect()
    }
}

/// Steepest change of a width with dose (nm for a per cent), several times what any resist has.
const MOST_NM_PER_PERCENT: f64 = 100.0;

/// Greatest change of dose that is measured (%).
const MOST_PERCENT: f64 = 1000.0;

impl CalibratedModel {
    /// A model of what was found.
    pub fn new(set: String, finding: String, perturbation: Perturbation) -> Self {
        Self {
            schema: SCHEMA,
            set,
            finding,
            perturbation,
            dose: None,
        }
    }

    /// Succeeds if pillars of a stack that are drawn so often, by width or number, on each of some elements can be as
    /// the model says.
    ///
    /// # Errors
    /// If the bias of all widths leaves nothing of the narrowest that is drawn, or joins the widest.
    pub fn check_drawn(&self, stack: &CellStack, counts: impl IntoIterator<Item = Vec<u64>>) -> Result<()> {
        let drawn = |counts: Vec<u64>| (1..counts.len()).filter(move |number| counts[*number] > 0);
        let numbers = counts.into_iter().flat_map(drawn);
        let edges = numbers.flat_map(|number| stack.shape.edges_nm(PillarId(number as u16)).map(f64::from));
        let [least, most] = edges.fold([f64::INFINITY, 0.0], |[least, most], nm| [nm.min(least), nm.max(most)]);
        if most > 0.0 {
            self.check_bias([least, most], stack.lattice.nearest_nm(stack.pitch_nm))
        } else {
            Ok(())
        }
    }

    /// Check of pillars whose edges are drawn from the one to the other of these (nm), `nearest_nm` from middle to
    /// middle.
    fn check_bias(&self, edges_nm: [f64; 2], nearest_nm: f64) -> Result<()> {
        let bias_nm = self.perturbation.geometry.cd_bias_nm;
        let [narrowest, widest] = edges_nm.map(|nm| nm + bias_nm);
        if narrowest > 0.0 && widest < nearest_nm {
            return Ok(());
        }
        let what = if narrowest > 0.0 {
            format!("makes pillars of {widest} nm, {nearest_nm} nm from one to the next")
        } else {
            format!("leaves nothing of pillars drawn {} nm wide", edges_nm[0])
        };
        Err(Error::refused(
            "model/bias-out-of-range",
            format!("`cd_bias_nm` = {bias_nm} of the model {what}"),
            format!(
                "set it in [perturbation.geometry] between {} and {}",
                -edges_nm[0],
                nearest_nm - edges_nm[1]
            ),
        ))
    }

    /// Read a model file.
    ///
    /// # Errors
    /// If it cannot be read, or is not the one that its calibration wrote; as [`CalibratedModel::parse`].
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with_text(path).map(|(model, _)| model)
    }

    /// Variant of [`CalibratedModel::read`] that returns the text too.
    ///
    /// # Errors
    /// As [`CalibratedModel::read`].
    pub fn read_with_text(path: &Path) -> Result<(Self, String)> {
        check_unaltered(path)?;
        let text = document::load(path)?;
        Self::parse(path, &text).map(|model| (model, text))
    }

    /// A model from the text of the file at `path`.
    ///
    /// # Errors
    /// If it is not such a file; all numbers that cannot be at once.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let written = "give the `model.toml` that `metalith calibrate` has written";
        let old = old_keys(text);
        if !old.is_empty() {
            return Err(Error::Text(Box::new(Faults::at_keys(path, text, old))));
        }
        let model: Self = toml::from_str(text).map_err(|e| {
            let fault = Fault {
                kind: FaultKind::Inconsistent,
                key: String::new(),
                span: e.span().unwrap_or(0..0),
                what: quoted(e.message()),
                hint: written.into(),
            };
            Error::Text(Box::new(Faults::new(path, text, vec![fault], 1)))
        })?;
        if !(1..=SCHEMA).contains(&model.schema) {
            let what = format!("this is a model of schema {}, 1 to {SCHEMA} are known", model.schema);
            return Err(Error::Text(Box::new(Faults::at_keys(
                path,
                text,
                vec![("schema".into(), what, written.into())],
            ))));
        }
        let faults = model.perturbation.faults();
        let dose = model.dose.map_or_else(Vec::new, |dose| dose.faults());
        if !(faults.is_empty() && dose.is_empty()) {
            let section = if text.contains("[perturbation") {
                "perturbation"
            } else {
                "departure"
            };
            let placed = |fault: PerturbationFault| (format!("{section}.{}", fault.key), fault.what, fault.hint);
            let faults = faults.into_iter().map(placed).chain(dose).collect();
            return Err(Error::Text(Box::new(Faults::at_keys(path, text, faults))));
        }
        Ok(Self {
            schema: SCHEMA,
            ..model
        })
    }

    /// Write it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = toml::to_string(self).expect("plain data serialises");
        AtomicFile::write(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> CalibratedModel {
        let mut perturbation = Perturbation::default();
        perturbation.geometry.cd_bias_nm = -9.75;
        *perturbation.light.shift_mut(1) = 0.5;
        CalibratedModel::new("chip".into(), "explained by cd_bias".into(), perturbation)
    }

    #[test]
    fn an_old_key_is_refused_with_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        model().write(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let old = text.replace("defocus_um", "gap_um");
        let Err(Error::Text(faults)) = CalibratedModel::parse(&path, &old) else {
            panic!("the old key is read")
        };
        let [fault] = faults.faults() else { panic!("{faults}") };
        assert_eq!(fault.hint, "write `defocus_um`");
        assert!(
            old[fault.span.clone()].contains("0.0") || old[fault.span.clone()].contains("gap_um"),
            "{faults}"
        );
    }

    #[test]
    fn a_model_file_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        model().write(&path).unwrap();
        assert_eq!(CalibratedModel::read(&path).unwrap(), model());
        let mut graded = model();
        graded.perturbation.geometry.cd_bias_density_range_um = Some(12.5);
        graded.dose = Some(DoseResponse {
            nm_per_percent: 0.8,
            measured_percent: [-20.0, 20.0],
        });
        graded.write(&path).unwrap();
        assert_eq!(CalibratedModel::read(&path).unwrap(), graded);
        let text = std::fs::read_to_string(&path).unwrap();
        let wrong = text.replace("= 12.5", "= 0.0").replace("= 0.8", "= nan");
        let Err(Error::Text(faults)) = CalibratedModel::parse(&path, &wrong) else {
            panic!("numbers that cannot be are read")
        };
        let keys: Vec<&str> = faults.faults().iter().map(|f| &*f.key).collect();
        assert_eq!(
            keys,
            ["perturbation.geometry.cd_bias_density_range_um", "dose.nm_per_percent"]
        );
        std::fs::write(&path, "schema = 7").unwrap();
        let Error::Text(faults) = CalibratedModel::read(&path).unwrap_err() else {
            panic!("a mistake of the text is one at a place");
        };
        // A schema that is not known would be a mistake at its key.
        let fault = &faults.faults()[0];
        assert_eq!(faults.line_column(fault.span.start), (1, 1));
        assert_eq!((fault.kind, &*fault.key), (FaultKind::Inconsistent, ""));
    }

    #[test]
    fn a_bias_that_pillars_cannot_have_is_refused_with_what_they_can() {
        let biased = |nm| {
            let mut model = model();
            model.perturbation.geometry.cd_bias_nm = nm;
            model.check_bias([100.0, 280.0], 350.0)
        };
        for nm in [-99.9, 0.0, 69.9] {
            biased(nm).unwrap();
        }
        let errors = [-100.0, 70.0].map(|nm| biased(nm).unwrap_err());
        assert!(errors.iter().all(|error| error.id() == "model/bias-out-of-range"));
        insta::assert_snapshot!(errors[0], @"
        `cd_bias_nm` = -100 of the model leaves nothing of pillars drawn 100 nm wide
          help: set it in [perturbation.geometry] between -100 and 70
        ");
        insta::assert_snapshot!(errors[1], @"
        `cd_bias_nm` = 70 of the model makes pillars of 350 nm, 350 nm from one to the next
          help: set it in [perturbation.geometry] between -100 and 70
        ");
    }

    #[test]
    fn a_file_of_the_first_schema_is_read_and_a_number_that_cannot_be_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        model().write(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text
            .replace("schema = 2", "schema = 1")
            .replace("[perturbation", "[departure");
        assert!(first.contains("[departure.geometry]"), "{first}");
        std::fs::write(&path, first).unwrap();
        assert_eq!(CalibratedModel::read(&path).unwrap(), model());
        let wrong = text
            .replace("stray_light = 0.0", "stray_light = 7.0")
            .replace("missing_pillars = 0.0", "missing_pillars = nan");
        std::fs::write(&path, &wrong).unwrap();
        let error = CalibratedModel::read(&path).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let Error::Text(faults) = error else { panic!("{error}") };
        for key in ["stray_light", "missing_pillars"] {
            let line = wrong.lines().position(|line| line.starts_with(key)).unwrap();
            let fault = faults.faults().iter().find(|fault| fault.key.ends_with(key)).unwrap();
            let place = faults.line_column(fault.span.start);
            assert_eq!(place, (line + 1, key.len() + 4), "{faults}");
        }
    }
}
