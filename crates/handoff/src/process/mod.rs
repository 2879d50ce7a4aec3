//! The process file: everything about a lab that a hand-off needs and a design does not know.

mod read;

use std::path::{Path, PathBuf};

use serde::Serialize;

use metalith_core::Result;
use metalith_core::document::load;
use metalith_drc::Deck;

/// The process that ships with the program, and the name of its file.
const STANDARD: (&str, &str) = (
    "processes/jbx6300_zep520a.toml",
    include_str!("../../../../processes/jbx6300_zep520a.toml"),
);

/// Doses of a matrix: three by three blocks.
pub(super) const DOSES: usize = 9;

/// One lab's way to make the chip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    pub name: String,
    /// One line of description.
    pub title: String,
    pub writer: Writer,
    pub resist: Resist,
    pub transfer: PatternTransfer,
    pub proximity: Proximity,
    pub apertures: ApertureStep,
    pub dose_matrix: DoseMatrixSpec,
    pub tests: TestSpec,
    pub metrology: MetrologySpec,
    pub checks: CheckSpec,
    pub job: JobSpec,
    #[serde(skip)]
    path: PathBuf,
    #[serde(skip)]
    text: String,
    /// Whether it is the program's own, and so are its decks.
    #[serde(skip)]
    standard: bool,
}

/// The electron-beam writer of the first step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Writer {
    pub name: String,
    pub acceleration_kv: f64,
    /// Name of the lens mode.
    pub mode: String,
    /// Largest edge of a write field (um).
    pub field_um: f64,
    /// Edge of a write field as used (um), so that its border runs between pillars.
    pub field_used_um: f64,
    /// Grid that figures are placed on (nm).
    pub grid_nm: f64,
    /// Fastest shot rate (MHz).
    pub clock_max_mhz: f64,
    /// Beam currents to choose from (nA).
    pub currents_na: Vec<f64>,
    /// Error between neighbouring fields, in use (nm).
    pub stitching_nm: f64,
    /// Time lost at each figure (us), at each field (s), and once (s).
    pub shape_overhead_us: f64,
    pub field_overhead_s: f64,
    pub job_overhead_s: f64,
}

/// Whether the exposed resist goes or stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    Positive,
    Negative,
}

/// The resist of the first step and its dose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Resist {
    pub name: String,
    pub tone: Tone,
    pub thickness_nm: f64,
    pub developer: String,
    /// Charge an area (uC/cm2), and the range that labs report.
    pub dose_uc_cm2: f64,
    pub dose_range_uc_cm2: [f64; 2],
}

/// How the pattern gets from resist to film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Mask material stays where the resist was opened.
    LiftOff,
    /// The film goes where the resist was opened.
    DirectEtch,
}

/// Pattern transfer from the resist into the film.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PatternTransfer {
    pub method: Method,
    pub mask: String,
    pub mask_thickness_nm: f64,
    pub etch: String,
    /// Films that this etch is for, by the names that designs give to the material of their pillars.
    pub films: Vec<String>,
}

/// Backscatter of electrons: range (um) and ratio to the direct dose, with their uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proximity {
    pub range_um: f64,
    pub range_limits_um: [f64; 2],
    pub ratio: f64,
    pub ratio_limits: [f64; 2],
    pub source: String,
}

/// The second step: openings in the metal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ApertureStep {
    pub writer: String,
    pub tone: String,
    pub resist: String,
    pub metal: String,
    pub metal_thickness_nm: f64,
    pub overlay_nm: f64,
    pub max_references: i64,
}

/// Nine blocks of equal geometry and different dose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DoseMatrixSpec {
    /// Doses as shares of that of the resist.
    pub factors: [f64; DOSES],
    /// Layer of the blocks; the datatype is the number of the dose, from one.
    pub layer: i16,
    pub lens_diameter_um: f64,
    pub pad_um: f64,
    pub pad_widths_nm: Vec<f64>,
    pub gap_um: f64,
}

/// Sizes of the test structures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestSpec {
    pub pad_um: f64,
    pub pad_width_step_nm: f64,
    pub sparse_pitches: i64,
    pub cd_widths_nm: Vec<f64>,
    pub cd_length_um: f64,
    pub vernier_pitch_um: f64,
    pub vernier_step_nm: f64,
    pub overlay_vernier_pitch_um: f64,
    pub overlay_vernier_step_nm: f64,
    pub etch_pad_um: f64,
    pub film_witness_um: f64,
    pub reference_wavelength_nm: f64,
}

/// Where widths are to be measured, and how well they should fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetrologySpec {
    pub sites_per_width: i64,
    /// Standard deviation of the width in this process (nm).
    pub width_tolerance_nm: f64,
}

/// The decks of rules that layouts for this process must keep: their files, or those of the program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckSpec {
    #[serde(skip)]
    pub pillar_rules: PathBuf,
    #[serde(skip)]
    pub aperture_rules: PathBuf,
    #[serde(skip)]
    pub dose_rules: PathBuf,
    #[serde(skip)]
    pub test_rules: PathBuf,
    #[serde(skip)]
    pub test_opening_rules: PathBuf,
}

/// Values of the draft job that the staff must confirm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobSpec {
    pub substrate_inch: f64,
    pub cassette_slot: String,
    pub path: String,
    pub layer_step1: i64,
}

impl CheckSpec {
    /// The decks of rules, each once.
    pub(super) fn decks(&self) -> [&Path; 5] {
        [
            &self.pillar_rules,
            &self.aperture_rules,
            &self.dose_rules,
            &self.test_rules,
            &self.test_opening_rules,
        ]
    }
}

impl Process {
    /// Read the process file at `path`.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every mistake, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, load(path)?)
    }

    /// The process that ships with the program, `processes/jbx6300_zep520a.toml`, with the decks that do.
    ///
    /// # Panics
    /// Never: it is tested.
    pub fn standard() -> Self {
        let (name, text) = STANDARD;
        read::process(Path::new(name), text.to_owned(), true).expect("the process of the program is sound")
    }

    pub(super) fn parse(path: &Path, text: String) -> Result<Self> {
        read::process(path, text, false)
    }

    /// Name and text of the file that it was read from.
    pub(super) fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    /// A deck of [`CheckSpec`].
    ///
    /// # Errors
    /// With every mistake of the file.
    pub(super) fn deck(&self, rules: &Path) -> Result<Deck> {
        if self.standard {
            Ok(Deck::shipped(rules).expect("tested with the process of the program"))
        } else {
            Deck::read(rules)
        }
    }

    /// Description of what remains on the chip where the first step exposes.
    pub fn exposed_becomes(&self) -> &'static str {
        match (self.resist.tone, self.transfer.method) {
            (Tone::Positive, Method::LiftOff) | (Tone::Negative, Method::DirectEtch) => {
                "what is exposed stays as a pillar"
            }
            _ => "what is exposed is etched away",
        }
    }

    /// Whether the first step exposes the pillars; if not, the tone of the layout is wrong.
    pub fn exposes_pillars(&self) -> bool {
        self.exposed_becomes().ends_with("pillar")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_process_is_read_and_exposes_pillars() {
        let process = Process::standard();
        for rules in process.checks.decks() {
            // The same deck, built in and from its file.
            let name = |deck: Deck| deck.name;
            let file = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../../rules")
                .join(rules.file_name().unwrap());
            assert_eq!(name(process.deck(rules).unwrap()), name(Deck::read(&file).unwrap()));
        }
        assert_eq!(process.resist.dose_uc_cm2, 280.0);
        assert!(process.exposes_pillars());
    }

    #[test]
    fn all_mistakes_are_reported_at_once_with_their_places() {
        let text = STANDARD
            .1
            .replace("tone = \"positive\"", "tone = \"possitive\"")
            .replace("field_used_um = 499.8", "field_used_um = 600")
            .replace("dose_uc_cm2 = 280", "dose = 280");
        let error = Process::parse(Path::new("processes/p.toml"), text)
            .unwrap_err()
            .to_string();
        for said in [
            "possitive",
            "larger than the field",
            "dose_uc_cm2",
            "unknown key `dose`",
        ] {
            assert!(error.contains(said), "{said} not in {error}");
        }
    }
}
